"""What measures change by when a solution moves, and when a parameter changes at a fixed pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.derivatives.columns import Columns, Frames, Problem, by_frames, differences
from assembly.derivatives.kkt import Moves
from assembly.derivatives.measure import Measure, place_of, world
from assembly.derivatives.numbers import ControlPoint, ControlWeight, FrameNumber, FrameOrigin, LeastGap, ShapeNumber
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.probed import ProbedScene
from assembly.derivatives.touching_place import place_slopes
from assembly.errors import InputError
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
    columns: Columns,
    moving: NDArray[np.int64],
    moves: Moves,
) -> tuple[Array, Flags]:
    """Derivatives (m, p) of measures in the user's units; which of them a free motion or a shared force changes."""
    here, scale = problem.here, problem.packed.scale
    steps = np.zeros((len(here.gradient), len(parameters)))
    steps[moving] = moves.steps
    slopes, own = np.zeros((len(measures), len(here.gradient))), np.zeros((len(measures), len(parameters)))
    units, told = np.ones((len(measures), 1)), {}
    by_own_frames = _coordinates_by_frames(problem, measures, parameters)
    coordinates = 0
    for i, item in enumerate(measures):
        if item.kind == "wrench":
            told[i] = _of_wrench(problem, item, parameters, steps, moves.forces)
        elif item.kind == "objective":
            # The envelope theorem: rows hold, so that only what the Lagrangian itself changes by counts.
            told[i] = (columns.values + problem.forces @ columns.rows) * problem.packed.unit
        elif item.kind == "coordinate":
            slopes[i], units[i] = here.measured[coordinates], scale if item.unit == "length" else 1.0
            own[i] = by_own_frames[coordinates]
            coordinates += 1
        elif item.kind == "gap":
            row = _row_of(problem, item)
            slopes[i], own[i], units[i] = here.jacobian[row], columns.rows[row], scale
            for r, parameter in enumerate(parameters):
                # The row is the gap less the least one.
                if isinstance(parameter._number, LeastGap) and parameter._number.owner is item.thing:
                    own[i, r] += 1.0 / scale
        elif item.kind == "touching":
            _of_touching(problem, item, parameters, slopes[i])
        else:
            _of_place(problem, item, parameters, slopes[i], own[i])
    rates = units * (slopes @ steps + own)
    for i, figures in told.items():
        rates[i] = figures
    loose = np.zeros(len(measures), dtype=bool)
    if moves.free.shape[1]:
        changed = np.abs(slopes[:, moving] @ moves.free).max(axis=1)
        loose = changed > FREE * np.maximum(1.0, np.abs(slopes).max(axis=1))
    for i, item in enumerate(measures):
        if item.kind == "wrench":
            loose[i] = _is_shared(problem, item, moves)
    return rates, loose


def _is_shared(problem: Problem, item: Measure, moves: Moves) -> bool:
    """Whether forces that are in balance change a wrench: then it is no function of the pose."""
    own = problem.packed.spans[next(k for k, each in enumerate(problem.constraints) if each is item.thing)]
    assert item.on is not None
    at = 6 * problem.index(item.on) + item.axis
    changed = np.abs(problem.here.jacobian[own, at] @ moves.shared[own])
    return bool(changed.max(initial=0.0) > FREE)


def _row_of(problem: Problem, item: Measure) -> int:
    """The row of a contact."""
    for k, contact in enumerate(problem.packed.contacts):
        if contact is item.thing:
            return k
    raise InputError(f"measure is the gap of {item.thing.name!r}; expected a contact of faces in the scene")


