"""A batch of solves: the bits of single ones, whoever solves them and in what order; failures are rows."""

from __future__ import annotations

import dataclasses
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from threading import Barrier, Event
from time import sleep

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.dexterity import Dexterity
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix
from assembly.studies.batches import solving
from benchmarks.linkages import boxes
from benchmarks.linkages import four_bar as spatial_four_bar
from tests.derivatives.sensitivity_scenes import clips, filmed


def near(scene, count, spread, seed=0):
    """Starts beside a solution, with turned bodies."""
    rng = np.random.default_rng(seed)
    q0s = np.repeat(scene.solve().q[None], count, 0)
    moving = [k for k, body in enumerate(scene.bodies) if not body.fixed]
    q0s[:, moving] += spread * rng.normal(size=(count, len(moving), 7))
    q0s[..., 3:] /= np.linalg.norm(q0s[..., 3:], axis=2, keepdims=True)
    return q0s


def linkage():
    return spatial_four_bar()[0]


def limited():
    """Turns of limited angles are told by where rows begin."""
    scene, crank = spatial_four_bar()
    crank.angle = None
    crank.freedom().limits = (0.1, 0.5)
    scene.minimize(asm.PointDistance(scene.bodies[2].point(1.5, 0.4, 0.2), (1.0, 2.0, 3.0)))
    return scene


def touching():
    return clips().scene


def dexterous():
    scene, crank = spatial_four_bar()
    crank.angle = None
    crank.freedom().limits = (-1.0, 1.0)
    scene.maximize(Dexterity(scene.bodies[2].point(1.5, 0.4, 0.2), [crank]))
    return scene


def kept_apart():
    balls = [asm.Body(name, asm.shapes.sphere(1.0), (2.5 * k, 0, 0), fixed=k == 0) for k, name in enumerate("ab")]
    scene = asm.Assembly(balls)
    scene.constrain(asm.Clearance())
    scene.minimize(asm.PointDistance(balls[1].point(0, 0, 0), (0.5, 0.0, 0.0)))
    return scene


def judged(scene, q):
    """The largest violation of the joints' rows, in plain numpy: points and axes of the spatial four-bar."""
    off = []
    for joint in scene.constraints:
        a, b = joint.frame_a, joint.frame_b
        rows = [q[scene.bodies.index(frame.body)] for frame in (a, b)]
        turns = [rotation_matrix(row[3:]) for row in rows]
        (p, u), (r, v) = (
            (row[:3] + turn @ frame.origin, turn @ frame.axes)
            for row, turn, frame in zip(rows, turns, (a, b), strict=True)
        )
        off += [*(p - r)]
        if isinstance(joint, asm.Revolute):
            off += [*np.cross(u[:, 2], v[:, 2])]
    return float(np.abs(off).max())


@pytest.mark.parametrize(
    ("make", "spread", "alone"),
    [
        (linkage, 0.3, 0),
        (limited, 0.02, 3),
        (touching, 1e-3, 3),
        (dexterous, 0.02, 6),
        (lambda: boxes(2, 0), 0.2, 6),
        (kept_apart, 0.0, 6),
    ],
    ids=["linkage", "limited", "touching", "dexterous", "boxes", "kept apart"],
)
def test_a_row_has_the_bits_of_a_solve(make, spread, alone):
    scene = make()
    q0s = near(scene, 6, spread)
    batch = scene.solve_many(q0s, threads=1)
    assert len(batch) == 6 and int(batch.alone.sum()) <= alone
    for k, q0 in enumerate(q0s):
        single = scene.solve(q0)
        assert batch.status[k] is single.status and batch.iterations[k] == single.iterations
        np.testing.assert_array_equal(batch.q[k], single.q)
        assert batch.feasibility[k] == single.feasibility and batch.objective[k] == single.objective
    # And again, from solutions.
    found = [scene.solve(q0) for q0 in q0s]
    warm = scene.solve_many(found, threads=1)
    for k, one in enumerate(found):
        np.testing.assert_array_equal(warm.q[k], scene.solve(one).q)


def test_nothing_depends_on_threads_or_order():
    scene = linkage()
    q0s = near(scene, 1000, 0.3)
    one = scene.solve_many(q0s, threads=1)
    order = np.random.default_rng(1).permutation(len(q0s))
    for other in (scene.solve_many(q0s, threads=3), scene.solve_many(q0s[order], threads=2)):
        back = other.q if np.array_equal(other.q, one.q) else other.q[np.argsort(order)]
        np.testing.assert_array_equal(back, one.q)
    assert one.success.all() and not one.alone.any()
    assert max(judged(scene, q) for q in one.q) < 1e-12
    np.testing.assert_array_equal(scene.solve_many(q0s[:1]).q, one.q[:1])


