"""The global manager's kernel: which pairs of bodies are looked at, which contacts between them are listed.

Every body carries a tree of patches (`proximity/bvh/tree.py`). A look at a pair of bodies descends their trees, finds
the
pairs of patches that may hold an extremum of the distance within the pair's reach, and the extrema by Newton's method
(`proximity/manager/extrema.py`). The near ones are listed: each has a place, from which it is tracked exactly. What is
left out is farther
than the pair's allowance: until a point of one body has moved by that much, seen from the other, nothing unlisted can
touch. Where patches face each other and hold no root, a motion may bring one forth; there, a ball around these patches
may move by less (`motion_bounds.py`). Which patches a look goes into is in `candidates.py`, how it searches them in
`search.py`, what it knows in `state.py`.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._record import Store
from assembly.proximity.bvh.neighbor_list import LIST_INTS
from assembly.proximity.bvh.tree import least_distance, node_at, tree_at
from assembly.proximity.features.solid_contact import CONTACT_RECORD, TRACK, tracked_at
from assembly.proximity.manager.candidates import candidate_pairs, near_enough
from assembly.proximity.manager.centerlines.box import BOX
from assembly.proximity.manager.centerlines.minima import MINIMA
from assembly.proximity.manager.centerlines.parts import near_parts, parts_beyond
from assembly.proximity.manager.centerlines.search import BOXES, MARK, search_centerlines
from assembly.proximity.manager.extrema import (
    ELSEWHERE,
    GIVEN_CONTACT,
    LISTED,
    ROOT,
    USELESS,
    extremum_at,
    is_alone,
)
from assembly.proximity.manager.flush import any_deep, drop_flush
from assembly.proximity.manager.motion_bounds import (
    LEAST_ALLOWANCE,
    STILL,
    PairSearch,
    allow_ball,
    largest_part,
    mover,
    no_ball,
    reach_now,
    used_most,
)
from assembly.proximity.manager.newton_regions import PASSED
from assembly.proximity.manager.overlap import crosses
from assembly.proximity.manager.posed_pair import posed_pair
from assembly.proximity.manager.search import search_patches
from assembly.proximity.manager.state import (
    ABORTED,
    EXTREMA,
    FAR,
    NEAR,
    PAIR_MEMORY,
    PAIR_RECORD,
    PLACE_MEMORY,
    SLICE,
    TAKE,
    TRACKING,
    any_listed,
    any_lost,
    keep_slots_of_given,
    known_extrema,
    lengths_at,
    list_extrema,
    manager_at,
    memory_header_at,
    memory_places,
    pair_at,
    pair_lengths_at,
    pair_state_at,
    place_at,
    release_given,
)
from assembly.proximity.manager.vertex_contacts import add_vertex_contacts
from assembly.proximity.manager.wires import both_radii

# Looks: at pairs that used up their allowance, or at all that moved. The first may be careful, at urgent pairs too, and
# in turns, earlier at one pair at a time, and ask whether bodies cross where a contact lost its root. MEASURED: which
# parts of allowances are used is known. SPARING: only at those that used up all of it, as no pose does that is allowed.
AS_NEEDED, EVERYTHING, CAREFUL, IN_TURNS, DOUBTFUL, MEASURED, SPARING = 0, 1, 2, 4, 8, 16, 32
# A pair is looked at again when so much of its allowance is used: the second, but the first of round wires, whose looks
# take little; in turns, the one that used most of it at the first, and any that cut a step since its last look at the
# third: what is left would cut the next one to nothing.
USED, SPENT, BRIEF = 0.5, 0.85, 0.35
# Room: pairs of patches of a look.
CANDIDATES, STACK = 8192, 1024
# Folds nearer than this part of a first reach are looked at after every move.
FLAT = 0.2
# Lists of parts of spines that are near are for motions up to so many first reaches.
CENTERLINE_RINGS = 4.0
# Arrays of an update. stack: nodes of both trees that wait, (k, 2); candidates: pairs of patches, (k, 2), and their
# distances; passed: ways of Newton's method, (WAYS, PASSED); work: one record of derivatives, one tracked pair; pairs:
# parts of centerlines, (k, 2); boxes: of both (`centerlines/search.py`); marks: of known roots, and minima of a box.
Workspace = namedtuple("Workspace", "stack candidates distances passed work pairs boxes marks")
# Ways of Newton's method that are remembered in a look.
WAYS = 64
# Whether a look tells if bodies cross where no contact says so. A contact that lost its root is a reason to ask in a
# solve; a tick has no time for it.
NEVER, WHERE_LOST, ALWAYS = 0, 1, 2
# Bodies cross that are in each other by more than this, or than what is called touching where that is known.
CROSSING = 1e-6


@kernel(inner=True)
def list_vertex_contacts(store, watch, posed, reach, least, offsets, workspace, extrema, count, tracked):
    """Add corners over faces to the roots of a pair. Returns how many roots there are.

    A listed contact whose root is at one stays there.
    """
    manager = manager_at(store.table, watch)
    lengths = lengths_at(store.pool, manager.lengths)
    span = (-lengths.first_reach, reach + least)
    merge_radius = lengths.neglect
    stack, candidates, work = workspace.stack, workspace.candidates, workspace.work
    count = add_vertex_contacts(store, posed, span, offsets, merge_radius, stack, candidates, extrema, count, work)
    for k in range(count):
        extremum = extremum_at(extrema, k)
        place = np.int64(extremum.origin)
        if place >= LISTED:
            tracked_at(tracked, manager.first + place - LISTED).stays = extremum.corner
    return count


@kernel(inner=True)
def nearest_fold(extrema, count, least, reach):
    """How far away what is born at a fold may be: about as far as the nearest root beside one. Corners have none."""
    low = math.inf
    for k in range(count):
        extremum = extremum_at(extrema, k)
        if extremum.corner == 0.0 and not is_alone(extrema, k) and abs(extremum.gap - least) <= reach:
            low = min(low, max(extremum.gap - least, 0.0))
    return low


@kernel(inner=True)
def crosses_elsewhere(store, watch, memory, p, posed, extrema, count, least, offsets, stack, candidates, tracked):
    """Whether the bodies of pair p are in each other where no contact says so."""
    manager = manager_at(store.table, watch)
    pair = pair_at(store.table, manager.pair_table + PAIR_RECORD * p)
    places = memory_places(store.table, watch)[1]
    margin = max(CROSSING, memory_header_at(memory, 0).overlap)
    deep = False
    for k in range(count):
        asked = (
            least
            if extremum_at(extrema, k).origin > GIVEN_CONTACT and extremum_at(extrema, k).place == ELSEWHERE
            else 0.0
        )
        deep = deep or (extremum_at(extrema, k).gap < asked - margin and extremum_at(extrema, k).origin != USELESS)
    for k in range(pair.low, pair.high):
        if place_at(memory, places + PLACE_MEMORY * k).pair == p:
            deep = deep or tracked_at(tracked, manager.first + k).gap < -margin
    return not deep and crosses(store, posed, stack, candidates, margin, offsets)


@kernel(inner=True)
def search_by_patches(store, watch, memory, p, posed, moving, reach, offsets, tracked, workspace, extrema):
    """Find the roots of pair p by patches that face each other.

    Returns a PairSearch, whether a listed root was lost, and whether there is anything within reach.
    """
    manager = manager_at(store.table, watch)
    stack, candidates, distances = workspace.stack, workspace.candidates, workspace.distances
    lengths = lengths_at(store.pool, manager.lengths)
    minimum = pair_at(store.table, manager.pair_table + PAIR_RECORD * p).minimum
    asked = pair_lengths_at(store.pool, minimum)
    least, flank = asked.least, asked.curved_bound
    at = memory_places(store.table, watch)[0] + PAIR_MEMORY * p
    found, reach = candidate_pairs(store, watch, memory, p, posed, moving, reach, stack, candidates)
    pair_state_at(memory, at).reach = reach
    count, any_gone = known_extrema(store, watch, memory, p, posed, offsets, tracked, extrema, workspace.work)
    enough = near_enough(store, posed, least, reach, flank, candidates, found, distances)
    span = (-lengths.last_reach, reach + least)
    merge_radius = lengths.neglect
    facing = (candidates, distances)
    search = search_patches(
        store, posed, moving, (flank, enough), span, offsets, merge_radius, facing, found, extrema, count,
        workspace.work, workspace.passed,
    )  # fmt: skip
    free = min(search.bound, reach)
    if found == 0:
        # Nothing faces the other body within reach: the boxes tell how far that is so.
        trees = posed.trees
        free = max(free, least_distance(store, trees[0], trees[1], posed.pose, math.inf, stack) - least)
    return PairSearch(search.count, free, search.ball_bound, search.ball, math.inf), any_gone, found > 0


@kernel(inner=True)
def search_by_centerlines(store, watch, memory, p, posed, moving, reach, offsets, tracked, workspace, extrema):
    """The same for two round wires, by their spines."""
    manager = manager_at(store.table, watch)
    stack, pairs, boxes = workspace.stack, workspace.pairs, workspace.boxes
    lengths = lengths_at(store.pool, manager.lengths)
    minimum = pair_at(store.table, manager.pair_table + PAIR_RECORD * p).minimum
    asked = pair_lengths_at(store.pool, minimum)
    least, flank = asked.least, asked.curved_bound
    radii = both_radii(store, posed.centerlines) + least
    ring = CENTERLINE_RINGS * lengths.first_reach
    at_list = manager.list_table + LIST_INTS * (p % manager.lists)
    waiting = near_parts(store, at_list, p, posed, moving, radii + reach, ring, stack, pairs, boxes)
    while waiting < 0 and reach > LEAST_ALLOWANCE:
        # Out of room: what is nearer is looked at more often.
        reach *= 0.5
        waiting = near_parts(store, at_list, p, posed, moving, radii + reach, ring, stack, pairs, boxes)
    pair_state_at(memory, memory_places(store.table, watch)[0] + PAIR_MEMORY * p).reach = reach
    count, any_gone = known_extrema(store, watch, memory, p, posed, offsets, tracked, extrema, workspace.work)
    if waiting < 0:
        # There is no room for what is as near as it should not be.
        memory_header_at(memory, 0).crowded = 1.0
        return PairSearch(count, 0.0, math.inf, no_ball(), math.inf), any_gone, True
    if waiting == 0:
        beyond = parts_beyond(store, posed, radii + reach, stack, pairs) - radii
        return PairSearch(count, beyond, math.inf, no_ball(), math.inf), any_gone, False
    # No tangent turns by more than a motion over this.
    rho = min(2.0 * (radii + reach), 0.99 * node_at(store.pool, tree_at(store.table, moving.tree).node_pool).radius)
    search = search_centerlines(
        store, posed, moving, rho, (least, TAKE * reach, reach, flank), lengths.neglect, boxes, waiting,
        workspace.marks, extrema, count, workspace.work,
    )  # fmt: skip
    return search, any_gone, True


@kernel(inner=True)
def update_pair(store, watch, memory, p, q, tracked, workspace, extrema, asks):
    """Find and list the roots of pair p; `asks` says whether it tells if the bodies cross elsewhere."""
    state = memory_header_at(memory, 0)
    manager = manager_at(store.table, watch)
    pair = pair_at(store.table, manager.pair_table + PAIR_RECORD * p)
    at = memory_places(store.table, watch)[0] + PAIR_MEMORY * p
    known = pair_state_at(memory, at)
    posed = posed_pair(manager, pair, q)
    state.looks += 1.0
    asked = pair_lengths_at(store.pool, pair.minimum)
    least = asked.least
    offsets = (asked.offset[0], asked.offset[1])
    moving = mover(store.table, watch, p, q)
    reach = reach_now(store, watch, memory, p, moving)
    wires = posed.centerlines[0] >= 0
    if wires:
        search, any_gone, found = search_by_centerlines(
            store, watch, memory, p, posed, moving, reach, offsets, tracked, workspace, extrema
        )
    else:
        search, any_gone, found = search_by_patches(
            store, watch, memory, p, posed, moving, reach, offsets, tracked, workspace, extrema
        )
    count, fertile, sure = search.count, search.ball_bound, search.accepted_bound
    if posed.surfaces[0] >= 0:
        keep_slots_of_given(store.table, watch, memory, p, extrema, count, tracked)
    elif manager.corners == 1:
        count = list_vertex_contacts(
            store, watch, posed, known.reach, least, offsets, workspace, extrema, count, tracked
        )
    if posed.surfaces[0] < 0 and any_deep(extrema, count):
        drop_flush(store, watch, memory, p, posed, extrema, count, tracked)
    if manager.mark_address != 0 and least > 0.0 and pair.given_count > 0:
        call_address(manager.mark_address, (store.table, store.pool, watch, p, q, tracked, extrema, count))
        release_given(store.table, watch, memory, p, extrema, count, tracked)
    rest, lowest, wanting = list_extrema(store, watch, memory, p, extrema, count, tracked)
    known.crossed = math.nan
    if wires and asks != NEVER:
        # All that is as near as this is known, and most of it is listed.
        known.crossed = 1.0 if lowest < -max(CROSSING, state.overlap) else 0.0
    elif asks == ALWAYS or (asks == WHERE_LOST and any_gone):
        crossed = crosses_elsewhere(
            store,
            watch,
            memory,
            p,
            posed,
            extrema,
            count,
            least,
            offsets,
            workspace.stack,
            workspace.candidates,
            tracked,
        )
        known.crossed = 1.0 if crossed else 0.0
    known.allowance = max(min(rest, search.bound), LEAST_ALLOWANCE)
    known.part = 0.0
    known.doubt = 0.0
    if wires:
        sure = max(sure, STILL * known.allowance)
    elif fertile < math.inf:
        low = nearest_fold(extrema, count, least, known.reach)
        sure = 0.0 if low <= FLAT * lengths_at(store.pool, manager.lengths).first_reach else math.inf
        fertile = fertile if sure == 0.0 else min(fertile, low)
    allow_ball(memory, at, search.ball, fertile, sure)
    listed = any_listed(store.table, watch, memory, p)
    known.state = float(TRACKING if listed else (NEAR if found else FAR))
    if wanting:
        state.crowded = 1.0


@kernel(inner=True)
def any_crossed(table, watch, memory):
    """Whether bodies were in each other at their last thorough look, where no contact says so."""
    at = memory_places(table, watch)[0]
    for p in range(manager_at(table, watch).pairs):
        if pair_state_at(memory, at + PAIR_MEMORY * p).crossed == 1.0:
            return True
    return False


@kernel(inline=True)
def is_by_patches(table, watch, p):
    """Whether pair p is looked at by patches, and not by the spines of two round wires."""
    return pair_at(table, manager_at(table, watch).pair_table + PAIR_RECORD * p).spine_f < 0


@kernel(inner=True)
def is_due(table, watch, memory, p, tracked, how, most):
    """Whether pair p is to be looked at, now that it is known which parts of allowances are used; `most` used most."""
    o = pair_state_at(memory, memory_places(table, watch)[0] + PAIR_MEMORY * p)
    part = o.part
    if how & ~MEASURED == EVERYTHING:
        due = part > 0.0 or math.isnan(o.crossed)
    else:
        much = SPENT if is_by_patches(table, watch, p) else USED
        due = part > (1.0 if how & SPARING != 0 else much)
        if how & IN_TURNS != 0:
            due = due or (p == most and part > USED)
            due = due or (part > BRIEF and o.cut_short > o.allowance)
        due = due or (how & CAREFUL != 0 and o.doubt > 1.0)
    return due or any_lost(table, watch, memory, p, tracked)


@kernel(inner=True, allocates=True)
def update_due(store, watch, memory, q, tracked, how, first, most):
    """Look at the pairs that are due, of which `first` is the first one."""
    state = memory_header_at(memory, 0)
    manager = manager_at(store.table, watch)
    stack = np.empty((STACK, 2), np.int64)
    extrema = np.empty((EXTREMA, ROOT))
    pairs = np.empty((BOXES, 2), np.int64)
    boxes = np.empty((BOXES, BOX))
    marks = (np.empty((EXTREMA, MARK)), np.empty((MINIMA, 2)))
    work = (np.empty((1, CONTACT_RECORD)), np.empty((1, TRACK)))
    with_patches = False
    candidates = stack
    distances = boxes[0]
    passed = boxes
    at = memory_places(store.table, watch)[0]
    for p in range(first, manager.pairs):
        if p != first and not is_due(store.table, watch, memory, p, tracked, how, most):
            continue
        if p != first and manager.clock != 0 and call_address(manager.clock, ()) > state.deadline:
            if manager.go_on_address == 0 or call_address(manager.go_on_address, ()) == ABORTED:
                # Who set it is told, and goes on in another call.
                state.deadline = -1.0
                break
            state.deadline = call_address(manager.clock, ()) + SLICE
        if is_by_patches(store.table, watch, p) and not with_patches:
            with_patches = True
            candidates = np.empty((CANDIDATES, 2), np.int64)
            distances = np.empty(CANDIDATES)
            passed = np.empty((WAYS, PASSED))
        asks = WHERE_LOST if how & DOUBTFUL != 0 else NEVER
        if how & ~MEASURED == EVERYTHING or math.isnan(pair_state_at(memory, at + PAIR_MEMORY * p).turn[0]):
            asks = ALWAYS
        workspace = Workspace(
            stack=stack,
            candidates=candidates,
            distances=distances,
            passed=passed,
            work=work,
            pairs=pairs,
            boxes=boxes,
            marks=marks,
        )
        update_pair(store, watch, memory, p, q, tracked, workspace, extrema, asks)


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], f8[:, ::1], f8[:, ::1], i8)")
def update(table, pool, watch, memory, q, tracked, how):
    """Look at the pairs of bodies that need it, or at all that moved, and list what is near.

    Returns how many events that made. `tracked` has a row for every place (`proximity/features/solid_contact.py`), at
    the roots of the poses q or close by.
    """
    store = Store(table, pool)
    state = memory_header_at(memory, 0)
    before = state.event_count
    state.calls += 1.0
    most = -1
    if how & MEASURED == 0:
        most = largest_part(store, watch, memory, q)[0]
    else:
        most = used_most(table, watch, memory)
    for p in range(manager_at(table, watch).pairs):
        if is_due(table, watch, memory, p, tracked, how, most):
            update_due(store, watch, memory, q, tracked, how, p, most)
            break
    return np.int64(state.event_count - before)
