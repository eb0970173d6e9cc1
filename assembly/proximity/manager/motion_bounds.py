"""How far a pair of bodies may go until it is looked at again, and which part of that it has gone.

What a look does not list is farther than the pair's allowance: until a point of one body has moved by that much, seen
from the other, it cannot touch. It is the smaller one whose motion is measured (`mover`): a wide plate's rim moves far
as a small ring turns. Where a motion may bring forth a contact, a ball around these patches of it has an allowance of
its own.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.vec import add, dot, matvec, matvec_t, quaternion_matrix, quaternion_product, sub
from assembly.kinematics.motion import RelativePose, rotation
from assembly.proximity.bvh.tree import node_at, three_of, tree_at
from assembly.proximity.manager.state import (
    PAIR_MEMORY,
    PAIR_RECORD,
    lengths_at,
    manager_at,
    memory_header_at,
    memory_places,
    pair_at,
    pair_lengths_at,
    pair_state_at,
)

# Where nothing may move a pair is looked at after every step.
LEAST_ALLOWANCE = 1e-12
# What moved by less than this part of its allowance, 1e-9 of the scene's size, is where it was.
STILL = 1e-8
# A reach is for so many moves as the last ones; of round wires, whose looks take a tenth of the time, for fewer.
MOVES, MOVES_OF_WIRES = 12.0, 6.0


# The body of a pair whose motion is measured. side: 0 if that is f, 1 g; tree: its tree; turn, shift: its pose seen
# from the other body, a rotation matrix by rows and its origin; quaternion: the same turn.
Mover = namedtuple("Mover", "side tree quaternion turn shift")
# A ball on it. center: in its axes; place: where that is, seen from the other body.
MotionBall = namedtuple("MotionBall", "center place radius")
# What a search finds of a pair. count: number of extrema that are known; bound: how far the body may go for all that is
# not in the ball; ball_bound: how far what is in the ball may go, because a contact may be created there, infinite if
# there is no ball; accepted_bound: how far until a pose that is accepted needs an update.
PairSearch = namedtuple("PairSearch", "count bound ball_bound ball accepted_bound")


@kernel(inline=True)
def no_ball():
    """A ball where there is none."""
    return MotionBall((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)


@kernel(inline=True)
def quaternion_from(q, i, j):
    """The turn of body j seen from body i."""
    return quaternion_product((q[i, 3], -q[i, 4], -q[i, 5], -q[i, 6]), (q[j, 3], q[j, 4], q[j, 5], q[j, 6]))


@kernel(inner=True)
def mover(table, watch, p, q):
    """The body of pair p whose motion is measured, at poses q."""
    pair = pair_at(table, manager_at(table, watch).pair_table + PAIR_RECORD * p)
    side = pair.smaller
    i, j, tree = (pair.body_f, pair.body_g, pair.tree_g) if side == 1 else (pair.body_g, pair.body_f, pair.tree_f)
    e = quaternion_from(q, i, j)
    shift = matvec_t(rotation(q, i), (q[j, 0] - q[i, 0], q[j, 1] - q[i, 1], q[j, 2] - q[i, 2]))
    turn = quaternion_matrix(e[0], e[1], e[2], e[3])
    return Mover(side=side, tree=tree, quaternion=e, turn=turn, shift=shift)


@kernel(inline=True)
def apart(e, f):
    """|e - f| of two quaternions with their best signs, 2 sin(a / 4) of the angle a between the turns."""
    square = 0.0
    other = 0.0
    for k in range(4):
        square += (e[k] - f[k]) * (e[k] - f[k])
        other += (e[k] + f[k]) * (e[k] + f[k])
    return math.sqrt(min(square, other))


@kernel(inline=True)
def turned_by(memory, o, e):
    """The same of the turn e of a pair and that of its last look, in the memory at o."""
    known = pair_state_at(memory, o)
    return apart(e, (known.turn[0], known.turn[1], known.turn[2], known.turn[3]))


@kernel(inline=True)
def moved_from(point, was, pose):
    """How far a point of a body is from where it was, by the body's pose."""
    d = sub(add(matvec(pose.rotation, point), pose.shift), was)
    return math.sqrt(dot(d, d))


@kernel(inner=True)
def reach_now(store, watch, memory, p, moving):
    """Keep where the bodies of pair p stand at this look. Returns its reach: for some moves as since the last one."""
    state = memory_header_at(memory, 0)
    manager = manager_at(store.table, watch)
    turn, shift = moving.turn, moving.shift
    at = memory_places(store.table, watch)[0] + PAIR_MEMORY * p
    known = pair_state_at(memory, at)
    lengths = lengths_at(store.pool, manager.lengths)
    reach = known.reach
    pair = pair_at(store.table, manager.pair_table + PAIR_RECORD * p)
    extremum = tree_at(store.table, moving.tree).node_pool
    if not math.isnan(known.turn[0]):
        pace = moved_from(
            three_of(node_at(store.pool, extremum).center), three_of(known.place), RelativePose(turn, shift)
        )
        pace += 2.0 * node_at(store.pool, extremum).radius * turned_by(memory, at, moving.quaternion)
        pace /= max(state.calls - known.called, 1.0)
        # After a step that was cut, as far as it was to go; but it goes no farther where contacts may be born.
        moves = MOVES if pair.spine_f < 0 else MOVES_OF_WIRES
        asked = max(moves * pace, min(known.cut_short, pair_lengths_at(store.pool, pair.minimum).curved_bound))
        reach = min(max(asked, lengths.first_reach), lengths.last_reach)
    known.cut_short = 0.0
    known.called = state.calls
    center = add(matvec(turn, three_of(node_at(store.pool, extremum).center)), shift)
    for k in range(4):
        known.turn[k] = moving.quaternion[k]
    for k in range(3):
        known.place[k] = center[k]
    return reach


