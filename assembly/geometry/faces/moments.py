"""First moments of a trimmed face: its area, and the integrals of x, y and z over it.

The same sums as in `geometry/faces/integrals.py`, with other integrands.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.faces.trim_pieces import Piece, piece_line
from assembly.geometry.splines.evaluate import into_domain, surface_at, surface_point
from assembly.geometry.vec import add, cross, dot, scale

ZERO = (0.0, 0.0, 0.0)


@kernel(inner=True)
def _moment_column(store, u, v, levels, nodes, weights):
    """Integrals over a column from v to the top of |Su x Sv| and of S |Su x Sv|."""
    patch = surface_at(store.table, 0)
    area = 0.0
    moment = ZERO
    x, _fits = into_domain(store.pool, patch.breaks_u, patch.spans_u, patch.closed_u, u)
    for k in range(levels.size - 1):
        low = max(v, levels[k])
        half = 0.5 * (levels[k + 1] - low)
        if not half > 0.0:
            continue
        for n in range(nodes.size):
            y = low + half * (1.0 + nodes[n])
            y, _fits = into_domain(store.pool, patch.breaks_v, patch.spans_v, patch.closed_v, y)
            s, su, sv, _suu, _suv, _svv = surface_point(store.table, store.pool, 0, x, y)
            normal = cross(su, sv)
            part = half * weights[n] * np.sqrt(dot(normal, normal))
            area += part
            moment = add(moment, scale(part, s))
    return area, moment


@kernel(signatures="(i8[::1], f8[::1], f8[:, ::1], i8[:, ::1], f8[::1], f8[::1], f8[::1], f8[:, ::1])")
def moments_along_pieces(table, pool, rows, places, levels, nodes, weights, out):
    """Integrals of u' G over parts of pieces.

    A row of `rows` holds t0, t1, the middle of the span, and what moves the curve into the cell, one of
    `places` where its coefficients are and its degree; `levels` are the knots of v within the cell, with its ends.
    """
    for k in range(rows.shape[0]):
        piece = Piece(places[k, 0], places[k, 1], rows[k, 2], rows[k, 0], rows[k, 1])
        half = 0.5 * (piece.t1 - piece.t0)
        area = 0.0
        moment = ZERO
        for n in range(nodes.size):
            u, v, du, _dv = piece_line(pool, piece, piece.t0 + half * (1.0 + nodes[n]))
            a, b = _moment_column(Store(table, pool), u + rows[k, 3], v + rows[k, 4], levels, nodes, weights)
            part = half * weights[n] * du
            area += part * a
            moment = add(moment, scale(part, b))
        out[k, 0] = area
        for l in range(3):
            out[k, 1 + l] = moment[l]


@kernel(signatures="(i8[::1], f8[::1], f8[:, ::1], f8[::1], f8[::1], f8[::1], f8[:, ::1])")
def moments_along_bottom(table, pool, stretches, levels, nodes, weights, out):
    """Integrals of G over stretches (u0, u1) of the bottom."""
    for k in range(stretches.shape[0]):
        u0 = stretches[k, 0]
        half = 0.5 * (stretches[k, 1] - u0)
        area = 0.0
        moment = ZERO
        for n in range(nodes.size):
            a, b = _moment_column(Store(table, pool), u0 + half * (1.0 + nodes[n]), levels[0], levels, nodes, weights)
            part = half * weights[n]
            area += part * a
            moment = add(moment, scale(part, b))
        out[k, 0] = area
        for l in range(3):
            out[k, 1 + l] = moment[l]
