"""How far a pair of bodies may move until its next update, and which part of that it has used.

What an update does not list is farther than the pair's motion bound: until a point of one body has moved by that much,
seen from the other, it cannot touch. The motion of the smaller body is measured, seen from the larger one (`mover`):
seen from a small ring that turns, the border of a wide plate moves far. Where a motion may create a contact, a ball
around those patches of the body that moves has a motion bound of its own.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.vec import add, dot, matvec, matvec_t, quaternion_matrix, quaternion_product, scale, sub
from assembly.kinematics.motion import rotation
from assembly.proximity.bvh.tree import node_at, three_of, tree_at
from assembly.proximity.manager.parameters import MOVES, MOVES_OF_WIRES, UNMOVED
from assembly.proximity.manager.records import (
    ContactManager,
    header_of,
    lengths_of,
    pair_in,
    pair_lengths_of,
    pair_of,
    pair_state_of,
    record_of,
)

# The body of a pair whose motion is measured. side: 0 if that is f, 1 g; tree: its tree; turn, shift: its pose seen
# from the other body, a rotation matrix by rows and its origin; quaternion: the same turn.
Mover = namedtuple("Mover", "side tree quaternion turn shift")
# A ball on it. center: in its axes; place: where that is, seen from the other body.
MotionBall = namedtuple("MotionBall", "center place radius")
# The result of a search of a pair. bound: the motion bound for all that is not in the ball; ball_bound: the motion
# bound of the ball, in which a contact may be created, infinite without a ball; accepted_bound: the motion after which
# an accepted pose needs an update.
PairSearch = namedtuple("PairSearch", "bound ball_bound ball accepted_bound")


@kernel(inline=True)
def no_ball():
    """The record of no ball."""
    return MotionBall((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)


@kernel(inline=True)
def quaternion_from(q, i, j):
    """The turn of body j seen from body i."""
    return quaternion_product((q[i, 3], -q[i, 4], -q[i, 5], -q[i, 6]), (q[j, 3], q[j, 4], q[j, 5], q[j, 6]))


@kernel(inline=True)
def ball_about(moving, lo, hi, least):
    """The ball around a box (lo, hi) on the body that moves, of a least radius."""
    d = sub(hi, lo)
    center = scale(0.5, add(lo, hi))
    place = add(matvec(moving.turn, center), moving.shift)
    return MotionBall(center, place, max(0.5 * math.sqrt(dot(d, d)), least))


@kernel(inner=True)
def mover(pair, q):
    """The body of a pair whose motion is measured, at poses q."""
    side = pair.smaller
    i, j, tree = (pair.body_f, pair.body_g, pair.tree_g) if side == 1 else (pair.body_g, pair.body_f, pair.tree_f)
    e = quaternion_from(q, i, j)
    shift = matvec_t(rotation(q, i), (q[j, 0] - q[i, 0], q[j, 1] - q[i, 1], q[j, 2] - q[i, 2]))
    turn = quaternion_matrix(e[0], e[1], e[2], e[3])
    return Mover(side=side, tree=tree, quaternion=e, turn=turn, shift=shift)


@kernel(inline=True)
def quaternion_distance(e, f):
    """|e - f| of two quaternions with their best signs, 2 sin(a / 4) of the angle a between the turns."""
    square = 0.0
    other = 0.0
    for k in range(4):
        square += (e[k] - f[k]) * (e[k] - f[k])
        other += (e[k] + f[k]) * (e[k] + f[k])
    return math.sqrt(min(square, other))


@kernel(inline=True)
def turned_by(known, e):
    """`quaternion_distance` between the turn e of a pair and that at its last update."""
    return quaternion_distance(e, (known.turn[0], known.turn[1], known.turn[2], known.turn[3]))


@kernel(inline=True)
def moved_from(point, was, moving):
    """How far a point of the body that moves is from where it was."""
    d = sub(add(matvec(moving.turn, point), moving.shift), was)
    return math.sqrt(dot(d, d))


@kernel(inline=True)
def root_ball(store, moving):
    """Center and radius of the ball around the body that moves, in its axes."""
    node = node_at(store.pool, tree_at(store.table, moving.tree).node_pool)
    return three_of(node.center), node.radius


@kernel(inner=True)
def margin_now(manager, p, moving):
    """Keep where pair p is now. Returns its query margin: several times its motion per call since the last update."""
    header, known, lengths = header_of(manager), pair_state_of(manager, p), lengths_of(manager)
    margin = known.margin
    pair = pair_of(manager, p)
    middle, radius = root_ball(manager.store, moving)
    if not math.isnan(known.turn[0]):
        pace = moved_from(middle, three_of(known.place), moving)
        pace += 2.0 * radius * turned_by(known, moving.quaternion)
        pace /= max(header.calls - known.called, 1.0)
        # After a step that was cut, the margin is to cover the whole step; but only up to the curvature-limited motion
        # bound, as motion bounds are no larger where contacts may be created.
        moves = MOVES if pair.centerline_f < 0 else MOVES_OF_WIRES
        asked = max(moves * pace, min(known.cut_short, pair_lengths_of(manager, p).curved_bound))
        margin = min(max(asked, lengths.least_margin), lengths.largest_margin)
    known.cut_short = 0.0
    known.called = header.calls
    center = add(matvec(moving.turn, middle), moving.shift)
    for k in range(4):
        known.turn[k] = moving.quaternion[k]
    for k in range(3):
        known.place[k] = center[k]
    return margin


@kernel(inner=True)
def allow_ball(known, ball, bound, sure):
    """Write a motion ball and its motion bound `bound` into the PAIR_STATE of its pair; infinite: there is no ball.

    `sure` is the motion after which an accepted pose needs an update; 0 if any motion does.
    """
    known.ball_bound = bound
    known.sure = sure
    if bound < math.inf:
        known.ball_radius = ball.radius
        for k in range(3):
            known.ball[k] = ball.center[k]
            known.ball_place[k] = ball.place[k]


@kernel(inner=True)
def part_used(manager, p, q):
    """Which part of its motion bounds pair p has used at poses q; infinite before its first update. Writes `doubt`.

    Points of a ball went no farther than its center plus 2 r |e - e'|: a turn by an angle a about an axis moves a point
    at a distance r from it by 2 r sin(a / 2), and |e - e'| is 2 sin(a / 4).
    """
    known = pair_state_of(manager, p)
    known.doubt = 0.0
    if math.isnan(known.turn[0]):
        return math.inf
    moving = mover(pair_of(manager, p), q)
    middle, radius = root_ball(manager.store, moving)
    angle = turned_by(known, moving.quaternion)
    moved = moved_from(middle, three_of(known.place), moving) + 2.0 * radius * angle
    if not moved > 0.0:
        return 0.0
    part = moved / known.motion_bound
    if known.ball_bound < known.motion_bound or 0.0 < known.sure < math.inf:
        moved = moved_from(three_of(known.ball), three_of(known.ball_place), moving) + 2.0 * known.ball_radius * angle
        part = max(part, moved / known.ball_bound)
        if known.sure > 0.0:
            known.doubt = moved / known.sure
    if known.sure == 0.0:
        known.doubt = part / UNMOVED
    return part


@kernel(inner=True)
def went(store, pair, before, after):
    """How far a point of one body of a pair went at most, seen from the other one, between two poses of a scene."""
    was, now = mover(pair, before), mover(pair, after)
    middle, radius = root_ball(store, was)
    moved = moved_from(middle, add(matvec(was.turn, middle), was.shift), now)
    return moved + 2.0 * radius * quaternion_distance(was.quaternion, now.quaternion)


@kernel(inner=True)
def used_most(manager):
    """The pair that had used the largest part of its motion bounds when that was last measured."""
    best = 0
    for p in range(1, record_of(manager).pairs):
        if pair_state_of(manager, p).part > pair_state_of(manager, best).part:
            best = p
    return best


@kernel(inner=True)
def measure_motion(manager, first, end, q):
    """Keep which parts of their motion bounds the pairs from first to before `end` used at poses q.

    Returns the pair that had used most, of all, when it was last measured.
    """
    for p in range(first, end):
        pair_state_of(manager, p).part = part_used(manager, p, q)
    return used_most(manager)


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], i8, i8, f8[:, ::1])")
def measure_parts(table, pool, at, memory, first, end, q):
    """`measure_motion`, of the contact manager at a place of the table. A solve calls this by its address."""
    return measure_motion(ContactManager(Store(table, pool), at, memory), first, end, q)


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8[:, ::1], f8[:, ::1], f8)")
def went_beyond(table, pool, at, p, before, after, most):
    """Whether a point of one body of pair p may have gone farther than `most` between two poses. By address, too."""
    return 1 if went(Store(table, pool), pair_in(table, at, p), before, after) > most else 0
