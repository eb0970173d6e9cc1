"""How the boundary of a workspace moves with numbers of its scene, and what that adds to the area or volume.

At a place x of the boundary the tip was drawn to a target m outside, and |m - x|^2 is the least that the objective of
that solve can be. By the envelope theorem its derivative by a parameter is that of the objective and the rows with the
pose held; so that of the distance d = |m - x| is known, and the boundary comes nearer by -dd/dp along its normal. The
content changes by the integral of that over the boundary.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.derivatives.implicit import sensitivity
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError
from assembly.studies.reachable.drawn_tip import DrawnTip

__all__ = ["BoundaryStops", "boundary_integral"]

Array = NDArray[np.float64]
# [cells] A place that is farther from where it was is another one.
_SAME = 1e-3


class BoundaryStops(NamedTuple):
    """Places (m, 3) of the boundary, the targets (m, 3) the tip was drawn to, poses (m, n, 7); the cells' size."""

    tip: DrawnTip
    size: float
    places: Array
    targets: Array
    poses: Array


def boundary_integral(stops: BoundaryStops, shares: Array, parameters: Sequence[Parameter]) -> Array:
    """The derivatives (p,) of the content, with the lengths or areas (m,) that places stand for."""
    result, told, without = np.zeros(len(parameters)), 0.0, 0.0
    for k in np.flatnonzero(shares > 0.0).tolist():
        velocities = _normal_velocities(stops, k, parameters)
        if np.isfinite(velocities).all():
            told += shares[k]
            result += shares[k] * velocities
        else:
            without += shares[k]
    if not told > 0.0:
        raise InputError("no place of the boundary has a derivative by the parameters; expected another scene")
    # Places without a derivative, as where two arcs meet at a stop, move as the others do on average.
    result *= (told + without) / told
    return result


def _normal_velocities(stops: BoundaryStops, k: int, parameters: Sequence[Parameter]) -> Array:
    """How fast the boundary goes outward at a place, a unit of each parameter, (p,)."""
    stop = stops.tip.to(stops.targets[k], stops.poses[k])
    place = stops.tip.place(stop)
    if not stop.has_ended or np.linalg.norm(place - stops.places[k]) > _SAME * stops.size:
        raise InputError(
            f"the tip stops at {place.tolist()} instead of {stops.places[k].tolist()} of the boundary; "
            "expected the scene with the numbers with which the workspace was found"
        )
    derived = sensitivity(stops.tip.scene, stop.solution, Measure("objective"), parameters)
    slopes = 0.5 * (derived.shrinking + derived.growing)[0]
    velocities: Array = -slopes / (2.0 * np.linalg.norm(stops.targets[k] - place))
    return velocities
