"""Contacts of solids: they roll over edges, stand on edges and corners, and say which features touch."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.program import records as layout
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.features.solid_contact import FEATURE_F, FEATURE_G
from tests.laws.loop_point import LoopPoint, moved
from tests.laws.witness import OFFSETS, SLOPE

TURNED = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
# Half extents of the box and the radius of what rolls over it.
X, Y, Z, R = 2.0, 2.0, 1.0, 0.5


def about(axis, angle):
    """A quaternion."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis])


def box(name="box", **pose):
    return asm.Body(name, asm.shapes.plate(2.0 * X, 2.0 * Y, 2.0 * Z), **pose)


def distance_to_box(p):
    """Of a point from the box about the origin; below its surface it is negative."""
    q = np.abs(p) - [X, Y, Z]
    return np.linalg.norm(np.maximum(q, 0.0)) + min(q.max(), 0.0)


def ball_on_box(start, target, unilateral=False, **more):
    ground = box(fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(R), start, TURNED)
    scene = asm.Assembly([ground, ball])
    scene.constrain(asm.Contact(ground, ball, "touch", unilateral))
    wish = asm.PointDistance(ball.point(0.0, 0.0, 0.0), target)
    scene.minimize(wish)
    return scene, ball, wish


def nearest(target):
    """Where the center of a ball that touches the box is nearest to a target: outside of the box only."""
    foot = np.clip(target, [-X, -Y, -Z], [X, Y, Z])
    way = np.asarray(target) - foot
    return foot + R * way / np.linalg.norm(way)


TARGETS = [
    ((0.5, 0.3, 1.8), 0),
    ((1.9, 0.3, 1.7), 0),
    ((2.2, 0.4, 1.6), 1),
    ((2.5, 0.5, 1.2), 1),
    ((2.7, 0.6, 0.6), 0),
    ((2.5, 1.9, 0.2), 0),
    ((2.3, 2.6, 0.1), 1),
    ((2.4, 2.5, 1.5), 2),
    ((1.0, 2.5, 1.4), 1),
]


def kind_of(feature):
    return ("face", "edge", "vertex").index(feature.split()[0])


def test_a_ball_rolls_over_edges_and_corners():
    scene, ball, wish = ball_on_box((0.3, 0.2, 1.6), TARGETS[0][0])
    solution = scene.solve()
    for target, kind in TARGETS:
        wish.target = np.array(target)
        solution = scene.solve(solution)
        assert solution.success, (target, solution.message)
        center = solution.pose(ball).position
        np.testing.assert_allclose(center, nearest(target), rtol=0, atol=1e-8)
        pair = solution.contacts["touch"]
        assert abs(distance_to_box(center) - R) < 1e-9 and abs(pair.gap) < 1e-9
        assert kind_of(pair.features[0]) == kind and pair.features[1].startswith("face")
        # The normal points from the box to the ball, and pushes it against what draws it.
        np.testing.assert_allclose(pair.normal, (center - pair.points[0]) / R, rtol=0, atol=1e-7)
        slope = 2.0 * (center - target)
        np.testing.assert_allclose(solution.multipliers["touch"][0] * pair.normal, -slope, rtol=0, atol=1e-6)
        np.testing.assert_allclose(solution.wrenches["touch"]["ball"].force, slope, rtol=0, atol=1e-6)


@pytest.mark.parametrize("target", [TARGETS[1][0], TARGETS[3][0], TARGETS[7][0]])
def test_the_same_places_are_found_from_afar_and_from_within(target):
    for start in ((0.5, 0.4, 6.0), (4.0, 3.0, 3.0), (1.7, 0.3, 1.2)):
        scene, ball, _ = ball_on_box(start, target)
        solution = scene.solve()
        assert solution.success, solution.message
        np.testing.assert_allclose(solution.pose(ball).position, nearest(target), rtol=0, atol=1e-8)


