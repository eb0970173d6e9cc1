"""Areas of faces, and the volumes and moments of what faces enclose.

The volume of a body is the integral of S.n / 3 over its faces (divergence theorem), and so are its moments. All
integrands are integrated by Gauss quadrature, exactly as far as doubles go: `geometry/faces/integrals.py` has them.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.integrals import FACE_INTEGRALS, along_bottom, along_pieces
from assembly.geometry.faces.trim_pieces import cut_of_piece, trim_at, trim_frame_at
from assembly.geometry.faces.trim_table import TrimTable
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["face_integrals"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Numbers of nodes, one after the other, until two of them agree to this part.
_NODES = (6, 12, 24, 48, 96, 192)
_AGREE = 1e-13


@cache
def _gauss(count: int) -> Array:
    """Nodes and weights in (-1, 1), (2, count)."""
    return np.array(np.polynomial.legendre.leggauss(count))


def _levels(knots: Array, low: float, high: float, period: float) -> Array:
    """Knots inside a cell, and its ends."""
    inside = knots
    if period:
        inside = np.concatenate([knots + k * period for k in range(-2, 3)])
    inside = inside[(inside > low) & (inside < high)]
    return np.unique(np.concatenate([[low], inside, [high]]))


def _rows(table: TrimTable, levels: tuple[Array, Array]) -> tuple[Array, NDArray[np.int64]]:
    """Parts of pieces on which no knot of the surface is passed, and where the coefficients and degree of each are."""
    links, bounds = table.rows()
    rows, which = [], []
    # Records are read column by column: of one at a time a field takes as long as a cut.
    columns = (links[name].tolist() for name in ("sign_u", "coefficients", "degree"))
    lengths = (bounds[name].tolist() for name in ("t0", "t1", "middle", "shift_u", "shift_v", "box", "start", "end"))
    for k, piece in enumerate(zip(*columns, *lengths, strict=True)):
        sign, coefficients, degree, t0, t1, middle, *shifts, box, start, end = piece
        if sign == 0:
            continue
        cuts = [t0, t1]
        for axis, shift in enumerate(shifts):
            low, high = box[2 * axis : 2 * axis + 2]
            inside = levels[axis][(levels[axis] > low) & (levels[axis] < high)].tolist()
            for level in inside:
                ends = start[axis] - shift, end[axis] - shift
                t, _, _ = cut_of_piece(
                    table.pool, coefficients, degree, middle, (t0, t1), axis, level - shift, ends
                )  # fmt: skip
                cuts.append(min(max(t, t0), t1))
        cuts.sort()
        for a, b in pairwise(cuts):
            rows.append([a, b, middle, *shifts])
            which.append(k)
    places = np.column_stack([links.coefficients, links.degree])[which]
    return np.array(rows).reshape(-1, 5), places.reshape(-1, 2)


def face_integrals(surface: NurbsSurface, table: TrimTable, center: Array) -> tuple[Any, Any]:
    """Integrals over the part of a surface that a trim leaves, about a center (3,), with N = Su x Sv.

    Returns
    -------
    The integrals, and by how much two numbers of nodes disagree about each: records of `FACE_INTEGRALS`.
    """
    trim = trim_at(table.table, 0)
    frame = trim_frame_at(table.pool, trim.frame)
    low, high = (frame.low_u, frame.low_v), (frame.high_u, frame.high_v)
    period = (frame.period_u, frame.period_v)
    levels = tuple(_levels(*each) for each in zip(surface.breaks(), low, high, period, strict=True))
    rows, places = _rows(table, (levels[0], levels[1]))
    walk = table.pool[trim.step_pool :][: 2 * trim.steps].reshape(-1, 2)
    ends = np.unique(np.concatenate([levels[0], walk[:, 0]]))
    stretches = np.column_stack([ends[:-1], ends[1:]])
    w = np.full(len(stretches), frame.bottom)
    for u, value in walk:
        w[stretches[:, 0] >= u] = value
    stretches, w = stretches[w != 0.0], w[w != 0.0]
    record, surface_pool = surface._tables
    places[:, 0] += surface_pool.size
    pool = np.concatenate([surface_pool, table.pool])

    far = np.abs(np.stack(surface.bounding_box()) - center).max(axis=0)
    reach = float(np.linalg.norm(far))
    # A length to the power of what each integral has more than an area.
    powers = np.repeat([1.0, reach, reach**2, reach**3], [1, 6, 3, 6])

    def sides(count: int, pieces: Indices, bottom: Indices) -> tuple[Array, Array]:
        out, low = np.empty((len(pieces), powers.size)), np.empty((len(bottom), powers.size))
        rule = _gauss(count)
        if len(pieces):
            along_pieces(record, pool, rows[pieces], places[pieces], levels[1], rule, center, out)
        if len(bottom):
            along_bottom(record, pool, stretches[bottom], levels[1], rule, center, low)
        return out, low * w[bottom, None]

    # Only what two numbers of nodes disagree on is done again with more.
    pieces, bottom = np.arange(len(rows), dtype=np.intp), np.arange(len(stretches), dtype=np.intp)
    along, below = sides(_NODES[0], pieces, bottom)
    change, change_below = np.full_like(along, np.inf), np.full_like(below, np.inf)
    for count in _NODES[1:]:
        more, more_below = sides(count, pieces, bottom)
        change[pieces], change_below[bottom] = np.abs(more - along[pieces]), np.abs(more_below - below[bottom])
        along[pieces], below[bottom] = more, more_below
        area = max(float(np.abs(along[:, 0]).sum() + np.abs(below[:, 0]).sum()), 1e-300)
        pieces = pieces[(change[pieces] > _AGREE * area * powers).any(axis=1)]
        bottom = bottom[(change_below[bottom] > _AGREE * area * powers).any(axis=1)]
        if not len(pieces) and not len(bottom):
            break
    total, doubt = along.sum(axis=0) + below.sum(axis=0), change.sum(axis=0) + change_below.sum(axis=0)
    return _record(total), _record(doubt)


def _record(values: Array) -> Any:
    return rows_of(FACE_INTEGRALS, values[None])[0]
