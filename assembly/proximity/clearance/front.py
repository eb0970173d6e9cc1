"""The front of a pair of bodies: pairs of nodes that cover all pairs of points, each with what separates it.

A pair of nodes is tested again only after points of body b have moved by its gap; the least of these lengths holds for
all pairs at once. Then the gap along the same direction is computed, in some nanoseconds. If it is too small, another
direction is sought; if none is found, one of the nodes is replaced by its children.

A look writes the next front beside the present one, of which most pairs need no test and stay as they are: as long as
no direction fails, only those that are tested are written, each beside its own row. If the look ends clear, the next
front replaces the present one; else nothing changes. If the time limit or full memory interrupts a look, the next front
also replaces the present one: its pairs then describe the pose that is looked at, and the next look at that pose goes
on with the pairs that are not separated yet. If that look does not end clear, or another pose is looked at instead, the
front from before is restored, since the front of a failed proof has many small pieces.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.geometry.vec import matvec
from assembly.kinematics.motion import RelativePose
from assembly.proximity.clearance.halve import put, vector
from assembly.proximity.clearance.records import (
    BY_BORE_B,
    BY_PLANE,
    BY_PLANE_OF_B,
    BY_SLEEVE,
    BY_SPINES,
    LEFT_OPEN,
    NODES_SIZE,
    ON_ITS_WAY,
    OPEN_YET,
    PARTED_SIZE,
    TO_POSE,
    counts_at,
    nodes_at,
    pair_proof_at,
    parted_at,
)
from assembly.proximity.clearance.sleeves import gap_of
from assembly.proximity.clearance.spines import loss_on_way, spine_gap
from assembly.proximity.clearance.way import sag_of, stays_apart

# The state of a pair of bodies. pair: a PAIR; counts: COUNTS; parted, nodes: rows of PARTED and NODES, the present
# front; next_parted, next_nodes: the next front; waiting, waiting_nodes: the queue of a look, a ring buffer; work:
# (3, 64), scratch memory.
Front = namedtuple("Front", "pair counts parted nodes next_parted next_nodes waiting waiting_nodes work")
# The limits of a look. needed: every gap has to be larger; touch: cells that cross by no more do not count as crossing;
# resolution: pairs of cells that are smaller stay open; budget: after so many pairs of nodes all others stay open;
# swept_budget: after so many pairs a way counts as too long; clock, until: the address of a function that tells the
# time, and the deadline (0: none) [ns].
Limits = namedtuple("Limits", "needed touch resolution budget swept_budget clock until")
# Two nodes, and what parts them.
Parted = namedtuple("Parted", "a b how")
# The clock is read once for so many pairs of the front that are tested again: some ten microseconds, which is what it
# costs to interrupt a look. A quarter: three times as many proofs of ticks with a budget go on in the next tick.
ASKED_AT_ONCE = 64


@kernel(inline=True)
def is_over(limits):
    """Whether a look is past its deadline."""
    return limits.until > 0 and call_address(limits.clock, ()) > limits.until


@kernel(inline=True)
def write_pair(parted, nodes, i, pair, n, expiry):
    """Write a pair of nodes, its direction and its expiry into row i."""
    row, direction = nodes_at(nodes, i), parted_at(parted, i)
    row.a, row.b, row.how = pair
    put(direction.normal, n)
    direction.expiry = expiry


@kernel(inner=True)
def begin_front(front):
    """A front of one pair, the roots, of which nothing is known."""
    counts = counts_at(front.counts, 0)
    write_pair(front.parted, front.nodes, 0, Parted(counts.root_a, counts.root_b, BY_PLANE), (0.0, 0.0, 0.0), -math.inf)
    counts.count = 1
    pair = pair_proof_at(front.pair, 0)
    pair.soonest = -math.inf
    pair.underway = 0.0


@kernel(inner=True)
def first_row(front):
    """What `begin_front` overwrites: the first pair of nodes, the count, and the travel that uses up the first gap."""
    row, parted, counts = nodes_at(front.nodes, 0), parted_at(front.parted, 0), counts_at(front.counts, 0)
    kept = Parted(row.a, row.b, row.how), vector(parted.normal), parted.expiry
    return kept, counts.count, pair_proof_at(front.pair, 0).soonest


@kernel(inner=True)
def bring_back(front, kept):
    """Restore what `begin_front` overwrote."""
    (pair, n, expiry), count, soonest = kept
    write_pair(front.parted, front.nodes, 0, pair, n, expiry)
    counts_at(front.counts, 0).count = count
    pair_proof_at(front.pair, 0).soonest = soonest


@kernel(inline=True)
def last_pose(front):
    """The pose of the last look that ended clear."""
    r, x = pair_proof_at(front.pair, 0).turn, pair_proof_at(front.pair, 0).shift
    return RelativePose((r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]), (x[0], x[1], x[2]))


@kernel(inner=True)
def remember(front, pose):
    """Make a pose the last one."""
    pair = pair_proof_at(front.pair, 0)
    for k in range(9):
        pair.turn[k] = pose.rotation[k]
    put(pair.shift, pose.shift)


@kernel(inner=True)
def keep(front, nodes, n, expiry):
    """Append a pair of nodes to the next front."""
    counts, pair = counts_at(front.counts, 0), pair_proof_at(front.pair, 0)
    write_pair(front.next_parted, front.next_nodes, counts.next_count, nodes, n, expiry)
    counts.next_count += 1
    pair.next_soonest = min(pair.next_soonest, expiry)


@kernel(inline=True)
def copy_row(rows, nodes, i, to_rows, to_nodes):
    """Copy row i of one front to the same row of another one."""
    for c in range(PARTED_SIZE):
        to_rows[i, c] = rows[i, c]
    for c in range(NODES_SIZE):
        to_nodes[i, c] = nodes[i, c]


@kernel(inner=True)
def take_next(front):
    """Replace the present front by the next one, which is complete."""
    counts = counts_at(front.counts, 0)
    for i in range(counts.next_count):
        copy_row(front.next_parted, front.next_nodes, i, front.parted, front.nodes)
    counts.count = counts.next_count


@kernel(inner=True)
def take_tested(front, travelled):
    """Replace the pairs of the present front that were tested, where the next one has only these."""
    for i in range(counts_at(front.counts, 0).count):
        if parted_at(front.parted, i).expiry <= travelled:
            copy_row(front.next_parted, front.next_nodes, i, front.parted, front.nodes)


@kernel(inner=True)
def complete_next(front, count, travelled):
    """Give the next front all of the first `count` pairs of the present one, where it has only those tested."""
    counts = counts_at(front.counts, 0)
    if counts.is_partial == 0:
        return
    for i in range(count):
        if not parted_at(front.parted, i).expiry <= travelled:
            copy_row(front.parted, front.nodes, i, front.next_parted, front.next_nodes)
    counts.is_partial, counts.next_count = 0, count


@kernel(inner=True)
def replace_front(front, pose, travelled):
    """Replace the present front by the next one, at a pose that becomes the last one."""
    counts, pair = counts_at(front.counts, 0), pair_proof_at(front.pair, 0)
    if counts.is_partial == 1:
        take_tested(front, travelled)
    else:
        take_next(front)
    if counts.fresh == 0:
        counts.fresh = counts.count
    pair.soonest = pair.next_soonest
    pair.travelled = travelled
    remember(front, pose)


@kernel(inline=True)
def aim_of(pair):
    """The pose to which the interrupted look leads."""
    r, x = pair.aim_turn, pair.aim_shift
    return RelativePose((r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]), (x[0], x[1], x[2]))


@kernel(inline=True)
def origin_of(pair):
    """The start of the whole way of which the interrupted look examined a part."""
    r, x = pair.origin_turn, pair.origin_shift
    return RelativePose((r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]), (x[0], x[1], x[2]))


@kernel(inner=True)
def copy_rows(front, begin, to, count):
    """Copy rows of the front from one place to another one."""
    for i in range(count):
        for c in range(PARTED_SIZE):
            front.parted[to + i, c] = front.parted[begin + i, c]
        for c in range(NODES_SIZE):
            front.nodes[to + i, c] = front.nodes[begin + i, c]


@kernel(inner=True)
def put_off(front, pose, swept, head, tail):
    """Interrupt a look at its deadline, or where memory is full: pairs of the queue go to the front for the next time.

    The front of the last pose is saved in the second half of the rows.
    """
    counts, pair = counts_at(front.counts, 0), pair_proof_at(front.pair, 0)
    if pair.underway == 0.0:
        copy_rows(front, 0, len(front.nodes) // 2, counts.count)
        counts.aside, pair.soonest_aside = counts.count, pair.soonest
    for i in range(head, tail):
        at = i % len(front.waiting)
        row = nodes_at(front.waiting_nodes, at)
        keep(front, Parted(row.a, row.b, OPEN_YET), vector(parted_at(front.waiting, at).normal), -math.inf)
    take_next(front)
    counts.earlier += head
    pair.soonest, pair.behind = -math.inf, 0.0
    pair.underway = ON_ITS_WAY if swept else TO_POSE
    for k in range(9):
        pair.aim_turn[k] = pose.rotation[k]
    put(pair.aim_shift, pose.shift)


@kernel(inner=True)
def goes_on(front, pose, swept):
    """Whether a look at a pose continues the interrupted one."""
    pair = pair_proof_at(front.pair, 0)
    if pair.underway != (ON_ITS_WAY if swept else TO_POSE):
        return False
    for k in range(9):
        if pair.aim_turn[k] != pose.rotation[k]:
            return False
    for k in range(3):
        if pair.aim_shift[k] != pose.shift[k]:
            return False
    return True


@kernel(inner=True)
def leave_off(front):
    """Give up an interrupted look: restore the front from before it."""
    pair, counts = pair_proof_at(front.pair, 0), counts_at(front.counts, 0)
    counts.earlier = 0
    if pair.underway == 0.0:
        return
    copy_rows(front, len(front.nodes) // 2, 0, counts.aside)
    counts.count, pair.soonest = counts.aside, pair.soonest_aside
    pair.underway = 0.0


@kernel(inline=True)
def is_asked_always(nodes):
    """Whether the gap of two nodes is computed at every pose, whatever it was at the last one.

    With a bore of b, points of a move as seen from b, and the radius of b's root does not bound that motion. A shaft
    that leans in a bore may approach its wall by more than its points move.
    """
    return nodes.how == BY_BORE_B or nodes.how >= BY_SLEEVE


@kernel(inline=True)
def expiry_of(nodes, travelled, gap):
    """The total travel of points of b up to which two nodes are certainly separated."""
    return -math.inf if is_asked_always(nodes) else travelled + gap


@kernel(inner=True)
def put_waiting(front, at, nodes, n):
    """Write a pair of nodes into place `at` of the queue."""
    write_pair(front.waiting, front.waiting_nodes, at % len(front.waiting), nodes, n, -math.inf)


@kernel(inner=True)
def spines_stay_apart(forest, front, nodes, way, needed, gaps):
    """Whether the distance of their spines keeps two pieces of wires apart all the way.

    gaps: by how much the gaps at both ends of the way exceed `needed`. Wires may overlap by `slimmer`, and on the way
    by its loss as well; the deepest overlap is written to `way_depth`.
    """
    pair = pair_proof_at(front.pair, 0)
    lesser = min(gaps[0], gaps[1])
    if not lesser > -pair.slimmer:
        return False
    if not way.swept:
        return True
    loss = loss_on_way(forest, nodes, way, lesser + needed, sag_of(way, forest, nodes.b))
    if lesser > loss:
        return True
    if pair.slimmer == 0.0 or loss == math.inf:
        return False
    pair.way_depth = max(pair.way_depth, loss - lesser)
    return True


@kernel(inner=True)
def ask_spines_again(forest, front, way, needed, i):
    """Whether the spines still separate pair i of the front at a new pose."""
    pair, row, parted = pair_proof_at(front.pair, 0), nodes_at(front.nodes, i), parted_at(front.parted, i)
    nodes, at = Parted(row.a, row.b, BY_SPINES), vector(parted.normal)
    gap, place = spine_gap(forest, nodes, way.after, at)
    before = parted.expiry - pair.travelled - pair.slimmer
    fine = spines_stay_apart(forest, front, nodes, way, needed, (before, gap - needed))
    if gap - needed > -pair.slimmer and not fine:
        before = spine_gap(forest, nodes, way.before, at)[0] - needed
        fine = spines_stay_apart(forest, front, nodes, way, needed, (before, gap - needed))
    if fine:
        keep(front, nodes, place, pair.travelled + way.moved + gap - needed + pair.slimmer)
    return fine


@kernel(inner=True)
def test_again(forest, front, way, needed, i):
    """Whether pair i of the front is separated at a new pose by what separates it; then it is in the next front."""
    row, parted = nodes_at(front.nodes, i), parted_at(front.parted, i)
    nodes, n, travelled = Parted(row.a, row.b, row.how), vector(parted.normal), pair_proof_at(front.pair, 0).travelled
    if nodes.how == BY_SPINES:
        return ask_spines_again(forest, front, way, needed, i)
    gap = gap_of(forest, nodes, way.after, n) - needed
    # expiry - travelled is a lower bound of the gap at the last pose; where the direction turns, of the distance alone.
    known = -math.inf if nodes.how == BY_PLANE_OF_B else parted.expiry - travelled
    fine = stays_apart(forest, nodes, way, n, (known, gap))
    if gap > 0.0 and not fine:
        before = gap_of(forest, nodes, way.before, n) - needed
        fine = stays_apart(forest, nodes, way, n, (before, gap))
    if fine:
        keep(front, nodes, n, expiry_of(nodes, travelled + way.moved, gap))
    return fine


@kernel(inline=True)
def hint_of(nodes, way, n):
    """The direction that is tried first of two nodes, seen from a; zero for none."""
    if nodes.how == BY_PLANE_OF_B:
        return matvec(way.after.rotation, n)
    return (0.0, 0.0, 0.0) if nodes.how == BY_SPINES else n


@kernel(inner=True)
def ask_again(forest, front, way, limits):
    """Test the front at a new pose along its stored directions. Pairs that fail go to the queue.

    Returns the length of the queue, and whether the deadline passed; pairs not tested by then stay as they are.
    """
    counts, pair = counts_at(front.counts, 0), pair_proof_at(front.pair, 0)
    travelled, needed, over = pair.travelled + way.moved, limits.needed, False
    counts.next_count, counts.is_partial = 0, 1
    pair.next_soonest = math.inf
    tail = 0
    for i in range(counts.count):
        row, parted = nodes_at(front.nodes, i), parted_at(front.parted, i)
        nodes, n, expiry = Parted(row.a, row.b, row.how), vector(parted.normal), parted.expiry
        if nodes.how == LEFT_OPEN:
            # The interrupted look, which goes on, left this pair open.
            complete_next(front, i, travelled)
            counts.opened += 1
            keep(front, nodes, n, expiry)
            continue
        if nodes.how == OPEN_YET:
            complete_next(front, i, travelled)
            put_waiting(front, tail, Parted(row.a, row.b, BY_PLANE), n)
            tail += 1
            continue
        if expiry > travelled or over:
            if counts.is_partial == 1:
                pair.next_soonest = min(pair.next_soonest, expiry)
            else:
                keep(front, nodes, n, expiry)
            continue
        counts.asked += 1
        # Pairs that are tested at every pose are no progress: the clock is not read for them.
        if not is_asked_always(nodes) and counts.asked % ASKED_AT_ONCE == 0 and is_over(limits):
            over = True
            complete_next(front, i, travelled)
        if counts.is_partial == 1:
            counts.next_count = i
        if not test_again(forest, front, way, needed, i):
            complete_next(front, i, travelled)
            put_waiting(front, tail, nodes, hint_of(nodes, way, n))
            tail += 1
    return tail, over
