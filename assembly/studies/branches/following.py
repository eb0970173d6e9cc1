"""`asm.follow`: one branch of solutions, as a number of the scene changes, through its turning points.

Pseudo-arclength continuation (H. B. Keller 1977): from a point a step along the branch's tangent, and Newton's method
in the plane across it leads back onto the branch. The parameter is an unknown as poses are, so that nothing is singular
where it turns back. Where a branch crosses another one, the determinant of the equations' matrix, bordered by the
tangent, changes its sign; steps go over that along their own branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from assembly._turn import in_turn
from assembly.derivatives.implicit import check_is_of, several, the_scene
from assembly.derivatives.measure import Measure
from assembly.derivatives.numbers import ControlPoint, ControlWeight, LeastGap, ShapeNumber
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError, bounded
from assembly.proximity.clearance.proof import LEAST_SIZE
from assembly.solve.clearance_proof import can_prove
from assembly.solve.solution import Solution
from assembly.studies.branches.follower import Follower
from assembly.studies.branches.options import FollowOptions
from assembly.studies.branches.result import Branch, branch_of
from assembly.studies.branches.surroundings import CrowdedError

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["follow"]

# Numbers with which faces, or the gaps that are proven, change.
OF_FACES = (ControlPoint, ControlWeight, LeastGap, ShapeNumber)


@in_turn
def follow(
    scene: Assembly,
    parameter: Parameter,
    low: float,
    high: float,
    *,
    of: Measure | Sequence[Measure] = (),
    start: Solution | None = None,
    **options: Any,
) -> Branch:
    """Follow the branch of a solution while a parameter goes from one end of a range to the other.

    The branch is followed both ways from the start, through turning points of the parameter, until it leaves the range,
    closes, or ends; docs/branches.md lists the events. The scene's own number is restored afterwards.

    Parameters
    ----------
    scene : Assembly
        Rows must determine the poses, or an objective must.
    parameter : Parameter
        One that is set in place, or makes faces.
    low, high : float
        The range, which has the parameter's value in it.
    of : Measure or several, optional
        Measures that the table has.
    start : Solution, optional
        Of the scene as it is now; solved by default.
    **options
        See `FollowOptions`.

    Raises
    ------
    InputError, TypeError
        A range without the parameter's value, a start that failed or at which bodies are not known to be clear, a scene
        with free motions and no objective; `swept` without a clearance, or of a number that makes faces.
    """
    the_scene(scene)
    if not isinstance(parameter, Parameter):
        raise TypeError(f"parameter is {parameter!r}; expected a Parameter")
    settings = FollowOptions.of(options)
    low, high = bounded("low", low), bounded("high", high)
    check_is_of("parameter", scene, parameter)
    value = parameter.value
    if not low <= value <= high or not low < high:
        raise InputError(
            f"low and high are {low:g} and {high:g}; expected low below high, and {parameter.name} = {value:g}, from "
            "where the branch is followed, in between"
        )
    measures = () if isinstance(of, (tuple, list)) and not of else several("of", of, Measure)
    _check_clearances(scene, parameter, settings)
    solution = scene.solve() if start is None else start
    if not isinstance(solution, Solution):
        raise TypeError(f"start is {start!r}; expected a Solution")
    if not solution.success:
        raise InputError(
            f"start is {solution.status.name} at {parameter.name} = {value:g}; expected a solution that succeeded: "
            f"{solution.message}"
        )
    try:
        while True:
            try:
                follower = Follower(scene, parameter, (low, high), settings, solution)
                ways = follower.ways()
                return branch_of(follower.first, ways, measures, follower.depth)
            except CrowdedError:
                # With more slots it begins anew: rows are others.
                parameter._number.put(value)
                scene._pack_with_more_places()
    finally:
        parameter._number.put(value)
        scene.packed().refresh()


def _check_clearances(scene: Assembly, parameter: Parameter, settings: FollowOptions) -> None:
    """Raise where what is asked of clearances cannot be told."""
    packed = scene.packed()
    if settings.swept and not packed.keeps_apart:
        raise InputError("swept is True where no clearance keeps bodies apart; expected one, asm.Clearance()")
    if packed.keeps_apart and not can_prove(packed):
        low, high = LEAST_SIZE, 1.0 / LEAST_SIZE
        raise InputError(f"scene has clearances and a size of {packed.scale:g}; expected {low:g} to {high:g}")
    if settings.swept and isinstance(parameter._number, OF_FACES):
        raise InputError(
            f"swept is True for {parameter.name}, with which faces or least gaps change; expected a number with which "
            "bodies move"
        )
