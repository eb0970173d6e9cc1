"""Which contacts that end may stay behind, and which are given up."""

from __future__ import annotations

import numpy as np
import pytest

from assembly._record import Store
from assembly.constraints.program.contact import HARDLY, MAY_GO, hold_all, lost_clearance_row, may_go
from assembly.constraints.program.records import (
    CLEARANCE_ROWS,
    CONTACTS,
    FIRST_CLEARANCE_ROW,
    FREE_COLUMN,
    HEADER,
    MINIMUM,
    ROW,
    ROW_TABLE,
    SHELL_F,
    Iterate,
)
from assembly.proximity.features.solid_contact import ALLOWED, CONTACT_RECORD, PAIR_GAP, STAYS, TRACK
from assembly.solve.loop.contacts import start_contacts

LEAST = 0.25


def clearance_rows(gap, solids=True):
    """The table, the pool, what is tracked and a point of two rows of a clearance, of which the first is open."""
    table = np.zeros(HEADER + 2 * ROW, dtype=np.int64)
    table[ROW_TABLE], table[FIRST_CLEARANCE_ROW], table[CLEARANCE_ROWS] = HEADER, 0, 2
    table[[HEADER + MINIMUM, HEADER + ROW + MINIMUM]] = 1
    table[[HEADER + SHELL_F, HEADER + ROW + SHELL_F]] = 0 if solids else -1
    start = np.full((2, TRACK), 0.5)
    start[:, [STAYS, ALLOWED]] = 0.0
    start[:, PAIR_GAP] = LEAST + 1.0, LEAST + gap
    records = np.full((2, CONTACT_RECORD), np.nan)
    point = Iterate(None, start.copy(), records, np.full(2, np.nan), np.full((2, 16), np.nan))
    return table, np.array([0.0, LEAST]), start, point


@pytest.mark.parametrize("solids", [True, False])
@pytest.mark.parametrize("gap", [1.0, 1e-12, -1e-12, -5e-10, -2e-9, -0.5])
def test_a_contact_that_ends_stays_behind_where_it_is_open_or_solids_touch(gap, solids):
    table, pool, start, point = clearance_rows(gap, solids)
    stays_behind = lost_clearance_row(Store(table, pool), 1, start, point, False, False)
    assert stays_behind == (gap > (-1e-9 if solids else 0.0))
    _q, tracked, records, residual, jacobian = point
    if not stays_behind:
        # Nothing was written: the step is refused.
        assert np.isnan(residual).all() and (tracked == start).all()
        return
    # What is known of it is told, also that it is not open; it moves nothing, and the next look finds it lost.
    assert residual[1] == pytest.approx(gap, abs=1e-16) and tracked[1, PAIR_GAP] == LEAST + residual[1]
    assert np.isnan(tracked[1, 0]) and (jacobian[1, :FREE_COLUMN] == 0.0).all() and np.isfinite(records[1]).any()
    assert np.isnan(residual[0])
    # It may be evaluated again, however often.
    assert lost_clearance_row(Store(table, pool), 1, tracked, point, False, False) and residual[1] == pytest.approx(
        gap, abs=1e-16
    )


def test_a_contact_that_is_not_open_stays_behind_where_it_goes_or_is_past_its_face():
    for past, goes, told in ((False, True, -0.5), (True, False, 0.0)):
        table, pool, start, point = clearance_rows(-0.5)
        assert lost_clearance_row(Store(table, pool), 1, start, point, past, goes)
        assert point.residual[1] == told and np.isnan(point.tracked[1, 0])


def test_only_contacts_of_solids_that_are_hardly_in_each_other_may_go():
    for gap, solids, expected in ((-0.9 * HARDLY, True, True), (-1.1 * HARDLY, True, False), (-1e-12, False, False)):
        table, *_rest = clearance_rows(gap, solids)
        assert may_go(table, 1, np.array([1.0, gap])) == expected
    # A row of the scene's own is no clearance's.
    table[FIRST_CLEARANCE_ROW], table[CLEARANCE_ROWS] = 0, 1
    assert not may_go(table, 1, np.array([1.0, 0.0]))


def test_contacts_that_could_go_are_held_again_as_before():
    table, _pool, start, _point = clearance_rows(0.0)
    for holds in (0.0, 1.0, 2.0, 3.0):
        start[:, STAYS] = MAY_GO - holds, holds
        hold_all(table, start)
        assert (start[:, STAYS] == holds).all()


def test_a_start_leaves_to_the_watch_what_a_clearance_has_lost():
    for solids in (True, False):
        table, pool, start, _point = clearance_rows(0.0, solids)
        table[CONTACTS] = 2
        start[:, 0] = np.nan
        assert start_contacts(Store(table, pool), None, start, np.full(2, -1), None) == -1
        assert np.isnan(start[:, 0]).all()
