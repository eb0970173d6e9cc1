"""The global manager's kernel: which pairs of bodies are looked at, which contacts between them are listed.

Every body carries a tree of patches (`bounding_tree.py`). A look at a pair of bodies descends their trees, finds the
pairs of patches that may hold an extremum of the distance within the pair's reach, and the extrema by Newton's method
(`roots.py`). The near ones are listed: each has a place, from which it is tracked exactly. What is left out is farther
than the pair's allowance: until a point of one body has moved by that much, seen from the other, nothing unlisted can
touch. Where patches face each other and hold no root, a motion may bring one forth; there, a ball around these patches
may move by less. What it knows is in `watch_memory.py`.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, matvec_t, quaternion_matrix, quaternion_product, scale, sub
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.bounding_tree import CENTER, NODE_POOL, RADIUS, least_distance, magnitudes, pairs_within
from assembly.proximity.corners import add_corners
from assembly.proximity.near_root import BARREN, LEFT, PASSED, half_widths, stays
from assembly.proximity.overlap import crosses, is_outside
from assembly.proximity.patch_list import LIST_INTS, listed_pairs
from assembly.proximity.roots import (
    ALIKE,
    CORNER,
    GAP,
    LISTED,
    MINIMUM_FOUND,
    NEW,
    NOTHING,
    ORIGIN,
    ROOT,
    ROOT_FOLD,
    USELESS,
    add_root,
    element_ball,
    element_distance,
    is_alone,
    is_known,
    slide_down,
)
from assembly.proximity.solid_contact import CONTACT_RECORD, PAIR_GAP, STAYS, TRACK
from assembly.proximity.watch_memory import (
    ALLOWANCE,
    BALL,
    BALL_ALLOWANCE,
    BALL_PLACE,
    BALL_RADIUS,
    CALLED,
    CALLS,
    CORNERS,
    CROSSED,
    CROWDED,
    EVENT_COUNT,
    FAR,
    FIRST,
    FIRST_REACH,
    HIGH,
    LAST_REACH,
    LENGTHS,
    LIST_TABLE,
    LISTS,
    LOOKS,
    LOW,
    NEAR,
    NEGLECT,
    PAIR_F,
    PAIR_G,
    PAIR_MEMORY,
    PAIR_MINIMUM,
    PAIR_RECORD,
    PAIR_SHELL_F,
    PAIR_SHELL_G,
    PAIR_SURFACE_F,
    PAIR_SURFACE_G,
    PAIR_TABLE,
    PAIRS,
    PART,
    PLACE,
    PLACE_MEMORY,
    REACH,
    ROOTS,
    STATE,
    TAKE,
    TRACK_SOLIDS,
    TRACKING,
    TREE_F,
    TREE_G,
    TURN,
    URGENT,
    any_lost,
    known_roots,
    list_roots,
    memory_places,
    seat_given,
)

# Looks: at pairs that used up their allowance, at urgent ones too, at all that moved.
AS_NEEDED, EVERYTHING, CAREFUL = 0, 1, 2
# The pair that used most of its allowance is looked at again when that is this part of it; others can wait longer.
USED, SPENT = 0.5, 0.85
# Room: pairs of patches of a look.
CANDIDATES, STACK = 8192, 1024
# Starts that a look leads down the slope of the gap, because Newton's method found no minimum from there.
SLIDES_A_LOOK = 6
# Folds nearer than this part of a first reach are looked at after every move.
FLAT = 0.2
# Ways of Newton's method that are remembered in a look.
WAYS = 64
# So many pairs of patches are looked into, if there are others that are farther apart; in a crowd, all that are nearer
# than this part of what a ball may go where contacts may be born. Less makes looks cheaper and steps shorter.
FEW, CROWDED_PART = 40, 0.5
# Bodies cross that are in each other by more than this.
CROSSING = 1e-6
# Where nothing may move a pair is looked at after every step.
LEAST_ALLOWANCE = 1e-12
# Lists of patches that face each other are for motions up to so many first reaches.
RINGS = 2.0
# A reach is for so many moves as the last ones.
MOVES = 12.0


@kernel(inline=True)
def quaternion_from(q, i, j):
    """The turn of body j seen from body i."""
    return quaternion_product((q[i, 3], -q[i, 4], -q[i, 5], -q[i, 6]), (q[j, 3], q[j, 4], q[j, 5], q[j, 6]))


@kernel(inline=True)
def turned_by(memory, o, e):
    """|e - e'|, 2 sin(a / 4) of the angle a by which a pair turned since its last look, in the memory at o."""
    square = 0.0
    other = 0.0
    for k in range(4):
        square += (e[k] - memory[o + TURN + k]) * (e[k] - memory[o + TURN + k])
        other += (e[k] + memory[o + TURN + k]) * (e[k] + memory[o + TURN + k])
    return math.sqrt(min(square, other))


