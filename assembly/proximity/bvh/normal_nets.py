"""Surfaces as Bezier pieces that can be restricted to boxes, with the Bezier points of their normals.

With S = A / w, one polynomial piece, w^3 Su x Sv = w Au x Av - w_v Au x A - w_u A x Av is a polynomial, too: its Bezier
points over a box span a cone that holds the normals there. Restricted to [x0, x1], the k-th Bezier point of degree n is
the blossom of n - k times x0 and k times x1 (Piegl & Tiller, The NURBS Book, section 5.3).
"""

from __future__ import annotations

from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.bezier import bernstein

__all__ = ["Nets", "bezier_product", "nets_of", "restricted", "restriction"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_UNIT_ROUNDING = 2.3e-16


class Nets(NamedTuple):
    """The Bezier pieces of a face's surface.

    Attributes
    ----------
    at_u, at_v
        Ends of the spans.
    points : (spans_u, spans_v, p + 1, q + 1, 4)
        Homogeneous.
    normals : (spans_u, spans_v, ., ., 3)
        Of the outward normal, times a positive function; zero at poles.
    slack : (spans_u, spans_v)
        How far each normal's Bezier point may be off.
    poles : (spans_u, spans_v) of bool
        Whether a piece has a pole: zeros among its normals are known to be.
    extent : float
        The largest coordinate.
    """

    at_u: Array
    at_v: Array
    points: Array
    normals: Array
    slack: Array
    poles: NDArray[np.bool_]
    extent: float


def _binomials(degree: int) -> Array:
    return np.array([comb(degree, k) for k in range(degree + 1)], dtype=float)


def bezier_product(a: Array, b: Array, crossed: bool = False) -> Array:
    """Bezier points of the product of two (cross product of two vectors), (..., m + 1, n + 1, components) each."""
    m, n, i, j = a.shape[-3] - 1, a.shape[-2] - 1, b.shape[-3] - 1, b.shape[-2] - 1
    left = a * (_binomials(m)[:, None] * _binomials(n))[..., None]
    right = b * (_binomials(i)[:, None] * _binomials(j))[..., None]
    total = np.zeros((*a.shape[:-3], m + i + 1, n + j + 1, max(a.shape[-1], b.shape[-1])))
    for k in range(m + 1):
        for l in range(n + 1):
            one = left[..., k : k + 1, l : l + 1, :]
            total[..., k : k + i + 1, l : l + j + 1, :] += np.cross(one, right) if crossed else one * right
    return np.asarray(total / (_binomials(m + i)[:, None] * _binomials(n + j))[..., None])


def _rates(net: Array) -> tuple[Array, Array]:
    """Bezier points of the derivatives over the unit square."""
    p, q = net.shape[-3] - 1, net.shape[-2] - 1
    return p * np.diff(net, axis=-3), q * np.diff(net, axis=-2)


def nets_of(face: Face) -> Nets:
    """The nets of a face."""
    surface = face.surface
    points = surface.bezier_pieces()
    p, q = surface.degree
    xyz = points[..., :3] / points[..., 3:]
    extent = float(np.abs(xyz).max())
    middle = 0.5 * (xyz.min(axis=(2, 3), keepdims=True) + xyz.max(axis=(2, 3), keepdims=True))
    w = points[..., 3:]
    # About the middle of each piece, where the products are smaller.
    a = points[..., :3] - middle * w
    au, av = _rates(a)
    largest = [np.linalg.norm(net, axis=-1).max(axis=(2, 3)) for net in (a, au, av, w)]
    if np.ptp(w) == 0.0:
        normals = bezier_product(au, av, crossed=True)
        size = largest[1] * largest[2]
        rates = [np.zeros_like(size)] * 2
        weight = np.ones_like(size)
    else:
        wu, wv = _rates(w)
        normals = bezier_product(w, bezier_product(au, av, crossed=True))
        normals -= bezier_product(wv, bezier_product(au, a, crossed=True))
        normals -= bezier_product(wu, bezier_product(a, av, crossed=True))
        rates = [np.abs(net).max(axis=(2, 3, 4)) for net in (wu, wv)]
        weight = largest[3]
        size = weight * largest[1] * largest[2] + largest[0] * (rates[1] * largest[1] + rates[0] * largest[2])
    # The products' own rounding, and that of the coordinates, which derivatives magnify.
    off = 16.0 * _UNIT_ROUNDING * extent * largest[3]
    slack = weight * off * 2.0 * (p * largest[2] + q * largest[1])
    slack += off * (rates[1] * (largest[1] + 2.0 * p * largest[0]) + rates[0] * (largest[2] + 2.0 * q * largest[0]))
    slack += 32.0 * (p + q) * _UNIT_ROUNDING * size
    # An edge that is one point, to the tolerance that makes it a pole, is one: the normal's points there vanish.
    bits = surface._pole_bits
    poles = np.zeros(slack.shape, dtype=bool)
    for bit, edge in ((1, np.s_[0, :, 0]), (2, np.s_[-1, :, -1]), (4, np.s_[:, 0, :, 0]), (8, np.s_[:, -1, :, -1])):
        if bits & bit:
            normals[edge] = 0.0
            poles[edge[:2]] = True
    at_u, at_v = surface.breaks()
    return Nets(at_u, at_v, points, face.sign * normals, slack, poles, extent)


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
