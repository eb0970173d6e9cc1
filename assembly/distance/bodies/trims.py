"""Trimmed faces: which part of a face a node is in, and where the boundary need not be considered.

The boundary is cut into pieces that run one way in u and in v (`geometry/faces/trim_pieces.py`), so that a box of
parameters is met by a piece where the part of it beside the box is. A box that no piece meets is inside or outside as a
whole.

The nearest points of a trimmed face are inside it, where the distance has no slope along the face, or on its boundary,
whose curves are patches of the body as well. So a part of the face through which the boundary passes is let go where
the distance falls everywhere on it, along u or v, towards a side that is within the patch: where the face ends before,
the boundary's curve is nearer.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store
from assembly.distance.bodies.nodes import links_of, node_of, patch_of
from assembly.distance.bodies.pair import doubt_of_points
from assembly.distance.bodies.records import CUT, GROUP, INSIDE, NONE, OUTSIDE, UNPLACED, patch_span_at
from assembly.geometry.faces.trim import trim_side
from assembly.geometry.faces.trim_pieces import bounds_of, piece_at, piece_of, trim_at, trim_frame_at
from assembly.geometry.faces.trim_pieces import links_of as piece_links

# The boundary is known to some multiple of what is on it.
_GRAIN = 4.0


@kernel(inline=True)
def _along(bounds, major, low, high, grain):
    """The part of a piece beside the box along its major axis: its ends there; none if low > high."""
    return max(low[major] - grain, bounds.box[2 * major]), min(high[major] + grain, bounds.box[2 * major + 1])


@kernel(inner=True)
def piece_meets(store, trim, k, low, high, grain):
    """Whether piece k of a trim may come within `grain` of a box of parameters in its own cell."""
    bounds, links = bounds_of(store, trim, k), piece_links(store, trim, k)
    box = bounds.box
    if box[0] > high[0] + grain or box[1] < low[0] - grain or box[2] > high[1] + grain or box[3] < low[1] - grain:
        return False
    major = links.major
    begin, end = _along(bounds, major, low, high, grain)
    shift = bounds.shift_u if major == 0 else bounds.shift_v
    other = bounds.shift_v if major == 0 else bounds.shift_u
    piece = piece_of(store, trim, k)
    start, stop = bounds.start[major] - shift, bounds.end[major] - shift
    _t, first, _direction = piece_at(store.pool, piece, major, begin - shift, start, stop)
    _t, last, _direction = piece_at(store.pool, piece, major, end - shift, start, stop)
    x, y = (first[1] + other, last[1] + other) if major == 0 else (first[0] + other, last[0] + other)
    minor = 1 - major
    return min(x, y) <= high[minor] + grain and max(x, y) >= low[minor] - grain


@kernel(inline=True)
def whole_periods(x, piece, period):
    """The multiple of a period that moves a box about x next to a piece."""
    return period * math.floor((piece - x) / period + 0.5) if period > 0.0 else 0.0


@kernel(inner=True)
def boundary_meets(store, trim, low, high):
    """Whether the boundary may pass through a box of parameters, on any sheet."""
    frame = trim_frame_at(store.pool, trim.frame)
    grain = _GRAIN * frame.on
    middle_u, middle_v = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
    around_u, around_v = 1 if frame.period_u > 0.0 else 0, 1 if frame.period_v > 0.0 else 0
    for k in range(trim.pieces):
        box = bounds_of(store, trim, k).box
        u = whole_periods(middle_u, 0.5 * (box[0] + box[1]), frame.period_u)
        v = whole_periods(middle_v, 0.5 * (box[2] + box[3]), frame.period_v)
        for s in range(-around_u, around_u + 1):
            for t in range(-around_v, around_v + 1):
                du, dv = u + s * frame.period_u, v + t * frame.period_v
                if piece_meets(store, trim, k, (low[0] + du, low[1] + dv), (high[0] + du, high[1] + dv), grain):
                    return True
    return False


@kernel(inner=True)
def place_node(tree, k):
    """Whether node k is INSIDE its face, OUTSIDE, or may be CUT by the boundary; kept with the node."""
    links = links_of(tree, k)
    if links.place != UNPLACED:
        return links.place
    node, patch = node_of(tree, k), patch_of(tree, links.patch)
    if patch.trim == NONE:
        links.place = INSIDE
        return links.place
    span = patch_span_at(tree.pool, patch.span)
    u, v = span.high_u - span.low_u, span.high_v - span.low_v
    low = (span.low_u + node.low_u * u, span.low_v + node.low_v * v)
    high = (span.low_u + node.high_u * u, span.low_v + node.high_v * v)
    store = Store(tree.table, tree.pool)
    links.place = CUT
    if not boundary_meets(store, trim_at(tree.table, patch.trim), low, high):
        side = trim_side(store, patch.trim, 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]))
        if side != 0:
            links.place = INSIDE if side > 0 else OUTSIDE
    return links.place


@kernel(inline=True)
def is_outside(tree, k):
    """Whether node k is no group and outside of its face."""
    links = links_of(tree, k)
    return links.patch != GROUP and patch_of(tree, links.patch).trim != NONE and place_node(tree, k) == OUTSIDE


@kernel(inline=True)
def space_dot(x, i, y, k):
    """Scalar product of two rows."""
    return x[3 * i] * y[3 * k] + x[3 * i + 1] * y[3 * k + 1] + x[3 * i + 2] * y[3 * k + 2]


@kernel(inner=True)
def falls_to_side(pair, a, i, b, j, of_a, slack):
    """Whether |D| falls everywhere on a pair along u or v of one node towards a side of it within its patch.

    D.J_m is off its value at the middles by at most sum_l |J_l.J_m| / 2 + far (k_m + E1) + (sum |K| / 8 + E0) |J_m|.
    """
    d, jacobian, k = pair.d, pair.j, pair.k
    own = node_of(a, i) if of_a else node_of(b, j)
    e0 = doubt_of_points(a, i, b, j) + slack
    bent = 0.0
    for o in range(6):
        bent += (0.25 if o % 3 == 1 else 0.125) * math.sqrt(space_dot(k, o, k, o))
    far = math.sqrt(space_dot(d, 0, d, 0)) + bent + e0
    for m in range(4):
        far += 0.5 * math.sqrt(space_dot(jacobian, m, jacobian, m))
    first = 0 if of_a else 2
    for m in range(first, first + 2):
        o = 3 * (first // 2) + m % 2
        row = 0.5 * (math.sqrt(space_dot(k, o, k, o)) + math.sqrt(space_dot(k, o + 1, k, o + 1)))
        length = math.sqrt(space_dot(jacobian, m, jacobian, m))
        off = far * (row + own.slope_doubt) + (bent + e0) * length
        for l in range(4):
            off += 0.5 * abs(space_dot(jacobian, l, jacobian, m))
        off = off * (1.0 + 1e-12) + 1e-13 * far * (length + row)
        slope = space_dot(d, 0, jacobian, m)
        low = own.low_u if m == first else own.low_v
        high = own.high_u if m == first else own.high_v
        if (slope > off and low > 0.0) or (slope < -off and high < 1.0):
            return True
    return False


@kernel(inner=True)
def nearest_is_elsewhere(pair, a, i, b, j, slack):
    """Whether trims prove that the nearest points are not on a pair. Its models are loaded and fully described."""
    if place_node(a, i) == CUT and falls_to_side(pair, a, i, b, j, True, slack):
        return True
    return place_node(b, j) == CUT and falls_to_side(pair, a, i, b, j, False, slack)
