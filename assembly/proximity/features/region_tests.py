"""What may be in a pair of cells: whether they are inside their trims, hold an extremum, or only one that is known.

Where features are nearest, d = g - f is normal to both, so that d.S_u = d.S_v = 0 on a face and d.C_t = 0 on an edge.
An extremum of two faces whose relative curvature has the least eigenvalue l > 0 is the only one over the region where
the curvatures of both change by less than l.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.faces.trim import trim_side
from assembly.geometry.faces.trim_nearest import trim_nearest
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.splines.evaluate import spline_curve_at, surface_at
from assembly.geometry.vec import cross, dot, sub
from assembly.proximity.brep.records import EDGE, FACE, VERTEX, edge_at, face_at
from assembly.proximity.features.ball_tree import INSIDE, MIXED_SIDE, OUTSIDE, UNKNOWN, cell_in, model_in

# Boxes whose normals turn by less hold at most one extremum.
TRUSTED = 0.05
# A known extremum within so many half widths of the middles of boxes counts as theirs: of boxes whose normals hardly
# turn, and of boxes whose curvatures hardly change.
BESIDE = 1.5
FAR = 6.0


@kernel(inner=True)
def is_feasible(store, kind, record, u, v):
    """Whether a point of a feature is a point of the body: for a face, inside the trim."""
    face = face_at(store.table, record)
    if kind != FACE or face.trim < 0:
        return True
    return trim_side(store, face.trim, u, v) >= 0


@kernel(inner=True)
def side_of(store, tree, i):
    """On which side of the trim of its face a cell is."""
    cell, model = cell_in(tree, i), model_in(tree, i)
    if cell.kind != FACE or cell.side != UNKNOWN:
        return cell.side
    trim = face_at(store.table, cell.record).trim
    s = trim_nearest(store, trim, 0, trim_at(store.table, trim).curves, model.u0, model.v0)[0]
    reach = math.sqrt(model.half_u**2 + model.half_v**2)
    side = INSIDE if s >= reach else (OUTSIDE if s < -1.000001 * reach else MIXED_SIDE)
    cell.side = side
    return side


@kernel(inner=True)
def grows(f, g, p, q, first, second, d):
    """Whether d.S_u cannot vanish over two modeled boxes; p and q are S_u and S_v of f, times half widths.

    `first` and `second` are half the derivatives of p along both directions.
    """
    pp = dot(p, p)
    if pp == 0.0:
        return False
    long = math.sqrt(pp)
    moves = pp + abs(dot(p, q)) + abs(dot(p, g.linear_u)) + abs(dot(p, g.linear_v))
    turn = 2.0 * math.sqrt(dot(first, first)) + math.sqrt(dot(second, second)) + 6.0 * f.rest
    reach = math.sqrt(dot(d, d)) + f.radius + g.radius
    return abs(dot(d, p)) > moves + long * (f.curved + g.curved) + reach * turn


@kernel(inner=True)
def monotone(f, kind, g, d):
    """Whether d.S_u or d.S_v cannot vanish anywhere on the box of f, for any point of the box of g."""
    if kind == VERTEX:
        return False
    if grows(f, g, f.linear_u, f.linear_v, f.square_u, f.mixed, d):
        return True
    return kind == FACE and grows(f, g, f.linear_v, f.linear_u, f.square_v, f.mixed, d)


@kernel(inner=True)
def excluded(trees, i, j, are_apart):
    """Whether no extremum of two features, and no crossing, is in a pair of their cells."""
    f, g = model_in(trees[0], i), model_in(trees[1], j)
    kind_f, kind_g = cell_in(trees[0], i).kind, cell_in(trees[1], j).kind
    d = sub(g.point, f.point)
    if monotone(f, kind_f, g, d) or monotone(g, kind_g, f, d):
        return True
    bend = f.bend + g.bend
    # Where features cross, their normals need not be parallel.
    if not (are_apart and bend < 1.5):
        return False
    if kind_f == FACE and kind_g == FACE:
        s = cross(f.normal, g.normal)
        return dot(s, s) > math.sin(bend) ** 2
    if kind_f == FACE and kind_g == EDGE:
        t = g.linear_u
        return abs(dot(t, f.normal)) > math.sin(bend) * math.sqrt(dot(t, t))
    if kind_f == EDGE and kind_g == FACE:
        t = f.linear_u
        return abs(dot(t, g.normal)) > math.sin(bend) * math.sqrt(dot(t, t))
    return False


@kernel(inner=True)
def relative_curvature(k, h, beta):
    """Least eigenvalue of the curvature of g relative to f moved to it, towards each other; and 1 / the least of K."""
    det = k[0] * k[2] - k[1] * k[1]
    if not (k[0] > 0.0 and det > 0.0):
        return -math.inf, 1.0
    s = -1.0 / det if beta >= 0.0 else 1.0 / det
    # -H K^-1, symmetric but for rounding.
    a = s * (h[0] * k[2] - h[1] * k[1])
    b = s * 0.5 * (h[1] * k[0] - h[0] * k[1] + h[2] * k[2] - h[3] * k[1])
    c = s * (h[3] * k[0] - h[2] * k[1])
    least = 0.5 * (a + c) - math.sqrt(0.25 * (a - c) ** 2 + b * b)
    low = 0.5 * (k[0] + k[2]) - math.sqrt(0.25 * (k[0] - k[2]) ** 2 + k[1] * k[1])
    return least, 1.0 / max(low, 1e-12)


@kernel(inline=True)
def off_middle(x, middle, half, period):
    """How many half widths x is from the middle of an interval."""
    d = abs(x - middle)
    if period > 0.0:
        d = min(d, abs(period - d))
    if half > 0.0:
        return d / half
    return 0.0


@kernel(inner=True)
def periods(store, kind, record):
    """Periods of a feature's coordinates; 0 where there is none."""
    edge = edge_at(store.table, record)
    if kind == FACE:
        r = surface_at(store.table, face_at(store.table, record).surface)
        bu = r.breaks_u
        bv = r.breaks_v
        u = store.pool[bu + r.spans_u] - store.pool[bu] if r.closed_u == 1 else 0.0
        v = store.pool[bv + r.spans_v] - store.pool[bv] if r.closed_v == 1 else 0.0
        return u, v
    if kind == EDGE and edge.start < 0:
        c = spline_curve_at(store.table, edge.curve)
        o = c.breaks
        return store.pool[o + c.spans] - store.pool[o], 0.0
    return 0.0, 0.0


