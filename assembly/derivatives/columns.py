"""What a unit of each parameter adds to rows, to the slopes of the Lagrangian, and to the objective, at a fixed pose.

Exactly where a row's derivative by its own number is known: a value, a limit, an offset, a least gap, a target, a frame
that only joints have. Where a number makes faces, or an objective measures with a frame, by differences of the rows
at the pose: of sixth order, of the scene packed with three values on either side and the same size.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.objectives import Objective
from assembly.constraints.packing.earlier import stretch
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program import records as layout
from assembly.derivatives.nets import gap_rates
from assembly.derivatives.numbers import (
    ControlPoint,
    ControlWeight,
    FrameNumber,
    LeastGap,
    RowNumber,
    ShapeNumber,
    TargetNumber,
)
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.probed import Evaluated, ProbedScene
from assembly.derivatives.size import by_size, size_rate
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.changes import tried_numbers
from assembly.kinematics.frame import Frame
from assembly.kinematics.pose import skew

__all__ = ["Columns", "Frames", "Problem", "by_frames", "columns_of", "differences"]

Array = NDArray[np.float64]
# Figures of an evaluated scene, given how many units of the objective of before one of its own is.
Figures = Callable[[Evaluated, float], Array]
# The first step of sixth-order differences, over the value; while those of order four differ by more than AGREE it is
# shortened by SHORTEN, SHORTER times at most.
STEP, AGREE, SHORTEN, SHORTER = 5e-3, 5e-8, 0.4, 4
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
    turns : (b, 3, 3)
        The bodies' rotations.
    forces : (m,)
        Multipliers of all rows, folds included.
    frames : Frames
        Parameters that are places of frames, on probes.
    probed, here : ProbedScene, Evaluated
    """

    bodies: Sequence[Body]
    constraints: Sequence[Constraint]
    objectives: Sequence[tuple[float, Objective]]
    packed: Packed
    state: Array
    turns: Array
    forces: Array
    frames: Frames
    probed: ProbedScene
    here: Evaluated

    def index(self, body: Body) -> int:
        """The place of a body."""
        for k, other in enumerate(self.bodies):
            if other is body:
                return k
        raise InputError(f"body {body.name!r} is of another scene; expected one of the solution's")


@dataclass(frozen=True, eq=False)
class Columns:
    """What a unit of each parameter adds: to residuals (m, p), to slopes of the Lagrangian (n, p), to the objective."""

    rows: Array
    slopes: Array
    values: Array


class Frames:
    """The parameters that are places of frames which only rows of joints and frame distances have.

    Parameters
    ----------
    packed : Packed
    parameters : sequence of Parameter
    turns : (b, 3, 3)
        Of the bodies.
    bodies : sequence of Body

    Attributes
    ----------
    numbers : list of FrameNumber or None
        Of every parameter.
    each : list of Frame
    twists : (6 k, p)
        Of every frame a unit of each parameter, about the origin of its body, lengths over the scene's size.
    """

    def __init__(
        self,
        packed: Packed,
        parameters: Sequence[Parameter],
        turns: Array,
        bodies: Sequence[Body],
        *,
        of_measures: bool = False,
    ) -> None:
        known: dict[int, None] = {}
        if of_measures or not packed.end_effectors:
            # A dexterity has frames of its inputs as well; what is measured has those of joints.
            known = _frames_of(packed)
        self.numbers = [_on_probe(parameter, known) for parameter in parameters]
        self.each: list[Frame] = []
        places: dict[int, int] = {}
        for number in self.numbers:
            if number is not None and id(number.frame) not in places:
                places[id(number.frame)] = len(self.each)
                self.each.append(number.frame)
        self.twists = np.zeros((6 * len(self.each), len(parameters)))
        hosts = {id(body): k for k, body in enumerate(bodies)}
        for r, number in enumerate(self.numbers):
            if number is not None:
                at = 6 * places[id(number.frame)]
                self.twists[at : at + 6, r] = number.twist(turns[hosts[id(number.frame.body)]], packed.scale)


# Names of what has frames: of a pair of a joint, of a term of the objective.
SIDES = ("frame_a", "frame_b", "frame")


