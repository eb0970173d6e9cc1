"""Trimmed faces: which part of a face a node is in, and where the boundary need not be considered.

The boundary is cut into pieces that are monotone in u and in v (`geometry/faces/trim_pieces.py`). Whether a piece meets
a box of parameters follows from two of its points: the ends of its part within the box's range of one parameter. A box
that no piece meets is inside or outside as a whole.

The nearest points of a trimmed face are inside it, where the distance has no slope along the face, or on its boundary,
whose curves are patches of the body as well. So a part of the face through which the boundary passes is let go where
the distance falls everywhere on it, along u or v, towards a side that is within the patch: where the face ends before
that side, its boundary curve is nearer.

On a flat face the segment from a nearest point inside it to the other body is along the normal. So a pair of a part of
the face and a part of the other body is let go where, seen along the normal, the two do not overlap, whether the
boundary passes through the part or not.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store
from assembly.distance.bodies.nodes import links_of, node_of, patch_of
from assembly.distance.bodies.pair import doubt_of_points, least_along
from assembly.distance.bodies.records import CUT, GROUP, INSIDE, NONE, OUTSIDE, UNPLACED, patch_span_at
from assembly.distance.bodies.spines import norm
from assembly.geometry.faces.trim import trim_side
from assembly.geometry.faces.trim_pieces import bounds_of, piece_at, piece_of, trim_at, trim_frame_at
from assembly.geometry.faces.trim_pieces import links_of as piece_links
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import add, dot, matvec, matvec_t, neg, scale, sub

# A box counts as met by the boundary within this multiple of the distance `on` of its trim.
_GRAIN = 4.0


@kernel(inline=True)
def _along(bounds, major, low, high, grain):
    """The ends, along its major axis, of a piece's part within the box's range; none if the first is larger."""
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

    D.J_m differs from its value at the middles by at most
    sum_l |J_l.J_m| / 2 + far (k_m + E1) + (sum |K| / 8 + E0) |J_m|.
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
    """Whether trims prove that the nearest points are not on a pair of described nodes; needs `load_models`."""
    if place_node(a, i) == CUT and falls_to_side(pair, a, i, b, j, True, slack):
        return True
    return place_node(b, j) == CUT and falls_to_side(pair, a, i, b, j, False, slack)


@kernel(inline=True)
def is_flat_inside(tree, k):
    """Whether node k is flat, and all of its points that may be on the boundary of its face, or on a crease, are on
    curves of the tree as well.

    Flat: of degree one in both directions, with equal weights. The boundary of a trimmed face is curves of the tree;
    the sides of its patch are no creases where there is no other patch.
    """
    links, node = links_of(tree, k), node_of(tree, k)
    patch = patch_of(tree, links.patch)
    if patch.degree_u != 1 or patch.degree_v != 1:
        return False
    if patch.trim == NONE or patch.single != 1:
        if node.low_u == 0.0 or node.high_u == 1.0 or node.low_v == 0.0 or node.high_v == 1.0:
            return False
    nets, at = tree.nets, links.net + 3
    return nets[at] == nets[at + 4] and nets[at] == nets[at + 8] and nets[at] == nets[at + 12]


@kernel(inner=True)
def is_beside(flat, i, tree, j, place, slack):
    """Whether no point of node j is straight over a point of the flat node i: then none is nearest to its inside.

    With S = P + u e1 + v e2, let w = alpha e1 + beta e2 be the projection of the middles' difference D on the face's
    plane. The difference D* of nearest points has D*.Su = D*.Sv = 0 inside the face, so that D*.w = 0. Su and Sv differ
    from e1 and e2 by at most the twist of the net, which is a parallelogram only up to rounding, and twice the error of
    its points.

    `place`: turn and shift of the other node's body relative to the flat one's.
    """
    turn, shift = place
    links, node, other = links_of(flat, i), node_of(flat, i), node_of(tree, j)
    nets, at = flat.nets, links.net + 16
    first = (nets[at], nets[at + 4], nets[at + 8])
    e2 = sub((nets[at + 1], nets[at + 5], nets[at + 9]), first)
    e1 = sub((nets[at + 2], nets[at + 6], nets[at + 10]), first)
    last = sub((nets[at + 3], nets[at + 7], nets[at + 11]), first)
    twist = sub(last, add(e1, e2))
    between = sub(sub(node.middle, shift), matvec(turn, other.middle))
    g11, g12, g22 = dot(e1, e1), dot(e1, e2), dot(e2, e2)
    determinant = g11 * g22 - g12 * g12
    if not determinant > 1e-6 * g11 * g22:
        # A sliver, whose plane rounding could turn.
        return False
    r1, r2 = dot(e1, between), dot(e2, between)
    alpha, beta = (g22 * r1 - g12 * r2) / determinant, (g11 * r2 - g12 * r1) / determinant
    w = add(scale(alpha, e1), scale(beta, e2))
    length = norm(w)
    far = norm(between) + node.radius + other.radius + node.away + other.away + slack
    if not length > 1e-9 * far:
        return False
    w, alpha, beta = scale(1.0 / length, w), abs(alpha) / length, abs(beta) / length
    least = least_along(flat, i, w) + least_along(tree, j, neg(matvec_t(turn, w))) - dot(w, shift)
    off = (alpha + beta) * (norm(twist) + 4.0 * node.away + slack)
    off += 16.0 * UNIT * (1.0 + alpha * math.sqrt(g11) + beta * math.sqrt(g22))
    return least > far * off + slack + node.away + other.away


@kernel(inline=True)
def flat_is_elsewhere(a, i, b, j, pose, slack):
    """Whether one of two parts of patches is flat, and the other one is beside it."""
    if is_flat_inside(a, i) and is_beside(a, i, b, j, (pose.turn, pose.shift), slack):
        return True
    if not is_flat_inside(b, j):
        return False
    m = pose.turn
    back = (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])
    return is_beside(b, j, a, i, (back, neg(matvec(back, pose.shift))), slack)
