"""Bounds of the first and second derivatives of surfaces and trim curves over boxes of their parameters.

With S = A / w, one rational Bezier piece, and P = A_u w - A w_u:

    S_u = P / w^2,    S_uu = (P_u w - 2 P w_u) / w^3,    S_uv = (P_v w - 2 P w_v) / w^3.

The numerators are made as Bezier nets, whose longest points bound them. Bounds of their terms one by one would not see
that they cancel: the twist S_uv of a cylinder would not come out as zero.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.bezier import elevation
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.bvh.normal_nets import bezier_product, restricted, restriction

__all__ = ["bends", "curve_bounds", "surface_bounds"]

Array = NDArray[np.float64]
# Bounds over parts of a span that only rounding leaves are divided by their width: they are widened to this part of it.
NARROWEST = 1e-6
# So many restricted nets are made at a time.
AT_ONCE = 2000


def _longest(net: Array) -> Array:
    """The longest vector of each net (n, rows, columns, k)."""
    if not net.size:
        return np.zeros(len(net))
    longest: Array = np.linalg.norm(net, axis=-1).max(axis=(1, 2))
    return longest


def _rate(net: Array, axis: int) -> Array:
    degree = net.shape[axis] - 1
    return degree * np.diff(net, axis=axis) if degree else np.zeros_like(net)


def _difference(a: Array, b: Array) -> Array:
    """a - b of nets of polynomials, of which one may have been left with a higher degree."""
    p, q = max(a.shape[1], b.shape[1]) - 1, max(a.shape[2], b.shape[2]) - 1
    return _elevated(a, p, q) - _elevated(b, p, q)


def _elevated(net: Array, p: int, q: int) -> Array:
    if net.shape[1:3] == (p + 1, q + 1):
        return net
    in_u, in_v = elevation(net.shape[1] - 1, p), elevation(net.shape[2] - 1, q)
    elevated: Array = np.einsum("ai,bj,nijk->nabk", in_u, in_v, net)
    return elevated


def _bounds_over(nets: Sequence[Array], divisor: Array) -> Array:
    """The longest vectors of each of several nets, over a divisor: (n, nets)."""
    return np.column_stack([_longest(net) / divisor for net in nets])


def _patch_bounds(net: Array) -> tuple[Array, Array]:
    """Bounds of |S_u|, |S_v| (n, 2) and of |S_uu|, |S_uv|, |S_vv| (n, 3) over the unit square, of nets (n, ., ., 4)."""
    w = net[..., 3:]
    xyz = net[..., :3] / w
    middle = 0.5 * (xyz.min(axis=(1, 2), keepdims=True) + xyz.max(axis=(1, 2), keepdims=True))
    a, least = net[..., :3] - middle * w, w.min(axis=(1, 2, 3))
    if np.ptp(w) == 0.0:
        au, av = _rate(a, 1), _rate(a, 2)
        second = _rate(au, 1), _rate(au, 2), _rate(av, 2)
        return _bounds_over((au, av), least), _bounds_over(second, least)
    au, av, wu, wv = _rate(a, 1), _rate(a, 2), _rate(w, 1), _rate(w, 2)
    pu = _difference(bezier_product(w, au), bezier_product(wu, a))
    pv = _difference(bezier_product(w, av), bezier_product(wv, a))

    def second_derivative(p: Array, axis: int, rate: Array) -> Array:
        return _difference(bezier_product(w, _rate(p, axis)), 2.0 * bezier_product(rate, p))

    second = second_derivative(pu, 1, wu), second_derivative(pu, 2, wv), second_derivative(pv, 2, wv)
    return _bounds_over((pu, pv), least**2), _bounds_over(second, least**3)


def _not_narrow(low: Array, high: Array) -> tuple[Array, Array]:
    low = np.minimum(low, np.maximum(high - NARROWEST, 0.0))
    return low, np.maximum(high, low + NARROWEST)


def surface_bounds(surface: NurbsSurface, low: Array, high: Array) -> tuple[Array, Array]:
    """Bounds over boxes of (u, v).

    Parameters
    ----------
    surface : NurbsSurface
    low, high : (n, 2)
        Corners of the boxes, which may go over knots and, where the surface is closed, over its seam.

    Returns
    -------
    first : (n, 2)
        Of |S_u|, |S_v|.
    second : (n, 3)
        Of |S_uu|, |S_uv|, |S_vv|.
    """
    pieces, breaks = surface.bezier_pieces(), surface.breaks()
    first, second = np.zeros((len(low), 2)), np.zeros((len(low), 3))
    turns = [(-1, 0, 1) if closed else (0,) for closed in surface.closed]
    periods = np.array([at[-1] - at[0] for at in breaks])
    for i, j in np.ndindex(len(breaks[0]) - 1, len(breaks[1]) - 1):
        start = np.array([breaks[0][i], breaks[1][j]])
        width = np.array([breaks[0][i + 1], breaks[1][j + 1]]) - start
        for turn in ((turn_u, turn_v) for turn_u in turns[0] for turn_v in turns[1]):
            begin = start + periods * turn
            lo, hi = np.clip((low - begin) / width, 0.0, 1.0), np.clip((high - begin) / width, 0.0, 1.0)
            rows = np.flatnonzero((hi > lo).all(axis=1))
            lo, hi = _not_narrow(lo, hi)
            for part in np.array_split(rows, 1 + len(rows) // AT_ONCE) if len(rows) else ():
                box = np.column_stack([lo[part, 0], hi[part, 0], lo[part, 1], hi[part, 1]])
                net = restricted(np.broadcast_to(pieces[i, j], (len(part), *pieces[i, j].shape)), box)
                rates, bends = _patch_bounds(net)
                wide = (hi - lo)[part] * width
                first[part] = np.maximum(first[part], rates / wide)
                by = np.column_stack([wide[:, 0] ** 2, wide[:, 0] * wide[:, 1], wide[:, 1] ** 2])
                second[part] = np.maximum(second[part], bends / by)
    return first, second


def curve_bounds(curve: NurbsCurve, t: Array) -> Array:
    """Bounds (n, 2) of |c_u''| and |c_v''| of a plane curve over intervals t (n, 2)."""
    pieces, at = curve.bezier_pieces(), curve.breaks()
    found = np.zeros((len(t), 2))
    for k in range(len(at) - 1 if pieces.shape[1] > 1 else 0):
        width = at[k + 1] - at[k]
        lo, hi = np.clip((t.min(axis=1) - at[k]) / width, 0, 1), np.clip((t.max(axis=1) - at[k]) / width, 0, 1)
        rows = np.flatnonzero(hi > lo)
        lo, hi = _not_narrow(lo, hi)
        net = restriction(pieces.shape[1] - 1, lo[rows], hi[rows]) @ pieces[k][None]
        w = net[..., -1:]
        x = net[..., :2] / w
        middle = 0.5 * (x.min(axis=1, keepdims=True) + x.max(axis=1, keepdims=True))
        a, off = net[..., :2] - middle * w, np.abs(x - middle).max(axis=1)
        a1, w1 = _rate(a, 1), _rate(w, 1)
        a2, w2 = _rate(a1, 1), _rate(w1, 1)
        least = w.min(axis=1)
        rate = (np.abs(a1).max(axis=1) + np.abs(w1).max(axis=1) * off) / least
        bend = np.abs(a2).max(axis=1) + np.abs(w2).max(axis=1) * off + 2.0 * np.abs(w1).max(axis=1) * rate
        wide = ((hi - lo)[rows] * width)[:, None]
        found[rows] = np.maximum(found[rows], bend / least / wide**2)
    return found


def bends(curve: NurbsCurve, t: Array) -> NDArray[np.int64]:
    """To which side of its chord, and of the chords of all its parts, a boundary curve is over intervals t (n, 2).

    1: left, where the material of a face is; -1: right; 0: not known. Left is where its control polygon over the
    interval, of one span or of several after another, turns right only, and by less than half a turn in all: then so
    do the polygons of its parts.
    """
    pieces, at = curve.bezier_pieces(), curve.breaks()
    low, high = t.min(axis=1), t.max(axis=1)
    # What is beyond a knot by rounding is not.
    rounded = 1e-12 * np.diff(at)
    first = np.searchsorted(at[1:-1] - rounded[:-1], low, side="right")
    last = np.maximum(np.searchsorted(at[1:-1] + rounded[1:], high, side="left"), first)
    found = np.zeros(len(t), dtype=np.int64)
    for k, end in np.unique(np.column_stack([first, last]), axis=0).tolist():
        rows = np.flatnonzero((first == k) & (last == end))
        nets = []
        for span in range(k, end + 1):
            width = at[span + 1] - at[span]
            part = (np.clip((ends[rows] - at[span]) / width, 0.0, 1.0) for ends in (low, high))
            net = restriction(pieces.shape[1] - 1, *part) @ pieces[span][None]
            # Where spans meet both have the same point.
            nets.append(net if span == k else net[:, 1:])
        found[rows] = _side(np.concatenate(nets, axis=1))
    return found


def _side(net: Array) -> NDArray[np.int64]:
    """To which side of their chords control polygons (n, points, 3) are that turn to one side only; 0 for others."""
    way = np.diff(net[..., :2] / net[..., -1:], axis=1)
    turn = way[:, :-1, 0] * way[:, 1:, 1] - way[:, :-1, 1] * way[:, 1:, 0]
    ahead = ((way[:, :1] * way).sum(axis=2) > 0.0).all(axis=1)
    little = 1e-15 * (way**2).sum(axis=2).max(axis=1)[:, None]
    left, right = (turn <= little).all(axis=1), (turn >= -little).all(axis=1)
    sides: NDArray[np.int64] = np.where(ahead & left, 1, np.where(ahead & right, -1, 0))
    return sides
