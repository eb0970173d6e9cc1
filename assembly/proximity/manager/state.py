"""What a watch (`proximity/manager/update.py`) knows: the layout of its record and its memory, places for contacts, and
the log.

The record of a watch is in the table of integers, what it knows in a memory of doubles:

    header | of every pair PAIR_MEMORY | of every place PLACE_MEMORY | events
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.proximity.features.holding import HELD_F
from assembly.proximity.features.solid_contact import ALLOWED, FEATURE_F, FEATURE_G, IDLE, PAIR_GAP, PAIR_NORMAL, STAYS
from assembly.proximity.manager.centerlines.curve import both_radii
from assembly.proximity.manager.extrema import (
    ALIKE,
    BESIDE_CONTACT,
    CODE_F,
    CODE_G,
    CORNER,
    GAP,
    GIVEN_CONTACT,
    GIVEN_RECORD,
    GIVEN_ROW,
    LISTED,
    MINIMUM_FOUND,
    NEW,
    OF_CONTACT,
    ORIGIN,
    POINT_F,
    ROOT_FOLD,
    ROOT_NORMAL,
    ROOT_PLACE,
    SWAPPED,
    USELESS,
    add_given,
    add_root,
)
from assembly.proximity.manager.near_singular_points import sunk
from assembly.proximity.manager.overlap import is_outside

# The record of a watch: counts; where pairs begin; the row of `tracked` that is the first place; address of
# `track_solids`; where its lengths are in the pool; how many lists there are, where they begin; whether corners are
# listed (`proximity/manager/vertex_contacts.py`); address of what tells the time, 0 where looks have as much as they
# need; address of
# `mark_places` (`contact_place.py`), 0 where no contact's bodies have a least gap above zero; address of what says
# between two parts of a long look whether it is to go on, 0 where nobody is asked.
PAIRS, PLACES, PAIR_TABLE, FIRST, TRACK_SOLIDS, LENGTHS, LISTS, LIST_TABLE = 0, 1, 2, 3, 4, 5, 6, 7
CORNERS, CLOCK, MARK_AT, GO_ON_AT, WATCH_RECORD = 8, 9, 10, 11, 12
# Nanoseconds between two questions whether to go on, and answers: on, to an end with what there is, or nowhere, because
# an exception throws all away.
SLICE = 50_000_000
GOES_ON, ENDS, ABORTED = 0, 1, 2
# Its lengths: roots nearer to each other than the first, and along the surfaces, are one; the reach of a first look;
# the largest.
NEGLECT, FIRST_REACH, LAST_REACH, LENGTH_COUNT = 0, 1, 2, 3
# A pair: bodies, trees, surfaces or else (-1) shells, where its least gap is in the pool (behind it how far it may
# go between looks where contacts may be born, how far facets of either are from their surfaces, and how far either
# reaches from its origin; behind these the same with a least gap of zero, for what is in the place of a contact), its
# places from and to, given contacts between the two (`extrema.py`), whether it is f (0) or g (1) that is the smaller
# one, and the spines of two round wires (-1: others).
PAIR_F, PAIR_G, TREE_F, TREE_G, PAIR_SURFACE_F, PAIR_SURFACE_G, PAIR_SHELL_F, PAIR_SHELL_G = 0, 1, 2, 3, 4, 5, 6, 7
PAIR_MINIMUM, LOW, HIGH, GIVEN, GIVEN_COUNT, SMALLER, SPINE_F, SPINE_G, PAIR_RECORD = 8, 9, 10, 11, 12, 13, 14, 15, 16
# How far behind a pair's least gap that of zero is.
IN_PLACE = 6
# Memory. Header: events, looks and contacts so far, the time of the caller, whether a near root ever found no place,
# calls so far; of a tick with a budget, when a look is to end after the pair that it is at, and how many looks there
# were before it; what bodies may be in each other and still touch: by so much less than the least gap a new contact may
# stay, as where a solve begins.
EVENT_COUNT, LOOKS, BORN, TIME, CROWDED, CALLS, DEADLINE, EARLIER, OVERLAP, MEMORY_HEADER = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
# Of a pair: how the smaller body was turned, seen from the other, at its last look (a quaternion, NaN before there was
# one), and where the middle of its tree was; how far it may go from there, its reach, its state, calls at its last
# look; a ball on it, where its middle was, and how far what is in it may go; which part of its allowances is used;
# how far what is in the ball may go until a pose that stays is looked at, because a contact may be born at a fold
# beside one that touches; whether the bodies are in each other where no contact says so (NaN: its last look did not
# ask); whether a near root found no place at the last look; how far a step was to go that was cut since; which part of
# what poses that stay may go is used.
TURN, PLACE, ALLOWANCE, REACH, STATE, CALLED = 0, 4, 7, 8, 9, 10
BALL, BALL_RADIUS, BALL_PLACE, BALL_ALLOWANCE, PART, SURE, CROSSED, WANTING, CUT_SHORT, DOUBT, PAIR_MEMORY = (
    11, 14, 15, 18, 19, 20, 21, 22, 23, 24, 25
)  # fmt: skip
FAR, NEAR, TRACKING = 0, 1, 2
# Of a place: its pair (-1: none), the number of its contact, and 1 where that is in the place of a given contact.
PLACE_PAIR, PLACE_NUMBER, PLACE_GIVEN, PLACE_MEMORY = 0, 1, 2, 3
# An event: kind, reason, pair, number of the contact, gap, time. The last so many are kept.
EVENT, EVENTS = 6, 64
ADDED, REMOVED, HANDED_OFF, MERGED, REFUSED = 0, 1, 2, 3, 4
CAME_NEAR, WENT_AWAY, LOST, SAME_ROOT, NO_PLACE = 0, 1, 2, 3, 4
# Roots nearer than this part of the reach are listed; those that are, stay so up to the second.
TAKE, KEEP = 0.4, 0.8
# Room for roots of a look.
ROOTS = 96
# A point of a valley that is held goes to its bottom as often as that is lower by more than this.
SUNK = 1e-13
# A given contact goes from a saddle to a minimum that is lower by no more than this.
SHALLOW = 1e-7


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


@kernel(inner=True)
def any_listed(table, watch, memory, p):
    """Whether pair p has a listed contact."""
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    places = memory_places(table, watch)[1]
    for k in range(table[pair + LOW], table[pair + HIGH]):
        if memory[places + PLACE_MEMORY * k] == p:
            return True
    return False


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
    tracked[r, STAYS] = roots[i, CORNER]
    tracked[r, IDLE] = 0.0


@kernel(inner=True)
def is_of_far_sides(table, pool, scene, roots, k, offsets):
    """Whether root k, with a negative gap, is of sides that are turned away from each other."""
    if scene[5][0] >= 0:
        return roots[k, GAP] < -both_radii(table, pool, scene[5])
    return is_outside(table, pool, scene, roots, k, offsets)


@kernel(inner=True)
def known_roots(table, pool, watch, memory, p, scene, offsets, tracked, roots, work):
    """The roots that contacts of pair p have now: given ones, then listed ones.

    A listed contact that lost its root, or came to that of another one or to the far sides, gives up its place. Returns
    how many roots there are, and whether any was lost.
    """
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    places = memory_places(table, watch)[1]
    neglect = pool[table[watch + LENGTHS] + NEGLECT]
    # A contact that is to close a gap would contradict a clearance that asks for one, where both stood for one root.
    radius = neglect if pool[table[pair + PAIR_MINIMUM]] == 0.0 else math.inf
    many = table[pair + GIVEN_COUNT] if scene[2][0] >= 0 else 0
    count = add_given(table, pool, scene, tracked, table[pair + GIVEN], many, radius, roots, work)
    first, last = table[pair + LOW], table[pair + HIGH]
    any_gone = False
    # Roots first, then corners, which give way to them.
    for step in range(2 * (last - first)):
        k = first + step % (last - first)
        o = places + PLACE_MEMORY * k
        r = table[watch + FIRST] + k
        corner = tracked[r, STAYS] if tracked[r, STAYS] > 0.0 else 0.0
        if memory[o] != p or (corner > 0.0) != (step >= last - first):
            continue
        lost = math.isnan(tracked[r, 0])
        before = count
        if not lost and count < ROOTS:
            start = (tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3])
            codes = (np.int64(tracked[r, FEATURE_F]), np.int64(tracked[r, FEATURE_G]))
            n = (tracked[r, PAIR_NORMAL], tracked[r, PAIR_NORMAL + 1], tracked[r, PAIR_NORMAL + 2])
            if corner >= HELD_F:
                start = sunk(table, pool, scene, codes, corner, start)
            count, found = add_root(table, pool, scene, codes, start, n, neglect, roots, count, work, corner)
            lost = found != ALIKE and found != MINIMUM_FOUND
            if count > before and corner == 0.0 and roots[before, GAP] < 0.0:
                lost = lost or is_of_far_sides(table, pool, scene, roots, before, offsets)
        if count > before and not lost:
            roots[before, ORIGIN] = LISTED + k
            if corner >= HELD_F and roots[before, GAP] < tracked[r, PAIR_GAP] - SUNK:
                # The same contact elsewhere: who solves has to know.
                note(table, watch, memory, HANDED_OFF, SAME_ROOT, p, memory[o + PLACE_NUMBER], roots[before, GAP])
            write_root(roots, before, tracked, r)
        else:
            # A corner that went past its face is none of these.
            any_gone = any_gone or (lost and corner == 0.0)
            kind, reason = (HANDED_OFF, LOST) if lost else (MERGED, SAME_ROOT)
            note(table, watch, memory, kind, reason, p, memory[o + PLACE_NUMBER], tracked[r, PAIR_GAP])
            release(table, watch, memory, k, tracked)
    return count, any_gone


@kernel(inline=True)
def gap_beyond(roots, i, least):
    """By how much root i is farther than its row asks for: in the place of a contact that is nothing."""
    return roots[i, GAP] - (0.0 if roots[i, ROOT_PLACE] == BESIDE_CONTACT else least)


@kernel(inner=True)
def release_given(table, watch, memory, p, roots, count, tracked):
    """Take their places from the roots that are a given contact's own pair, or that came into its place or left it.

    The latter ask for another least gap from now on, and are listed anew.
    """
    places = memory_places(table, watch)[1]
    for i in range(count):
        origin = np.int64(roots[i, ORIGIN])
        own = roots[i, ROOT_PLACE] == OF_CONTACT
        if origin >= LISTED:
            o = places + PLACE_MEMORY * (origin - LISTED)
            if own or (roots[i, ROOT_PLACE] == BESIDE_CONTACT) != (memory[o + PLACE_GIVEN] == 1.0):
                kind, reason = (MERGED, SAME_ROOT) if own else (HANDED_OFF, SAME_ROOT)
                note(table, watch, memory, kind, reason, p, memory[o + PLACE_NUMBER], roots[i, GAP])
                release(table, watch, memory, origin - LISTED, tracked)
                roots[i, ORIGIN] = NEW
        if own and roots[i, ORIGIN] == NEW:
            roots[i, ORIGIN] = USELESS


@kernel(inner=True)
def list_roots(table, pool, watch, memory, p, roots, count, tracked):
    """Give places to the near roots of pair p and take them from the far ones.

    Returns by how much the nearest one that is not listed is farther than it has to be, its gap, and whether a place
    was wanting.
    """
    wanting = False
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    at = memory_places(table, watch)[0] + PAIR_MEMORY * p
    places, reach = memory_places(table, watch)[1], memory[at + REACH]
    least = pool[table[pair + PAIR_MINIMUM]]
    rest = math.inf
    lowest = math.inf
    for i in range(count):
        origin = np.int64(roots[i, ORIGIN])
        if origin >= LISTED and gap_beyond(roots, i, least) > KEEP * reach:
            k = origin - LISTED
            number = memory[places + PLACE_MEMORY * k + PLACE_NUMBER]
            note(table, watch, memory, REMOVED, WENT_AWAY, p, number, roots[i, GAP])
            release(table, watch, memory, k, tracked)
            rest = min(rest, gap_beyond(roots, i, least))
            lowest = min(lowest, roots[i, GAP])
    # The nearest first, so that it is the far ones for which places may be wanting.
    while True:
        best = -1
        for i in range(count):
            if roots[i, ORIGIN] == NEW and (best < 0 or gap_beyond(roots, i, least) < gap_beyond(roots, best, least)):
                best = i
        if best < 0:
            break
        gap = gap_beyond(roots, best, least)
        roots[best, ORIGIN] = USELESS
        k = free_place(table, watch, memory, pair) if gap <= TAKE * reach else -1
        if k < 0:
            rest = min(rest, gap)
            lowest = min(lowest, roots[best, GAP])
            if gap <= TAKE * reach and not wanting:
                wanting = True
                if memory[at + WANTING] == 0.0:
                    note(table, watch, memory, REFUSED, NO_PLACE, p, 0.0, roots[best, GAP])
            continue
        o = places + PLACE_MEMORY * k
        memory[o + PLACE_PAIR] = float(p)
        memory[BORN] += 1.0
        memory[o + PLACE_NUMBER] = memory[BORN]
        memory[o + PLACE_GIVEN] = 1.0 if roots[best, ROOT_PLACE] == BESIDE_CONTACT else 0.0
        write_root(roots, best, tracked, table[watch + FIRST] + k)
        tracked[table[watch + FIRST] + k, ALLOWED] = -gap if -memory[OVERLAP] <= gap < 0.0 else 0.0
        note(table, watch, memory, ADDED, CAME_NEAR, p, memory[BORN], roots[best, GAP])
    memory[at + WANTING] = 1.0 if wanting else 0.0
    return rest, lowest, wanting


@kernel(inner=True)
def minimum_beside(roots, count, i):
    """The minimum nearest to root i, a saddle, that is hardly lower, or -1."""
    best = -1
    least = math.inf
    for k in range(count):
        origin = roots[k, ORIGIN]
        lower = roots[i, GAP] - roots[k, GAP]
        if not (origin == NEW or origin >= LISTED) or not roots[k, ROOT_FOLD] > 0.0 or not 0.0 <= lower <= SHALLOW:
            continue
        square = 0.0
        for l in range(3):
            d = roots[i, POINT_F + l] - roots[k, POINT_F + l]
            square += d * d
        if square < least:
            best = k
            least = square
    return best


@kernel(inner=True)
def seat_given(table, watch, memory, p, roots, count, tracked):
    """Given contacts of surfaces whose minimum has become a saddle go to one of those that it parted into.

    A contact that stayed would hold the surfaces at the saddle, and they would cross beside it.
    """
    given = table[table[watch + PAIR_TABLE] + PAIR_RECORD * p + GIVEN]
    places = memory_places(table, watch)[1]
    for i in range(count):
        if roots[i, ORIGIN] > GIVEN_CONTACT or not roots[i, ROOT_FOLD] < 0.0:
            continue
        k = minimum_beside(roots, count, i)
        if k < 0:
            continue
        c = np.int64(GIVEN_CONTACT - roots[i, ORIGIN])
        r = table[given + GIVEN_RECORD * c + GIVEN_ROW]
        swap = 2 * table[given + GIVEN_RECORD * c + SWAPPED]
        for l in range(4):
            tracked[r, l] = roots[k, (l + swap) % 4]
        tracked[r, PAIR_GAP] = roots[k, GAP]
        if roots[k, ORIGIN] == NEW:
            note(table, watch, memory, HANDED_OFF, LOST, p, 0.0, roots[k, GAP])
        else:
            place = np.int64(roots[k, ORIGIN]) - LISTED
            number = memory[places + PLACE_MEMORY * place + PLACE_NUMBER]
            note(table, watch, memory, MERGED, SAME_ROOT, p, number, roots[k, GAP])
            release(table, watch, memory, place, tracked)
        roots[k, ORIGIN] = roots[i, ORIGIN]
        roots[i, ORIGIN] = USELESS
