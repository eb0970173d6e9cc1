"""Meshes lie on their surfaces, look outward, and are closed where the surface is."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import assembly as asm
from assembly.view.mesh import Mesh, body_mesh, face_mesh, joined

RNG = np.random.default_rng(5)
CLOSED = {
    "sphere": asm.shapes.sphere(2.0),
    "ellipsoid": asm.shapes.ellipsoid(3.0, 1.0, 0.2),
    "torus": asm.shapes.torus(5.0, 1.0),
    "paper clip": asm.shapes.paper_clip(),
    "far torus": asm.shapes.torus(5.0, 1.0).transformed(translation=(1e5, -1e5, 3e4)),
}


def bumps(degree=3, spans=4):
    n = degree + spans
    x, y = np.meshgrid(np.linspace(0, 9, n), np.linspace(0, 7, n), indexing="ij")
    knots = np.concatenate([np.zeros(degree), np.linspace(0, 1, spans + 1), np.ones(degree)])
    points, weights = np.dstack([x, y, RNG.normal(size=(n, n))]), RNG.uniform(0.5, 2, (n, n))
    return asm.NurbsSurface(points, (knots, knots), (degree, degree), weights)


OPEN = {
    "plane": asm.shapes.plane(3.0, 2.0),
    "cylinder": asm.shapes.cylinder(1.0, 4.0),
    "cone": asm.shapes.cone(1.0, 2.0),
    "cubic": bumps(),
    "bilinear": bumps(1, 3),
}
ALL = {**CLOSED, **OPEN}


def face_normals(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return np.cross(b - a, c - a)


@pytest.mark.parametrize("surface", ALL.values(), ids=ALL)
@pytest.mark.parametrize("reversed", [False, True])
def test_triangles_and_normals_look_outward(surface, reversed):
    mesh = face_mesh(asm.Face(surface, reversed=reversed))
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-12)
    flat = face_normals(mesh)
    area = np.linalg.norm(flat, axis=1)
    assert (area > 0.0).all()
    # Normals turn 7.5 degrees a cell in either direction, so a triangle's is within 15 degrees of its corners', more
    # or less: turning is sampled.
    cosine = (flat[:, None, :] * mesh.normals[mesh.triangles]).sum(axis=2) / area[:, None]
    assert cosine.min() > np.cos(np.deg2rad(20.0))


def from_wire(x, y, z):
    """Distance to the center line of PIPE: up the z axis, over a half turn of radius 3, with a free end."""
    bend = np.where(z >= 4.0, np.hypot(np.hypot(x - 3.0, z - 4.0) - 3.0, y), np.inf)
    leg = np.sqrt(x**2 + y**2 + (z - np.clip(z, 0.0, 4.0)) ** 2)
    end = np.sqrt((x - 6.0) ** 2 + y**2 + (z - 4.0) ** 2)
    return np.minimum(np.minimum(bend, leg), end) / 0.5


PIPE = asm.shapes.pipe(asm.shapes.Path().line(4.0).arc(3.0, np.pi, toward=(1, 0, 0)), 0.5)
EQUATIONS = {
    "sphere": (CLOSED["sphere"], lambda x, y, z: (x**2 + y**2 + z**2) / 4.0),
    "ellipsoid": (CLOSED["ellipsoid"], lambda x, y, z: x**2 / 9.0 + y**2 + z**2 / 0.04),
    "torus": (CLOSED["torus"], lambda x, y, z: (np.hypot(x, y) - 5.0) ** 2 + z**2),
    "cylinder": (OPEN["cylinder"], lambda x, y, z: x**2 + y**2),
    "cone": (OPEN["cone"], lambda x, y, z: 1.0 + np.hypot(x, y) - 0.5 * (1.0 - z)),
    "plane": (OPEN["plane"], lambda x, y, z: 1.0 + z),
    "pipe": (PIPE, from_wire),
}


@pytest.mark.parametrize(("surface", "equation"), EQUATIONS.values(), ids=EQUATIONS)
def test_corners_lie_on_the_surface(surface, equation):
    mesh = face_mesh(asm.Face(surface))
    # Rounding of coordinates up to 6 and, in the ellipsoid, of squares of their 5-fold.
    assert equation(*mesh.vertices.T) == pytest.approx(1.0, abs=1e-13)


def test_normals_of_a_torus():
    mesh = face_mesh(asm.Face(CLOSED["torus"]))
    x, y, z = mesh.vertices.T
    ring = np.hypot(x, y) - 5.0
    outward = np.stack([x * ring / np.hypot(x, y), y * ring / np.hypot(x, y), z], axis=1)
    # Normals beside a knot are taken 1e-9 of a span inside it.
    assert np.abs(mesh.normals - outward).max() < 1e-8


@pytest.mark.parametrize("surface", CLOSED.values(), ids=CLOSED)
def test_closed_surfaces_have_closed_meshes(surface):
    mesh = face_mesh(asm.Face(surface))
    # Points are compared to the last bit: not even a hair's crack.
    _, welded = np.unique(mesh.vertices, axis=0, return_inverse=True)
    corners = welded.reshape(-1)[mesh.triangles]
    edges = Counter((int(a), int(b)) for t in corners for a, b in zip(t, np.roll(t, -1), strict=True))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)


def test_volume_of_a_torus_from_its_mesh():
    mesh = face_mesh(asm.Face(CLOSED["torus"]))
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    volume = (a * np.cross(b, c)).sum() / 6.0
    # 48 sides around and along: inscribed polygons lose 2 pi^2 / (3 48^2) = 0.3 percent in each.
    assert volume == pytest.approx(2.0 * np.pi**2 * 5.0, rel=1e-2)
    assert volume < 2.0 * np.pi**2 * 5.0


def test_a_clip_is_round_and_not_too_many_triangles():
    surface = asm.shapes.paper_clip(wire_radius=0.5)
    mesh = face_mesh(asm.Face(surface))
    assert 3_000 < len(mesh.vertices) < 20_000
    around = mesh.vertices[np.abs(mesh.vertices[:, 2] - mesh.vertices[:, 2].max()) < 1.5]
    assert len(np.unique(np.round(around[:, 1], 6))) >= 24


def test_a_budget_is_kept():
    surface = asm.shapes.paper_clip()
    for budget in (2_000, 500):
        assert len(face_mesh(asm.Face(surface), budget).vertices) <= budget
    # Below one cell a span it cannot go.
    n_u, n_v = (len(breaks) for breaks in surface.breaks())
    assert len(face_mesh(asm.Face(surface), 1).vertices) == n_u * n_v


def test_an_edge_stays_an_edge():
    roof = asm.NurbsSurface(
        [[[-1, 0, 0], [-1, 1, 0]], [[0, 0, 1], [0, 1, 1]], [[1, 0, 0], [1, 1, 0]]],
        ([0, 0, 0.5, 1, 1], [0, 0, 1, 1]),
        (1, 1),
    )
    mesh = face_mesh(asm.Face(roof))
    assert len(mesh.vertices) == 8 and len(mesh.triangles) == 4
    s = np.sqrt(0.5)
    # The two normals of the ridge, exact but for rounding: both sides are flat.
    assert mesh.normals == pytest.approx(np.repeat([[-s, 0, s], [s, 0, s]], 4, axis=0), abs=1e-12)


def test_a_corner_without_a_normal():
    i = np.linspace(0.0, 2.0, 3)
    points = np.stack([*np.meshgrid(i, i, indexing="ij"), np.zeros((3, 3))], axis=-1)
    points[0, 1] = points[1, 0] = points[0, 0]
    surface = asm.NurbsSurface(points, ([0, 0, 0, 1, 1, 1],) * 2, (2, 2))
    with pytest.raises(ValueError, match="without a normal"):
        surface.normal(0.0, 0.0)
    # A flat surface: its normal is exact up to rounding.
    assert np.abs(face_mesh(asm.Face(surface)).normals - [0.0, 0.0, 1.0]).max() < 1e-14


def test_a_body_of_six_faces():
    mesh = body_mesh(asm.Body("block", asm.shapes.box(1.0, 2.0, 3.0)))
    assert mesh is not None
    assert (len(mesh.vertices), len(mesh.triangles)) == (24, 12)
    outside = mesh.vertices + 1e-3 * mesh.normals
    # Outward: each face's vertices move beyond the box by just that much.
    assert np.abs(outside / [0.5, 1.0, 1.5]).max(axis=1) == pytest.approx(1.0, abs=2.1e-3)
    assert (np.abs(outside) > [0.5, 1.0, 1.5]).sum() == 24
    assert body_mesh(asm.Body("nothing")) is None


def test_moving_and_joining():
    mesh = face_mesh(asm.Face(CLOSED["sphere"]))
    matrix = np.diag([2.0, 1.0, 0.5, 1.0])
    matrix[:3, 3] = 1.0, 2.0, 3.0
    moved = mesh.transformed(matrix)
    # The normal of an ellipsoid is the gradient of its equation.
    gradient = (moved.vertices - [1.0, 2.0, 3.0]) / np.array([4.0, 2.0, 1.0]) ** 2
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert np.abs(moved.normals - gradient).max() < 1e-8
    both = joined([mesh, moved])
    assert isinstance(both, Mesh)
    n = len(mesh.vertices)
    assert both.triangles[len(mesh.triangles) :] == pytest.approx(moved.triangles + n, abs=0)
    assert both.vertices[n:] == pytest.approx(moved.vertices, abs=0)
