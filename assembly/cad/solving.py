"""Assemblies of other libraries, solved where they stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from assembly.cad.build123d_solver import is_build123d, solve_build123d
from assembly.cad.cadquery_solver import solve_cadquery
from assembly.cad.libraries import is_of, shown
from assembly.errors import InputError
from assembly.solve.solution import Solution

__all__ = ["solve"]


def solve(assembly: Any, *, fixed: Any = (), driven: Mapping[Any, Any] | None = None, **options: Any) -> Solution:
    """Solve what holds between the parts of an assembly, and move them; nothing is moved where that fails.

    Of a `cadquery.Assembly` these are the constraints that its `constrain` was called with, and locations are set as
    its own `solve` sets them. Parts that are Fixed stay, and the assembly's own object does; where there is neither,
    the first part does that others are constrained to. Constraints hold to 1e-12 of the size, and not in the sense of
    least squares: where some contradict others by more than `fit`, the solution is INFEASIBLE and names them.
    Constraints that repeat each other do no harm. Shapes are not read, but for CadQuery's own markers on them.

    Of build123d's parts these are the joints that `connect_to` tied, also in loops, within their ranges. What they
    leave free stays as near as it can to where it is: to the values that `connect_to` was called with.

    Parameters
    ----------
    assembly : cadquery.Assembly, or build123d parts: a Compound with children, or several of them
    fixed : parts or their labels
        Of build123d: what does not move; the first part by default. Of CadQuery, say so by `constrain(name, "Fixed")`.
    driven : mapping of joint -> value
        Of build123d: values that joints are held at, an angle in degrees or a position; of a joint that has both
        {"angle": degrees, "position": length}.
    **options
        Of `Assembly.solve`: `tolerance`, `fit`, `time_limit` and so on.

    Returns
    -------
    Solution
        Constraints are named by their kinds and parts, "Plane base-lid", joints by parts and labels,
        "base.hinge-lid.pin"; bodies are those of the parts, and a world where constraints need it.

    Raises
    ------
    TypeError, InputError
        Something else, no constraints or joints that are tied, arguments that cannot be used.
    """
    if is_of("cadquery", "Assembly", assembly):
        if fixed or driven:
            raise InputError("fixed and driven are for build123d; expected assembly.constrain(name, 'Fixed') instead")
        return solve_cadquery(assembly, options)
    if is_build123d(assembly):
        return solve_build123d(assembly, fixed, {} if driven is None else driven, options)
    raise TypeError(f"assembly is {shown(assembly)}; expected a cadquery.Assembly, or build123d parts with joints")
