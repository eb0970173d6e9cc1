"""Scenes of joints that hold at hidden poses, and their violation by frames in the world alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm

__all__ = ["JOINTS", "Hidden"]

Array = NDArray[np.float64]
# What the rows of each say, in words of frames: origins meet, lie on the axis or at its height; axes; no turn.
JOINTS = {
    asm.Fixed: ("origin", "axis", "turn"),
    asm.Revolute: ("origin", "axis"),
    asm.Prismatic: ("on axis", "axis", "turn"),
    asm.Cylindrical: ("on axis", "axis"),
    asm.Planar: ("height", "axis"),
    asm.Spherical: ("origin",),
    asm.Universal: ("origin", "square"),
}


def random_pose(rng: np.random.Generator, spread: float = 1.5) -> asm.Pose:
    e = rng.normal(size=4)
    return asm.Pose(spread * rng.normal(size=3), e / np.linalg.norm(e))


def random_frames(rng: np.random.Generator, pose_a: asm.Pose, pose_b: asm.Pose) -> list[tuple[Array, Array]]:
    """Two frames that are one in the world, seen from each body: origin and axes."""
    at, turn = rng.normal(size=3), Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    found = []
    for pose in (pose_a, pose_b):
        back = pose.matrix[:3, :3].T
        found.append((back @ (at - pose.position), back @ turn))
    return found


class Hidden:
    """A scene with joints that hold at hidden poses, and starts a little off them.

    Parameters
    ----------
    seed, bodies, joints
        The first body is fixed; the first joints make a tree, further ones loops and doubles.
    off : float
        How far starts are off, in lengths and radians.
    spoil : float
        The last joint's frame is moved by it, so that it may not fit.
    kinds : classes of joints
        To choose from.
    """

    def __init__(
        self,
        seed: int | Sequence[int],
        bodies: int,
        joints: int,
        off: float = 0.2,
        spoil: float = 0.0,
        kinds: Sequence[Any] = tuple(JOINTS),
    ) -> None:
        rng = np.random.default_rng(seed)
        self.poses = [random_pose(rng) for _ in range(bodies)]
        self.bodies: list[asm.Body] = []
        for k, pose in enumerate(self.poses):
            turn = Rotation.from_rotvec(off * rng.normal(size=3)) * Rotation.from_matrix(pose.matrix[:3, :3])
            start = pose.position + off * rng.normal(size=3), turn.as_quat(scalar_first=True)
            if k == 0:
                start = pose.position, pose.quaternion
            self.bodies.append(asm.Body(f"body {k}", None, *start, fixed=k == 0))
        self.scene = asm.Assembly(self.bodies)
        self.joints: list[tuple[Any, int, int, Any, Any]] = []
        for k in range(joints):
            # A tree first, so that everything hangs together; then loops and doubles, which are redundant or close.
            j = k + 1 if k + 1 < bodies else int(rng.integers(1, bodies))
            i = int(rng.integers(0, j))
            kind = kinds[int(rng.integers(len(kinds)))]
            (at_a, axes_a), (at_b, axes_b) = random_frames(rng, self.poses[i], self.poses[j])
            if spoil > 0.0 and k == joints - 1:
                at_b = at_b + spoil * axes_b[:, 2] + spoil * axes_b[:, 0]
            z = axes_b[:, 0] if kind is asm.Universal else axes_b[:, 2]
            x = axes_b[:, 1] if kind is asm.Universal else axes_b[:, 0]
            a = self.bodies[i].frame(at_a, axes_a[:, 2], axes_a[:, 0])
            b = self.bodies[j].frame(at_b, z, x)
            self.joints.append((kind, i, j, (at_a, axes_a[:, 2], axes_a[:, 0]), (at_b, z, x)))
            self.scene.constrain(kind(a, b, f"joint {k}"))

    def violation(self, q: Array) -> float:
        """The worst of all joints at q, by frames in the world alone."""
        worst = 0.0
        for kind, i, j, one, other in self.joints:
            (a, za, xa), (b, zb, xb) = (self._in_world(q[k], frame) for k, frame in ((i, one), (j, other)))
            d = b - a
            off = {
                "origin": np.abs(d).max(),
                "on axis": np.linalg.norm(d - (d @ za) * za),
                "height": abs(d @ za),
                "axis": np.linalg.norm(np.cross(za, zb)) + (za @ zb < 0.0),
                "turn": np.linalg.norm(np.cross(xa, xb)) + (xa @ xb < 0.0),
                "square": abs(za @ zb),
            }
            worst = max(worst, *(off[word] for word in JOINTS[kind]))
        return float(worst)

    @staticmethod
    def _in_world(row: Array, frame: Any) -> tuple[Array, Array, Array]:
        turn = Rotation.from_quat(row[3:], scalar_first=True)
        at, z, x = frame
        return row[:3] + turn.apply(at), turn.apply(z), turn.apply(x)
