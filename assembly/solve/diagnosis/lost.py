"""Honest figures of a pose at which a contact has no extremal pair, so that the loop had no rows to evaluate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from assembly.solve.dense.jacobian import NoPairError, rows_of
from assembly.solve.dense.row_table import gradient_at
from assembly.solve.diagnosis.subset import Snapshot

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["goal", "violations"]


def violations(solution: Solution) -> dict[str, float]:
    """Violation of every constraint, by name, in the user's units.

    Of a contact without a pair it is the distance of the points that `Solution.contacts` has.
    """
    scene = solution._scene
    snapshot = Snapshot(scene, solution._packed, solution._state, None, solved=False)
    found = {constraint.name: 0.0 for constraint in scene.constraints}
    left = list(range(len(scene.constraints)))
    while left:
        problem = snapshot.problem(left)
        try:
            rows = rows_of(problem.packed, problem.start(snapshot.q))
        except NoPairError as error:
            contact = problem.packed.contacts[error.contact]
            points = solution.contacts[contact.name].points
            found[contact.name] = float(np.linalg.norm(points[1] - points[0]))
            left = [k for k in left if scene.constraints[k].name != contact.name]
            continue
        each = np.where(rows.one_sided, np.maximum(-rows.residual, 0.0), np.abs(rows.residual))
        each = np.where(problem.packed.lengths[rows.program_rows], each * problem.packed.scale, each)
        for owner, value in zip(rows.owners.tolist(), each.tolist(), strict=True):
            name = problem.constraints[owner].name
            found[name] = max(found[name], value)
        break
    return found


def goal(solution: Solution) -> tuple[float, float]:
    """The objective in the user's units, and the largest component of its gradient, scaled."""
    packed = solution._packed
    gradient = np.empty(6 * packed.count)
    free = np.empty(packed.pair_rows, dtype=np.int64)
    table, pool = packed.table_at(solution._state), solution._pool_as_solved()
    value = gradient_at(table, pool, solution._state, free, gradient, packed.end_effectors)
    return float(value) * packed.unit, float(np.abs(gradient).max())