def test_rows_are_told_in_their_places_however_many_a_thread_tells_at_a_time(monkeypatch):
    scene, crank = spatial_four_bar()
    start, of = scene.solve(), [asm.Measure(scene.constraints[3]), asm.Measure(scene.bodies[2], "y")]
    columns = sizes(scene, crank, 1300)
    batches = [scene.solve_many(start, parameters=columns, of=of, threads=threads) for threads in (1, 2)]
    monkeypatch.setattr(solving, "TOLD", 1)
    batches += [scene.solve_many(start, parameters=columns, of=of, threads=3)]
    for k in (0, 127, 128, 1023, 1024, 1299):
        one = scene.solve_many(start, parameters={item: values[[k]] for item, values in columns.items()}, of=of)
        for batch in batches:
            assert batch.status[k] is one.status[0] and batch.iterations[k] == one.iterations[0]
            for name in ("q", "measures", "objective", "feasibility"):
                np.testing.assert_array_equal(getattr(batch, name)[k], getattr(one, name)[0])


def crowded():
    """Boxes that are drawn to one place, and that solves find slots for contacts of."""
    ground = asm.Body("ground", asm.shapes.box(6, 6, 1), (0, 0, -2), fixed=True)
    boxes = [asm.Body(f"box {k}", asm.shapes.box(1, 1, 1), (1.5 * k - 0.7, 0.2 * k, 0.3 * k)) for k in range(2)]
    scene = asm.Assembly([ground, *boxes])
    scene.constrain(asm.Clearance(minimum=0.05))
    for k, box in enumerate(boxes):
        scene.minimize(asm.PointDistance(box.point(0, 0, 0), (0.3 * k, 0.1, 0.0)))
    return scene


def test_rows_with_clearances_depend_on_no_other_row():
    scene = crowded()
    q0s = np.repeat(scene.q[None], 5, 0)
    q0s[:, 1:, :3] += 0.05 * np.random.default_rng(1).standard_normal((5, 2, 3))
    one = scene.solve_many(q0s, threads=1)
    assert one.alone.all() and one.success.any()
    two = scene.solve_many(q0s[::-1], threads=2)
    least = asm.Parameter(scene.constraints[0], "minimum")
    same = scene.solve_many(q0s[[3]], parameters={least: [0.05, 0.06, 0.05]})
    for name in ("q", "status", "iterations", "feasibility"):
        np.testing.assert_array_equal(getattr(two, name)[::-1], getattr(one, name))
        assert (getattr(same, name)[[0, 2]] == getattr(one, name)[3]).all()


def sizes(scene, crank, count, seed=0):
    """Parameters of the spatial four-bar: a link's length, where the rocker has its joint, the drive."""
    rng = np.random.default_rng(seed)
    return {
        asm.Parameter(scene.constraints[1].frame_a, "origin", "x"): rng.uniform(0.8, 1.1, count),
        asm.Parameter(scene.constraints[2].frame_b, "origin", "y"): rng.uniform(1.8, 2.3, count),
        asm.Parameter(crank, "angle"): rng.uniform(-4.0, 9.0, count),
    }


@pytest.mark.parametrize("warm", [False, True])
def test_rows_of_parameters_are_scenes_with_these_numbers(warm):
    scene, crank = spatial_four_bar()
    coupler, rocker = scene.bodies[2:]
    of = [
        asm.Measure(scene.constraints[3], name="rocker"),
        asm.Measure(coupler.point(1.0, 0.5, 0.0), "z"),
        asm.Measure((scene.constraints[1].frame_a, rocker)),
        asm.Measure("objective"),
    ]
    start = scene.solve() if warm else None
    columns = sizes(scene, crank, 300)
    before = [item.value for item in columns]
    batch = scene.solve_many(start, parameters=columns, of=of, threads=2)
    assert [item.value for item in columns] == before and batch.success.all() and not batch.alone.any()
    assert np.array_equal(scene.solve(start).q, scene.solve(start).q)
    assert batch.values.shape == (300, 3) and batch.measure("rocker").shape == (300,)
    for k in range(0, 300, 30):
        for item, values in columns.items():
            item.value = float(values[k])
        single = scene.solve(start)
        np.testing.assert_allclose(batch.q[k], single.q, rtol=0, atol=1e-13)
        np.testing.assert_allclose(batch.measures[k], [item.value(single) for item in of], rtol=0, atol=2e-13)
        assert judged(scene, batch.q[k]) < 1e-12


