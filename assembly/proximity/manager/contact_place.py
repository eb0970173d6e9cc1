"""The place of a contact on two bodies: the region in which a least gap of these bodies does not apply.

Around a contact's pair of points the bodies are nearer to each other than any gap above zero. The place of the contact
is the region between the bodies that can be reached from these points without the gap rising to the least gap: it holds
the corners of a face that lies on another face, and both minima into which the contact's minimum splits. Where the
bodies are near beyond a wider gap is another place. For a contact that is still open, the least gap is counted from the
contact's own gap.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._newton import damped_newton
from assembly._record import Store
from assembly.geometry.nearest_place import Interval, move_along, sight_of, step_along
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.vec import add, dot, scale, sub
from assembly.proximity.brep.borders import feature_at, feature_kind
from assembly.proximity.brep.records import EDGE, VERTEX
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.extrema.feature_jets import edge_jet, vertex_point
from assembly.proximity.features.solid_contact import pair_parameters, tracked_at
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
from assembly.proximity.manager.overlap import DEPTH, next_near, patch_at, projection_at, seen_by_other, surface_of_code
from assembly.proximity.manager.posed_pair import posed_pair
from assembly.proximity.manager.records import ContactManager, lengths_of, pair_lengths_of, pair_of

# How many strides a path between two pairs of points takes if it is straight; and how many at most.
STRIDES, LONGEST = 32, 96
# How often a point is centered between the bodies after a stride; by which part of a stride it must come nearer.
CENTERINGS, GAINED = 3, 0.05
# A part of an edge and a point.
EdgeQuery = namedtuple("EdgeQuery", "store edge y interval")


@kernel(inner=True)
def point_of(store, surface, shell, code, u, v):
    """The point of a surface, or of a feature of a shell, in the axes of its body."""
    if surface >= 0:
        return surface_point(store.table, store.pool, surface, u, v).point
    kind = feature_kind(store.table, shell, code)
    feature = feature_at(store.table, shell, code)
    if kind == VERTEX:
        return vertex_point(store, feature)
    return (
        edge_jet(store, feature, u)[0] if kind == EDGE else surface_point(store.table, store.pool, feature, u, v).point
    )


@kernel(inline=True)
def distance_between(a, b):
    """The distance of two points."""
    d = sub(a, b)
    return math.sqrt(dot(d, d))


@kernel(inline=True)
def _seen(query, t):
    """The point of the question from a place of the edge."""
    p, along, bent = edge_jet(query.store, query.edge, t)
    return sight_of(sub(p, query.y), along, bent)


_nearest_from = kernel(inner=True)(damped_newton(_seen, step_along, move_along, steps=9))


@kernel(inner=True)
def point_on_edge(store, edge, low, high, y):
    """The point of a part of an edge nearest to y, as Newton's method finds it from the middle of the part."""
    query = EdgeQuery(store, edge, y, Interval(low, high, False))
    return edge_jet(store, edge, _nearest_from(query, 0.5 * (low + high))[2])[0]


@kernel(inner=True)
def nearest_point(posed, side, y, distance, stack):
    """The nearest point of one body to y, in its axes, and whether one is within a distance."""
    store, shell = posed.store, posed.shells[side]
    stack[0] = 0
    used = 1
    least = distance
    best = y
    some = False
    while used > 0:
        e, used = next_near(store, posed.trees[side], y, least, stack, used)
        if e < 0:
            break
        element = patch_at(posed, side, e)
        code = np.int64(element.feature)
        if surface_of_code(posed, side, code) >= 0:
            off, n, found = projection_at(posed, side, e, y)
            p = sub(y, scale(off, n))
            if not found:
                continue
        elif feature_kind(store.table, shell, code) == EDGE:
            middle, half = element.middle[0], element.half[0]
            p = point_on_edge(store, feature_at(store.table, shell, code), middle - half, middle + half, y)
        else:
            p = vertex_point(store, feature_at(store.table, shell, code))
        away = distance_between(p, y)
        if away <= least:
            least, best, some = away, p, True
    return best, some


@kernel(inner=True)
def between_bodies(posed, c, distance, stack):
    """The middle of both bodies' nearest points to c, how far these are apart, and whether both are near c."""
    p, found_f = nearest_point(posed, 0, c, distance, stack)
    q, found_g = nearest_point(posed, 1, seen_by_other(posed, 0, c), distance, stack)
    q = seen_by_other(posed, 1, q)
    return scale(0.5, add(p, q)), distance_between(q, p), found_f and found_g


