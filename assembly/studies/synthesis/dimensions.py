"""Dimensions of a mechanism found by an optimizer of scipy, with exact derivatives of solutions.

Dimensions are counted in parts of the width of their bounds. Sums of squares go to `least_squares` where there are no
other constraints: a step to dimensions that the scene has no solution with gives NaN there, which shortens it. All else
goes to SLSQP. There such a step has measures that are worse than all before, so that the line search shortens it.

The greatest of a measure over the stations is not smooth. One variable more, s, is minimized, with f_k <= s for every
station k.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from assembly._turn import in_turn
from assembly.assembly import Assembly
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.response import ResponseError
from assembly.errors import InputError, integer, positive
from assembly.studies.synthesis.goal import Bound, Goal, Relation
from assembly.studies.synthesis.result import Synthesis
from assembly.studies.synthesis.station import Station

__all__ = ["synthesize"]

Array = NDArray[np.float64]
# Measures solved anew from another start, and bounds, may be off by this much of what they are: solves are good to
# about 1e-12 of the scene, and worse where a mechanism is nearly stretched.
_SAME = 1e-8


@in_turn
def synthesize(
    scene: Assembly,
    minimize: Measure | Relation | Station | Sequence[Station],
    parameters: Mapping[Parameter, tuple[float, float]],
    *,
    subject_to: Sequence[Bound] = (),
    stations: Sequence[Station] = (),
    apply: bool = False,
    most: int = 200,
    level: float = 1e-6,
) -> Synthesis:
    """Find dimensions with which a mechanism does best what is wanted.

    Parameters
    ----------
    scene : Assembly
    minimize : stations with what is wanted there, a Measure, or a function
        Stations: the sum of squares of all differences, for example of a coupler's point from given positions. A
        measure: its value, or its greatest value over `stations`; "objective" is the value of the scene's own
        objective, for instance a `Dexterity`. A function: it takes the dimensions (p,), which the scene has meanwhile,
        and returns a number and its derivatives (p,), for example the area that a tip reaches.
    parameters : mapping of Parameter -> (low, high)
        The dimensions and their bounds. They start from their present values.
    subject_to : sequence of (what, low, high), optional
        Bounds that hold at the end, None for a side without one: of a measure, at every station; or of a function that
        takes the dimensions (p,) and gives a number and its derivatives (p,).
    stations : sequence of Station, optional
        If a measure is minimized: the states to consider.
    apply : bool
        Whether the scene's parameters are set to the values found in case of success; by default they are restored.
    most : int
        Steps after which the optimizer ends.
    level : float
        Slopes that count as zero: the change over the width of the bounds, in parts of what is minimized. Use 0.01 for
        a function whose derivatives are only good to a hundredth; SLSQP then ends when the value changes by less than
        the square of this.

    Returns
    -------
    Synthesis

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used, a start outside the bounds.
    ResponseError
        A station without a solution at the start, or measures without derivatives there.
    """
    if not isinstance(scene, Assembly):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    if not isinstance(apply, bool):
        raise InputError(f"apply is {apply!r}; expected True or False")
    integer("most", most, 1, 10**6)
    positive("level", level)
    goal = Goal(scene, minimize, parameters, subject_to, stations)
    start = goal.start_of_search()
    if goal.worst is None and goal.relation is None and not goal.bounds:
        # Coordinates' own trust regions: without active bounds its steps are those of Gauss and Newton.
        found = optimize.least_squares(
            goal.residuals,
            start,
            goal.residual_rates,
            bounds=(0.0, 1.0),
            method="dogbox",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-14,
            max_nfev=most,
        )
    else:
        found = _by_slsqp(goal, start, most, level)
    result = _checked(scene, goal, goal.values(np.clip(found.x, *goal.range)), level, str(found.message))
    if apply and result.success:
        result.apply()
    return result


def _by_slsqp(goal: Goal, start: Array, most: int, level: float) -> Any:
    sides = [(0.0, 1.0)] * len(goal.parameters) + [(None, None)] * (goal.worst is not None)
    return optimize.minimize(
        goal.cost,
        start,
        jac=True,
        bounds=sides,
        method="SLSQP",
        constraints=[{"type": "ineq", "fun": goal.rooms, "jac": goal.room_rates}],
        options={"ftol": 1e-15 if goal.relation is None else level**2, "maxiter": most},
    )


def _checked(scene: Assembly, goal: Goal, values: Array, level: float, message: str) -> Synthesis:
    """What was found, with stations solved anew, one from the other, and slopes that are level or held by bounds."""
    known, wrong = goal.evaluations.solved(values), list[str]()
    try:
        measures = goal.evaluations.solved_anew(scene, values)
    except (ResponseError, InputError) as error:
        measures = np.full(goal.count, np.nan)
        wrong.append(f"solved anew: {error}")
    if known is None or not (np.abs(known.measures - measures) <= _SAME * (1.0 + np.abs(measures))).all():
        wrong.append("stations solved one from the other are others than those solved from the start's")
    passed = goal.passed(values, measures)
    if not passed <= _SAME * (1.0 + np.abs(values).max()):
        wrong.append(f"bounds are passed by {passed:.1e}")
    slope = goal.slope_left(values)
    if not slope <= level:
        wrong.append(f"dimensions can be bettered: slopes are {slope:.1e}, not {level:.1e}")
    residuals = goal.differences(measures)
    cost = 0.5 * float(residuals @ residuals) if goal.worst is None else float(measures[goal.worst].max())
    if goal.relation is not None:
        cost = goal.related((values - goal.low) / goal.width)[0]
    evaluations = goal.evaluations
    return Synthesis(
        success=not wrong,
        message="; ".join([message, *wrong]),
        parameters=goal.parameters,
        values=values,
        cost=cost,
        residuals=residuals,
        measures=measures,
        violation=passed,
        evaluations=evaluations.count,
        failures=tuple(evaluations.failures),
    )
