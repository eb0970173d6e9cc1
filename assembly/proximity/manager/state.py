"""What a contact manager (`proximity/manager/update.py`) knows: its records and its memory, slots for contacts, events.

Its record is in the table of integers, what it knows in a memory of doubles:

    header | of every pair a PAIR_STATE | of every slot a PLACE_STATE | events
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.features.holding import HELD_F
from assembly.proximity.features.solid_contact import (
    pair_parameters,
    tracked_at,
)
from assembly.proximity.manager.extrema import (
    ALIKE,
    BESIDE_CONTACT,
    GIVEN_CONTACT,
    GIVEN_RECORD,
    LISTED,
    MINIMUM_FOUND,
    NEW,
    OF_CONTACT,
    USELESS,
    add_extremum,
    add_given,
    extremum_at,
    given_at,
)
from assembly.proximity.manager.near_singular_points import sunk
from assembly.proximity.manager.overlap import is_outside
from assembly.proximity.manager.wires import both_radii

# The record of a contact manager in the table. Places of the pool and the table are absolute.
MANAGER_DTYPE = record_dtype(
    "i8",
    pairs=1,  # number of pairs of bodies
    places=1,  # number of slots for contacts, of all pairs
    pair_table=1,  # where the records of pairs begin in the table
    first=1,  # row of `tracked` that is the first slot
    track_solids=1,  # address of `features/solid_contact.track_solids`
    lengths=1,  # where its lengths are in the pool
    lists=1,  # number of neighbor lists
    list_table=1,  # where these begin in the table
    corners=1,  # 1: vertex contacts are listed as well (`vertex_contacts.py`)
    clock=1,  # address of what tells the time; 0: updates take as long as they need
    mark_address=1,  # address of `contact_place.mark_places`; 0: no contact's bodies have a least gap above zero
    go_on_address=1,  # address of what says between two parts of a long update whether to go on; 0: nobody is asked
)
manager_at = record_view(MANAGER_DTYPE)
PAIRS = place_of(MANAGER_DTYPE, "pairs")
PLACES = place_of(MANAGER_DTYPE, "places")
PAIR_TABLE = place_of(MANAGER_DTYPE, "pair_table")
FIRST = place_of(MANAGER_DTYPE, "first")
TRACK_SOLIDS = place_of(MANAGER_DTYPE, "track_solids")
LENGTHS = place_of(MANAGER_DTYPE, "lengths")
LISTS = place_of(MANAGER_DTYPE, "lists")
LIST_TABLE = place_of(MANAGER_DTYPE, "list_table")
VERTEX_CONTACTS = place_of(MANAGER_DTYPE, "corners")
CLOCK = place_of(MANAGER_DTYPE, "clock")
MARK_AT = place_of(MANAGER_DTYPE, "mark_address")
WATCH_RECORD = size_of(MANAGER_DTYPE)
# Nanoseconds between two questions whether to go on, and answers: on, to an end with what there is, or nowhere, because
# an exception throws all away.
SLICE = 50_000_000
GOES_ON, ENDS, ABORTED = 0, 1, 2
# The lengths of a contact manager in the pool [over the size of the scene].
LENGTHS_DTYPE = record_dtype(
    "f8",
    neglect=1,  # merge radius: extrema nearer to each other, and along the surfaces, are one
    first_reach=1,  # query margin of a first update, and the least one
    last_reach=1,  # the largest query margin
)
lengths_at = record_view(LENGTHS_DTYPE)
MERGE_RADIUS = place_of(LENGTHS_DTYPE, "neglect")
FIRST_REACH = place_of(LENGTHS_DTYPE, "first_reach")
LAST_REACH = place_of(LENGTHS_DTYPE, "last_reach")
LENGTH_COUNT = size_of(LENGTHS_DTYPE)
# A pair of bodies f and g in the table: two single surfaces, or else two B-rep bodies.
PAIR_DTYPE = record_dtype(
    "i8",
    body_f=1,  # rows of the poses
    body_g=1,
    tree_f=1,  # records of the trees of patches
    tree_g=1,
    surface_f=1,  # records of the surfaces, or -1
    surface_g=1,
    shell_f=1,  # records of the B-rep bodies, or -1
    shell_g=1,
    minimum=1,  # where PAIR_LENGTHS are in the pool
    low=1,  # its slots: the first one
    high=1,  # and the one behind the last
    given=1,  # where the records of given contacts between the two begin (`extrema.py`)
    given_count=1,
    smaller=1,  # which body's motion is measured: 0 f, 1 g, the smaller one
    spine_f=1,  # records of the centerlines of two round wires, or -1
    spine_g=1,
)
pair_at = record_view(PAIR_DTYPE)
PAIR_F = place_of(PAIR_DTYPE, "body_f")
PAIR_G = place_of(PAIR_DTYPE, "body_g")
PAIR_SURFACE_F = place_of(PAIR_DTYPE, "surface_f")
PAIR_SHELL_F = place_of(PAIR_DTYPE, "shell_f")
PAIR_SHELL_G = place_of(PAIR_DTYPE, "shell_g")
PAIR_MINIMUM = place_of(PAIR_DTYPE, "minimum")
LOW = place_of(PAIR_DTYPE, "low")
GIVEN = place_of(PAIR_DTYPE, "given")
GIVEN_COUNT = place_of(PAIR_DTYPE, "given_count")
SMALLER = place_of(PAIR_DTYPE, "smaller")
CENTERLINE_F = place_of(PAIR_DTYPE, "spine_f")
PAIR_RECORD = size_of(PAIR_DTYPE)
# Lengths of a pair in the pool [over the size of the scene]. Where contacts are given the same follow IN_PLACE behind
# with a least gap of zero, for what is in the place of a contact.
PAIR_LENGTHS = record_dtype(
    "f8",
    least=1,  # least gap
    curved_bound=1,  # curvature-limited motion bound: how far it may go between updates where contacts may be born
    offset=2,  # how far facets of f, and of g, are from their surfaces
    far=2,  # how far f, and g, reach from their origins
)
pair_lengths_at = record_view(PAIR_LENGTHS)
IN_PLACE = size_of(PAIR_LENGTHS)
# The header of a memory.
MEMORY_DTYPE = record_dtype(
    "f8",
    event_count=1,  # events so far
    looks=1,  # updates of a pair so far
    born=1,  # contacts so far: the number of the last one
    time=1,  # that of the caller
    crowded=1,  # 1: a near extremum once found no slot
    calls=1,  # calls so far
    deadline=1,  # of a tick with a budget: when an update ends, after the pair that it is at
    earlier=1,  # updates of a pair before that tick
    overlap=1,  # by so much less than the least gap a new contact may stay, as where a solve begins
)
memory_header_at = record_view(MEMORY_DTYPE)
EVENT_COUNT = place_of(MEMORY_DTYPE, "event_count")
LOOKS = place_of(MEMORY_DTYPE, "looks")
CROWDED = place_of(MEMORY_DTYPE, "crowded")
CALLS = place_of(MEMORY_DTYPE, "calls")
DEADLINE = place_of(MEMORY_DTYPE, "deadline")
EARLIER = place_of(MEMORY_DTYPE, "earlier")
OVERLAP = place_of(MEMORY_DTYPE, "overlap")
MEMORY_HEADER = size_of(MEMORY_DTYPE)
# What is known of a pair of bodies since its last update. Motion is that of the smaller body, seen from the other.
PAIR_STATE = record_dtype(
    "f8",
    turn=4,  # how that body was turned, a quaternion; NaN before the first update
    place=3,  # where the middle of its tree was
    allowance=1,  # motion bound: until a point of it went so far, nothing that is not listed can touch
    reach=1,  # query margin
    state=1,  # FAR, NEAR or TRACKING
    called=1,  # calls at the last update
    ball=3,  # motion ball: its middle on the body
    ball_radius=1,
    ball_place=3,  # where its middle was
    ball_allowance=1,  # motion bound of what is in the ball; infinite: there is no ball
    part=1,  # which part of its motion bounds is used
    sure=1,  # how far what is in the ball may go until an accepted pose needs an update, as folds may have contacts
    crossed=1,  # 1: the bodies are in each other where no contact says so; NaN: the last update did not ask
    wanting=1,  # 1: a near extremum found no slot at the last update
    cut_short=1,  # how far a step was to go that was cut since
    doubt=1,  # which part of what accepted poses may go is used
)
pair_state_at = record_view(PAIR_STATE)
TURN = place_of(PAIR_STATE, "turn")
PLACE = place_of(PAIR_STATE, "place")
ALLOWANCE = place_of(PAIR_STATE, "allowance")
REACH = place_of(PAIR_STATE, "reach")
STATE = place_of(PAIR_STATE, "state")
CALLED = place_of(PAIR_STATE, "called")
BALL_ALLOWANCE = place_of(PAIR_STATE, "ball_allowance")
PART = place_of(PAIR_STATE, "part")
SURE = place_of(PAIR_STATE, "sure")
CROSSED = place_of(PAIR_STATE, "crossed")
CUT_SHORT = place_of(PAIR_STATE, "cut_short")
DOUBT = place_of(PAIR_STATE, "doubt")
PAIR_MEMORY = size_of(PAIR_STATE)
FAR, NEAR, TRACKING = 0, 1, 2
# A slot for a contact.
PLACE_STATE = record_dtype(
    "f8",
    pair=1,  # its pair of bodies, or -1: it is free
    number=1,  # number of its contact
    given=1,  # 1: that is in the place of a given contact
)
place_at = record_view(PLACE_STATE)
PLACE_PAIR = place_of(PLACE_STATE, "pair")
PLACE_NUMBER = place_of(PLACE_STATE, "number")
PLACE_MEMORY = size_of(PLACE_STATE)
# An event; the last EVENTS are kept.
EVENT_DTYPE = record_dtype(
    "f8",
    kind=1,  # ADDED, ...
    reason=1,  # CAME_NEAR, ...
    pair=1,  # number of the pair of bodies
    number=1,  # of the contact
    gap=1,  # [over the size of the scene]
    time=1,  # that of the caller
)
event_at = record_view(EVENT_DTYPE)
EVENT, EVENTS = size_of(EVENT_DTYPE), 64
ADDED, REMOVED, HANDED_OFF, MERGED, REFUSED = 0, 1, 2, 3, 4
CAME_NEAR, WENT_AWAY, LOST, SAME_EXTREMUM, NO_PLACE = 0, 1, 2, 3, 4
# Roots nearer than this part of the reach are listed; those that are, stay so up to the second.
TAKE, KEEP = 0.4, 0.8
# Room for roots of a look.
EXTREMA = 96
# A point of a valley that is held goes to its bottom as often as that is lower by more than this.
SUNK = 1e-13
# A given contact goes from a saddle to a minimum that is lower by no more than this.
SHALLOW = 1e-7


@kernel(inline=True)
def memory_places(table, watch):
    """Where pairs, places and events begin in the memory."""
    manager = manager_at(table, watch)
    places = MEMORY_HEADER + PAIR_MEMORY * manager.pairs
    return MEMORY_HEADER, places, places + PLACE_MEMORY * manager.places


@kernel(inner=True)
def note(table, watch, memory, kind, reason, p, number, gap):
    """Write an event into the log."""
    state = memory_header_at(memory, 0)
    event = event_at(memory, memory_places(table, watch)[2] + EVENT * (np.int64(state.event_count) % EVENTS))
    event.kind = float(kind)
    event.reason = float(reason)
    event.pair = float(p)
    event.number = number
    event.gap = gap
    event.time = state.time
    state.event_count += 1.0


@kernel(inner=True)
def any_listed(table, watch, memory, p):
    """Whether pair p has a listed contact."""
    pair = pair_at(table, manager_at(table, watch).pair_table + PAIR_RECORD * p)
    places = memory_places(table, watch)[1]
    for k in range(pair.low, pair.high):
        if place_at(memory, places + PLACE_MEMORY * k).pair == p:
            return True
    return False


@kernel(inner=True)
def any_lost(table, watch, memory, p, tracked):
    """Whether a listed contact of pair p has lost its root."""
    manager = manager_at(table, watch)
    pair = pair_at(table, manager.pair_table + PAIR_RECORD * p)
    places = memory_places(table, watch)[1]
    for k in range(pair.low, pair.high):
        if place_at(memory, places + PLACE_MEMORY * k).pair == p and math.isnan(
            tracked_at(tracked, manager.first + k).parameters[0]
        ):
            return True
    return False


@kernel(inner=True)
def release(table, watch, memory, k, tracked):
    """Make place k free."""
    o = memory_places(table, watch)[1] + PLACE_MEMORY * k
    place_at(memory, o).pair = -1.0
    tracked_at(tracked, manager_at(table, watch).first + k).parameters[0] = math.nan


@kernel(inner=True)
def free_place(table, watch, memory, pair):
    """A place without a contact among those of a pair, or -1."""
    pair_record = pair_at(table, pair)
    places = memory_places(table, watch)[1]
    for k in range(pair_record.low, pair_record.high):
        if place_at(memory, places + PLACE_MEMORY * k).pair < 0.0:
            return k
    return -1


@kernel(inner=True)
def write_extremum(extrema, i, tracked, r):
    """Track root i in row r."""
    extremum = extremum_at(extrema, i)
    pair = tracked_at(tracked, r)
    for k in range(4):
        pair.parameters[k] = extremum.parameters[k]
    pair.feature_f = extremum.code_f
    pair.feature_g = extremum.code_g
    for k in range(3):
        pair.normal[k] = extremum.normal[k]
    pair.gap = extremum.gap
    pair.stays = extremum.corner
    pair.idle = 0.0
    pair.facing = 0.0


@kernel(inner=True)
def is_of_far_sides(store, posed, extrema, k, offsets):
    """Whether root k, with a negative gap, is of sides that are turned away from each other."""
    if posed.centerlines[0] >= 0:
        return extremum_at(extrema, k).gap < -both_radii(store, posed.centerlines)
    return is_outside(store, posed, extrema, k, offsets)


@kernel(inner=True)
def known_extrema(store, watch, memory, p, posed, offsets, tracked, extrema, work):
    """The roots that contacts of pair p have now: given ones, then listed ones.

    A listed contact that lost its root, or came to that of another one or to the far sides, gives up its place. Returns
    how many roots there are, and whether any was lost.
    """
    manager = manager_at(store.table, watch)
    pair = pair_at(store.table, manager.pair_table + PAIR_RECORD * p)
    places = memory_places(store.table, watch)[1]
    merge_radius = lengths_at(store.pool, manager.lengths).neglect
    # A contact that is to close a gap would contradict a clearance that asks for one, where both stood for one root.
    radius = merge_radius if pair_lengths_at(store.pool, pair.minimum).least == 0.0 else math.inf
    many = pair.given_count if posed.surfaces[0] >= 0 else 0
    count = add_given(store, posed, tracked, pair.given, many, radius, extrema, work)
    first, last = pair.low, pair.high
    any_gone = False
    # Roots first, then corners, which give way to them.
    for step in range(2 * (last - first)):
        k = first + step % (last - first)
        slot = place_at(memory, places + PLACE_MEMORY * k)
        r = manager.first + k
        tracked_pair = tracked_at(tracked, r)
        vertex_contact = tracked_pair.stays if tracked_pair.stays > 0.0 else 0.0
        if slot.pair != p or (vertex_contact > 0.0) != (step >= last - first):
            continue
        lost = math.isnan(tracked_pair.parameters[0])
        before = count
        extremum = extremum_at(extrema, before)
        if not lost and count < EXTREMA:
            start = pair_parameters(tracked_pair)
            codes = (np.int64(tracked_pair.feature_f), np.int64(tracked_pair.feature_g))
            n = three_of(tracked_pair.normal)
            if vertex_contact >= HELD_F:
                start = sunk(store, posed, codes, vertex_contact, start)
            count, found = add_extremum(
                store, posed, codes, start, n, merge_radius, extrema, count, work, vertex_contact
            )
            lost = found != ALIKE and found != MINIMUM_FOUND
            if count > before and vertex_contact == 0.0 and extremum.gap < 0.0:
                lost = lost or is_of_far_sides(store, posed, extrema, before, offsets)
        if count > before and not lost:
            extremum.origin = LISTED + k
            if vertex_contact >= HELD_F and extremum.gap < tracked_pair.gap - SUNK:
                # The same contact elsewhere: who solves has to know.
                note(store.table, watch, memory, HANDED_OFF, SAME_EXTREMUM, p, slot.number, extremum.gap)
            write_extremum(extrema, before, tracked, r)
        else:
            # A corner that went past its face is none of these.
            any_gone = any_gone or (lost and vertex_contact == 0.0)
            kind, reason = (HANDED_OFF, LOST) if lost else (MERGED, SAME_EXTREMUM)
            note(store.table, watch, memory, kind, reason, p, slot.number, tracked_pair.gap)
            release(store.table, watch, memory, k, tracked)
    return count, any_gone


@kernel(inline=True)
def gap_beyond(extrema, i, least):
    """By how much root i is farther than its row asks for: in the place of a contact that is nothing."""
    extremum = extremum_at(extrema, i)
    return extremum.gap - (0.0 if extremum.place == BESIDE_CONTACT else least)


@kernel(inner=True)
def release_given(table, watch, memory, p, extrema, count, tracked):
    """Take their places from the roots that are a given contact's own pair, or that came into its place or left it.

    The latter ask for another least gap from now on, and are listed anew.
    """
    places = memory_places(table, watch)[1]
    for i in range(count):
        extremum = extremum_at(extrema, i)
        origin = np.int64(extremum.origin)
        own = extremum.place == OF_CONTACT
        if origin >= LISTED:
            o = place_at(memory, places + PLACE_MEMORY * (origin - LISTED))
            if own or (extremum.place == BESIDE_CONTACT) != (o.given == 1.0):
                kind, reason = (MERGED, SAME_EXTREMUM) if own else (HANDED_OFF, SAME_EXTREMUM)
                note(table, watch, memory, kind, reason, p, o.number, extremum.gap)
                release(table, watch, memory, origin - LISTED, tracked)
                extremum.origin = NEW
        if own and extremum.origin == NEW:
            extremum.origin = USELESS


@kernel(inner=True)
def list_extrema(store, watch, memory, p, extrema, count, tracked):
    """Give places to the near roots of pair p and take them from the far ones.

    Returns by how much the nearest one that is not listed is farther than it has to be, its gap, and whether a place
    was wanting.
    """
    state = memory_header_at(memory, 0)
    manager = manager_at(store.table, watch)
    wanting = False
    pair = manager.pair_table + PAIR_RECORD * p
    at = pair_state_at(memory, memory_places(store.table, watch)[0] + PAIR_MEMORY * p)
    places, reach = memory_places(store.table, watch)[1], at.reach
    least = pair_lengths_at(store.pool, pair_at(store.table, pair).minimum).least
    rest = math.inf
    lowest = math.inf
    for i in range(count):
        origin = np.int64(extremum_at(extrema, i).origin)
        if origin >= LISTED and gap_beyond(extrema, i, least) > KEEP * reach:
            k = origin - LISTED
            number = place_at(memory, places + PLACE_MEMORY * k).number
            note(store.table, watch, memory, REMOVED, WENT_AWAY, p, number, extremum_at(extrema, i).gap)
            release(store.table, watch, memory, k, tracked)
            rest = min(rest, gap_beyond(extrema, i, least))
            lowest = min(lowest, extremum_at(extrema, i).gap)
    # The nearest first, so that it is the far ones for which places may be wanting.
    while True:
        best = -1
        for i in range(count):
            if extremum_at(extrema, i).origin == NEW and (
                best < 0 or gap_beyond(extrema, i, least) < gap_beyond(extrema, best, least)
            ):
                best = i
        if best < 0:
            break
        gap = gap_beyond(extrema, best, least)
        extremum_at(extrema, best).origin = USELESS
        k = free_place(store.table, watch, memory, pair) if gap <= TAKE * reach else -1
        if k < 0:
            rest = min(rest, gap)
            lowest = min(lowest, extremum_at(extrema, best).gap)
            if gap <= TAKE * reach and not wanting:
                wanting = True
                if at.wanting == 0.0:
                    note(store.table, watch, memory, REFUSED, NO_PLACE, p, 0.0, extremum_at(extrema, best).gap)
            continue
        o = place_at(memory, places + PLACE_MEMORY * k)
        o.pair = float(p)
        state.born += 1.0
        o.number = state.born
        o.given = 1.0 if extremum_at(extrema, best).place == BESIDE_CONTACT else 0.0
        write_extremum(extrema, best, tracked, manager.first + k)
        tracked_at(tracked, manager.first + k).allowed = -gap if -state.overlap <= gap < 0.0 else 0.0
        note(store.table, watch, memory, ADDED, CAME_NEAR, p, state.born, extremum_at(extrema, best).gap)
    at.wanting = 1.0 if wanting else 0.0
    return rest, lowest, wanting


@kernel(inner=True)
def minimum_beside(extrema, count, i):
    """The minimum nearest to root i, a saddle, that is hardly lower, or -1."""
    extremum_record = extremum_at(extrema, i)
    best = -1
    least = math.inf
    for k in range(count):
        extremum = extremum_at(extrema, k)
        origin = extremum.origin
        lower = extremum_record.gap - extremum.gap
        if not (origin == NEW or origin >= LISTED) or not extremum.fold > 0.0 or not 0.0 <= lower <= SHALLOW:
            continue
        square = 0.0
        for l in range(3):
            d = extremum_record.point_f[l] - extremum.point_f[l]
            square += d * d
        if square < least:
            best = k
            least = square
    return best


@kernel(inner=True)
def keep_slots_of_given(table, watch, memory, p, extrema, count, tracked):
    """Given contacts of surfaces whose minimum has become a saddle go to one of those that it parted into.

    A contact that stayed would hold the surfaces at the saddle, and they would cross beside it.
    """
    given = pair_at(table, manager_at(table, watch).pair_table + PAIR_RECORD * p).given
    places = memory_places(table, watch)[1]
    for i in range(count):
        extremum = extremum_at(extrema, i)
        if extremum.origin > GIVEN_CONTACT or not extremum.fold < 0.0:
            continue
        k = minimum_beside(extrema, count, i)
        extremum_record = extremum_at(extrema, k)
        if k < 0:
            continue
        c = np.int64(GIVEN_CONTACT - extremum.origin)
        given_record = given_at(table, given + GIVEN_RECORD * c)
        pair = tracked_at(tracked, given_record.row)
        swap = 2 * given_record.swapped
        for l in range(4):
            pair.parameters[l] = extremum_record.parameters[(l + swap) % 4]
        pair.gap = extremum_record.gap
        if extremum_record.origin == NEW:
            note(table, watch, memory, HANDED_OFF, LOST, p, 0.0, extremum_record.gap)
        else:
            place = np.int64(extremum_record.origin) - LISTED
            number = place_at(memory, places + PLACE_MEMORY * place).number
            note(table, watch, memory, MERGED, SAME_EXTREMUM, p, number, extremum_record.gap)
            release(table, watch, memory, place, tracked)
        extremum_record.origin = extremum.origin
        extremum.origin = USELESS
