"""An update of the contact manager: which pairs of bodies are searched, and which of their contacts are listed.

Every body carries a tree of patches (`proximity/bvh/tree.py`). An update at a pair of bodies descends their trees,
finds the pairs of patches that may hold an extremum of the distance within the pair's query margin, and the extrema by
Newton's method (`proximity/manager/extrema.py`). The near ones are listed: each has a slot, from which it is tracked
exactly. What is left out is farther than the pair's motion bound: until a point of one body has moved by that much,
seen from the other, nothing unlisted can touch. Where patches face each other and hold no extremum, a motion may bring
one forth; there, a ball around these patches may move by less (`motion_bounds.py`). Which patches an update goes into
is in `candidates.py`, how it searches them in `search.py`, what it knows in `records.py`, what it lists in `slots.py`.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._record import Store
from assembly.proximity.bvh.box_descent import least_distance
from assembly.proximity.bvh.neighbor_list import LIST_INTS
from assembly.proximity.features.solid_contact import CONTACT_RECORD, TRACK, tracked_at
from assembly.proximity.manager.candidates import Candidates, candidate_pairs, near_enough
from assembly.proximity.manager.centerlines.box import BOX
from assembly.proximity.manager.centerlines.minima import MINIMA
from assembly.proximity.manager.centerlines.parts import near_parts, parts_beyond
from assembly.proximity.manager.centerlines.search import BOXES, MARK, CenterlineLimits, search_centerlines
from assembly.proximity.manager.extrema import (
    ELSEWHERE,
    GIVEN_CONTACT,
    LISTED,
    ROOT,
    USELESS,
    Extrema,
    extremum_at,
    is_alone,
)
from assembly.proximity.manager.flush import any_deep, drop_flush
from assembly.proximity.manager.motion_bounds import (
    PairSearch,
    allow_ball,
    margin_now,
    measure_motion,
    mover,
    no_ball,
    root_ball,
    used_most,
)
from assembly.proximity.manager.newton_regions import PASSED
from assembly.proximity.manager.overlap import crosses
from assembly.proximity.manager.parameters import (
    BRIEF,
    CENTERLINE_SKIN,
    CROSSING,
    LEAST_MOTION_BOUND,
    NEAR_FOLD,
    SLICE,
    SPENT,
    TAKE,
    UNMOVED,
    USED,
)
from assembly.proximity.manager.posed_pair import posed_pair
from assembly.proximity.manager.records import (
    ABORTED,
    FAR,
    MEMORY_HEADER,
    NEAR,
    PAIR_MEMORY,
    TRACKING,
    ContactManager,
    header_of,
    lengths_of,
    manager_at,
    pair_lengths_of,
    pair_of,
    pair_state_at,
    pair_state_of,
    record_of,
    slot_of,
)
from assembly.proximity.manager.search import Limits, search_patches
from assembly.proximity.manager.slots import (
    any_listed,
    any_lost,
    known_extrema,
    list_extrema,
    release_given,
)
from assembly.proximity.manager.vertex_contacts import add_vertex_contacts
from assembly.proximity.manager.wires import both_radii

# Which pairs an update is for. AS_NEEDED: those that used up their motion bound; EVERYTHING: all that moved. Flags:
# CAREFUL: also pairs whose accepted poses need an update; IN_TURNS: also the one pair that has used most, earlier than
# others; DOUBTFUL: ask whether bodies cross where a contact lost its extremum; MEASURED: the used parts of motion
# bounds are known; SPARING: only pairs that used up all of theirs, as no allowed pose does.
AS_NEEDED, EVERYTHING, CAREFUL, IN_TURNS, DOUBTFUL, MEASURED, SPARING = 0, 1, 2, 4, 8, 16, 32
# The most extrema, and pairs of patches, of an update.
EXTREMA = 96
CANDIDATES, STACK = 8192, 1024
# Arrays of an update. stack: nodes of both trees that wait, (k, 2); candidates: pairs of patches, (k, 2), and their
# distances; passed: sequences of Newton's method, (WAYS, PASSED); pairs: parts of centerlines, (k, 2); boxes: of both
# (`centerlines/search.py`); marks: of known extrema, and minima of a box.
Workspace = namedtuple("Workspace", "stack candidates distances passed pairs boxes marks")
# How many sequences of Newton's method are remembered in an update.
WAYS = 64
# Whether an update tests for crossings without a contact. A contact that lost its extremum is a reason in a solve; a
# tick has no time for it.
NEVER, WHERE_LOST, ALWAYS = 0, 1, 2


@kernel(inner=True)
def list_vertex_contacts(manager, p, posed, workspace, extrema, tracked):
    """Add corners over faces to the extrema of pair p. A listed contact whose extremum is at one stays there."""
    lengths = lengths_of(manager)
    span = (-lengths.least_margin, pair_state_of(manager, p).margin + pair_lengths_of(manager, p).least)
    add_vertex_contacts(posed, span, lengths.merge_radius, workspace.stack, workspace.candidates, extrema)
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        slot = np.int64(extremum.origin)
        if slot >= LISTED:
            tracked_at(tracked, record_of(manager).first + slot - LISTED).stays = extremum.corner


@kernel(inner=True)
def nearest_fold(extrema, least, margin):
    """About the least distance at which a fold may create a contact: that of the nearest extremum near a fold."""
    low = math.inf
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        if extremum.corner == 0.0 and not is_alone(extremum) and abs(extremum.gap - least) <= margin:
            low = min(low, max(extremum.gap - least, 0.0))
    return low


@kernel(inner=True)
def crosses_elsewhere(manager, p, posed, extrema, workspace, tracked):
    """Whether the bodies of pair p cross without a contact that shows it."""
    pair = pair_of(manager, p)
    least = pair_lengths_of(manager, p).least
    depth = max(CROSSING, header_of(manager).overlap)
    deep = False
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        asked = least if extremum.origin > GIVEN_CONTACT and extremum.place == ELSEWHERE else 0.0
        deep = deep or (extremum.gap < asked - depth and extremum.origin != USELESS)
    for k in range(pair.low, pair.high):
        if slot_of(manager, k).pair == p:
            deep = deep or tracked_at(tracked, record_of(manager).first + k).gap < -depth
    return not deep and crosses(posed, workspace.stack, workspace.candidates, depth)


@kernel(inner=True)
def search_by_patches(manager, p, posed, moving, margin, tracked, workspace, extrema):
    """Find the extrema of pair p by patches that face each other.

    Returns a PairSearch, whether a listed extremum was lost, and whether there is anything within the query margin.
    """
    stack, pairs, distances = workspace.stack, workspace.candidates, workspace.distances
    lengths, asked = lengths_of(manager), pair_lengths_of(manager, p)
    least, curved_bound = asked.least, asked.curved_bound
    found, margin = candidate_pairs(manager, p, posed, moving, margin, stack, pairs)
    pair_state_of(manager, p).margin = margin
    any_gone = known_extrema(manager, p, posed, tracked, extrema)
    facing = Candidates(pairs, distances, found)
    enough = near_enough(posed, least, margin, curved_bound, facing)
    limits = Limits(curved_bound, enough, (-lengths.largest_margin, margin + least), lengths.merge_radius)
    search = search_patches(posed, moving, limits, facing, extrema, workspace.passed)
    bound = min(search.bound, margin)
    if found == 0:
        # Nothing faces the other body within the margin: the boxes tell how far that is so.
        bound = max(bound, least_distance(posed.store, posed.trees, posed.pose, math.inf, stack) - least)
    return PairSearch(bound, search.ball_bound, search.ball, math.inf), any_gone, found > 0


@kernel(inner=True)
def search_by_centerlines(manager, p, posed, moving, margin, tracked, workspace, extrema):
    """`search_by_patches`, for two round wires and by their centerlines."""
    store, record = manager.store, record_of(manager)
    lengths, asked = lengths_of(manager), pair_lengths_of(manager, p)
    least = asked.least
    radii = both_radii(store, posed.centerlines) + least
    skin = CENTERLINE_SKIN * lengths.least_margin
    at_list = record.list_table + LIST_INTS * (p % record.lists)
    waiting = near_parts(posed, at_list, p, moving, radii + margin, skin, workspace)
    while waiting < 0 and margin > LEAST_MOTION_BOUND:
        # An array is full: within a smaller margin the motion bound is shorter, and the pair is updated more often.
        margin *= 0.5
        waiting = near_parts(posed, at_list, p, moving, radii + margin, skin, workspace)
    pair_state_of(manager, p).margin = margin
    any_gone = known_extrema(manager, p, posed, tracked, extrema)
    if waiting < 0:
        # There is no memory for a contact that violates its least gap.
        header_of(manager).crowded = 1.0
        return PairSearch(0.0, math.inf, no_ball(), math.inf), any_gone, True
    if waiting == 0:
        beyond = parts_beyond(posed, radii + margin, workspace.stack, workspace.pairs) - radii
        return PairSearch(beyond, math.inf, no_ball(), math.inf), any_gone, False
    # A motion by a length d turns no tangent by more than d / rho.
    rho = min(2.0 * (radii + margin), 0.99 * root_ball(store, moving)[1])
    limits = CenterlineLimits(least, TAKE * margin, margin, asked.curved_bound, lengths.merge_radius, rho)
    search = search_centerlines(posed, moving, limits, workspace.boxes, waiting, workspace.marks, extrema)
    return search, any_gone, True


@kernel(inner=True)
def update_pair(manager, p, q, tracked, workspace, extrema, asks):
    """Find and list the extrema of pair p; `asks` says when to test whether the bodies cross without a contact."""
    record, header = record_of(manager), header_of(manager)
    pair, known = pair_of(manager, p), pair_state_of(manager, p)
    posed = posed_pair(manager, p, q)
    header.updates += 1.0
    least = pair_lengths_of(manager, p).least
    moving = mover(pair, q)
    margin = margin_now(manager, p, moving)
    wires = posed.centerlines[0] >= 0
    extrema.count[0] = 0
    if wires:
        search, any_gone, found = search_by_centerlines(manager, p, posed, moving, margin, tracked, workspace, extrema)
    else:
        search, any_gone, found = search_by_patches(manager, p, posed, moving, margin, tracked, workspace, extrema)
    if posed.surfaces[0] < 0 and record.corners == 1:
        list_vertex_contacts(manager, p, posed, workspace, extrema, tracked)
    if posed.surfaces[0] < 0 and any_deep(extrema):
        drop_flush(manager, p, posed, extrema, tracked)
    if record.mark_address != 0 and least > 0.0 and pair.given_count > 0:
        table, pool = manager.store.table, manager.store.pool
        rows = extrema.rows[: extrema.count[0]]
        call_address(record.mark_address, (table, pool, manager.at, manager.memory, p, q, tracked, rows))
        release_given(manager, p, extrema, tracked)
    rest, lowest, wanting = list_extrema(manager, p, extrema, tracked)
    known.crossed = math.nan
    if wires and asks != NEVER:
        # All that is as near as this is known, and most of it is listed.
        known.crossed = 1.0 if lowest < -max(CROSSING, header.overlap) else 0.0
    elif asks == ALWAYS or (asks == WHERE_LOST and any_gone):
        known.crossed = 1.0 if crosses_elsewhere(manager, p, posed, extrema, workspace, tracked) else 0.0
    keep_bounds(manager, p, search, rest, extrema)
    known.state = float(TRACKING if any_listed(manager, p) else (NEAR if found else FAR))
    if wanting:
        header.crowded = 1.0


@kernel(inner=True)
def keep_bounds(manager, p, search, rest, extrema):
    """Keep the motion bounds of pair p, by a PairSearch and by `rest`: how near extrema without slots are."""
    known = pair_state_of(manager, p)
    known.motion_bound = max(min(rest, search.bound), LEAST_MOTION_BOUND)
    known.part = 0.0
    known.doubt = 0.0
    birth_bound, sure = search.ball_bound, search.accepted_bound
    if not is_by_patches(manager, p):
        sure = max(sure, UNMOVED * known.motion_bound)
    elif birth_bound < math.inf:
        low = nearest_fold(extrema, pair_lengths_of(manager, p).least, known.margin)
        sure = 0.0 if low <= NEAR_FOLD * lengths_of(manager).least_margin else math.inf
        birth_bound = birth_bound if sure == 0.0 else min(birth_bound, low)
    allow_ball(known, search.ball, birth_bound, sure)


@kernel(inner=True)
def any_crossed(table, at, memory):
    """Whether bodies were in each other at their last thorough update, where no contact says so."""
    for p in range(manager_at(table, at).pairs):
        if pair_state_at(memory, MEMORY_HEADER + PAIR_MEMORY * p).crossed == 1.0:
            return True
    return False


@kernel(inline=True)
def is_by_patches(manager, p):
    """Whether pair p is searched by patches, and not by the centerlines of two round wires."""
    return pair_of(manager, p).centerline_f < 0


@kernel(inner=True)
def is_due(manager, p, tracked, how, most):
    """Whether pair p is to be updated, by the used part of its motion bounds; pair `most` has used most."""
    known = pair_state_of(manager, p)
    part = known.part
    if how & ~MEASURED == EVERYTHING:
        due = part > 0.0 or math.isnan(known.crossed)
    else:
        much = SPENT if is_by_patches(manager, p) else USED
        due = part > (1.0 if how & SPARING != 0 else much)
        if how & IN_TURNS != 0:
            due = due or (p == most and part > USED)
            due = due or (part > BRIEF and known.cut_short > known.motion_bound)
        due = due or (how & CAREFUL != 0 and known.doubt > 1.0)
    return due or any_lost(manager, p, tracked)


@kernel(inner=True, allocates=True)
def update_due(manager, q, tracked, how, first, most):
    """Update the pairs that are due, of which `first` is the first one."""
    record, header = record_of(manager), header_of(manager)
    extrema = Extrema(
        rows=np.empty((EXTREMA, ROOT)),
        count=np.zeros(1, np.int64),
        derivatives=np.empty((1, CONTACT_RECORD)),
        tracked=np.empty((1, TRACK)),
    )
    stack = np.empty((STACK, 2), np.int64)
    pairs = np.empty((BOXES, 2), np.int64)
    boxes = np.empty((BOXES, BOX))
    marks = (np.empty((EXTREMA, MARK)), np.empty((MINIMA, 2)))
    with_patches = False
    candidates = stack
    distances = boxes[0]
    passed = boxes
    for p in range(first, record.pairs):
        if p != first and not is_due(manager, p, tracked, how, most):
            continue
        if p != first and record.clock != 0 and call_address(record.clock, ()) > header.deadline:
            if record.go_on_address == 0 or call_address(record.go_on_address, ()) == ABORTED:
                # The caller continues in another call.
                header.deadline = -1.0
                break
            header.deadline = call_address(record.clock, ()) + SLICE
        if is_by_patches(manager, p) and not with_patches:
            with_patches = True
            candidates = np.empty((CANDIDATES, 2), np.int64)
            distances = np.empty(CANDIDATES)
            passed = np.empty((WAYS, PASSED))
        asks = WHERE_LOST if how & DOUBTFUL != 0 else NEVER
        if how & ~MEASURED == EVERYTHING or math.isnan(pair_state_of(manager, p).turn[0]):
            asks = ALWAYS
        workspace = Workspace(stack, candidates, distances, passed, pairs, boxes, marks)
        update_pair(manager, p, q, tracked, workspace, extrema, asks)


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[:, ::1], f8[:, ::1], i8)")
def update(table, pool, at, memory, q, tracked, how):
    """Update the pairs of bodies that need it, or all that moved, and list what is near.

    Returns how many events that made. `tracked` has a row for every slot (`proximity/features/solid_contact.py`), at
    the extrema of the poses q or close by.
    """
    manager = ContactManager(Store(table, pool), at, memory)
    header, pairs = header_of(manager), record_of(manager).pairs
    before = header.event_count
    header.calls += 1.0
    most = measure_motion(manager, 0, pairs, q) if how & MEASURED == 0 else used_most(manager)
    for p in range(pairs):
        if is_due(manager, p, tracked, how, most):
            update_due(manager, q, tracked, how, p, most)
            break
    return np.int64(header.event_count - before)