@kernel(inner=True)
def allow_ball(memory, at, ball, allowance, sure):
    """Keep a ball on the body that moves and how far what is in it may go, in the memory of its pair.

    Infinite: there is no ball. What is `sure` is how far, until a pose that stays is looked at; 0 if any that moved is.
    """
    known = pair_state_at(memory, at)
    known.ball_allowance = allowance
    known.sure = sure
    if allowance < math.inf:
        known.ball_radius = ball.radius
        for k in range(3):
            known.ball[k] = ball.center[k]
            known.ball_place[k] = ball.place[k]


@kernel(inner=True)
def part_used(store, watch, memory, p, q):
    """Which part of its allowances pair p has used at poses q; infinite before its first look. Notes its DOUBT.

    A ball's points went no farther than its middle and 2 r |e - e'|: a turn by an angle a about an axis moves a point
    at a distance r from it by 2 r sin(a / 2), and |e - e'| is 2 sin(a / 4).
    """
    o = memory_places(store.table, watch)[0] + PAIR_MEMORY * p
    known = pair_state_at(memory, o)
    known.doubt = 0.0
    if math.isnan(known.turn[0]):
        return math.inf
    moving = mover(store.table, watch, p, q)
    turn, shift = moving.turn, moving.shift
    extremum = tree_at(store.table, moving.tree).node_pool
    angle = turned_by(memory, o, moving.quaternion)
    moved = (
        moved_from(three_of(node_at(store.pool, extremum).center), three_of(known.place), RelativePose(turn, shift))
        + 2.0 * node_at(store.pool, extremum).radius * angle
    )
    if not moved > 0.0:
        return 0.0
    part = moved / known.allowance
    if known.ball_allowance < known.allowance or 0.0 < known.sure < math.inf:
        moved = (
            moved_from(three_of(known.ball), three_of(known.ball_place), RelativePose(turn, shift))
            + 2.0 * known.ball_radius * angle
        )
        part = max(part, moved / known.ball_allowance)
        if known.sure > 0.0:
            known.doubt = moved / known.sure
    if known.sure == 0.0:
        known.doubt = part / STILL
    return part


@kernel(inner=True)
def went(store, watch, p, before, after):
    """How far a point of one body of pair p went at most, seen from the other one, between two poses of a scene."""
    was, now = mover(store.table, watch, p, before), mover(store.table, watch, p, after)
    extremum = tree_at(store.table, was.tree).node_pool
    center = three_of(node_at(store.pool, extremum).center)
    d = sub(add(matvec(now.turn, center), now.shift), add(matvec(was.turn, center), was.shift))
    return math.sqrt(dot(d, d)) + 2.0 * node_at(store.pool, extremum).radius * apart(was.quaternion, now.quaternion)


@kernel(inner=True)
def used_most(table, watch, memory):
    """The pair that had used the largest part of its allowances when that was last measured."""
    at = memory_places(table, watch)[0]
    best = 0
    for p in range(1, manager_at(table, watch).pairs):
        if pair_state_at(memory, at + PAIR_MEMORY * p).part > pair_state_at(memory, at + PAIR_MEMORY * best).part:
            best = p
    return best


@kernel(inner=True)
def largest_part(store, watch, memory, q):
    """The pair that used the largest part of its allowances at poses q, and that part."""
    at = memory_places(store.table, watch)[0]
    for p in range(manager_at(store.table, watch).pairs):
        pair_state_at(memory, at + PAIR_MEMORY * p).part = part_used(store, watch, memory, p, q)
    best = used_most(store.table, watch, memory)
    return best, pair_state_at(memory, at + PAIR_MEMORY * best).part


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], i8, i8, f8[:, ::1])")
def measure_parts(table, pool, watch, memory, first, end, q):
    """Keep which parts of their allowances the pairs from first to before `end` used at poses q.

    Returns the pair that had used most, of all, when it was last measured. A solve calls this by its address.
    """
    at = memory_places(table, watch)[0]
    for p in range(first, end):
        pair_state_at(memory, at + PAIR_MEMORY * p).part = part_used(Store(table, pool), watch, memory, p, q)
    return used_most(table, watch, memory)


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8[:, ::1], f8[:, ::1], f8)")
def went_beyond(table, pool, watch, p, before, after, most):
    """Whether a point of one body of pair p may have gone farther than `most` between two poses. By address, too."""
    return 1 if went(Store(table, pool), watch, p, before, after) > most else 0
