"""The search of a look (`watch.py`) for contacts of two round wires, by their spines.

Wires touch where the distance of their spines has a minimum, less their radii. Boxes of both, lengths along a piece of
either, are halved until it is known of each how many minima it holds (`spine_box.py`); where that takes boxes that are
all but points, feet tell (`spine_minima.py`). So no contact is missed, and it is known how far bodies may go until
there may be others: what is excluded by a margin stays so for motions that are shorter.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, scale, sub
from assembly.proximity.extremal import pair_frame
from assembly.proximity.roots import GAP, NEW, NOTHING, ORIGIN, add_root, are_one, write
from assembly.proximity.spine_box import BARREN, CONVEX, EMPTY, UNKNOWN, apart, box_of
from assembly.proximity.spine_curve import (
    BALL,
    BALL_RADIUS,
    CLOSED,
    LENGTH,
    NODE_POOL,
    NODE_TABLE,
    NUMBERS,
    PART,
    PART_POOL,
    PIECE,
    PIECE_POOL,
    PIECES,
    SHARPEST,
    both_radii,
    spine_place,
    spine_point,
    three,
    wire_parameters,
)
from assembly.proximity.spine_minima import convex_minimum, valley_minima

# Room: boxes that wait, six doubles each (piece and lengths of f, then of g).
BOXES, BOX = 512, 6
# A box that turns no tangent by more than this, half of it, is thin enough for feet to tell.
THIN = 0.05
# So many boxes are halved only because their margins are small, down to so many radians.
REFINED, FINE = 24, 0.3
# Where bodies may go by less than this part of a flank, they go by a flank, and are looked at wherever they stay.
HASTY = 0.2
# Slopes of F below this say that a known contact is a minimum's.
AT_ROOT = 1e-9
# Newton's method on the surfaces ends at the minimum it began at, if the gap is the same but for this.
ASTRAY = 1e-9
# Spines that are nearer than this cross, and have no direction to each other.
MEETING = 1e-12


@kernel(inline=True)
def open_ends(table, pool, f, g, box):
    """At which free ends of two spines a box is: f's start and end, g's start and end."""
    free_f = table[f + CLOSED] == 0
    free_g = table[g + CLOSED] == 0
    i = np.int64(box[0])
    j = np.int64(box[3])
    last_f = pool[table[f + PIECE_POOL] + PIECE * i + LENGTH]
    last_g = pool[table[g + PIECE_POOL] + PIECE * j + LENGTH]
    return (
        free_f and i == 0 and box[1] <= 0.0,
        free_f and i == table[f + PIECES] - 1 and box[2] >= last_f,
        free_g and j == 0 and box[4] <= 0.0,
        free_g and j == table[g + PIECES] - 1 and box[5] >= last_g,
    )


@kernel(inner=True)
def near_pieces(table, pool, f, g, turn, shift, reach, stack, boxes):
    """Parts of two spines that may be within a reach of each other, as boxes.

    Returns how many, or -1 where there is no room; and a distance which all others are beyond.
    """
    nodes_f = table[f + NODE_POOL]
    nodes_g = table[g + NODE_POOL]
    stack[0, 0] = 0
    stack[0, 1] = 0
    used = 1
    count = 0
    beyond = math.inf
    while used > 0:
        used -= 1
        i = stack[used, 0]
        j = stack[used, 1]
        o = nodes_f + BALL * i
        p = nodes_g + BALL * j
        d = sub(add(matvec(turn, three(pool, p)), shift), three(pool, o))
        radius_f = pool[o + BALL_RADIUS]
        radius_g = pool[p + BALL_RADIUS]
        least = math.sqrt(dot(d, d)) - radius_f - radius_g
        if least > reach:
            beyond = min(beyond, least)
            continue
        child_f = table[table[f + NODE_TABLE] + i]
        child_g = table[table[g + NODE_TABLE] + j]
        if child_f < 0 and child_g < 0:
            if count == boxes.shape[0]:
                return -1, 0.0
            from_f = table[f + PART_POOL] + PART * (-1 - child_f)
            from_g = table[g + PART_POOL] + PART * (-1 - child_g)
            for k in range(PART):
                boxes[count, k] = pool[from_f + k]
                boxes[count, PART + k] = pool[from_g + k]
            count += 1
            continue
        if used + 2 > stack.shape[0]:
            return -1, 0.0
        down_f = child_g < 0 or (child_f >= 0 and radius_f >= radius_g)
        for k in range(2):
            stack[used, 0] = child_f + k if down_f else i
            stack[used, 1] = j if down_f else child_g + k
            used += 1
    return count, beyond


@kernel(inner=True)
def mark_known(table, pool, scene, f, g, roots, count, marks):
    """Where on the spines known roots are that are at a minimum: piece and length of either; NaN for others."""
    surfaces = scene[2]
    for k in range(count):
        i, s = spine_place(table, pool, f, surfaces[0], roots[k, 0], roots[k, 1])
        j, t = spine_place(table, pool, g, surfaces[1], roots[k, 2], roots[k, 3])
        marks[k, 0] = float(i)
        marks[k, 1] = s
        marks[k, 2] = float(j)
        marks[k, 3] = t
        o = table[f + PIECE_POOL] + PIECE * i
        p = table[g + PIECE_POOL] + PIECE * j
        d, tf, _bend_f, tg, _bend_g = apart(pool, o, p, scene[0], scene[1], s, t)
        if not abs(dot(d, tf)) + abs(dot(d, tg)) <= AT_ROOT:
            # At a half ball, or on its way to a root: what is there is looked for.
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


@kernel(inner=True)
def add_minimum(table, pool, scene, f, g, i, j, s, t, neglect, roots, count, work):
    """Add the contact at lengths s and t along pieces i and j, if it is none of the known ones. Returns how many."""
    if count == roots.shape[0]:
        return count
    o = table[f + PIECE_POOL] + PIECE * i
    p = table[g + PIECE_POOL] + PIECE * j
    d, tf, _bend_f, tg, _bend_g = apart(pool, o, p, scene[0], scene[1], s, t)
    length = math.sqrt(dot(d, d))
    if length < MEETING:
        # Any way across both is as good.
        d = cross(tf, tg)
        length = math.sqrt(dot(d, d))
        if not length > 0.0:
            return count
    way = scale(1.0 / length, d)
    u_f, v_f = wire_parameters(table, pool, f, scene[2][0], i, s, way)
    u_g, v_g = wire_parameters(table, pool, g, scene[2][1], j, t, matvec_t(scene[0], scale(-1.0, way)))
    start = (u_f, v_f, u_g, v_g)
    gap = length - both_radii(table, pool, scene[5])
    before = count
    count, found = add_root(table, pool, scene, (0, 0), start, (0.0, 0.0, 0.0), neglect, roots, count, work, 0.0)
    if found == NOTHING or not abs(roots[before, GAP] - gap) <= ASTRAY:
        # At a fold Newton's method may find nothing, or go elsewhere: the minimum is known without it.
        frame = pair_frame(table, pool, scene[2][0], scene[2][1], scene[0], scene[1], start)
        if not frame[11]:
            return before
        write(roots, before, start, 0, 0, frame[0], frame[10], frame[3], frame[4], 0.0)
        for k in range(before):
            if are_one(table, pool, scene, roots, before, k, neglect):
                return before
        count = before + 1
    if count > before:
        roots[before, ORIGIN] = NEW
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


@kernel(inner=True)
def search_spines(
    table, pool, scene, moving, largest, lengths, neglect, roots, count, work, stack, boxes, marks
):
    """Look for all contacts of two wires with gaps up to `near`; known ones are the first `count` roots.

    The `lengths` are the least gap asked for, how near is near, the reach, and the flank: how far bodies may go at a
    fold. `moving` is the body that moves, `largest` the radius of a ball around all of it.

    Returns
    -------
    How many roots there are; how far bodies may go for all that is not in the ball; how far what is in the ball on the
    body that moves may go, infinite if there is none; that ball; whether it holds a fold of a contact that is near;
    whether anything is within reach.
    """
    least, near, reach, flank = lengths
    f, g = scene[5]
    side, _tree, _e, moving_turn, moving_shift = moving
    radii = both_radii(table, pool, scene[5]) + least
    sharpest = max(pool[table[f + NUMBERS] + SHARPEST], pool[table[g + NUMBERS] + SHARPEST])
    rho = min(2.0 * (radii + reach), 0.99 * largest)
    turn, shift = scene[0], scene[1]
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    ball = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
    waiting, beyond = near_pieces(table, pool, f, g, turn, shift, radii + reach, stack, boxes)
    if waiting < 0:
        return count, 0.0, math.inf, ball, False, True
    if waiting == 0:
        return count, max(reach, beyond - radii), math.inf, ball, False, False
    known = count
    mark_known(table, pool, scene, f, g, roots, known, marks)
    free = reach
    fertile = math.inf
    folds = False
    blind = False
    refined = 0
    while waiting > 0:
        waiting -= 1
        box = (
            boxes[waiting, 0],
            boxes[waiting, 1],
            boxes[waiting, 2],
            boxes[waiting, 3],
            boxes[waiting, 4],
            boxes[waiting, 5],
        )
        i = np.int64(box[0])
        j = np.int64(box[3])
        o = table[f + PIECE_POOL] + PIECE * i
        p = table[g + PIECE_POOL] + PIECE * j
        part = (box[1], box[2], box[4], box[5])
        ends = open_ends(table, pool, f, g, box)
        low, what, margin = box_of(pool, o, p, turn, shift, part, ends, rho)
        low -= radii
        # A minimum that a box may hold, and nobody looks for, is as near as the box.
        hollow = what == EMPTY or what == BARREN
        allowed = max(low, margin) if low <= near or hollow else low
        if allowed >= reach and (low > near or hollow):
            continue
        h = 0.5 * (box[2] - box[1])
        k = 0.5 * (box[5] - box[4])
        thin = max(h, k) * sharpest <= 0.5 * THIN
        marked = is_marked(boxes, waiting, marks, known)
        halve = what == UNKNOWN and low <= near and not thin
        if not halve and allowed < near and refined < REFINED and max(h, k) * sharpest > FINE and what != CONVEX:
            halve = True
            refined += 1
        if halve and waiting + 2 <= boxes.shape[0]:
            # The longer one.
            at = 1 if h >= k else 4
            middle = 0.5 * (box[at] + box[at + 1])
            for l in range(2):
                for m in range(BOX):
                    boxes[waiting + l, m] = box[m]
            boxes[waiting, at + 1] = middle
            boxes[waiting + 1, at] = middle
            waiting += 2
            continue
        if low <= near:
            if what == CONVEX and not marked:
                found, s, t = convex_minimum(pool, o, p, turn, shift, part, ends, box[1] + h, box[4] + k)
                if found:
                    count = add_minimum(table, pool, scene, f, g, i, j, s, t, neglect, roots, count, work)
            elif what == UNKNOWN:
                many, first, other, fine = valley_minima(pool, o, p, turn, shift, part, ends)
                if many > 0:
                    count = add_minimum(table, pool, scene, f, g, i, j, first[0], first[1], neglect, roots, count, work)
                if many > 1:
                    count = add_minimum(table, pool, scene, f, g, i, j, other[0], other[1], neglect, roots, count, work)
                blind = blind or not fine
        if allowed < HASTY * flank:
            # Beside a fold of a contact that is near: poses are looked at one by one.
            folds = True
            allowed = flank
        if allowed >= near:
            free = min(free, allowed)
            continue
        fertile = min(fertile, allowed)
        lo, hi = around_box(pool, p if side == 1 else o, box, side, lo, hi)
    if fertile < math.inf:
        d = sub(hi, lo)
        center = scale(0.5, add(lo, hi))
        radius = max(0.5 * math.sqrt(dot(d, d)), rho)
        ball = (center, add(matvec(moving_turn, center), moving_shift), radius)
    return count, free, fertile, ball, folds, True
