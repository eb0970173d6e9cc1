"""Rows that repeat each other and disagree: SOLVED, FITTED or INFEASIBLE with names, never without a name."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from tests.solve.redundant import (
    MECHANISMS,
    bennett,
    contradiction,
    fixed_twice,
    four_bar,
    free_four_bar,
    least_squares_step,
    parallelogram,
)

# What is wrong in one frame, for errors in parts of the mechanism's size.
KINDS = {
    "tilt": lambda e, size: {"tilt": e},
    "across": lambda e, size: {"shift": (e * size, 0.0, 0.0)},
    "along": lambda e, size: {"shift": (0.0, 0.0, e * size)},
}
SIZES = {"four_bar": 6.0, "free_four_bar": 6.0, "parallelogram": 4.0, "bennett": 3.0}
# Rows hold to 2e-13, and what they disagree by is found to a millionth.
HELD = 2e-12


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("make", MECHANISMS, ids=lambda make: make.__name__)
def test_errors_of_all_sizes(make, kind, cases):
    size = SIZES.get(make.__name__, 2.0)
    seen = []
    for power in np.linspace(-13.0, -2.0, cases(8, 45)):
        scene = make(KINDS[kind](10.0**power, size))
        solution = scene.solve()
        seen.append(solution.status)
        assert solution.iterations <= 20, (power, solution)
        if solution.status is asm.Status.INFEASIBLE:
            assert not solution.success and solution.conflicting, (power, solution)
            assert "conflicting: '" in solution.message
            continue
        assert solution.success and solution.mobility.dof == MECHANISMS[make], (power, solution)
        here, step = least_squares_step(scene, solution.mobility.size, solution.q)
        # What is left of the rows no step changes: the pose is one of least squares.
        assert np.abs(step).max() < 10.0 * HELD, (power, np.abs(step).max())
        assert np.abs(here).max() == pytest.approx(max(solution._largest(solution.mobility.size).values()), abs=HELD)
        if solution.status is asm.Status.FITTED:
            assert 0.0 < np.abs(here).max() <= 1e-6
            named = solution.disagreeing
            assert named and all(repr(name) in solution.message for name in named)
            assert max(named.values()) == pytest.approx(solution.feasibility, abs=HELD * size)
            assert set(named) <= set(solution.mobility.redundant)
        else:
            assert solution.status is asm.Status.SOLVED and np.abs(here).max() < HELD and not solution.disagreeing
    order = [asm.Status.SOLVED, asm.Status.FITTED, asm.Status.INFEASIBLE]
    places = [order.index(status) for status in seen]
    # The lengths of a planar linkage may be any, and a slide may be shifted along itself.
    if (make.__name__, kind) in (("four_bar", "across"), ("free_four_bar", "across"), ("two_slides", "along")):
        assert set(seen) == {asm.Status.SOLVED}
    else:
        assert places == sorted(places) and set(places) == {0, 1, 2}


def test_what_may_disagree_is_told():
    error = {"shift": (0.0, 0.0, 1e-5)}
    assert fixed_twice(error).solve().status is asm.Status.INFEASIBLE
    wide = fixed_twice(error).solve(fit=1e-4)
    assert wide.status is asm.Status.FITTED and wide.mobility.dof == 0 and "disagree" in str(wide.mobility)
    # Half of it each, less what a turn takes: joints are two lengths apart, and lengths count over sqrt(5).
    assert wide.disagreeing == pytest.approx({"once": 4e-6, "twice": 4e-6}, rel=1e-5)
    assert str(wide).startswith("FITTED: ") and "'once' (4e-06)" in str(wide)


@pytest.mark.parametrize("off", [1e-10, 1e-9, 1e-7])
def test_strictly_nothing_may(off):
    scene = fixed_twice({"shift": (0.0, 0.0, off)})
    solution = scene.solve(fit=0.0)
    assert solution.status is asm.Status.INFEASIBLE and solution.conflicting_sets == [("once", "twice")]
    assert solution.iterations <= 20 and scene.solve().status is asm.Status.FITTED


@pytest.mark.parametrize("fit", [-1e-9, 0.1, np.nan, "close"])
def test_bad_fits(fit):
    with pytest.raises((InputError, TypeError), match="fit"):
        four_bar({}).solve(fit=fit)


@pytest.mark.parametrize("make", [four_bar, parallelogram, bennett], ids=lambda make: make.__name__)
def test_sweeps_know_what_disagreed(make):
    scene = make({"tilt": 1e-7, "shift": (0.0, 0.0, 1e-7)})
    drive = scene.constraints[0]
    solution = scene.solve()
    # Not over the dead center of the parallelogram.
    for angle in np.linspace(drive.angle, drive.angle + 2.0, 40):
        drive.angle = angle
        solution = scene.solve(solution)
        assert solution.status is asm.Status.FITTED and solution.iterations <= 8, solution
        _, step = least_squares_step(scene, solution.mobility.size, solution.q)
        assert np.abs(step).max() < 10.0 * HELD
    again = scene.solve(solution)
    assert again.status is asm.Status.FITTED and again.iterations <= 4
    assert again.disagreeing == pytest.approx(solution.disagreeing, rel=1e-4)
    # Strictly, what is known of it is of no use.
    assert not scene.solve(solution, fit=0.0).success


def test_what_disagrees_no_more_is_solved():
    scene = asm.Assembly([asm.Body("ground", fixed=True), asm.Body("arm")])
    first, second = (asm.Revolute(*scene.bodies, name, angle=0.3) for name in ("first", "second"))
    scene.constrain(first, second)
    second.angle = 0.3 + 1e-8
    solution = scene.solve()
    assert solution.status is asm.Status.FITTED and solution.disagreeing == pytest.approx(
        {"first": 5e-9, "second": 5e-9}, rel=1e-5
    )
    second.angle = 0.3
    solution = scene.solve(solution)
    assert solution.status is asm.Status.SOLVED and not solution.disagreeing
    second.angle = 0.4
    solution = scene.solve(solution)
    assert solution.status is asm.Status.INFEASIBLE and solution.conflicting == ["first", "second"]


def test_objectives_are_at_their_minimum():
    # A door on two hinges that are off, its handle drawn to a place.
    ground, door = asm.Body("ground", fixed=True), asm.Body("door")
    scene = asm.Assembly([ground, door])
    scene.constrain(
        asm.Revolute(ground, door, "low"),
        asm.Revolute(ground.frame(at=(0, 0, 2.0 + 2e-7)), door.frame(at=(0, 0, 2)), "high"),
    )
    scene.minimize(asm.PointDistance(door.point(1, 0, 1), target=(-3, 0.1, 1)))
    solution = scene.solve()
    assert solution.status is asm.Status.FITTED and solution.stationarity < 1e-9
    x, y, z = solution.pose(door).apply((1, 0, 1))
    assert np.arctan2(y, x) == pytest.approx(np.arctan2(0.1, -3.0), abs=1e-9) and z == pytest.approx(
        1.0 + 1e-7, abs=1e-12
    )
    # From the maximum on the other side, too.
    door.pose = asm.Pose((0, 0, 0), (np.cos(-0.5 * np.arctan2(0.1, 3.0)), 0, 0, np.sin(-0.5 * np.arctan2(0.1, 3.0))))
    solution = scene.solve()
    assert solution.status is asm.Status.FITTED and solution.objective == pytest.approx((np.hypot(3, 0.1) - 1.0) ** 2)


def test_limits_hold():
    # Driven to a little beyond its stop: the drive is off, the stop is not passed.
    ground, door = asm.Body("ground", fixed=True), asm.Body("door")
    scene = asm.Assembly([ground, door])
    scene.constrain(
        asm.Revolute(ground, door, "stop", limits=(-1.0, 0.5)), asm.Revolute(ground, door, "drive", angle=0.5 + 1e-7)
    )
    solution = scene.solve()
    assert solution.status is asm.Status.FITTED and solution.values["stop.angle"] == pytest.approx(0.5, abs=1e-12)
    assert solution.disagreeing == pytest.approx({"drive": 1e-7}, rel=1e-5)
    assert scene.solve(solution).status is asm.Status.FITTED


@pytest.mark.parametrize("off", [1e-8, 1e-7])
def test_contacts_hold_where_joints_are_fitted(off):
    # A ball that touches the floor and is held at two places of a line that goes up: joints disagree, it touches.
    floor = asm.Body("floor", asm.shapes.plane(20, 20), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), (0.1, 0.0, 1.2))
    scene = asm.Assembly([floor, ball])
    scene.constrain(
        asm.Contact(floor, ball, "touch"),
        asm.Fixed(floor.frame(at=(0, 0, 1.0 + off)), ball.frame(), "held"),
        asm.Spherical(floor.frame(at=(0.0, off, 1.0)), ball.frame(), "held again"),
    )
    solution = scene.solve()
    assert solution.status is asm.Status.FITTED and solution.violations["touch"] < 1e-11
    assert solution.pose(ball).position[2] == pytest.approx(1.0, abs=1e-11)
    assert set(solution.disagreeing) == {"held", "held again"}


@pytest.mark.parametrize("off", [1e-9, 1e-8, 1e-6, 1e-3])
def test_contacts_that_contradict_are_not_fitted(off):
    # A ball between a floor and a ceiling that are too far apart to touch both.
    ball = asm.Body("ball", asm.shapes.sphere(1.0), (0.1, 0.2, 1.1))
    floor = asm.Body("floor", asm.shapes.plane(20, 20), fixed=True)
    ceiling = asm.Body("ceiling", asm.shapes.plane(20, 20), (0, 0, 2.0 + off), (0, 1, 0, 0), fixed=True)
    scene = asm.Assembly([floor, ceiling, ball])
    scene.constrain(asm.Contact(floor, ball, "below"), asm.Contact(ceiling, ball, "above"))
    solution = scene.solve()
    assert solution.status is asm.Status.INFEASIBLE and solution.conflicting_sets == [("below", "above")], solution


def test_contradictions_are_infeasible_and_named(cases):
    steps = []
    for seed in range(cases(60, 1000)):
        scene = contradiction(np.random.default_rng(seed))
        solution = scene.solve()
        assert solution.status is asm.Status.INFEASIBLE and solution.conflicting, (seed, solution)
        steps.append(solution.iterations)
    assert np.median(steps) <= 10


def test_distant_bodies_do_not_matter():
    # The disagreement is of the rows, whatever the bodies' origins are.
    scenes = []
    for far in (0.0, 1000.0):
        ground, plate = asm.Body("ground", fixed=True), asm.Body("plate", position=(-far, 0.1, 0))
        scene = asm.Assembly([ground, plate])
        scene.constrain(
            asm.Revolute(ground, plate.frame(at=(far, 0, 0)), "low"),
            asm.Revolute(ground.frame(at=(0, 0, 2 + 1e-6)), plate.frame(at=(far, 0, 2)), "high"),
        )
        scenes.append(scene.solve())
    near, far = scenes
    assert near.status is far.status is asm.Status.FITTED and near.mobility.dof == far.mobility.dof == 1
    assert far.disagreeing == pytest.approx(near.disagreeing, rel=1e-3)


def test_what_is_tracked_is_fitted():
    # Two hinges that are off by a little, their door led by its handle.
    ground, door = asm.Body("ground", fixed=True), asm.Body("door")
    scene = asm.Assembly([ground, door])
    scene.constrain(
        asm.Revolute(ground, door, "low"),
        asm.Revolute(ground.frame(at=(1e-7, 0, 2)), door.frame(at=(0, 0, 2)), "high"),
    )
    tracker = scene.tracker(door.point(1, 0, 1))
    for turn in np.linspace(0.0, 3.0, 60):
        step = tracker.step((np.cos(turn), np.sin(turn), 1.0))
        assert step.feasibility <= 1e-7 and step.status in (asm.TrackStatus.FOLLOWED, asm.TrackStatus.APPROACHING)
    step = tracker.step((np.cos(turn), np.sin(turn), 1.0))
    assert step.status is asm.TrackStatus.FOLLOWED and step.solution.status is asm.Status.FITTED
    x, y, _ = step.solution.pose(door).apply((1, 0, 1))
    assert np.arctan2(y, x) == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize("off", [1e-10, 1e-7, 1e-5])
def test_wheels_of_a_closed_train(off):
    ground, *wheels = (asm.Body(name, fixed=name == "ground") for name in ("ground", "a", "b", "c"))
    scene = asm.Assembly([ground, *wheels])
    pins = [asm.Revolute(ground.frame(at=(k, 0, 0)), wheel, f"pin {k}") for k, wheel in enumerate(wheels)]
    gears = [asm.Gear(pins[k], pins[(k + 1) % 3], ratio, f"gear {k}") for k, ratio in enumerate((-2.0, -0.5, 1.0))]
    gears[2].offset = off
    scene.constrain(*pins, *gears)
    solution = scene.solve()
    assert solution.iterations <= 20 and solution.mobility.dof == 1
    if off > 1e-6:
        assert solution.status is asm.Status.INFEASIBLE and solution.conflicting == ["gear 0", "gear 1", "gear 2"]
        return
    # The least squares of (b + 2 a, c + b / 2, a - c - off).
    shares = np.array([-0.5, 1.0, 1.0]) / 2.25
    assert solution.status is asm.Status.FITTED
    assert solution.disagreeing == pytest.approx({f"gear {k}": abs(s) * off for k, s in enumerate(shares)}, rel=1e-3)


@pytest.mark.parametrize("off", [1e-10, 1e-7, 1e-5])
def test_a_linkage_out_of_reach(off):
    # A crank and a rod that are to be longer than they are: straight they are off least.
    ground, crank, rod, slider = (
        asm.Body(name, fixed=name == "ground") for name in ("ground", "crank", "rod", "slider")
    )
    scene = asm.Assembly([ground, crank, rod, slider])
    x = (1, 0, 0)
    scene.constrain(
        asm.Revolute(ground, crank, "drive"),
        asm.Revolute(crank.frame(at=(1, 0, 0)), rod, "pin"),
        asm.Revolute(rod.frame(at=(2, 0, 0)), slider, "wrist"),
        asm.Prismatic(ground.frame(z=x), slider.frame(z=x), "guide", slide=3.0 * (1.0 + off)),
    )
    solution = scene.solve()
    status = asm.Status.FITTED if off < 1e-6 else asm.Status.INFEASIBLE
    assert solution.status is status and solution.iterations <= 20
    assert abs(solution.values["drive.angle"]) < 1e-6 and abs(solution.values["pin.angle"]) < 1e-6
    named = solution.disagreeing or solution.conflicting
    assert set(named) == {"drive", "guide", "pin", "wrist"}
    if solution.success:
        assert sum(named.values()) == pytest.approx(3.0 * off, rel=1e-3)


def test_a_bent_linkage_that_all_but_reaches_is_fitted():
    # Straight it is off least, and on the way there the violation becomes level: no step can reduce it, though its
    # singular value is not that of rows that repeat each other.
    for seed in (7, 11, 19):
        rng = np.random.default_rng(seed)
        off, (a, b), bend = 10.0 ** rng.uniform(-10.5, -6.3), rng.uniform(0.2, 3.0, 2), 10.0 ** rng.uniform(-4.0, -0.5)
        ground = asm.Body("ground", fixed=True)
        crank = asm.Body("crank", quaternion=(np.cos(0.5 * bend), 0.0, 0.0, np.sin(0.5 * bend)))
        rod, slider = asm.Body("rod", position=(a, 0.0, 0.0)), asm.Body("slider", position=(a + b, 0.0, 0.0))
        scene = asm.Assembly([ground, crank, rod, slider])
        x = (1, 0, 0)
        scene.constrain(
            asm.Revolute(ground, crank, "drive"),
            asm.Revolute(crank.frame(at=(a, 0, 0)), rod, "pin"),
            asm.Revolute(rod.frame(at=(b, 0, 0)), slider, "wrist"),
            asm.Prismatic(ground.frame(z=x), slider.frame(z=x), "guide", slide=(a + b) * (1.0 + off)),
        )
        solution = scene.solve()
        assert solution.status is asm.Status.FITTED, seed
        assert sum(solution.disagreeing.values()) == pytest.approx((a + b) * off, rel=1e-2), seed


@pytest.mark.parametrize("off", [-4.7e-6, 2e-6, 4.9e-6])
def test_only_what_is_mended_nearby_is_no_disagreement(off):
    # Nothing drives it: along its freedom slopes of a few parts of what it is off would mend a part of it, far away.
    solution = free_four_bar({"shift": (0.0, 0.0, 6.0 * off)}).solve()
    assert solution.status is asm.Status.FITTED and solution.iterations <= 6
    assert set(solution.disagreeing) == {"drive", "elbow", "wrist", "swing"}


@pytest.mark.parametrize("make", MECHANISMS, ids=lambda make: make.__name__)
def test_errors_of_all_kinds_at_once(make, cases):
    # An undriven linkage beyond `fit` is off by less and less along its freedom, for as far as it moves: that is no
    # reason to follow it.
    rng = np.random.default_rng(0)
    size = SIZES.get(make.__name__, 2.0)
    for k in range(cases(20, 300)):
        tilt, *shift = 10.0 ** rng.uniform(-13.0, -2.0, 4) * rng.choice([-1.0, 1.0], 4) * (rng.random(4) < 0.6)
        solution = make({"tilt": tilt, "shift": tuple(size * one for one in shift)}).solve()
        assert solution.iterations <= 20, (k, solution)
        if solution.status is asm.Status.INFEASIBLE:
            assert solution.conflicting, (k, solution)
        else:
            assert solution.success, (k, solution)
