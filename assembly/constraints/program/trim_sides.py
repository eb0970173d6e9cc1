"""The side of its loop that a row of a trim belongs to, where the loop has corners.

The distance from a loop is smooth except at corners. A loop with corners is cut there into sides, each of which goes on
straight beyond its ends (`geometry/faces/loop_sides.py`), and a trim of it has one more row. Its rows have two slots.
Slot 0 has the side that the contact is on, in the form of the trim. Slot 1 has the side that meets it at the corner
next to the contact, as a one-sided row of its signed distance:

    keep "on":                         s_0 = 0,           turn s_1 >= 0,
    keep "inside", convex corner:      s_0 >= 0,          s_1 >= 0,
    keep "outside", reflex corner:    -s_0 >= 0,         -s_1 >= 0,

with `turn` 1 where the loop turns left and -1 where it turns right. So the rows of a solve are smooth near a corner,
and which of them push there is decided as for any active set. Away from corners slot 1 has no side and is idle, and a
one-sided slot 0 belongs to the whole loop: around a corner that is reflex from the contact's side, its distance is that
from a point. Sides are tracked values: they stay during a step and are chosen anew between steps (`trim_corners.py`).
"""

from __future__ import annotations

from collections import namedtuple

from assembly._kernel import kernel
from assembly.constraints.program.records import FREE_COLUMN, SIDE, header_at, loop_sides_at, side_at

# What a row of a trim refers to: a loop (-1: none, the row is idle), its curves as edges, the factor of its distance.
TrimPlace = namedtuple("TrimPlace", "loop edges factor")
# Residual of an idle row [over the size of the scene]: any positive number would do.
OPEN = 1.0


@kernel(inline=True)
def side_number(table, sides, number):
    """The record of side `number` of a loop."""
    return side_at(table, sides.sides + SIDE * number)


@kernel(inline=True)
def trim_place(store, row, tracked):
    """The `TrimPlace` of a row of a trim, a record."""
    factor = store.pool[row.factor]
    if row.sides < 0:
        return TrimPlace(row.loop, row.edges, factor)
    sides = loop_sides_at(store.table, row.sides)
    at = header_at(store.table, 0).first_side + sides.place
    first, corner = int(tracked[at, 0]), int(tracked[at + 1, 0])
    if row.slot == 1:
        if corner == 0:
            return TrimPlace(-1, -1, factor)
        other = side_number(store.table, sides, abs(corner) - 1)
        return TrimPlace(other.loop, other.edges, abs(factor) if corner > 0 else -abs(factor))
    if first > 0 and (row.one_sided == 0 or corner != 0):
        side = side_number(store.table, sides, first - 1)
        return TrimPlace(side.loop, side.edges, factor)
    return TrimPlace(row.loop, row.edges, factor)


@kernel(inner=True)
def part_of(jacobian, r, rates, k):
    """The number a with row r = a rates + b row k, by least squares."""
    ss = 0.0
    sg = 0.0
    gg = 0.0
    rs = 0.0
    rg = 0.0
    for j in range(FREE_COLUMN + 4):
        ss += rates[0, j] * rates[0, j]
        sg += rates[0, j] * jacobian[k, j]
        gg += jacobian[k, j] * jacobian[k, j]
        rs += jacobian[r, j] * rates[0, j]
        rg += jacobian[r, j] * jacobian[k, j]
    det = ss * gg - sg * sg
    return (rs * gg - rg * sg) / det if det > 1e-12 * ss * gg else 0.0
