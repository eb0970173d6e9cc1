"""Bezier pieces of bodies: normals, boxes around boundaries, and where boxes are against trims."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes import solids
from assembly.geometry.splines.bezier import bernstein
from assembly.geometry.splines.curve import NurbsCurve
from assembly.proximity.brep.bezier_nets import face_nets_at
from assembly.proximity.brep.body_nets import BOUNDARY_PARTS, SurfaceParts, nets_of, pack_nets
from assembly.proximity.brep.box_sides import CLEAR, ENTERED, OUTSIDE
from tests.geometry.splines.test_surface import random_surface

PLATE = solids.plate(2.0, 1.5, 0.3, [(0.4, 0.3, 0.3), (-0.5, -0.2, 0.2)])
SURFACES = {
    "bicubic": random_surface(1, (3, 3)),
    "mixed": random_surface(2, (4, 2), ("multiple", "unclamped")),
    "sphere": shapes.sphere(2.0),
    "torus": shapes.torus(4.0, 1.0),
    "plane": shapes.plane(3.0, 2.0),
}


def nets_and_record(face):
    nets = nets_of((face,))
    return nets, face_nets_at(nets.table, 0)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", SURFACES)
def test_nets_of_normals_are_the_normals(name, turned):
    """Polynomials of the Bezier points, piece by piece, have the direction of the normal, and vanish at poles alone."""
    face = Face(SURFACES[name], reversed=turned)
    surface = face.surface
    nets, record = nets_and_record(face)
    rows, columns = record.normal_rows, record.normal_columns
    count = record.spans_u * record.spans_v
    normals = nets.pool[record.normals :][: 3 * count * rows * columns].reshape(
        record.spans_u, record.spans_v, rows, columns, 3
    )
    at_u, at_v = surface.breaks()
    x = np.array([0.08, 0.4, 0.5, 0.93])
    u_basis, v_basis = bernstein(rows - 1, x), bernstein(columns - 1, x)
    for i in range(record.spans_u):
        for j in range(record.spans_v):
            found = np.einsum("ka,lb,abm->klm", u_basis, v_basis, normals[i, j])
            u, v = at_u[i] + x * (at_u[i + 1] - at_u[i]), at_v[j] + x * (at_v[j + 1] - at_v[j])
            expected = face.normal(u[:, None], v)
            size = np.linalg.norm(found, axis=2, keepdims=True)
            np.testing.assert_allclose(found / size, expected, atol=1e-10)
            slack, pole = nets.pool[record.slack + i * record.spans_v + j], nets.pool[record.poles]
            assert 0.0 < slack < 1e-10 * np.linalg.norm(normals[i, j], axis=2).max()
            assert pole == (1.0 if name == "sphere" else 0.0)


@pytest.mark.parametrize("face", [part for part in PLATE if part.holes], ids=["bottom", "top"])
def test_boxes_hold_the_boundary(face):
    nets, record = nets_and_record(face)
    boxes = nets.pool[record.boundary :][: 4 * record.boundary_boxes].reshape(-1, 4)
    assert len(boxes) >= BOUNDARY_PARTS * len(face.boundary)
    for curve in face.boundary:
        uv = curve.evaluate(np.linspace(*curve.domain, 997))[:, None]
        assert ((boxes[:, ::2] <= uv) & (uv <= boxes[:, 1::2])).all(axis=2).any(axis=1).all()
    # Not much more than the boundary: no box is longer than an eighth of the face.
    extent = np.ptp(face.surface.domain, axis=1)
    assert ((boxes[:, 1::2] - boxes[:, ::2]) <= 0.125 * extent).all()


def ring(turns, height):
    """A band of a cylinder between two curves around it that rise and fall."""
    surface = shapes.cylinder(1.0, 4.0)
    (a, b), (c, d) = surface.domain
    u = np.linspace(a, b, 9) + turns * (b - a)
    wave = height * np.array([0, 1, 1, 0, -1, -1, 0, 1, 0])
    knots = [0, 0, 0, 0, *np.linspace(0, 1, 7)[1:-1], 1, 1, 1, 1]
    low = np.column_stack([u, c + 0.3 * (d - c) + wave])
    high = np.column_stack([u, c + 0.7 * (d - c) + wave])[::-1]
    return Face(surface, outer=[NurbsCurve(low, knots, 3)], holes=[[NurbsCurve(high, knots, 3)]])


@pytest.mark.parametrize("face", [*(part for part in PLATE if part.holes), ring(0.0, 0.4), ring(0.37, 0.4)])
def test_boxes_are_on_their_side_of_the_trim(face):
    nets, _ = nets_and_record(face)
    rng = np.random.default_rng(7)
    low, extent = np.array(face.surface.domain)[:, 0], np.ptp(face.surface.domain, axis=1)
    begin = low + rng.uniform(0.0, 0.9, (600, 2)) * extent
    end = np.minimum(begin + rng.uniform(0.0, 0.3, (600, 1)) ** 2 * extent, low + extent)
    boxes = np.stack([begin, end], axis=2).reshape(-1, 4)
    sides = nets.sides(np.zeros(600, dtype=np.int64), boxes)
    assert all((sides == side).sum() > 20 for side in (CLEAR, OUTSIDE, ENTERED))
    np.testing.assert_array_equal(nets.outside(0, boxes), sides == OUTSIDE)
    uv = begin[:, None] + rng.uniform(size=(600, 200, 2)) * (end - begin)[:, None]
    inside = face.contains(uv[..., 0], uv[..., 1])
    assert inside[sides == CLEAR].all()
    assert not inside[sides == OUTSIDE].any()
    # A box that is said to be entered mostly is: it is near the boundary.
    entered = inside[sides == ENTERED]
    assert (entered.any(axis=1) & ~entered.all(axis=1)).mean() > 0.5


def test_a_whole_surface_leaves_nothing_out():
    nets, record = nets_and_record(Face(shapes.sphere(1.0)))
    assert record.trim == -1
    assert not nets.outside(0, np.array([[0.0, 0.1, 0.0, 0.1], [-3.0, 9.0, -3.0, 9.0]])).any()


def test_surfaces_without_curves():
    nets = pack_nets([SurfaceParts(shapes.plane(1.0, 1.0), ()), SurfaceParts(shapes.torus(2.0, 0.5), ())])
    assert nets.faces == len(nets.records) == 2
    np.testing.assert_array_equal(nets.first_curve, [0, 0, 0])
