"""What a unit of each parameter adds to rows, to the slopes of the Lagrangian, and to the objective, at a fixed pose.

Exactly where a row's derivative by its own number is known: a value, a limit, an offset, a least gap, a target, a frame
that only joints have. Where a number makes faces, or an objective measures with a frame, by differences of the rows
at the pose: of sixth order, of the scene packed with three values on either side and the same size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.objectives import Objective
from assembly.constraints.packing.earlier import stretch
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program import records as layout
from assembly.constraints.program.objective_terms import POSTURE, TERM
from assembly.derivatives.numbers import FrameNumber, LeastGap, RowNumber, ShapeNumber, TargetNumber
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.probed import Evaluated, ProbedScene, stands_for
from assembly.errors import InputError
from assembly.kinematics.body import Body, Frame
from assembly.kinematics.changes import tried_numbers
from assembly.kinematics.pose import rotation_matrix

__all__ = ["Column", "Problem", "by_frame", "column_of", "differences", "joint_frame"]

Array = NDArray[np.float64]
# Sixth-order central differences, and their step over the value.
WEIGHTS = ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0))
STEP = 5e-3
# Differences of figures of order one that are rounding.
ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class Problem:
    """A solution as it is derived.

    Attributes
    ----------
    bodies, constraints, objectives
        Of the scene; constraints as they were packed.
    packed, state
    forces : (m,)
        Multipliers of all rows, folds included.
    frames : sequence of Frame
        Those on probes.
    probed, here : ProbedScene, Evaluated
    """

    bodies: Sequence[Body]
    constraints: Sequence[Constraint]
    objectives: Sequence[tuple[float, Objective]]
    packed: Packed
    state: Array
    forces: Array
    frames: Sequence[Frame]
    probed: ProbedScene
    here: Evaluated

    def row(self, body: Body) -> Array:
        """The pose of a body, (7,), in the user's units."""
        k = next(k for k, other in enumerate(self.bodies) if other is body)
        return self.state[7 * k : 7 * k + 7]

    def place(self, number: FrameNumber) -> int:
        """The place of a number's frame among those on probes."""
        return next(k for k, frame in enumerate(self.frames) if frame is number.frame)

    def frame_twist(self, number: FrameNumber) -> Array:
        """Twists of all probes a unit of a frame's number, (6 k,), lengths over the scene's size."""
        twists, place = np.zeros(6 * len(self.frames)), self.place(number)
        twists[6 * place : 6 * place + 6] = number.twist(self.row(number.frame.body), self.packed.scale)
        return twists


@dataclass(frozen=True, eq=False)
class Column:
    """What a unit of a parameter adds: to residuals (m,), to slopes of the Lagrangian (n,), to the objective."""

    rows: Array
    slopes: Array
    value: float


def joint_frame(parameter: Parameter, packed: Packed) -> FrameNumber | None:
    """The number of a parameter that is a place of a frame which rows of joints have, and no term of the objective."""
    number = parameter._number
    if not isinstance(number, FrameNumber) or packed.end_effectors:
        return None
    in_term = any(stands_for(term.frame, number.frame) for term, _ in packed._turns)
    pairs = ((pair.frame_a, pair.frame_b) for pair in packed._frames)
    of_joints = not in_term and any(stands_for(frame, number.frame) for pair in pairs for frame in pair)
    return number if of_joints else None


def column_of(problem: Problem, parameter: Parameter) -> Column:
    """The column of a parameter.

    Raises
    ------
    InputError
        A parameter that enters no row and no term.
    """
    number, packed = parameter._number, problem.packed
    rows, slopes, value = np.zeros_like(problem.here.residual), np.zeros_like(problem.here.gradient), 0.0
    enters = True
    if isinstance(number, RowNumber):
        units = [
            (row, unit)
            for row, (equation, _, unit) in zip(packed.value_rows, packed._values, strict=True)
            if equation.source is not None
            and equation.source[0] is number.owner
            and equation.source[1] == number.attribute
        ]
        for row, unit in units:
            rows[row] = (1.0 if number.attribute == "upper" else -1.0) / unit
        enters = bool(units)
    elif isinstance(number, LeastGap):
        own = [k for k, item in enumerate(problem.constraints) if item is number.clearance]
        table = packed.table_at(problem.state)
        kept = packed.owners == (own[0] if own else -1)
        bodies = table[table[layout.ROW_TABLE] :][: layout.ROW * packed.rows].reshape(-1, layout.ROW)[:, layout.BODY_F]
        rows[: packed.rows][kept & (bodies >= 0)] = -1.0 / packed.scale
        enters = bool(own)
    elif isinstance(number, TargetNumber):
        slopes, value, enters = _of_target(problem, number)
    elif (frame := joint_frame(parameter, packed)) is not None:
        rows = problem.here.by_frames @ problem.frame_twist(frame)
        slopes = by_frame(problem, problem.here, frame)
    else:
        rows, slopes, value = _by_differences(problem, parameter)
        enters = bool(rows.any() or slopes.any() or value)
    if not enters:
        raise InputError(f"parameter {parameter.name!r} enters no row and no term; expected one of what is solved")
    return Column(rows, slopes, value)


