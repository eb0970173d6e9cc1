"""Contacts of solids that come to lie on each other: their corners first, then that they touch.

The gap of a contact is the minimum of the gaps at its corners (`constraints/packing/corners.py`), and has a kink where
several are equal. The loop first keeps all corners from crossing, each a smooth row g_i >= 0, without the contacts
themselves. From the end of that it continues with the contacts: bodies that are pressed together touch there already,
and others are drawn to each other by min g_i = 0.

A contact's row is then held at the corner that is nearest, g_k = 0, and does not switch from corner to corner while
bodies slide on each other. With all others one-sided that is min g_i = 0 as long as corner k pushes. If it would have
to pull, another corner might open less, and the row is that of the nearest features.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.records import BODY_F, BODY_G, ONE_SIDED, ROW, ROW_TABLE
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.features.holding import HELD_F, HELD_G
from assembly.proximity.features.solid_contact import ALLOWED, IDLE, STAYS, TRACK, TRACKED_PAIR
from assembly.solve.loop.settings import FIT, GATHER, PENALTY, PENALTY_FLOOR, PLACES, SOLVED, UNSURE
from assembly.solve.second_order.leave import Fit, Outcome

__all__ = ["corners_first", "with_corners"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Multipliers below this part of the largest are rounding: stationarity is required to 1e-9.
PULLS = 1e-8


def with_corners(packed: Packed) -> list[int]:
    """The rows of contacts whose corners are listed, for themselves or by a clearance of the same two bodies."""
    if not packed.clearance_rows:
        return []
    own = {id(item.contact) for item in packed.corners}
    kept = {
        frozenset(map(id, pair))
        for clearance, pairs in zip(packed.clearances, packed.clearance_pairs, strict=True)
        for pair in pairs
        if clearance.corners
    }
    return [
        row
        for row, (contact, is_whole) in enumerate(zip(packed.contacts, packed.whole, strict=True))
        if id(contact) in own or (not is_whole and frozenset(map(id, contact.bodies)) in kept)
    ]


def corners_first(
    packed: Packed,
    settings: Array,
    start: Callable[[], Array],
    run: Callable[[Table, Array, Array], Outcome],
    go_on: Callable[[Packed, Array, Array], Outcome],
) -> Outcome | None:
    """The outcome of a solve that keeps corners apart before it asks for contacts; None where it does not hold.

    Parameters
    ----------
    packed : Packed
    settings : array
    start : callable
        Makes the state of the solve's start.
    run, go_on : callables
        The loop with a table, settings and a state; and from a state that a solve has led to.
    """
    rows = with_corners(packed)
    state = start()
    tracked = state[packed.contacts_at : packed.angles_at].reshape(-1, TRACK)
    if settings[PENALTY] > settings[PENALTY_FLOOR]:
        # In a first solve a pair is known only if the user has given its start: that contact keeps it.
        rows = [row for row in rows if np.isnan(tracked[row, 0])]
    # Where the others are is found anew once bodies are there.
    tracked[rows] = np.nan
    state[packed.multipliers_at : packed.residuals_at][rows] = 0.0
    if not rows:
        return None
    outcome = run(_left_alone(packed.table, rows), settings, state)
    if settings[PLACES] == 1.0 and packed.is_crowded(outcome.state):
        return outcome
    if outcome.code not in (SOLVED, UNSURE):
        return None
    settings = settings.copy()
    settings[GATHER] = 0.0
    for holds in (True, False):
        state = outcome.state.copy()
        # Rows that the loop left there are without the contacts.
        state[packed.kept_at :] = 0.0
        for row in rows:
            _take_nearest(packed, state, row, holds)
        found = go_on(packed, settings, state)
        if settings[PLACES] == 1.0 and packed.is_crowded(found.state):
            return found
        if found.code == SOLVED and not (holds and _pulls(packed, found.state, rows)):
            return found._replace(fit=found.fit or Fit(float(settings[FIT])))
    return None


def _pulls(packed: Packed, state: Array, rows: Sequence[int]) -> bool:
    """Whether a contact has a multiplier that a row >= 0 does not allow, beyond rounding."""
    multipliers = state[packed.multipliers_at : packed.residuals_at]
    return bool(multipliers[rows].max() > PULLS * np.abs(multipliers).max())


def _left_alone(table: Table, rows: Sequence[int]) -> Table:
    """A table in which rows of contacts are idle: without bodies, and one-sided, so that they ask for nothing."""
    table = table.copy()
    for row in rows:
        contact = table[table[ROW_TABLE] + ROW * row :]
        contact[[BODY_F, BODY_G]], contact[ONE_SIDED] = -1, 1
    return table


def _take_nearest(packed: Packed, state: Array, row: int, holds: bool) -> None:
    """Let a contact begin with the pair of the corner that is nearest, where one is listed for it; whether it holds it.

    Of solids that touch a search from nothing finds points that they have in common, and no pair. A clearance may list
    the two bodies the other way around.
    """
    tracked = state[packed.contacts_at : packed.angles_at].reshape(-1, TRACK)
    gaps = state[packed.residuals_at :]
    sides = packed.sides[row]
    first, nearest, is_turned = len(packed.contacts), -1, False
    for k, (pair, _) in enumerate(packed.listed(state)):
        if pair < 0 or not (nearest < 0 or gaps[first + k] < gaps[first + nearest]):
            continue
        a, b = packed.kept_pairs[pair]
        if (a is sides[0] and b is sides[1]) or (a is sides[1] and b is sides[0]):
            nearest, is_turned = k, a is not sides[0]
    if nearest >= 0:
        tracked[row] = tracked[first + nearest]
        if is_turned:
            contact = packed.table[packed.table[ROW_TABLE] + ROW * row :]
            q = state[: packed.contacts_at].reshape(-1, 7)
            _turn_around(tracked[row], q[contact[BODY_F], 3:], q[contact[BODY_G], 3:])
        # It has no allowed overlap yet.
        tracked[row, [IDLE, ALLOWED]] = 0.0
        if not holds:
            tracked[row, STAYS] = 0.0


def _turn_around(tracked: Array, turn_f: Array, turn_g: Array) -> None:
    """Make a tracked pair of bodies g and f, (TRACK,), that of f and g; the quaternions of both."""
    (pair,) = rows_of(TRACKED_PAIR, tracked[None])
    pair.parameters = pair.parameters[[2, 3, 0, 1]]
    pair.feature_f, pair.feature_g = pair.feature_g, pair.feature_f
    pair.normal = -rotation_matrix(turn_f).T @ rotation_matrix(turn_g) @ pair.normal
    pair.stays = {HELD_F: HELD_G, HELD_G: HELD_F}.get(float(pair.stays), pair.stays)
