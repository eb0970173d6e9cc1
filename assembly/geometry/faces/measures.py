"""Areas of faces, and the volumes that faces enclose.

The volume of a body is the integral of S.n / 3 over its faces (divergence theorem). Both integrands are integrated
by Gauss quadrature, exactly as far as doubles go: `geometry/faces/integrals.py` has the formula.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces import trim_pieces as layout
from assembly.geometry.faces.integrals import along_bottom, along_pieces
from assembly.geometry.faces.trim_table import TrimTable
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["area_and_volume"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Numbers of nodes, one after the other, until two of them agree to this part.
_NODES = (6, 12, 24, 48, 96, 192)
_AGREE = 1e-13


@cache
def _gauss(count: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nodes, weights


def _levels(knots: Array, low: float, high: float, period: float) -> Array:
    """Knots inside a cell, and its ends."""
    inside = knots
    if period:
        inside = np.concatenate([knots + k * period for k in range(-2, 3)])
    inside = inside[(inside > low) & (inside < high)]
    return np.unique(np.concatenate([[low], inside, [high]]))


def _rows(table: TrimTable, levels: tuple[Array, Array]) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Parts of pieces on which no knot of the surface is passed."""
    record, pool = table.table, table.pool
    count, first = int(record[layout.TRIM_ALL]), int(record[layout.TRIM_PIECE_POOL])
    ints = record[record[layout.TRIM_PIECE_TABLE] :][: count * layout.PIECE_INTS].reshape(-1, layout.PIECE_INTS)
    doubles = pool[first : first + count * layout.PIECE_DOUBLES].reshape(-1, layout.PIECE_DOUBLES)
    rows, which = [], []
    for k in np.flatnonzero(ints[:, layout.PIECE_SIGN_U]).tolist():
        piece = doubles[k]
        t0, t1 = float(piece[layout.PIECE_T0]), float(piece[layout.PIECE_T1])
        cuts = [t0, t1]
        for axis in range(2):
            low, high, shift = piece[2 * axis], piece[2 * axis + 1], piece[layout.SHIFT_U + axis]
            start, end = float(piece[layout.START + axis] - shift), float(piece[layout.END + axis] - shift)
            for level in levels[axis][(levels[axis] > low) & (levels[axis] < high)]:
                t, _, _ = layout.cut_of_piece(
                    pool, int(ints[k, layout.PIECE_COEFFICIENTS]), int(ints[k, layout.PIECE_DEGREE]),
                    float(piece[layout.MIDDLE]), t0, t1, axis, float(level - shift), start, end,
                )  # fmt: skip
                cuts.append(min(max(t, t0), t1))
        cuts.sort()
        for a, b in zip(cuts[:-1], cuts[1:], strict=True):
            rows.append([a, b, piece[layout.MIDDLE], piece[layout.SHIFT_U], piece[layout.SHIFT_V]])
            which.append(k)
    chosen = ints[np.array(which, dtype=np.int64)]
    coefficients, degrees = chosen[:, layout.PIECE_COEFFICIENTS].copy(), chosen[:, layout.PIECE_DEGREE].copy()
    return np.array(rows).reshape(-1, 5), coefficients, degrees


def area_and_volume(surface: NurbsSurface, table: TrimTable) -> Array:
    """Area, and integral of S.(Su x Sv) / 3, of the part of a surface that a trim leaves: (2,)."""
    at = int(table.table[layout.TRIM_FRAME])
    frame = table.pool[at : at + layout.FRAME]
    low, high = frame[[layout.LOW_U, layout.LOW_V]], frame[[layout.HIGH_U, layout.HIGH_V]]
    period = frame[[layout.PERIOD_U, layout.PERIOD_V]]
    levels = tuple(_levels(*each) for each in zip(surface.breaks(), low, high, period, strict=True))
    rows, coefficients, degrees = _rows(table, (levels[0], levels[1]))
    steps = int(table.table[layout.TRIM_STEPS])
    walk = table.pool[table.table[layout.TRIM_STEP_POOL] :][: 2 * steps].reshape(-1, 2)
    ends = np.unique(np.concatenate([levels[0], walk[:, 0]]))
    stretches = np.column_stack([ends[:-1], ends[1:]])
    w = np.full(len(stretches), frame[layout.BOTTOM])
    for u, value in walk:
        w[stretches[:, 0] >= u] = value
    stretches, w = stretches[w != 0.0], w[w != 0.0]
    record, surface_pool = surface.packed()
    shift = surface_pool.size
    pool = np.concatenate([surface_pool, table.pool])

    def sides(count: int, pieces: Indices, bottom: Indices) -> tuple[Array, Array]:
        out, low = np.empty((len(pieces), 2)), np.empty((len(bottom), 2))
        gauss = _gauss(count)
        if len(pieces):
            along_pieces(
                record, pool, rows[pieces], coefficients[pieces] + shift, degrees[pieces], levels[1], *gauss, out
            )
        if len(bottom):
            along_bottom(record, pool, stretches[bottom], levels[1], *gauss, low)
        return out, low * w[bottom, None]

    # Only what two numbers of nodes disagree on is done again with more.
    pieces, bottom = np.arange(len(rows), dtype=np.intp), np.arange(len(stretches), dtype=np.intp)
    along, below = sides(_NODES[0], pieces, bottom)
    for count in _NODES[1:]:
        more, more_below = sides(count, pieces, bottom)
        change = np.abs(more - along[pieces]), np.abs(more_below - below[bottom])
        along[pieces], below[bottom] = more, more_below
        size = np.maximum(np.abs(along).sum(axis=0) + np.abs(below).sum(axis=0), 1e-300)
        pieces = pieces[(change[0] > _AGREE * size).any(axis=1)]
        bottom = bottom[(change[1] > _AGREE * size).any(axis=1)]
        if not len(pieces) and not len(bottom):
            break
    return np.asarray(along.sum(axis=0) + below.sum(axis=0))
