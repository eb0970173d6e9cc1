"""A point of the loop outside it: rows, objective and derivatives of a scene at poses, by the loop's own functions.

Called from Python they run as plain Python: slow, and without a compiler between the test and the formula.
"""

from __future__ import annotations

import numpy as np

from assembly.constraints import layout, program
from assembly.proximity.free_pair import VARIABLES, VECTORS
from assembly.proximity.solid_contact import CONTACT_RECORD, TRACK
from assembly.solve.contacts import start_contacts
from assembly.solve.rows import envelope, place_rows
from assembly.solve.search import goal


class LoopPoint:
    """The scene's program with every row evaluated at q (n, 7), no pair free."""

    def __init__(self, scene, q, tracked=None):
        packed = scene.packed()
        packed.refresh()
        self.packed, self.table, self.pool = packed, packed.table, packed.pool
        table = packed.table
        self.rows, self.n = int(table[layout.ROWS]), 6 * int(table[layout.MOVING])
        scaled = np.array(q, dtype=float)
        scaled[:, :3] = (scaled[:, :3] - packed.reference) / packed.scale
        pairs, tracks = int(table[layout.CONTACTS]), int(table[layout.TRACKED])
        self.point = (
            scaled,
            np.zeros((tracks, TRACK)),
            np.ones((pairs + int(table[layout.JOINTS] + table[layout.VECTOR_TRIMS]), CONTACT_RECORD)),
            np.empty(self.rows),
            np.zeros((self.rows, layout.EXTRA_COLUMN + 6 * int(table[layout.EXTRA]))),
        )
        self.shape = (
            np.empty((self.rows, 3 + int(table[layout.EXTRA])), dtype=np.int64),
            np.empty(max(self.rows, 1), dtype=np.int64),
            np.empty(self.n, dtype=np.int64),
            np.empty(max(self.rows, 1), dtype=np.int64),
        )
        free = np.full(pairs, -1, dtype=np.int64)
        room = (np.empty((VECTORS, 3, VARIABLES)), np.empty((VARIABLES, VARIABLES)))
        self.loose = (free, np.empty((pairs, 4)), *room, np.empty((tracks, TRACK)))
        at = table[layout.TAPE_ROOM]
        self.room = tuple(np.empty(size) for size in table[at : at + 3])
        place_rows(table, free, self.shape[0], self.shape[1])
        envelope(table, self.shape[0], self.rows, self.n, self.shape[2], self.shape[3])
        if tracked is None:
            state = np.zeros(packed.results_at)
            state[packed.contacts_at : packed.angles_at] = np.nan
            packed.start_angles(np.array(q, dtype=float), state, False)
            tracked = state[packed.contacts_at : packed.multipliers_at].reshape(-1, TRACK)
            start = (table, self.pool, scaled, tracked, free, self.loose[1])
            # Solids that cross are looked for where a scene asks for it.
            assert start_contacts(*start) < 0 or (packed.seek_penetration() and start_contacts(*start) < 0)
        lost = program.evaluate(table, self.pool, np.array(tracked), np.inf, self.loose, self.room, self.point)
        assert lost < 0

    @property
    def residual(self):
        return self.point[3]

    @property
    def tracked(self):
        return self.point[1]

    def jacobian(self):
        """Dense, (rows, n): a row's twists at the places of its bodies."""
        out = np.zeros((self.rows, self.n))
        for r in range(self.rows):
            for b, at in enumerate(self.shape[0][r]):
                if at >= 0:
                    column = 6 * b if b < 2 else layout.EXTRA_COLUMN + 6 * (b - 3)
                    out[r, at : at + 6] += self.point[4][r, column : column + 6]
        return out

    def goal(self, order=1):
        """Value, gradient (n,) and Hessian (n, n) of the objective."""
        gradient, hessian = np.zeros(self.n), np.zeros((self.n, self.n))
        value = goal(
            self.table,
            self.pool,
            self.shape,
            self.rows,
            self.loose,
            self.room,
            self.packed.tips,
            self.point,
            order,
            gradient,
            hessian,
        )
        return value, gradient, np.triu(hessian) + np.triu(hessian, 1).T

    def row_terms(self, y):
        """Second derivative of y . rows, (n, n)."""
        hessian = np.zeros((self.n, self.n))
        program.add_row_terms(
            self.table,
            self.pool,
            self.loose,
            self.room,
            self.shape[0],
            self.point,
            np.asarray(y, dtype=float),
            np.zeros(self.rows),
            hessian,
        )
        return np.triu(hessian) + np.triu(hessian, 1).T


def moved(scene, q, step):
    """Poses retracted by a step (n,) of the loop's unknowns: lengths over the scene's size, bodies by their slots."""
    from assembly.kinematics.pose import retract

    packed = scene.packed()
    slots = packed.table[packed.table[layout.SLOTS] :][: len(q)]
    out = np.array(q, dtype=float)
    for k, slot in enumerate(slots):
        if slot >= 0:
            twist = np.array(step[6 * slot : 6 * slot + 6])
            twist[:3] *= packed.scale
            out[k] = retract(out[k], twist)
    return out
