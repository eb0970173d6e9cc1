"""How far points are from trimmed faces and from edges."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.selection.selection import checked_place

__all__ = ["distance_along", "distance_to_face", "finer"]

Array = NDArray[np.float64]
# Samples of a span of a curve, and rounds in which the best place among them is looked at more closely.
_SAMPLES, _ROUNDS = 17, 10
# Samples of a face along either parameter, four a span, and how many of the nearest are gone on from.
_GRID, _MOST, _STARTS = 16, 96, 4
# Steps of Newton's method, and halvings of a step that does not come nearer.
_STEPS, _HALVINGS = 30, 8


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

    That of the nearest place that is found from samples of the inside, by Newton's method, and of the boundary.
    """
    place = checked_place("point", point)
    surface = face.surface
    best = _inside(face, place)
    for curve in face.boundary:

        def along(t: Array, curve: NurbsCurve = curve) -> Array:
            return np.asarray(surface.evaluate(*curve.evaluate(t).T))

        best = min(best, distance_along(along, finer(curve.breaks(), surface), place))
    return best


def _inside(face: Face, point: Array) -> float:
    """The distance of the nearest place inside of a face that is found; infinite where no sample is inside."""
    surface = face.surface
    counts = [min(max(_GRID, 4 * len(at)), _MOST) for at in surface.breaks()]
    grid = [np.linspace(*ends, count) for ends, count in zip(surface.domain, counts, strict=True)]
    u, v = (each.ravel() for each in np.meshgrid(*grid, indexing="ij"))
    inside = face.contains(u, v)
    if not inside.any():
        return np.inf
    uv = np.column_stack([u, v])[inside]
    gaps = np.linalg.norm(surface.evaluate(*uv.T) - point, axis=1)
    best = float(gaps.min())
    # The nearest samples that are not beside each other.
    steps = [each[1] - each[0] for each in grid]
    left = np.argsort(gaps, kind="stable")
    for _ in range(_STARTS):
        if not left.size:
            break
        start = uv[left[0]]
        best = min(best, _descended(face, point, start, float(gaps[left[0]])))
        left = left[(np.abs(uv[left] - start) > 3.0 * np.array(steps)).any(axis=1)]
    return best


def _descended(face: Face, point: Array, at: Array, gap: float) -> float:
    """The distance at the end of damped Newton steps from parameters (2,) that stay inside of a face."""
    surface = face.surface
    low, high = np.array(surface.domain).T
    for _ in range(_STEPS):
        s, su, sv, suu, suv, svv = surface.evaluate(at[0], at[1], 2)
        off, tangents = s - point, np.column_stack([su, sv])
        gradient = tangents.T @ off
        first = tangents.T @ tangents
        hessian = first + np.array([[off @ suu, off @ suv], [off @ suv, off @ svv]])
        if not np.linalg.eigvalsh(hessian)[0] > 0.0:
            hessian = first
        step = np.linalg.lstsq(hessian, -gradient, rcond=1e-12)[0]
        for _ in range(_HALVINGS):
            there = np.clip(at + step, low, high)
            now = float(np.linalg.norm(surface.evaluate(there[0], there[1]) - point))
            if now < gap and bool(face.contains(there[0], there[1])):
                break
            step = 0.5 * step
        else:
            return gap
        at, gap = there, now
    return gap
