"""Listed contacts that follow bodies which somebody else moves, and the look at what came near them.

A contact is carried along the move by the contact velocity formulation,

    du = RATES z,     z = ZED (d_f, d_g)                                   (proximity/extrema/rates.py)

with the twists d that lead from the last poses to these, and corrected there by Newton's method. One that is not found,
is a minimum no longer, or was corrected by so much that it may be another root now, is left to the watch
(`proximity/manager/update.py`), whose look at the pair of bodies finds all there are.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.constraints.program.contact import track_contact, track_row
from assembly.constraints.program.records import (
    BODIES,
    BODY_F,
    BODY_G,
    FIRST_GUARD,
    GUARD_NUMBER,
    GUARDS,
    REFERENCE,
    ROW,
    ROW_TABLE,
    SCALE,
    SHELL_F,
    SURFACE_F,
    WATCH,
)
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import BREAKS_U, BREAKS_V, CLOSED_U, CLOSED_V, SPANS_U, SPANS_V
from assembly.geometry.vec import quaternion_product
from assembly.proximity.extrema.face_face import BEND, CONVERGED, SINGULAR
from assembly.proximity.extrema.rates import ARM_F, GAP, RATES, ZED
from assembly.proximity.features.solid_contact import FOLD, PAIR_GAP, PROPER, TRACK
from assembly.proximity.manager.state import (
    ALLOWANCE,
    EVENT_COUNT,
    LENGTHS,
    NEGLECT,
    PAIR_MEMORY,
    PLACE_MEMORY,
    memory_places,
)
from assembly.proximity.manager.update import IN_TURNS
from assembly.solve.loop.clearances import look_around, place_guards

# A correction by more than this part of the prediction and of the surface's domain puts the root in doubt; so does a
# root as near as this to a fold (det H over |H|^2), where others are born.
ASTRAY, SLACK, NEAR_FOLD = 0.5, 1e-3, 1e-3
# How far the length of a quaternion may be from one.
UNIT = 1e-2


@kernel(inner=True)
def place_bodies(table, pool, q, poses):
    """Poses in the user's coordinates to scaled ones. Whether all are finite and the quaternions nearly unit."""
    for b in range(table[BODIES]):
        square = 0.0
        for k in range(7):
            if not math.isfinite(q[b, k]):
                return False
            if k >= 3:
                square += q[b, k] * q[b, k]
        length = math.sqrt(square)
        if not abs(length - 1.0) <= UNIT:
            return False
        for k in range(3):
            poses[b, k] = (q[b, k] - pool[REFERENCE + k]) / pool[SCALE]
        for k in range(3, 7):
            poses[b, k] = q[b, k] / length
    return True


@kernel(inner=True)
def write_twists(table, before, poses, twists):
    """The twists, over a unit of time, that lead from poses to poses, by the shorter way around."""
    for b in range(table[BODIES]):
        for k in range(3):
            twists[b, k] = poses[b, k] - before[b, k]
        w, x, y, z = quaternion_product(
            (poses[b, 3], poses[b, 4], poses[b, 5], poses[b, 6]),
            (before[b, 3], -before[b, 4], -before[b, 5], -before[b, 6]),
        )
        sine = math.sqrt(x * x + y * y + z * z)
        factor = 2.0 * math.atan2(sine, abs(w)) / sine if sine > 1e-150 else 2.0
        if w < 0.0:
            factor = -factor
        twists[b, 3] = factor * x
        twists[b, 4] = factor * y
        twists[b, 5] = factor * z


@kernel(inner=True)
def predict(table, pool, row, r, tracked, records, twists, guess):
    """Coordinates of contact r along its bodies' twists."""
    f = table[row + BODY_F]
    g = table[row + BODY_G]
    for i in range(TRACK):
        guess[r, i] = tracked[r, i]
    for j in range(4):
        s = 0.0
        for i in range(6):
            s += records[r, ZED + 12 * j + i] * twists[f, i] + records[r, ZED + 12 * j + 6 + i] * twists[g, i]
        for i in range(4):
            guess[r, i] += records[r, RATES + 4 * i + j] * s
    if table[row + SHELL_F] < 0:
        for side in range(2):
            i = 2 * side
            guess[r, i], guess[r, i + 1], _clamped = into_domain(
                table, pool, table[row + SURFACE_F + side], guess[r, i], guess[r, i + 1]
            )


@kernel(inline=True)
def part_of_domain(table, pool, surface, u, v, s, t):
    """The larger difference of two pairs of parameters, in parts of the domain, the shorter way around."""
    du = abs(u - s) / (pool[table[surface + BREAKS_U] + table[surface + SPANS_U]] - pool[table[surface + BREAKS_U]])
    dv = abs(v - t) / (pool[table[surface + BREAKS_V] + table[surface + SPANS_V]] - pool[table[surface + BREAKS_V]])
    if table[surface + CLOSED_U] == 1:
        du = min(du, abs(1.0 - du))
    if table[surface + CLOSED_V] == 1:
        dv = min(dv, abs(1.0 - dv))
    return max(du, dv)