@kernel(inline=True)
def moved_from(pool_or_memory, at, memory, was, turn, shift):
    """How far a point of g, its place on g and where it was in arrays, is from where it was, seen from f."""
    there = add(matvec(turn, load(pool_or_memory, at)), shift)
    d = sub(there, load(memory, was))
    return math.sqrt(dot(d, d))


@kernel(inline=True)
def load(array, at):
    return (array[at], array[at + 1], array[at + 2])


@kernel(inner=True)
def part_used(table, pool, watch, memory, p, q):
    """Which part of its allowances pair p has used at poses q; infinite before its first look.

    A ball's points went no farther than its middle and 2 r |e - e'|: a turn by an angle a about an axis moves a point
    at a distance r from it by 2 r sin(a / 2), and |e - e'| is 2 sin(a / 4).
    """
    o = memory_places(table, watch)[0] + PAIR_MEMORY * p
    if math.isnan(memory[o + TURN]):
        return math.inf
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    i = table[pair + PAIR_F]
    j = table[pair + PAIR_G]
    e = quaternion_from(q, i, j)
    turn = quaternion_matrix(e[0], e[1], e[2], e[3])
    shift = matvec_t(rotation(q, i), (q[j, 0] - q[i, 0], q[j, 1] - q[i, 1], q[j, 2] - q[i, 2]))
    root = table[table[pair + TREE_G] + NODE_POOL]
    angle = turned_by(memory, o, e)
    moved = moved_from(pool, root + CENTER, memory, o + PLACE, turn, shift) + 2.0 * pool[root + RADIUS] * angle
    if not moved > 0.0:
        return 0.0
    part = moved / memory[o + ALLOWANCE]
    if memory[o + BALL_ALLOWANCE] < memory[o + ALLOWANCE]:
        moved = (
            moved_from(memory, o + BALL, memory, o + BALL_PLACE, turn, shift) + 2.0 * memory[o + BALL_RADIUS] * angle
        )
        part = max(part, moved / memory[o + BALL_ALLOWANCE])
    return part


@kernel(inner=True)
def largest_part(table, pool, watch, memory, q):
    """The pair that used the largest part of its allowances at poses q, and that part."""
    best = -1
    largest = -1.0
    for p in range(table[watch + PAIRS]):
        part = part_used(table, pool, watch, memory, p, q)
        memory[memory_places(table, watch)[0] + PAIR_MEMORY * p + PART] = part
        if part > largest:
            best = p
            largest = part
    return best, largest


@kernel(inner=True)
def near_enough(table, pool, scene, bulk, least, enough, lowest, candidates, found, distances):
    """A distance within which so few of the pairs of patches are that each can be looked into; at most `enough`.

    What is within `lowest`, or in the wrong order, is looked into in any case.
    """
    for c in range(found):
        distances[c] = (
            element_distance(table, pool, scene[3], scene[0], scene[1], bulk, candidates[c, 0], candidates[c, 1])
            - least
        )
    for _ in range(6):
        count = 0
        for c in range(found):
            if -math.inf < distances[c] <= enough:
                count += 1
        if count <= FEW or enough <= lowest:
            break
        enough = max(0.5 * enough, lowest)
    return enough