def test_a_one_sided_contact_binds_and_lets_go():
    scene, ball, wish = ball_on_box((0.3, 0.2, 3.0), (0.5, 0.3, 4.0), unilateral=True)
    solution = scene.solve()
    assert solution.success
    np.testing.assert_allclose(solution.pose(ball).position, (0.5, 0.3, 4.0), rtol=0, atol=1e-9)
    assert solution.multipliers["touch"][0] == 0.0
    for target in ((0.5, 0.3, 1.2), (2.3, 0.3, 1.3), (4.0, 0.0, 0.0), (2.2, 0.1, 0.2)):
        wish.target = np.array(target)
        solution = scene.solve(solution)
        assert solution.success, (target, solution.message)
        outside = distance_to_box(np.array(target)) >= R
        center = solution.pose(ball).position
        if outside:
            np.testing.assert_allclose(center, target, rtol=0, atol=1e-9)
        else:
            assert distance_to_box(center) == pytest.approx(R, abs=1e-9)
            assert solution.multipliers["touch"][0] < 0.0
            np.testing.assert_allclose(center, nearest(target), rtol=0, atol=1e-8)


def test_a_cylinder_rolls_off_the_edge():
    """A lying roller: its wall on the top, then on the edge, then on the side."""
    ground = box(fixed=True)
    roller = asm.Body("roller", asm.shapes.solid_cylinder(R, 1.0), (1.5, 0.0, Z + R), about((1, 0, 0), 0.5 * np.pi))
    scene = asm.Assembly([ground, roller])
    guide = asm.Planar(ground.frame(z=(0, 1, 0)), roller.frame(z=(0, 0, -1)), "guide")
    scene.constrain(asm.Contact(ground, roller, "touch"), guide)
    wish = asm.PointDistance(roller.point(0.0, 0.0, 0.0), (0.5, 0.0, 1.7))
    scene.minimize(wish)
    solution = None
    for angle in np.linspace(-0.6, 1.2, 7):
        # Around the upper right edge, from the top to the side.
        target = np.array([X, 0.0, Z]) + 0.8 * np.array([np.sin(angle), 0.0, np.cos(angle)])
        wish.target = target
        solution = scene.solve(solution)
        assert solution.success, (angle, solution.message)
        center = solution.pose(roller).position
        expected = nearest([target[0], 0.0, target[2]])
        np.testing.assert_allclose(center[[0, 2]], expected[[0, 2]], rtol=0, atol=1e-8)
        assert abs(solution.contacts["touch"].gap) < 1e-9


def test_a_box_stands_on_an_edge_and_on_a_corner():
    """A tilted box that is to be low: an edge, or a corner, touches the top of the other one."""
    for axis, angle in (((0.0, 1.0, 0.0), 0.4), ((1.0, 2.0, 0.0), 0.5)):
        turn = about(axis, angle)
        ground, top = box("ground", fixed=True), asm.Body("top", asm.shapes.plate(1.0, 1.0, 1.0), (0.1, 0.2, 2.5), turn)
        scene = asm.Assembly([ground, top])
        back = rotation_matrix(turn).T
        led = top.frame(z=back[:, 2], x=back[:, 0])
        pin = asm.Prismatic(ground.frame((0.1, 0.2, 0.0), x=(1.0, 0.0, 0.0)), led, "pin")
        scene.constrain(asm.Contact(ground, top, "touch"), pin)
        solution = scene.solve()
        assert solution.success, solution.message
        corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        lowest = solution.pose(top).apply(corners)[:, 2].min()
        assert lowest == pytest.approx(Z, abs=1e-9)


def test_edge_on_edge():
    """A box turned on its edge lies across an edge of the other one."""
    ground = box("ground", quaternion=about((0, 1, 0), 0.25 * np.pi), fixed=True)
    turn = about((1, 0, 0), 0.25 * np.pi)
    bar = asm.Body("bar", asm.shapes.plate(6.0, 1.0, 1.0), (0.1, 0.2, 4.0), turn)
    scene = asm.Assembly([ground, bar])
    scene.constrain(asm.Contact(ground, bar, "touch"))
    # The least move: a pull downward would lay the bar's edge along a face, where one contact is not smooth.
    solution = scene.solve()
    assert solution.success, solution.message
    pair = solution.contacts["touch"]
    assert [feature.split()[0] for feature in pair.features] == ["edge", "edge"]
    assert abs(pair.gap) < 1e-9


def differences(rows, n, step):
    columns = []
    for j in range(n):
        way = np.zeros(n)
        way[j] = step
        columns.append(np.tensordot(SLOPE, [rows(offset * way) for offset in OFFSETS], 1) / step)
    return np.stack(columns, -1)


