"""Listed contacts that follow bodies whose poses are given, and the update of what came near them.

A contact is predicted along the move by the contact velocity formulation,

    du = RATES z,     z = ZED (d_f, d_g)                                   (proximity/extrema/rates.py)

with the twists d that lead from the last poses to these, and corrected there by Newton's method. A contact that is not
found, is no longer a minimum, or was corrected so much that it may be another extremum, is left to the contact manager
(`proximity/manager/update.py`), whose update of the pair of bodies finds all contacts.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.contact import (
    contact_of,
    copy_tracked,
    is_of_solids,
    predict_pair,
    surface_of,
    track_contact,
    track_row,
)
from assembly.constraints.program.records import Iterate, LiftedPairs, header_at, pool_header_at
from assembly.geometry.splines.evaluate import surface_at
from assembly.geometry.vec import quaternion_product
from assembly.proximity.extrema.face_face import BEND, CONVERGED, SINGULAR
from assembly.proximity.extrema.rates import derivatives_at
from assembly.proximity.features.solid_contact import contact_record_at, tracked_at
from assembly.proximity.manager.records import (
    PAIR_MEMORY,
    PLACE_MEMORY,
    lengths_at,
    manager_at,
    memory_header_at,
    memory_places,
    pair_state_at,
    place_at,
)
from assembly.proximity.manager.update import IN_TURNS
from assembly.solve.loop.clearances import place_clearance_rows, update_around
from assembly.solve.loop.contacts import is_near_fold
from assembly.solve.loop.workspace import Rows

# A contact may have come to another extremum if it is corrected by more than this part of the prediction plus this part
# of the surface's domain, or if it is as near as this to a fold (det H over |H|^2), where other extrema appear.
ASTRAY, SLACK, NEAR_FOLD = 0.5, 1e-3, 1e-3
# How far the length of a quaternion may be from one.
QUATERNION_SLACK = 1e-2


@kernel(inner=True)
def place_bodies(store, q, poses):
    """Convert poses from the user's coordinates to scaled ones. Whether all are finite, quaternions nearly unit."""
    units = pool_header_at(store.pool, 0)
    for b in range(header_at(store.table, 0).bodies):
        square = 0.0
        for k in range(7):
            if not math.isfinite(q[b, k]):
                return False
            if k >= 3:
                square += q[b, k] * q[b, k]
        length = math.sqrt(square)
        if not abs(length - 1.0) <= QUATERNION_SLACK:
            return False
        for k in range(3):
            poses[b, k] = (q[b, k] - units.reference[k]) / units.scale
        for k in range(3, 7):
            poses[b, k] = q[b, k] / length
    return True


@kernel(inner=True)
def write_twists(table, before, poses, twists):
    """The twists, over a unit of time, that lead from poses to poses, by the shorter way around."""
    for b in range(header_at(table, 0).bodies):
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
def predict(store, r, tracked, records, twists, guess):
    """Coordinates of contact r along its bodies' twists."""
    contact = contact_of(store.table, r)
    derivatives = derivatives_at(records, r)
    f, g = contact.body_f, contact.body_g
    copy_tracked(tracked, r, guess)
    for j in range(4):
        s = 0.0
        for i in range(6):
            s += derivatives.zed[j, i] * twists[f, i] + derivatives.zed[j, 6 + i] * twists[g, i]
        for i in range(4):
            guess[r, i] += derivatives.rates[i, j] * s
    predict_pair(store, r, tracked, guess)


@kernel(inline=True)
def part_of_domain(store, surface, u, v, s, t):
    """The larger difference of two pairs of parameters, in parts of the domain, the shorter way around."""
    patch = surface_at(store.table, surface)
    du = abs(u - s) / (store.pool[patch.breaks_u + patch.spans_u] - store.pool[patch.breaks_u])
    dv = abs(v - t) / (store.pool[patch.breaks_v + patch.spans_v] - store.pool[patch.breaks_v])
    if patch.closed_u == 1:
        du = min(du, abs(1.0 - du))
    if patch.closed_v == 1:
        dv = min(dv, abs(1.0 - dv))
    return max(du, dv)


@kernel(inner=True)
def is_astray(store, r, before, guess, after):
    """Whether a contact of two surfaces was corrected by so much that it may have come to another extremum."""
    for side in range(2):
        i = 2 * side
        surface = surface_of(contact_of(store.table, r), side)
        moved = part_of_domain(store, surface, before[r, i], before[r, i + 1], guess[r, i], guess[r, i + 1])
        off = part_of_domain(store, surface, guess[r, i], guess[r, i + 1], after[r, i], after[r, i + 1])
        if off > ASTRAY * moved + SLACK:
            return True
    return False


