"""The place of a contact on two bodies: what a least gap of the same bodies does not ask for.

Around a contact's pair of points the bodies are nearer than any gap above zero. Its place is all that is reached from
there between the two bodies without their gap rising to the least one: the corners of a face that lies on another face,
the two minima into which the contact's minimum parts. What is near elsewhere, beyond a wider gap, is another place. A
contact that is still open is taken as closed: what it will leave open by less than the least gap is in its place.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.vec import add, dot, matvec, matvec_t, scale, sub
from assembly.proximity.brep.borders import feature_at, feature_kind
from assembly.proximity.brep.records import EDGE, VERTEX
from assembly.proximity.bvh.tree import (
    ELEMENT,
    NODE,
    NODE_INTS,
    element_at,
    node_at,
    node_links_at,
    three_of,
    tree_at,
)
from assembly.proximity.extrema.feature_jets import edge_jet, vertex_point
from assembly.proximity.features.solid_contact import tracked_at
from assembly.proximity.manager.extrema import (
    BESIDE_CONTACT,
    ELSEWHERE,
    GIVEN_RECORD,
    LISTED,
    NEW,
    OF_CONTACT,
    extremum_at,
    given_at,
)
from assembly.proximity.manager.overlap import DEPTH, projection_at, surface_of, with_children
from assembly.proximity.manager.posed_pair import posed_pair
from assembly.proximity.manager.state import (
    PAIR_RECORD,
    lengths_at,
    manager_at,
    pair_at,
    pair_lengths_at,
)

# A way from one pair to another one has so many strides, were it straight; so many it may have at most.
STRIDES, LONGEST = 32, 96
# How often a point is put between the bodies anew after a stride, and which part of a stride has to be gained.
CENTERINGS, GAINED = 3, 0.05
# Steps of Newton's method to the nearest point of an edge.
EDGE_STEPS = 8


@kernel(inner=True)
def point_of(store, surface, shell, code, u, v):
    """The point of a surface, or of a feature of a shell, in the axes of its body."""
    if surface >= 0:
        return surface_point(store.table, store.pool, surface, u, v)[0]
    kind = feature_kind(store.table, shell, code)
    feature = feature_at(store.table, shell, code)
    if kind == VERTEX:
        return vertex_point(store, feature)
    return edge_jet(store, feature, u)[0] if kind == EDGE else surface_point(store.table, store.pool, feature, u, v)[0]


@kernel(inner=True)
def point_on_edge(store, edge, low, high, y):
    """The point of a part of an edge that Newton's method takes for the nearest one to y."""
    t = 0.5 * (low + high)
    for _ in range(EDGE_STEPS):
        p, along, bent = edge_jet(store, edge, t)
        d = sub(p, y)
        slope = dot(d, along)
        square = dot(along, along)
        curvature = square + dot(d, bent)
        step = -slope / (curvature if curvature > 0.1 * square else max(square, 1e-300))
        before = t
        t = min(max(t + step, low), high)
        if abs(t - before) <= 1e-12 * (high - low):
            break
    return edge_jet(store, edge, t)[0]


@kernel(inner=True)
def nearest_point(store, tree, surface, shell, y, reach, stack):
    """The nearest point of a body to y, in its axes, and whether one is within reach."""
    tree_record = tree_at(store.table, tree)
    stack[0] = 0
    used = 1
    least = reach
    best = y
    some = False
    while used > 0:
        used -= 1
        i = stack[used]
        o = node_at(store.pool, tree_record.node_pool + NODE * i)
        square = 0.0
        for k in range(3):
            off = max(abs(y[k] - o.center[k]) - o.half[k], 0.0)
            square += off * off
        if square > least * least:
            continue
        child = node_links_at(store.table, tree_record.node_table + NODE_INTS * i).child
        if child >= 0:
            used = with_children(stack, used, child)
            continue
        e = -1 - child
        at = tree_record.element_pool + ELEMENT * e
        code = np.int64(element_at(store.pool, at).feature)
        if surface_of(store.table, shell, surface, code) >= 0:
            distance, n, found = projection_at(store, tree, surface, shell, e, y)
            p = sub(y, scale(distance, n))
            if not found:
                continue
        elif feature_kind(store.table, shell, code) == EDGE:
            element = element_at(store.pool, at)
            middle, half = element.middle[0], element.half[0]
            p = point_on_edge(store, feature_at(store.table, shell, code), middle - half, middle + half, y)
        else:
            p = vertex_point(store, feature_at(store.table, shell, code))
        d = sub(p, y)
        distance = math.sqrt(dot(d, d))
        if distance <= least:
            least, best, some = distance, p, True
    return best, some


@kernel(inner=True)
def between_bodies(store, posed, c, reach, stack):
    """The middle of the nearest points of both bodies to c, how far these are apart, and whether both are in reach."""
    turn, shift = posed.pose.rotation, posed.pose.shift
    p, found_f = nearest_point(store, posed.trees[0], posed.surfaces[0], posed.shells[0], c, reach, stack)
    at_g = matvec_t(turn, sub(c, shift))
    q, found_g = nearest_point(store, posed.trees[1], posed.surfaces[1], posed.shells[1], at_g, reach, stack)
    q = add(matvec(turn, q), shift)
    d = sub(q, p)
    return scale(0.5, add(p, q)), math.sqrt(dot(d, d)), found_f and found_g


