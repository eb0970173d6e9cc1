"""How far an extremal pair is from a fold, where two of them merge: det H over |H|^2, on both sides of knot lines.

Across a knot line the curvature of a smooth surface may jump, as where a straight wire begins to bend: a pair that is
isolated by its own curvature may have another one beside it there.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import find_span, surface_at
from assembly.proximity.extrema.face_face import pair_frame
from assembly.proximity.extrema.pair_matrix import FLAT, fold_of, pair_matrix

# Parameters within so many half widths of the middle of a patch are beside it.
BESIDE = 3.0


@kernel(inline=True)
def beyond_knot(store, r, direction, x, most):
    """A parameter just beyond the knot line nearest to x, or x itself where none is within `most`."""
    patch = surface_at(store.table, r)
    o = patch.breaks_u if direction == 0 else patch.breaks_v
    count = patch.spans_u if direction == 0 else patch.spans_v
    closed = patch.closed_u == 1 if direction == 0 else patch.closed_v == 1
    k = find_span(store.pool, o, count, x)
    lo = store.pool[o + k]
    hi = store.pool[o + k + 1]
    end = lo if x - lo < hi - x else hi
    if abs(x - end) > most:
        return x
    first = store.pool[o]
    last = store.pool[o + count]
    if end == lo:
        if k > 0:
            return lo - 1e-9 * (lo - store.pool[o + k - 1])
        return last - 1e-9 * (last - store.pool[o + count - 1]) if closed else x
    if k + 1 < count:
        return hi + 1e-9 * (store.pool[o + k + 2] - hi)
    return first + 1e-9 * (store.pool[o + 1] - first) if closed else x


@kernel(inner=True)
def fold_beyond(store, posed, x, half):
    """The least distance of an extremum from a fold, with curvatures beyond knot lines within BESIDE half widths."""
    f, g = posed.surfaces[0], posed.surfaces[1]
    y = (
        beyond_knot(store, f, 0, x[0], BESIDE * half[0]),
        beyond_knot(store, f, 1, x[1], BESIDE * half[1]),
        beyond_knot(store, g, 0, x[2], BESIDE * half[2]),
        beyond_knot(store, g, 1, x[3], BESIDE * half[3]),
    )
    least = math.inf
    for i in range(4):
        u = y[0] if i % 2 == 1 else x[0]
        v = y[1] if i >= 2 else x[1]
        if i > 0 and (u, v) == (x[0], x[1]):
            continue
        for j in range(4):
            s = y[2] if j % 2 == 1 else x[2]
            t = y[3] if j >= 2 else x[3]
            if (i == 0 and j == 0) or (j > 0 and (s, t) == (x[2], x[3])):
                continue
            frame = pair_frame(store, f, g, posed.pose, (u, v, s, t))
            if frame.regular:
                least = min(least, fold_of(pair_matrix(frame.shape_f, frame.shape_g, frame.gap, FLAT).h, 1.0))
    return least
