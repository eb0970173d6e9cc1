"""Boundary curves of trimmed faces as Bezier curves in space, exact compositions S(c(t)): patches of degree 0 in v.

A curve c of the parameters is cut where it passes from one patch of the surface to the next. With c = (U, V) / W on
such a part, U and V from 0 to W across the patch,

    sum_ij C(p, i) U^i (W - U)^(p - i) C(q, j) V^j (W - V)^(q - j) P_ij

is homogeneous in U, V and W, so that S(c(t)) is a rational Bezier curve of degree d (p + q).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.distance.bodies.patch_blocks import PatchBlock
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.trim_pieces import cut_of_piece
from assembly.geometry.splines import bezier
from assembly.geometry.splines.bezier_pieces import UNIT

__all__ = ["boundary_patches"]

Array = NDArray[np.float64]
# Halvings of a part until all its weights are positive, by more than this part of the largest one.
_HALVINGS = 20
_WEIGHT = 1e-2


def boundary_patches(face: Face, patches: PatchBlock, only: int | None = None) -> Iterator[PatchBlock]:
    """The boundary curves of a face with these patches, or one of them by its number, a block a part."""
    surface = face.surface
    at = surface.breaks()
    curves = face.boundary
    pieces = [curve.bezier_pieces() for curve in curves]
    for number, low, high, middle in _parts(face, only):
        breaks = curves[number].breaks()
        span = min(max(int(np.searchsorted(breaks, 0.5 * (low + high), "right")) - 1, 0), len(breaks) - 2)
        whole = breaks[span + 1] - breaks[span]
        inside = (low - breaks[span]) / whole, (high - breaks[span]) / whole
        place = [_span_of(middle[axis], at[axis], surface._periods[axis]) for axis in range(2)]
        net = patches.nets[place[0][0] * (len(at[1]) - 1) + place[1][0]]
        part = _restricted(pieces[number][span], *inside)
        for begin, end, points in _halves(part, place, net, _HALVINGS):
            t = low + (high - low) * begin, low + (high - low) * end
            spans = np.array([[*t, 0.0, 1.0]])
            error = patches.error + points.error
            lightest = float(points.net[:, 3].min())
            yield PatchBlock(points.net[None, :, None], spans, patches.face, number, face.sign, False, error, lightest)


def _parts(face: Face, only: int | None) -> Iterator[tuple[int, float, float, Array]]:
    """Parts of boundary curves that stay on one patch: number of the curve, its interval, and a point inside it."""
    trim = face._boundary.table
    links, bounds = trim.rows()
    at = face.surface.breaks()
    periods = face.surface._periods
    count = int(trim.table[3])
    for k in range(count):
        piece, ends = links[k], bounds[k]
        if only is not None and int(piece.curve) != only:
            continue
        shift = np.array([ends.shift_u, ends.shift_v])
        begin, end = ends.start - shift, ends.end - shift
        times = [float(ends.t0), float(ends.t1)]
        for axis in range(2):
            for level in _between(begin[axis], end[axis], at[axis], periods[axis]):
                t, _u, _v = cut_of_piece(
                    trim.pool, int(piece.coefficients), int(piece.degree), float(ends.middle),
                    (float(ends.t0), float(ends.t1)), axis, float(level), (float(begin[axis]), float(end[axis])),
                )  # fmt: skip
                times.append(t)
        times.sort()
        curve = face.boundary[int(piece.curve)]
        for low, high in zip(times[:-1], times[1:], strict=True):
            if high > low:
                yield int(piece.curve), low, high, curve.evaluate(0.5 * (low + high))


def _between(a: float, b: float, at: Array, period: float) -> Array:
    """The breaks that lie between two coordinates, whole periods added."""
    low, high = min(a, b), max(a, b)
    if period:
        first, last = np.floor((low - at[-1]) / period), np.ceil((high - at[0]) / period)
        at = np.unique(at[None] + period * np.arange(first, last + 1.0)[:, None])
    return at[(at > low) & (at < high)]


def _span_of(x: float, at: Array, period: float) -> tuple[int, float, float]:
    """The span of a surface on which a coordinate is, and its ends on the coordinate's own sheet."""
    move = period * np.floor((x - at[0]) / period) if period else 0.0
    span = min(max(int(np.searchsorted(at, x - move, "right")) - 1, 0), len(at) - 2)
    return span, float(at[span] + move), float(at[span + 1] + move)


def _restricted(points: Array, low: float, high: float) -> Array:
    """The part from low to high of a Bezier curve."""
    low, high = max(low, 0.0), min(high, 1.0)
    if high < 1.0:
        points = bezier.divided(points, high)[0]
    return bezier.divided(points, low / high)[1] if low > 0.0 else points


@dataclass(frozen=True, eq=False)
class _SpaceCurve:
    """Homogeneous control points (n + 1, 4), and how far the curve may be from the one that is meant."""

    net: Array
    error: float