def test_targets_limits_and_contacts_are_numbers_of_rows():
    scene = clips().scene
    (_, goal), *_ = scene.objectives
    touch = scene.constraints[0]
    target = np.array(goal.target)
    columns = {asm.Parameter(goal, "target", axis): target[k] + np.linspace(0, 0.5, 5) for k, axis in enumerate("xyz")}
    of = [asm.Measure(touch), asm.Measure("objective")]
    batch = scene.solve_many(scene.solve(), parameters=columns, of=of)
    start = scene.solve()
    for k in range(5):
        goal.target = [values[k] for values in columns.values()]
        single = scene.solve(start)
        np.testing.assert_array_equal(batch.q[k], single.q)
        assert abs(batch.measures[k, 0]) < 1e-12 * 40 and batch.objective[k] == single.objective
    limited_scene = limited()
    hinge = limited_scene.constraints[0]
    asked = {"lower": np.array([0.1, 0.6]), "upper": np.array([0.5, 0.7])}
    ends = {asm.Parameter(hinge.freedom(), name): at for name, at in asked.items()}
    angle = limited_scene.solve_many(parameters=ends, of=[asm.Measure(hinge)]).measures[:, 0]
    assert (angle >= asked["lower"] - 1e-12).all() and (angle <= asked["upper"] + 1e-12).all()


def test_gaps_of_rows_are_gaps_of_solutions():
    """Of contacts with a least gap too; to rounding, for a solution finds them again."""
    case = filmed()
    q0s = near(case.scene, 3, 1e-3)
    batch = case.scene.solve_many(q0s, of=case.of, threads=1)
    assert batch.success.all() and not batch.alone.all()
    expected = [[item.value(solution) for item in case.of] for solution in map(case.scene.solve, q0s)]
    # Over bodies of 16.
    np.testing.assert_allclose(batch.measures, expected, rtol=0, atol=1e-13 * 16.0)
    assert batch.measure("two.gap")[0] > 0.09
    elsewhere = filmed().wrt[0]
    with pytest.raises(InputError, match="of another scene"):
        case.scene.solve_many(parameters={elsewhere: [0.1]})


def test_rows_that_fail_are_rows():
    scene, crank = spatial_four_bar()
    length = asm.Parameter(scene.constraints[1].frame_a, "origin", "x")
    columns = {length: np.array([1.0, 9.0, 1.1])}
    of = [asm.Measure(scene.bodies[3], "x")]
    loop = scene.solve_many(parameters=columns, of=of, retry=False)
    assert loop.success.tolist() == [True, False, True] and not loop.alone.any()
    whole = scene.solve_many(parameters=columns, of=of)
    assert whole.status[1] is asm.Status.INFEASIBLE and whole.alone.tolist() == [False, True, False]
    for batch in (loop, whole):
        assert np.isnan(batch.measures[:, 0]).tolist() == [False, True, False] and batch.feasibility[1] > 0.1
        assert "SOLVED" in str(batch) and repr(batch) == "Batch(3 rows, 2 solved)"
        assert "3 rows" in batch._repr_html_()
    np.testing.assert_array_equal(whole.q[[0, 2]], loop.q[[0, 2]])
    with pytest.raises(dataclasses.FrozenInstanceError):
        loop.seconds = 0.0
    with pytest.raises(ValueError, match="read-only"):
        loop.q[0] = 0.0


def test_faces_of_parameters_are_made_row_by_row():
    ground = asm.Body("ground", asm.shapes.plane(20, 20), fixed=True)
    ball = asm.Body("ball", asm.Parametric(asm.shapes.sphere, radius=1.0), (0, 0, 2.0))
    scene = asm.Assembly([ground, ball])
    scene.constrain(asm.Contact(ground, ball))
    batch = scene.solve_many(parameters={asm.Parameter(ball, "radius"): [0.5, 1.5]}, of=[asm.Measure(ball, "z")])
    np.testing.assert_allclose(batch.measures[:, 0], [0.5, 1.5], rtol=0, atol=1e-12)
    assert batch.alone.all() and ball.shape.numbers["radius"] == 1.0


class Stop(Exception):
    """What a handler raises."""


def raise_on_alarm(*_):
    raise Stop


@pytest.fixture
def stopping():
    before = signal.signal(signal.SIGALRM, raise_on_alarm)
    yield
    signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="no signal of a timer on this system")
