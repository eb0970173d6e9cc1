"""When a solve begins again, and which contacts that end may stay behind."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.constraints.contact_rows import HARDLY, MAY_GO, TOUCHING, hold_all, lost_guard, may_go
from assembly.constraints.layout import FIRST_GUARD, FREE_COLUMN, GUARDS, HEADER, MINIMUM, ROW, ROW_TABLE, SHELL_F
from assembly.proximity.solid_contact import CONTACT_RECORD, PAIR_GAP, STAYS, TRACK
from assembly.solve.afresh import BEGINNINGS, BEGUN, LEAST_PART, LEFT, PACE, STRIDE, creeps, may_begin, set_pace

LEAST = 0.25


def creeping(values, begun=0.0, start=0):
    """At which steps a solve with these objectives is said to creep."""
    pace = np.full(PACE, np.nan)
    set_pace(pace, 0.0, 0)
    creeps(pace, 0, values[0])
    if begun > 0.0:
        set_pace(pace, begun, start)
    assert pace[BEGUN] == begun
    return [k for k, value in enumerate(values[1:], start + 1) if creeps(pace, k, value)]


@pytest.mark.parametrize("offset", [10.0, -10.0, 1e3])
@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_a_solve_creeps_where_its_objective_gains_little_of_what_it_gained_in_all(factor, offset):
    # From 2 to 1 in the first steps, then by so much every so many.
    gains = np.arange(3 * STRIDE + 1) // STRIDE
    least = LEAST_PART * factor
    values = np.where(np.arange(len(gains)) < STRIDE, 2.0, 1.0 / (1.0 - least) ** (1.0 - gains)) + offset
    values[STRIDE:] = offset + 2.0 - 1.0 / (1.0 - least) ** (gains[STRIDE:] - 1.0)
    assert creeping(values) == ([2 * STRIDE, 3 * STRIDE] if factor < 1.0 else [])
    # It began again: what it gained before counts, and there is nothing to compare the first one with.
    again = np.r_[values[0], np.full(2 * STRIDE, values[STRIDE])]
    assert creeping(again, begun=1.0, start=70) == [70 + 2 * STRIDE]


def test_a_solve_that_gets_on_does_not_creep_nor_one_that_had_nothing_to_gain():
    assert creeping(0.9 ** (np.arange(500) / STRIDE)) == []
    assert creeping(np.ones(500)) == []
    # One that comes near to nothing by a part of it each time.
    assert creeping(1e-6 * 0.9 ** (np.arange(500) / STRIDE) + (np.arange(500) < STRIDE)) == []
    # Between two that are compared it may do what it likes.
    values = 0.9 ** (np.arange(500) // STRIDE) * np.where(np.arange(500) % STRIDE == 0, 1.0, 7.0)
    assert creeping(values) == []


def test_a_solve_begins_again_a_few_times_while_there_are_steps():
    pace = np.zeros(PACE)
    for begun in range(BEGINNINGS + 2):
        set_pace(pace, float(begun), 0)
        assert may_begin(pace, 10, 10 + LEFT) == (begun < BEGINNINGS)
        assert not may_begin(pace, 11, 10 + LEFT)


def guards(gap, solids=True):
    """The table, the pool, what is tracked and a point of two rows of a clearance, of which the first is open."""
    table = np.zeros(HEADER + 2 * ROW, dtype=np.int64)
    table[ROW_TABLE], table[FIRST_GUARD], table[GUARDS] = HEADER, 0, 2
    table[[HEADER + MINIMUM, HEADER + ROW + MINIMUM]] = 1
    table[[HEADER + SHELL_F, HEADER + ROW + SHELL_F]] = 0 if solids else -1
    start = np.full((2, TRACK), 0.5)
    start[:, STAYS] = 0.0
    start[:, PAIR_GAP] = LEAST + 1.0, LEAST + gap
    point = None, start.copy(), np.full((2, CONTACT_RECORD), np.nan), np.full(2, np.nan), np.full((2, 16), np.nan)
    return table, np.array([0.0, LEAST]), start, point


@pytest.mark.parametrize("solids", [True, False])
@pytest.mark.parametrize("gap", [1.0, 1e-12, -1e-12, -0.5 * TOUCHING, -2.0 * TOUCHING, -0.5])
def test_a_contact_that_ends_stays_behind_where_it_is_open_or_solids_touch(gap, solids):
    table, pool, start, point = guards(gap, solids)
    stays_behind = lost_guard(table, pool, 1, start, point, False, False)
    assert stays_behind == (gap > (-TOUCHING if solids else 0.0))
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
    assert lost_guard(table, pool, 1, tracked, point, False, False) and residual[1] == pytest.approx(gap, abs=1e-16)


def test_a_contact_that_is_not_open_stays_behind_where_it_goes_or_is_past_its_face():
    for past, goes, told in ((False, True, -0.5), (True, False, 0.0)):
        table, pool, start, point = guards(-0.5)
        assert lost_guard(table, pool, 1, start, point, past, goes)
        assert point[3][1] == told and np.isnan(point[1][1, 0])


def test_only_contacts_of_solids_that_are_hardly_in_each_other_may_go():
    for gap, solids, expected in ((-0.9 * HARDLY, True, True), (-1.1 * HARDLY, True, False), (-1e-12, False, False)):
        table, *_rest = guards(gap, solids)
        assert may_go(table, 1, np.array([1.0, gap])) == expected
    # A row of the scene's own is no clearance's.
    table[FIRST_GUARD], table[GUARDS] = 0, 1
    assert not may_go(table, 1, np.array([1.0, 0.0]))


def test_contacts_that_could_go_are_held_again_as_before():
    table, _pool, start, _point = guards(0.0)
    for holds in (0.0, 1.0, 2.0, 3.0):
        start[:, STAYS] = MAY_GO - holds, holds
        hold_all(table, start)
        assert (start[:, STAYS] == holds).all()