def _frames_of(packed: Packed) -> dict[int, None]:
    """The frames of rows and terms, those that others are turned from, by their identities."""
    pairs = [*packed._frames, *(term for term, _ in packed._turns)]
    sides = (side for pair in pairs for side in (getattr(pair, name, None) for name in SIDES))
    return {id(getattr(side, "base", side)): None for side in sides if side is not None}


def _on_probe(parameter: Parameter, known: Collection[int]) -> FrameNumber | None:
    number = parameter._number
    return number if isinstance(number, FrameNumber) and id(number.frame) in known else None


def columns_of(problem: Problem, parameters: Sequence[Parameter], may_be_idle: bool = False) -> Columns:
    """The columns of parameters; whether one may be idle, as a number of a body is between contacts.

    Raises
    ------
    InputError
        A parameter that enters no row and no term, where none may.
    """
    frames, here = problem.frames, problem.here
    rows, slopes = here.by_frames @ frames.twists, by_frames(problem, here)
    values = here.slopes_by_frames @ frames.twists
    for r, parameter in enumerate(parameters):
        number = parameter._number
        if frames.numbers[r] is not None:
            continue
        if isinstance(number, RowNumber):
            enters = _of_row(problem, number, rows[:, r])
        elif isinstance(number, LeastGap):
            enters = _of_least_gap(problem, number, rows[:, r])
        elif isinstance(number, TargetNumber):
            values[r], enters = _of_target(problem, number, slopes[:, r])
        elif isinstance(number, ControlPoint) and (exact := gap_rates(problem, number)) is not None:
            rows[:, r], enters = exact, bool(exact.any()) or _is_of_a_face(problem, parameter)
        else:
            rows[:, r], slopes[:, r], values[r] = _by_differences(problem, parameter)
            enters = bool(rows[:, r].any() or slopes[:, r].any() or values[r]) or _is_of_a_face(problem, parameter)
            # A hinge may turn about its axis in its frame: rows are as they were, what is measured is not.
            enters = enters or _on_probe(parameter, _frames_of(problem.packed)) is not None
        if not (enters or may_be_idle):
            raise InputError(
                f"parameter {parameter.name!r} enters no row and no term; expected one on which the solve depends"
            )
    _add_size(problem, parameters, slopes, values)
    return Columns(rows, slopes, values)


def _add_size(problem: Problem, parameters: Sequence[Parameter], slopes: Array, values: Array) -> None:
    """Add what parameters do through the scene's size."""
    slope, value = by_size(problem.packed, problem.bodies, problem.state, len(slopes))
    if value or slope.any():
        scene = (problem.bodies, problem.constraints, problem.objectives)
        for r, parameter in enumerate(parameters):
            rate = size_rate(parameter, problem.packed.scale, scene)
            slopes[:, r] += rate * slope
            values[r] += rate * value


def by_frames(problem: Problem, here: Evaluated) -> Array:
    """What a unit of each parameter's frame adds to the slopes of the Lagrangian, (n, p).

    The frame goes with its body: a turn of the body comes after the frame's twist, which the symmetric second
    derivative has half before and half after.
    """
    twists = problem.frames.twists
    slopes: Array = here.mixed @ twists
    for k, host in enumerate(problem.probed.hosts):
        force, torque = here.pulls[6 * k : 6 * k + 3], here.pulls[6 * k + 3 : 6 * k + 6]
        if force.any() or torque.any():
            slopes[6 * host + 3 : 6 * host + 6] -= skew(force) @ twists[6 * k : 6 * k + 3]
            slopes[6 * host + 3 : 6 * host + 6] -= 0.5 * skew(torque) @ twists[6 * k + 3 : 6 * k + 6]
    return slopes


def _of_row(problem: Problem, number: RowNumber, rows: Array) -> bool:
    """Write what a unit of a row's own number adds; whether there is such a row."""
    enters = False
    for row, (equation, _, unit) in zip(problem.packed.value_rows, problem.packed._values, strict=True):
        source = equation.source
        if source is not None and source[0] is number.owner and source[1] == number.attribute:
            rows[row] = (1.0 if number.attribute == "upper" else -1.0) / unit
            enters = True
    return enters


