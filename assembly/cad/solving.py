"""Assemblies of other libraries, solved in place."""

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
    """Solve the constraints or joints between the parts of an assembly, and move the parts; if that fails nothing is
    moved.

    For a `cadquery.Assembly` these are the constraints given to its `constrain`, and locations are set as its own
    `solve` sets them. Fixed parts stay, and so does the assembly's own object; if there is neither, the first part that
    others are constrained to stays. Constraints hold to 1e-12 of the size, not in the sense of least squares: if some
    contradict others by more than `fit`, the solution is INFEASIBLE and names them. Redundant constraints do no harm.
    Of shapes only CadQuery's own markers are computed.

    For build123d's parts these are the joints connected by `connect_to`, also in loops, within their ranges. What they
    leave free stays as near as possible to where it is: to the values given to `connect_to`.

    Parameters
    ----------
    assembly : cadquery.Assembly, or build123d parts: a Compound with children, or several of them
    fixed : parts or their labels
        For build123d: parts that do not move; by default the first part. For CadQuery use `constrain(name, "Fixed")`
        instead.
    driven : mapping of joint -> value
        For build123d: values at which joints are held, an angle in degrees or a position, for a ball its three angles;
        for a joint that has both {"angle": degrees, "position": length}.
    **options
        Of `Assembly.solve`: `tolerance`, `fit`, `time_limit` and so on.

    Returns
    -------
    Solution
        Constraints are named by their kinds and parts, "Plane base-lid", joints by parts and labels,
        "base.hinge-lid.pin"; bodies are those of the parts, and a world body if constraints need it.

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
