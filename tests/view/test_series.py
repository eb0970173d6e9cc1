"""Trajectories as they may be given, and what changes over them."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.proximity.extrema.pairs import ContactPair, PairStatus
from assembly.view.series import contact_series, ellipsoid_series, poses_at, stills, trajectory_rows

RNG = np.random.default_rng(2)
TIMES = np.array([0.0, 0.5, 1.0, 1.25, 2.0])


def test_trajectories_may_be_arrays_lists_and_iterators(balls, rolling):
    for given in (rolling, rolling.tolist(), list(rolling), iter(rolling)):
        rows, solutions = trajectory_rows(balls, given)
        # Quaternions of cosines and sines are unit but for rounding.
        assert rows == pytest.approx(rolling, abs=1e-15)
        assert solutions == []


def test_a_trajectory_of_solutions(balls):
    first = balls.solve()
    balls.objectives[0][1].target = (5.0, 1.0, 1.0)
    second = balls.solve(first)
    rows, solutions = trajectory_rows(balls, (solution for solution in (first, second)))
    assert (rows == [first.q, second.q]).all()
    assert solutions == [first, second]


def test_poses_at_frames_and_between(rolling):
    rows = poses_at(rolling, np.array([0.0, 3.0, 3.5, 12.0]))
    assert rows[[0, 1, 3]] == pytest.approx(rolling[[0, 3, 12]], abs=1e-15)
    # On the circle that the blue ball goes.
    angle = 3.5 / 12.0 * 0.5 * np.pi
    assert rows[2, 2, :3] == pytest.approx([2.3 + 2.5 * np.cos(angle), 2.5 * np.sin(angle), 0.0], abs=1e-14)


@pytest.mark.parametrize(
    ("change", "kind", "message"),
    [
        (lambda q, s: q[:, :2], InputError, r"trajectory has shape \(13, 2, 7\); expected \(frames, 3, 7\)"),
        (lambda q, s: q[0], InputError, r"trajectory has shape \(3, 7\); expected \(frames, 3, 7\)"),
        (lambda q, s: q[:1], InputError, "trajectory has 1 frame; expected two at least"),
        (lambda q, s: [], InputError, r"trajectory has shape \(0,\); expected \(frames, 3, 7\)"),
        (lambda q, s: q * np.where(np.arange(13) == 4, np.nan, 1)[:, None, None], InputError, r"\[4, 0, 0\] is nan"),
        (lambda q, s: 2.0 * q, InputError, r"trajectory\[0\]\[0, 3:\] is .*; expected a unit quaternion"),
        (lambda q, s: "poses", InputError, "trajectory is 'poses'; expected real numbers"),
        (lambda q, s: None, InputError, "trajectory is None; expected real numbers"),
        (lambda q, s: s, TypeError, r"trajectory is one Solution; expected a sequence of them, or poses"),
        (lambda q, s: [s], InputError, "trajectory has 1 frame; expected two at least"),
        (lambda q, s: [s, q[0]], TypeError, r"trajectory\[1\] is of type ndarray; expected a Solution, as others"),
        (lambda q, s: [q[0], s], TypeError, r"trajectory\[0\] is of type ndarray; expected a Solution, as others"),
    ],
)
def test_bad_trajectories(balls, rolling, change, kind, message):
    with pytest.raises(kind, match=message):
        trajectory_rows(balls, change(rolling, balls.solve()))


def test_a_solution_of_another_scene(balls):
    other = asm.Assembly([asm.Body("elsewhere", asm.shapes.sphere(1.0))])
    message = "trajectory[0] is a solution of another scene: body is Body('elsewhere', 1 faces)"
    with pytest.raises(InputError, match=re.escape(message)):
        trajectory_rows(other, [balls.solve()] * 2)


def pair(x, gap=0.0):
    points = np.array([[x, 0.0, 0.0], [x + gap, 0.0, 0.0]])
    return ContactPair(np.zeros(4), points, np.array([1.0, 0.0, 0.0]), gap, PairStatus.CONVERGED)


def test_contacts_that_come_and_go():
    frames = [{"a": pair(0.0), "b": pair(np.nan)}, {"a": pair(1.0, -0.5)}, {"a": pair(np.nan), "c": pair(7.0)}]
    found = {series.name: series for series in contact_series([SimpleNamespace(contacts=f) for f in frames], TIMES)}
    # No pair at all: nothing to show.
    assert set(found) == {"a", "c"}
    # These numbers are exact in binary.
    assert found["a"].points[:, 0, 0].tolist() == [0.0, 0.5, 1.0, 1.0, 1.0]
    assert found["a"].points[:, 1, 0].tolist() == [0.0, 0.25, 0.5, 0.5, 0.5]
    assert found["a"].gaps.tolist() == [0.0, -0.25, -0.5, -0.5, -0.5]
    assert found["a"].shown.tolist() == [1.0, 1.0, 1.0, 0.75, 0.0]
    assert found["c"].shown.tolist() == [0.0, 0.0, 0.0, 0.25, 1.0]
    assert (found["c"].points[:, 0, 0] == 7.0).all() and (found["c"].normals == [1.0, 0.0, 0.0]).all()


def body_of(axes, lengths):
    """The matrix of the solid, which does not know how its axes are named."""
    return axes @ np.diag(lengths**2) @ axes.T


def test_axes_of_an_ellipsoid_keep_their_names():
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    frames = []
    for k in range(40):
        axes = np.linalg.qr(RNG.normal(size=(3, 3)))[0] if k == 0 else frames[0].axes
        turned = asm.Pose.from_axis_angle(axis, 0.05 * k).matrix[:3, :3] @ axes
        # Lengths cross one another; axes come in any order and of either sign, as eigenvectors do.
        lengths = np.array([1.0 + 0.1 * k, 3.0 - 0.05 * k, 2.0])
        order, signs = (np.arange(3), 1.0) if k == 0 else (RNG.permutation(3), RNG.choice([-1.0, 1.0], 3))
        frames.append(Ellipsoid((k, 0, 0), turned[:, order] * signs, lengths[order], (1, 0, 0)))
    times = np.linspace(0.0, 39.0, 79)
    (series,) = ellipsoid_series(frames, 40, times)
    assert series.color == (1.0, 0.0, 0.0)
    assert series.centers[:, 0] == pytest.approx(times, abs=1e-13)
    for k, shape in enumerate(frames):
        found = body_of(series.axes[2 * k], series.lengths[2 * k])
        # Squares up to 25 after two rotations.
        assert found == pytest.approx(body_of(shape.axes, shape.lengths), abs=1e-12)
    assert np.linalg.det(series.axes) == pytest.approx(1.0, abs=1e-13)
    # Half a step is a turn by 0.025.
    steps = np.swapaxes(series.axes[:-1], 1, 2) @ series.axes[1:]
    assert np.arccos(0.5 * (np.einsum("kii->k", steps) - 1.0)) == pytest.approx(0.025, abs=1e-9)
    assert np.ptp(np.diff(series.lengths, axis=0), axis=0).max() < 1e-13


def test_ellipsoids_that_stay():
    one, other = Ellipsoid((0, 0, 0), np.eye(3), (1, 2, 3)), Ellipsoid((1, 0, 0), np.eye(3), (1, 0, 0))
    assert len(stills(one)) == len(ellipsoid_series(one, 5, TIMES)) == 1
    assert [shape.lengths.tolist() for shape in stills(iter([one, other]))] == [[[1, 2, 3]], [[1, 0, 0]]]
    assert stills(()) == ellipsoid_series((), 5, TIMES) == []
    series = ellipsoid_series([[one, other], (other, other), iter([one, one])], 3, TIMES)
    assert series[0].lengths.tolist() == [[1, 2, 3], [1, 1, 1.5], [1, 0, 0], [1, 0.5, 0.75], [1, 2, 3]]
    assert series[1].centers[:, 0].tolist() == [1.0, 1.0, 1.0, 0.75, 0.0]
    # A mirrored one is the same solid.
    (flat,) = stills(Ellipsoid((0, 0, 0), np.diag([1.0, 1.0, -1.0]), (1, 2, 3)))
    assert np.linalg.det(flat.axes[0]) == 1.0 and flat.lengths.tolist() == [[1, 2, 3]]


def test_bad_ellipsoids():
    one = Ellipsoid((0, 0, 0), np.eye(3), (1, 2, 3))
    with pytest.raises(TypeError, match="ellipsoids is 3; expected an Ellipsoid or several"):
        stills(3)
    with pytest.raises(TypeError, match=r"ellipsoids\[1\] is 'x'; expected an Ellipsoid"):
        stills([one, "x"])
    with pytest.raises(TypeError, match="ellipsoids is 'x'; expected an Ellipsoid, or one or several for each frame"):
        ellipsoid_series("x", 2, TIMES)
    with pytest.raises(InputError, match="ellipsoids has 2 entries; expected 3, one for each frame, or an Ellipsoid"):
        ellipsoid_series([one, one], 3, TIMES)
    with pytest.raises(InputError, match=r"ellipsoids\[2\] holds 2; expected 1, as in the first frame"):
        ellipsoid_series([one, one, [one, one]], 3, TIMES)
    for wrong in (7, "text", [one, 7]):
        with pytest.raises(TypeError, match=r"ellipsoids\[1\] is .*; expected an Ellipsoid or several"):
            ellipsoid_series([one, wrong, one], 3, TIMES)
