"""Recorded hands: checked when they come in, smooth in between, the same from file to file and from frame to frame."""

from __future__ import annotations

import re

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import multiply, rotate

RNG = np.random.default_rng(5)


def turns(t):
    """Poses (k, 7) along a smooth motion that turns by several turns in ten seconds."""
    rows = []
    for s in np.atleast_1d(t):
        first = asm.Pose.from_axis_angle((1, 2, 2), 1.7 * np.sin(1.3 * s))
        second = asm.Pose.from_axis_angle((2, -1, 2), 1.1 * s + 0.6 * np.cos(2.0 * s))
        rows.append(np.concatenate([(np.sin(s), np.cos(2.0 * s), s), multiply(first.quaternion, second.quaternion)]))
    return np.array(rows)


def angle(e, f):
    """Angles between the turns of unit quaternions (k, 4)."""
    sine, cosine = (np.linalg.norm(e - sign * f, axis=-1) for sign in (1.0, -1.0))
    return 4.0 * np.minimum(np.arctan2(sine, cosine), np.arctan2(cosine, sine))


def apart(a, b):
    """Largest distance or angle between pose rows (k, 7)."""
    return max(np.abs(a[:, :3] - b[:, :3]).max(), angle(a[:, 3:], b[:, 3:]).max())


def test_a_trace_keeps_what_it_is_given():
    times, points = np.array([0.0, 0.5, 2.0]), RNG.normal(size=(3, 3))
    trace = asm.Trace(times, points)
    times[0], points[0] = 9.0, 9.0
    assert trace.times.tolist() == [0.0, 0.5, 2.0] and trace.targets[0, 0] != 9.0
    assert (trace.positions == trace.targets).all()
    assert not trace.targets.flags.writeable and not trace.times.flags.writeable
    assert trace.duration == 2.0 and len(trace) == 3
    assert [(t, row.tolist()) for t, row in trace] == list(
        zip(trace.times.tolist(), trace.targets.tolist(), strict=True)
    )
    assert repr(trace).startswith("Trace(3 points in 2 s, speed up to ")


def test_poses_may_be_objects_and_are_on_one_side():
    t = np.linspace(0.0, 3.0, 40)
    rows = turns(t)
    signs = RNG.choice([-1.0, 1.0], size=40)
    signs[0] = 1.0
    mixed = np.column_stack([rows[:, :3], rows[:, 3:] * signs[:, None]])
    trace = asm.Trace(t, mixed)
    assert ((trace.targets[1:, 3:] * trace.targets[:-1, 3:]).sum(axis=1) > 0.0).all()
    s = np.linspace(0.0, 3.0, 101)
    np.testing.assert_array_equal(trace.at(s), asm.Trace(t, rows).at(s))
    objects = asm.Trace(t, [asm.Pose(row[:3], row[3:]) for row in mixed])
    np.testing.assert_allclose(objects.targets, trace.targets, rtol=0, atol=1e-15)
    # Two digits are unit enough, and normalized.
    rough = asm.Trace(t, rows * ([1.0] * 3 + [1.009] * 4))
    np.testing.assert_allclose(rough.targets, trace.targets, rtol=0, atol=1e-15)


def test_points_move_along_a_spline_that_keeps_cubics():
    t = np.sort(RNG.uniform(0.0, 2.0, 12))
    coefficients = RNG.normal(size=(4, 3))
    trace = asm.Trace(t, np.vander(t, 4) @ coefficients)
    s = np.linspace(t[0], t[-1], 301)
    np.testing.assert_allclose(trace.at(s), np.vander(s, 4) @ coefficients, rtol=0, atol=1e-11)
    np.testing.assert_allclose(trace.at(t), trace.targets, rtol=0, atol=1e-14)
    # Outside it stands still, and a single time has a single target.
    assert (trace.at(t[0] - 1.0) == trace.at(t[0])).all() and (trace.at(t[-1] + 1.0) == trace.at(t[-1])).all()
    assert trace.at(1.0).shape == (3,) and trace.at(np.full((2, 5), 1.0)).shape == (2, 5, 3)