@pytest.mark.parametrize("threads", [1, 2])
def test_a_signal_ends_a_batch(threads, monkeypatch, stopping):
    scene = linkage()
    q0s = np.repeat(near(scene, 20, 0.3), 200, 0)
    # Two threads never draw the same number.
    slices, numbers = [], count(1)
    solve_rows = solving.solve_rows

    def slowly(*given):
        """Send the signal with the third slice; slices after it take long enough for the main thread to hear of it."""
        number = next(numbers)
        slices.append(number)
        if number == 3:
            os.kill(os.getpid(), signal.SIGALRM)
        if number >= 3:
            sleep(0.05)
        solve_rows(*given)

    monkeypatch.setattr(solving, "solve_rows", slowly)
    with pytest.raises(Stop):
        scene.solve_many(q0s, threads=threads)
    assert 3 <= len(slices) < len(q0s) / solving.SLICE
    assert scene.solve_many(q0s[:2]).success.all()


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="no signal of a timer on this system")
def test_a_signal_while_threads_are_made_ends_those_that_began(monkeypatch, stopping):
    scene = linkage()
    q0s = np.repeat(near(scene, 20, 0.3), 200, 0)
    begun, slices = Event(), []

    class Pool(ThreadPoolExecutor):
        """Sends the signal when the second thread is submitted, once the first one solves."""

        def submit(self, *given):
            if self._threads:
                assert begun.wait(60.0)
                os.kill(os.getpid(), signal.SIGALRM)
            return super().submit(*given)

    def slowly(*_):
        slices.append(0)
        begun.set()
        sleep(0.05)

    monkeypatch.setattr(solving, "solve_rows", slowly)
    monkeypatch.setattr(solving, "ThreadPoolExecutor", Pool)
    with pytest.raises(Stop):
        scene.solve_many(q0s, threads=2)
    assert 1 <= len(slices) < len(q0s) / solving.SLICE


def test_bad_input():
    scene, crank = spatial_four_bar()
    angle = asm.Parameter(crank, "angle")
    other = asm.Parameter(spatial_four_bar()[1], "angle")
    q0s = np.repeat(scene.q[None], 2, 0)
    q0s[1, 2, 3] = 3.0
    for call, error, text in [
        (lambda: scene.solve_many(np.zeros((2, 3, 7))), InputError, r"q0s has shape \(2, 3, 7\)"),
        (lambda: scene.solve_many(q0s), InputError, r"q0s\[1, 2, 3:\] is .* a unit quaternion"),
        (lambda: scene.solve_many([scene.solve(), 3]), TypeError, r"q0s\[1\] is 3; expected a Solution"),
        (lambda: scene.solve_many(limited().solve()), InputError, "q0 is a solution of another assembly"),
        (lambda: scene.solve_many(parameters=[angle]), TypeError, "expected a mapping of Parameter"),
        (lambda: scene.solve_many(parameters={"angle": [1.0]}), TypeError, "the key 'angle'; expected a Parameter"),
        (lambda: scene.solve_many(parameters={other: [1.0]}), InputError, "of another scene"),
        (lambda: scene.solve_many(parameters={angle: [1.0, np.nan]}), InputError, r"is nan; expected finite"),
        (lambda: scene.solve_many(q0s[:0], parameters={angle: [1.0]}), InputError, "q0s has shape"),
        (
            lambda: scene.solve_many(np.repeat(scene.q[None], 2, 0), parameters={angle: [1.0] * 3}),
            InputError,
            "q0s has 2 rows; expected 1, or 3",
        ),
        (lambda: scene.solve_many(threads=0), InputError, "threads is 0"),
        (lambda: scene.solve_many(retry=1), InputError, "retry is 1; expected True or False"),
        (lambda: scene.solve_many(of=["x"]), TypeError, "of has 'x'; expected a Measure"),
        (lambda: scene.solve_many(verbose=1), InputError, "verbose is 1 of a batch"),
        (lambda: scene.solve_many(tolerances=1), InputError, "option 'tolerances' is unknown"),
        (limited_batch, InputError, "expected lower <= upper"),
    ]:
        with pytest.raises(error, match=text):
            call()
    assert angle.value == 0.3


def limited_batch():
    scene = limited()
    freedom = scene.constraints[0].freedom()
    columns = {asm.Parameter(freedom, "lower"): [0.1, 0.6], asm.Parameter(freedom, "upper"): [0.5, 0.5]}
    return scene.solve_many(parameters=columns)


def test_an_exception_in_any_thread_ends_the_others():
    remaining, taken, together = iter(range(400)), [], Barrier(3)

    def work():
        first = next(remaining)
        together.wait()
        if first == 2:
            raise RuntimeError("of the third one")
        for k in remaining:
            sleep(0.002)
            taken.append(k)

    with pytest.raises(RuntimeError, match="third"):
        solving._over_threads(work, remaining, 3)
    assert len(taken) < 200
