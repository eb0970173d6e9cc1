"""Nearest axes chosen at the start of a solve, and chosen anew where that fails.

Where bodies lie scattered, what their axes are nearest to means little, and may contradict what other constraints ask:
a plate that is to lie flush, and stands upright now, may have its bores on the wrong side of being perpendicular. Then
the constraints without those of nearest axes are held first, and axes are aligned or opposed as they are there.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.joint import Joint
from assembly.solve.interruption import Interruption
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["with_axes_of_the_rest"]

Array = NDArray[np.float64]


def with_axes_of_the_rest(
    scene: Assembly,
    failed: Solution,
    given: Array,
    starts: Mapping[str, ArrayLike] | None,
    options: dict[str, Any],
    interruption: Interruption,
) -> Solution:
    """A solve with axes as they are nearest where the other constraints hold; what failed where that is no better.

    Parameters
    ----------
    scene : Assembly
    failed : Solution
        With axes as they are nearest at the start.
    given : (n, 7)
        The start.
    starts, options, interruption
        Of the solve that failed.
    """
    nearest = [item for item in scene.constraints if isinstance(item, Joint) and item.asked_axes == "nearest"]
    others = [item for item in scene.constraints if item not in nearest]
    if not others or interruption.is_over():
        return failed
    rest = type(scene)(scene.bodies)
    rest._take_constraints(others)
    named = None if starts is None else {name: starts[name] for name in starts}
    held = rest._from_start(given, named, options, interruption)
    if not held.success or interruption.is_over():
        return failed
    poses = dict(zip(scene.bodies, held.q, strict=True))
    if {item.name: item._nearest_at(poses) for item in nearest} == failed.axes:
        return failed
    with scene._axes_as_at(held.q):
        solution = scene._from_start(given, starts, options, interruption)
    solution.seconds += failed.seconds + held.seconds
    return solution if solution.success else failed
