"""Threads that use one scene, callbacks that ask for scenes that others have, and processes forked meanwhile."""

from __future__ import annotations

import inspect
import os
import signal
import sys
import time
from threading import Barrier, Event, Thread, get_ident

import numpy as np
import pytest

import assembly as asm
from tests.solve.long_arm import long_arm

# Public functions of a scene that take no turn in its whole length, and why.
# Of an arm whose solve takes several times the 50 ms between callbacks.
LINKS = 150
OF_THEIR_OWN = {
    "interference": "reads bodies and poses alone",
    "study": "takes it until workers have what they need, or to its end in this process",
    "workspace": "has scenes of its own, and takes it to pack the given one",
}


@pytest.fixture(autouse=True)
def switches_often():
    """Threads are switched so often that they meet in all places."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


class FourBar:
    """A driven four-bar, and what is asked of it."""

    def __init__(self):
        ground, crank, rod = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rod", position=(1, 0.5, 0))
        rocker = asm.Body("rocker", position=(4, 0, 0))
        self.drive = asm.Revolute(ground, crank, "drive", angle=0.7)
        pin = asm.Revolute(crank.frame(at=(1.5, 0, 0)), rod, "pin")
        joint = asm.Revolute(rod.frame(at=(4, 0, 0)), rocker.frame(at=(3, 0, 0)), "joint")
        post = asm.Revolute(ground.frame(at=(4, 0, 0)), rocker, "post")
        self.scene = asm.Assembly([ground, crank, rod, rocker])
        self.scene.constrain(self.drive, pin, joint, post)
        self.number, self.measure = asm.Parameter(self.drive, "angle"), asm.Measure(post, name="swing")
        self.tip, self.inputs = rod.point(2.0, 0.5, 0.0), [self.drive]


class Arm:
    """Three links that are drawn to a target, and what is asked of them."""

    def __init__(self):
        bodies = [asm.Body("ground", fixed=True), *(asm.Body(f"link {k}", position=(k, 0.1 * k, 0)) for k in range(3))]
        self.scene = asm.Assembly(bodies)
        self.inputs = [
            asm.Revolute(a.frame(at=(float(k > 0), 0, 0)), b, f"hinge {k}", limits=(-2.5, 2.5))
            for k, (a, b) in enumerate(zip(bodies, bodies[1:], strict=False))
        ]
        self.scene.constrain(*self.inputs)
        self.tip = bodies[-1].point(1, 0, 0)
        goal = asm.PointDistance(self.tip, (1.5, 1.0, 0.0))
        self.scene.minimize(goal, asm.Posture(weight=0.1))
        self.number, self.measure = asm.Parameter(goal, "target", "x"), asm.Measure(self.inputs[1], name="bent")


class Nearest:
    """An arm on a hinge that takes the nearest axes: which these are is packed, anew for another start."""

    def __init__(self):
        ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(0.1, 0.0, 0.0))
        hinge = asm.Revolute(ground, arm, "hinge", angle=0.4, axes="nearest")
        self.scene = asm.Assembly([ground, arm])
        self.scene.constrain(hinge)
        self.number, self.measure = asm.Parameter(hinge, "angle"), asm.Measure(arm, "x", name="x")
        self.tip, self.inputs = arm.point(1, 0, 0), [hinge]


def asked(given):
    """What is asked, by name: each call's answer as bytes."""
    scene, value = given.scene, given.number.value
    first = scene.solve()
    elsewhere = scene.q.copy()
    elsewhere[1:, :3] += 0.05 * np.random.default_rng(1).normal(size=elsewhere[1:, :3].shape)
    if isinstance(given, Nearest):
        elsewhere[1, 3:] = 0.0, 1.0, 0.0, 0.0

    def anew():
        return scene.solve(elsewhere)

    def saved():
        place = given.folder / f"{get_ident()}.json"
        scene.save(place)
        return place.read_text()

    return {
        "solve": lambda: scene.solve().q,
        "elsewhere": lambda: anew().q,
        "warm": lambda: scene.solve(first).q,
        "solve_all": lambda: np.array([s.q for s in scene.solve_all(starts=2)]),
        "solve_many": lambda: scene.solve_many(np.stack([scene.q, elsewhere]), threads=1).q,
        "rows": lambda: scene.solve_many(first, parameters={given.number: [value, value + 0.01]}, threads=1).q,
        "mobility": lambda: scene.mobility(elsewhere).singular_values,
        "mobility of it": lambda: anew().mobility.free_motions,
        "second order": lambda: repr(anew().second_order),
        "pose error": lambda: anew().pose_error,
        "wrenches": lambda: np.array([w.vector for of in anew().wrenches.values() for w in of.values()]),
        "save": saved,
        "sensitivity": lambda: asm.sensitivity(scene, scene.solve(first), given.measure, given.number).matrix,
        "response": lambda: asm.Response(scene, given.measure, given.number, start=first)([value + 0.01]),
        "jacobian": lambda: asm.tip_jacobian(scene, given.tip, given.inputs, elsewhere),
        "play": lambda: asm.play(scene, scene.solve(first), given.measure).width,
        "tracker": lambda: scene.tracker(given.tip, q0=first).q,
        "tolerances": lambda: (
            asm.tolerances(
                scene, scene.solve(first), given.measure, {given.number: asm.Normal(0.01)}, samples=3
            ).samples.values
        ),
        "study": lambda: asm.study(scene, asm.grid({given.number: [value, value + 0.02]}), given.measure)[
            given.measure.name
        ],
        "follow": lambda: asm.follow(scene, given.number, value - 0.05, value + 0.05, of=given.measure).table,
    }