def by_frame(problem: Problem, here: Evaluated, number: FrameNumber) -> Array:
    """What a unit of a frame's number adds to the slopes of forces . rows, (n,).

    The frame goes with its body: a turn of the body comes after the frame's twist, which the symmetric second
    derivative has half before and half after.
    """
    place = problem.place(number)
    twist, pulls = problem.frame_twist(number)[6 * place : 6 * place + 6], here.pulls[6 * place : 6 * place + 6]
    slopes: Array = here.mixed @ problem.frame_twist(number)
    turned = slice(6 * problem.probed.hosts[place] + 3, 6 * problem.probed.hosts[place] + 6)
    slopes[turned] += np.cross(twist[:3], pulls[:3]) + 0.5 * np.cross(twist[3:], pulls[3:])
    return slopes


def _of_target(problem: Problem, number: TargetNumber) -> tuple[Array, float, bool]:
    """Slopes and value a unit of a target's coordinate."""
    packed, slopes, value, enters = problem.packed, np.zeros_like(problem.here.gradient), 0.0, False
    for term, at in packed._targets:
        if term is number.term:
            body = term.bodies[0]
            row = problem.row(body)
            k = next(k for k, other in enumerate(problem.bodies) if other is body)
            arm = rotation_matrix(row[3:]) @ packed.pool[at - 3 : at]
            off = (row[:3] - packed.reference) / packed.scale + arm - packed.pool[at : at + 3]
            factor, axis = -2.0 * packed.pool[at - 4] / packed.scale, np.eye(3)[number.axis]
            slopes[6 * k : 6 * k + 6] += factor * np.concatenate([axis, np.cross(arm, axis)])
            value += factor * float(off[number.axis])
            enters = True
    return slopes, value, enters


def _by_differences(problem: Problem, parameter: Parameter) -> tuple[Array, Array, float]:
    """Differences of residuals, slopes and value."""
    m = len(problem.here.residual)

    def figures(there: Evaluated, ratio: float) -> Array:
        slopes = ratio * there.gradient + problem.forces @ there.jacobian
        return np.concatenate([there.residual, slopes, [ratio * there.value]])

    change = differences(problem, parameter, figures)
    return change[:m], change[m:-1], float(change[-1])


def differences(problem: Problem, parameter: Parameter, figures: Callable[[Evaluated, float], Array]) -> Array:
    """Figures of the scene at the solution's pose, differenced by a parameter.

    `figures` is given what the scene is with the parameter's value, and how many units of the objective one of its is.
    """
    number, shape = parameter._number, (problem.here.residual.shape, problem.here.gradient.shape)
    middle = number.get()
    step = parameter.step or STEP * (abs(middle) or _size(problem, parameter))
    change: Array = np.zeros(0)
    with tried_numbers():
        try:
            for k, weight in WEIGHTS:
                for sign in (1.0, -1.0):
                    number.set(middle + sign * k * step)
                    there, ratio = evaluated_now(problem)
                    if (there.residual.shape, there.gradient.shape) != shape:
                        raise InputError(
                            f"{parameter.name} changes what rows there are; expected a step below {step:g}"
                        )
                    found = sign * weight / step * figures(there, ratio)
                    change = change + found if change.size else found
        finally:
            number.set(middle)
    # What rounding leaves of what does not change is no derivative.
    change[np.abs(change) < ROUNDING / step] = 0.0
    return change


def _size(problem: Problem, parameter: Parameter) -> float:
    number = parameter._number
    return 1.0 if isinstance(number, ShapeNumber) or number.unit != "length" else problem.packed.scale


def evaluated_now(problem: Problem) -> tuple[Evaluated, float]:
    """The scene with the numbers that it has now at the solution's pose, in the units of before; and by how much the
    objective counts in others.
    """
    packed = problem.packed
    crowding, corners = packed.crowding, bool(packed.corners)
    other = Packed(problem.bodies, problem.constraints, problem.objectives, crowding, corners, packed.scale)
    other.refresh()
    table = packed.table
    records = table[table[layout.TERM_TABLE] :][: TERM * table[layout.TERMS]].reshape(-1, TERM)
    for kind, _, at, _, follows in records[:, :5].tolist():
        if kind == POSTURE and follows:
            # What a posture without a reference is measured from is where the solve began.
            other.pool[at + 1 : at + 8] = packed.pool[at + 1 : at + 8]
    state = problem.state.copy()
    stretch(packed, other, state)
    return ProbedScene(other, state, problem.bodies).evaluate(problem.forces), other.unit / packed.unit
