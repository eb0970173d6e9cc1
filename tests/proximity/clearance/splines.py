"""Random splines, and shapes of all kinds, for bounds that have to hold."""

from __future__ import annotations

import numpy as np

import assembly as asm
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.path import Path
from tests.proximity.clearance.scenes import faces_of


def knots_of(rng, degree, inner, low, high):
    """Clamped, with random inner ones, some of them multiple."""
    at = np.sort(rng.uniform(low, high, inner))
    many = np.repeat(at, rng.integers(1, degree + 1, inner))
    return np.r_[[low] * (degree + 1), many, [high] * (degree + 1)]


def random_surface(rng, offset=0.0):
    """Rational or not, with inner knots, at any place; one in four has a row of equal points, a pole."""
    degree = tuple(int(p) for p in rng.integers(1, 4, 2))
    knots = [knots_of(rng, p, int(rng.integers(0, 3)), -1.0, 2.0) for p in degree]
    shape = [len(k) - p - 1 for k, p in zip(knots, degree, strict=True)]
    points = rng.normal(size=(*shape, 3)) + offset
    if rng.random() < 0.25:
        points[0] = points[0, 0]
    weights = rng.uniform(0.3, 3.0, shape) if rng.random() < 0.7 else None
    return asm.NurbsSurface(points, knots, degree, weights)


def random_curve(rng):
    degree = int(rng.integers(1, 5))
    knots = knots_of(rng, degree, int(rng.integers(0, 3)), 0.0, 3.0)
    count = len(knots) - degree - 1
    weights = rng.uniform(0.3, 3.0, count) if rng.random() < 0.7 else None
    return asm.NurbsCurve(rng.normal(size=(count, 2)), knots, degree, weights)


def bumpy_hole():
    """A square with a hole whose boundary bends both ways."""
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    radius = 0.5 + 0.2 * np.cos(3.0 * angle)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    ring = np.vstack([ring, ring[:3]])
    knots = np.arange(len(ring) + 4.0)
    pieces = asm.NurbsCurve(ring, knots, 3).bezier_pieces()
    hole = [asm.NurbsCurve.bezier(piece[:, :2] / piece[:, 2:]) for piece in pieces]
    return asm.shapes.trimmed_plane(square(1.0), [hole])


def square(half):
    corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return [asm.NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]


def circle(x, y, radius):
    """Of four arcs."""
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    weights = np.array([1, np.sqrt(0.5)] * 4 + [1])
    return asm.NurbsCurve(radius * ring + [x, y], np.repeat(np.arange(5.0), [3, 2, 2, 2, 3]), 2, weights)


def trimmed(surface, *profiles):
    """A face whose boundary is plane curves in (u, v) of a surface: an outer one, and holes."""
    outer, *holes = profiles
    return Face(surface, asm.Loop(outer), [asm.Loop(hole) for hole in holes])


def wavy_sheet():
    points = np.stack(np.meshgrid(*[np.linspace(-1.2, 1.2, 4)] * 2, indexing="ij"), axis=-1)
    height = 0.3 * np.sin(2.0 * points[..., 0]) * np.cos(3.0 * points[..., 1])
    knots = [[-1.2] * 4 + [1.2] * 4] * 2
    return asm.NurbsSurface(np.concatenate([points, height[..., None]], axis=-1), knots, (3, 3))


def shapes():
    """Of all kinds: poles, seams, trims, rims that bend both ways, knots, rational ones, thin ones."""
    sheet = wavy_sheet()
    wire = Path().line(1.0).arc(0.5, 2.0, (1.0, 0.0, 0.0)).line(0.4)
    return {
        "box": asm.shapes.box(1.0, 0.7, 0.5),
        "ball": asm.shapes.sphere(0.4),
        "ellipsoid": asm.shapes.ellipsoid(0.3, 0.5, 0.7),
        "torus": asm.shapes.torus(0.6, 0.15),
        "cone": asm.shapes.cone(0.5, 1.0),
        "cylinder": asm.shapes.cylinder(0.3, 1.2),
        "wall of degree 3, 2": asm.shapes.cylinder(0.3, 1.2).elevate((3, 2)),
        "pin": asm.shapes.solid_cylinder(0.3, 1.2),
        "plate": asm.shapes.plate(3.0, 2.0, 0.3, [(-0.7, 0.0, 0.5), (0.7, 0.1, 0.4)]),
        "slot": asm.shapes.plate_with_slot(3.0, 2.0, 0.3, 1.2, 0.5, angle=0.3),
        "cam": asm.shapes.cam([1.0, 1.2, 0.9, 1.1, 1.3, 0.8], 0.4, 0.3),
        "wire": asm.shapes.pipe(wire, 0.1),
        "clip": asm.shapes.paper_clip(),
        "sheet": sheet,
        "trimmed sheet": trimmed(sheet, circle(0.0, 0.0, 1.0), circle(0.2, 0.1, 0.4)),
        "trimmed ball": trimmed(asm.shapes.sphere(1.0), circle(3.0, 1.6, 1.2), circle(3.1, 1.5, 0.5)),
        "over the seam": trimmed(asm.shapes.cylinder(1.0, 2.0), circle(0.0, 1.0, 0.8)),
        "bumpy hole": bumpy_hole(),
    }


def surface_points(face, count, rng):
    """Random points of a face, and points of its boundary; (n, 3)."""
    (u0, u1), (v0, v1) = face.surface.domain
    u, v = rng.uniform(u0, u1, count), rng.uniform(v0, v1, count)
    if face.boundary:
        within = face.locate(u, v) >= 0
        u, v = u[within], v[within]
        ends = [curve.evaluate(np.linspace(*curve.domain, 60)) for curve in face.boundary]
        u, v = np.r_[u, *(e[:, 0] for e in ends)], np.r_[v, *(e[:, 1] for e in ends)]
    else:
        u, v = np.r_[u, u0, u0, u1, u1, u], np.r_[v, v0, v1, v0, v1, np.full(count, v1)]
    return face.surface.evaluate(u, v)


def points_of(shape, count, rng):
    return np.concatenate([surface_points(face, count, rng) for face in faces_of(shape)])
