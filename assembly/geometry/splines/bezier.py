"""Knot vectors and Bezier pieces: what curves and surfaces share, one direction at a time.

A spline is a Bezier curve on every span. Its blossom f(t_1, ..., t_p), the symmetric multi-affine
form with f(t, ..., t) = C(t), gives the Bezier points of the span [a, b] as

    b_k = f(a, ..., a, b, ..., b)      with k times b,

(Ramshaw, "Blossoms are polar forms", 1989), for any knots, clamped or not.
"""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, integer, real_array

# Where power tables are used, which lose digits with the degree; curves beyond are evaluated in Bernstein form.
MAX_DEGREE = 15
MAX_CURVE_DEGREE = 50
# Distinct knots closer than this part of the domain would make a span that doubles cannot resolve.
_MIN_SPAN = 1e-14
_FIRST = np.ones(1, dtype=bool)

Array = NDArray[np.float64]


def checked_knots(name: str, value: ArrayLike, degree: int, count: int) -> Array:
    """Knots that fit `count` control points of the given degree, read-only.

    Raises
    ------
    InputError
        Wrong count, decreasing knots, an empty domain, a discontinuity, or spans too short for doubles.
    """
    knots = real_array(name, value, ("n",))
    if knots.size != count + degree + 1:
        raise InputError(
            f"{name} has {knots.size} values; expected {count + degree + 1} "
            f"({count} control points + degree {degree} + 1)"
        )
    # Plain floats: most vectors have a dozen knots, for which every call of numpy costs more than all of this.
    values = knots.tolist()
    if count == degree + 1 and values[0] == values[degree] < values[count] == values[-1]:
        # One clamped span.
        knots.flags.writeable = False
        return knots
    if sorted(values) != values:
        k = next(k for k, (knot, following) in enumerate(pairwise(values)) if following < knot)
        raise InputError(
            f"{name} decreases from {values[k]:g} to {values[k + 1]:g} at index {k + 1}; expected nondecreasing knots"
        )
    low, high = values[degree], values[count]
    if not high > low:
        raise InputError(
            f"{name} has the empty domain [{low:g}, {high:g}]; expected knots[degree] < knots[-degree - 1]"
        )
    times = Counter(values)
    if max(times.values()) > degree:
        for knot, count_of in times.items():
            allowed = degree if low < knot < high else degree + 1
            if count_of > allowed:
                raise InputError(
                    f"{name} holds {knot:g} {count_of} times; expected at most {allowed} "
                    f"(more would tear the spline of degree {degree})"
                )
    distinct = [knot for knot in times if low <= knot <= high]
    shortest = min(following - knot for knot, following in pairwise(distinct))
    if shortest < _MIN_SPAN * (high - low):
        raise InputError(
            f"{name} has a span of {shortest:g}; expected distinct knots at least {_MIN_SPAN:g} of the domain apart"
        )
    knots.flags.writeable = False
    return knots


def checked_degree(name: str, value: int, count: int, highest: int = MAX_DEGREE) -> int:
    """A degree that `count` control points can carry."""
    degree = integer(name, value, 1, highest)
    if count < degree + 1:
        raise InputError(f"{name} is {degree}; expected at most {count - 1} with {count} control points")
    return degree


def breaks(knots: Array, degree: int) -> Array:
    """The distinct knots of the domain."""
    inside = knots[degree : knots.size - degree]
    if inside.size == 2:
        return np.array(inside)
    # Knots are sorted.
    return np.asarray(inside[np.concatenate([_FIRST, inside[1:] != inside[:-1]])])


def _span_indices(knots: Array, degree: int) -> NDArray[np.intp]:
    """Index j of every nonempty span [knots[j], knots[j + 1]] of the domain."""
    j = np.arange(degree, knots.size - degree - 1)
    return j[knots[j + 1] > knots[j]]


def extraction(knots: Array, degree: int) -> tuple[Array, NDArray[np.intp]]:
    """Matrices from control points to the Bezier points of every span.

    Returns
    -------
    matrices : (spans, degree + 1, degree + 1)
        Bezier points of span i are `matrices[i] @ control_points[first[i] : first[i] + degree + 1]`.
    first : (spans,)
        Index of the first control point that a span uses.

    Both are read-only.
    """
    return _extraction(knots.tobytes(), degree)


@lru_cache(maxsize=256)
def _extraction(row: bytes, degree: int) -> tuple[Array, NDArray[np.intp]]:
    """`extraction` of the knots with these bytes: circles, lines and faces of one kind share their knots."""
    knots, p = np.frombuffer(row), degree
    j = _span_indices(knots, p)
    a, b = knots[j], knots[j + 1]
    matrices = np.empty((j.size, p + 1, p + 1))
    for k in range(p + 1):
        d = np.broadcast_to(np.eye(p + 1), (j.size, p + 1, p + 1))
        for r in range(1, p + 1):
            t = a if r <= p - k else b
            i = np.arange(r, p + 1)
            left = knots[j[:, None] - p + i]
            right = knots[j[:, None] + 1 + i - r]
            alpha = ((t[:, None] - left) / (right - left))[:, :, None]
            d = (1.0 - alpha) * d[:, :-1] + alpha * d[:, 1:]
        matrices[:, k] = d[:, 0]
    first = j - p
    matrices.flags.writeable = first.flags.writeable = False
    return matrices, first


def pieces(points: Array, knots: Array, degree: int) -> Array:
    """Bezier points of every span along the first axis: (n, ...) to (spans, degree + 1, ...)."""
    if len(points) == degree + 1 and knots[0] == knots[degree] and knots[degree + 1] == knots[-1]:
        # A clamped spline of one span has them for control points. A negative zero becomes positive, as in any sum.
        return np.asarray(points[None] + 0.0)
    matrices, first = extraction(knots, degree)
    windows = points[first[:, None] + np.arange(degree + 1)]
    flat = windows.reshape(first.size, degree + 1, -1)
    result = np.asarray(matrices @ flat)
    # Neighbors share an end in exact arithmetic; make them share it in doubles too.
    result[1:, 0] = result[:-1, -1]
    return result.reshape(windows.shape)


