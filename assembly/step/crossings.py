"""Where coordinates of a function of one parameter take values: all crossings between its samples, found at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["crossings"]

Array = NDArray[np.float64]
# How near to a root its place is, absolute and relative: rounding.
_ROOT = 1e-15


def crossings(values: Array, at: Array, function: Callable[[Array], Array], joints: Sequence[Array]) -> Array:
    """Parameters at which a coordinate of a sampled function takes one of its values.

    Parameters
    ----------
    values : (n, d)
        Of the function at parameters.
    at : (n,)
        These, rising.
    function
        (m,) -> (m, d).
    joints
        The values of each coordinate.
    """
    found = []
    rows: list[tuple[Array, ...]] = []
    for axis, row in enumerate(joints):
        sides = values[:, axis, None] - row
        found.append(at[(sides == 0.0).any(axis=1)])
        k, j = np.nonzero(sides[:-1] * sides[1:] < 0.0)
        rows.append((at[k], at[k + 1], sides[k, j], sides[k + 1, j], np.full(k.size, axis), row[j]))
    if not any(row[0].size for row in rows):
        return np.concatenate(found)
    low, high, below, above, which, wanted = (np.concatenate(column) for column in zip(*rows, strict=True))
    which = which.astype(np.int64)

    def apart(t: Array, rows: NDArray[np.int64]) -> Array:
        gap: Array = function(t)[np.arange(t.size), which[rows]] - wanted[rows]
        return gap

    found.append(_roots(apart, (low, high), (below, above)))
    return np.concatenate(found)


def _roots(
    function: Callable[[Array, NDArray[np.int64]], Array], ends: tuple[Array, Array], values: tuple[Array, Array]
) -> Array:
    """Roots of functions between places where they have different signs, all at once: Chandrupatla's method.

    T. R. Chandrupatla, A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function without
    using derivatives, Advances in Engineering Software 28 (1997).

    Parameters
    ----------
    function
        Of parameters and which of the functions each is of.
    ends, values
        Two places of each, and the values there.
    """
    (x1, x2), (f1, f2) = ends, values
    roots = np.empty(x1.size)
    left = np.arange(x1.size)
    part = np.full(x1.size, 0.5)
    while left.size:
        x = x1 + part * (x2 - x1)
        f = function(x, left)
        is_same = (f > 0.0) == (f1 > 0.0)
        x3, f3 = np.where(is_same, x1, x2), np.where(is_same, f1, f2)
        x2, f2 = np.where(is_same, x2, x1), np.where(is_same, f2, f1)
        x1, f1 = x, f
        best = np.where(np.abs(f1) < np.abs(f2), x1, x2)
        least = (_ROOT + _ROOT * np.abs(best)) / np.abs(x2 - x1)
        is_done = (least > 0.5) | (f1 == 0.0)
        roots[left[is_done]] = np.where(f1 == 0.0, x1, best)[is_done]
        x1, x2, x3, f1, f2, f3, least, left = (row[~is_done] for row in (x1, x2, x3, f1, f2, f3, least, left))
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        # An inverse parabola through three places where it is monotonous between them, else the middle.
        part = np.full(x1.size, 0.5)
        k = np.flatnonzero((phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi))
        a, b, c = f1[k], f2[k], f3[k]
        part[k] = a / (b - a) * c / (b - c) + (x3[k] - x1[k]) / (x2[k] - x1[k]) * a / (c - a) * b / (c - b)
        part = np.minimum(np.maximum(part, least), 1.0 - least)
    return roots
