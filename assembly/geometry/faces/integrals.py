"""Integrals over a trimmed face, by Green's theorem in the cell of its trim table.

With w(u, v) = 1 where there is material, w(u, v) = w(u, bottom) + the signs of u' of the pieces below (u, v). So

    integral of g w  =  sum over pieces  of the integral of u'(t) G(u(t), v(t)) dt
                        + the integral of w(u, bottom) G(u, bottom) du,       G(u, v) = integral of g from v to the top.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store, record_dtype, record_view
from assembly.geometry.faces.trim_pieces import Piece, piece_line
from assembly.geometry.splines.evaluate import into_domain, surface_at, surface_point
from assembly.geometry.vec import cross, dot, sub

# Integrals over a face: its area, and for a body that faces enclose (p = S - center, N = Su x Sv, by Gauss' theorem):
FACE_INTEGRALS = record_dtype(
    "f8",
    area=1,  # of |N|
    moment=3,  # of p |N|
    flux=3,  # of p_x N_x, p_y N_y, p_z N_z: each is the volume
    first=3,  # of p (p . N): four times the first moments
    second=6,  # of p_i p_j (p . N) for xx, yy, zz, xy, xz, yz: five times the second moments
)
integrals_at = record_view(FACE_INTEGRALS)


@kernel(inner=True)
def _add_column(store, u, v, levels, rule, center, factor, out):
    """Add `factor` times the integrals over a column from v to the top. `rule` holds nodes and weights of Gauss."""
    patch = surface_at(store.table, 0)
    total = integrals_at(out, 0)
    x, _fits = into_domain(store.pool, patch.breaks_u, patch.spans_u, patch.closed_u, u)
    for k in range(levels.size - 1):
        low = max(v, levels[k])
        half = 0.5 * (levels[k + 1] - low)
        if not half > 0.0:
            continue
        for n in range(rule.shape[1]):
            y, _fits = into_domain(
                store.pool, patch.breaks_v, patch.spans_v, patch.closed_v, low + half * (1.0 + rule[0, n])
            )
            s, su, sv, _suu, _suv, _svv = surface_point(store.table, store.pool, 0, x, y)
            normal = cross(su, sv)
            p = sub(s, (center[0], center[1], center[2]))
            share = factor * half * rule[1, n]
            patch_area = share * np.sqrt(dot(normal, normal))
            total.area += patch_area
            outward = share * dot(p, normal)
            for i in range(3):
                total.moment[i] += patch_area * p[i]
                total.flux[i] += share * p[i] * normal[i]
                total.first[i] += outward * p[i]
                total.second[i] += outward * p[i] * p[i]
            total.second[3] += outward * p[0] * p[1]
            total.second[4] += outward * p[0] * p[2]
            total.second[5] += outward * p[1] * p[2]


@kernel(signatures="(i8[::1], f8[::1], f8[:, ::1], i8[:, ::1], f8[::1], f8[:, ::1], f8[::1], f8[:, ::1])")
def along_pieces(table, pool, rows, places, levels, rule, center, out):
    """Integrals of u' G over parts of pieces.

    A row of `rows` holds t0, t1, the middle of the span, and the shift in u and v that moves the curve into the cell.
    A row of `places` holds where in the pool the coefficients are, and the degree. `levels` are the knots of v within
    the cell, and the cell's two ends.
    """
    for k in range(rows.shape[0]):
        piece = Piece(places[k, 0], places[k, 1], rows[k, 2], rows[k, 0], rows[k, 1])
        half = 0.5 * (piece.t1 - piece.t0)
        out[k] = 0.0
        for n in range(rule.shape[1]):
            u, v, du, _dv = piece_line(pool, piece, piece.t0 + half * (1.0 + rule[0, n]))
            factor = half * rule[1, n] * du
            _add_column(Store(table, pool), u + rows[k, 3], v + rows[k, 4], levels, rule, center, factor, out[k])


@kernel(signatures="(i8[::1], f8[::1], f8[:, ::1], f8[::1], f8[:, ::1], f8[::1], f8[:, ::1])")
def along_bottom(table, pool, stretches, levels, rule, center, out):
    """Integrals of G over stretches (u0, u1) of the bottom."""
    for k in range(stretches.shape[0]):
        u0 = stretches[k, 0]
        half = 0.5 * (stretches[k, 1] - u0)
        out[k] = 0.0
        for n in range(rule.shape[1]):
            u = u0 + half * (1.0 + rule[0, n])
            _add_column(Store(table, pool), u, levels[0], levels, rule, center, half * rule[1, n], out[k])