def insert(points: Array, knots: Array, degree: int, value: float, times: int) -> tuple[Array, Array]:
    """Insert a knot along the first axis: Piegl & Tiller, The NURBS Book, A5.1.

    Raises
    ------
    InputError
        The value is outside the domain, or its multiplicity would exceed the degree.
    """
    low, high = knots[degree], knots[knots.size - degree - 1]
    if not low <= value <= high:
        raise InputError(f"value is {value:g}; expected a knot in the domain [{low:g}, {high:g}]")
    present = int(np.count_nonzero(knots == value))
    if times < 1 or present + times > degree:
        raise InputError(
            f"times is {times}; expected 1 to {degree - present}: "
            f"the knot {value:g} is there {present} times and the degree is {degree}"
        )
    for _ in range(times):
        s = int(np.count_nonzero(knots == value))
        k = int(np.searchsorted(knots, value, side="right")) - 1
        i = np.arange(k - degree + 1, k - s + 1)
        alpha = ((value - knots[i]) / (knots[i + degree] - knots[i])).reshape((-1,) + (1,) * (points.ndim - 1))
        moved = alpha * points[i] + (1.0 - alpha) * points[i - 1]
        points = np.concatenate([points[: k - degree + 1], moved, points[k - s :]])
        knots = np.insert(knots, k + 1, value)
    return points, knots


@lru_cache(maxsize=64)
def elevation(degree: int, target: int) -> Array:
    """Matrix (target + 1, degree + 1) that writes a Bezier piece in a higher degree, exactly.

    Piegl & Tiller, The NURBS Book, section 5.5.
    """
    extra = target - degree
    matrix = np.zeros((target + 1, degree + 1))
    for i in range(target + 1):
        for k in range(max(0, i - extra), min(degree, i) + 1):
            matrix[i, k] = comb(degree, k) * comb(extra, i - k) / comb(target, i)
    matrix.flags.writeable = False
    return matrix


def full_knots(at: Array, degree: int) -> Array:
    """The clamped knots of Bezier pieces that share their ends."""
    times = np.full(at.size, degree)
    times[[0, -1]] += 1
    return np.repeat(at, times)


def joined(bezier: Array) -> Array:
    """Control points (spans * degree + 1, ...) of Bezier pieces (spans, degree + 1, ...) that share their ends."""
    inner = bezier[:, :-1].reshape((-1,) + bezier.shape[2:])
    return np.concatenate([inner, bezier[-1, -1:]])


def divided(points: Array, x: float) -> tuple[Array, Array]:
    """De Casteljau's algorithm: Bezier points of both parts of a piece (degree + 1, ...), cut at x in [0, 1]."""
    left, right = np.empty_like(points), np.empty_like(points)
    last = len(points) - 1
    for k in range(last + 1):
        left[k], right[last - k] = points[0], points[-1]
        points = (1.0 - x) * points[:-1] + x * points[1:]
    return left, right


@lru_cache(maxsize=64)
def power_matrix(degree: int) -> Array:
    """Matrix of integers from Bezier points to powers about the middle of a span.

    With z = (2 u - a - b) / (b - a), the Bernstein polynomial is
    B_k = 2^-p C(p, k) (1 + z)^k (1 - z)^(p - k); entry [m, k] is its coefficient of z^m without 2^-p.
    """
    matrix = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        row = [1]
        for sign in [1] * k + [-1] * (degree - k):
            row = [(row[m] if m < len(row) else 0) + sign * (row[m - 1] if m else 0) for m in range(len(row) + 1)]
        matrix[:, k] = [comb(degree, k) * c for c in row]
    matrix.flags.writeable = False
    return matrix


def centered_powers(bezier: Array, at: Array, axis: int) -> Array:
    """Coefficients of (u - middle)^m on every span from Bezier points.

    Parameters
    ----------
    bezier
        Bezier points, spans on axis 0 and points of one piece on `axis`.
    at
        (spans + 1,) ends of the spans.
    """
    degree = bezier.shape[axis] - 1
    # `np.moveaxis` takes longer than the product.
    order = [*range(axis), *range(axis + 1, bezier.ndim), axis]
    turned = bezier.transpose(order) @ power_matrix(degree).T
    scale = 0.5**degree * (2.0 / np.diff(at))[:, None] ** np.arange(degree + 1)
    turned *= scale.reshape((at.size - 1,) + (1,) * (turned.ndim - 2) + (degree + 1,))
    back = [*range(axis), bezier.ndim - 1, *range(axis, bezier.ndim - 1)]
    return turned.transpose(back)


@lru_cache(maxsize=64)
def _binomials(degree: int) -> tuple[NDArray[np.intp], Array]:
    """0 to the degree, and the binomials of that."""
    return np.arange(degree + 1), np.array([comb(degree, k) for k in range(degree + 1)], dtype=float)


def bernstein(degree: int, x: Array) -> Array:
    """Bernstein polynomials at x in [0, 1]: (len(x), degree + 1)."""
    k, binomials = _binomials(degree)
    return np.asarray(binomials * x[:, None] ** k * (1.0 - x[:, None]) ** (degree - k))


def mirrored(knots: Array, low: float, high: float) -> Array:
    """The knots of the reversed spline over the same domain [low, high], its ends kept to the bit."""
    turned = (low + high) - knots[::-1]
    turned[knots[::-1] == high] = low
    turned[knots[::-1] == low] = high
    return np.asarray(turned)