@kernel(inner=True)
def correct(store, r, q, guess, tracked, records):
    """Newton's method from guess[r], into tracked[r] and record r. Whether there is a minimum of the distance."""
    pair = tracked_at(tracked, r)
    copy_tracked(guess, r, tracked)
    if is_of_solids(store.table, r):
        status = track_row(store, q, guess, BEND, records, tracked, r)
        found = status == CONVERGED or status == SINGULAR
    else:
        status, x, facing, _distance = track_contact(store, q, guess, BEND, records, r)
        found = status == CONVERGED or status == SINGULAR
        tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3] = x
        pair.facing = facing
    if found:
        pair.gap = derivatives_at(records, r).gap
    if not found or contact_record_at(records, r).proper == 0.0:
        tracked[r, 0] = math.nan
        return False
    return True


@kernel(inner=True)
def make_due(table, memory, k):
    """Let the next update search the pair of bodies whose contact is in slot k."""
    pairs, places, _events = memory_places(table, header_at(table, 0).manager_record)
    p = int(place_at(memory, places + PLACE_MEMORY * k).pair)
    pair_state_at(memory, pairs + PAIR_MEMORY * p).motion_bound = 0.0


@kernel(inner=True)
def doubt_twins(store, memory, k, records):
    """Make a pair of bodies due for an update where contact k is within the merge radius of another one of the pair."""
    header = header_at(store.table, 0)
    first = header.first_clearance_row
    places = memory_places(store.table, header.manager_record)[1]
    near = lengths_at(store.pool, manager_at(store.table, header.manager_record).lengths).merge_radius
    for l in range(k):
        if place_at(memory, places + PLACE_MEMORY * l).pair != place_at(memory, places + PLACE_MEMORY * k).pair:
            continue
        square = 0.0
        for i in range(3):
            d = derivatives_at(records, first + k).arm_f[i] - derivatives_at(records, first + l).arm_f[i]
            square += d * d
        if square <= near * near:
            make_due(store.table, memory, k)


@kernel(
    signatures=("(i8[::1], f8[::1], f8[:, ::1], UniTuple(f8[:, ::1], 3), UniTuple(f8[:, ::1], 5), i8[::1], f8[::1])")
)
def follow(table, pool, q, last, room, free, memory):
    """Follow the listed contacts to poses q (n, 7) in the user's coordinates, then update, which lists what is near.

    `last` are poses, tracked values and records of the last call, and become those of this one; `room` is for poses,
    twists, two times tracked values, and two rows of numbers. Returns the number of events; or -1, with
    nothing changed, if poses are not finite or their quaternions far from unit.
    """
    store = Store(table, pool)
    header = header_at(table, 0)
    state = memory_header_at(memory, 0)
    poses, tracked, records = last
    standing, twists, guess, before, numbers = room
    # Nothing evaluates rows here: what would be their residuals and multipliers is room alone.
    listed = Iterate(poses, tracked, records, numbers[0], numbers)
    lifted = LiftedPairs(free, None, None, None, guess, memory)
    rows = Rows(header.clearance_rows, 0.0, numbers[0], numbers[1], None, None, None, None)
    events = state.event_count
    if not place_bodies(store, q, standing):
        return -1
    write_twists(table, poses, standing, twists)
    for b in range(header.bodies):
        for k in range(7):
            poses[b, k] = standing[b, k]
    first = header.first_clearance_row
    for k in range(header.clearance_rows):
        r = first + k
        if contact_of(table, r).body_f < 0:
            continue
        copy_tracked(tracked, r, before)
        predict(store, r, tracked, records, twists, guess)
        if not correct(store, r, poses, guess, tracked, records):
            continue
        if is_near_fold(records, r, NEAR_FOLD):
            make_due(table, memory, k)
        elif not is_of_solids(table, r) and is_astray(store, r, before, guess, tracked):
            make_due(table, memory, k)
        doubt_twins(store, memory, k, records)
    update_around(store, memory, listed, IN_TURNS)
    for k in range(header.clearance_rows):
        before[first + k, 0] = float(contact_of(table, first + k).clearance_number)
    place_clearance_rows(table, lifted, listed, rows, False)
    for k in range(header.clearance_rows):
        r = first + k
        contact = contact_of(table, r)
        if contact.body_f >= 0 and float(contact.clearance_number) != before[r, 0]:
            copy_tracked(tracked, r, guess)
            correct(store, r, poses, guess, tracked, records)
    return int(state.event_count - events)
