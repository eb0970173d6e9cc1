"""The search of a look (`proximity/manager/update.py`) for contacts of two round wires, by their spines.

Wires touch where the distance of their spines has a minimum, less their radii. Boxes of both, lengths along a part of
either, are halved until it is known of each how many minima it holds (`proximity/manager/centerlines/box.py`); where
that takes boxes that are
all but points, feet tell (`minima.py`). So no contact is missed, and it is known how far bodies may go until
there may be others: what is excluded by a margin stays so for motions that are shorter.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, scale, sub
from assembly.proximity.extrema.face_face import pair_frame
from assembly.proximity.features.solid_contact import pair_parameters
from assembly.proximity.manager.centerlines.box import (
    BARREN,
    BOX,
    CONVEX,
    EMPTY,
    UNKNOWN,
    FreeEnds,
    Lengths,
    apart,
    box_of,
    centerline_box_at,
)
from assembly.proximity.manager.centerlines.minima import convex_minimum, near_singular_minima
from assembly.proximity.manager.extrema import (
    NEW,
    NOTHING,
    SAME,
    USELESS,
    add_extremum,
    are_one,
    extremum_at,
    write,
)
from assembly.proximity.manager.motion_bounds import MotionBall, PairSearch, no_ball
from assembly.proximity.manager.wires import (
    PART,
    both_radii,
    centerline_at,
    centerline_part_at,
    centerline_place,
    centerline_point,
    wire_at,
    wire_parameters,
)

# Room for boxes that wait.
BOXES = 2048
# Where a known root is on the centerlines: part and length from its middle of either.
KNOWN_PLACE = record_dtype("f8", part_f=1, at_f=1, part_g=1, at_g=1)
known_place_at = record_view(KNOWN_PLACE)
MARK = size_of(KNOWN_PLACE)
# Boxes over half of which no tangent turns by more than this are thin enough for feet to tell.
THIN = 0.025
# So many boxes are halved only because they allow little, down to so many radians.
REFINED, FINE = 16, 0.05
# What may go by more than this part of a reach is not worth a ball.
MUCH = 0.6
# Of a level valley points are contacts that are farther from each other than so many radii.
SPARSE = 0.5
# Slopes of the distance below this say that a known contact is a minimum's.
AT_EXTREMUM = 1e-9
# Newton's method on the surfaces ends at the minimum it began at, if the gap is the same but for this.
ASTRAY = 1e-9
# Spines that are nearer than this cross, and have no direction to each other.
MEETING = 1e-12


@kernel(inline=True)
def open_ends(store, f, g, box):
    """At which free ends of two spines a box is: f's start and end, g's start and end."""
    line = centerline_at(store.table, f)
    centerline = centerline_at(store.table, g)
    free_f = line.closed == 0
    free_g = centerline.closed == 0
    i = np.int64(box.part_f)
    j = np.int64(box.part_g)
    half_f = centerline_part_at(store.pool, line.part_pool + PART * i).half
    half_g = centerline_part_at(store.pool, centerline.part_pool + PART * j).half
    return FreeEnds(
        start_f=free_f and i == 0 and box.from_f <= -half_f,
        end_f=free_f and i == line.parts - 1 and box.to_f >= half_f,
        start_g=free_g and j == 0 and box.from_g <= -half_g,
        end_g=free_g and j == centerline.parts - 1 and box.to_g >= half_g,
    )


@kernel(inner=True)
def mark_known(store, posed, extrema, count, marks):
    """Where on the spines known roots are that are at a minimum: part and length of either; NaN for others."""
    surfaces = posed.surfaces
    f, g = posed.centerlines
    for k in range(count):
        x = pair_parameters(extremum_at(extrema, k))
        i, s = centerline_place(store, f, surfaces[0], x[0], x[1])
        j, t = centerline_place(store, g, surfaces[1], x[2], x[3])
        mark = known_place_at(marks, k)
        mark.part_f, mark.at_f = float(i), s
        mark.part_g, mark.at_g = float(j), t
        o = centerline_at(store.table, f).part_pool + PART * i
        p = centerline_at(store.table, g).part_pool + PART * j
        there = apart(store.pool, o, p, posed.pose, s, t)
        d = there.d
        if extremum_at(extrema, k).origin == USELESS or not abs(dot(d, there.tangent_f)) + abs(
            dot(d, there.tangent_g)
        ) <= AT_EXTREMUM * math.sqrt(dot(d, d)):
            # Of far sides, at a half ball, or on its way to a root: what is there is looked for.
            mark.part_f = math.nan


@kernel(inner=True)
def is_marked(boxes, b, marks, count):
    """Whether a known root is in box b."""
    box = centerline_box_at(boxes, b)
    for k in range(count):
        mark = known_place_at(marks, k)
        if (
            mark.part_f == box.part_f
            and mark.part_g == box.part_g
            and box.from_f <= mark.at_f <= box.to_f
            and box.from_g <= mark.at_g <= box.to_g
        ):
            return True
    return False


@kernel(inline=True)
def across_both(f, g):
    """A unit vector across two tangents: of spines that cross any is as good."""
    n = cross(f, g)
    length = math.sqrt(dot(n, n))
    if length < MEETING:
        # They run along each other: across the first one.
        n = cross(f, (1.0, 0.0, 0.0) if abs(f[0]) < 0.7 else (0.0, 1.0, 0.0))
        length = math.sqrt(dot(n, n))
    return scale(1.0 / length, n)


@kernel(inner=True)
def add_minimum(store, posed, i, j, s, t, merge_radius, extrema, count, work):
    """Add the contact at lengths s and t along parts i and j, if it is none of the known ones. Returns how many."""
    if count == extrema.shape[0]:
        return count
    f, g = posed.centerlines
    o = centerline_at(store.table, f).part_pool + PART * i
    p = centerline_at(store.table, g).part_pool + PART * j
    there = apart(store.pool, o, p, posed.pose, s, t)
    d = there.d
    length = math.sqrt(dot(d, d))
    way = scale(1.0 / length, d) if length >= MEETING else across_both(there.tangent_f, there.tangent_g)
    u_f, v_f = wire_parameters(store, f, posed.surfaces[0], i, s, way)
    u_g, v_g = wire_parameters(store, g, posed.surfaces[1], j, t, matvec_t(posed.pose.rotation, scale(-1.0, way)))
    start = (u_f, v_f, u_g, v_g)
    gap = length - both_radii(store, posed.centerlines)
    before = count
    extremum = extremum_at(extrema, before)
    count, found = add_extremum(store, posed, (0, 0), start, (0.0, 0.0, 0.0), merge_radius, extrema, count, work, 0.0)
    if found == NOTHING or not abs(extremum.gap - gap) <= ASTRAY:
        # At a fold Newton's method may find nothing, or go elsewhere: the minimum is known without it.
        frame = pair_frame(store, posed.surfaces[0], posed.surfaces[1], posed.pose, start)
        if not frame.regular:
            return before
        write(extrema, before, start, 0, 0, frame.normal, frame.gap, frame.point_f, frame.point_g, 0.0)
        for k in range(before):
            radius = min(merge_radius, SAME) if extremum_at(extrema, k).origin == USELESS else merge_radius
            if are_one(store, posed, extrema, before, k, radius):
                return before
        count = before + 1
    if count > before:
        extremum.origin = NEW
    return count


@kernel(inline=True)
def around_box(pool, o, box, side, lo, hi):
    """A box (lo, hi) made larger so that the part of one spine in a box of both is in it."""
    begin, end = (box.from_f, box.to_f) if side == 0 else (box.from_g, box.to_g)
    half = 0.5 * (end - begin)
    middle = centerline_point(pool, o, begin + half)[0]
    return (
        (min(lo[0], middle[0] - half), min(lo[1], middle[1] - half), min(lo[2], middle[2] - half)),
        (max(hi[0], middle[0] + half), max(hi[1], middle[1] + half), max(hi[2], middle[2] + half)),
    )


@kernel(inline=True)
def halves(boxes, b):
    """Box b is halved along the longer one of its sides; the second half is behind it."""
    for m in range(BOX):
        boxes[b + 1, m] = boxes[b, m]
    first, second = centerline_box_at(boxes, b), centerline_box_at(boxes, b + 1)
    if first.to_f - first.from_f >= first.to_g - first.from_g:
        first.to_f = second.from_f = 0.5 * (first.from_f + first.to_f)
    else:
        first.to_g = second.from_g = 0.5 * (first.from_g + first.to_g)


@kernel(inner=True)
def add_minima(store, posed, box, ends, what, merge_radius, places, extrema, count, work):
    """Add the minima that a box has. Returns how many roots there are, and whether these are all for certain."""
    f, g = posed.centerlines
    i = np.int64(box.part_f)
    j = np.int64(box.part_g)
    o = centerline_at(store.table, f).part_pool + PART * i
    p = centerline_at(store.table, g).part_pool + PART * j
    part = Lengths(box.from_f, box.to_f, box.from_g, box.to_g)
    certain = True
    settled = False
    if what == CONVEX:
        s, t = 0.5 * (box.from_f + box.to_f), 0.5 * (box.from_g + box.to_g)
        found, s, t, settled = convex_minimum(store.pool, o, p, posed.pose, part, ends, s, t)
        if found:
            count = add_minimum(store, posed, i, j, s, t, merge_radius, extrema, count, work)
    if not settled:
        many, level, certain = near_singular_minima(store.pool, o, p, posed.pose, part, ends, places)
        if level:
            # All along it is as good: points here and there stand for it.
            merge_radius = max(
                merge_radius,
                SPARSE / max(centerline_part_at(store.pool, o).bend, centerline_part_at(store.pool, p).bend),
            )
        for m in range(many):
            count = add_minimum(store, posed, i, j, places[m, 0], places[m, 1], merge_radius, extrema, count, work)
    return count, certain


@kernel(inner=True)
def search_centerlines(store, posed, moving, rho, lengths, merge_radius, boxes, waiting, rooms, extrema, count, work):
    """Look for all contacts of two wires with gaps up to `near`; known ones are the first `count` roots.

    The `lengths` are the least gap asked for, how near is near, the reach, and the flank: how far bodies may go at a
    fold. `moving` is the body that moves. There are `waiting` boxes; within the reach nothing is outside of them. The
    `rooms` are for marks of known roots, and for the minima of a box.

    Returns a PairSearch.
    """
    least, near, reach, flank = lengths
    f, g = posed.centerlines
    line = centerline_at(store.table, f)
    centerline = centerline_at(store.table, g)
    side = moving.side
    radii = both_radii(store, posed.centerlines) + least
    sharpest = max(wire_at(store.pool, line.numbers).sharpest, wire_at(store.pool, centerline.numbers).sharpest)
    known = count
    marks, places = rooms
    mark_known(store, posed, extrema, known, marks)
    free = reach
    fertile = math.inf
    sure = math.inf
    refined = 0
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    while waiting > 0:
        b = waiting - 1
        box = centerline_box_at(boxes, b)
        o = line.part_pool + PART * np.int64(box.part_f)
        p = centerline.part_pool + PART * np.int64(box.part_g)
        part = Lengths(box.from_f, box.to_f, box.from_g, box.to_g)
        ends = open_ends(store, f, g, box)
        low, what, margin = box_of(store.pool, o, p, posed.pose, part, ends, radii + reach, rho)
        low -= radii
        # A minimum that a box may hold, and nobody looks for, is as near as the box.
        hollow = what == EMPTY or what == BARREN
        allowed = max(low, margin) if low <= near or hollow else low
        if allowed >= reach and (low > near or hollow):
            waiting = b
            continue
        bend = 0.5 * max(box.to_f - box.from_f, box.to_g - box.from_g) * sharpest
        halve = what == UNKNOWN and low <= near and bend > THIN
        if not halve and allowed < flank and refined < REFINED and bend > FINE:
            halve = True
            refined += 1
        if halve and waiting < boxes.shape[0]:
            halves(boxes, b)
            waiting += 1
            continue
        if low <= near and not hollow and not (what == CONVEX and is_marked(boxes, b, marks, known)):
            count, certain = add_minima(store, posed, box, ends, what, merge_radius, places, extrema, count, work)
            if halve or count == extrema.shape[0] or not certain:
                # There may be one that is not known.
                allowed = low
        waiting = b
        if allowed >= MUCH * reach and allowed >= flank:
            free = min(free, allowed)
            continue
        if allowed < flank:
            # A contact may be born beside one that is near: so far it is excluded.
            sure = min(sure, allowed)
            allowed = flank
        fertile = min(fertile, allowed)
        lo, hi = around_box(store.pool, p if side == 1 else o, box, side, lo, hi)
    if not fertile < math.inf:
        return PairSearch(count, free, fertile, no_ball(), sure)
    d = sub(hi, lo)
    center = scale(0.5, add(lo, hi))
    radius = max(0.5 * math.sqrt(dot(d, d)), rho)
    ball = MotionBall(center=center, place=add(matvec(moving.turn, center), moving.shift), radius=radius)
    return PairSearch(count, free, fertile, ball, sure)
