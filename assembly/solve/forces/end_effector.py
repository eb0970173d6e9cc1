"""What an end effector can do with its inputs at a pose: Jacobian, ellipsoid and measures, by the loop's own code.

With rates v of all bodies that keep the two-sided rows, A v = 0, and turn the inputs at rates e, B v = e, the end
effector's velocity is J e (`solve/loop/dexterity.py`). Closed loops and contacts are rows like others, so the same J
serves them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._turn import in_turn
from assembly.constraints.model.constraint import Constraint, Freedom
from assembly.constraints.model.dexterity import MEASURES, Axes, Dexterity, Task
from assembly.constraints.model.joint import Joint
from assembly.constraints.packing.scene import Packed
from assembly.constraints.packing.terms import dexterity_numbers
from assembly.constraints.program import objective_terms as terms
from assembly.constraints.program import records as layout
from assembly.constraints.program.primitives import FRAMES
from assembly.errors import InputError, positive
from assembly.kinematics.body import Body
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.kinematics.frame import Frame, Point
from assembly.kinematics.pose import pose_rows, rotation_matrix
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.dense.jacobian import rows_of
from assembly.solve.diagnosis.undetermined import complaint
from assembly.solve.forces.end_effector_rates import end_effector_at
from assembly.solve.loop.dexterity import DETERMINED
from assembly.solve.result import Result

if TYPE_CHECKING:
    from assembly.assembly import Assembly
    from assembly.solve.solution import Solution

__all__ = ["dexterity_ellipsoid", "dexterity_value", "tip_jacobian"]

Array = NDArray[np.float64]
# A one-sided row that is off its bound by less, over the scene's size, touches: solves leave some 1e-10.
TOUCHING = 1e-8


@in_turn
def tip_jacobian(
    scene: Assembly,
    tip: Point | Frame | Body,
    inputs: Sequence[Joint | Freedom],
    q: ArrayLike | Solution | None = None,
    *,
    task: Task | None = None,
    length: float = 1.0,
    axes: Axes | None = None,
    ignoring: Iterable[Constraint] = (),
    holding: Iterable[Constraint] = (),
    active: bool = False,
) -> Array:
    """Velocities of an end effector for unit rates of the inputs, through closed loops and contacts.

    Two-sided constraints hold; driven values do not count, limits and one-sided contacts only if requested. If the pose
    violates constraints, it is the Jacobian of rates that do not change the violations.

    Parameters
    ----------
    scene : Assembly
    tip : Point, Frame or Body
        A body stands for its origin and axes.
    inputs : sequence of Joint or Freedom
        Joints with one coordinate, or coordinates, `joint.freedom(name)`.
    q : (n, 7) or Solution, optional
        One row per body, or a solution for these bodies; the bodies' own poses by default.
    task : "position", "rotation" or "pose", optional
        Which rows: its linear velocity, its body's angular velocity, or both, linear first. Position for a point,
        pose for a frame or a body by default.
    length : float
        Angular velocities of a pose task are multiplied by it, to compare them with linear ones.
    axes, ignoring, holding
        As of `Dexterity`: which world axes count, constraints that do not hold the mechanism, and constraints whose
        one-sided rows do.
    active : bool
        Whether one-sided rows that are at their bound at q, contacts that touch and limits that are reached, hold it as
        well.

    Returns
    -------
    (r, k)
        One row per velocity that counts, one column per input, world axes. Lengths in the user's unit, angles in
        radians.

    Raises
    ------
    InputError
        The inputs depend on each other at this pose or leave the end effector's motion open (the message
        names those that do, and coordinates to add), or q does not fit.

    Notes
    -----
    Of an open chain of revolute joints the columns are z x (p - o) and z (paper 001, section 3.1).
    """
    options = Dexterity(
        tip, inputs, task=task, length=length, axes=axes, ignoring=tuple(ignoring), holding=tuple(holding)
    )
    return _evaluated(scene, options, q, active)[0]


@in_turn
def dexterity_value(
    scene: Assembly, objective: Dexterity, q: ArrayLike | Solution | None = None, *, active: bool = False
) -> float:
    """The measure of a `Dexterity` at a pose, without its weight.

    Parameters
    ----------
    scene : Assembly
    objective : Dexterity
        It need not be a term of the scene's objective.
    q : (n, 7) or Solution, optional
    active : bool
        As of `tip_jacobian`.

    Raises
    ------
    InputError
        As of `tip_jacobian`; also where the measure is infinite.
    """
    if not isinstance(objective, Dexterity):
        raise TypeError(f"objective is {objective!r}; expected a Dexterity")
    value = _evaluated(scene, objective, q, active)[1]
    if not np.isfinite(value):
        raise InputError(f"objective is {objective!r}; expected a finite measure at q, but it is infinite")
    return value


@in_turn
def dexterity_ellipsoid(
    scene: Assembly,
    tip: Point | Frame | Body,
    inputs: Sequence[Joint | Freedom],
    q: ArrayLike | Solution | None = None,
    *,
    scale: float = 1.0,
    ignoring: Iterable[Constraint] = (),
    holding: Iterable[Constraint] = (),
    active: bool = False,
) -> Ellipsoid:
    """The velocities of an end effector for all rates of the inputs of norm one, as an ellipsoid around it.

    Its axes and half their lengths are the left singular vectors and the singular values of the position Jacobian
    (paper 001, section 3.1: the eigenvectors of J J^T and the roots of its eigenvalues), longest first. With fewer than
    three inputs it is flat.

    Parameters
    ----------
    scene, tip, inputs, q
        As of `tip_jacobian`.
    scale : float
        What one unit of velocity is drawn as.
    ignoring, holding, active
        As of `tip_jacobian`.

    Returns
    -------
    Ellipsoid
        In the world; `asm.view` draws it.

    Raises
    ------
    InputError
        As of `tip_jacobian`.
    """
    factor = positive("scale", scale)
    objective = Dexterity(tip, inputs, task="position", ignoring=ignoring, holding=holding)
    jacobian, _, poses = _evaluated(scene, objective, q, active)
    body, origin = objective.tip_task.tip.body, objective.tip_task.origin
    row = poses[next(k for k, other in enumerate(scene.bodies) if other is body)]
    axes, lengths, _ = np.linalg.svd(jacobian)
    return Ellipsoid(row[:3] + rotation_matrix(row[3:]) @ origin, axes, factor * np.pad(lengths, (0, 3 - lengths.size)))


def _evaluated(
    scene: Assembly, objective: Dexterity, q: ArrayLike | Solution | None, active: bool
) -> tuple[Array, float, Array]:
    """Jacobian, measure and poses; raises where there is none."""
    # Assembly itself lives above this module.
    if not callable(getattr(scene, "packed", None)):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    task = objective.tip_task
    for what, bodies in (("tip", (task.tip.body,)), ("inputs", task.bodies)):
        for body in bodies:
            if not any(other is body for other in scene.bodies):
                known = ", ".join(repr(other.name) for other in scene.bodies)
                raise InputError(f"{what} is on body {body.name!r}; expected bodies of this assembly: {known}")
    for what, listed in (("ignoring", task.ignoring), ("holding", task.holding)):
        for item in listed:
            if not any(item is other for other in scene.constraints):
                known = ", ".join(repr(other.name) for other in scene.constraints)
                raise InputError(f"{what} names {item.name!r}; expected constraints of this assembly: {known}")
    if not isinstance(active, (bool, np.bool_)):
        raise InputError(f"active is {active!r}; expected True or False")
    if isinstance(q, Result):
        q._list_contacts()
    packed = scene.packed()
    state = _state(scene, packed, q)
    touching = _touching(packed, state) if active else []
    table, pool, term = _with_term(packed, objective, touching)
    jacobian = np.empty((task.rows, len(task.inputs)))
    free = np.empty(packed.pair_rows, dtype=np.int64)
    lost, outcome, value = end_effector_at(table, pool, term, state, free, jacobian)
    if lost >= 0:
        name = packed.contacts[lost].name
        raise InputError(f"q leaves contact {name!r} without an extremal pair; expected a pose where it has one")
    if outcome != DETERMINED or not np.isfinite(jacobian).all():
        raise InputError(complaint(scene, packed, state, task, touching))
    return jacobian, float(value), state[: packed.contacts_at].reshape(-1, 7)


def _state(scene: Assembly, packed: Packed, q: ArrayLike | Solution | None) -> Array:
    """Where the bodies are, and where the pairs of contacts are looked for."""
    if not isinstance(q, Result):
        return scene._start(packed, None if q is None else pose_rows("q", q, len(scene.bodies)), None)
    if q._packed is packed:
        return q._state
    if q._scene.bodies != scene.bodies:
        raise InputError("q is a solution of another assembly; expected one with these bodies")
    # A value that was driven and is free now makes another program of the same scene.
    state = scene._start(packed, q.q, None)
    known = zip(q._scene.contacts, q._scene.sides, q._parameters, strict=True)
    for contact, sides, parameters in known:
        for k, (other, other_sides) in enumerate(zip(packed.contacts, packed.sides, strict=True)):
            if contact is other and sides == other_sides:
                at = packed.contacts_at + TRACK * k
                state[at : at + TRACK] = parameters
    return state


def _touching(packed: Packed, state: Array) -> list[int]:
    """The one-sided rows that are at their bound at a state."""
    rows = rows_of(packed, state)
    touches = rows.one_sided & (np.abs(rows.residual) <= TOUCHING)
    return [int(r) for r in np.unique(rows.program_rows[touches])]


def _with_term(packed: Packed, objective: Dexterity, active: Collection[int]) -> tuple[NDArray[np.int64], Array, int]:
    """Table and pool with a term at their end that is not part of the objective, and where it is.

    One-sided rows that are `active` hold the mechanism.
    """
    task, places, scale = objective.tip_task, packed.body_places, packed.scale
    table, pool = packed.table, packed.pool
    joints, first = int(table[layout.JOINTS]), int(table[layout.JOINT_TABLE])
    frames: list[int] = []
    numbers: list[Array] = []
    held = packed.row_numbers.that_hold(task, active)
    fields = [MEASURES.index(objective.measure), task.bits, len(task.inputs), table.size, len(held)]
    for k, freedom in enumerate(task.inputs):
        pair = freedom.coordinate.frames
        bodies = [places[frame.body] for frame in (pair.frame_a, pair.frame_b)]
        frames += [*bodies, pool.size + FRAMES * k]
        numbers += [part for frame in (pair.frame_a, pair.frame_b) for part in (frame.origin / scale, frame.axes.T)]
        # Which turn an angle is on is no matter here.
        fields += [freedom.coordinate.kind, freedom.coordinate.component, joints + k, -1, *bodies]
    units = [1.0 if freedom.coordinate.is_angle else 1.0 / scale for freedom in task.inputs]
    parameters = np.array(dexterity_numbers(objective, 1.0, scale, units))
    own = table[first : first + layout.JOINT_RECORD * joints]
    extended = np.concatenate([table, held, own, frames, fields, [0] * terms.TERM]).astype(np.int64)
    extended[layout.JOINT_TABLE] = table.size + len(held)
    extended[layout.JOINTS] = joints + len(task.inputs)
    term = extended.size - terms.TERM
    record = terms.term_at(extended, term)
    record.kind, record.body = terms.DEXTERITY, places[task.tip.body]
    record.parameters, record.tape = pool.size + FRAMES * len(task.inputs), term - len(fields)
    return extended, np.concatenate([pool, *(part.ravel() for part in numbers), parameters]), term
