"""The state of a search over two bodies, and its descents to nearby points.

A descent is Newton's method for |D|^2, confined to the unit squares of two patches. It is no part of a proof: its
result is a pair of points, whose distance is an upper bound.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._lanes import lane, load_lanes, store_xyz
from assembly._newton import damped_newton
from assembly._record import Store, record_dtype, record_view, size_of
from assembly.distance.bodies.nodes import links_of, node_of, patch_of
from assembly.distance.bodies.pair import pair_work_at
from assembly.distance.bodies.records import NONE, body_head_at, patch_span_at
from assembly.distance.bodies.spines import SPHERE, Spine, norm, of_sphere, spine_bound, spine_of
from assembly.distance.patches.newton import fill_basis, newton_direction
from assembly.distance.patches.pair import (
    BASIS,
    PATCH_J,
    PATCH_K,
    D,
    load_hessian,
    load_side,
    patch_work_at,
    vector_dot,
)
from assembly.distance.piece_search import bound_to_beat
from assembly.geometry.faces.trim import trim_side
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import dot, matvec, matvec_t, sub

# Bounds of the rounding errors of two bodies at this pose. slack: of sums of coordinates; point: of the difference of
# two evaluated points; slope: of an evaluated first derivative; step: bounds closer than this are equal.
BodyErrors = namedtuple("BodyErrors", "slack point slope step")
# a, b: trees; heap: pairs of nodes; state, pair, w: blocks of BODY_SEARCH, PAIR_WORK and PATCH_WORK, basis functions
# behind the latter; room: for describing nodes; question: what is asked.
BodySearch = namedtuple("BodySearch", "a b pose heap state pair w room errors question")
# tolerance, clearance [length]: a clearance below zero asks for the distance itself; budget: the most pairs to examine.
BodyQuestion = namedtuple("BodyQuestion", "tolerance clearance budget")
BODY_SEARCH = record_dtype(
    "f8",
    limit=1,  # pairs with at least this bound are discarded [length]
    let_go=1,  # the least bound of the discarded pairs [length]
    lower=1,  # proven bounds of the distance [length]
    upper=1,
    patches=2,  # numbers of the patches that have the nearest known points
    places=4,  # coordinates of these points in the unit squares of the patches
    points=6,  # these points, from a's center, in a's axes [length]
    world=6,  # these points in world coordinates [length]
    facing=2,  # of a and of b: cosine between outward normal and way to the other point; 0 on a boundary curve
    boxed=2,  # 1: the nearest point of b is in the box of a; that of a in the box of b
    way=3,  # unit vector from the nearest known point of b to that of a
    pairs=1,  # pairs of nodes examined
    popped=1,  # pairs taken from the heap
    descents=1,
    next_descent=1,  # value of `popped` at which the next descent is due
    key=1,  # bound of the pair in hand
    tried=1,  # the best bound that a direction gave of the pair in hand
    key_way=3,  # the direction that gave it; before that, the direction of the parent pair
    parted=1,  # the upper bound when supports were written; infinite: they were not yet [length]
    parted_shift=1,  # the shift of the pose along their direction [length]
    parted_pairs=1,  # pairs examined when they were written
    rings=2,  # places of the spines of two tori
    rings_apart=1,  # a lower bound of the distance of these
    on_a=3,  # points in hand, from a's center and in a's axes
    on_b=3,
)
body_search_at = record_view(BODY_SEARCH)
SEARCH_DOUBLES = size_of(BODY_SEARCH)
BodyQuery = namedtuple("BodyQuery", "search i j")
BodyMerit = namedtuple("BodyMerit", "merit")
_STEPS = 30
# How often a descent crosses sides of patches: a quarter of a turn each, on both bodies.
_CROSSINGS = 4
# Of boundary curves that are equally near to a point, by this part of it the distance to their middles decides.
_NEARER_MIDDLE = 1e-3


@kernel(inner=True)
def evaluate_node(tree, k, x, y, w):
    """Point of a node; its first and second derivatives at PATCH_J and PATCH_K."""
    links = links_of(tree, k)
    patch = patch_of(tree, links.patch)
    m, n = patch.degree_u + 1, patch.degree_v + 1
    bu, bv = BASIS, BASIS + 3 * m
    fill_basis(w, bu, m - 1, x)
    fill_basis(w, bv, n - 1, y)
    at = links.net
    s = 0.0 * load_lanes(tree.nets, at)
    su = sv = suu = suv = svv = s
    for i in range(m):
        t = tv = tvv = 0.0 * s
        for j in range(n):
            row = load_lanes(tree.nets, at)
            t = t + w[bv + j] * row
            tv = tv + w[bv + n + j] * row
            tvv = tvv + w[bv + 2 * n + j] * row
            at += 4
        b0, b1, b2 = w[bu + i], w[bu + m + i], w[bu + 2 * m + i]
        s = s + b0 * t
        su = su + b1 * t
        suu = suu + b2 * t
        sv = sv + b0 * tv
        suv = suv + b1 * tv
        svv = svv + b0 * tvv
    d = 1.0 / lane(s, 3)
    wu, wv = lane(su, 3), lane(sv, 3)
    point = d * s
    xu = d * (su - wu * point)
    xv = d * (sv - wv * point)
    store_xyz(xu, w, PATCH_J)
    store_xyz(xv, w, PATCH_J + 3)
    store_xyz(d * (suu - (2.0 * wu) * xu - lane(suu, 3) * point), w, PATCH_K)
    store_xyz(d * (suv - wu * xv - wv * xu - lane(suv, 3) * point), w, PATCH_K + 3)
    store_xyz(d * (svv - (2.0 * wv) * xv - lane(svv, 3) * point), w, PATCH_K + 6)
    return (lane(point, 0), lane(point, 1), lane(point, 2))


@kernel(inline=True)
def turn_rows(turn, w, at, count):
    """Turn vectors, one after the other in a block."""
    for i in range(at, at + 3 * count, 3):
        w[i], w[i + 1], w[i + 2] = matvec(turn, (w[i], w[i + 1], w[i + 2]))


@kernel(inner=True)
def load_places(search, i, j):
    """D, J and K at PLACE of two nodes."""
    w, state, turn = search.w, body_search_at(search.state, 0), search.pose.turn
    work = patch_work_at(w, 0)
    point = evaluate_node(search.a, i, work.place[0], work.place[1], w)
    state.on_a[0], state.on_a[1], state.on_a[2] = point
    load_side(w, PATCH_J, PATCH_K, 1.0, 2, 0, w)
    point = matvec(turn, evaluate_node(search.b, j, work.place[2], work.place[3], w))
    turn_rows(turn, w, PATCH_J, 2)
    turn_rows(turn, w, PATCH_K, 3)
    load_side(w, PATCH_J, PATCH_K, -1.0, 2, 2, w)
    for c in range(3):
        work.d[c] = (state.on_a[c] - point[c]) - search.pose.shift[c]
        state.on_b[c] = point[c] + search.pose.shift[c]


@kernel(inline=True)
def _look(query, place):
    work = patch_work_at(query.search.w, 0)
    work.place[0], work.place[1], work.place[2], work.place[3] = place
    load_places(query.search, query.i, query.j)
    return BodyMerit(vector_dot(query.search.w, D, D))


@kernel(inline=True)
def _step_from(query, _place, at):
    w = query.search.w
    work = patch_work_at(w, 0)
    load_hessian(w, 4)
    newton_direction(w, 4)
    step = work.step
    # Steps along a flat valley may be unbounded: they are limited to the length of the unit squares.
    longest = max(1.0, max(max(abs(step[0]), abs(step[1])), max(abs(step[2]), abs(step[3]))))
    fall = 0.0
    way = 0.0
    for i in range(4):
        step[i] /= longest
        fall += work.g[i] * step[i]
        way += abs(step[i])
    return (step[0], step[1], step[2], step[3]), fall > -1e-17 * at.merit or way < 1e-16


@kernel(inline=True)
def _moved(x, step):
    return min(max(x + step, 0.0), 1.0)


@kernel(inline=True)
def _move(_query, x, part, step):
    return (
        _moved(x[0], part * step[0]),
        _moved(x[1], part * step[1]),
        _moved(x[2], part * step[2]),
        _moved(x[3], part * step[3]),
    )


_descend = kernel(inner=True)(damped_newton(_look, _step_from, _move, steps=_STEPS))


@kernel(inner=True)
def descend(search, i, j):
    """Descend from PLACE to a local minimum on two nodes and load its points. Returns their distance."""
    work = patch_work_at(search.w, 0)
    x = work.place
    start = (_moved(x[0], 0.0), _moved(x[1], 0.0), _moved(x[2], 0.0), _moved(x[3], 0.0))
    place, _at, _last = _descend(BodyQuery(search, i, j), start)
    x[0], x[1], x[2], x[3] = place
    load_places(search, i, j)
    return math.sqrt(vector_dot(search.w, D, D))


@kernel(inner=True)
def is_on_face(tree, k, x, y):
    """Whether a place of whole patch k is inside its face, and not within rounding of the boundary."""
    patch = patch_of(tree, k)
    if patch.trim == NONE:
        return True
    span = patch_span_at(tree.pool, patch.span)
    u = span.low_u + x * (span.high_u - span.low_u)
    v = span.low_v + y * (span.high_v - span.low_v)
    return trim_side(Store(tree.table, tree.pool), patch.trim, u, v) == 1


@kernel(inner=True)
def take_points(search, patch_a, patch_b, far):
    """Keep the points in hand, at PLACE of two whole patches and `far` apart, if they are the nearest known."""
    a, b, state, work = search.a, search.b, body_search_at(search.state, 0), patch_work_at(search.w, 0)
    away = node_of(a, patch_of(a, patch_a).node).away + node_of(b, patch_of(b, patch_b).node).away
    upper = far * (1.0 + 16.0 * UNIT) + search.errors.point + away
    x = work.place
    if not upper < state.upper or not is_on_face(a, patch_a, x[0], x[1]) or not is_on_face(b, patch_b, x[2], x[3]):
        return
    state.upper = upper
    state.limit = bound_to_beat(search.question, upper, search.errors.step)
    state.patches[0], state.patches[1] = patch_a, patch_b
    for i in range(4):
        state.places[i] = x[i]
    for c in range(3):
        state.points[c], state.points[3 + c] = state.on_a[c], state.on_b[c]
        if far > 0.0:
            state.way[c] = work.d[c] / far


@kernel(inner=True)
def descend_on_patches(search, patch_a, patch_b):
    """A local minimum of two whole patches from PLACE."""
    body_search_at(search.state, 0).descents += 1.0
    far = descend(search, patch_of(search.a, patch_a).node, patch_of(search.b, patch_b).node)
    take_points(search, patch_a, patch_b, far)


@kernel(inline=True)
def place_on_patches(search, i, j):
    """Convert PLACE from coordinates of two nodes to those of their whole patches."""
    x = patch_work_at(search.w, 0).place
    node = node_of(search.a, i)
    x[0] = node.low_u + x[0] * (node.high_u - node.low_u)
    x[1] = node.low_v + x[1] * (node.high_v - node.low_v)
    node = node_of(search.b, j)
    x[2] = node.low_u + x[2] * (node.high_u - node.low_u)
    x[3] = node.low_v + x[3] * (node.high_v - node.low_v)


@kernel(inner=True)
def take_from_nodes(search, i, j):
    """Keep the points at PLACE of two nodes if they are the nearest known."""
    patch_a, patch_b = links_of(search.a, i).patch, links_of(search.b, j).patch
    place_on_patches(search, i, j)
    load_places(search, patch_of(search.a, patch_a).node, patch_of(search.b, patch_b).node)
    take_points(search, patch_a, patch_b, math.sqrt(vector_dot(search.w, D, D)))


@kernel(inline=True)
def is_on_side(x, y):
    """Whether a place is on a side of its patch, beyond which a neighbor may go on."""
    return x == 0.0 or x == 1.0 or y == 0.0 or y == 1.0


@kernel(inner=True)
def cross_sides(search, of_a):
    """Descend from the nearest known points to patches of a or b that may continue a patch beyond its side."""
    state, x = body_search_at(search.state, 0), patch_work_at(search.w, 0).place
    side = 0 if of_a else 1
    at = 2 * side
    if not is_on_side(state.places[at], state.places[at + 1]):
        return
    tree = search.a if of_a else search.b
    point = (state.points[3 * side], state.points[3 * side + 1], state.points[3 * side + 2])
    if not of_a:
        point = matvec_t(search.pose.turn, sub(point, search.pose.shift))
    here, other = int(state.patches[side]), int(state.patches[1 - side])
    u, v = state.places[2 - at], state.places[3 - at]
    for k in range(int(body_head_at(tree.pool, 0).patches)):
        node = node_of(tree, patch_of(tree, k).node)
        middle = (node.middle[0], node.middle[1], node.middle[2])
        if k != here and patch_of(tree, k).curve == NONE and norm(sub(middle, point)) <= node.radius:
            x[at] = x[at + 1] = 0.5
            x[2 - at], x[3 - at] = u, v
            descend_on_patches(search, k if of_a else other, other if of_a else k)


@kernel(inner=True)
def descend_across_sides(search):
    """Descend to neighbors of patches on elementary surfaces, until the distance of these is reached or none is nearer.

    Where that is the distance of the bodies, the search ends as soon as points at this distance are known. Until then
    no pair has a better bound than another, and all would be examined.
    """
    a, b, state = search.a, search.b, body_search_at(search.state, 0)
    for _ in range(_CROSSINGS):
        first, second = patch_of(a, int(state.patches[0])).spine, patch_of(b, int(state.patches[1])).spine
        if first == NONE or second == NONE:
            return
        least, upper = spine_bound(a, first, b, second, search.pose), state.upper
        if not 0.0 < least < state.limit:
            return
        cross_sides(search, True)
        cross_sides(search, False)
        if not state.upper < upper:
            return


@kernel(inner=True)
def nearest_boundary(tree, face, point):
    """The patch of the boundary of a face that is nearest to a point, relative to the center of the body.

    Its ball tells it, and its line or its circle: the ball of a long line has points that are far from it. Of parts of
    one circle, the one whose middle is nearer.
    """
    best, least = NONE, math.inf
    place = Spine(SPHERE, (point[0], point[1], point[2]), (0.0, 0.0, 1.0), 0.0, 0.0, 0.0)
    for k in range(int(body_head_at(tree.pool, 0).patches)):
        patch = patch_of(tree, k)
        if patch.curve != NONE and patch.face == face:
            node = node_of(tree, patch.node)
            apart = sub(node.middle, point)
            middle = math.sqrt(dot(apart, apart))
            far = max(0.0, middle - node.radius)
            if patch.spine != NONE:
                far = max(far, of_sphere(place, spine_of(tree.pool, patch.spine)))
            far += _NEARER_MIDDLE * middle
            if far < least:
                best, least = k, far
    return best


@kernel(inner=True)
def descend_on_boundary(search, patch_a, patch_b):
    """Descend from PLACE of two whole patches to a local minimum, on the boundary where a place is outside its face."""
    a, b, state, x = search.a, search.b, body_search_at(search.state, 0), patch_work_at(search.w, 0).place
    on_b = matvec_t(search.pose.turn, sub(state.on_b, search.pose.shift))
    if patch_of(a, patch_a).trim != NONE and not is_on_face(a, patch_a, x[0], x[1]):
        patch_a = nearest_boundary(a, patch_of(a, patch_a).face, state.on_a)
        x[0] = x[1] = 0.5
    if patch_of(b, patch_b).trim != NONE and not is_on_face(b, patch_b, x[2], x[3]):
        patch_b = nearest_boundary(b, patch_of(b, patch_b).face, on_b)
        x[2] = x[3] = 0.5
    descend_on_patches(search, patch_a, patch_b)


@kernel(inner=True)
def descend_from_nodes(search, i, j):
    """A local minimum of the whole patches of two nodes, from PLACE of these.

    If a face is trimmed and no nearer points were found, descend on the boundary as well, and on the nodes themselves.
    """
    state, x = body_search_at(search.state, 0), patch_work_at(search.w, 0).place
    patch_a, patch_b = links_of(search.a, i).patch, links_of(search.b, j).patch
    start, upper = (x[0], x[1], x[2], x[3]), state.upper
    place_on_patches(search, i, j)
    descend_on_patches(search, patch_a, patch_b)
    if state.upper < upper:
        descend_across_sides(search)
    trimmed = patch_of(search.a, patch_a).trim != NONE or patch_of(search.b, patch_b).trim != NONE
    if trimmed and state.upper == upper:
        descend_on_boundary(search, patch_a, patch_b)
        x[0], x[1], x[2], x[3] = start
        descend(search, i, j)
        take_from_nodes(search, i, j)


@kernel(inline=True)
def place_at_models(search):
    """Set PLACE to where the quadratic of the pair is least."""
    for k in range(4):
        patch_work_at(search.w, 0).place[k] = pair_work_at(search.pair, 0).z[k] + 0.5
