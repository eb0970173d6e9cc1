"""Where the loop is easily fooled: folds, poles, faces that start tilted, idle contacts, far starts, deep overlaps."""

from __future__ import annotations

import json

import numpy as np
import pytest

import assembly as asm
from assembly.kinematics.pose import rotate
from assembly.proximity.extrema.pairs import PairStatus

shapes = asm.shapes
FOUND = (PairStatus.CONVERGED, PairStatus.SINGULAR)


def unit(*e):
    return np.array(e, dtype=float) / np.linalg.norm(e)


def touching(shape_a, shape_b, position, quaternion, **options):
    a = asm.Body("a", shape_a, fixed=True)
    b = asm.Body("b", shape_b, position=position, quaternion=unit(*quaternion))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b, **options))
    return scene


def holds(scene, solution):
    """Whether every contact is found again, by a search that knows nothing of the loop's unknowns, with its gap."""
    for k, (f, g) in enumerate(scene.packed().sides):
        if not scene.packed().whole[k]:
            if abs(asm.proximity.closest_features(f, g, *solution.q).gap) > 1e-9 * scene.packed().scale:
                return False
            continue
        q_f, q_g = (solution.q[[body.name for body in scene.bodies].index(side.body.name)] for side in (f, g))
        pair = asm.proximity.extremal_pair(f, q_f, g, q_g, solution._parameters[k, :4])
        if abs(pair.gap) > 1e-9 * scene.packed().scale:
            return False
        if pair.status not in FOUND and not flush(f, q_f, g, q_g, solution._parameters[k, :4]):
            return False
    return True


def flush(f, q_f, g, q_g, parameters):
    """Whether the surfaces touch at the parameters with one tangent plane: at the end of a cone's line on a plane, say.

    There the search, which steps along the line, finds the end of the patch instead of a pair.
    """
    sides = []
    for side, q, (u, v) in ((f, q_f, parameters[:2]), (g, q_g, parameters[2:])):
        p, su, sv = (rotate(q[3:], x) for x in side.face.surface.evaluate(u, v, 1))
        n = np.cross(su, sv)
        sides.append((p + q[:3], n / np.linalg.norm(n)))
    (p, n), (r, m) = sides
    # The rows of a free pair, which say so, hold to 1e-12.
    return np.linalg.norm(p - r) < 1e-9 and np.linalg.norm(np.cross(n, m)) < 1e-9


@pytest.mark.parametrize(
    ("shape_a", "shape_b", "size", "seed"),
    [
        (shapes.plane(4, 4), shapes.sphere(1), 2.0, 1),
        (shapes.plane(4, 4), shapes.cone(1, 2), 2.0, 2),
        (shapes.box(2, 2, 2), shapes.sphere(1), 2.0, 3),
        (shapes.plane(4, 4), shapes.ellipsoid(1, 0.7, 0.4), 2.0, 4),
        (shapes.torus(1, 0.3), shapes.torus(1.2, 0.2), 2.5, 5),
    ],
)
def test_what_is_solved_is_found_again(shape_a, shape_b, size, seed, cases):
    rng = np.random.default_rng(seed)
    solved, count = 0, cases(16, 40)
    for _ in range(count):
        scene = touching(shape_a, shape_b, rng.uniform(-1, 1, 3) * size, rng.normal(size=4))
        solution = scene.solve()
        if solution.success:
            solved += 1
            assert holds(scene, solution), solution
    assert solved >= count // 4


@pytest.mark.parametrize(
    ("shape", "shape_b", "position", "quaternion"),
    [
        # The pair slid onto a pole, or the apex: its own rows vanish there, and the surfaces crossed at an angle.
        (shapes.plane(4, 4), shapes.sphere(1), (-1.7, 0.36, -0.61), (0.246, -0.246, -0.691, 0.634)),
        (shapes.box(2, 2, 2), shapes.sphere(1), (0.55, 1.24, 1.4), (-0.394, -0.849, -0.269, -0.228)),
        (shapes.plane(4, 4), shapes.cone(1, 2), (2.28, -1.46, 1.64), (0.288, -0.268, 0.136, 0.909)),
    ],
)
def test_a_free_pair_at_a_pole_is_no_success(shape, shape_b, position, quaternion):
    scene = touching(shape, shape_b, position, quaternion)
    solution = scene.solve()
    assert not solution.success or holds(scene, solution)


def test_wires_pulled_taut_end_stationary():
    # Out of reach: the wires come to folds of their pairs, where gaps alone have no derivative to go on with.
    wire = shapes.torus(1.0, 0.12)
    poses = [(0.9, 0.1, 0.1), (1.1, 0.2, -0.1), (0.85, -0.2, 0.2), (1.0, 0.0, 0.3)]
    for k, position in enumerate(poses):
        scene = touching(wire, wire, position, (1.0, 1.0, 0.1 * k, 0.05))
        b = scene.body("b")
        scene.minimize(asm.PointDistance(b.point(1, 0, 0), b.pose.apply((1, 0, 0)) + [2.0, 2.0, 1.0]))
        solution = scene.solve()
        assert solution.success, solution
        assert solution.objective > 1.0 and abs(solution.multipliers["a-b"][0]) > 0.1
        assert holds(scene, solution)