def answers(call, seconds):
    """What a call answers, again and again for a while, each answer once."""
    found, end = set(), time.perf_counter() + seconds
    while time.perf_counter() < end:
        found.add(answer(call))
    return found


def answer(call):
    try:
        told = call()
    except asm.errors.InputError as error:
        return f"refused: {error}"
    return told if isinstance(told, str) else np.asarray(told).tobytes()


def together(*works):
    """What each of several functions returns that threads run at once; none may wait for ever."""
    barrier, found = Barrier(len(works)), [None] * len(works)

    def run(k):
        barrier.wait()
        found[k] = works[k]()

    threads = [Thread(target=run, args=(k,), daemon=True) for k in range(len(works))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120.0)
    assert not any(thread.is_alive() for thread in threads), "threads wait for each other"
    return found


# Calls that write, each in its way: where a solve begins, other numbers for a while, another packing.
WRITERS = ["elsewhere", "tolerances", "study"]
# Of joints that take nearest axes solutions are those of the last start: calls that solve and then ask of the solution
# depend on what another thread solves in between.
AT_ONCE = ["solve", "elsewhere", "warm", "solve_all", "solve_many", "mobility"]


@pytest.mark.parametrize("kind", [FourBar, Arm, Nearest])
def test_calls_of_threads_answer_as_one_after_the_other(kind, tmp_path):
    given = kind()
    given.folder = tmp_path
    calls = asked(given)
    if kind is Nearest:
        calls = {name: calls[name] for name in AT_ONCE}
    alone = {name: {answer(call) for _ in range(3)} for name, call in calls.items()}
    # Each a second time, after all the others.
    for name, call in calls.items():
        alone[name].add(answer(call))
    wrong = []
    for name, call in calls.items():
        for writer in AT_ONCE if kind is Nearest else WRITERS:
            found = together(lambda c=call: answers(c, 0.03), lambda c=calls[writer]: answers(c, 0.03))
            wrong += [(name, writer)] * (not found[0] <= alone[name] or not found[1] <= alone[writer])
    assert not wrong


def test_every_public_call_of_a_scene_takes_its_turn():
    without = set()
    for name in asm.__all__:
        call = getattr(asm, name)
        if inspect.ismodule(call):
            # Where a command of the same name was imported, that stands for the function.
            call = getattr(call, name, None)
        if not inspect.isfunction(call):
            continue
        first = next(iter(inspect.signature(call).parameters.values()), None)
        if first is not None and "Assembly" in str(first.annotation) and not hasattr(call, "__wrapped__"):
            without.add(name)
    assert without == set(OF_THEIR_OWN)
    for call in (asm.Assembly.at, asm.Assembly.mobility, asm.Assembly.save, asm.reference.solve):
        assert hasattr(call, "__wrapped__"), call


def test_a_scene_may_be_named():
    given = FourBar()
    assert asm.follow(scene=given.scene, parameter=given.number, low=0.6, high=0.8).table.size
    with pytest.raises(TypeError, match="expected an Assembly"):
        asm.follow(scene="scene", parameter=given.number, low=0.6, high=0.8)
    with pytest.raises(TypeError, match="scene"):
        asm.follow()