def _coordinates_by_frames(problem: Problem, measures: Sequence[Measure], parameters: Sequence[Parameter]) -> Array:
    """What frames that a parameter places change coordinates by at a fixed pose, (coordinates, p)."""
    frames, here = problem.frames, problem.here
    coordinates = [item.thing.coordinate for item in measures if item.kind == "coordinate"]
    if coordinates and problem.packed.end_effectors:
        # Where a dexterity is no probes are in the rows, and those of what is measured are asked for by themselves.
        frames = Frames(problem.packed, parameters, problem.turns, problem.bodies, of_measures=True)
        if frames.each:
            probed = ProbedScene(problem.packed, problem.state, problem.bodies, frames.each, coordinates)
            here = probed.evaluate(problem.forces)
    changes: Array = here.measured_by_frames @ frames.twists
    return changes


def _of_place(problem: Problem, item: Measure, parameters: Sequence[Parameter], slopes: Array, own: Array) -> None:
    """Write slopes of a place in the world or of a distance, in lengths over scaled twists; and what frames add."""
    sides = item.thing if item.kind == "distance" else (item.thing,)
    bodies = [problem.index(place_of(side)[0]) for side in sides]
    places = [
        world(side, problem.state[7 * k : 7 * k + 3], problem.turns[k]) for side, k in zip(sides, bodies, strict=True)
    ]
    if item.kind == "distance":
        apart = places[1][0] - places[0][0]
        length = float(np.linalg.norm(apart))
        if not length > 0.0:
            raise InputError(f"measure {item.name!r} is the distance of two places that coincide; it has no derivative")
        directions = [-apart / length, apart / length]
    else:
        directions = [np.eye(3)[item.axis]]
    scales = np.repeat([problem.packed.scale, 1.0], 3)
    for side, k, (_, jacobian), direction in zip(sides, bodies, places, directions, strict=True):
        slopes[6 * k : 6 * k + 6] += (direction @ jacobian) * scales
        for r, number in enumerate(parameter._number for parameter in parameters):
            if isinstance(number, FrameOrigin) and number.frame is getattr(side, "base", side):
                own[r] += direction @ problem.turns[k][:, number.axis]


def _of_touching(problem: Problem, item: Measure, parameters: Sequence[Parameter], slopes: Array) -> None:
    """Write slopes of where a contact is on a face, over scaled twists."""
    for parameter in parameters:
        if isinstance(parameter._number, DIFFERENCED):
            raise InputError(
                f"parameter {parameter.name!r} makes faces, on which {item.name!r} is measured; expected other numbers"
            )
    scales = np.repeat([problem.packed.scale, 1.0], 3)
    sides = place_slopes(item.axis, item.thing, problem.packed, problem.state)
    for body, found in zip(item.thing.contact.bodies, sides, strict=True):
        at = 6 * problem.index(body)
        slopes[at : at + 6] += found * scales


def _of_wrench(problem: Problem, item: Measure, parameters: Sequence[Parameter], steps: Array, forces: Array) -> Array:
    """Derivatives of a component of -J^T y of one constraint's rows."""
    packed, here = problem.packed, problem.here
    places = [k for k, constraint in enumerate(problem.constraints) if constraint is item.thing]
    if not places or not any(item.on is body for body in bodies_of(item.thing, problem.bodies)):
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
    assert item.on is not None
    b = problem.index(item.on)
    at = 6 * b + item.axis
    pulls = (held @ here.jacobian)[6 * b : 6 * b + 6]
    rates = here.jacobian[own, at] @ forces[: packed.rows][own] + (alone.hessian - none.hessian)[at] @ steps
    if item.axis >= 3:
        # A turn of the body comes after its step.
        rates += 0.5 * np.cross(steps[6 * b + 3 : 6 * b + 6].T, pulls[3:])[:, item.axis - 3]
    rates += (by_frames(problem, alone) - by_frames(problem, none))[at]
    for r, parameter in enumerate(parameters):
        if isinstance(parameter._number, DIFFERENCED) or (
            isinstance(parameter._number, FrameNumber) and problem.frames.numbers[r] is None
        ):
            rates[r] += differences(problem, parameter, lambda there, _: held @ there.jacobian)[at]
    scale = packed.unit / (packed.scale if item.axis < 3 else 1.0)
    wrench: Array = -scale * rates
    return wrench
