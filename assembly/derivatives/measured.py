"""What measures change by when a solution moves, and when a parameter changes at a fixed pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.derivatives.columns import Column, Problem, by_frame, differences, joint_frame
from assembly.derivatives.kkt import Moves
from assembly.derivatives.measure import Measure, place_of, world
from assembly.derivatives.numbers import ControlPoint, ControlWeight, FrameOrigin, ShapeNumber
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix
from assembly.solve.forces.statics import bodies_of

__all__ = ["rates_of"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# A free motion of length one that changes a measure by no more does not.
FREE = 1e-7
# Numbers that slopes of rows are differenced by.
DIFFERENCED = (ShapeNumber, ControlPoint, ControlWeight)


def rates_of(
    problem: Problem,
    measures: Sequence[Measure],
    parameters: Sequence[Parameter],
    columns: Sequence[Column],
    moving: NDArray[np.int64],
    moves: Moves,
) -> tuple[Array, Flags]:
    """Derivatives (m, p) of measures in the user's units, and which of them a free motion changes, (m,)."""
    steps = np.zeros((len(problem.here.gradient), len(parameters)))
    steps[moving] = moves.steps
    free = np.zeros((len(problem.here.gradient), moves.free.shape[1]))
    free[moving] = moves.free
    rates, loose = np.empty((len(measures), len(parameters))), np.zeros(len(measures), dtype=bool)
    coordinates = [item for item in measures if item.kind == "coordinate"]
    for i, item in enumerate(measures):
        if item.kind == "wrench":
            rates[i] = _of_wrench(problem, item, parameters, steps, moves.forces)
            continue
        if item.kind == "objective":
            # The envelope theorem: rows hold, so that only what the Lagrangian itself changes by counts.
            own = [column.value + float(problem.forces @ column.rows) for column in columns]
            rates[i] = np.array(own) * problem.packed.unit
            continue
        if item.kind == "coordinate":
            slopes, own_rates = _of_coordinate(problem, coordinates.index(item), parameters)
            unit = problem.packed.scale if item.unit == "length" else 1.0
        elif item.kind == "gap":
            row = _row_of(problem, item)
            slopes, own_rates = problem.here.jacobian[row], np.array([column.rows[row] for column in columns])
            unit = problem.packed.scale
        else:
            slopes, own_rates = _of_place(problem, item, parameters)
            unit = 1.0
        rates[i] = unit * (slopes @ steps + own_rates)
        loose[i] = free.shape[1] > 0 and bool(np.abs(slopes @ free).max() > FREE * max(1.0, np.abs(slopes).max()))
    return rates, loose


def _of_coordinate(problem: Problem, place: int, parameters: Sequence[Parameter]) -> tuple[Array, Array]:
    """Slopes of a joint's coordinate, and what it changes by with frames of its own."""
    own = np.zeros(len(parameters))
    for r, parameter in enumerate(parameters):
        if (frame := joint_frame(parameter, problem.packed)) is not None:
            own[r] = problem.here.measured_by_frames[place] @ problem.frame_twist(frame)
    return problem.here.measured[place], own


def _row_of(problem: Problem, item: Measure) -> int:
    """The row of a contact."""
    for k, contact in enumerate(problem.packed.contacts):
        if contact is item.thing:
            return k
    raise InputError(f"measure is the gap of {item.thing.name!r}; expected a contact of the scene that is one of faces")


def _of_place(problem: Problem, item: Measure, parameters: Sequence[Parameter]) -> tuple[Array, Array]:
    """Slopes of a place in the world or of a distance, in lengths over scaled twists; and what frames add."""
    slopes, own = np.zeros(len(problem.here.gradient)), np.zeros(len(parameters))
    sides = item.thing if item.kind == "distance" else (item.thing,)
    places = [world(side, problem.row(place_of(side)[0])) for side in sides]
    if item.kind == "distance":
        apart = places[1][0] - places[0][0]
        length = float(np.linalg.norm(apart))
        if not length > 0.0:
            raise InputError(f"measure {item.name!r} is the distance of two places that coincide; it has no derivative")
        directions = [-apart / length, apart / length]
    else:
        directions = [np.eye(3)[item.axis]]
    scales = np.repeat([problem.packed.scale, 1.0], 3)
    for side, (_, jacobian), direction in zip(sides, places, directions, strict=True):
        body = place_of(side)[0]
        k = next(k for k, other in enumerate(problem.bodies) if other is body)
        slopes[6 * k : 6 * k + 6] += (direction @ jacobian) * scales
        for r, parameter in enumerate(parameters):
            number = parameter._number
            if isinstance(number, FrameOrigin) and number.frame is side:
                own[r] += direction @ rotation_matrix(problem.row(body)[3:])[:, number.axis]
    return slopes, own


def _of_wrench(problem: Problem, item: Measure, parameters: Sequence[Parameter], steps: Array, forces: Array) -> Array:
    """Derivatives of a component of -J^T y of one constraint's rows."""
    packed, here = problem.packed, problem.here
    places = [k for k, constraint in enumerate(problem.constraints) if constraint is item.thing]
    if not places or item.on is None or not any(item.on is b for b in bodies_of(item.thing, problem.bodies)):
        raise InputError(f"measure {item.name!r} is of a constraint and a body; expected ones of the scene")
    if packed.is_implicit:
        raise InputError(f"measure {item.name!r} is a force, in a scene without an objective; expected an energy")
    if len(here.residual) > packed.rows:
        raise InputError(f"measure {item.name!r} is a force beside a contact at a fold; expected none there")
    own = np.zeros(packed.rows, dtype=bool)
    own[packed.spans[places[0]]] = True
    held = np.where(own, problem.forces, 0.0)
    # Of the Lagrangian with these rows alone, less what the objective is of it.
    alone, none = problem.probed.evaluate(held), problem.probed.evaluate(np.zeros_like(held))
    b = next(k for k, body in enumerate(problem.bodies) if body is item.on)
    at = 6 * b + item.axis
    pulls = (held @ here.jacobian)[6 * b : 6 * b + 6]
    rates = here.jacobian[own, at] @ forces[: packed.rows][own] + (alone.hessian - none.hessian)[at] @ steps
    if item.axis >= 3:
        # A turn of the body comes after its step.
        rates += 0.5 * np.cross(steps[6 * b + 3 : 6 * b + 6].T, pulls[3:])[:, item.axis - 3]
    for r, parameter in enumerate(parameters):
        if (frame := joint_frame(parameter, packed)) is not None:
            rates[r] += by_frame(problem, alone, frame)[at]
        elif isinstance(parameter._number, DIFFERENCED):
            rates[r] += differences(problem, parameter, lambda there, _: held @ there.jacobian)[at]
    scale = packed.unit / (packed.scale if item.axis < 3 else 1.0)
    wrench: Array = -scale * rates
    return wrench
