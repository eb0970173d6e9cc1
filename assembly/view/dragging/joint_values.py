"""Driving a joint's coordinate to a value for one solve."""

from __future__ import annotations

from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.joint import Joint
from assembly.errors import InputError, number
from assembly.solve.solution import Solution

__all__ = ["freedoms_of", "reach_of", "set_value"]

Array = NDArray[np.float64]


def freedoms_of(scene: Assembly) -> dict[str, Freedom]:
    """Every coordinate of every joint by its name in `Solution.values`."""
    return {
        f"{joint.name}.{name}": joint.freedom(name)
        for joint in scene.constraints
        if isinstance(joint, Joint)
        for name in joint.freedoms
    }


def reach_of(freedom: Freedom, size: float) -> tuple[float, float]:
    """From where to where a slider goes: the limits; else a turn, or the scene's size to both sides."""
    most = pi if freedom.coordinate.is_angle else size
    low = -most if freedom.lower == -inf else freedom.lower
    high = most if freedom.upper == inf else freedom.upper
    return low, high


def set_value(scene: Assembly, name: str, value: float, q: Array) -> Solution:
    """Solve a scene from poses (n, 7) with a coordinate at a value; one that is free is free again afterward.

    Raises
    ------
    InputError
        An unknown name, a value that is not finite or beyond the limits.
    """
    known = freedoms_of(scene)
    if name not in known:
        listed = ", ".join(map(repr, known))
        raise InputError(f"name is {name!r}; expected {f'one of {listed}' if known else 'a joint, but there is none'}")
    freedom, wanted = known[name], number(name, value)
    before = freedom.value
    limits = freedom.lower, freedom.upper
    if before is None and (limits[0] > -inf or limits[1] < inf):
        wanted = min(max(wanted, limits[0]), limits[1])
    try:
        freedom.value = wanted
        solution = scene.solve(q)
    finally:
        if before is None:
            freedom.value = None
    if before is not None and not solution.success:
        freedom.value = before
    return solution