@kernel(inline=True)
def around(table, pool, tree, e, lo, hi):
    """A box (lo, hi) made larger so that the ball around an element is in it."""
    center, radius = element_ball(table, pool, tree, e)
    return (
        (min(lo[0], center[0] - radius), min(lo[1], center[1] - radius), min(lo[2], center[2] - radius)),
        (max(hi[0], center[0] + radius), max(hi[1], center[1] + radius), max(hi[2], center[2] + radius)),
    )


@kernel(inner=True)
def look_at_pair(
    table, pool, watch, memory, p, q, tracked, stack, candidates, distances, roots, passed, work, thorough
):
    """Find and list the roots of pair p; a `thorough` look tells whether the bodies cross elsewhere."""
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    at = memory_places(table, watch)[0] + PAIR_MEMORY * p
    i = table[pair + PAIR_F]
    j = table[pair + PAIR_G]
    turn, shift = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
    scene = (
        turn,
        shift,
        (
            table[pair + PAIR_SURFACE_F],
            table[pair + PAIR_SURFACE_G],
            table[pair + PAIR_SHELL_F],
            table[pair + PAIR_SHELL_G],
        ),
        (table[pair + TREE_F], table[pair + TREE_G]),
        (i, j, q, table[watch + TRACK_SOLIDS]),
    )
    memory[LOOKS] += 1.0
    least = pool[table[pair + PAIR_MINIMUM]]
    lengths = table[watch + LENGTHS]
    reach = memory[at + REACH]
    e = quaternion_from(q, i, j)
    root = table[table[pair + TREE_G] + NODE_POOL]
    if not math.isnan(memory[at + TURN]):
        pace = moved_from(pool, root + CENTER, memory, at + PLACE, turn, shift)
        pace += 2.0 * pool[root + RADIUS] * turned_by(memory, at, e)
        pace /= max(memory[CALLS] - memory[at + CALLED], 1.0)
        reach = min(max(MOVES * pace, pool[lengths + FIRST_REACH]), pool[lengths + LAST_REACH])
    memory[at + CALLED] = memory[CALLS]
    center = add(matvec(turn, load(pool, root + CENTER)), shift)
    for k in range(4):
        memory[at + TURN + k] = e[k]
    for k in range(3):
        memory[at + PLACE + k] = center[k]
    found = np.int64(-1)
    lists = table[watch + LISTS]
    ring = RINGS * pool[lengths + FIRST_REACH]
    if lists > 0 and reach <= ring:
        at_list = table[watch + LIST_TABLE] + LIST_INTS * (p % lists)
        found = listed_pairs(table, pool, at_list, p, scene[3], turn, shift, e, reach + least, ring, stack, candidates)
    while not 0 <= found <= candidates.shape[0]:
        found = pairs_within(
            table, pool, table[pair + TREE_F], table[pair + TREE_G], turn, shift, reach + least, stack, candidates
        )
        if 0 <= found <= candidates.shape[0]:
            break
        if reach < LEAST_ALLOWANCE:
            # There is no room for what is as near as it should not be.
            found = candidates.shape[0] if found > 0 else 0
            memory[CROWDED] = 1.0
            break
        # Out of room: what is nearer is looked at more often.
        reach *= 0.5
    memory[at + REACH] = reach
    count = known_roots(table, pool, watch, memory, p, scene, tracked, roots, work)
    flank = pool[table[pair + PAIR_MINIMUM] + 1]
    offsets = (pool[table[pair + PAIR_MINIMUM] + 2], pool[table[pair + PAIR_MINIMUM] + 3])
    bulk = magnitudes(turn)
    enough = max(TAKE * reach, flank)
    enough = near_enough(table, pool, scene, bulk, least, enough, CROWDED_PART * flank, candidates, found, distances)
    free = math.inf
    fertile = math.inf
    slides = 0
    visited = 0
    smooth = scene[2][0] >= 0
    folding = False
    for k in range(count):
        folding = folding or not is_alone(roots, k)
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    for c in range(found):
        if count == ROOTS:
            break
        bound = distances[c]
        if bound > flank and bound > enough:
            # Whatever root is there is not near enough for a place, and bounds what the bodies may go;
            free = min(free, bound)
            continue
        if bound > enough:
            # in a crowd, what the ball around it may go.
            fertile = min(fertile, bound)
            lo, hi = around(table, pool, scene[3][1], candidates[c, 1], lo, hi)
            continue
        codes, start, inside, folds = is_known(table, pool, scene, candidates[c, 0], candidates[c, 1], roots, count)
        folding = folding or folds
        if inside:
            continue
        before = count
        stayed, near, half, mine = True, start, (0.0, 0.0, 0.0, 0.0), visited
        if smooth:
            half = half_widths(table, pool, scene[3], candidates[c])
            way, near, visited = stays(table, pool, scene[2], turn, shift, start, half, passed, visited)
            stayed = way != LEFT
            if way >= 0:
                if folding or passed[way, BARREN] == 1.0:
                    fertile = min(fertile, max(bound, flank))
                    lo, hi = around(table, pool, scene[3][1], candidates[c, 1], lo, hi)
                continue
        result = NOTHING
        if stayed or not folding:
            # Where nothing folds, it tells whether it goes to a root that is known.
            count, result = add_root(
                table, pool, scene, codes, near, (0.0, 0.0, 0.0), pool[lengths + NEGLECT], roots, count, work, 0.0
            )
        if count > before:
            folding = folding or not is_alone(roots, before)
        minimum = result == MINIMUM_FOUND or (result == ALIKE and roots[count, ROOT_FOLD] > 0.0)
        if folding and smooth and stayed and not minimum and slides < SLIDES_A_LOOK:
            # Near a fold Newton's method may go to the saddle, past the minimum beside it.
            if count > before:
                before += 1
            slides += 1
            stride = element_ball(table, pool, table[pair + TREE_F], candidates[c, 0])[1]
            start, stayed = slide_down(table, pool, scene[2][0], scene[2][1], turn, shift, start, stride, half)
            if stayed and count < ROOTS:
                count, result = add_root(
                    table, pool, scene, codes, start, (0.0, 0.0, 0.0), pool[lengths + NEGLECT], roots, count, work, 0.0
                )
        if result == ALIKE and not folding:
            # On the slopes around a root that is known.
            continue
        if count == before or result != MINIMUM_FOUND:
            # Patches that face each other and hold no root of their own: a motion may bring one forth.
            fertile = min(fertile, max(bound, flank))
            lo, hi = around(table, pool, scene[3][1], candidates[c, 1], lo, hi)
            if visited > mine:
                passed[mine, BARREN] = 1.0
        else:
            gap = roots[before, GAP]
            # The far sides of two bodies oppose each other, too.
            alien = gap > reach + least or gap < -pool[lengths + LAST_REACH]
            alien = alien or (gap < 0.0 and is_outside(table, pool, scene, roots, before, offsets))
            roots[before, ORIGIN] = USELESS if alien else NEW
    if smooth:
        seat_given(table, watch, memory, p, roots, count, tracked)
    elif table[watch + CORNERS] == 1:
        neglect = pool[lengths + NEGLECT]
        span = (-pool[lengths + FIRST_REACH], reach + least)
        count = add_corners(table, pool, scene, span, offsets, neglect, stack, candidates, roots, count, work)
        for k in range(count):
            place = np.int64(roots[k, ORIGIN])
            if place >= LISTED:
                tracked[table[watch + FIRST] + place - LISTED, STAYS] = roots[k, CORNER]
    rest, wanting = list_roots(table, pool, watch, memory, p, roots, count, tracked)
    listed = 0
    for k in range(table[pair + LOW], table[pair + HIGH]):
        if memory[memory_places(table, watch)[1] + PLACE_MEMORY * k] == p:
            listed += 1
    # What is born at a fold is about as far away as that.
    low = math.inf
    for k in range(count):
        if not is_alone(roots, k) and abs(roots[k, GAP] - least) <= reach:
            low = min(low, max(roots[k, GAP] - least, 0.0))
    urgent = fertile < math.inf and low <= FLAT * pool[lengths + FIRST_REACH]
    if fertile < math.inf and not urgent:
        fertile = min(fertile, low)
    memory[at + BALL_ALLOWANCE] = fertile
    if thorough:
        deep = False
        for k in range(count):
            deep = deep or (roots[k, GAP] < least - CROSSING and roots[k, ORIGIN] != USELESS)
        for k in range(table[pair + LOW], table[pair + HIGH]):
            if memory[memory_places(table, watch)[1] + PLACE_MEMORY * k] == p:
                deep = deep or tracked[table[watch + FIRST] + k, PAIR_GAP] < -CROSSING
        crossed = not deep and crosses(table, pool, scene, stack, candidates, CROSSING, offsets)
        memory[at + CROSSED] = 1.0 if crossed else 0.0
    else:
        memory[at + CROSSED] = math.nan
    memory[at + URGENT] = 1.0 if urgent else 0.0
    if fertile < math.inf:
        d = sub(hi, lo)
        memory[at + BALL_RADIUS] = 0.5 * math.sqrt(dot(d, d))
        center = scale(0.5, add(lo, hi))
        place = add(matvec(turn, center), shift)
        for k in range(3):
            memory[at + BALL + k] = center[k]
            memory[at + BALL_PLACE + k] = place[k]
    if found == 0:
        # Nothing faces the other body within reach: the boxes tell how far that is so.
        trees = scene[3]
        reach = max(reach, least_distance(table, pool, trees[0], trees[1], turn, shift, math.inf, stack) - least)
    memory[at + ALLOWANCE] = max(min(min(reach, rest), free), LEAST_ALLOWANCE)
    memory[at + STATE] = float(TRACKING if listed > 0 else (NEAR if found > 0 else FAR))
    if wanting or count == ROOTS:
        memory[CROWDED] = 1.0


