"""Control points of faces: what a unit of one adds to the gaps of contacts, exactly, where nothing else is asked for.

A gap at a fixed pose changes by the motion of the surface's point along the normal: the pair is extremal, so that where
it slides to does not count. A control point moves a point of the surface by its share there, a rational basis function,
as a step of the body along the same axis would by one. So a row's derivative is that of such a step times the share.

How slopes of rows change needs more of the surface. They count where a solution has forces; without an objective it has
none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.derivatives.numbers import ControlPoint
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.features.solid_contact import TRACK

if TYPE_CHECKING:
    from assembly.derivatives.columns import Problem

__all__ = ["gap_rates"]

Array = NDArray[np.float64]


def gap_rates(problem: Problem, number: ControlPoint) -> Array | None:
    """What a unit of a control point's coordinate adds to residuals (m,); None where that is not all, or not known.

    It is known of contacts of two lone faces, in a scene without clearances, trims and objectives.
    """
    packed, here = problem.packed, problem.here
    has_folds = len(here.residual) > packed.rows
    if not packed.is_implicit or has_folds or packed.clearance_rows or packed.trims or problem.forces.any():
        return None
    result, tracked = np.zeros(len(here.residual)), problem.state[packed.contacts_at :][: TRACK * len(packed.contacts)]
    for k, (sides, domains) in enumerate(zip(packed.sides, packed.domains, strict=True)):
        if number.face not in sides:
            continue
        if domains is None:
            return None
        body = problem.index(number.face.body)
        for side, at in zip(sides, (0, 2), strict=True):
            if side is number.face:
                u, v = tracked.reshape(-1, TRACK)[k, at : at + 2].tolist()
                along = here.jacobian[k, 6 * body : 6 * body + 3] @ problem.turns[body][:, number.index[2]]
                result[k] += along * _share(side.face.surface, number.index[:2], u, v) / packed.scale
    return result


def _share(surface: NurbsSurface, index: tuple[int, int], u: float, v: float) -> float:
    """By how much of a control point's motion the surface's point moves at parameters u, v."""
    points = np.zeros_like(surface.control_points)
    # The first coordinate is the share; the others keep the net from being one point.
    points[..., 1:] = surface.control_points[..., 1:]
    points[index][0] = 1.0
    share = NurbsSurface(points, surface.knots, surface.degree, surface.weights).evaluate(u, v)
    return float(share[0])
