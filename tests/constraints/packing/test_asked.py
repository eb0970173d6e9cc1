"""What is asked for between two solves: the ends as they are, and halves that bisect lines and turns."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.packing.asked import asked_between, asked_change


def turned(angle, at=(0.0, 0.0, 0.0), sign=1.0):
    """A pose turned about an axis that is none of the world's."""
    axis = np.array([0.48, 0.6, 0.64])
    return asm.Pose(at, sign * np.append(np.cos(0.5 * angle), np.sin(0.5 * angle) * axis))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.7, 3.1])
def test_between(angle, sign):
    here, there = [0.5, np.zeros(3), turned(0.2)], [-1.5, np.arange(3.0), turned(0.2 + angle, (1.0, 2.0, 4.0), sign)]
    for part in (0.0, 0.25, 0.5, 1.0):
        number, point, pose = asked_between(here, there, part)
        expected = turned(0.2 + part * angle)
        assert number == 0.5 - 2.0 * part and point.tolist() == [0.0, part, 2.0 * part]
        assert pose.position.tolist() == [part, 2.0 * part, 4.0 * part]
        assert abs(pose.quaternion @ expected.quaternion) == pytest.approx(1.0, abs=1e-15)
        assert np.abs(np.cross(pose.quaternion[1:], expected.quaternion[1:])).max() < 1e-15
    # Lengths are counted in the scene's size.
    assert asked_change(here[:1], there[:1], [4.0]) == 0.5
    assert asked_change(here[1:2], there[1:2], [np.sqrt(5.0)]) == pytest.approx(1.0, abs=1e-15)
    assert asked_change(here[2:], there[2:], [1.0]) == pytest.approx(angle, abs=1e-15)


def test_the_other_way_around_is_shorter():
    (pose,) = asked_between([turned(0.0)], [turned(1.5 * np.pi)], 0.5)
    assert abs(pose.quaternion @ turned(-0.25 * np.pi).quaternion) == pytest.approx(1.0, abs=1e-15)


def test_solutions_know_what_they_were_asked_for():
    """In the order of the packed scene, also after all of it is another one; and it is asked for again as it was."""
    base, body, other = asm.Body("base", fixed=True), asm.Body("body"), asm.Body("other", position=(2.0, 0.0, 0.0))
    joint = asm.Cylindrical(base.frame(), body.frame(), "joint", angle=0.3, slide_limits=(-1.0, 1.0))
    plane = asm.PointOnPlane(other.point(0, 0, 0), base.frame(), offset=0.25)
    point, frame = asm.PointDistance(body.point(1, 0, 0), (1.0, 0.0, 0.5)), asm.FrameDistance(other, turned(0.4))
    scene = asm.Assembly([base, body, other])
    scene.constrain(joint, plane)
    scene.minimize(point, frame)
    first = scene.solve()
    joint.angle, plane.offset, point.target, frame.target = 0.5, 0.5, (2.0, 0.0, 0.5), turned(0.6)
    joint.slide_limits = (-2.0, 3.0)
    second = scene.solve(first)
    assert first.success and second.success
    numbers = [value for value in first._asked if isinstance(value, float)]
    assert sorted(numbers) == [-1.0, -1.0, 0.25, 0.3]
    scene.packed().ask_for(first._asked)
    assert (joint.angle, plane.offset, joint.slide_limits) == (0.3, 0.25, (-1.0, 1.0))
    assert point.target.tolist() == [1.0, 0.0, 0.5] and frame.target.q.tolist() == turned(0.4).q.tolist()
    assert scene.solve(first).q == pytest.approx(first.q, abs=1e-12)
    scene.packed().ask_for(second._asked)
    assert (joint.angle, plane.offset, joint.slide_limits) == (0.5, 0.5, (-2.0, 3.0))


def test_a_solution_is_as_exact_as_it_was_whatever_is_asked_for_since():
    base, arm = asm.Body("base", fixed=True), asm.Body("arm")
    drive = asm.Revolute(base.frame(), arm.frame(at=(-1.0, 0.0, 0.0)), "drive", angle=0.2)
    scene = asm.Assembly([base, arm])
    scene.constrain(drive)
    first = scene.solve()
    drive.angle = 1.4
    second = scene.solve(first)
    assert max(first.pose_error, second.pose_error) < 1e-12
