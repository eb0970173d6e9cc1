"""The Bezier pieces of a surface about its middle and in parts of its size, and samples of them."""

from __future__ import annotations

from functools import lru_cache
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from assembly.geometry.recognition.motions import GRAM, moves_nowhere
from assembly.geometry.splines import bezier
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Net", "Samples", "bezier_dot", "exactness", "has_no_motion", "net_of", "samples_of"]

Array = NDArray[np.float64]
# Parameters of samples in a piece: inside of it, where poles are not.
_PLACES = np.array([0.1, 0.5, 0.9])
# Pieces along either parameter that are sampled.
_FEW = 3
# Where the normal is shorter than this part of the longest one, rounding decides on its direction.
_SHORT = 1e-9
# A shape is exact if it is off by no more than this part of its size plus the rounding of its coordinates. That is
# some 4,000 roundings of those who made and moved it, and a millionth of what different shapes of a drawing differ by.
_EXACT = 1e-12
_COORDINATES = 256.0 * UNIT


class Net(NamedTuple):
    """A surface, moved to the origin and scaled to the size one.

    Attributes
    ----------
    pieces : (spans_u, spans_v, p + 1, q + 1, 4)
        Homogeneous Bezier points.
    points : (spans_u, spans_v, p + 1, q + 1, 3)
        The same as points of space.
    middle : (3,)
        Of the box of the control points: what became the origin.
    size : float
        The diagonal of that box: what became one.
    rounding : float
        How far, in parts of the size, the points may be off those of what was meant.
    """

    pieces: Array
    points: Array
    middle: Array
    size: float
    rounding: float


class Samples(NamedTuple):
    """Points of a net and its unit normals there, (n, 3), and all points by rows of u and of v, (k, l, 3)."""

    points: Array
    normals: Array
    grid: Array


def exactness(size: float, far: float) -> float:
    """How far what counts as exact may be off, of a size and with coordinates up to `far` [length]."""
    return _EXACT * size + _COORDINATES * far


def has_no_motion(pieces: Array, middle: Array, size: float, loose: float) -> bool:
    """Whether samples of a surface, which is no point, tell that no rigid motion takes it along itself.

    Then it is neither a plane nor anything round or swept (`motions.py`).

    Parameters
    ----------
    pieces : (spans_u, spans_v, p + 1, q + 1, 4)
        Homogeneous Bezier points.
    middle : (3,)
        Of the box around them.
    size : float
        The diagonal of that box.
    loose : float
        Singular values of normals and moments below this part of the largest one count as none.
    """
    shape = pieces.shape[:4]
    x, y, z = middle.tolist()
    chosen, basis = (_chosen(shape[0]), _chosen(shape[1])), (*_basis(shape[2] - 1), *_basis(shape[3] - 1))
    frame = (x, y, z), 1.0 / size
    return bool(moves_nowhere(pieces.flatten(), shape, chosen, basis, frame, loose, np.empty(GRAM)))


def net_of(surface: NurbsSurface) -> Net:
    """The net of a surface that is not one point."""
    low, high = surface.bounding_box()
    size = surface.size
    middle = 0.5 * low + 0.5 * high
    pieces = surface.bezier_pieces().copy()
    # One factor for all weights changes no point.
    pieces /= pieces[..., 3].max()
    pieces[..., :3] = (pieces[..., :3] - middle * pieces[..., 3:]) / size
    far = float(np.maximum(np.abs(low), np.abs(high)).max())
    rounding = 16.0 * UNIT + 8.0 * UNIT * far / size
    return Net(pieces, pieces[..., :3] / pieces[..., 3:], middle, size, rounding)


@lru_cache(maxsize=64)
def _basis(n: int) -> tuple[Array, Array]:
    """Bernstein polynomials of a degree at the places of samples, and their derivatives: (places, n + 1) each."""
    lower = bezier.bernstein(n - 1, _PLACES)
    slopes = n * (np.pad(lower, ((0, 0), (1, 0))) - np.pad(lower, ((0, 0), (0, 1))))
    return bezier.bernstein(n, _PLACES), slopes


@lru_cache(maxsize=64)
def _chosen(count: int) -> NDArray[np.intp]:
    """The pieces of so many that are sampled: the first, the last and some between."""
    return np.unique(np.linspace(0, count - 1, min(count, _FEW)).round().astype(np.intp))


def samples_of(net: Net) -> Samples:
    """Points and normals, at the same places of a few pieces."""
    spans_u, spans_v, m, n, _ = net.pieces.shape
    some = net.pieces[_chosen(spans_u)][:, _chosen(spans_v)]
    (b, db), (c, dc) = _basis(m - 1), _basis(n - 1)

    def evaluated(along_u: Array, along_v: Array) -> Array:
        # (i, j, p, q, 4) to (i, a, j, b, 4).
        rows = np.matmul(along_u, some.reshape(*some.shape[:3], -1)).reshape(*some.shape[:2], -1, n, 4)
        values = np.matmul(along_v, rows).swapaxes(1, 2)
        return np.asarray(values.reshape(some.shape[0] * len(_PLACES), -1, 4))

    s, su, sv = evaluated(b, c), evaluated(db, c), evaluated(b, dc)
    w = s[..., 3:]
    grid = s[..., :3] / w
    normals = np.cross((su[..., :3] - su[..., 3:] * grid) / w, (sv[..., :3] - sv[..., 3:] * grid) / w).reshape(-1, 3)
    lengths = np.linalg.norm(normals, axis=1)
    keep = lengths > _SHORT * lengths.max()
    return Samples(grid.reshape(-1, 3)[keep], normals[keep] / lengths[keep, None], grid)


@lru_cache(maxsize=64)
def _binomials(m: int, n: int) -> Array:
    """Products of binomials of two degrees, (m + 1, n + 1)."""
    rows = [np.array([comb(degree, k) for k in range(degree + 1)], dtype=float) for degree in (m, n)]
    return np.outer(*rows)


def bezier_dot(a: Array, b: Array) -> Array:
    """Bezier points (..., m + i + 1, n + j + 1) of the scalar product of two vectors of polynomials.

    Parameters
    ----------
    a, b : (..., components, m + 1, n + 1), (..., components, i + 1, j + 1)
        Their Bezier points.
    """
    (m, n), (i, j) = ((x.shape[-2] - 1, x.shape[-1] - 1) for x in (a, b))
    # Times binomials, and with u = v^(n + j + 1), these are polynomials of one variable: a product is a convolution.
    row = n + j + 1
    left = np.zeros((*a.shape[:-2], m + 1, row))
    left[..., : n + 1] = a * _binomials(m, n)
    left = left.reshape(*a.shape[:-2], -1)
    many, count = left.shape[-1], (m + i + 1) * row
    right = np.zeros((*b.shape[:-2], m + 1 + m + i + 1, row))
    right[..., m + 1 : m + i + 2, : j + 1] = b * _binomials(i, j)
    # right has `many` zeros in front: value k is the sum of left[s] * right[many + k - s].
    windows = sliding_window_view(right.reshape(*b.shape[:-2], -1), many, axis=-1)[..., 1 : count + 1, :]
    total = np.matmul(windows, left[..., ::-1, None])[..., 0].sum(axis=-2)
    return np.asarray(total.reshape(*total.shape[:-1], m + i + 1, row) / _binomials(m + i, n + j))
