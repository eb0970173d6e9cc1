"""Rows of clearances that stay open for certain along a step, and so are not evaluated at its end."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import Store
from assembly.constraints.program import records as layout
from assembly.constraints.program.evaluate import evaluate
from assembly.proximity.extrema.lifted_pair import VARIABLES, VECTORS
from assembly.proximity.features.solid_contact import CONTACT_RECORD, IDLE, PAIR_GAP, SLACK, TRACK
from assembly.proximity.manager import update as watch
from assembly.proximity.manager.records import PAIR_MEMORY, QUERY_MARGIN, memory_places
from assembly.solve.loop.clearances import place_clearance_rows
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.residuals import arrange, move, record_of_blocks
from assembly.solve.loop.workspace import new_rows
from tests.laws.loop_point import room_of_shape

SHAPES = {
    "rings": lambda: asm.shapes.torus(1.0, 0.1),
    "eggs": lambda: asm.shapes.ellipsoid(0.7, 0.5, 0.4),
}


class Near:
    """Three bodies near each other whose origins are not in their middles, one of them fixed, with a clearance."""

    def __init__(self, rng, shape, minimum):
        bodies = []
        for k in range(3):
            turn = Rotation.random(rng=rng).as_quat(scalar_first=True)
            bodies.append(asm.Body(f"body {k}", shape, 0.3 * rng.normal(size=3) + [1.6 * k, 0, 0], turn, fixed=k == 1))
        scene = asm.Assembly(bodies)
        scene.constrain(asm.Clearance(minimum=minimum))
        self.packed = packed = scene.packed()
        self.table, self.pool = table, pool = packed.table, packed.pool
        self.n = 6 * int(table[layout.MOVING])
        rows = int(table[layout.ROWS])
        self.shape = room_of_shape(table, rows, self.n, record_of_blocks(table))
        self.free = np.full(rows, -1, dtype=np.int64)
        room = np.empty((VECTORS, 3, VARIABLES)), np.empty((VARIABLES, VARIABLES))
        self.memory = packed._memory.copy()
        self.loose = layout.LiftedPairs(self.free, np.empty((rows, 4)), *room, np.zeros((rows, TRACK)), self.memory)
        at = table[layout.TAPE_WORKSPACE]
        self.room = layout.TapeWorkspace(*(np.empty(size) for size in table[at : at + 3]))
        q = scene.q.copy()
        q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
        self.here = self.point(q)
        self.here.tracked[:] = np.nan
        # What is listed is to be farther away, too.
        pairs, places, _ = memory_places(table, table[layout.MANAGER_RECORD])
        self.memory[pairs:places].reshape(-1, PAIR_MEMORY)[:, QUERY_MARGIN] = 1.0
        watch.update(table, pool, table[layout.MANAGER_RECORD], self.memory, q, self.here.tracked, watch.EVERYTHING)
        self.program = layout.Program(Store(table, pool), self.shape, self.loose, self.room, None)
        place_clearance_rows(table, self.loose, self.here, new_rows(rows, 1.0), True)
        arrange(table, self.free, self.shape, rows, self.n)
        self.rows = rows
        self.exactly(self.here)

    def point(self, q):
        """Room for a point at these poses."""
        rows = int(self.table[layout.ROWS])
        records = np.full((rows, CONTACT_RECORD), np.nan)
        return layout.Iterate(q.copy(), np.zeros((rows, TRACK)), records, np.zeros(rows), np.full((rows, 16), np.nan))

    def exactly(self, point):
        """Every row by its pair."""
        start = point.tracked.copy()
        return evaluate(self.program, start, np.inf, point) < 0

    def step(self, d):
        """The point that a step leads to, as the loop evaluates it, and which rows it took as open."""
        trial = self.point(self.here.q)
        move(self.table, self.here.q, d, 1.0, trial.q)
        predict_pairs(Store(self.table, self.pool), self.shape.bases, self.loose, self.here, trial, d, 1.0)
        idle = self.loose.guess[:, IDLE] == 1.0
        found = evaluate(self.program, self.loose.guess, np.inf, trial) < 0
        return trial, idle, found


@pytest.mark.parametrize("minimum", [0.0, 0.02])
@pytest.mark.parametrize("name", SHAPES)
def test_rows_that_are_not_evaluated_are_open_and_nearly_what_they_would_be(name, minimum, cases):
    rng = np.random.default_rng(4)
    skipped = evaluated = 0
    count = cases(2, 14)
    for _ in range(count):
        near = Near(rng, SHAPES[name](), minimum)
        size = 10.0 ** rng.uniform(-3.0, -0.7)
        # Several steps in a row: what is left of a gap goes on from each to the next one.
        gone = 0.0
        for _ in range(6):
            d = size * rng.normal(size=near.n) / np.sqrt(near.n)
            trial, idle, found = near.step(d)
            if not found:
                break
            gone += np.abs(d).sum()
            exact = near.point(trial.q)
            exact.tracked[:] = trial.tracked
            if not near.exactly(exact) or (np.isnan(exact.tracked[:, 0]) != np.isnan(near.here.tracked[:, 0])).any():
                # A pair that a step as long as that leads elsewhere: no row says anything of it.
                break
            for r in np.flatnonzero(idle):
                # What is left falls by what both bodies may have moved.
                minimum_at = int(near.table[near.table[layout.ROW_TABLE] + layout.ROW * r + layout.MINIMUM])
                gone_now = 0.0
                for side, at in enumerate(near.shape.bases[r, :2]):
                    if at >= 0:
                        reach = near.pool[minimum_at + 4 + side]
                        gone_now += np.linalg.norm(d[at : at + 3]) + reach * np.linalg.norm(d[at + 3 : at + 6])
                assert trial.records[r, SLACK] == pytest.approx(near.here.records[r, SLACK] - gone_now, abs=1e-15)
                # No less than is left; and what a step makes of a gap to first order.
                assert exact.residual[r] >= trial.records[r, SLACK] > 0.0
                assert trial.residual[r] >= trial.records[r, SLACK]
                assert abs(exact.residual[r] - trial.residual[r]) < 60.0 * gone**2
                assert trial.tracked[r, IDLE] == 0.0 and trial.tracked[
                    r, PAIR_GAP
                ] - minimum / near.packed.scale == pytest.approx(trial.residual[r], abs=1e-15)
            skipped += int(idle.sum())
            evaluated += int((~idle & ~np.isnan(trial.tracked[:, 0])).sum())
            near.here = trial
    assert skipped > 15 / 14 * count and evaluated > 10 / 14 * count


def test_rows_that_may_close_are_evaluated():
    rng = np.random.default_rng(6)
    near = Near(rng, SHAPES["rings"](), 0.0)
    left = np.nanmax(near.here.records[:, SLACK])
    assert left > 0.0
    far = near.pool[near.table[near.table[layout.ROW_TABLE] + layout.MINIMUM :: layout.ROW][0] + 4]
    for body in range(near.n // 6):
        for k in range(6):
            d = np.zeros(near.n)
            # As far as may close the widest of these gaps: by a shift, or a turn of what is farthest away.
            d[6 * body + k] = 1.001 * left / (1.0 if k < 3 else far)
            _, idle, _ = near.step(d)
            moved = near.shape.bases[: near.rows, :2] == 6 * body
            assert not (idle & moved.any(axis=1)).any()