def _halves(part: Array, place: Any, net: Array, left: int) -> Iterator[tuple[float, float, _SpaceCurve]]:
    """The curve of a part, in halves where a weight of it would not be positive; the parts of 0 to 1 they are on."""
    curve = _composed(part, place, net)
    w = curve.net[:, 3]
    if left == 0 or w.min() > _WEIGHT * w.max():
        yield 0.0, 1.0, _SpaceCurve(curve.net / w.max(), curve.error)
        return
    for k, half in enumerate(bezier.divided(part, 0.5)):
        for begin, end, points in _halves(half, place, net, left - 1):
            yield 0.5 * (k + begin), 0.5 * (k + end), points


def _composed(part: Array, place: Any, net: Array) -> _SpaceCurve:
    """S(c(t)) for a part of c, (d + 1, 3) homogeneous, and a patch whose spans are given."""
    w = part[:, 2]
    scale = np.array([comb(len(w) - 1, k) for k in range(len(w))], dtype=float)
    sides = []
    for axis in range(2):
        _span, low, high = place[axis]
        along = (part[:, axis] - low * w) / (high - low)
        # How far rounding moves the parameter, and a point of the patch with it.
        sides.append((along, (8.0 * UNIT * (abs(low) + abs(high)) / (high - low) + 16.0 * UNIT)))
    error = sum(rough * _steepest(net, axis) for axis, (_along, rough) in enumerate(sides))
    (u, _), (v, _) = sides
    for axis, along in enumerate((u, v)):
        place_on = along[0] / w[0]
        if (along == place_on * w).all():
            # The curve runs along the other parameter.
            net = np.tensordot(bezier.bernstein(net.shape[axis] - 1, np.array([place_on]))[0], net, (0, axis))
            net = np.expand_dims(net, axis)
    if _is_affine(net):
        points = w[:, None] * net[0, 0] + u[:, None] * (net[1, 0] - net[0, 0]) + v[:, None] * (net[0, 1] - net[0, 0])
        size = float(np.abs(net[..., :3]).max()) * (1.0 + np.abs(u / w).max() + np.abs(v / w).max())
        return _SpaceCurve(points, error + 16.0 * UNIT * size)
    across = (
        _powers(u * scale, (w - u) * scale, net.shape[0] - 1),
        _powers(v * scale, (w - v) * scale, net.shape[1] - 1),
    )
    total, majorant = _summed(across, net), _summed(across, np.abs(net), True)
    degree = len(total) - 1
    factors = np.array([comb(degree, k) for k in range(degree + 1)], dtype=float)[:, None]
    total, majorant = total / factors, majorant / factors
    reach = float(np.linalg.norm(net[..., :3] / net[..., 3:], axis=-1).max())
    largest = np.linalg.norm(majorant[:, :3], axis=1) + reach * majorant[:, 3]
    error += 8.0 * (degree + 16.0) * UNIT * float((largest / np.maximum(total[:, 3], 1e-300)).max())
    if (net[..., 3] == net[0, 0, 3]).all() and (w == w[0]).all():
        total[:, 3] = total[0, 3]
    return _SpaceCurve(total, error)


def _steepest(net: Array, axis: int) -> float:
    """A bound of the derivative along an axis, of the size of the rational one."""
    points = net[..., :3] / net[..., 3:]
    ratio = float(net[..., 3].max() / net[..., 3].min())
    steps = np.linalg.norm(np.diff(points, axis=axis), axis=-1)
    return float(net.shape[axis] - 1) * ratio**2 * float(steps.max(initial=0.0))


def _is_affine(net: Array) -> bool:
    """Whether a patch maps parameters to space by x -> a + A x, exactly."""
    if net.shape[:2] != (2, 2) or not (net[..., 3] == net[0, 0, 3]).all():
        return False
    return bool((net[0, 0] - net[0, 1] == net[1, 0] - net[1, 1]).all())


def _powers(x: Array, y: Array, n: int) -> list[Array]:
    """C(n, i) x^i y^(n - i) of polynomials in the Bernstein form, coefficients times binomials."""
    of_x, of_y = [np.ones(1)], [np.ones(1)]
    for _ in range(n):
        of_x.append(np.convolve(of_x[-1], x))
        of_y.append(np.convolve(of_y[-1], y))
    return [comb(n, i) * np.convolve(of_x[i], of_y[n - i]) for i in range(n + 1)]


def _summed(across: tuple[list[Array], list[Array]], net: Array, absolute: bool = False) -> Array:
    """sum_ij across_i across_j P_ij, (n + 1, 4); of absolute values."""
    along_u, along_v = ([np.abs(row) if absolute else row for row in rows] for rows in across)
    result = np.zeros((len(along_u[0]) + len(along_v[0]) - 1, net.shape[-1]))
    for i, row in enumerate(along_u):
        inner = sum(other[:, None] * net[i, j] for j, other in enumerate(along_v))
        for c in range(net.shape[-1]):
            result[:, c] += np.convolve(row, inner[:, c])
    return result