def test_tilted_faces_come_to_lie_flush():
    scene = touching(shapes.plane(4, 4), shapes.plane(4, 4), (0.2, 0.1, 1.0), (1, 0.1, 0.05, 0.02))
    solution = scene.solve()
    assert solution.success
    # All of the tile is in the floor's plane; 1e-12 of the size, 5.7, at arms of 2.
    corners = solution.pose("b").apply([[x, y, 0.0] for x in (-2, 2) for y in (-2, 2)])
    np.testing.assert_allclose(corners[:, 2], 0.0, rtol=0, atol=1e-9)


def test_a_roller_comes_to_lie_along_the_floor():
    scene = touching(shapes.plane(4, 4), shapes.cylinder(0.3, 1.0), (0.0, 0.0, 1.0), (1, 1, 0.1, 0))
    solution = scene.solve()
    assert solution.success
    axis = solution.pose("b").apply([[0, 0, -0.5], [0, 0, 0.5]])
    np.testing.assert_allclose(axis[:, 2], 0.3, rtol=0, atol=1e-9)


def test_an_idle_contact_whose_pair_ends_takes_the_nearest_one():
    scene = touching(
        shapes.torus(1, 0.3),
        shapes.torus(1.2, 0.2),
        (3.06, -3.83, 0.63),
        (-0.263, -0.21, -0.1, -0.936),
        unilateral=True,
    )
    b = scene.body("b")
    scene.minimize(asm.PointDistance(b.point(-0.23, -0.87, 3.32), target=(0.45, -0.71, -0.56)))
    solution = scene.solve()
    assert solution.success and solution.objective == pytest.approx(0.0, abs=1e-12)


def test_an_idle_ball_leaves_the_floor_over_its_edge():
    scene = touching(shapes.plane(4, 4), shapes.sphere(0.5), (0.3, 0.2, 1.0), (0.8, 0.4, -0.4, 0.2), unilateral=True)
    scene.minimize(asm.PointDistance(scene.body("b").point(0, 0, 0), (3.0, 0.2, 1.0)))
    solution = scene.solve()
    assert solution.success
    np.testing.assert_allclose(solution.q[1, :3], [3.0, 0.2, 1.0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("distance", [1e3, 1e6])
def test_far_bodies_come_together(distance):
    solution = touching(shapes.sphere(1), shapes.sphere(1), (distance, 0.1, 0), (0.8, 0.4, -0.4, 0.2)).solve()
    assert solution.success and solution.iterations < 60
    # What rounding at that distance leaves, or the tolerance.
    assert np.linalg.norm(solution.q[1, :3]) == pytest.approx(2.0, abs=1e-11)


@pytest.mark.parametrize("depth", [0.2, 0.5, 0.8])
def test_overlapping_balls_are_pushed_out_the_short_way(depth, cases):
    rng = np.random.default_rng(7)
    for _ in range(cases(7, 20)):
        towards = unit(*rng.normal(size=3))
        scene = touching(
            shapes.sphere(1), shapes.sphere(0.5), (1.5 - depth) * towards, rng.normal(size=4), unilateral=True
        )
        solution = scene.solve()
        assert solution.success
        np.testing.assert_allclose(solution.q[1, :3], 1.5 * towards, rtol=0, atol=1e-9)


@pytest.mark.parametrize("radius", [0.1, 0.01, 0.001])
def test_a_small_ball_stays_outside_a_large_one(radius):
    solution = touching(shapes.sphere(1), shapes.sphere(radius), (1 + 2 * radius, 0.1, 0), (1, 0, 0, 0)).solve()
    assert solution.success
    assert np.linalg.norm(solution.q[1, :3]) == pytest.approx(1 + radius, abs=1e-11)


def test_starts_must_be_a_mapping():
    scene = touching(shapes.sphere(1), shapes.sphere(1), (3, 0, 0), (1, 0, 0, 0))
    with pytest.raises(TypeError, match=r"starts is \[1\]; expected a mapping"):
        scene.solve(starts=[1])


def of_wires_and_of_tiles():
    wire, tile = shapes.torus(1, 0.12), shapes.plane(4, 4)
    solutions = [
        touching(wire, wire, (1.0, 0.1, 0.0), (0.7, 0.7, 0.1, 0.05)).solve(),
        touching(tile, tile, (0.2, 0.1, 1.0), (0.993, 0.099, 0.05, 0.02)).solve(),
    ]
    return [[solution.success, *solution.q[1].tolist()] for solution in solutions]


def test_the_loop_is_the_same_without_jit(run_python):
    code = "import json; from tests.solve.test_loop import *; print(json.dumps(of_wires_and_of_tiles()))"
    for one, other in zip(json.loads(run_python(code, NUMBA_DISABLE_JIT="1")), of_wires_and_of_tiles(), strict=True):
        assert one[0] and other[0]
        # Fused multiply-adds round otherwise; the least move has one minimum, found to 1e-10 over its curvature.
        np.testing.assert_allclose(one[1:], other[1:], rtol=0, atol=1e-9)
