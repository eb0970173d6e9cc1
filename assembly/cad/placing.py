"""Assemblies of other libraries moved to the poses of a solution."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from assembly.cad.build123d_parts import place_build123d
from assembly.cad.cadquery_parts import place_cadquery
from assembly.cad.libraries import is_of, shown
from assembly.errors import InputError
from assembly.solve.solution import Solution

__all__ = ["place"]

Thing = TypeVar("Thing")


def place(assembly: Thing, solution: Solution) -> Thing:
    """Move the parts of an assembly to the poses of their bodies in a solution.

    Parameters
    ----------
    assembly : cadquery.Assembly, build123d Compound with children, or several build123d parts
        What `from_cadquery` or `from_build123d` was called with. Bodies and parts are matched by their names.
    solution : Solution
        It may have other bodies as well; parts without a body in it keep their location in their parent.

    Returns
    -------
    The same assembly, its locations changed.

    Raises
    ------
    TypeError, InputError
        Something else, a solution that did not succeed, or one that has a body of none of the parts.
    """
    if not isinstance(solution, Solution):
        raise TypeError(f"solution is {shown(solution)}; expected a Solution, what a solve returns")
    if not solution.success:
        raise InputError(f"solution is {solution.status.name}; expected one that succeeded: {solution.message}")
    names = {body.name for body in solution._scene.bodies}
    if is_of("cadquery", "Assembly", assembly):
        placed = place_cadquery(assembly, solution, names)
    elif is_of("build123d", "Shape", assembly) or isinstance(assembly, Iterable):
        placed = place_build123d(assembly, solution, names)
    else:
        raise TypeError(f"assembly is {shown(assembly)}; expected a cadquery.Assembly or build123d parts")
    if not placed:
        known = ", ".join(map(repr, sorted(names)))
        raise InputError(f"assembly has no part of the solution's bodies; expected one of {known}")
    return assembly
