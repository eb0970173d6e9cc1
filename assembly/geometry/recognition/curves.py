"""Curves that are lines or circles, exactly: fitted to points, and proven of all of them by Bezier points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.geometry.recognition.nets import bezier_dot, exactness
from assembly.geometry.splines import bezier
from assembly.geometry.splines.bezier_pieces import UNIT

__all__ = ["Circle", "Line", "curve_form"]

Array = NDArray[np.float64]
# Samples of a piece.
_PLACES = np.linspace(0.0, 1.0, 5)


@dataclass(frozen=True, eq=False)
class Line(ReadOnlyArrays):
    """A straight line through `point` along the unit `direction`; no point of the curve is farther from it."""

    point: Array
    direction: Array
    deviation: float


@dataclass(frozen=True, eq=False)
class Circle(ReadOnlyArrays):
    """A circle about `center` across the unit `axis`; no point of the curve is farther from it than `deviation`."""

    center: Array
    axis: Array
    radius: float
    deviation: float


def curve_form(parts: Sequence[Array], tolerance: float | None = None) -> Line | Circle | None:
    """The one line or circle on which a curve, or all of several, lie.

    Parameters
    ----------
    parts : sequence of (pieces, degree + 1, 4)
        Homogeneous Bezier points, an array a degree.
    tolerance : float, optional
        How far they may be off [length]; by default what `elementary_form` takes for exact.
    """
    points = np.concatenate([(part[..., :3] / part[..., 3:]).reshape(-1, 3) for part in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    size, far = float(np.linalg.norm(high - low)), float(np.abs(points).max())
    if not size > 0.0:
        return None
    allowed = exactness(size, far) if tolerance is None else tolerance
    middle = points.mean(axis=0)
    # All three directions, of two points as well.
    ways = np.linalg.svd(points - middle, full_matrices=len(points) < 3)[2]
    rounding = UNIT * (16.0 * size + 8.0 * far)
    local = (points - middle) @ ways.T
    off = float(np.hypot(local[:, 1], local[:, 2]).max())
    if off <= allowed:
        return Line(middle, ways[0], off + rounding)
    off = float(np.abs(local[:, 2]).max())
    if off > allowed:
        return None
    # In the plane, in parts of the size.
    flat = []
    for part in parts:
        w = part[..., 3:]
        flat.append(np.concatenate([(part[..., :3] - middle * w) @ ways[:2].T / size, w], axis=-1))
    center, radius, beside = _circle(flat)
    # What bends by no more than a line may be off, and is none, is no circle either but rounding.
    if not off + size * beside <= allowed or size <= 8.0 * radius * allowed:
        return None
    return Circle(
        middle + size * center @ ways[:2], ways[2], size * radius, off + size * beside + rounding * (1.0 + radius)
    )


def _circle(parts: list[Array]) -> tuple[Array, float, float]:
    """Center and radius of the circle through samples, 2 c.x + (r^2 - c.c) = x.x; how far the parts are from it."""
    samples = []
    for part in parts:
        values = bezier.bernstein(part.shape[1] - 1, _PLACES) @ part
        samples.append((values[..., :2] / values[..., 2:]).reshape(-1, 2))
    x = np.concatenate(samples)
    rows = np.column_stack([2.0 * x, np.ones(len(x))])
    a, b, rest = np.linalg.lstsq(rows, (x**2).sum(axis=1), rcond=None)[0].tolist()
    center, radius = np.array([a, b]), float(np.sqrt(max(rest + a * a + b * b, 0.0)))
    if not radius > 0.0:
        return center, radius, np.inf
    # From a point of the circle, e.(e + 2 x_0): large radii cost no digits.
    base = radius * (x[0] - center) / np.linalg.norm(x[0] - center)
    worst = 0.0
    for part in parts:
        w = part[:, None, :, 2:]
        e = np.moveaxis(part[..., :2] - (center + base) * part[..., 2:], -1, 1)[..., None]
        other = e + 2.0 * base[:, None, None] * w
        worst = max(worst, float(np.abs(bezier_dot(e, other) / bezier_dot(w, w)).max()) / radius)
    return center, radius, worst
