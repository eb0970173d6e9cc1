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
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, scale, sub
from assembly.proximity.extrema.face_face import pair_frame
from assembly.proximity.manager.centerlines.box import BARREN, CONVEX, EMPTY, UNKNOWN, apart, box_of
from assembly.proximity.manager.centerlines.curve import (
    PART,
    both_radii,
    centerline_at,
    centerline_part_at,
    spine_place,
    spine_point,
    wire_at,
    wire_parameters,
)
from assembly.proximity.manager.centerlines.minima import convex_minimum, valley_minima
from assembly.proximity.manager.extrema import (
    NEW,
    NOTHING,
    SAME,
    USELESS,
    add_root,
    are_one,
    extremum_at,
    write,
)

# Room: boxes that wait, six doubles each (part and lengths of f, then of g).
BOXES, BOX = 2048, 6
# Boxes over half of which no tangent turns by more than this are thin enough for feet to tell.
THIN = 0.025
# So many boxes are halved only because they allow little, down to so many radians.
REFINED, FINE = 16, 0.05
# What may go by more than this part of a reach is not worth a ball.
MUCH = 0.6
# Of a level valley points are contacts that are farther from each other than so many radii.
SPARSE = 0.5
# Slopes of the distance below this say that a known contact is a minimum's.
AT_ROOT = 1e-9
# Newton's method on the surfaces ends at the minimum it began at, if the gap is the same but for this.
ASTRAY = 1e-9
# Spines that are nearer than this cross, and have no direction to each other.
MEETING = 1e-12


@kernel(inline=True)
def open_ends(table, pool, f, g, box):
    """At which free ends of two spines a box is: f's start and end, g's start and end."""
    line = centerline_at(table, f)
    centerline = centerline_at(table, g)
    free_f = line.closed == 0
    free_g = centerline.closed == 0
    i = np.int64(box[0])
    j = np.int64(box[3])
    half_f = centerline_part_at(pool, line.part_pool + PART * i).half
    half_g = centerline_part_at(pool, centerline.part_pool + PART * j).half
    return (
        free_f and i == 0 and box[1] <= -half_f,
        free_f and i == line.parts - 1 and box[2] >= half_f,
        free_g and j == 0 and box[4] <= -half_g,
        free_g and j == centerline.parts - 1 and box[5] >= half_g,
    )


@kernel(inner=True)
def mark_known(table, pool, scene, roots, count, marks):
    """Where on the spines known roots are that are at a minimum: part and length of either; NaN for others."""
    surfaces = scene[2]
    f, g = scene[5]
    for k in range(count):
        i, s = spine_place(table, pool, f, surfaces[0], roots[k, 0], roots[k, 1])
        j, t = spine_place(table, pool, g, surfaces[1], roots[k, 2], roots[k, 3])
        marks[k, 0] = float(i)
        marks[k, 1] = s
        marks[k, 2] = float(j)
        marks[k, 3] = t
        o = centerline_at(table, f).part_pool + PART * i
        p = centerline_at(table, g).part_pool + PART * j
        d, tf, _bend_f, tg, _bend_g = apart(pool, o, p, scene[0], scene[1], s, t)
        if extremum_at(roots, k).origin == USELESS or not abs(dot(d, tf)) + abs(dot(d, tg)) <= AT_ROOT * math.sqrt(
            dot(d, d)
        ):
            # Of far sides, at a half ball, or on its way to a root: what is there is looked for.
            marks[k, 0] = math.nan