def test_turns_are_smooth_and_of_fourth_order_up_to_the_ends():
    s = np.linspace(0.0, 6.0, 2001)
    exact, errors = turns(s), []
    for count in (49, 97, 193):
        t = np.linspace(0.0, 6.0, count)
        trace = asm.Trace(t, turns(t))
        assert apart(trace.at(t), turns(t)) < 1e-14
        rows = trace.at(s)
        assert np.abs(np.linalg.norm(rows[:, 3:], axis=1) - 1.0).max() < 1e-15
        errors.append(apart(rows, exact))
    # Half the interval, a sixteenth of the error.
    assert errors[0] < 2e-3 and errors[1] < errors[0] / 12.0 and errors[2] < errors[1] / 12.0
    # The second differences of both sides of a sample agree: no jump of the acceleration.
    trace, h = asm.Trace(np.linspace(0.0, 6.0, 49), turns(np.linspace(0.0, 6.0, 49))), 1e-4
    inner = trace.times[1:-1]
    rows = [trace.at(inner + k * h) for k in range(-3, 4)]
    left, right = (sum(w * rows[3 + side * k] for k, w in enumerate((2, -5, 4, -1))) / h**2 for side in (-1, 1))
    # One-sided differences are off by h^2 times the fourth derivative and by rounding over h^2.
    np.testing.assert_allclose(left, right, rtol=0, atol=1e-4 * np.abs(left).max())


def test_the_motion_does_not_depend_on_the_frame_it_is_seen_from():
    t = np.linspace(0.0, 6.0, 30)
    rows, s = turns(t), np.linspace(0.0, 6.0, 200)
    world = asm.Pose.from_axis_angle((3, 1, -1), 2.0, (0.0, 0.0, 0.0))
    grip = asm.Pose.from_axis_angle((0, 1, -1), 1.0)
    poses = [world @ asm.Pose(row[:3], row[3:]) @ grip for row in rows]
    moved = [world @ asm.Pose(row[:3], row[3:]) @ grip for row in asm.Trace(t, rows).at(s)]
    assert apart(asm.Trace(t, poses).at(s), np.array([pose.q for pose in moved])) < 1e-13


