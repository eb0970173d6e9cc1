"""Whether two solutions of a scene are the same: equal poses, or ends of a straight way of equally good poses.

What nothing asks for, as how a body is turned of which a point alone counts, comes out as each start left it; so does
what an objective that is flat at its best hardly asks for. Poses between such solutions hold as well and have the same
objective, which is so of no two answers that differ by chance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.records import MANAGER_RECORD
from assembly.errors import InputError
from assembly.kinematics.pose import retract
from assembly.proximity.features.solid_contact import TRACK
from assembly.proximity.manager.records import CROSSED, MEMORY_HEADER, PAIR_MEMORY
from assembly.proximity.manager.update import EVERYTHING, update
from assembly.solve.dense.jacobian import rows_of
from assembly.solve.dense.row_table import gradient_at
from assembly.solve.diagnosis.nearby_poses import moves
from assembly.solve.solution import Solution

__all__ = ["are_one"]

Array = NDArray[np.float64]
# Poses that differ by less are the same: lengths over the scene's size, radians.
SAME = 1e-6
# Parts of the way between two solutions at which it is looked.
BETWEEN = (0.31, 0.5, 0.77)
# Objectives that differ by less, over their size or the scene's unit of it, are the same; what rows may be off there.
ALIKE, HELD = 1e-9, 1e-9


def are_one(solution: Solution, other: Solution) -> bool:
    """Whether two solutions of a scene count as one."""
    packed = solution._packed
    if _is_same(solution.q, other.q, packed.scale):
        return True
    value, unit = solution.objective, packed.unit
    # Contacts that a clearance leaves out are not told from others where they are found anew; of a dexterity no pose is
    # as good by chance.
    if (
        (packed.clearance_rows and packed.contacts)
        or packed.end_effectors is not None
        or not _alike(value, other.objective, unit)
    ):
        return False
    way, sizes = moves(solution.q, other.q, packed.scale), np.repeat([packed.scale, 1.0], 3)
    between = (_objective_at(packed, solution, retract(solution.q, part * way * sizes)) for part in BETWEEN)
    return all(_alike(value, there, unit) for there in between)


def _is_same(q: Array, other: Array, size: float) -> bool:
    """Whether all bodies are at the same place; a quaternion and its negative are the same turn."""
    if np.abs(q[:, :3] - other[:, :3]).max() > SAME * size:
        return False
    # |e - f| is half the angle between them, where it is small.
    signs = np.where((q[:, 3:] * other[:, 3:]).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    return bool(np.linalg.norm(q[:, 3:] - signs * other[:, 3:], axis=1).max() <= 0.5 * SAME)


def _alike(value: float, other: float, unit: float) -> bool:
    return abs(value - other) <= ALIKE * max(unit, abs(value))


def _objective_at(packed: Packed, solution: Solution, q: Array) -> float:
    """The objective at poses (n, 7) near a solution; infinite where constraints do not hold."""
    state = solution._state.copy()
    state[: packed.contacts_at] = q.ravel()
    # A round body that turned is touched elsewhere: contacts are found anew.
    state[packed.contacts_at : packed.angles_at] = np.nan
    if packed.clearance_rows and _crosses(packed, state, q):
        return np.inf
    try:
        rows = rows_of(packed, state)
    except InputError:
        return np.inf
    off = np.where(rows.one_sided, np.maximum(-rows.residual, 0.0), np.abs(rows.residual))
    if not off.max(initial=0.0) <= HELD:
        return np.inf
    free, gradient = np.empty(packed.pair_rows, dtype=np.int64), np.empty(6 * packed.count)
    return float(gradient_at(packed.table, packed.pool, rows.state, free, gradient, packed.end_effectors)) * packed.unit


def _crosses(packed: Packed, state: Array, q: Array) -> bool:
    """Whether bodies of a clearance cross at poses (n, 7); what is near there is listed in the state."""
    scaled = q.copy()
    scaled[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    state[packed.memory_at :] = packed.new_state()[packed.memory_at :]
    tracked = state[packed.contacts_at : packed.angles_at].reshape(-1, TRACK)
    memory = state[packed.memory_at :]
    update(packed.table, packed.pool, packed.table[MANAGER_RECORD], memory, scaled, tracked, EVERYTHING)
    pairs = memory[MEMORY_HEADER:][: PAIR_MEMORY * len(packed.kept_pairs)].reshape(-1, PAIR_MEMORY)
    return bool((pairs[:, CROSSED] == 1.0).any())
