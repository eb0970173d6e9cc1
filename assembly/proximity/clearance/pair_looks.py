"""Looks at pairs of bodies at poses in the world, and at the ways there, as Python asks for them."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._lent import lent_array
from assembly._record import Store
from assembly.geometry.vec import dot, matmul_t, matvec_t, quaternion_matrix, quaternion_product
from assembly.kinematics.motion import RelativePose, exponential, rotation
from assembly.proximity.clearance.front import Front, Limits, begin_front, bring_back, first_row, last_pose
from assembly.proximity.clearance.inside import FOREST
from assembly.proximity.clearance.look import go_to, look
from assembly.proximity.clearance.records import CLEAR, NO_ROOM, OPEN, SPENT, Forest, counts_at, pair_proof_at
from assembly.proximity.clearance.separation import separation

# The task of a pair: none; to look at a pose; with a new front; at the way there; with a new front made at the last
# pose; at the way in one look, not in parts.
PASSED_BY, AT_POSE, BEGUN_ANEW, ON_WAY, ON_WAY_ANEW, ON_WAY_AT_ONCE = 0, 1, 2, 3, 4, 5
# The task of all pairs to go on with interrupted looks.
GOING_ON = 6
# A front that has grown by more than this factor and number is begun anew.
GROWN, MANY = 2, 200
# The error of a gap by rounding of poses and sums of coordinates, in parts of these: some thirty roundings.
ROUNDING = 4e-15


@kernel(inner=True)
def posed_with_move(q, a, b, move):
    """The pose of body b, moved by a translation and a small rotation about its origin in world axes, seen from a."""
    turn = quaternion_product(exponential((move[3], move[4], move[5])), (q[b, 3], q[b, 4], q[b, 5], q[b, 6]))
    rotation_a, rotation_b = rotation(q, a), quaternion_matrix(turn[0], turn[1], turn[2], turn[3])
    d = (q[b, 0] - q[a, 0] + move[0], q[b, 1] - q[a, 1] + move[1], q[b, 2] - q[a, 2] + move[2])
    return RelativePose(matmul_t(rotation_a, rotation_b), matvec_t(rotation_a, d))


@kernel(inner=True)
def done_task(forest, front, pose, limits, task):
    """Do the task of a pair; returns how its look ended."""
    pair, counts = pair_proof_at(front.pair, 0), counts_at(front.counts, 0)
    if task == ON_WAY_ANEW:
        kept = first_row(front)
        begin_front(front)
        code = look(forest, front, last_pose(front), limits, False)
        if code == CLEAR:
            counts.fresh = counts.count
        elif code == SPENT or code == NO_ROOM:
            counts.fresh = 0
            return code
        else:
            bring_back(front, kept)
    if task == ON_WAY or task == ON_WAY_ANEW:
        return go_to(forest, front, pose, limits)
    if task == BEGUN_ANEW:
        begin_front(front)
    code = look(forest, front, pose, limits, task == ON_WAY_AT_ONCE)
    if task == BEGUN_ANEW:
        counts.fresh = 0 if code == SPENT or code == NO_ROOM else counts.count
    pair.part = 1.0 if code == CLEAR else 0.0
    return code


@kernel(inner=True)
def look_at_pair(forest, front, q, move, task, time):
    """Do the task of a pair of bodies at poses q; returns how its look ended. time: a clock and a deadline."""
    pair, count = pair_proof_at(front.pair, 0), counts_at(front.counts, 0)
    count.asked = 0
    count.sought = 0
    count.halved = 0
    count.stabbed = 0
    if pair.underway == 0.0:
        pair.way_depth = 0.0
    pose = posed_with_move(q, count.body_a, count.body_b, move)
    far = pair.far + math.sqrt(dot(pose.shift, pose.shift))
    needed = pair.needed + ROUNDING * far
    limits = Limits(needed, pair.touch, pair.resolution, count.budget, count.budget, time[0], time[1])
    return done_task(forest, front, pose, limits, task)


# Arrays of a proof, as a table of lent arrays has them: those of `Forest`, of `Fronts`, how looks ended, and the last
# poses (pairs, 12) before the last call of `stay_clear`.
integers, integer_rows = lent_array("i8", 1), lent_array("i8", 2)
doubles, double_rows = lent_array("f8", 1), lent_array("f8", 2)
fronts_of_nodes, fronts_of_directions = lent_array("i8", 3), lent_array("f8", 3)
PAIRS_AT, CODES_AT, BEGUN_AT = 6, 15, 16


@kernel(inline=True, allocates=True)
def lent_forest(lent):
    """The trees of a proof."""
    store = Store(integers(lent, 0), doubles(lent, 1))
    return Forest(store, integer_rows(lent, 2), integer_rows(lent, 3), double_rows(lent, 4), integers(lent, 5))


@kernel(inline=True, allocates=True)
def lent_front(lent, k):
    """The front of pair k of a proof."""
    at = PAIRS_AT
    return Front(
        pair=double_rows(lent, at)[k],
        counts=integer_rows(lent, at + 1)[k],
        parted=fronts_of_directions(lent, at + 2)[k],
        nodes=fronts_of_nodes(lent, at + 3)[k],
        next_parted=double_rows(lent, at + 4),
        next_nodes=integer_rows(lent, at + 5),
        waiting=double_rows(lent, at + 6),
        waiting_nodes=integer_rows(lent, at + 7),
        work=double_rows(lent, at + 8),
    )


@kernel(inline=True)
def is_grown(front):
    """Whether a front has grown so much that it is begun anew; not while a look goes on with it."""
    counts = counts_at(front.counts, 0)
    idle = counts.fresh > 0 and pair_proof_at(front.pair, 0).underway == 0.0
    return idle and counts.count > GROWN * counts.fresh + MANY


@kernel(inline=True)
def keep_begin(lent, k):
    """Keep the last pose of pair k."""
    pair, begun = pair_proof_at(lent_front(lent, k).pair, 0), double_rows(lent, BEGUN_AT)
    for i in range(9):
        begun[k, i] = pair.turn[i]
    for i in range(3):
        begun[k, 9 + i] = pair.shift[i]


@kernel(signatures="(i8[:, ::1], f8[:, ::1], f8[:, ::1], i8[::1], UniTuple(i8, 2))", allocates=True)
def look_at_pairs(lent, q, moves, tasks, time):
    """Look at pairs of bodies at poses q (n, 7), each after a move (6) of its second body; codes say how looks ended.

    lent: the arrays of a proof. time: a clock's address and the deadline [ns]; pairs that are left then end SPENT.
    """
    forest, codes = lent_forest(lent), integers(lent, CODES_AT)
    for k in range(len(tasks)):
        if tasks[k] == PASSED_BY:
            continue
        codes[k] = look_at_pair(forest, lent_front(lent, k), q, moves[k], tasks[k], time)
        if codes[k] == SPENT:
            for i in range(k + 1, len(tasks)):
                codes[i] = SPENT
            return


@kernel(
    signatures="(i8[:, ::1], f8[:, ::1], f8[:, ::1], f8, UniTuple(i8, 2), UniTuple(i8, 2))",
    allocates=True,
)
def stay_clear(lent, q, moves, touch, asked, time):
    """Look at all pairs on the way to poses q (n, 7): SPENT, the code of the first that did not end clear, or CLEAR.

    If a pair was not clear at its last look, none is looked at: all end OPEN. asked: the task, and a budget for each
    pair (0: the usual one). The task is ON_WAY; ON_WAY_AT_ONCE for ways that are not to be taken in parts; or GOING_ON,
    which continues the pairs that ended SPENT in a call whose time was over. lent and time are those of
    `look_at_pairs`.
    """
    task, budget = asked
    forest, codes = lent_forest(lent), integers(lent, CODES_AT)
    if task != GOING_ON:
        known = True
        for k in range(len(codes)):
            codes[k] = OPEN
            keep_begin(lent, k)
            known = known and pair_proof_at(lent_front(lent, k).pair, 0).known == 1.0
        if not known:
            return OPEN
        for k in range(len(codes)):
            codes[k] = SPENT
    worst = CLEAR
    for k in range(len(codes)):
        if codes[k] != SPENT:
            if worst == CLEAR:
                worst = codes[k]
            continue
        front = lent_front(lent, k)
        pair_proof_at(front.pair, 0).touch = touch
        each = ON_WAY_AT_ONCE if task == ON_WAY_AT_ONCE else ON_WAY
        if is_grown(front):
            each = ON_WAY_ANEW
        count = counts_at(front.counts, 0)
        usual = count.budget
        if budget > 0:
            count.budget = budget
        codes[k] = look_at_pair(forest, front, q, moves[k], each, time)
        count.budget = usual
        if codes[k] == SPENT:
            return SPENT
        if worst == CLEAR:
            worst = codes[k]
    return worst


@kernel(signatures=f"({FOREST}, UniTuple(i8, 2), f8[::1], f8[::1], f8[::1])")
def gap_along(forest_arrays, nodes, turn, shift, normal):
    """The gap of two nodes along a direction, b at a rotation (9) and a shift seen from a."""
    table, pool, faces, links, tree_nodes, used = forest_arrays
    forest = Forest(Store(table, pool), faces, links, tree_nodes, used)
    rotation_b = (turn[0], turn[1], turn[2], turn[3], turn[4], turn[5], turn[6], turn[7], turn[8])
    pose = RelativePose(rotation_b, (shift[0], shift[1], shift[2]))
    return separation(forest, nodes[0], nodes[1], pose, (normal[0], normal[1], normal[2]))