@kernel(inner=True)
def from_middle(store, tree, i, u, v):
    """How far coordinates are from the middle of a cell, in half widths: the larger of both directions."""
    cell, model = cell_in(tree, i), model_in(tree, i)
    period_u, period_v = periods(store, cell.kind, cell.record)
    return max(off_middle(u, model.u0, model.half_u, period_u), off_middle(v, model.v0, model.half_v, period_v))


# An extremum of two features that is known.
KNOWN_EXTREMUM = record_dtype(
    "f8",
    parameters=4,  # (u, v) of f, then of g
    curvature=1,  # least relative curvature, of two faces
    stretch=1,  # 1 / the least eigenvalue of K of f
    feature_f=1,  # their numbers
    feature_g=1,
)
known_extremum_at = record_view(KNOWN_EXTREMUM)
KNOWN = size_of(KNOWN_EXTREMUM)


@kernel(inner=True)
def is_known(store, trees, i, j, extrema):
    """Whether the only extremum that two cells may hold is known; and half widths to the nearest known one."""
    f, g = model_in(trees[0], i), model_in(trees[1], j)
    feature_f, feature_g = cell_in(trees[0], i).feature, cell_in(trees[1], j).feature
    bend = max(f.bend, g.bend)
    nearest = math.inf
    for k in range(extrema.shape[0]):
        extremum = known_extremum_at(extrema, k)
        if extremum.feature_f != feature_f or extremum.feature_g != feature_g:
            continue
        x = extremum.parameters
        s = max(from_middle(store, trees[0], i, x[0], x[1]), from_middle(store, trees[1], j, x[2], x[3]))
        nearest = min(nearest, s)
        if s <= BESIDE and bend <= TRUSTED:
            return True, s
        if s <= FAR:
            change = f.change * extremum.stretch * extremum.stretch + g.change
            if extremum.curvature > 1.5 * max(s, 1.0) * change:
                return True, s
    return False, nearest
