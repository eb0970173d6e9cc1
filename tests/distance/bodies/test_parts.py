"""Boundary curves in space, and faces and curves that are elementary: what packing finds, and the bounds of spines."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.distance.bodies.boundary_patches import boundary_patches
from assembly.distance.bodies.elementary import spine_row
from assembly.distance.bodies.packing import tree_of
from assembly.distance.bodies.patch_blocks import is_trimmed, patches_of
from assembly.distance.bodies.query import bodies_apart
from assembly.distance.bodies.records import spine_at
from assembly.distance.bodies.spines import CYLINDER, PLANE, SPHERE, TORUS
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.bezier import bernstein
from tests.distance.bodies.example_shapes import points_on, solids, trimmed_faces

CENTER = np.array([0.1, 0.2, 0.3])
SHAPES = asm.shapes


def all_trimmed():
    rng = np.random.default_rng(0)
    return [*trimmed_faces(rng).values(), *(f for faces in solids().values() for f in faces if is_trimmed(f))]


@pytest.mark.parametrize("face", all_trimmed(), ids=repr)
def test_boundary_curves_in_space_are_those_of_the_parameters(face):
    patches = patches_of(face, 0, CENTER)
    covered = np.zeros(len(face.boundary))
    closed, (low, high) = np.array(face.surface.closed), np.array(face.surface.domain).T
    for part in boundary_patches(face, patches):
        net = part.nets[0, :, 0]
        x = np.linspace(0.0, 1.0, 13)
        s = bernstein(len(net) - 1, x) @ net
        begin, end = part.spans[0, :2]
        uv = face.boundary[part.curve].evaluate(begin + (end - begin) * x)
        uv = np.where(closed, uv, np.clip(uv, low, high))
        off = np.linalg.norm(s[:, :3] / s[:, 3:] + CENTER - face.surface.evaluate(uv[:, 0], uv[:, 1]), axis=1)
        # Evaluation by power tables is off by some units as well.
        assert off.max() <= part.error + 1e-14
        assert part.error < 1e-12
        assert net[:, 3].min() > 0.0
        covered[part.curve] += end - begin
    lengths = [curve.domain[1] - curve.domain[0] for curve in face.boundary]
    np.testing.assert_allclose(covered, lengths, rtol=1e-9)


def test_a_loop_along_the_edges_of_the_domain_trims_nothing():
    plane = SHAPES.plane(2.0, 1.0)
    whole = asm.NurbsCurve.polyline([[-1, -0.5], [1, -0.5], [1, 0.5], [-1, 0.5], [-1, -0.5]])
    assert not is_trimmed(Face(plane))
    edges = [asm.NurbsCurve.polyline([a, b]) for a, b in pairwise(whole.control_points)]
    assert not is_trimmed(Face(plane, outer=edges))
    assert is_trimmed(Face(plane, outer=[*edges[:3], *_detour()]))


def _detour():
    corners = [[-1, 0.5], [-0.5, 0.0], [-1, -0.5]]
    return [asm.NurbsCurve.polyline([a, b]) for a, b in pairwise(corners)]


def spine_of_surface(surface):
    face = Face(surface)
    row = spine_row(patches_of(face, 0, np.zeros(3)), face, np.zeros(3))
    return None if row is None else spine_at(row, 0)


@pytest.mark.parametrize("seed", range(5))
def test_elementary_surfaces_are_found(seed):
    rng = np.random.default_rng(seed)
    turn, place = Rotation.random(random_state=seed).as_matrix(), rng.standard_normal(3)

    def found(surface):
        spine = spine_of_surface(surface.transformed(turn, place))
        assert spine is not None and spine.off < 1e-12
        return spine

    sphere = found(SHAPES.sphere(1.3))
    assert sphere.kind == SPHERE and abs(sphere.radius - 1.3) < 1e-13
    np.testing.assert_allclose(sphere.center, place, atol=1e-13)
    cylinder = found(SHAPES.cylinder(0.7, 2.0))
    assert cylinder.kind == CYLINDER and abs(cylinder.radius - 0.7) < 1e-13 and abs(cylinder.half - 1.0) < 1e-13
    assert abs(abs(cylinder.axis @ turn[:, 2]) - 1.0) < 1e-13
    torus = found(SHAPES.torus(1.0, 0.3))
    assert torus.kind == TORUS and abs(torus.radius - 0.3) < 1e-13 and abs(torus.major - 1.0) < 1e-13
    plane = found(SHAPES.plane(1.0, 2.0))
    assert plane.kind == PLANE and abs(abs(plane.axis @ turn[:, 2]) - 1.0) < 1e-13


def test_what_is_nearly_elementary_is_not():
    for surface in (SHAPES.ellipsoid(1.0, 1.0, 1.0 + 1e-9), SHAPES.cone(1.0, 2.0, 1.0 - 1e-9), SHAPES.cone(1.0, 2.0)):
        assert spine_of_surface(surface) is None


def elementary():
    return {
        "sphere": SHAPES.sphere(0.8),
        "small sphere": SHAPES.sphere(0.2),
        "cylinder": SHAPES.cylinder(0.6, 1.5),
        "thin cylinder": SHAPES.cylinder(0.1, 4.0),
        "torus": SHAPES.torus(1.0, 0.3),
        "ring": SHAPES.torus(0.5, 0.1),
        "plane": SHAPES.plane(3.0, 2.5),
    }


def test_bounds_of_spines_hold_against_samples(cases):
    # A budget of one pair: the roots of the two trees, whose bound is that of the spines.
    rng = np.random.default_rng(3)
    surfaces = list(elementary().values())
    told = 0
    for _ in range(cases(60, 5000)):
        a, b = (Face(surfaces[int(k)]) for k in rng.integers(len(surfaces), size=2))
        tilt = 10.0 ** rng.uniform(-6, 0) if rng.random() < 0.7 else 0.0
        e = np.array([1.0, *(tilt * rng.standard_normal(3))])
        shift = rng.standard_normal(3) * 10.0 ** rng.uniform(-4, 0, 3) * rng.integers(0, 2, 3)
        q = np.array([[0, 0, 0, 1, 0, 0, 0], [*shift, *(e / np.linalg.norm(e))]])
        found = bodies_apart(tree_of((a,)), tree_of((b,)), q, 1e-10, 1)
        turn = Rotation.from_quat(np.roll(q[1, 3:], -1)).as_matrix()
        p, r = points_on(a, 25), points_on(b, 25) @ turn.T + shift
        least = np.sqrt(((p[:, None] - r[None]) ** 2).sum(axis=2).min())
        assert found.lower <= least + 1e-14
        told += found.lower > 0.0
    assert told > 0.3 * cases(60, 5000)


@pytest.mark.parametrize(
    ("a", "b", "shift", "expected"),
    [
        ("sphere", "small sphere", (0.0, 0.0, 0.0), 0.6),
        ("sphere", "small sphere", (0.0, 0.0, 0.1), 0.5),
        ("cylinder", "thin cylinder", (0.0, 0.0, 0.0), 0.5),
        ("cylinder", "thin cylinder", (1.0, 0.0, 0.3), 0.3),
        ("cylinder", "thin cylinder", (1.2, 0.04, 0.3), np.hypot(1.2, 0.04) - 0.7),
        ("cylinder", "thin cylinder", (-0.9, -0.8, 0.3), np.hypot(0.9, 0.8) - 0.7),
        ("cylinder", "cylinder", (0.0, 0.0, 2.0), 0.5),
        ("sphere", "small sphere", (1.1, -0.07, 0.4), np.sqrt(1.1**2 + 0.07**2 + 0.4**2) - 1.0),
        ("sphere", "small sphere", (0.03, 0.02, 0.1), 0.6 - np.sqrt(0.03**2 + 0.02**2 + 0.1**2)),
        ("ring", "ring", (0.0, 1.5, 0.0), 0.3),
        ("ring", "thin cylinder", (0.8, 0.05, 0.2), np.hypot(0.8, 0.05) - 0.7),
        ("torus", "ring", (0.0, 0.0, 0.0), 0.1),
        ("torus", "ring", (0.0, 0.0, 1.2), 0.9),
        ("torus", "thin cylinder", (0.0, 0.0, 0.0), 0.6),
        ("torus", "small sphere", (0.0, 0.0, 0.0), 0.5),
        ("torus", "plane", (0.0, 0.0, 1.0), 0.7),
        ("sphere", "plane", (0.0, 0.0, 1.0), 0.2),
    ],
)
def test_valleys_of_nearest_points_are_told_at_once(a, b, shift, expected):
    shapes = elementary()
    q = np.array([[0, 0, 0, 1, 0, 0, 0], [*shift, 1, 0, 0, 0]])
    for order in (1, -1):
        trees = [tree_of((Face(shapes[name]),)) for name in (a, b)[::order]]
        found = bodies_apart(*trees, q[::order].copy(), 1e-10, 20)
        assert found.upper - found.lower <= 1e-11
        assert found.lower <= expected <= found.upper
