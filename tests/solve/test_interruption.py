"""A solve that is ended before it is done: by its time limit, by a callback, by Ctrl-C; and one that is not."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.packing.scene import Packed
from assembly.errors import InputError
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager.parameters import SLICE
from assembly.solve import interruption
from assembly.solve.loop import pauses
from assembly.solve.loop.settings import ASK_ADDRESS
from tests.solve.long_arm import long_arm

LIMIT = {"max_iterations": 10_000}


@pytest.fixture(scope="module")
def scene() -> asm.Assembly:
    return long_arm()


@pytest.fixture(scope="module")
def whole(scene) -> asm.Solution:
    """The solve that nobody ends."""
    solution = scene.solve(**LIMIT)
    assert solution.success and solution.seconds > 2 * SLICE / 1e9, "too short for what is tested here"
    return solution


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt, as in a terminal: a process begun in the background ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def holds(solution: asm.Solution) -> bool:
    return all(abs(value) < 1e-9 for value in solution.violations.values())


def test_asking_changes_nothing(scene, whole):
    asked: list[tuple[int, float, float]] = []
    solution = scene.solve(**LIMIT, callback=lambda *progress: asked.append(progress))
    np.testing.assert_array_equal(solution.q, whole.q)
    assert solution.iterations == whole.iterations and solution.status is asm.Status.SOLVED
    # Between slices: at most one question in each.
    assert 1 <= len(asked) <= solution.seconds * 1e9 / SLICE + 1
    iterations = [iteration for iteration, _, _ in asked]
    assert iterations == sorted(iterations) and iterations[-1] <= solution.iterations
    assert all(np.isfinite(value) and feasibility >= 0.0 for _, value, feasibility in asked)


def test_a_callback_ends_a_solve_at_a_pose_that_holds(scene, whole):
    # Where the machine is busy with something else the first question may come before the first step.
    solution = scene.solve(**LIMIT, callback=lambda iteration, objective, feasibility: iteration > 0)
    assert solution.status is asm.Status.STOPPED and not solution.success
    assert 0 < solution.iterations < whole.iterations
    # The start holds, so there is one.
    assert holds(solution) and solution.feasibility < 1e-9
    distance = np.linalg.norm(solution.pose("link 249").apply([1.0, 0.0, 0.0]) - np.array([-75.0, 125.0, 0.0]))
    assert solution.objective == pytest.approx(distance**2, rel=1e-9)  # of that pose
    assert "callback" in str(solution)


def test_a_time_limit_ends_a_solve(scene, whole):
    solution = scene.solve(**LIMIT, time_limit=1e-6)
    assert solution.status is asm.Status.TIME_LIMIT and not solution.success
    assert solution.iterations < whole.iterations and holds(solution)
    assert "time limit" in solution.message
    # One that is not reached changes nothing, and the next solve has none.
    np.testing.assert_array_equal(scene.solve(**LIMIT, time_limit=1e6).q, whole.q)
    np.testing.assert_array_equal(scene.solve(**LIMIT).q, whole.q)


def test_a_short_solve_is_not_interrupted():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    small = asm.Assembly([ground, arm])
    small.constrain(asm.Revolute(ground, arm, "hinge", angle=0.3))
    assert small.solve(time_limit=1e-9, callback=lambda *_: True).success


def test_what_a_callback_raises_is_raised(scene, whole):
    def callback(iteration, objective, feasibility):
        raise LookupError(f"at {iteration}")

    with pytest.raises(LookupError, match=r"at \d+"):
        scene.solve(**LIMIT, callback=callback)
    np.testing.assert_array_equal(scene.solve(**LIMIT).q, whole.q)


def test_a_callback_may_solve(scene, whole):
    small = long_arm(2)
    inner: list[bool] = []
    scene.solve(**LIMIT, callback=lambda *_: inner.append(small.solve(time_limit=10.0).success))
    assert inner and all(inner)


@pytest.mark.skipif(os.name == "nt", reason="signals are not sent so on Windows")
@pytest.mark.parametrize("options", [{}, {"time_limit": 100.0}, {"callback": print}], ids=str)
def test_ctrl_c_ends_a_solve(scene, whole, options, ctrl_c):
    timer = threading.Timer(0.3 * whole.seconds, lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        # Within: however late it is, the signal comes to nobody else. A thousand solves take many minutes.
        timer.start()
        for _ in range(1000):  # also where the machine is so quick that a solve was over before
            scene.solve(**LIMIT, **options)
    timer.join()
    np.testing.assert_array_equal(scene.solve(**LIMIT).q, whole.q)


def test_ctrl_c_ends_solves_of_many_starts(scene, whole, ctrl_c, caplog):
    timer = threading.Timer(0.5 * whole.seconds, lambda: os.kill(os.getpid(), signal.SIGINT))

    def begin(done, total):
        """Start the timer after the first solve, while there are many to come."""
        if done and timer.ident is None:
            timer.start()

    # What was found until then is returned, and that it is not all is said.
    found = scene.solve_all(starts=1000, progress=begin, **LIMIT)
    timer.join()
    assert found and all(solution.success for solution in found)
    (said,) = [record for record in caplog.records if "was interrupted" in record.message]
    assert said.args[0] < 1000


def test_solves_of_many_starts_have_one_time_limit():
    # A million starts take minutes; the first few take milliseconds, and longer where the machine is busy.
    for limit in (0.5, 5.0, 50.0):
        found = long_arm(2).solve_all(starts=10**6, time_limit=limit)
        if found:
            break
    assert found and all(solution.success for solution in found)


def test_other_threads_have_no_signals_and_their_own_callbacks(scene, whole):
    outcomes: dict[int, asm.Solution] = {}

    def work(k: int) -> None:
        own = long_arm()
        outcomes[k] = own.solve(**LIMIT, callback=lambda *_: k == 1) if k > 0 else own.solve(**LIMIT)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [outcomes[k].status.name for k in range(3)] == ["SOLVED", "STOPPED", "SOLVED"]
    for k in (0, 2):
        np.testing.assert_array_equal(outcomes[k].q, whole.q)


@pytest.mark.parametrize(
    ("option", "error", "message"),
    [
        ({"time_limit": 0.0}, InputError, "time_limit is 0; expected a number of seconds above 0"),
        ({"time_limit": "soon"}, InputError, "time_limit is 'soon'; expected a finite real number"),
        ({"time_limit": float("nan")}, InputError, "time_limit is nan; expected a finite real number"),
        ({"callback": 3}, TypeError, "callback is 3; expected a function of iteration, objective and feasibility"),
    ],
)
def test_limits_that_are_none(scene, option, error, message):
    with pytest.raises(error, match=message):
        scene.solve(**option)


def test_an_interruption_leaves_shared_settings_as_they_are():
    shared = interruption.CTRL_C.fill(np.zeros(ASK_ADDRESS + 1))
    before = shared.copy()
    own = interruption.Interruption(time_limit=1.0).settings(shared)
    assert own[ASK_ADDRESS] != shared[ASK_ADDRESS] != 0.0
    np.testing.assert_array_equal(shared, before)
    found: list[float] = []
    thread = threading.Thread(target=lambda: found.append(interruption.CTRL_C.settings(shared)[ASK_ADDRESS]))
    thread.start()
    thread.join()
    assert found == [0.0]


CROWD = 60
PAIRS = CROWD * (CROWD - 1) // 2


def crowd(count: int = CROWD) -> asm.Assembly:
    """Ellipsoids in each other, so that one update of their pairs takes longer than a slice; with places for all."""
    rng = np.random.default_rng(0)
    shape = asm.shapes.ellipsoid(1.0, 0.9, 0.8)
    scene = asm.Assembly(asm.Body(f"{k}", shape, rng.uniform(-1.0, 1.0, 3)) for k in range(count))
    scene.constrain(asm.Clearance(slots=600))
    return scene


@pytest.fixture(scope="module")
def crowded() -> asm.Assembly:
    return crowd()


def seen(packed: Packed, state: np.ndarray) -> int:
    """How many pairs the contact manager of a state has updated."""
    pairs = state[packed.memory_at + manager_records.MEMORY_HEADER :]
    pairs = pairs[: manager_records.PAIR_MEMORY * len(packed.clearance_pairs[0])].reshape(
        -1, manager_records.PAIR_MEMORY
    )
    return int((~np.isnan(pairs[:, manager_records.PAIR_TURN])).sum())


def test_one_update_of_many_pairs_asks(crowded):
    # With no iteration at all nobody but the update at the start can ask.
    other = crowded.solve(max_iterations=0)
    assert other.seconds > SLICE / 1e9, "too short for what is tested here"
    asked: list[tuple[int, float, float]] = []
    solution = crowded.solve(max_iterations=0, callback=lambda *progress: asked.append(progress))
    assert asked and asked[0][0] == 0
    # Nothing is known of the start yet: zeros would say that it holds.
    assert np.isnan(asked[0][1]) and asked[0][2] == np.inf
    np.testing.assert_array_equal(solution.q, other.q)
    assert solution.violations == other.violations


@pytest.mark.parametrize("options", [{"time_limit": 1e-6}, {"callback": lambda *_: True}], ids=["time", "callback"])
def test_an_update_that_is_not_to_go_on_is_whole(crowded, options):
    solution = crowded.solve(**options)
    assert solution.status in (asm.Status.TIME_LIMIT, asm.Status.STOPPED) and not solution.success
    # What crosses is told, and not left out with pairs that were not updated.
    assert seen(solution._packed, solution._state) == PAIRS and solution.feasibility > 0.1


def test_scenes_of_many_pairs_look_at_the_clock_from_the_first_step():
    assert pauses.is_large(crowd(24).packed().table)
    assert not pauses.is_large(crowd(5).packed().table)
    assert not pauses.is_large(long_arm(20).packed().table)
    assert pauses.is_large(long_arm(40).packed().table)


def test_an_update_that_is_thrown_away_ends_at_once(crowded):
    whole = crowded.solve(max_iterations=0)
    packed = crowded.packed()
    states: list[np.ndarray] = []

    def callback(iteration, objective, feasibility):
        # The first question may come before the first pair, where the machine is busy with something else.
        if seen(packed, asked.watched[0]) > 0:
            states.append(asked.watched[0])
            raise LookupError

    asked = interruption.Interruption(callback=callback)
    with pytest.raises(LookupError):
        crowded._from_start(None, None, {}, asked)
    assert len(states) == 1 and 0 < seen(packed, states[0]) < PAIRS
    again = crowded.solve(max_iterations=0)
    np.testing.assert_array_equal(again.q, whole.q)
    assert again.violations == whole.violations


def test_what_is_waited_for():
    limited = interruption.Interruption(time_limit=100.0)
    assert limited.wait_for("a sum", lambda: 1 + 1) == 2
    with pytest.raises(ZeroDivisionError):
        limited.wait_for("a quotient", lambda: 1 // 0)
    done = threading.Event()
    with pytest.raises(TimeoutError, match="a rest is not known yet when time_limit is over"):
        interruption.Interruption(time_limit=1e-3).wait_for("a rest", lambda: done.wait(60.0))
    assert not done.is_set()
    done.set()


def test_ctrl_c_ends_what_is_waited_for(ctrl_c):
    done = threading.Event()

    def compute():
        os.kill(os.getpid(), signal.SIGINT)
        done.wait(60.0)

    with pytest.raises(KeyboardInterrupt):
        interruption.CTRL_C.wait_for("a rest", compute)
    assert not done.is_set()
    done.set()