def callback_that(act):
    """A callback of a solve that acts once."""
    acted = []

    def callback(*_):
        if not acted:
            acted.append(True)
            act()

    return callback


@pytest.mark.parametrize("count", [2, 3])
def test_callbacks_that_solve_each_others_scenes_do_not_wait_for_ever(count):
    scenes = [long_arm(LINKS) for _ in range(count)]
    expected = scenes[0].solve(max_iterations=10_000).q
    starts = [scene.solve(max_iterations=1) for scene in scenes]
    inside = Barrier(count)
    found = [None] * count

    def work(k):
        def act():
            # By now each thread has the turn of its own scene.
            inside.wait(60.0)
            other = (k + 1) % count
            solution = scenes[other].solve(max_iterations=10_000)
            found[k] = solution.q, scenes[other].mobility().dof, starts[other].mobility.dof

        return scenes[k].solve(callback=callback_that(act), max_iterations=10_000).q

    outer = together(*(lambda k=k: work(k) for k in range(count)))
    for k in range(count):
        np.testing.assert_array_equal(outer[k], expected)
        np.testing.assert_array_equal(found[k][0], expected)
        assert found[k][1:] == (LINKS, LINKS)


def test_a_callback_that_asks_for_its_own_scene_is_given_a_copy():
    scene, found = long_arm(LINKS), []
    expected, dof = scene.solve(max_iterations=10_000).q, scene.mobility().dof

    def act():
        found.append(scene.mobility().dof)
        found.append([s.q for s in scene.solve_all(starts=1)])
        found.append(scene.solve(max_iterations=10_000).q)

    np.testing.assert_array_equal(scene.solve(callback=callback_that(act), max_iterations=10_000).q, expected)
    assert found[0] == dof
    np.testing.assert_array_equal(found[2], expected)


def test_who_waits_gets_the_turn_and_a_callback_waits_for_another_scene():
    scene, other = long_arm(LINKS), long_arm(LINKS)
    expected, held, found = other.solve(max_iterations=10_000).q, Event(), []

    def hold():
        other.solve(callback=callback_that(lambda: (held.set(), time.sleep(0.2))), max_iterations=10_000)

    def ask():
        held.wait(60.0)
        before = time.perf_counter()
        act = callback_that(lambda: found.append((other.solve(max_iterations=10_000).q, time.perf_counter() - before)))
        scene.solve(callback=act, max_iterations=10_000)

    together(hold, ask)
    np.testing.assert_array_equal(found[0][0], expected)
    # It waited, as nobody waited for it.
    assert found[0][1] > 0.1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_process_forked_while_a_thread_solves_can_solve():
    scene, ends = long_arm(LINKS), Event()
    expected = scene.solve(max_iterations=10_000).q
    inside = Event()
    ball, cube = asm.Body("ball", asm.shapes.sphere(1.0)), asm.Body("cube", asm.shapes.box(1, 1, 1), position=(3, 0, 0))

    def work():
        scene.solve(callback=callback_that(lambda: (inside.set(), ends.wait(60.0))), max_iterations=10_000)

    thread = Thread(target=work, daemon=True)
    thread.start()
    inside.wait(60.0)
    child = os.fork()
    if not child:
        code = 1
        try:
            signal.alarm(60)
            same = np.array_equal(scene.solve(max_iterations=10_000).q, expected) and np.array_equal(
                scene.solve(max_iterations=10_000).q, expected
            )
            apart = asm.proximity.distance(ball, cube)
            # The scene itself was solved, not a copy each time.
            code = 0 if same and not scene._turn.is_busy and apart is not None else 2
        finally:
            os._exit(code)
    ends.set()
    thread.join(60.0)
    assert os.waitpid(child, 0)[1] == 0
    np.testing.assert_array_equal(scene.solve(max_iterations=10_000).q, expected)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_who_forks_in_a_callback_goes_on_in_both_processes():
    scene, children = long_arm(LINKS), []
    expected = scene.solve(max_iterations=10_000).q

    def act():
        children.append(os.fork())
        if not children[0]:
            signal.alarm(60)

    code = 1
    try:
        found = scene.solve(callback=callback_that(act), max_iterations=10_000).q
        again = scene.solve(max_iterations=10_000).q
        code = 0 if np.array_equal(found, expected) and np.array_equal(again, expected) else 2
    finally:
        if children and not children[0]:
            os._exit(code)
    assert code == 0
    assert os.waitpid(children[0], 0)[1] == 0
