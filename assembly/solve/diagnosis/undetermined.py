"""Why an end effector has no Jacobian: inputs that depend on each other, or leave it free to move.

With N the free motions of the two-sided rows, B the rates of the inputs and T that of the end effector: a combination
of inputs that vanishes on N, or a motion of N that turns no input and moves the end effector.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Coordinate, Freedom
from assembly.constraints.model.dexterity import TipTask
from assembly.constraints.model.joint import Joint
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.primitives import RECORD, coordinate, place_frames, write_gradient
from assembly.kinematics.pose import rotation_matrix, skew
from assembly.solve.dense.jacobian import moving_columns, rows_of
from assembly.solve.dense.rank import Balanced

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["complaint"]

Array = NDArray[np.float64]
# Rates of motions of length one, and parts of a combination of inputs, that count as zero.
NO_MOTION, NO_PART = 1e-6, 1e-4


def complaint(scene: Assembly, packed: Packed, state: Array, task: TipTask, active: Collection[int] = ()) -> str:
    """What is wrong with the inputs at a state, in words for an error; `active` are one-sided rows that count."""
    moving = [k for k, body in enumerate(scene.bodies) if not body.fixed]
    columns = moving_columns(moving)
    rows = rows_of(packed, state)
    holds = np.isin(np.arange(packed.rows), packed.row_numbers.that_hold(task, active))
    counted = holds[rows.program_rows]
    worst = float(np.abs(rows.residual[counted]).max(initial=0.0))
    motions = Balanced.of(rows.jacobian[np.ix_(counted, columns)], worst).free().T
    poses = _scaled(packed, rows.state)
    rates = np.array([_gradient(packed, freedom.coordinate, poses)[columns] for freedom in task.inputs]) @ motions
    left, sizes, right = np.linalg.svd(rates)
    rank = int(np.count_nonzero(sizes > NO_MOTION))
    listed = _listed(task.inputs)
    parts = np.linalg.norm(left[:, rank:], axis=1)
    dependent = [freedom for freedom, part in zip(task.inputs, parts, strict=True) if part > NO_PART]
    if len(dependent) == 1:
        return f"inputs is [{listed}]; expected inputs that can move, but here constraints hold {_listed(dependent)}"
    if dependent:
        return (
            f"inputs is [{listed}]; expected inputs with rates of their own, but here constraints tie "
            f"{_listed(dependent)} together"
        )
    # Of the motions that turn no input, those that move the end effector.
    idle = motions @ right[rank:].T
    _, moved, within = np.linalg.svd(_end_effector_rows(packed, task, poses)[:, columns] @ idle)
    open_ = idle @ within[: int(np.count_nonzero(moved > NO_MOTION))].T
    others = [freedom for item in scene.constraints if isinstance(item, Joint) for freedom in item.freedoms.values()]
    turned = [
        freedom
        for freedom in others
        if np.abs(_gradient(packed, freedom.coordinate, poses)[columns] @ open_).max(initial=0.0) > NO_MOTION
    ]
    missing = f"; {_listed(turned)} may still change" if turned else ""
    return f"inputs is [{listed}]; expected inputs that determine how the tip on {task.tip.body.name!r} moves{missing}"


def _listed(freedoms: list[Freedom] | tuple[Freedom, ...]) -> str:
    return ", ".join(f"{freedom.joint.name!r}.{freedom.name}" for freedom in freedoms)


def _scaled(packed: Packed, state: Array) -> Array:
    """Poses as the program has them."""
    poses = state[: packed.contacts_at].reshape(-1, 7).copy()
    poses[:, :3] = (poses[:, :3] - packed.reference) / packed.scale
    return poses


def _gradient(packed: Packed, item: Coordinate, poses: Array) -> Array:
    """Of a coordinate, in the twists of all bodies, (6 n,)."""
    frames = (item.frames.frame_a, item.frames.frame_b)
    pool = np.concatenate([part.ravel() for frame in frames for part in (frame.origin / packed.scale, frame.axes.T)])
    i, j = (packed.body_places[frame.body] for frame in frames)
    records, row, out = np.empty((1, RECORD)), np.empty((1, 12)), np.zeros((len(poses), 6))
    place_frames(pool, 0, poses, i, j, records, 0)
    _, n, arm_f, arm_g, h = coordinate(item.kind, item.component, records, 0, 0.0)
    write_gradient(n, arm_f, arm_g, h, 1.0, row, 0, 0)
    out[i], out[j] = row[0, :6], row[0, 6:]
    return out.ravel()


def _end_effector_rows(packed: Packed, task: TipTask, poses: Array) -> Array:
    """The end effector's velocity by the twists of all bodies, lengths over the scene's size, (rows, 6 n)."""
    body = packed.body_places[task.tip.body]
    arm = rotation_matrix(poses[body, 3:]) @ task.origin / packed.scale
    out = np.zeros((6, 6 * len(poses)))
    out[:, 6 * body : 6 * body + 6] = np.block([[np.eye(3), -skew(arm)], [np.zeros((3, 3)), np.eye(3)]])
    return out[[k for k in range(6) if task.bits >> k & 1]]