def test_resampling():
    t = np.array([1.0, 1.3, 1.7, 2.0, 2.55])
    trace = asm.Trace(t, RNG.normal(size=(5, 3)))
    fine = trace.resampled(100.0)
    np.testing.assert_allclose(fine.times, 1.0 + np.arange(156) / 100.0, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(fine.targets, trace.at(fine.times))
    # 0.1 s at 10 Hz is one interval although 1.1 - 1.0 is less than 0.1.
    assert len(asm.Trace([1.0, 1.1], [[0, 0, 0], [1, 0, 0]]).resampled(10.0)) == 2
    assert 1.1 - 1.0 != 0.1
    assert len(trace.resampled(1000.0)) == 1551
    with pytest.raises(InputError, match="rate is 0.5 for 1.55 s; expected two samples at least"):
        trace.resampled(0.5)
    with pytest.raises(InputError, match="rate is -1; expected a positive number"):
        trace.resampled(-1.0)


@pytest.mark.parametrize("width", [3, 7])
def test_a_motion_made_through_points_begins_and_ends_at_rest(width):
    times = np.array([0.0, 0.7, 1.0, 2.0])
    rows = turns(0.7 * times)[:, :width]
    made = asm.Trace.through(rows, times, rate=1000.0)
    assert len(made) == 2001 and made.times[-1] == 2.0
    np.testing.assert_allclose(made.targets[[0, 700, 1000, 2000]], rows, rtol=0, atol=1e-14)
    ways = np.linalg.norm(np.diff(made.targets, axis=0), axis=1)
    # From rest s = a t^2 / 2: a first step of a / 2 h^2, against steps of h in the middle.
    assert ways[0] < 1e-4 and ways[-1] < 1e-4 and ways.max() > 1e-3
    # Velocity changes by acceleration times h, nowhere more.
    assert np.abs(np.diff(made.targets, n=2, axis=0)).max() < 1e-4
    # An interval that does not fit is a little shorter.
    odd = asm.Trace.through(rows, times, rate=1.9)
    np.testing.assert_allclose(np.diff(odd.times), 0.5, rtol=0, atol=1e-15)
    np.testing.assert_allclose(odd.targets[-1], rows[-1], rtol=0, atol=1e-14)
    with pytest.raises(InputError, match="rate is 0; expected a positive number"):
        asm.Trace.through(rows, times, rate=0.0)
    with pytest.raises(InputError, match=r"points has shape \(4, 2\); expected \(4, 3\) for points, \(4, 7\)"):
        asm.Trace.through(rows[:, :2], times)


def test_one_after_the_other():
    out = asm.Trace.through([(0, 0, 0), (1, 2, 3)], [5.0, 6.0], rate=10.0)
    back = asm.Trace.through([(1, 2, 3), (0, 0, 0)], [0.0, 2.0], rate=10.0)
    both = out.then(back)
    assert both.times[0] == 5.0 and both.duration == 3.0 and len(both) == 11 + 21 - 1
    np.testing.assert_array_equal(both.targets, np.vstack([out.targets, back.targets[1:]]))
    np.testing.assert_allclose(np.diff(both.times), 0.1, rtol=0, atol=1e-14)
    many = asm.Trace.concatenate([both] * 4)
    assert len(many) == 4 * 30 + 1 and many.duration == pytest.approx(12.0, abs=1e-12)
    assert len(asm.Trace.concatenate([out])) == 11
    # Rounding at the origin is no gap.
    near = asm.Trace([0.0, 1.0], [(1e-17, 0, 0), (1, 2, 3)])
    assert len(both.then(near)) == 32
    # With a pause the hand goes on elsewhere.
    jump = out.then(out, pause=0.5)
    assert len(jump) == 22 and jump.times[11] == 6.5
    with pytest.raises(InputError, match=r"traces\[1\] begins 3.74 away from where the one before ends; expected the"):
        out.then(out)
    half = asm.Trace([0, 1], [asm.Pose().q, asm.Pose.from_axis_angle((0, 0, 1), 3.0).q])
    with pytest.raises(InputError, match=r"begins 0 away, turned by 2 rad, from where|turned by"):
        half.then(half)
    # -q is the same turn.
    assert len(half.then(asm.Trace([0, 1], half.targets[::-1] * ([1.0] * 3 + [-1.0] * 4)))) == 3
    with pytest.raises(InputError, match=r"traces\[1\] has poses; expected points as traces\[0\]"):
        out.then(half)
    with pytest.raises(InputError, match="pause is -1; expected seconds, not below zero"):
        out.then(back, pause=-1.0)
    with pytest.raises(InputError, match="traces is empty"):
        asm.Trace.concatenate([])


def test_speeds():
    # One unit in each of three intervals; most of the time at speed 0.5.
    trace = asm.Trace([0.0, 1.0, 1.5, 3.5], [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1)])
    assert trace.speed == (2.0, 0.5)
    assert trace.speed.peak == 2.0 and trace.speed.median == 0.5
    assert trace.turning == (0.0, 0.0)
    t = np.linspace(0.0, 2.0, 9)
    poses = [asm.Pose.from_axis_angle((1, 2, 2), 3.0 * s, (4.0 * s, 0, 0)) for s in t]
    twist = asm.Trace(t, poses)
    assert twist.turning == pytest.approx((3.0, 3.0), abs=1e-14)
    assert twist.speed == pytest.approx((4.0, 4.0), abs=1e-14)