@kernel(inner=True)
def is_astray(table, pool, row, r, before, guess, after):
    """Whether a contact of two surfaces was corrected by so much that it may have come to another root."""
    for side in range(2):
        i = 2 * side
        surface = table[row + SURFACE_F + side]
        moved = part_of_domain(table, pool, surface, before[r, i], before[r, i + 1], guess[r, i], guess[r, i + 1])
        off = part_of_domain(table, pool, surface, guess[r, i], guess[r, i + 1], after[r, i], after[r, i + 1])
        if off > ASTRAY * moved + SLACK:
            return True
    return False


@kernel(inner=True)
def correct(table, pool, row, r, q, guess, tracked, records):
    """Newton's method from guess[r], into tracked[r] and record r. Whether there is a minimum of the distance."""
    for i in range(TRACK):
        tracked[r, i] = guess[r, i]
    if table[row + SHELL_F] >= 0:
        status = track_row(table, pool, row, q, guess, BEND, records, tracked, r)
        found = status == CONVERGED or status == SINGULAR
    else:
        start = (guess[r, 0], guess[r, 1], guess[r, 2], guess[r, 3])
        status, x, _distance = track_contact(table, pool, row, q, start, BEND, records, r)
        found = status == CONVERGED or status == SINGULAR
        tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3] = x
    if found:
        tracked[r, PAIR_GAP] = records[r, GAP]
    if not found or records[r, PROPER] == 0.0:
        tracked[r, 0] = math.nan
        return False
    return True


@kernel(inner=True)
def look_at_all_of(table, memory, k):
    """Let the next look take up the pair of bodies whose contact is at place k."""
    pairs, places, _events = memory_places(table, table[WATCH])
    p = int(memory[places + PLACE_MEMORY * k])
    memory[pairs + PAIR_MEMORY * p + ALLOWANCE] = 0.0


@kernel(inner=True)
def doubt_twins(table, pool, memory, k, records):
    """Look at a pair of bodies where contact k came within the spheres of neglect of another one."""
    first = table[FIRST_GUARD]
    places = memory_places(table, table[WATCH])[1]
    near = pool[table[table[WATCH] + LENGTHS] + NEGLECT]
    for l in range(k):
        if memory[places + PLACE_MEMORY * l] != memory[places + PLACE_MEMORY * k]:
            continue
        square = 0.0
        for i in range(3):
            d = records[first + k, ARM_F + i] - records[first + l, ARM_F + i]
            square += d * d
        if square <= near * near:
            look_at_all_of(table, memory, k)


@kernel(
    signatures=(
        "(i8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], UniTuple(f8[:, ::1], 5), i8[::1], f8[::1])"
    ),
)
def follow(table, pool, q, poses, tracked, records, room, free, memory):
    """Bodies stand at q (n, 7) in the user's coordinates now: carry the listed contacts, look, list what is near.

    `poses`, `tracked` and `records` are those of the last call, and become those of this one; `room` holds (poses,
    twists), a guess, and two rows of numbers. Returns the number of events, or -1, and nothing has changed, for poses
    that are not finite or whose quaternions are far from unit.
    """
    standing, twists, guess, before, rows = room
    events = memory[EVENT_COUNT]
    if not place_bodies(table, pool, q, standing):
        return -1
    write_twists(table, poses, standing, twists)
    for b in range(table[BODIES]):
        for k in range(7):
            poses[b, k] = standing[b, k]
    first = table[FIRST_GUARD]
    for k in range(table[GUARDS]):
        r = first + k
        row = table[ROW_TABLE] + ROW * r
        if table[row + BODY_F] < 0:
            continue
        for i in range(TRACK):
            before[r, i] = tracked[r, i]
        predict(table, pool, row, r, tracked, records, twists, guess)
        if not correct(table, pool, row, r, poses, guess, tracked, records):
            continue
        if abs(records[r, FOLD]) < NEAR_FOLD:
            look_at_all_of(table, memory, k)
        elif table[row + SHELL_F] < 0 and is_astray(table, pool, row, r, before, guess, tracked):
            look_at_all_of(table, memory, k)
        doubt_twins(table, pool, memory, k, records)
    look_around(table, pool, memory, (poses, tracked), IN_TURNS)
    for k in range(table[GUARDS]):
        before[first + k, 0] = float(table[table[ROW_TABLE] + ROW * (first + k) + GUARD_NUMBER])
    place_guards(table, memory, (poses, tracked, records, rows[0]), rows[0], rows[1], free, False)
    for k in range(table[GUARDS]):
        r = first + k
        row = table[ROW_TABLE] + ROW * r
        if table[row + BODY_F] >= 0 and float(table[row + GUARD_NUMBER]) != before[r, 0]:
            for i in range(TRACK):
                guess[r, i] = tracked[r, i]
            correct(table, pool, row, r, poses, guess, tracked, records)
    return int(memory[EVENT_COUNT] - events)