@kernel(inner=True)
def any_crossed(table, watch, memory):
    """Whether bodies were in each other at their last thorough look, where no contact says so."""
    at = memory_places(table, watch)[0]
    for p in range(table[watch + PAIRS]):
        if memory[at + PAIR_MEMORY * p + CROSSED] == 1.0:
            return True
    return False


@kernel
def look(table, pool, watch, memory, q, tracked, how):
    """Look at the pairs of bodies that need it, at urgent ones as well, or at all that moved; list what is near.

    Returns how many events that made. `tracked` has a row for every place (`solid_contact.py`), at the roots of the
    poses q or close by.
    """
    before = memory[EVENT_COUNT]
    memory[CALLS] += 1.0
    ready = False
    stack = np.empty((1, 2), np.int64)
    candidates = stack
    distances = np.empty(1)
    roots = np.empty((1, ROOT))
    passed = np.empty((1, PASSED))
    work = (roots, roots)
    next_pair, _part = largest_part(table, pool, watch, memory, q)
    at = memory_places(table, watch)[0]
    for p in range(table[watch + PAIRS]):
        part = memory[at + PAIR_MEMORY * p + PART]
        if how == EVERYTHING:
            due = part > 0.0 or math.isnan(memory[at + PAIR_MEMORY * p + CROSSED])
        else:
            due = part > SPENT or (p == next_pair and part > USED)
            due = due or (how == CAREFUL and part > 0.0 and memory[at + PAIR_MEMORY * p + URGENT] == 1.0)
        if not due and not any_lost(table, watch, memory, p, tracked):
            continue
        if not ready:
            ready = True
            stack = np.empty((STACK, 2), np.int64)
            candidates = np.empty((CANDIDATES, 2), np.int64)
            distances = np.empty(CANDIDATES)
            roots = np.empty((ROOTS, ROOT))
            passed = np.empty((WAYS, PASSED))
            work = (np.empty((1, CONTACT_RECORD)), np.empty((1, TRACK)))
        thorough = how == EVERYTHING or math.isnan(memory[at + PAIR_MEMORY * p + TURN])
        look_at_pair(
            table, pool, watch, memory, p, q, tracked, stack, candidates, distances, roots, passed, work, thorough
        )
    return np.int64(memory[EVENT_COUNT] - before)