def test_values_of_a_coordinate():
    t = np.array([0.0, 0.1, 0.25, 0.4, 0.7])
    trace = asm.Trace(t, [0.0, 0.2, 3.1, -3.1, 7.0])
    assert trace.kind == "numbers" and trace.targets.shape == (5,) and trace.at(0.3).shape == ()
    assert asm.Trace(t, np.zeros((5, 3))).kind == "points"
    np.testing.assert_allclose(trace.at(t), trace.targets, rtol=0, atol=1e-14)
    # A spline keeps cubics, whatever turn an angle is on.
    cubic = asm.Trace(t, t**3 - 4.0 * t)
    s = np.linspace(0.0, 0.7, 50)
    np.testing.assert_allclose(cubic.at(s), s**3 - 4.0 * s, rtol=0, atol=1e-14)
    assert list(trace) == list(zip(t.tolist(), trace.targets.tolist(), strict=True))
    assert trace.speed == pytest.approx((6.2 / 0.15, 10.1 / 0.3)) and trace.turning == (0.0, 0.0)
    assert repr(trace) == "Trace(5 numbers in 0.7 s, speed up to 41.3/s)"
    made = asm.Trace.through([0.0, 2.0], [0.0, 1.0], rate=100.0)
    assert made.at(0.5) == pytest.approx(1.0, abs=1e-14) and len(made.resampled(10.0)) == 11
    both = made.then(asm.Trace([0.0, 1.0], [2.0, 1.0]))
    assert len(both) == 102 and both.targets[-1] == 1.0
    with pytest.raises(InputError, match=r"traces\[1\] begins 2 away from where the one before ends"):
        made.then(made)
    with pytest.raises(InputError, match=r"traces\[1\] has points; expected numbers as traces\[0\]"):
        made.then(asm.Trace([0.0, 1.0], np.zeros((2, 3))))
    with pytest.raises(InputError, match="targets are numbers; expected points or poses"):
        _ = made.positions
    with pytest.raises(InputError, match=r"targets\[1\] is nan"):
        asm.Trace([0.0, 1.0], [0.0, np.nan])


@pytest.mark.parametrize("ending", ["csv", "npz"])
@pytest.mark.parametrize("width", [1, 3, 7])
def test_files_keep_every_bit(tmp_path, ending, width):
    t = np.sort(RNG.uniform(0.0, 1e3, 50))
    trace = asm.Trace(t, turns(t)[:, 0] if width == 1 else turns(t)[:, :width] * 1.0)
    path = tmp_path / f"hand.{ending}"
    trace.save(path)
    again = asm.Trace.load(str(path))
    assert (again.times == trace.times).all() and (again.targets == trace.targets).all()
    if ending == "csv":
        heading = path.read_text().splitlines()[0]
        assert heading == {1: "time,value", 3: "time,x,y,z", 7: "time,x,y,z,qw,qx,qy,qz"}[width]


def test_a_table_of_another_program(tmp_path):
    path = tmp_path / "hand.csv"
    path.write_bytes(b'\xef\xbb\xbf"time", x, y, z\r\n0,1,2,3\r\n\r\n0.5, 1e1 ,2,3\r\n')
    trace = asm.Trace.load(path)
    assert trace.times.tolist() == [0.0, 0.5] and trace.targets.tolist() == [[1, 2, 3], [10, 2, 3]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "hand.csv line 1 is ''; expected time,x,y,z or time,x,y,z,qw,qx,qy,qz or time,value"),
        ("t,x,y,z\n0,0,0,0\n", "hand.csv line 1 is 't,x,y,z'; expected time,x,y,z or"),
        ("time,x,y,z\n0,0,0,0\n1,2,3\n", "hand.csv line 3 has 3 values; expected time,x,y,z"),
        ("time,x,y,z\n0,0,0,0\n\n1,2,3,up\n", "hand.csv line 4: could not convert string to float: 'up'; expected"),
        ("time,x,y,z\n0,0,0,0\n1,nan,0,0\n", "hand.csv: targets[1, 0] is nan; expected finite numbers"),
        ("time,x,y,z\n1,0,0,0\n1,0,0,0\n", "hand.csv: times[1] is 1.0 after 1.0; expected increasing times"),
        ("time,x,y,z\n1,0,0,0\n", "hand.csv: times has 1 entry; expected two at least"),
        ("time,x,y,z\n", "hand.csv: times has shape (0,); expected (k,)"),
    ],
)
def test_tables_that_are_none(tmp_path, text, message):
    path = tmp_path / "hand.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=re.escape(message)):
        asm.Trace.load(path)


