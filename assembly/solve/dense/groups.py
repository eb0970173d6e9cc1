"""Groups of bodies connected by constraints: each moves by itself, and has a rank of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint
from assembly.kinematics.body import Body
from assembly.solve.dense.jacobian import Rows, moving_columns
from assembly.solve.dense.rank import Balanced
from assembly.solve.interruption import CTRL_C, Interruption

__all__ = ["Group", "groups_of"]


@dataclass(frozen=True, eq=False)
class Group:
    """Moving bodies, by their places in the scene, and the rows between them.

    Attributes
    ----------
    places : tuple of int
    rows : (m,) int
        Places in `Rows`.
    balanced : Balanced
        Of these rows, in the twists of these bodies.
    """

    places: tuple[int, ...]
    rows: NDArray[np.int64]
    balanced: Balanced

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        return 6 * len(self.places) - self.balanced.rank


def groups_of(
    bodies: Sequence[Body],
    constraints: Sequence[Constraint],
    rows: Rows,
    counted: NDArray[np.bool_],
    tolerance: float | None = None,
    fit: float = 0.0,
    interruption: Interruption = CTRL_C,
) -> list[Group]:
    """The groups of a scene, in the order of their first bodies, with those rows that are counted.

    A tolerance decides on rank if it is given, else what the rows' residuals make of the pose: up to `fit` they may be
    what rows that repeat each other disagree by. TimeoutError where the interruption's time is over before.
    """
    worst = float(np.abs(rows.residual[counted]).max(initial=0.0))
    places = {id(body): k for k, body in enumerate(bodies)}
    group = list(range(len(bodies)))
    present = sorted(set(rows.owners[counted].tolist()))
    for owner in present:
        # Bodies that are fixed tie nothing together.
        moving = [places[id(body)] for body in constraints[owner].bodies if not body.fixed]
        for k in moving[1:]:
            old, new = group[k], group[moving[0]]
            group = [new if other == old else other for other in group]
    owner_groups = {
        owner: next(group[places[id(body)]] for body in constraints[owner].bodies if not body.fixed)
        for owner in present
    }
    found = []
    for label in dict.fromkeys(group[k] for k, body in enumerate(bodies) if not body.fixed):
        members = tuple(k for k, body in enumerate(bodies) if not body.fixed and group[k] == label)
        own = np.array(
            [r for r in np.flatnonzero(counted).tolist() if owner_groups[int(rows.owners[r])] == label], dtype=np.int64
        )
        jacobian = rows.jacobian[np.ix_(own, moving_columns(members))]
        interruption.check("rank")
        found.append(Group(members, own, Balanced.of(jacobian, worst, tolerance, fit, interruption)))
    return found
