"""How far points are from trimmed faces and from edges."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.distance.queries import minimum_distance
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.selection.selection import checked_place

__all__ = ["distance_along", "distance_to_face", "finer"]

Array = NDArray[np.float64]
# Samples of a span of a curve, and rounds in which the best place among them is looked at more closely.
_SAMPLES, _ROUNDS = 17, 10
# Samples of a face along either parameter, and steps of Newton's method from the nearest of them.
_GRID, _STEPS = 24, 20


def distance_along(curve: Callable[[Array], Array], breaks: Array, point: Array) -> float:
    """How far a point is from a curve of t, by samples between its breaks that are refined about the nearest.

    Parameters
    ----------
    curve : callable
        Points (n, 3) at parameters (n,).
    breaks : (k,)
        The ends of its smooth parts.
    point : (3,)
    """
    t = np.unique(np.concatenate([np.linspace(a, b, _SAMPLES) for a, b in pairwise(breaks)]))
    best = np.inf
    for _ in range(_ROUNDS):
        gaps = np.linalg.norm(curve(t) - point, axis=1)
        k = int(np.argmin(gaps))
        best = min(best, float(gaps[k]))
        t = np.linspace(t[max(k - 1, 0)], t[min(k + 1, t.size - 1)], _SAMPLES)
    return best


def finer(breaks: Array, surface: NurbsSurface) -> Array:
    """Breaks of a curve in (u, v), and as many more between them as the surface has spans: it may pass all of these."""
    spans = max(4, sum(len(at) - 1 for at in surface.breaks()))
    parts = [np.linspace(a, b, spans + 1) for a, b in pairwise(breaks)]
    return np.unique(np.concatenate(parts))


def distance_to_face(face: Face, point: ArrayLike) -> float:
    """How far a point (3,) is from a face, within its boundary.

    The nearest point of the whole surface is certified. Where that is trimmed away, the nearest one found of the
    boundary and of the inside is taken.
    """
    place = checked_place("point", point)
    surface = face.surface
    whole = minimum_distance(surface, place)
    u, v = np.ravel(whole.parameters)[:2]
    if not (face.outer or face.holes) or bool(face.contains(u, v)):
        return float(whole.upper)
    best = _inside(face, place)
    for curve in face.boundary:

        def along(t: Array, curve: object = curve) -> Array:
            points = surface.evaluate(*curve.evaluate(t).T)  # type: ignore[attr-defined]  # a curve of the boundary
            return np.asarray(points)

        best = min(best, distance_along(along, finer(curve.breaks(), surface), place))
    return best


def _inside(face: Face, point: Array) -> float:
    """The distance of the nearest extremum inside of a face that is found from samples; infinite without one."""
    surface = face.surface
    (u0, u1), (v0, v1) = surface.domain
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(u0, u1, _GRID), np.linspace(v0, v1, _GRID), indexing="ij"))
    inside = face.contains(u, v)
    if not inside.any():
        return np.inf
    u, v = u[inside], v[inside]
    gaps = np.linalg.norm(surface.evaluate(u, v) - point, axis=1)
    k = int(np.argmin(gaps))
    best, at = float(gaps[k]), np.array([u[k], v[k]])
    for _ in range(_STEPS):
        s, su, sv = surface.evaluate(at[0], at[1], 1)
        tangents = np.column_stack([su, sv])
        step = np.linalg.lstsq(tangents, point - s, rcond=None)[0]
        at = np.clip(at + step, [u0, v0], [u1, v1])
        if not bool(face.contains(at[0], at[1])):
            break
        best = min(best, float(np.linalg.norm(surface.evaluate(at[0], at[1]) - point)))
    return best