# Where an egg is put, and the kinds of features of the box and the egg that are closest.
PLACES = [((0.3, 0.2, 2.2), 0), ((2.6, 0.3, 1.7), 1), ((2.6, 2.5, 1.6), 2), ((2.3, 0.3, 1.2), 1)]


@pytest.mark.parametrize(("place", "kind"), PLACES, ids=str)
def test_the_gap_and_its_derivatives(place, kind):
    rng = np.random.default_rng(2)
    turn = rng.normal(size=4)
    egg = asm.Body("egg", asm.shapes.ellipsoid(0.5, 0.6, 0.7), place, turn / np.linalg.norm(turn))
    ground = box(quaternion=about((1, 2, 3), 1e-3))
    scene = asm.Assembly([ground, egg])
    scene.constrain(asm.Contact(ground, egg))
    point = LoopPoint(scene, scene.q)
    faces, edges = 6, 12
    found = [int(point.tracked[0, column]) for column in (FEATURE_F, FEATURE_G)]
    assert (found[0] >= faces) + (found[0] >= faces + edges) == kind and found[1] == 0
    assert point.table[point.table[layout.ROW_TABLE] + layout.SHELL_F] >= 0
    ways = np.linalg.qr(rng.normal(size=(12, 12)))[0]

    def at(steps):
        return LoopPoint(scene, moved(scene, scene.q, ways @ steps), point.tracked)

    slopes = differences(lambda d: at(d).residual, 12, 4e-4)
    np.testing.assert_allclose(point.jacobian() @ ways, slopes, rtol=0, atol=1e-9)
    curves = ways.T @ differences(lambda d: at(d).jacobian()[0], 12, 4e-4)
    # The gradient in twists turns with the bodies: its derivative's symmetric part is the second derivative.
    hessian = ways.T @ point.row_terms([1.0]) @ ways
    # Differences of gradients over 4e-4 leave about 1e-8 where the egg is most curved.
    np.testing.assert_allclose(hessian, 0.5 * (curves + curves.T), rtol=0, atol=2e-8)


@pytest.mark.parametrize("unilateral", [False, True])
@pytest.mark.parametrize("target", [(0.01, 0.0, 0.6), (0.2, 0.1, 0.5), (0.0, 0.0, 0.3)])
@pytest.mark.parametrize("start", [(0.0, 0.0, 2.0), (1.2, 0.3, 2.0)])
def test_a_ball_over_a_hole_is_held_by_the_near_side_of_its_rim(start, target, unilateral):
    # As its center crosses the hole's axis the nearest point of the rim is the farthest one, and stationary still:
    # balls sank until that point was touched, and ended SOLVED. Over the axis is a kink, which no single row can hold.
    plate = asm.Body("plate", asm.shapes.plate(4, 4, 0.5, [(0, 0, 0.5)]), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), start)
    scene = asm.Assembly([plate, ball])
    scene.constrain(asm.Contact(plate, ball, unilateral=unilateral))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), target))
    solution = scene.solve()
    x, y, z = solution.q[1, :3]
    gap = np.hypot(np.hypot(x, y) - 0.5, z - 0.25) - 1.0
    # What is said of the pose is so; one that is not SOLVED may be off by the violation that it tells.
    assert gap > -solution.feasibility - 1e-12
    assert unilateral or abs(gap) <= solution.feasibility + 1e-12


def test_a_hand_draws_no_ball_through_the_rim_of_a_hole(cases):
    plate = asm.Body("plate", asm.shapes.plate(4, 4, 0.5, [(0, 0, 0.5)]), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), (0.02, 0.01, 1.12))
    scene = asm.Assembly([plate, ball])
    scene.constrain(asm.Contact(plate, ball, unilateral=True))
    tracker = scene.tracker(ball.point(0, 0, 0))
    ticks = cases(60, 200)
    for k in range(ticks):
        step = tracker.step((0.02 - 0.1 * k / ticks, 0.01 - 0.06 * k / ticks, 1.12 - 0.6 * k / ticks))
        x, y, z = step.q[1, :3]
        # Ticks hold to 1e-9 of the scene's size.
        assert np.hypot(np.hypot(x, y) - 0.5, z - 0.25) - 1.0 > -step.feasibility - 1e-8