def test_files_that_are_no_traces(tmp_path):
    with pytest.raises(InputError, match=r"expected a name that ends with .csv or .npz"):
        asm.Trace.load(tmp_path / "hand.txt")
    with pytest.raises(InputError, match=r"path is 'hand'; expected a name that ends with .csv or .npz"):
        asm.Trace([0, 1], np.zeros((2, 3))).save("hand")
    with pytest.raises(FileNotFoundError):
        asm.Trace.load(tmp_path / "hand.csv")
    (tmp_path / "text.csv").write_bytes(b"time,x,y,z\n0,0,\xff,0\n")
    with pytest.raises(InputError, match="text.csv is no text: .* expected a table of numbers"):
        asm.Trace.load(tmp_path / "text.csv")
    for content in (b"", b"time", b"PK\x03\x04 and more"):
        (tmp_path / "hand.npz").write_bytes(content)
        with pytest.raises(InputError, match="hand.npz is no file of a trace"):
            asm.Trace.load(tmp_path / "hand.npz")
    np.savez(tmp_path / "hand.npz", times=[0.0, 1.0])
    with pytest.raises(InputError, match="hand.npz is no file of a trace: .*targets"):
        asm.Trace.load(tmp_path / "hand.npz")
    np.savez(tmp_path / "hand.npz", times=[0.0, 1.0], targets=np.array([None, 1]))
    with pytest.raises(InputError, match="hand.npz is no file of a trace"):
        asm.Trace.load(tmp_path / "hand.npz")
    with pytest.raises(FileNotFoundError):
        asm.Trace.load(tmp_path / "other.npz")


@pytest.mark.parametrize(
    ("times", "targets", "message"),
    [
        ([0.0], [[0, 0, 0]], "times has 1 entry; expected two at least"),
        ([0.0, 1.0, 1.0], np.zeros((3, 3)), "times[2] is 1.0 after 1.0; expected increasing times"),
        ([0.0, np.inf], np.zeros((2, 3)), "times[1] is inf"),
        ("now", np.zeros((2, 3)), "times is 'now'; expected real numbers"),
        ([0.0, 1.0], np.zeros((3, 3)), "targets has shape (3, 3); expected (2, 3) for points, (2, 7) for poses or"),
        ([0.0, 1.0], np.zeros((2, 4)), "targets has shape (2, 4); expected (2, 3) for points, (2, 7) for poses or"),
        ([0.0, 1.0], [[0, 0, 0], [0, 0]], "targets has rows of different lengths"),
        ([0.0, 1.0], [asm.Pose(), (0, 0, 0)], "targets has rows of different lengths"),
        ([0.0, 1.0], [[0, 0, 0], [0, np.nan, 0]], "targets[1, 1] is nan"),
        ([0.0, 1.0], [["a"] * 3] * 2, "targets is [['a', 'a', 'a'], ['a', 'a', 'a']]; expected real numbers"),
        (
            [0.0, 1.0],
            np.zeros((2, 7)),
            "targets[0, 3:] is [0.0, 0.0, 0.0, 0.0] with norm 0; expected a unit quaternion",
        ),
    ],
)
def test_bad_input(times, targets, message):
    with pytest.raises(InputError, match=re.escape(message)):
        asm.Trace(times, targets)


def test_times_to_be_asked_for_are_numbers():
    trace = asm.Trace([0, 1], np.zeros((2, 3)))
    for t in (np.nan, "now", [0.0, np.inf]):
        with pytest.raises(InputError, match=r"^t"):
            trace.at(t)


def test_a_hand_at_rest():
    still = asm.Trace([0.0, 1.0], [(1, 2, 3)] * 2)
    assert still.speed == (0.0, 0.0) and (still.at(np.linspace(0, 1, 5)) == [1, 2, 3]).all()
    e = rotate((1, 0, 0, 0), (1, 2, 3))
    assert (still.resampled(4.0).targets == e).all()
