"""Triangles of faces with a boundary: those made without a triangulation are those that one makes."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.meshing.trimmed_cells import TrimmedCells, parallelogram_cells, tube_cells
from tests.proximity.clearance.scenes import faces_of

TOLERANCE, ANGLE = 0.01, 0.5
# What corners may be moved by where the triangulation joins them to its lines, in parts of the domain.
CLOSE = 1e-9


def turned(surface, rng):
    """The same surface somewhere else, with its parameters exchanged or not."""
    matrix = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix *= np.sign(np.linalg.det(matrix))
    found = surface.transformed(matrix, rng.normal(size=3))
    return found.transposed() if rng.random() < 0.5 else found


def described(face, cells):
    """Of every triangle its corners, in (u, v) in parts of the domain, and which of its edges are of which curve."""
    low, high = np.array(face.surface.domain).T
    corners = np.round((cells.parameters - low) / (high - low) / CLOSE).astype(int)
    curve = np.where(cells.segments < 0, -1, cells.border.curve[cells.segments])
    ways = {}
    for triangle, curves in zip(corners.tolist(), curve.tolist(), strict=True):
        first = min(range(3), key=lambda k: triangle[k])
        order = [(first + k) % 3 for k in range(3)]
        ways[tuple(tuple(triangle[k]) for k in order)] = tuple(curves[k] for k in order)
    return ways


@pytest.mark.parametrize("kind", ["parallelogram", "tube"])
def test_they_are_those_of_the_triangulation(kind, cases):
    rng = np.random.default_rng(0)
    for _ in range(cases(12, 200)):
        sizes = rng.uniform(0.3, 3.0, 2)
        shape = asm.shapes.plane(*sizes) if kind == "parallelogram" else asm.shapes.cylinder(*sizes)
        face = asm.Face(turned(shape, rng), reversed=bool(rng.random() < 0.5))
        found = parallelogram_cells(face) if kind == "parallelogram" else tube_cells(face, TOLERANCE, ANGLE)
        assert described(face, found) == described(face, TrimmedCells(face, TOLERANCE, ANGLE).made())


def test_chords_have_the_parameters_of_their_ends(cases):
    rng = np.random.default_rng(1)
    for _ in range(cases(6, 100)):
        for shape in (asm.shapes.plane(1.0, 2.0), asm.shapes.cylinder(0.5, 1.0)):
            face = asm.Face(turned(shape, rng))
            cells = parallelogram_cells(face) or tube_cells(face, TOLERANCE, ANGLE)
            row, k = np.nonzero(cells.segments >= 0)
            segment = cells.segments[row, k]
            ends = np.stack([cells.parameters[row, k], cells.parameters[row, (k + 1) % 3]], axis=1)
            for number, curve in enumerate(face.boundary):
                own = cells.border.curve[segment] == number
                assert np.abs(curve.evaluate(cells.border.t[segment[own]]) - ends[own]).max() <= 1e-15 * np.ptp(ends)
            # Counterclockwise in (u, v), and all of the domain.
            a, b = cells.parameters[:, 1] - cells.parameters[:, 0], cells.parameters[:, 2] - cells.parameters[:, 0]
            areas = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
            (u0, u1), (v0, v1) = face.surface.domain
            assert areas.min() > 0.0
            assert areas.sum() == pytest.approx((u1 - u0) * (v1 - v0), rel=1e-12)


def test_other_faces_have_none():
    hole = asm.shapes.plate(3.0, 2.0, 1.0, [(0.0, 0.0, 0.4)])
    assert all(parallelogram_cells(face) is None for face in hole if face.holes)
    assert tube_cells(asm.Face(asm.shapes.torus(1.0, 0.3)), TOLERANCE, ANGLE) is None
    assert tube_cells(asm.Face(asm.shapes.cone(1.0, 2.0)), TOLERANCE, ANGLE) is None
    twisted = np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0.5]]], dtype=float)
    bilinear = asm.NurbsSurface(twisted, ([0, 0, 1, 1], [0, 0, 1, 1]), (1, 1))
    assert not bilinear.is_parallelogram
    assert parallelogram_cells(asm.Face(bilinear)) is None


def test_triangles_beside_an_apex_cover_the_face():
    """In (u, v) nothing is left out, though two corners of a triangle may be one point in space."""
    (face,) = (face for face in faces_of(asm.shapes.cone(0.5, 1.0)) if face.surface.closed[0] != face.surface.closed[1])
    cells = TrimmedCells(face, TOLERANCE, ANGLE).made()
    a, b = cells.parameters[:, 1] - cells.parameters[:, 0], cells.parameters[:, 2] - cells.parameters[:, 0]
    (u0, u1), (v0, v1) = face.surface.domain
    assert 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() == pytest.approx((u1 - u0) * (v1 - v0), rel=1e-9)


@pytest.mark.parametrize("center", [0.0, 0.3, 2.0 * np.pi])
def test_chords_beyond_a_seam_are_cut_where_they_stand(center):
    """A hole across the seam of a cylinder is laid out in parts, some of them a period from their curve."""
    hole = asm.curves.circle(0.5, (center, 4.0)).reversed()
    face = asm.Face(asm.shapes.cylinder(1.0, 8.0), None, [hole])
    made = TrimmedCells(face, TOLERANCE, ANGLE)
    left = []
    for _ in range(3):
        cells = made.made()
        of_hole = (np.abs(cells.border.ends[..., 1] - 4.0) < 1.0).all(axis=1)
        chords = np.ptp(cells.border.ends[of_hole], axis=1)
        a, b = cells.parameters[:, 1] - cells.parameters[:, 0], cells.parameters[:, 2] - cells.parameters[:, 0]
        left.append(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
        assert chords.max() < 0.5
        made.cut(np.arange(len(cells.border.curve)))
    # Chords of the hole are within it, and come nearer to it.
    missing = np.array(left) - (16.0 * np.pi - 0.25 * np.pi)
    assert (missing > 0.0).all() and (missing[1:] < 0.3 * missing[:-1]).all()
