"""Shapes that tests of distances of bodies are about."""

from __future__ import annotations

import numpy as np

import assembly as asm
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

HALF = np.sqrt(0.5)
_CIRCLE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
_WEIGHTS = np.array([1.0, HALF, 1.0, HALF, 1.0, HALF, 1.0, HALF, 1.0])


def ellipse(u, v, a, b):
    """A loop in the parameters of a face."""
    return NurbsCurve(_CIRCLE * [a, b] + [u, v], [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, _WEIGHTS)


def wavy(rng, spans=1, rational=True, height=0.3):
    """A bicubic sheet over the unit square."""
    n = 3 + spans
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, n)], indexing="ij")
    net = np.stack([x, y, height * rng.standard_normal((n, n))], axis=2)
    knots = np.concatenate([[0.0] * 3, np.linspace(0.0, 1.0, spans + 1), [1.0] * 3])
    return NurbsSurface(net, (knots, knots), (3, 3), rng.uniform(0.5, 2.0, (n, n)) if rational else None)


def random_pose(rng, reach):
    e = rng.standard_normal(4)
    return np.concatenate([reach * rng.standard_normal(3), e / np.linalg.norm(e)])


def trimmed_faces(rng):
    """Faces of all sorts with loops: names and faces."""
    shapes = asm.shapes
    return {
        "sheet with a hole": Face(
            wavy(rng, 3), outer=ellipse(0.5, 0.5, 0.45, 0.4), holes=[ellipse(0.4, 0.5, 0.2, 0.1)]
        ),
        "torus with a hole over its seams": Face(shapes.torus(1.0, 0.25), holes=[ellipse(0.0, 0.0, 0.5, 0.3)]),
        "part of a torus": Face(shapes.torus(1.0, 0.25), outer=ellipse(0.2, 1.0, 0.5, 0.3)),
        "sphere with a hole": Face(shapes.sphere(1.0), holes=[ellipse(0.1, 1.5, 1.5, 0.8)]),
    }


def solids():
    shapes = asm.shapes
    return {
        "box": shapes.box(1.0, 0.6, 0.4),
        "cylinder": shapes.solid_cylinder(0.4, 1.0),
        "plate": shapes.plate(2.0, 1.5, 0.3, [(0.0, 0.0, 0.4), (0.6, 0.3, 0.1)]),
        "cam": shapes.cam(np.array([1.0, 1.1, 1.3, 1.2, 1.0, 0.9]), 0.5, 0.3),
    }


def points_on(face, count=80):
    """Points of a face, a grid of parameters."""
    (a, b), (c, d) = face.surface.domain
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(a, b, count), np.linspace(c, d, count)))
    if face.outer is not None or face.holes:
        keep = face.contains(u, v)
        u, v = u[keep], v[keep]
    return face.surface.evaluate(u, v)