@kernel(inner=True)
def leads_to(store, posed, begin, end, level, stack):
    """Whether a way between the bodies leads from one point to another one, along which they are nearer than a level.

    It goes straight for the end, and after every stride back to where both bodies are equally far.
    """
    d = sub(end, begin)
    left = math.sqrt(dot(d, d))
    stride = left / STRIDES
    c = begin
    for _ in range(LONGEST):
        if left <= stride:
            return True
        c = add(c, scale(stride / left, sub(end, c)))
        near = False
        for _centering in range(CENTERINGS):
            c, gap, found = between_bodies(store, posed, c, stride + level, stack)
            if not found:
                return False
            near = gap < level
            if near:
                break
        d = sub(end, c)
        before, left = left, math.sqrt(dot(d, d))
        if not near or left > before - GAINED * stride:
            return False
    return False


@kernel(inner=True)
def contact_points(store, posed, given, tracked):
    """The pair of points of a given contact, in the axes of body f of its pair of bodies."""
    given_record = given_at(store.table, given)
    pair = tracked_at(tracked, given_record.row)
    a = point_of(
        store, given_record.surface[0], given_record.shell[0], np.int64(pair.feature_f),
        pair.parameters[0], pair.parameters[1],
    )  # fmt: skip
    b = point_of(
        store, given_record.surface[1], given_record.shell[1],
        np.int64(pair.feature_g), pair.parameters[2], pair.parameters[3],
    )  # fmt: skip
    if given_record.swapped == 1:
        a, b = b, a
    return a, add(matvec(posed.pose.rotation, b), posed.pose.shift)


@kernel(inline=True)
def extremum_points(extrema, k):
    """The pair of points of a root."""
    extremum = extremum_at(extrema, k)
    return three_of(extremum.point_f), three_of(extremum.point_g)


@kernel(inline=True)
def apart(a, b):
    """The distance of two points."""
    d = sub(a, b)
    return math.sqrt(dot(d, d))


@kernel(inner=True, allocates=True)
def spread(store, posed, extrema, count, begin, limits, stack):
    """Mark the roots in the place of a contact whose points have their middle at `begin`.

    From root to root, the nearest first: each is tried from the nearest point that is known to be in the place. The
    `limits` are the level below which gaps are, and the gap below which no root is taken.
    """
    level, lowest = limits
    middles = np.empty((count, 3))
    # From how near a root was tried last, and from where it is to be tried next.
    tried = np.full(count, math.inf)
    nearest = np.full(count, math.inf)
    source = np.empty((count, 3))
    eligible = np.zeros(count, np.bool_)
    for k in range(count):
        p, q = extremum_points(extrema, k)
        c = scale(0.5, add(p, q))
        middles[k, 0], middles[k, 1], middles[k, 2] = c
        source[k, 0], source[k, 1], source[k, 2] = begin
        nearest[k] = apart(c, begin)
        may = extremum_at(extrema, k).origin == NEW or extremum_at(extrema, k).origin >= LISTED
        eligible[k] = (
            may and extremum_at(extrema, k).place == ELSEWHERE and lowest <= extremum_at(extrema, k).gap < level
        )
    while True:
        best = -1
        for k in range(count):
            if eligible[k] and nearest[k] < tried[k] and (best < 0 or nearest[k] < nearest[best]):
                best = k
        if best < 0:
            return
        tried[best] = nearest[best]
        start = (source[best, 0], source[best, 1], source[best, 2])
        end = (middles[best, 0], middles[best, 1], middles[best, 2])
        if not leads_to(store, posed, start, end, level, stack):
            continue
        extremum_at(extrema, best).place = BESIDE_CONTACT
        eligible[best] = False
        for k in range(count):
            away = apart((middles[k, 0], middles[k, 1], middles[k, 2]), end)
            if away < nearest[k]:
                nearest[k] = away
                source[k, 0], source[k, 1], source[k, 2] = end


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8[:, ::1], f8[:, ::1], f8[:, ::1], i8)")
def mark_places(table, pool, watch, p, q, tracked, extrema, count):
    """Mark the roots of pair p that are a given contact's pair, or in its place; how many contacts have one."""
    store = Store(table, pool)
    manager = manager_at(table, watch)
    pair = pair_at(table, manager.pair_table + PAIR_RECORD * p)
    posed = posed_pair(manager, pair, q)
    least = pair_lengths_at(pool, pair.minimum).least
    merge_radius = lengths_at(pool, manager.lengths).neglect
    stack = np.empty(DEPTH, np.int64)
    known = 0
    for c in range(pair.given_count):
        given = pair.given + GIVEN_RECORD * c
        given_record = given_at(table, given)
        r = given_record.row
        if math.isnan(tracked_at(tracked, r).parameters[0]):
            continue
        known += 1
        a, b = contact_points(store, posed, given, tracked)
        for k in range(count):
            p_f, p_g = extremum_points(extrema, k)
            if max(apart(p_f, a), apart(p_g, b)) <= merge_radius:
                extremum_at(extrema, k).place = OF_CONTACT
        gap = apart(a, b) if tracked_at(tracked, r).gap > 0.0 else 0.0
        # A contact that may stay open, and is by more than the least gap, excuses nothing that is nearer.
        lowest = least if given_record.opens == 1 and gap >= least else -math.inf
        limits = (gap + least, lowest)
        spread(store, posed, extrema, count, scale(0.5, add(a, b)), limits, stack)
    return known