@kernel(inner=True)
def leads_to(posed, begin, end, level, stack):
    """Whether a path between the bodies joins two points, with gaps below a level all along.

    Each stride goes straight toward the end; then the point is centered between the bodies again.
    """
    left = distance_between(end, begin)
    stride = left / STRIDES
    c = begin
    for _ in range(LONGEST):
        if left <= stride:
            return True
        c = add(c, scale(stride / left, sub(end, c)))
        near = False
        for _centering in range(CENTERINGS):
            c, gap, found = between_bodies(posed, c, stride + level, stack)
            if not found:
                return False
            near = gap < level
            if near:
                break
        before, left = left, distance_between(end, c)
        if not near or left > before - GAINED * stride:
            return False
    return False


@kernel(inner=True)
def contact_points(posed, given, tracked):
    """The pair of points of a given contact, in the axes of body f of its pair of bodies."""
    pair = tracked_at(tracked, given.row)
    x, codes = pair_parameters(pair), (np.int64(pair.feature_f), np.int64(pair.feature_g))
    a = point_of(posed.store, given.surface[0], given.shell[0], codes[0], x[0], x[1])
    b = point_of(posed.store, given.surface[1], given.shell[1], codes[1], x[2], x[3])
    if given.swapped == 1:
        a, b = b, a
    return a, seen_by_other(posed, 1, b)


@kernel(inner=True, allocates=True)
def spread_place(posed, extrema, begin, limits, stack):
    """Mark the extrema in the place of a contact whose points have their middle at `begin`.

    The place grows from extremum to extremum, the nearest first: each is tried from the nearest point that is known to
    be in the place. `limits` are the gap below which extrema are left out, and the level that gaps must stay below.
    """
    lowest, level = limits
    count = extrema.shape[0]
    middles = np.empty((count, 3))
    # The distance from which an extremum was last tried; its distance to the nearest point of the place, and that
    # point.
    tried = np.full(count, math.inf)
    nearest = np.full(count, math.inf)
    source = np.empty((count, 3))
    eligible = np.zeros(count, np.bool_)
    for k in range(count):
        extremum = extremum_at(extrema, k)
        c = scale(0.5, add(three_of(extremum.point_f), three_of(extremum.point_g)))
        middles[k, 0], middles[k, 1], middles[k, 2] = c
        source[k, 0], source[k, 1], source[k, 2] = begin
        nearest[k] = distance_between(c, begin)
        may = extremum.origin == NEW or extremum.origin >= LISTED
        eligible[k] = may and extremum.place == ELSEWHERE and lowest <= extremum.gap < level
    while True:
        best = -1
        for k in range(count):
            if eligible[k] and nearest[k] < tried[k] and (best < 0 or nearest[k] < nearest[best]):
                best = k
        if best < 0:
            return
        tried[best] = nearest[best]
        end = three_of(middles[best])
        if not leads_to(posed, three_of(source[best]), end, level, stack):
            continue
        extremum_at(extrema, best).place = BESIDE_CONTACT
        eligible[best] = False
        for k in range(count):
            away = distance_between(three_of(middles[k]), end)
            if away < nearest[k]:
                nearest[k] = away
                source[k, 0], source[k, 1], source[k, 2] = end


@kernel(inner=True)
def mark(manager, p, q, tracked, extrema, stack):
    """Mark extrema of pair p at given contacts or in their places; how many of these contacts have points."""
    table = manager.store.table
    pair = pair_of(manager, p)
    posed = posed_pair(manager, p, q)
    least = pair_lengths_of(manager, p).least
    merge_radius = lengths_of(manager).merge_radius
    known = 0
    for c in range(pair.given_count):
        given = given_at(table, pair.given + GIVEN_RECORD * c)
        contact = tracked_at(tracked, given.row)
        if math.isnan(contact.parameters[0]):
            continue
        known += 1
        a, b = contact_points(posed, given, tracked)
        for k in range(extrema.shape[0]):
            extremum = extremum_at(extrema, k)
            if (
                max(distance_between(three_of(extremum.point_f), a), distance_between(three_of(extremum.point_g), b))
                <= merge_radius
            ):
                extremum.place = OF_CONTACT
        gap = distance_between(a, b) if contact.gap > 0.0 else 0.0
        # A contact that may be open, and is by the least gap or more, excuses no gap below the least one.
        lowest = least if given.opens == 1 and gap >= least else -math.inf
        spread_place(posed, extrema, scale(0.5, add(a, b)), (lowest, gap + least), stack)
    return known


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], i8, f8[:, ::1], f8[:, ::1], f8[:, ::1])", allocates=True)
def mark_places(table, pool, at, memory, p, q, tracked, extrema):
    """`mark`, of the contact manager at a place of the table. An update calls this by its address."""
    manager = ContactManager(Store(table, pool), at, memory)
    return mark(manager, p, q, tracked, extrema, np.empty(DEPTH, np.int64))
