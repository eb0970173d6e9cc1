"""Bezier pieces of a curve packed for certified queries: tables of `geometry/splines/bezier_pieces.py`."""

from __future__ import annotations

from functools import cache
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines import bezier
from assembly.geometry.splines.bezier_pieces import CENTER, ERROR, HEAD, REACH, RECORD, UNIT, WEIGHT_RATIO

if TYPE_CHECKING:
    from assembly.geometry.splines.curve import NurbsCurve

__all__ = ["degree_tables", "pack_pieces", "pack_point"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@cache
def degree_tables(degree: int) -> Array:
    """Binomials of n, n - 1, n - 2 and weights of the middle's derivatives, rows of n + 1 each; binomials of 2 n."""
    n = degree
    rows = np.zeros((6, n + 1))
    for k in range(3):
        rows[k, : max(n - k + 1, 0)] = [comb(n - k, i) for i in range(n - k + 1)] if n >= k else []
    # Value, first and second derivative at 1/2: differences of the binomials of n - k over 2^(n - k).
    for k in range(3):
        if n >= k:
            row = np.array([float(comb(n - k, i)) for i in range(n - k + 1)])
            for j in range(k):
                row = (n - j) * np.diff(np.concatenate([[0.0], row, [0.0]])) * -1.0
            rows[3 + k] = row / 2.0 ** (n - k)
    return np.concatenate([rows.ravel(), [float(comb(2 * n, i)) for i in range(2 * n + 1)]])


@cache
def _product_matrix(degree: int) -> Array:
    """(n + 1, n + 1) weights C(n, i) C(n, j) / C(2 n, i + j) of the products in the Bernstein form of a product."""
    n = degree
    return np.array([[comb(n, i) * comb(n, j) / comb(2 * n, i + j) for j in range(n + 1)] for i in range(n + 1)])


@cache
def _diagonals(degree: int) -> NDArray[np.intp]:
    """Flat positions i + j of an (n + 1, n + 1) matrix, sorted, and where each sum begins."""
    n = degree
    sums = np.add.outer(np.arange(n + 1), np.arange(n + 1)).ravel()
    order = np.argsort(sums, kind="stable")
    starts = np.searchsorted(sums[order], np.arange(2 * n + 1))
    return np.concatenate([order, starts])


def _products(a: Array, b: Array) -> Array:
    """Bernstein coefficients (..., 2 n + 1) of products of polynomials with coefficients (..., n + 1)."""
    n = a.shape[-1] - 1
    terms = (a[..., :, None] * b[..., None, :] * _product_matrix(n)).reshape(a.shape[:-1] + (-1,))
    table = _diagonals(n)
    count = (n + 1) ** 2
    return np.add.reduceat(terms[..., table[:count]], table[count:], axis=-1)


def _tree_boxes(low: Array, high: Array) -> Array:
    """Boxes of the balanced tree over the spans, (2 spans - 1, 6), root first, left before right."""
    boxes = np.empty((2 * len(low) - 1, 6))

    def fill(node: int, begin: int, end: int) -> None:
        boxes[node, :3] = low[begin:end].min(axis=0)
        boxes[node, 3:] = high[begin:end].max(axis=0)
        if end - begin > 1:
            middle = (begin + end) // 2
            fill(node + 1, begin, middle)
            fill(node + 2 * (middle - begin), middle, end)

    fill(0, 0, len(low))
    center = 0.5 * (boxes[:, :3] + boxes[:, 3:])
    # Rounded up: the two corners, their difference and the middle are within four units of the last place.
    half = 0.5 * (boxes[:, 3:] - boxes[:, :3]) + 8.0 * UNIT * np.abs(boxes).max(initial=0.0)
    return np.concatenate([center, half], axis=1)


def pack_pieces(curve: NurbsCurve) -> tuple[Ints, Array]:
    """Record and pool of a curve.

    The packed curve is within `pool[ERROR]` of the given one: control points are moved to the center (one rounding
    of what is left), multiplied by their weights (one) and turned into Bezier points by p steps of at most eight
    roundings each and a sum of p + 1 terms with positive weights; all errors are parts of REACH, for every step is a
    convex combination. A rational point is a quotient of two such sums, which doubles that.
    """
    n = curve.degree
    points, d = curve.control_points, curve.control_points.shape[1]
    low, high = points.min(axis=0), points.max(axis=0)
    center = np.zeros(3)
    center[:d] = 0.5 * low + 0.5 * high
    homogeneous = np.zeros((len(points), 4))
    homogeneous[:, :d] = points - center[:d]
    weights = curve.weights
    rational = bool(weights.min() != weights.max())
    reach = float(np.sqrt((homogeneous[:, :3] ** 2).sum(axis=1).max())) * (1.0 + 8.0 * UNIT)
    if rational:
        # Powers of two change no digits.
        weights = np.ldexp(weights, -int(np.frexp(weights.max())[1]))
        homogeneous[:, :3] *= weights[:, None]
        homogeneous[:, 3] = weights
    else:
        homogeneous[:, 3] = 1.0
    at = curve.breaks()
    if len(at) == 2 and len(points) == n + 1 and curve.knots[0] == at[0] and curve.knots[-1] == at[1]:
        net, roundings = homogeneous[None], 3.0
    else:
        net, roundings = bezier.pieces(homogeneous, curve.knots, n), 16.0 * (n + 2)
        if not rational:
            net[..., 3] = 1.0
    spans = len(net)
    positions = net[..., :3] / net[..., 3:] if rational else net[..., :3]
    boxes = _tree_boxes(positions.min(axis=1), positions.max(axis=1))
    turned = np.swapaxes(net, 1, 2)
    squares = np.empty((spans, 5, 2 * n + 1))
    squares[:, 1:] = _products(turned, turned[:, 3:])
    squares[:, 0] = _products(turned[:, :3], turned[:, :3]).sum(axis=1)
    head = np.zeros(HEAD)
    head[REACH] = reach
    head[ERROR] = (2.0 if rational else 1.0) * roundings * UNIT * reach
    head[CENTER : CENTER + 3] = center
    head[WEIGHT_RATIO] = weights.max() / weights.min() * (1.0 + 4.0 * UNIT)
    return _laid_out(n, rational, [head, at, degree_tables(n), net, boxes, squares])


def _laid_out(degree: int, rational: bool, blocks: list[Array]) -> tuple[Ints, Array]:
    """Record and pool of head, breaks, tables of the degree, pieces, boxes of the tree and squares."""
    ends = np.cumsum([block.size for block in blocks])
    n = degree + 1
    breaks, binomials, pieces, tree, squares = ends[:5]
    places = [breaks, binomials, binomials + 3 * n, pieces, tree, squares, binomials + 6 * n]
    record = np.array([degree, blocks[1].size - 1, rational, *places], dtype=np.int64)
    assert record.size == RECORD
    return record, np.concatenate([block.ravel() for block in blocks])


@cache
def _origin() -> tuple[Ints, Array]:
    head = np.zeros(HEAD)
    head[WEIGHT_RATIO] = 1.0
    ends, net, square = np.array([0.0, 1.0]), np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    return _laid_out(0, False, [head, ends, degree_tables(0), net, np.zeros(6), square])


def pack_point(point: Array) -> tuple[Ints, Array]:
    """The same of a point (d,): a curve of degree 0, whose record is not to be changed."""
    record, pool = _origin()
    pool = pool.copy()
    pool[CENTER : CENTER + len(point)] = point
    return record, pool
