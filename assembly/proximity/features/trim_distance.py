"""Signed distance of a point of a surface to a loop, in (u, v), with its derivatives.

With the projection c of u on the loop, n the unit normal there towards material and k the loop's curvature towards n,

    s = n.(u - c),   s_u = n,   s_uu = -k / (1 - k s) (I - n n^T):

the motion of the projection drops out of the gradient. Where the projection is a corner, s_uu = (I - n n^T) / s, as for
the distance from a point.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.faces.trim_nearest import trim_nearest
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.splines.evaluate import CURVE_RECORD, curve_point

# Cosine between n and the tangent at the projection above which the projection is a corner.
CORNER = 1e-6


@kernel(inner=True)
def trim_distance(store, trim, u, v):
    """s, s_u (2), and the one number b of s_uu = b (I - n n^T)."""
    trim_record = trim_at(store.table, trim)
    s, k, t, _cu, _cv, nu, nv = trim_nearest(store, trim, 0, trim_record.curves, u, v)
    _c, rate, bend = curve_point(store.table, store.pool, trim_record.first + CURVE_RECORD * k, t)
    square = rate[0] * rate[0] + rate[1] * rate[1]
    along = rate[0] * nu + rate[1] * nv
    if along * along > CORNER * CORNER * square:
        return s, (nu, nv), 1.0 / s if s != 0.0 else 0.0
    curvature = (bend[0] * nu + bend[1] * nv) / square if square > 0.0 else 0.0
    away = 1.0 - curvature * s
    # On the medial axis the distance has a ridge, and no second derivative.
    return s, (nu, nv), -curvature / away if abs(away) > 1e-9 and math.isfinite(curvature) else 0.0
