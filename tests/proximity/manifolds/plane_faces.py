"""Trimmed plane faces for tests of manifolds: polygons, discs, slots, with and without holes."""

from __future__ import annotations

from functools import cache

import numpy as np

import assembly as asm
from assembly.geometry.shapes.plane_curves import arc, circle, polygon, segment


def slot(length, radius):
    """Two half circles and two straight sides, counterclockwise."""
    h = 0.5 * length
    return [
        segment((-h, -radius), (h, -radius)),
        arc(radius, -0.5 * np.pi, 0.5 * np.pi, (h, 0.0)),
        segment((h, radius), (-h, radius)),
        arc(radius, 0.5 * np.pi, 1.5 * np.pi, (-h, 0.0)),
    ]


def polygons(rng):
    """A random star-shaped polygon."""
    count = int(rng.integers(3, 8))
    turns = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    gaps = np.diff(np.append(turns, turns[0] + 2.0 * np.pi))
    if gaps.max() > 2.6 or gaps.min() < 0.2:
        return polygons(rng)
    return polygon(rng.uniform(0.6, 1.4, count)[:, None] * np.column_stack([np.cos(turns), np.sin(turns)]))


@cache
def plane_faces():
    """Faces in the xy-plane, their (u, v) are (x, y); every other one looks down."""
    rng = np.random.default_rng(3)
    loops = [
        (polygon([(-1, -1), (1, -1), (1, 1), (-1, 1)]), []),
        (
            polygon([(-1, -0.6), (1.2, -0.6), (1.2, 0.7), (-1, 0.7)]),
            [circle(0.3, (0.2, 0.0)), circle(0.2, (-0.5, 0.2))],
        ),
        (circle(1.0), []),
        (circle(1.1), [circle(0.5, (0.1, 0.2))]),
        (slot(1.2, 0.5), []),
        (slot(1.4, 0.6), [polygon([(-0.3, -0.2), (0.3, -0.2), (0.0, 0.3)])]),
        (polygon([(-1, -1), (1, -1), (1, 0), (0, 0), (0, 1), (-1, 1)]), []),
        *((polygons(rng), []) for _ in range(6)),
        *((polygons(rng), [circle(0.15, (0.05, 0.0))]) for _ in range(3)),
    ]
    return tuple(
        asm.Face(face.surface, face.outer, face.holes, reversed=bool(k % 2))
        for k, face in enumerate(asm.shapes.trimmed_plane(outer, holes) for outer, holes in loops)
    )
