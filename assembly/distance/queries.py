"""How far two shapes are apart, with a proof: curves, points, convex hulls and surfaces.

    lower <= min |a(s) - b(t)| <= upper

holds in floating point for every answer. Spline curves and surfaces are searched by halves of Bezier pieces
(`distance/spline_queries.py`), formulas and hulls by enclosures (`distance/enclosures/queries.py`). After paper 003
(Lakshmanan et al.), algorithms 1 to 4, with the conditions that make them complete.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.distance.curves.capsules import FARTHER, OPEN
from assembly.distance.curves.point_curve import UNFINISHED, point_distances
from assembly.distance.curves.search import ANSWER
from assembly.distance.operands import checked_operand, dimension, is_formula, is_spline
from assembly.distance.separation import Separation
from assembly.distance.spline_queries import (
    compared,
    from_pairs,
    nearest_address,
    quick_answer,
    spline_distance,
    surface_distance,
    turned,
    written_answer,
)
from assembly.errors import AssemblyError, InputError, integer, number, positive, real_array
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Bound", "closest_points", "collides", "is_separated", "minimum_distance", "minimum_distances"]

Array = NDArray[np.float64]
Bound = Literal["auto", "hull", "ellipsoid", "capsule", "taylor"]
_BOUNDS = ("auto", "hull", "ellipsoid", "capsule", "taylor")
_BUDGET = 200_000


def minimum_distance(
    a: Any,
    b: Any,
    tolerance: float = 1e-10,
    *,
    clearance: float | None = None,
    bound: Bound = "auto",
    polish: bool = True,
    max_evaluations: int = _BUDGET,
) -> Separation:
    """Certified bounds of the least distance of two shapes.

    Parameters
    ----------
    a, b : NurbsCurve, FormulaCurve, NurbsSurface, or array
        An array (d,) is a point, (k, d) the convex hull of its rows; d is 2 or 3 and the same for both.
    tolerance : float
        How far the two bounds may be apart, in the units of the shapes.
    clearance : float, optional
        End as soon as it is decided whether the shapes are farther apart than this. Zero asks whether they meet.
    bound : "auto", "hull", "ellipsoid", "capsule" or "taylor"
        How pieces are enclosed: "auto" chooses by the kind of the curve; the others are for comparison.
    polish : bool
        Newton's method with a proof of uniqueness. Without it bounds alone converge, as in paper 003.
    max_evaluations : int
        Pairs of pieces that may be bounded, at least 1.

    Returns
    -------
    Separation
        Its bounds are true whatever its status. With a clearance: SEPARATED (lower > clearance), NOT_SEPARATED
        (upper <= clearance), UNDECIDED (the clearance is between two bounds within the tolerance). With clearance 0:
        DISJOINT, HIT (a common point is proven) or UNDECIDED (a distance of at most the tolerance).

    Raises
    ------
    InputError
        An argument that does not fit, or two shapes that no query knows.
    """
    if not (type(tolerance) is float and 0.0 < tolerance < math.inf):
        tolerance = positive("tolerance", tolerance)
    if clearance is None:
        limit = -1.0
    else:
        limit = number("clearance", clearance)
        if limit < 0.0:
            raise InputError(f"clearance is {limit:g}; expected a distance, zero or more")
    if not (type(max_evaluations) is int and 0 < max_evaluations < 2**40):
        max_evaluations = integer("max_evaluations", max_evaluations, 1, 2**40)
    # An array would be compared by its elements.
    if not isinstance(bound, str) or bound not in _BOUNDS:
        raise InputError(f"bound is {bound!r}; expected one of {', '.join(_BOUNDS)}")
    if not isinstance(polish, (bool, np.bool_)):
        raise InputError(f"polish is {polish!r}; expected True or False")
    question = (tolerance, limit, max_evaluations, polish)
    if bound == "auto" or bound == "hull":
        out = np.empty(ANSWER)
        if type(a) is np.ndarray and type(b) is NurbsCurve:
            code = quick_answer(b, a, question, out)
            if code >= 0:
                return turned(written_answer(b, a, code, out, question))
        else:
            code = quick_answer(a, b, question, out)
            if code >= 0:
                return written_answer(a, b, code, out, question)
    a = checked_operand("a", a)
    b = checked_operand("b", b)
    if (d := dimension(a)) != (e := dimension(b)):
        raise InputError(f"a is in {d}-D and b in {e}-D; expected one space")
    if bound in ("auto", "hull") and is_spline(a) and is_spline(b):
        return spline_distance(a, b, question)
    if bound == "hull":
        raise InputError("bound is 'hull'; expected curves and surfaces of control points with it")
    if (is_formula(a) and isinstance(b, NurbsSurface)) or (is_formula(b) and isinstance(a, NurbsSurface)):
        if bound != "auto":
            raise InputError(f"bound is {bound!r}; expected 'auto' with a surface and a formula")
        return surface_distance(a, b, question)
    from assembly.distance.enclosures.queries import enclosed_distance

    return enclosed_distance(a, b, tolerance, clearance, bound, polish, max_evaluations)


def is_separated(a: Any, b: Any, clearance: float, tolerance: float = 1e-10) -> bool:
    """Whether two shapes are farther apart than a clearance.

    True is certified. False means that this is not proven: the distance is at most clearance + tolerance, or a budget
    of 200,000 pairs was spent.

    See `minimum_distance` for the arguments and what is raised.
    """
    if (
        type(tolerance) is float
        and type(clearance) is float
        and 0.0 < tolerance < math.inf
        and 0.0 <= clearance < math.inf
    ):
        said = compared(a, b, clearance)
        if said != OPEN:
            return said == FARTHER
        out = np.empty(ANSWER)
        if quick_answer(a, b, (tolerance, clearance, _BUDGET, True), out) >= 0:
            return bool(out[0] > clearance)
    limit = number("clearance", clearance)
    return minimum_distance(a, b, tolerance, clearance=limit).lower > limit


def collides(a: Any, b: Any, tolerance: float = 1e-10) -> bool:
    """Whether two shapes may meet.

    False is certified: they have no common point. True means that this is not proven: the distance is at most the
    tolerance, or a budget of 200,000 pairs was spent; `minimum_distance(a, b, clearance=0.0)` tells whether a common
    point is proven (HIT). A surface is a sheet and a plane curve a line: what lies inside does not meet it.

    See `minimum_distance` for the arguments and what is raised.
    """
    return not is_separated(a, b, 0.0, tolerance)


def closest_points(a: Any, b: Any, tolerance: float = 1e-10) -> Array:
    """A point of a and a point of b (2, d) whose distance is the least one to the tolerance.

    See `minimum_distance` for the arguments.

    Raises
    ------
    AssemblyError
        The bounds did not come within the tolerance: the text has them and says why.
    InputError
        An argument that does not fit.
    """
    answer = minimum_distance(a, b, tolerance)
    if not answer.converged:
        raise AssemblyError(
            f"the distance is between {answer.lower:.17g} and {answer.upper:.17g}, not known to the tolerance "
            f"{tolerance:g}: {answer.status.value}"
        )
    return answer.points


def minimum_distances(
    points: ArrayLike, curve: NurbsCurve, tolerance: float = 1e-10, *, max_evaluations: int = _BUDGET
) -> tuple[Array, Array, Array]:
    """Certified distances of many points from one curve, in one call.

    Parameters
    ----------
    points : (n, d)
        An array of no rows has no distances.
    curve : NurbsCurve
    tolerance : float
    max_evaluations : int
        For each point.

    Returns
    -------
    lower, upper, parameters : (n,) each
        Bounds, true whether or not they are within the tolerance, and the parameters of the nearest points.

    Raises
    ------
    InputError
        An argument that does not fit.
    """
    tolerance = positive("tolerance", tolerance)
    budget = integer("max_evaluations", max_evaluations, 1, 2**40)
    if not isinstance(curve, NurbsCurve):
        raise TypeError(f"curve is {curve!r}; expected a NurbsCurve")
    d = curve.control_points.shape[1]
    none = isinstance(points, np.ndarray) and points.shape == (0, d)
    rows = np.empty((0, d)) if none else real_array("points", points, ("n", d))
    out = np.empty((len(rows), ANSWER))
    codes = np.empty(len(rows), dtype=np.int64)
    space = np.zeros((len(rows), 3))
    space[:, :d] = rows
    record, pool = curve._packed_pieces
    question = (tolerance, -1.0, budget, True)
    point_distances(record, pool, space, question, nearest_address(), codes, out)
    for i in np.flatnonzero(codes == UNFINISHED):
        from_pairs(curve, rows[i], question, out[i])
    return out[:, 0].copy(), out[:, 1].copy(), out[:, 2].copy()
