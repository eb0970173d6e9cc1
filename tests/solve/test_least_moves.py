"""Without an objective: what holds is not moved, and moves are measured from where the user put the bodies."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from tests.solve.lower_poses import random_scene, unit_quaternion

SHAPES = (
    asm.shapes.box(1.0, 0.8, 0.6),
    asm.shapes.sphere(0.5),
    asm.shapes.box(3.0, 3.0, 0.1),
    asm.shapes.solid_cylinder(0.4, 1.0),
    asm.shapes.ellipsoid(0.3, 0.5, 0.7),
)


def move(scene, start, q):
    """The objective of a scene that has none, from one pose to another, bodies without a shape."""
    lever = 0.5 * scene.packed().scale
    turned = 1.0 - (start[:, 3:] * q[:, 3:]).sum(axis=1) ** 2
    return ((q[:, :3] - start[:, :3]) ** 2).sum() + 4.0 * lever**2 * turned.sum()


def of_rows(rng):
    """Joints, limits, contacts or clearances of a random scene, and no objective."""
    scene, _ = random_scene(rng, rng.random() < 0.5)
    other = asm.Assembly(scene.bodies)
    other.constrain(*scene.constraints)
    return other


def of_solids(rng):
    """Two or three solids that keep off each other, two of which may touch."""
    count = int(rng.integers(2, 4))
    bodies = [
        asm.Body(
            f"body {k}",
            SHAPES[rng.integers(len(SHAPES))],
            fixed=k == 0,
            position=rng.uniform(-1.6, 1.6, 3),
            quaternion=unit_quaternion(rng),
        )
        for k in range(count)
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    if rng.random() < 0.5:
        scene.constrain(asm.Contact(bodies[0], bodies[1]))
    return scene


def of_placements(rng):
    """Two bodies with a constraint of points or directions, or wheels with a gear."""
    ground, a, b = (asm.Body(name, fixed=name == "ground") for name in ("ground", "a", "b"))
    for body in (a, b):
        body.pose = asm.Pose(rng.normal(size=3), unit_quaternion(rng))
    frames = [body.frame(at=rng.normal(size=3), z=rng.normal(size=3)) for body in (ground, a, b)]
    scene = asm.Assembly([ground, a, b])
    kinds = [asm.Parallel, asm.Perpendicular, asm.PointOnLine, asm.PointOnPlane, asm.Planar, asm.Fixed]
    scene.constrain(kinds[rng.integers(6)](frames[0], frames[1], "first"))
    if rng.random() < 0.5:
        scene.constrain(asm.Distance(frames[1], frames[2], rng.uniform(0.5, 2.0), "apart"))
    else:
        turn = asm.Revolute(frames[0], frames[2], "turn", limits=(-1.0, 2.0))
        screw = asm.Screw(ground.frame(), a, 0.3, "screw") if rng.random() < 0.3 else None
        scene = scene if screw is None else asm.Assembly([ground, a, b])
        scene.constrain(*[item for item in (turn, screw) if item is not None])
        if screw is not None:
            scene.constrain(asm.Gear(turn, screw.freedom("angle"), 2.0))
    return scene


@pytest.mark.parametrize(("kind", "few"), [(of_rows, 60), (of_solids, 15), (of_placements, 30)])
def test_what_holds_is_not_moved_by_a_bit(kind, few, cases):
    tried = 0
    for k in range(cases(few, 1000)):
        scene = kind(np.random.default_rng([k, few]))
        first = scene.solve()
        # Where rounding of far coordinates violates more than the tolerance, what it leaves depends on the start.
        if not first.success or first.feasibility > 2e-13 * scene.packed().scale:
            continue
        for body in scene.bodies:
            if not body.fixed:
                body.pose = first.pose(body)
        tried += 1
        start = scene.q
        # A final update of a clearance that lists another contact counts as an iteration.
        updates = any(isinstance(item, asm.Clearance) for item in scene.constraints)
        for again in (scene.solve(), scene.solve(first)):
            assert again.success and again.iterations <= int(updates)
            np.testing.assert_array_equal(again.q, start)
    assert tried > few // 2


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.0, -2.0, 0.5), (0.0, 3.0, -4.0)])
def test_a_ball_in_a_box_leaves_by_the_nearest_wall_and_says_how_far(place):
    box = asm.Body("box", asm.shapes.box(40, 40, 10), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), position=place)
    scene = asm.Assembly([box, ball])
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    way = solution.pose(ball).position - place
    assert solution.success
    assert abs(solution.pose(ball).position[2]) == pytest.approx(6.0, abs=1e-9)
    # It may turn on its way, which counts as well, and need not be lower than walls that are as near.
    assert solution.objective == pytest.approx(way @ way, abs=1e-6)
    assert solution.objective == pytest.approx((6.0 - abs(place[2])) ** 2, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_scattered_bodies_are_measured_from_where_they_were_given(seed):
    rng = np.random.default_rng(seed)
    bodies = [asm.Body("ground", fixed=True)]
    scene = asm.Assembly(bodies)
    for k in range(4):
        bodies.append(asm.Body(f"link {k}", position=3.0 * rng.normal(size=3), quaternion=unit_quaternion(rng)))
        scene.add(bodies[-1])
        a, b = (body.frame(at=rng.normal(size=3), z=rng.normal(size=3)) for body in bodies[-2:])
        scene.constrain((asm.Revolute, asm.Spherical)[k % 2](a, b, f"joint {k}"))
    start = scene.q
    solution = scene.solve()
    assert solution.success
    assert solution.objective == pytest.approx(move(scene, start, solution.q), rel=1e-12)
    # From there it is none.
    again = scene.solve(solution.q)
    assert again.iterations == 0 and again.objective < 1e-28


def test_a_posture_asks_for_the_least_move():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(3.0, 1.0, 0.0))
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Revolute(ground, arm.frame(at=(2.0, 0.0, 0.0)), "hinge"))
    free = scene.solve()
    scene.minimize(asm.Posture(scene.q))
    asked = scene.solve()
    assert free.success and asked.success and asked.second_order == "minimum"
    assert asked.objective <= free.objective + 1e-12
    assert asked.stationarity <= 1e-10
