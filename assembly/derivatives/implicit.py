"""Derivatives of a solution with respect to numbers of its scene, by the implicit function theorem."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._turn import in_turn
from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.contents import Contents
from assembly.constraints.packing.renumbered import have_same_numbers
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.contact import TOUCHING
from assembly.derivatives.columns import Columns, Frames, Problem, columns_of
from assembly.derivatives.kkt import Moves, System, one_sided_moves, solve_system
from assembly.derivatives.measure import Measure
from assembly.derivatives.measured import rates_of
from assembly.derivatives.numbers import FrameNumber, LeastGap, PlaceNumber, RowNumber, TargetNumber
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.plan import kept_plan, layout_of, plan_of
from assembly.derivatives.probed import Evaluated, ProbedScene
from assembly.derivatives.result import Moved, Sensitivity
from assembly.errors import InputError, items
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.solve.second_order.dense import CUT, PUSHING, STATIONARY, UNBALANCED
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["check_is_of", "sensitivity", "several", "the_scene"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# One-sided derivatives that differ by no more are one.
SAME = 1e-9


@partial(in_turn, calls_back=False)
def sensitivity(
    scene: Assembly, solution: Solution, of: Measure | Sequence[Measure], wrt: Parameter | Sequence[Parameter]
) -> Sensitivity:
    """How measures of a solution change with parameters of its scene.

    With an objective the derivative is that of the stationary point on the rows; without one it is that of the least
    move from the solution's own pose. See docs/sensitivity.md.

    Parameters
    ----------
    scene : Assembly
    solution : Solution
        A successful one of the scene as it is now.
    of : Measure or sequence of Measure
    wrt : Parameter or sequence of Parameter

    Raises
    ------
    InputError, TypeError
        A solution that failed, or of other numbers than the scene has now; a parameter that enters nothing.
    """
    the_scene(scene)
    plan = kept_plan(solution, of, wrt)
    if plan is not None:
        # Made for these very measures and parameters, which were looked at then.
        planned = plan.derived(*_checked(scene, solution))
        if planned is not None:
            return planned
    measures = several("of", of, Measure)
    parameters = several("wrt", wrt, Parameter)
    packed, state = _checked(scene, solution)
    if plan is None:
        plan = plan_of(solution, scene.bodies, (measures, parameters))
        planned = None if plan is None else plan.derived(packed, state)
        if planned is not None:
            return planned
    return _derived(scene, solution, measures, parameters)


def _derived(
    scene: Assembly, solution: Solution, measures: Sequence[Measure], parameters: Sequence[Parameter]
) -> Sensitivity:
    """The general way: for all there is."""
    problem, pushing, weak = _problem(scene, solution, measures, parameters)
    columns = columns_of(problem, parameters)
    system, moving = _system(problem, columns)
    below, above = _moves(system, pushing, weak)
    rates = [
        rates_of(problem, measures, parameters, columns, moving, moves)
        for moves in {id(below): below, id(above): above}.values()
    ]
    return _result(problem, measures, parameters, (below, above), moving, rates)


def the_scene(scene: Assembly) -> Assembly:
    """A scene, and nothing else."""
    if not isinstance(scene, Contents):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    return scene


def check_is_of(name: str, scene: Assembly, parameter: Parameter) -> None:
    """Raise for a parameter of another scene, as far as it tells."""
    number = parameter._number
    known = True
    if isinstance(number, RowNumber):
        owner = number.owner.joint if isinstance(number.owner, Freedom) else number.owner
        known = any(item is owner for item in scene.constraints)
    elif isinstance(number, LeastGap):
        known = any(item is number.owner for item in scene.constraints)
    elif isinstance(number, PlaceNumber):
        known = any(item is number.place for item in (*scene.constraints, *(term for _, term in scene.objectives)))
    elif isinstance(number, TargetNumber):
        known = any(term is number.term for _, term in scene.objectives)
    elif isinstance(number, FrameNumber):
        known = any(body is number.frame.body for body in scene.bodies)
    if not known:
        raise InputError(f"{name} has {parameter.name!r}, which is of another scene; expected ones of this scene")


def several(name: str, value: Any, kind: type) -> tuple[Any, ...]:
    """One thing of a kind, or several."""
    given = (value,) if isinstance(value, kind) else items(name, value, f"a {kind.__name__} or several")
    for k, item in enumerate(given):
        if not isinstance(item, kind):
            raise TypeError(f"{name}[{k}] is {item!r}; expected a {kind.__name__}")
    if not given:
        raise InputError(f"{name} is empty; expected a {kind.__name__} at least")
    return given


def _checked(scene: Assembly, solution: Solution) -> tuple[Packed, Array]:
    """How the scene of a solution is packed, and its state."""
    if not isinstance(solution, Solution):
        raise TypeError(f"solution is {solution!r}; expected a Solution")
    if not solution.success:
        raise InputError(f"solution is {solution.status.name}; expected one that succeeded")
    packed, state = solution._packed, solution._state
    if not have_same_numbers(packed, scene.packed()):
        raise InputError(
            "solution is of another scene, or of this one with other numbers; expected one "
            "solved with the present numbers"
        )
    packed.refresh()
    if not _are_same(packed.asked, solution._asked):
        raise InputError(
            "solution was solved with other values or targets than the scene has now; expected one solved with these"
        )
    if solution._begun is not None:
        packed.measure_from(solution._begun)
    return packed, state


def _problem(
    scene: Assembly, solution: Solution, measures: Sequence[Measure], parameters: Sequence[Parameter]
) -> tuple[Problem, Flags, Flags]:
    """The solution as it is derived; which rows hold, and which are at their bound without a force."""
    packed, state = _checked(scene, solution)
    bodies = scene.bodies
    turns = np.array([rotation_matrix(row) for row in state[: packed.contacts_at].reshape(-1, 7)[:, 3:]])
    frames = Frames(packed, parameters, turns, bodies)
    coordinates = [item.thing.coordinate for item in measures if item.kind == "coordinate"]
    probed = ProbedScene(packed, state, bodies, frames.each, coordinates)
    given = state[packed.multipliers_at : packed.residuals_at]
    # The least move: nothing pushes, and every one-sided row at its bound may open.
    here = probed.evaluate(np.zeros_like(given) if packed.is_implicit else given)
    folds = len(here.residual) - packed.rows
    one_sided = np.concatenate([packed.one_sided, np.zeros(folds, dtype=bool)])
    touching = ~one_sided | (np.abs(here.residual) <= TOUCHING)
    forces = np.zeros(len(here.residual))
    if not packed.is_implicit:
        forces[: packed.rows] = given
        forces = _balanced(here, _moving(bodies, len(here.gradient)), forces, touching, one_sided)
        if not np.array_equal(forces[: packed.rows], given) or forces[packed.rows :].any():
            here = probed.evaluate(forces)
    pushing = ~one_sided | (touching & (forces < -PUSHING))
    problem = Problem(
        bodies, solution._scene.constraints, scene.objectives, packed, state, turns, forces, frames, probed, here
    )
    return problem, pushing, touching & ~pushing


def _are_same(asked: Sequence[Any], others: Sequence[Any]) -> bool:
    """Whether values and targets are; a loop of its own, because every call of `sensitivity` goes through it."""
    if len(asked) != len(others):
        return False
    for a, b in zip(asked, others, strict=True):
        if a is b:
            continue
        if not (np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b):
            return False
    return True


def _moving(bodies: Sequence[Body], n: int) -> NDArray[np.int64]:
    """The columns, of n, of bodies that move, and of folds."""
    moving = np.repeat([not body.fixed for body in bodies], 6)
    return np.flatnonzero(np.concatenate([moving, np.ones(n - moving.size, dtype=bool)]))


def _balanced(here: Evaluated, columns: NDArray[np.int64], forces: Array, touching: Flags, one_sided: Flags) -> Array:
    """Multipliers with what is missing for balance in the columns that move; rows of folds have none in a state."""
    gradient, jacobian = here.gradient, here.jacobian
    left = (gradient + forces @ jacobian)[columns]
    if np.abs(left).max(initial=0.0) > UNBALANCED:
        rows = np.flatnonzero(touching)
        forces = forces.copy()
        forces[rows] -= np.linalg.lstsq(jacobian[np.ix_(rows, columns)].T, left, rcond=CUT)[0]
        forces[one_sided] = np.minimum(forces[one_sided], 0.0)
        left = (gradient + forces @ jacobian)[columns]
        if np.abs(left).max(initial=0.0) > STATIONARY:
            raise InputError(
                "solution is no stationary point of the objective as it is now; expected one solved with it, "
                "and of a Posture without a reference the last solve of the scene"
            )
    return forces


def _system(problem: Problem, columns: Columns) -> tuple[System, NDArray[np.int64]]:
    """The equations in the twists of moving bodies and coordinates of folds; and which columns these are."""
    here = problem.here
    moving = _moving(problem.bodies, len(here.gradient))
    rows_by, slopes_by = columns.rows, columns.slopes[moving]
    hessian = here.hessian[np.ix_(moving, moving)]
    if problem.packed.is_implicit:
        # Of the least move: |x|^2 + lever^2 |turn|^2 of every body, as a posture from here has it.
        weights = np.zeros(len(here.gradient))
        for k, body in enumerate(problem.bodies):
            lever = 0.5 * (body.size or problem.packed.scale) / problem.packed.scale
            weights[6 * k : 6 * k + 6] = [1.0, 1.0, 1.0, lever**2, lever**2, lever**2]
        hessian, slopes_by = np.diag(weights[moving]), np.zeros_like(slopes_by)
    jacobian = np.ascontiguousarray(here.jacobian[:, moving])
    return System(jacobian, hessian, rows_by, slopes_by, problem.packed.is_implicit), moving


def _moves(system: System, pushing: Flags, weak: Flags) -> tuple[Moves, Moves]:
    """The derivatives from below and from above."""
    if not weak.any():
        both = solve_system(system, pushing)
        return both, both
    sides = []
    for sign in (-1.0, 1.0):
        moves = one_sided_moves(system, pushing, weak, sign)
        if moves is None:
            raise InputError(
                f"solution has {int(weak.sum())} one-sided rows at their bounds without a force; expected fewer"
            )
        sides.append(moves)
    return sides[0], sides[1]


def _result(
    problem: Problem,
    measures: Sequence[Measure],
    parameters: Sequence[Parameter],
    sides: tuple[Moves, Moves],
    moving: NDArray[np.int64],
    rates: Sequence[tuple[Array, Flags]],
) -> Sensitivity:
    """What is told of it."""
    below, above = sides
    (shrinking, loose), (growing, _) = rates[0], rates[-1]
    packed = problem.packed
    reasons: dict[str, str] = {}
    # No negative zeros.
    shrinking, growing = shrinking + 0.0, growing + 0.0
    for moves, matrix in ((below, shrinking), (above, growing)):
        matrix[:, moves.contradicts | moves.drifts] = np.nan
    differs = np.abs(shrinking - growing) > SAME * (1.0 + np.abs(shrinking) + np.abs(growing))
    for k, parameter in enumerate(parameters):
        if below.contradicts[k] or above.contradicts[k]:
            reasons[parameter.name] = "rows that repeat each other cannot all follow it: no solution is beside this one"
        elif below.drifts[k] or above.drifts[k]:
            reasons[parameter.name] = "the objective has no curvature along a motion that it asks for"
        elif differs[:, k].any():
            reasons[parameter.name] = "a one-sided row is at its bound without a force: shrinking | growing"
    matrix = np.where(differs | np.isnan(shrinking) | np.isnan(growing), np.nan, 0.5 * (shrinking + growing))
    both = below is above
    matrix = shrinking if both else matrix
    steps = np.zeros((len(problem.here.gradient), len(parameters)))
    steps[moving] = below.steps if both else 0.5 * (below.steps + above.steps)
    lost = np.isnan(matrix).all(axis=0) if measures else np.zeros(len(parameters), dtype=bool)
    steps[:, lost] = np.nan
    forces = (below.forces if both else 0.5 * (below.forces + above.forces))[: packed.rows]
    return Sensitivity(
        tuple(measures),
        tuple(parameters),
        matrix,
        shrinking,
        growing,
        loose,
        below.rank,
        reasons,
        Moved(
            layout_of(problem.bodies, problem.constraints, packed, True),
            np.concatenate((steps, forces)),
            packed.scale,
            packed.unit,
        ),
    )
