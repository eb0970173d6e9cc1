"""An end effector's Jacobian at a state, outside the loop: what `solve/forces/end_effector.py` calls."""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.objective_terms import term_at
from assembly.constraints.program.records import header_at
from assembly.solve.dense.row_table import point_at
from assembly.solve.linear_algebra.singular_values import measure_jacobian
from assembly.solve.loop.dexterity import DEPENDENT, DIRECTION, dexterity_at, end_effector_map
from assembly.solve.loop.residuals import place_rows


@kernel(signatures="(i8[::1], f8[::1], i8, f8[::1], i8[::1], f8[:, ::1])", allocates=True)
def end_effector_at(table, pool, term, state, free, jacobian):
    """The Jacobian of a term of dexterity at a state, in the user's units.

    Returns a contact that has no pair there or -1, an outcome of `dexterity.end_effector_map`, and the measure.
    """
    store = Store(table, pool)
    header = header_at(table, 0)
    term_record = term_at(table, term)
    at = point_at(store, state, free)
    lost, count = at.lost, at.count
    if lost >= 0:
        return lost, DEPENDENT, 0.0
    rows = header.rows + 4 * count
    bases = np.empty((rows, 3 + header.extra), np.int64)
    place_rows(table, free, bases, np.empty(rows, np.int64))
    effector = end_effector_map(store, term, bases, rows, 6 * header.moving + 4 * count, at.iterate, 1)
    found = effector.jacobian
    jacobian[:] = found
    measure = dexterity_at(table, term_record.tape).measure
    value = measure_jacobian(measure, pool, term_record.parameters + DIRECTION, found, np.empty(found.shape))
    return lost, effector.outcome, value
