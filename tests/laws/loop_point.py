"""A point of the loop outside it: rows, objective and derivatives of a scene at poses, by the loop's own functions.

Called from Python they run as plain Python: slow, and without a compiler between the test and the formula.
"""

from __future__ import annotations

import numpy as np

from assembly._record import Store
from assembly.constraints.program import records as layout
from assembly.constraints.program import row_terms
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.hessian_blocks import BLOCKS, COLUMN, COUNT, FIRST, PLACE, is_blocked
from assembly.proximity.extrema.lifted_pair import VARIABLES, VECTORS
from assembly.proximity.features.solid_contact import CONTACT_RECORD, TRACK
from assembly.solve.loop.contacts import start_contacts
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.residuals import arrange, record_of_blocks, shape_of, size_of_shape


def room_of_shape(table, rows, n, blocks):
    """Room for where rows and unknowns stand."""
    integers, doubles = size_of_shape(table, rows, n)
    return shape_of(table, rows, n, blocks, np.zeros(integers, dtype=np.int64), np.zeros(doubles))


class LoopPoint:
    """The scene's program with every row evaluated at q (n, 7), no pair free; its Hessian by blocks, if it is to be."""

    def __init__(self, scene, q, tracked=None, blocks=False):
        packed = scene.packed()
        packed.refresh()
        self.packed, self.table, self.pool = packed, packed.table, packed.pool
        table = packed.table
        self.rows, self.n = int(table[layout.ROWS]), 6 * int(table[layout.MOVING])
        scaled = np.array(q, dtype=float)
        scaled[:, :3] = (scaled[:, :3] - packed.reference) / packed.scale
        pairs, tracks = int(table[layout.CONTACTS]), int(table[layout.TRACKED])
        self.point = layout.Iterate(
            scaled,
            np.zeros((tracks, TRACK)),
            np.ones((pairs + int(table[layout.JOINTS] + table[layout.VECTOR_TRIMS]), CONTACT_RECORD)),
            np.empty(self.rows),
            np.zeros((self.rows, layout.EXTRA_COLUMN + 6 * int(table[layout.EXTRA]))),
        )
        self.shape = room_of_shape(table, self.rows, self.n, record_of_blocks(table) if blocks else table[:0])
        free = np.full(pairs, -1, dtype=np.int64)
        workspace = (np.empty((VECTORS, 3, VARIABLES)), np.empty((VARIABLES, VARIABLES)))
        self.loose = layout.LiftedPairs(free, np.empty((pairs, 4)), *workspace, np.empty((tracks, TRACK)), np.empty(0))
        at = table[layout.TAPE_WORKSPACE]
        self.workspace = layout.TapeWorkspace(*(np.empty(size) for size in table[at : at + 3]))
        arrange(table, free, self.shape, self.rows, self.n)
        self.program = layout.Program(
            Store(table, self.pool), self.shape, self.loose, self.workspace, packed.end_effectors
        )
        if tracked is None:
            state = np.zeros(packed.results_at)
            state[packed.contacts_at : packed.angles_at] = np.nan
            state[: packed.contacts_at] = np.ravel(q)
            packed.start_angles(state, False)
            tracked = state[packed.contacts_at : packed.multipliers_at].reshape(-1, TRACK)
            start = (self.program.store, scaled, tracked, free, self.loose.lengths)
            # Solids that cross are looked for where a scene asks for it.
            assert start_contacts(*start) < 0 or (packed.seek_penetration() and start_contacts(*start) < 0)
        lost = evaluate(self.program, np.array(tracked), np.inf, self.point)
        assert lost < 0

    @property
    def residual(self):
        return self.point.residual

    @property
    def tracked(self):
        return self.point.tracked

    def jacobian(self):
        """Dense, (rows, n): a row's twists at the places of its bodies."""
        out = np.zeros((self.rows, self.n))
        for r in range(self.rows):
            for b, at in enumerate(self.shape.bases[r]):
                if at >= 0:
                    column = 6 * b if b < 2 else layout.EXTRA_COLUMN + 6 * (b - 3)
                    out[r, at : at + 6] += self.point.jacobian[r, column : column + 6]
        return out

    def room_for_hessian(self):
        """An array for it, dense or by blocks."""
        order = self.shape.sparsity
        return np.zeros((6 * order.blocks[BLOCKS], 6) if is_blocked(order) else (self.n, self.n))

    def dense(self, hessian):
        """The symmetric matrix of what was written to an array."""
        order = self.shape.sparsity
        if is_blocked(order):
            parts, hessian = hessian, np.zeros((self.n, self.n))
            blocks, first, column = order.blocks, order.blocks[FIRST], order.blocks[COLUMN]
            slots = np.argsort(blocks[blocks[PLACE] : blocks[PLACE] + blocks[COUNT]])
            for p in range(blocks[COUNT]):
                for e in range(blocks[first + p], blocks[first + p + 1]):
                    low, high = sorted((slots[p], slots[blocks[column + e]]))
                    hessian[6 * low : 6 * low + 6, 6 * high : 6 * high + 6] = parts[6 * e : 6 * e + 6]
        return np.triu(hessian) + np.triu(hessian, 1).T

    def goal(self, order=1):
        """Value, gradient (n,) and Hessian (n, n) of the objective."""
        gradient, hessian = np.zeros(self.n), self.room_for_hessian()
        value = goal(self.program, self.rows, self.point, order, gradient, hessian)
        return value, gradient, self.dense(hessian)

    def row_terms(self, y, weights=None):
        """Second derivative of y . rows + J^T diag(weights) J, (n, n)."""
        hessian = self.room_for_hessian()
        weights = np.zeros(self.rows) if weights is None else np.asarray(weights, dtype=float)
        row_terms.add_row_terms(self.program, self.point, np.asarray(y, dtype=float), weights, hessian)
        return self.dense(hessian)


def moved(scene, q, step):
    """Poses retracted by a step (n,) of the loop's unknowns: lengths over the scene's size, bodies by their blocks."""
    from assembly.kinematics.pose import retract

    packed = scene.packed()
    blocks = packed.table[packed.table[layout.UNKNOWN_BLOCKS] :][: len(q)]
    out = np.array(q, dtype=float)
    for k, block in enumerate(blocks):
        if block >= 0:
            twist = np.array(step[6 * block : 6 * block + 6])
            twist[:3] *= packed.scale
            out[k] = retract(out[k], twist)
    return out
