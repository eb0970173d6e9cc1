"""The dependence of an objective on the scene's size: a posture weights turns of bodies without a shape by half of it.

A frame placed anew, or a distance that is longer than the bodies, may make the scene larger, and a turn in a posture
weightier. All else that is divided by the size is multiplied by it again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.objectives import Objective
from assembly.constraints.packing.scene import Packed
from assembly.constraints.packing.scene_size import scene_size
from assembly.constraints.program.objective_terms import POSTURE, POSTURE_FIELDS, POSTURE_QUATERNION, TERM
from assembly.constraints.program.records import TERM_TABLE, TERMS
from assembly.derivatives.parameter import Parameter
from assembly.kinematics.body import Body
from assembly.kinematics.changes import tried_numbers
from assembly.kinematics.pose import multiply

__all__ = ["by_size", "size_rate"]

Array = NDArray[np.float64]
LEVER = place_of(POSTURE_FIELDS, "lever")
# The step of sixth-order differences of the size, over the value or the size.
STEP = 1e-3


def by_size(packed: Packed, bodies: Sequence[Body], state: Array, n: int) -> tuple[Array, float]:
    """What a unit of the size adds to the objective's slopes (n,), and to its value."""
    slopes, value = np.zeros(n), 0.0
    if packed.is_implicit:
        return slopes, value
    table, pool = packed.table, packed.pool
    terms = table[table[TERM_TABLE] :][: TERM * table[TERMS]].reshape(-1, TERM).tolist()
    turned = {at - POSTURE_QUATERNION for _, at in packed._turns}
    for kind, k, at, *_ in terms:
        if kind == POSTURE and at not in turned and not bodies[k].size:
            w, x, y, z = state[7 * k + 3 : 7 * k + 7]
            c, *u = multiply(pool[at + POSTURE_QUATERNION : at + POSTURE_QUATERNION + 4], np.array([w, -x, -y, -z]))
            factor = 2.0 * pool[at + LEVER] / packed.scale
            slopes[6 * k + 3 : 6 * k + 6] -= 4.0 * factor * c * np.array(u)
            value += 4.0 * factor * float(np.dot(u, u))
    return slopes, value


def size_rate(
    parameter: Parameter,
    size: float,
    scene: tuple[Sequence[Body], Sequence[Constraint], Sequence[tuple[float, Objective]]],
) -> float:
    """What a unit of a parameter adds to the size of a scene: bodies, constraints, objectives."""
    number = parameter._number
    middle = number.get()
    step, rate = STEP * (abs(middle) or size), 0.0
    with tried_numbers():
        try:
            for k, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
                for sign in (1.0, -1.0):
                    number.put(middle + sign * k * step)
                    rate += sign * weight / step * (scene_size(*scene) - size)
        finally:
            number.put(middle)
    return rate
