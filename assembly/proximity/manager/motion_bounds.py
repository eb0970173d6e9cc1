"""How far a pair of bodies may go until it is looked at again, and which part of that it has gone.

What a look does not list is farther than the pair's allowance: until a point of one body has moved by that much, seen
from the other, it cannot touch. It is the smaller one whose motion is measured (`mover`): a wide plate's rim moves far
as a small ring turns. Where a motion may bring forth a contact, a ball around these patches of it has an allowance of
its own.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, matvec_t, quaternion_matrix, quaternion_product, sub
from assembly.kinematics.motion import rotation
from assembly.proximity.bvh.tree import CENTER, NODE_POOL, RADIUS, three
from assembly.proximity.manager.state import (
    ALLOWANCE,
    BALL,
    BALL_ALLOWANCE,
    BALL_PLACE,
    BALL_RADIUS,
    CALLED,
    CALLS,
    CUT_SHORT,
    DOUBT,
    FIRST_REACH,
    LAST_REACH,
    LENGTHS,
    PAIR_F,
    PAIR_MEMORY,
    PAIR_MINIMUM,
    PAIR_RECORD,
    PAIR_TABLE,
    PAIRS,
    PART,
    PLACE,
    REACH,
    SMALLER,
    SPINE_F,
    SURE,
    TREE_F,
    TURN,
    memory_places,
)

# Where nothing may move a pair is looked at after every step.
LEAST_ALLOWANCE = 1e-12
# What moved by less than this part of its allowance, 1e-9 of the scene's size, is where it was.
STILL = 1e-8
# A reach is for so many moves as the last ones; of round wires, whose looks take a tenth of the time, for fewer.
MOVES, MOVES_OF_WIRES = 12.0, 6.0


@kernel(inline=True)
def quaternion_from(q, i, j):
    """The turn of body j seen from body i."""
    return quaternion_product((q[i, 3], -q[i, 4], -q[i, 5], -q[i, 6]), (q[j, 3], q[j, 4], q[j, 5], q[j, 6]))


@kernel(inner=True)
def mover(table, watch, p, q):
    """The body of pair p whose motion is measured: 0 if that is f, its tree, its pose seen from the other body.

    The pose is a quaternion, and the same as a rotation and a shift.
    """
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    side = table[pair + SMALLER]
    i = table[pair + PAIR_F + 1 - side]
    j = table[pair + PAIR_F + side]
    e = quaternion_from(q, i, j)
    shift = matvec_t(rotation(q, i), (q[j, 0] - q[i, 0], q[j, 1] - q[i, 1], q[j, 2] - q[i, 2]))
    return side, table[pair + TREE_F + side], e, quaternion_matrix(e[0], e[1], e[2], e[3]), shift


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
    return apart(e, (memory[o + TURN], memory[o + TURN + 1], memory[o + TURN + 2], memory[o + TURN + 3]))


@kernel(inline=True)
def moved_from(pool_or_memory, at, memory, was, turn, shift):
    """How far a point of a body, its place on it and where it was in arrays, is from where it was."""
    there = add(matvec(turn, three(pool_or_memory, at)), shift)
    d = sub(there, three(memory, was))
    return math.sqrt(dot(d, d))


@kernel(inner=True)
def reach_now(table, pool, watch, memory, p, moving):
    """Keep where the bodies of pair p stand at this look. Returns its reach: for some moves as since the last one."""
    _side, tree, e, turn, shift = moving
    at = memory_places(table, watch)[0] + PAIR_MEMORY * p
    lengths = table[watch + LENGTHS]
    reach = memory[at + REACH]
    pair = table[watch + PAIR_TABLE] + PAIR_RECORD * p
    root = table[tree + NODE_POOL]
    if not math.isnan(memory[at + TURN]):
        pace = moved_from(pool, root + CENTER, memory, at + PLACE, turn, shift)
        pace += 2.0 * pool[root + RADIUS] * turned_by(memory, at, e)
        pace /= max(memory[CALLS] - memory[at + CALLED], 1.0)
        # After a step that was cut, as far as it was to go; but it goes no farther where contacts may be born.
        moves = MOVES if table[pair + SPINE_F] < 0 else MOVES_OF_WIRES
        asked = max(moves * pace, min(memory[at + CUT_SHORT], pool[table[pair + PAIR_MINIMUM] + 1]))
        reach = min(max(asked, pool[lengths + FIRST_REACH]), pool[lengths + LAST_REACH])
    memory[at + CUT_SHORT] = 0.0
    memory[at + CALLED] = memory[CALLS]
    center = add(matvec(turn, three(pool, root + CENTER)), shift)
    for k in range(4):
        memory[at + TURN + k] = e[k]
    for k in range(3):
        memory[at + PLACE + k] = center[k]
    return reach


@kernel(inner=True)
def allow_ball(memory, at, ball, allowance, sure):
    """Keep a ball on the body that moves and how far what is in it may go, in the memory of its pair.

    Infinite: there is no ball. What is `sure` is how far, until a pose that stays is looked at; 0 if any that moved is.
    """
    memory[at + BALL_ALLOWANCE] = allowance
    memory[at + SURE] = sure
    if allowance < math.inf:
        center, place, memory[at + BALL_RADIUS] = ball
        for k in range(3):
            memory[at + BALL + k] = center[k]
            memory[at + BALL_PLACE + k] = place[k]


@kernel(inner=True)
def part_used(table, pool, watch, memory, p, q):
    """Which part of its allowances pair p has used at poses q; infinite before its first look. Notes its DOUBT.

    A ball's points went no farther than its middle and 2 r |e - e'|: a turn by an angle a about an axis moves a point
    at a distance r from it by 2 r sin(a / 2), and |e - e'| is 2 sin(a / 4).
    """
    o = memory_places(table, watch)[0] + PAIR_MEMORY * p
    memory[o + DOUBT] = 0.0
    if math.isnan(memory[o + TURN]):
        return math.inf
    _side, tree, e, turn, shift = mover(table, watch, p, q)
    root = table[tree + NODE_POOL]
    angle = turned_by(memory, o, e)
    moved = moved_from(pool, root + CENTER, memory, o + PLACE, turn, shift) + 2.0 * pool[root + RADIUS] * angle
    if not moved > 0.0:
        return 0.0
    part = moved / memory[o + ALLOWANCE]
    if memory[o + BALL_ALLOWANCE] < memory[o + ALLOWANCE] or 0.0 < memory[o + SURE] < math.inf:
        moved = (
            moved_from(memory, o + BALL, memory, o + BALL_PLACE, turn, shift) + 2.0 * memory[o + BALL_RADIUS] * angle
        )
        part = max(part, moved / memory[o + BALL_ALLOWANCE])
        if memory[o + SURE] > 0.0:
            memory[o + DOUBT] = moved / memory[o + SURE]
    if memory[o + SURE] == 0.0:
        memory[o + DOUBT] = part / STILL
    return part


@kernel(inner=True)
def went(table, pool, watch, p, before, after):
    """How far a point of one body of pair p went at most, seen from the other one, between two poses of a scene."""
    _side, tree, e, turn, shift = mover(table, watch, p, before)
    _side, _tree, f, turned, shifted = mover(table, watch, p, after)
    root = table[tree + NODE_POOL]
    center = three(pool, root + CENTER)
    d = sub(add(matvec(turned, center), shifted), add(matvec(turn, center), shift))
    return math.sqrt(dot(d, d)) + 2.0 * pool[root + RADIUS] * apart(e, f)


@kernel(inner=True)
def used_most(table, watch, memory):
    """The pair that had used the largest part of its allowances when that was last measured."""
    at = memory_places(table, watch)[0] + PART
    best = 0
    for p in range(1, table[watch + PAIRS]):
        if memory[at + PAIR_MEMORY * p] > memory[at + PAIR_MEMORY * best]:
            best = p
    return best


@kernel(inner=True)
def largest_part(table, pool, watch, memory, q):
    """The pair that used the largest part of its allowances at poses q, and that part."""
    at = memory_places(table, watch)[0] + PART
    for p in range(table[watch + PAIRS]):
        memory[at + PAIR_MEMORY * p] = part_used(table, pool, watch, memory, p, q)
    best = used_most(table, watch, memory)
    return best, memory[at + PAIR_MEMORY * best]


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], i8, i8, f8[:, ::1])")
def measure_parts(table, pool, watch, memory, first, end, q):
    """Keep which parts of their allowances the pairs from first to before `end` used at poses q.

    Returns the pair that had used most, of all, when it was last measured. A solve calls this by its address.
    """
    at = memory_places(table, watch)[0] + PART
    for p in range(first, end):
        memory[at + PAIR_MEMORY * p] = part_used(table, pool, watch, memory, p, q)
    return used_most(table, watch, memory)


@kernel(signatures="(i8[::1], f8[::1], i8, i8, f8[:, ::1], f8[:, ::1], f8)")
def went_beyond(table, pool, watch, p, before, after, most):
    """Whether a point of one body of pair p may have gone farther than `most` between two poses. By address, too."""
    return 1 if went(table, pool, watch, p, before, after) > most else 0
