"""Bezier nets restricted to boxes.

Restricted to [x0, x1], the k-th Bezier point of degree n is the blossom of n - k times x0 and k times x1 (Piegl &
Tiller, The NURBS Book, section 5.3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.bezier import bernstein

__all__ = ["restricted", "restriction"]

Array = NDArray[np.float64]


def restriction(degree: int, low: Array, high: Array) -> Array:
    """Matrices (n, degree + 1, degree + 1) from the Bezier points of a piece to those over [low, high] of it."""
    ends, place = np.unique(low + 1j * high, return_inverse=True)
    result = np.zeros((ends.size, degree + 1, degree + 1))
    for k in range(degree + 1):
        one, other = bernstein(degree - k, ends.real), bernstein(k, ends.imag)
        for i in range(degree - k + 1):
            result[:, k, i : i + k + 1] += one[:, i : i + 1] * other
    return np.asarray(result[place])


def restricted(net: Array, boxes: Array) -> Array:
    """Bezier points of pieces (n, m + 1, l + 1, components) over boxes (n, 4) of their unit squares: u, then v."""
    n, rows, columns, components = net.shape
    in_u = restriction(rows - 1, boxes[:, 0], boxes[:, 1]) @ net.reshape(n, rows, -1)
    in_v = restriction(columns - 1, boxes[:, 2], boxes[:, 3])[:, None] @ in_u.reshape(n, rows, columns, components)
    return np.asarray(in_v)
