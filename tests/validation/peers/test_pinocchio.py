"""Pinocchio reads the same robots: places of links at random values of joints."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from tests.files.robots import ARM

pin = pytest.importorskip("pinocchio")
# To 1e-12 of a robot of 1,000 mm, and as much by products of matrices.
CLOSE = 1e-9


def test_forward_kinematics(tmp_path):
    # It has no mimics in its default model: the follower's value is given.
    given = tmp_path / "arm.urdf"
    given.write_text(ARM)
    again = tmp_path / "again.urdf"
    robot = asm.read_urdf(given)
    asm.write_urdf(again, robot)
    rng = np.random.default_rng(13)
    for path in (given, again):
        model = pin.buildModelFromUrdf(str(path))
        data = model.createData()
        for _ in range(10):
            values = {"shoulder": rng.uniform(-2, 2.5), "elbow": rng.uniform(-3, 3), "grip": rng.uniform(0, 0.1)}
            for name, value in values.items():
                joint = robot.joint(name)
                if isinstance(joint, asm.Prismatic):
                    joint.slide = 1000.0 * value
                else:
                    joint.angle = value
            solution = robot.assembly().solve()
            q = pin.neutral(model)
            values["roll"] = 0.1 - 0.5 * values["elbow"]
            for name, value in values.items():
                if not model.existJointName(name):
                    continue
                joint = model.joints[model.getJointId(name)]
                own = [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
                q[joint.idx_q : joint.idx_q + joint.nq] = own
            pin.framesForwardKinematics(model, data, q)
            for body in robot.bodies:
                place = data.oMf[model.getFrameId(body.name, pin.FrameType.BODY)]
                found = solution.pose(body).matrix
                np.testing.assert_allclose(found[:3, 3], 1000.0 * place.translation, rtol=0, atol=CLOSE)
                np.testing.assert_allclose(found[:3, :3], place.rotation, rtol=0, atol=CLOSE)
