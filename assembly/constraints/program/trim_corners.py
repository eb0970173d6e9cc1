"""The choice, at an iterate, of the sides of a loop that the rows of its trim belong to (see `trim_sides.py`).

One-sided rows belong to the nearest side, and to its neighbor at the corner next to the contact, where that corner is
convex from the contact's side. There both rows hold, and their multipliers decide which of them push.

A contact "on" a loop keeps its side. At a corner its multipliers y_0 and y_1 tell what the objective gains along the
two sides: nothing along this one as long as y_1 pushes, and nothing along the other one as long as turn y_0 <= 0, which
would be its multiplier there. A corner is a solution if both hold. Where y_1 pushes and turn y_0 > 0, the contact goes
on along the other side, whose row becomes the equation: the two sides exchange slots. Another side becomes the nearest
one only where the contact was far from its own.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.records import (
    SIGNED,
    STRETCH,
    Iterate,
    LiftedPairs,
    header_at,
    loop_sides_at,
    stretch_at,
)
from assembly.constraints.program.trim import add_coordinate_rate, trim_of
from assembly.constraints.program.trim_sides import part_of, side_number, trim_place
from assembly.geometry.faces.trim_nearest import trim_nearest
from assembly.geometry.faces.trim_pieces import trim_at, trim_frame_at
from assembly.proximity.features.trim_distance import trim_distance

# Distances in (u, v) count as different if they differ by more than this part of the loop's extent: the rounding of
# nearest points. Only rows that are far from being active are left out because of it.
DIFFERENT = 1e-9
# The sides of a trim's rows. `side`: the number of the side in slot 0 (-1: not known yet). `corner`: the number of the
# side in slot 1 plus one, positive where the loop turns left and negative where it turns right; 0 without a corner.
Corner = namedtuple("Corner", "side corner")


@kernel(inline=True)
def other_side(corner):
    """The number of the side of slot 1, or -1."""
    return abs(corner) - 1


@kernel(inner=True)
def foot_on(store, loop, u, v):
    """The `TrimFoot` (projection) of a point on a whole loop, or on a side of it."""
    return trim_nearest(store, loop, 0, trim_at(store.table, loop).curves, u, v)


@kernel(inner=True)
def nearest_side(store, sides, foot):
    """The number of the side that a projection on the loop is on."""
    found, least = 0, math.inf
    for k in range(sides.stretches):
        stretch = stretch_at(store.table, sides.stretch_table + STRETCH * k)
        if stretch.curve == foot.curve:
            beyond = max(store.pool[stretch.range] - foot.t, foot.t - store.pool[stretch.range + 1], 0.0)
            if beyond < least:
                found, least = stretch.side, beyond
    return found


@kernel(inner=True)
def corner_next_to(store, row, sides, number, at, distance):
    """The corner that a contact on side `number` is next to, if the row of the other side is valid there; else 0.

    `at` is the contact in (u, v), `distance` its distance from the loop, positive inside. The other side ends at
    another corner, beyond which its extension is not valid: in the kept region none is nearer than the nearest side.
    """
    side = side_number(store.table, sides, number)
    foot = foot_on(store, side.loop, at[0], at[1])
    low, high = store.pool[side.range], store.pool[side.range + 1]
    ends = foot.t > 0.5 * (low + high)
    turn, neighbor = (side.turn_after, side.after) if ends else (side.turn_before, side.before)
    if turn == 0:
        return 0
    other = side_number(store.table, sides, neighbor).loop
    near = DIFFERENT * trim_frame_at(store.pool, trim_at(store.table, row.loop).frame).extent
    if row.one_sided == 1:
        kept = 1 if store.pool[row.factor] >= 0.0 else -1
        if turn != kept:
            return 0
        if kept * distance >= 0.0 and kept * foot_on(store, other, at[0], at[1]).distance < kept * distance - near:
            return 0
    elif low <= foot.t <= high and turn * foot_on(store, other, foot.u, foot.v).distance < -near:
        # The loop itself violates the row of the other side there.
        return 0
    return turn * (neighbor + 1)


@kernel(inner=True, allocates=True)
def side_multiplier(store, r, lifted, point, y):
    """The multiplier with which the signed row of slot 0 pushes as the rows of its trim do, from r on.

    A length is a positive multiple of the signed distance, so its own multiplier serves. Components that contain the
    gap combine the signed distance and the gap; their gradients over the twists of a tracked pair tell the shares.
    """
    row = trim_of(store.table, r)
    if row.form == SIGNED or row.by_length == 1:
        return y[r]
    k, o = row.contact, 2 * row.side
    place = trim_place(store, row, point.tracked)
    _s, n, _bend = trim_distance(store, place.loop, point.tracked[k, o], point.tracked[k, o + 1])
    rates = np.zeros((1, point.jacobian.shape[1]))
    add_coordinate_rate(lifted, point.records, k, o, n[0], rates, 0)
    add_coordinate_rate(lifted, point.records, k, o + 1, n[1], rates, 0)
    total = 0.0
    for l in range(row.count):
        total += y[r + l] * part_of(point.jacobian, r + l, rates, k)
    return total / place.factor


@kernel(inner=True)
def goes_on(y_side, y_other, corner, least):
    """Whether a contact on a loop leaves a corner along the other side: see the heading."""
    turn = 1.0 if corner > 0 else -1.0
    return corner != 0 and y_other < -least and turn * y_side > least


@kernel(inner=True)
def chosen_sides(store, row, before, found, at):
    """The `Corner` of a contact `at` (u, v), projected to `found` on the loop; `before` is that of the last iterate."""
    sides = loop_sides_at(store.table, row.sides)
    near = nearest_side(store, sides, found)
    other = other_side(before.corner)
    stays = row.one_sided == 0 and (near == before.side or near == other)
    side = before.side if stays and before.side >= 0 else near
    corner = corner_next_to(store, row, sides, side, at, found.distance)
    if (
        row.one_sided == 1
        and before.corner != 0
        and corner != 0
        and side == other
        and other_side(corner) == before.side
    ):
        # The same two sides in exchanged slots: they stay where they are.
        return before
    return Corner(side, corner)


@kernel(inner=True)
def move_multipliers(row, r, y_side, before, after, y):
    """Give the rows of a trim, from r on, the multipliers that their sides had in other slots, and none to new sides.

    `y_side` is the multiplier with which the signed row of slot 0 pushed.
    """
    second = r + row.count
    two_sided = row.one_sided == 0
    y_other = y[second] if not two_sided or before.corner > 0 else -y[second]
    had, other = other_side(before.corner), other_side(after.corner)
    first = y_side if after.side == before.side else (y_other if after.side == had else 0.0)
    beside = 0.0
    if other >= 0:
        beside = y_side if other == before.side else (y_other if other == had else 0.0)
    if after.side != before.side:
        for l in range(row.count):
            y[r + l] = 0.0
        if row.by_length == 1 or row.form == SIGNED:
            y[r] = first if two_sided else min(first, 0.0)
    y[second] = min(beside if not two_sided or after.corner > 0 else -beside, 0.0)


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), "
        "Tuple((i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[::1])), "
        "Tuple((f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])), f8, f8[::1], f8[::1])"
    ),
    allocates=True,
)
def trim_sides(scene, pairs, at, least, y, proposed):
    """Choose the sides of rows of trims and write them to the tracked values. Returns how many trims changed sides.

    For these, the multipliers `y` and `proposed` move with their sides. At a corner, proposed multipliers above `least`
    in size tell whether the contact goes on along its other side.
    """
    table, pool = scene
    free, lengths, vectors, variables, guess, memory = pairs
    q, tracked, records, residual, jacobian = at
    store, point = Store(table, pool), Iterate(q, tracked, records, residual, jacobian)
    lifted = LiftedPairs(free, lengths, vectors, variables, guess, memory)
    header = header_at(table, 0)
    changed = 0
    for r in range(header.contacts, header.contacts + header.trims):
        row = trim_of(table, r)
        k, o = row.contact, 2 * row.side
        if row.sides < 0 or row.slot == 1 or (r > header.contacts and trim_of(table, r - 1).sides == row.sides):
            # The loop has no corners, or this is not the first row of its trim.
            continue
        if not (math.isfinite(tracked[k, o]) and math.isfinite(tracked[k, o + 1])):
            continue
        place = header.first_side + loop_sides_at(table, row.sides).place
        before = Corner(int(tracked[place, 0]) - 1, int(tracked[place + 1, 0]))
        uv = (tracked[k, o], tracked[k, o + 1])
        found = foot_on(store, row.loop, uv[0], uv[1])
        after = chosen_sides(store, row, before, found, uv)
        y_side = side_multiplier(store, r, lifted, point, y) if before.corner != 0 else y[r]
        pushed = side_multiplier(store, r, lifted, point, proposed) if before.corner != 0 else proposed[r]
        holds = row.one_sided == 0 and after.side == before.side
        if holds and goes_on(pushed, proposed[r + row.count], before.corner, least):
            after = Corner(other_side(before.corner), np.sign(before.corner) * (before.side + 1))
        if after.side != before.side or after.corner != before.corner:
            changed += 1
            move_multipliers(row, r, y_side, before, after, y)
            move_multipliers(row, r, pushed, before, after, proposed)
            tracked[place, 0], tracked[place + 1, 0] = after.side + 1, after.corner
    return changed