def _of_least_gap(problem: Problem, number: LeastGap, rows: Array) -> bool:
    """The same of the contacts of a clearance."""
    packed = problem.packed
    own = [k for k, item in enumerate(problem.constraints) if item is number.owner]
    table = packed.table_at(problem.state)
    kept = packed.owners == (own[0] if own else -1)
    bodies = table[table[layout.ROW_TABLE] :][: layout.ROW * packed.rows].reshape(-1, layout.ROW)[:, layout.BODY_F]
    rows[: packed.rows][kept & (bodies >= 0)] = -1.0 / packed.scale
    return bool(own)


def _of_target(problem: Problem, number: TargetNumber, slopes: Array) -> tuple[float, bool]:
    """Write the slopes a unit of a target's coordinate adds; what it adds to the value, and whether there is one."""
    packed, value, enters = problem.packed, 0.0, False
    for term, at in packed._targets:
        if term is number.term:
            k = problem.index(term.bodies[0])
            arm = problem.turns[k] @ packed.pool[at - 3 : at]
            place = (problem.state[7 * k : 7 * k + 3] - packed.reference) / packed.scale + arm
            factor, axis = -2.0 * packed.pool[at - 4] / packed.scale, np.eye(3)[number.axis]
            slopes[6 * k : 6 * k + 6] += factor * np.concatenate([axis, skew(arm) @ axis])
            value += factor * float((place - packed.pool[at : at + 3])[number.axis])
            enters = True
    return value, enters


def _is_of_a_face(problem: Problem, parameter: Parameter) -> bool:
    """Whether a parameter is of the net of a face of the scene: where contacts are elsewhere, it does nothing."""
    number = parameter._number
    if not isinstance(number, (ControlPoint, ControlWeight)):
        return False
    return any(number.face.face is side.face for body in problem.bodies for side in body.faces)


def _by_differences(problem: Problem, parameter: Parameter) -> tuple[Array, Array, float]:
    """Differences of residuals, slopes and value."""
    m = len(problem.here.residual)

    def figures(there: Evaluated, ratio: float) -> Array:
        slopes = ratio * there.gradient + problem.forces @ there.jacobian
        return np.concatenate([there.residual, slopes, [ratio * there.value]])

    change = differences(problem, parameter, figures)
    return change[:m], change[m:-1], float(change[-1])


def differences(problem: Problem, parameter: Parameter, figures: Figures) -> Array:
    """Figures of the scene at the solution's pose, differenced by a parameter.

    `figures` is given what the scene is with the parameter's value, and how many units of the objective one of its is.
    """
    middle = parameter._number.get()
    step = parameter.step or STEP * (abs(middle) or _size(problem, parameter))
    change: Array = np.zeros(0)
    with tried_numbers():
        try:
            for _ in range(SHORTER):
                halves = [_half(problem, parameter, middle, k * step, figures) / step for k in (1, 2, 3)]
                change = 0.75 * halves[0] - 0.15 * halves[1] + halves[2] / 60.0
                fourth = (8.0 * halves[0] - halves[1]) / 12.0
                # The error of order six is about that of order four to the power 3/2.
                if parameter.step or np.abs(change - fourth).max() <= AGREE * np.abs(change).max():
                    break
                step *= SHORTEN
        finally:
            parameter._number.set(middle)
    # What rounding leaves of what does not change is no derivative.
    change[np.abs(change) < ROUNDING / step] = 0.0
    return change


def _half(problem: Problem, parameter: Parameter, middle: float, way: float, figures: Figures) -> Array:
    """The difference of figures between the number at `middle + way` and at `middle - way`."""
    shape = problem.here.residual.shape, problem.here.gradient.shape
    found = []
    for value in (middle + way, middle - way):
        parameter._number.set(value)
        there, ratio = evaluated_now(problem)
        if (there.residual.shape, there.gradient.shape) != shape:
            raise InputError(f"{parameter.name} has other rows at {value:g}; expected a smaller step than {abs(way):g}")
        found.append(figures(there, ratio))
    change: Array = found[0] - found[1]
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
    # What a posture without a reference is measured from is where the solve began.
    other.measure_from(packed.begun_at())
    state = problem.state.copy()
    stretch(packed, other, state)
    return ProbedScene(other, state, problem.bodies).evaluate(problem.forces), other.unit / packed.unit