@kernel(inner=True)
def is_marked(boxes, b, marks, count):
    """Whether a known root is in box b."""
    for k in range(count):
        if (
            marks[k, 0] == boxes[b, 0]
            and marks[k, 2] == boxes[b, 3]
            and boxes[b, 1] <= marks[k, 1] <= boxes[b, 2]
            and boxes[b, 4] <= marks[k, 3] <= boxes[b, 5]
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
def add_minimum(table, pool, scene, i, j, s, t, neglect, roots, count, work):
    """Add the contact at lengths s and t along parts i and j, if it is none of the known ones. Returns how many."""
    if count == roots.shape[0]:
        return count
    f, g = scene[5]
    o = centerline_at(table, f).part_pool + PART * i
    p = centerline_at(table, g).part_pool + PART * j
    d, tf, _bend_f, tg, _bend_g = apart(pool, o, p, scene[0], scene[1], s, t)
    length = math.sqrt(dot(d, d))
    way = scale(1.0 / length, d) if length >= MEETING else across_both(tf, tg)
    u_f, v_f = wire_parameters(table, pool, f, scene[2][0], i, s, way)
    u_g, v_g = wire_parameters(table, pool, g, scene[2][1], j, t, matvec_t(scene[0], scale(-1.0, way)))
    start = (u_f, v_f, u_g, v_g)
    gap = length - both_radii(table, pool, scene[5])
    before = count
    extremum = extremum_at(roots, before)
    count, found = add_root(table, pool, scene, (0, 0), start, (0.0, 0.0, 0.0), neglect, roots, count, work, 0.0)
    if found == NOTHING or not abs(extremum.gap - gap) <= ASTRAY:
        # At a fold Newton's method may find nothing, or go elsewhere: the minimum is known without it.
        frame = pair_frame(table, pool, scene[2][0], scene[2][1], scene[0], scene[1], start)
        if not frame.regular:
            return before
        write(roots, before, start, 0, 0, frame.normal, frame.gap, frame.point_f, frame.point_g, 0.0)
        for k in range(before):
            radius = min(neglect, SAME) if extremum_at(roots, k).origin == USELESS else neglect
            if are_one(table, pool, scene, roots, before, k, radius):
                return before
        count = before + 1
    if count > before:
        extremum.origin = NEW
    return count


@kernel(inline=True)
def around_box(pool, o, box, side, lo, hi):
    """A box (lo, hi) made larger so that the part of one spine in a box of both is in it."""
    begin, end = (box[1], box[2]) if side == 0 else (box[4], box[5])
    half = 0.5 * (end - begin)
    middle = spine_point(pool, o, begin + half)[0]
    return (
        (min(lo[0], middle[0] - half), min(lo[1], middle[1] - half), min(lo[2], middle[2] - half)),
        (max(hi[0], middle[0] + half), max(hi[1], middle[1] + half), max(hi[2], middle[2] + half)),
    )


@kernel(inline=True)
def halves(boxes, b):
    """Box b is halved along the longer one of its sides; the second half is behind it."""
    at = 1 if boxes[b, 2] - boxes[b, 1] >= boxes[b, 5] - boxes[b, 4] else 4
    middle = 0.5 * (boxes[b, at] + boxes[b, at + 1])
    for m in range(BOX):
        boxes[b + 1, m] = boxes[b, m]
    boxes[b, at + 1] = middle
    boxes[b + 1, at] = middle


@kernel(inner=True)
def add_minima(table, pool, scene, box, ends, what, neglect, places, roots, count, work):
    """Add the minima that a box has. Returns how many roots there are, and whether these are all for certain."""
    f, g = scene[5]
    i = np.int64(box[0])
    j = np.int64(box[3])
    o = centerline_at(table, f).part_pool + PART * i
    p = centerline_at(table, g).part_pool + PART * j
    part = (box[1], box[2], box[4], box[5])
    certain = True
    settled = False
    if what == CONVEX:
        s, t = 0.5 * (box[1] + box[2]), 0.5 * (box[4] + box[5])
        found, s, t, settled = convex_minimum(pool, o, p, scene[0], scene[1], part, ends, s, t)
        if found:
            count = add_minimum(table, pool, scene, i, j, s, t, neglect, roots, count, work)
    if not settled:
        many, level, certain = valley_minima(pool, o, p, scene[0], scene[1], part, ends, places)
        if level:
            # All along it is as good: points here and there stand for it.
            neglect = max(neglect, SPARSE / max(centerline_part_at(pool, o).bend, centerline_part_at(pool, p).bend))
        for m in range(many):
            count = add_minimum(table, pool, scene, i, j, places[m, 0], places[m, 1], neglect, roots, count, work)
    return count, certain


@kernel(inner=True)
def search_spines(table, pool, scene, moving, rho, lengths, neglect, boxes, waiting, rooms, roots, count, work):
    """Look for all contacts of two wires with gaps up to `near`; known ones are the first `count` roots.

    The `lengths` are the least gap asked for, how near is near, the reach, and the flank: how far bodies may go at a
    fold. `moving` is the body that moves. There are `waiting` boxes; within the reach nothing is outside of them. The
    `rooms` are for marks of known roots, and for the minima of a box.

    Returns
    -------
    How many roots there are; how far bodies may go for all that is not in the ball; how far what is in the ball on the
    body that moves may go, infinite if there is none; that ball; how far it may, until a pose that stays is looked at.
    """
    least, near, reach, flank = lengths
    f, g = scene[5]
    line = centerline_at(table, f)
    centerline = centerline_at(table, g)
    side, _tree, _e, turn, shift = moving
    radii = both_radii(table, pool, scene[5]) + least
    sharpest = max(wire_at(pool, line.numbers).sharpest, wire_at(pool, centerline.numbers).sharpest)
    known = count
    marks, places = rooms
    mark_known(table, pool, scene, roots, known, marks)
    free = reach
    fertile = math.inf
    sure = math.inf
    refined = 0
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    while waiting > 0:
        b = waiting - 1
        box = (boxes[b, 0], boxes[b, 1], boxes[b, 2], boxes[b, 3], boxes[b, 4], boxes[b, 5])
        o = line.part_pool + PART * np.int64(box[0])
        p = centerline.part_pool + PART * np.int64(box[3])
        part = (box[1], box[2], box[4], box[5])
        ends = open_ends(table, pool, f, g, box)
        low, what, margin = box_of(pool, o, p, scene[0], scene[1], part, ends, radii + reach, rho)
        low -= radii
        # A minimum that a box may hold, and nobody looks for, is as near as the box.
        hollow = what == EMPTY or what == BARREN
        allowed = max(low, margin) if low <= near or hollow else low
        if allowed >= reach and (low > near or hollow):
            waiting = b
            continue
        bend = 0.5 * max(box[2] - box[1], box[5] - box[4]) * sharpest
        halve = what == UNKNOWN and low <= near and bend > THIN
        if not halve and allowed < flank and refined < REFINED and bend > FINE:
            halve = True
            refined += 1
        if halve and waiting < boxes.shape[0]:
            halves(boxes, b)
            waiting += 1
            continue
        if low <= near and not hollow and not (what == CONVEX and is_marked(boxes, b, marks, known)):
            count, certain = add_minima(table, pool, scene, box, ends, what, neglect, places, roots, count, work)
            if halve or count == roots.shape[0] or not certain:
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
        lo, hi = around_box(pool, p if side == 1 else o, box, side, lo, hi)
    if not fertile < math.inf:
        return count, free, fertile, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0), sure
    d = sub(hi, lo)
    center = scale(0.5, add(lo, hi))
    radius = max(0.5 * math.sqrt(dot(d, d)), rho)
    return count, free, fertile, (center, add(matvec(turn, center), shift), radius), sure
