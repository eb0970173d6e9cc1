"""The global manager's kernel: which pairs of bodies are looked at, which contacts between them are listed.

Every body carries a tree of patches (`bounding_tree.py`). A look at a pair of bodies descends their trees, finds the
pairs of patches that may hold an extremum of the distance within the pair's reach, and the extrema by Newton's method
(`roots.py`). The near ones are listed: each has a place, from which it is tracked exactly. What is left out is farther
than the pair's allowance: until a point of one body has moved by that much, seen from the other, nothing unlisted can
touch. Where patches face each other and hold no root, a motion may bring one forth; there, a ball around these patches
may move by less.

The record of a watch is in the table of integers, what it knows in a memory of doubles:

    header | of every pair PAIR_MEMORY | of every place PLACE_MEMORY | events
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, matvec_t, quaternion_matrix, quaternion_product, scale, sub
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.bounding_tree import CENTER, NODE_POOL, RADIUS, least_distance, magnitudes, pairs_within
from assembly.proximity.roots import (
    ALIKE,
    ALONE,
    CODE_F,
    CODE_G,
    GAP,
    LISTED,
    MINIMUM_FOUND,
    NEW,
    ORIGIN,
    ROOT,
    ROOT_FOLD,
    ROOT_NORMAL,
    USELESS,
    add_given,
    add_root,
    crosses,
    element_ball,
    element_distance,
    is_known,
    is_outside,
    slide_down,
)
from assembly.proximity.solid_contact import CONTACT_RECORD, FEATURE_F, FEATURE_G, PAIR_GAP, PAIR_NORMAL, TRACK

# The record of a watch: counts; where pairs begin; the row of `tracked` that is the first place; address of
# `track_solids`; where its lengths are in the pool.
PAIRS, PLACES, PAIR_TABLE, FIRST, TRACK_SOLIDS, LENGTHS, WATCH_RECORD = 0, 1, 2, 3, 4, 5, 6
# Its lengths: roots nearer to each other than the first, and along the surfaces, are one; the reach of a first look;
# the largest.
NEGLECT, FIRST_REACH, LAST_REACH, LENGTH_COUNT = 0, 1, 2, 3
# A pair: bodies, trees, surfaces or else (-1) shells, where its least gap is in the pool (behind it how far it may
# go between looks where contacts may be born, and how far facets are from their surfaces), its places from and to, and
# rows of given contacts between the two (row, 1 if the bodies are the other way round).
PAIR_F, PAIR_G, TREE_F, TREE_G, PAIR_SURFACE_F, PAIR_SURFACE_G, PAIR_SHELL_F, PAIR_SHELL_G = 0, 1, 2, 3, 4, 5, 6, 7
PAIR_MINIMUM, LOW, HIGH, GIVEN, GIVEN_COUNT, PAIR_RECORD = 8, 9, 10, 11, 12, 13
# Memory. Header: events, looks and contacts so far, the time of the caller, whether a near root ever found no place,
# calls so far.
EVENT_COUNT, LOOKS, BORN, TIME, CROWDED, CALLS, MEMORY_HEADER = 0, 1, 2, 3, 4, 5, 6
# Of a pair: how g was turned, seen from f, at its last look (a quaternion, NaN before there was one), and where the
# middle of its tree was; how far g may go from there, its reach, its state, calls at its last look; a ball on g, where
# its middle was, and how far what is in it may go; which part of its allowances is used; whether it is looked at after
# every move, because a contact may be born at a fold beside one that touches; whether the bodies are in each other
# where no contact says so.
TURN, PLACE, ALLOWANCE, REACH, STATE, CALLED = 0, 4, 7, 8, 9, 10
BALL, BALL_RADIUS, BALL_PLACE, BALL_ALLOWANCE, PART, URGENT, CROSSED, PAIR_MEMORY = 11, 14, 15, 18, 19, 20, 21, 22
FAR, NEAR, TRACKING = 0, 1, 2
# Looks: at pairs that used up their allowance, at urgent ones too, at all that moved.
AS_NEEDED, EVERYTHING, CAREFUL = 0, 1, 2
# Of a place: its pair (-1: none), the number of its contact.
PLACE_PAIR, PLACE_NUMBER, PLACE_MEMORY = 0, 1, 2
# An event: kind, reason, pair, number of the contact, gap, time. The last so many are kept.
EVENT, EVENTS = 6, 64
ADDED, REMOVED, HANDED_OFF, MERGED = 0, 1, 2, 3
CAME_NEAR, WENT_AWAY, LOST, SAME_ROOT, NO_PLACE = 0, 1, 2, 3, 4
# The pair that used most of its allowance is looked at again when that is this part of it; others can wait longer.
USED, SPENT = 0.5, 0.85
# Roots nearer than this part of the reach are listed; those that are, stay so up to the second.
TAKE, KEEP = 0.4, 0.8
# Room: pairs of patches of a look, roots.
CANDIDATES, ROOTS, STACK = 8192, 96, 1024
# Starts that a look leads down the slope of the gap, because Newton's method found no minimum from there.
SLIDES_A_LOOK = 6
# So many pairs of patches are looked into, if there are others that are farther apart.
FEW = 40
# Bodies cross that are in each other by more than this.
CROSSING = 1e-6
# Where nothing may move a pair is looked at after every step.
LEAST_ALLOWANCE = 1e-12
# A reach is for so many moves as the last ones.
MOVES = 12.0


@kernel(inline=True)
def memory_places(table, watch):
    """Where pairs, places and events begin in the memory."""
    places = MEMORY_HEADER + PAIR_MEMORY * table[watch + PAIRS]
    return MEMORY_HEADER, places, places + PLACE_MEMORY * table[watch + PLACES]


@kernel(inner=True)
def note(table, watch, memory, kind, reason, p, number, gap):
    """Write an event into the log."""
    at = memory_places(table, watch)[2] + EVENT * (np.int64(memory[EVENT_COUNT]) % EVENTS)
    memory[at] = float(kind)
    memory[at + 1] = float(reason)
    memory[at + 2] = float(p)
    memory[at + 3] = number
    memory[at + 4] = gap
    memory[at + 5] = memory[TIME]
    memory[EVENT_COUNT] += 1.0


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
def any_lost(table, watch, memory, p, tracked):
    """Whether a listed contact of pair p has lost its root."""
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    places = memory_places(table, watch)[1]
    for k in range(table[pair + LOW], table[pair + HIGH]):
        if memory[places + PLACE_MEMORY * k] == p and math.isnan(tracked[table[watch + FIRST] + k, 0]):
            return True
    return False


@kernel(inner=True)
def release(table, watch, memory, k, tracked):
    """Make place k free."""
    o = memory_places(table, watch)[1] + PLACE_MEMORY * k
    memory[o + PLACE_PAIR] = -1.0
    tracked[table[watch + FIRST] + k, 0] = math.nan


@kernel(inner=True)
def free_place(table, watch, memory, pair):
    """A place without a contact among those of a pair, or -1."""
    places = memory_places(table, watch)[1]
    for k in range(table[pair + LOW], table[pair + HIGH]):
        if memory[places + PLACE_MEMORY * k] < 0.0:
            return k
    return -1


@kernel(inner=True)
def write_root(roots, i, tracked, r):
    """Track root i in row r."""
    for k in range(4):
        tracked[r, k] = roots[i, k]
    tracked[r, FEATURE_F] = roots[i, CODE_F]
    tracked[r, FEATURE_G] = roots[i, CODE_G]
    for k in range(3):
        tracked[r, PAIR_NORMAL + k] = roots[i, ROOT_NORMAL + k]
    tracked[r, PAIR_GAP] = roots[i, GAP]


@kernel(inner=True)
def known_roots(table, pool, watch, memory, p, scene, tracked, roots, work):
    """The roots that contacts of pair p have now: given ones, then listed ones. Returns how many roots there are.

    A listed contact that lost its root, or came to that of another one, gives up its place.
    """
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    places = memory_places(table, watch)[1]
    count = add_given(table, pool, scene, tracked, table[pair + GIVEN], table[pair + GIVEN_COUNT], roots, work)
    for k in range(table[pair + LOW], table[pair + HIGH]):
        o = places + PLACE_MEMORY * k
        if memory[o] != p:
            continue
        r = table[watch + FIRST] + k
        lost = math.isnan(tracked[r, 0])
        before = count
        if not lost and count < ROOTS:
            start = (tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3])
            codes = (np.int64(tracked[r, FEATURE_F]), np.int64(tracked[r, FEATURE_G]))
            n = (tracked[r, PAIR_NORMAL], tracked[r, PAIR_NORMAL + 1], tracked[r, PAIR_NORMAL + 2])
            neglect = pool[table[watch + LENGTHS] + NEGLECT]
            count, found = add_root(table, pool, scene, codes, start, n, neglect, roots, count, work)
            lost = found != ALIKE and found != MINIMUM_FOUND
        if count > before and not lost:
            roots[before, ORIGIN] = LISTED + k
            write_root(roots, before, tracked, r)
        else:
            kind, reason = (HANDED_OFF, LOST) if lost else (MERGED, SAME_ROOT)
            note(table, watch, memory, kind, reason, p, memory[o + PLACE_NUMBER], tracked[r, PAIR_GAP])
            release(table, watch, memory, k, tracked)
    return count


@kernel(inner=True)
def list_roots(table, pool, watch, memory, p, roots, count, tracked):
    """Give places to the near roots of pair p and take them from the far ones.

    Returns the least gap that is not listed, and whether a place was wanting.
    """
    wanting = False
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    places, reach = memory_places(table, watch)[1], memory[memory_places(table, watch)[0] + PAIR_MEMORY * p + REACH]
    least = pool[table[pair + PAIR_MINIMUM]]
    rest = math.inf
    for i in range(count):
        origin = np.int64(roots[i, ORIGIN])
        if origin >= LISTED and roots[i, GAP] - least > KEEP * reach:
            k = origin - LISTED
            number = memory[places + PLACE_MEMORY * k + PLACE_NUMBER]
            note(table, watch, memory, REMOVED, WENT_AWAY, p, number, roots[i, GAP])
            release(table, watch, memory, k, tracked)
            rest = min(rest, roots[i, GAP] - least)
    # The nearest first, so that it is the far ones for which places may be wanting.
    while True:
        best = -1
        for i in range(count):
            if roots[i, ORIGIN] == NEW and (best < 0 or roots[i, GAP] < roots[best, GAP]):
                best = i
        if best < 0:
            break
        gap = roots[best, GAP] - least
        roots[best, ORIGIN] = USELESS
        k = free_place(table, watch, memory, pair) if gap <= TAKE * reach else -1
        if k < 0:
            rest = min(rest, gap)
            wanting = wanting or gap <= TAKE * reach
            continue
        o = places + PLACE_MEMORY * k
        memory[o + PLACE_PAIR] = float(p)
        memory[BORN] += 1.0
        memory[o + PLACE_NUMBER] = memory[BORN]
        write_root(roots, best, tracked, table[watch + FIRST] + k)
        note(table, watch, memory, ADDED, CAME_NEAR, p, memory[BORN], roots[best, GAP])
    return rest, wanting


@kernel(inner=True)
def near_enough(table, pool, scene, bulk, least, enough, candidates, found, distances):
    """A distance within which so few of the pairs of patches are that each can be looked into; at most `enough`."""
    for c in range(found):
        distances[c] = (
            element_distance(table, pool, scene[3], scene[0], scene[1], bulk, candidates[c, 0], candidates[c, 1])
            - least
        )
    for _ in range(6):
        count = 0
        for c in range(found):
            if distances[c] <= enough:
                count += 1
        if count <= FEW:
            break
        enough *= 0.5
    return enough


@kernel(inner=True)
def look_at_pair(table, pool, watch, memory, p, q, tracked, stack, candidates, distances, roots, work, thorough):
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
    while True:
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
    margin = pool[table[pair + PAIR_MINIMUM] + 2]
    bulk = magnitudes(turn)
    enough = near_enough(table, pool, scene, bulk, least, max(TAKE * reach, flank), candidates, found, distances)
    free = math.inf
    fertile = math.inf
    slides = 0
    folding = False
    for k in range(count):
        folding = folding or not roots[k, ROOT_FOLD] > ALONE
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    for c in range(found):
        if count == ROOTS:
            break
        bound = distances[c]
        if bound > enough and bound > flank:
            # Whatever root is there is not near enough for a place.
            free = min(free, bound)
            continue
        if bound > enough:
            fertile = flank
            center, radius = element_ball(table, pool, table[pair + TREE_G], candidates[c, 1])
            lo = (min(lo[0], center[0] - radius), min(lo[1], center[1] - radius), min(lo[2], center[2] - radius))
            hi = (max(hi[0], center[0] + radius), max(hi[1], center[1] + radius), max(hi[2], center[2] + radius))
            continue
        codes, start, inside = is_known(table, pool, scene, candidates[c, 0], candidates[c, 1], roots, count)
        if inside:
            continue
        before = count
        count, result = add_root(
            table, pool, scene, codes, start, (0.0, 0.0, 0.0), pool[lengths + NEGLECT], roots, count, work
        )
        if count > before:
            folding = folding or not roots[before, ROOT_FOLD] > ALONE
        if folding and scene[2][0] >= 0 and slides < SLIDES_A_LOOK and (count == before or result != MINIMUM_FOUND):
            # Near a fold Newton's method may go to the saddle, past the minimum beside it.
            if count > before:
                before += 1
            slides += 1
            stride = element_ball(table, pool, table[pair + TREE_F], candidates[c, 0])[1]
            start = slide_down(table, pool, scene[2][0], scene[2][1], turn, shift, start, stride)
            if count < ROOTS:
                count, result = add_root(
                    table, pool, scene, codes, start, (0.0, 0.0, 0.0), pool[lengths + NEGLECT], roots, count, work
                )
        if result == ALIKE and not folding:
            # On the slopes around a root that is known.
            continue
        if count == before or result != MINIMUM_FOUND:
            # Patches that face each other and hold no root of their own: a motion may bring one forth.
            fertile = min(fertile, max(bound, flank))
            center, radius = element_ball(table, pool, table[pair + TREE_G], candidates[c, 1])
            lo = (min(lo[0], center[0] - radius), min(lo[1], center[1] - radius), min(lo[2], center[2] - radius))
            hi = (max(hi[0], center[0] + radius), max(hi[1], center[1] + radius), max(hi[2], center[2] + radius))
        else:
            gap = roots[before, GAP]
            # The far sides of two bodies oppose each other, too.
            alien = abs(gap) > reach + least or (gap < 0.0 and is_outside(table, pool, scene, roots, before, margin))
            roots[before, ORIGIN] = USELESS if alien else NEW
    rest, wanting = list_roots(table, pool, watch, memory, p, roots, count, tracked)
    listed = 0
    for k in range(table[pair + LOW], table[pair + HIGH]):
        if memory[memory_places(table, watch)[1] + PLACE_MEMORY * k] == p:
            listed += 1
    memory[at + BALL_ALLOWANCE] = fertile
    if thorough:
        deep = False
        for k in range(count):
            deep = deep or (roots[k, GAP] < least and roots[k, ORIGIN] != USELESS)
        for k in range(table[pair + LOW], table[pair + HIGH]):
            if memory[memory_places(table, watch)[1] + PLACE_MEMORY * k] == p:
                deep = deep or tracked[table[watch + FIRST] + k, PAIR_GAP] < 0.0
        crossed = not deep and crosses(table, pool, scene, stack, candidates, CROSSING)
        memory[at + CROSSED] = 1.0 if crossed else 0.0
    memory[at + URGENT] = 1.0 if folding and fertile < math.inf else 0.0
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
    work = (roots, roots)
    next_pair, _part = largest_part(table, pool, watch, memory, q)
    at = memory_places(table, watch)[0]
    for p in range(table[watch + PAIRS]):
        part = memory[at + PAIR_MEMORY * p + PART]
        if how == EVERYTHING:
            due = part > 0.0
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
            work = (np.empty((1, CONTACT_RECORD)), np.empty((1, TRACK)))
        thorough = how == EVERYTHING or math.isnan(memory[at + PAIR_MEMORY * p + TURN])
        look_at_pair(table, pool, watch, memory, p, q, tracked, stack, candidates, distances, roots, work, thorough)
    return np.int64(memory[EVENT_COUNT] - before)
