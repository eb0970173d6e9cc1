"""Certified distances of curves given by a formula, of spline curves, points and convex hulls, by enclosures.

The answer of `enclosed_distance` is a `Separation`: bounds that hold in floating point whatever its status. The search
is `distance/enclosures/search.py`, what it rests on `enclosure.py` and `taylor.py`.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb, inf, isfinite
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import read_only
from assembly.distance.enclosures import hull_pair
from assembly.distance.enclosures import node as en
from assembly.distance.enclosures import search as es
from assembly.distance.enclosures.enclosure import AUTO, BEZIER, CAPSULE, ELLIPSOID, FORMULA, HULL, TAYLOR
from assembly.distance.patches.formula_packing import about
from assembly.distance.separation import Separation, SeparationStatus
from assembly.errors import InputError, integer, number, positive, real_array
from assembly.geometry.expression import formula
from assembly.geometry.splines import bezier_ranges
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.formula_curve import FormulaCurve

__all__ = ["BOUNDS", "Bound", "Operand", "enclosed_distance", "packed_operand"]

Array = NDArray[np.float64]
Bound = Literal["auto", "ellipsoid", "capsule", "taylor"]
BOUNDS: dict[str, int] = {"auto": AUTO, "ellipsoid": ELLIPSOID, "capsule": CAPSULE, "taylor": TAYLOR}
STATUSES = {
    es.CONVERGED: SeparationStatus.CONVERGED,
    es.SEPARATED: SeparationStatus.SEPARATED,
    es.NOT_SEPARATED: SeparationStatus.NOT_SEPARATED,
    es.HIT: SeparationStatus.HIT,
    es.DISJOINT: SeparationStatus.DISJOINT,
    es.UNDECIDED: SeparationStatus.UNDECIDED,
    es.BUDGET_SPENT: SeparationStatus.BUDGET_SPENT,
    es.ROUNDED: SeparationStatus.ROUNDED,
}


class Operand(NamedTuple):
    """A shape as the search reads it: kind, dimension, smooth parts, table, pool and doubles of room.

    Curves are given about a center, points and hulls as they are.
    """

    kind: int
    dimension: int
    parts: int
    table: NDArray[np.int64]
    pool: Array
    workspace: int


# Attributes in which a curve keeps its center, and itself packed about that center and about another one.
_CENTER, _KEY = "_enclosure_center", "_enclosure_operands"
_ORIGIN = np.zeros(3)


def enclosed_distance(
    a: FormulaCurve | NurbsCurve | ArrayLike,
    b: FormulaCurve | NurbsCurve | ArrayLike,
    tolerance: float = 1e-10,
    clearance: float | None = None,
    bound: Bound = "auto",
    polish: bool = True,
    max_evaluations: int = 100_000,
) -> Separation:
    """Bounds of the distance of two curves, of a curve and a point or a convex hull, or of two of the latter.

    Parameters
    ----------
    a, b : FormulaCurve, NurbsCurve, (d,) array or (k, d) array
        d = 2 or 3, the same for both; an array is a point, or the vertices of a convex hull in any order.
    tolerance : float
        Positive: upper - lower to reach.
    clearance : float, optional
        Ask only whether the distance is greater than this; zero: whether the shapes meet.
    bound : str
        How pieces of a curve are enclosed: "ellipsoid" (Lakshmanan et al. 003, theorem 1, corrected), "capsule",
        "taylor" (by second derivatives), or "auto", the least of the first and the last and a box.
    polish : bool
        Also use Newton's method and proofs by second derivatives. Without, and with "ellipsoid", this is the paper's
        plain method (algorithms 1 to 4).
    max_evaluations : int
        Pairs of pieces to bound at most.

    Returns
    -------
    Separation
        HIT also answers a plain distance query where shapes are proven to meet: the distance is zero, and `upper` says
        how far apart the two points are.

    Raises
    ------
    InputError, TypeError
        Another kind of operand, two dimensions, or an option that is not meant.
    """
    center = _center(a) if isinstance(a, (FormulaCurve, NurbsCurve)) else _center(b)
    first, second = packed_operand("a", a, center), packed_operand("b", b, center)
    if first.dimension != second.dimension:
        raise InputError(f"a is {first.dimension}-D and b {second.dimension}-D; expected one dimension for both")
    # Checks that numbers of the usual kind have passed already.
    goal = tolerance
    if not (type(tolerance) is float and 0.0 < tolerance < inf):
        goal = positive("tolerance", tolerance)
    gap = -1.0
    if clearance is not None:
        gap = number("clearance", clearance)
        if gap < 0.0:
            raise InputError(f"clearance is {gap:g}; expected zero, a positive number or None")
    if not isinstance(bound, str) or bound not in BOUNDS:
        raise InputError(f"bound is {bound!r}; expected one of {', '.join(BOUNDS)}")
    if not isinstance(polish, (bool, np.bool_)):
        raise InputError(f"polish is {polish!r}; expected True or False")
    budget = max_evaluations
    if not (type(max_evaluations) is int and 0 < max_evaluations <= 10**8):
        budget = integer("max_evaluations", max_evaluations, 1, 10**8)
    if first.kind == HULL and second.kind == HULL:
        return _between_hulls(first, second, goal, gap)
    swapped = first.kind == HULL
    if swapped:
        first, second = second, first
    state = np.zeros(en.SCRATCH)
    why = int(
        es.search(
            first.dimension + 1,
            *((shape.kind, shape.table, shape.pool, shape.workspace) for shape in (first, second)),
            *(center, (goal, gap, budget, bool(polish)), BOUNDS[bound], state),
        )
    )
    state = state[: en.STATE].copy()
    if not state[en.UPPER] < inf:
        _note_middles(*((b, a) if swapped else (a, b)), first, second, state)
    values = state.tolist()
    parameters = [_parameter(first, values[en.AT_S], values[en.SPAN_A])]
    if second.kind != HULL:
        parameters.append(_parameter(second, values[en.AT_T], values[en.SPAN_B]))
    return _answer(why, state, values, parameters, first.dimension, swapped)


def _note_middles(a: Any, b: Any, first: Operand, second: Operand, state: Array) -> None:
    """Points of both shapes where the search could bound nothing, so that the upper bound is one."""
    points = []
    for shape, operand, at, part in ((a, first, en.AT_S, en.SPAN_A), (b, second, en.AT_T, en.SPAN_B)):
        state[at] = state[part] = 0.0
        if operand.kind == HULL:
            points.append(np.reshape(shape, (-1, operand.dimension))[0].astype(np.float64))
            continue
        if operand.kind == FORMULA:
            state[at] = 0.5 * (shape.domain[0] + shape.domain[1])
        points.append(shape.evaluate(_parameter(operand, float(state[at]), 0.0)))
    # Points are evaluated to some roundings of their size, and to a curve's own error.
    size = sum(float(np.abs(point).max()) for point in points)
    error = getattr(a, "error", 0.0) + getattr(b, "error", 0.0)
    state[en.UPPER] = float(np.linalg.norm(points[0] - points[1])) * (1.0 + 1e-12) + 1e-10 * size + 4.0 * error
    state[en.POINT_A : en.POINT_A + 6] = 0.0
    for k, point in enumerate(points):
        state[en.POINT_A + 3 * k : en.POINT_A + 3 * k + point.size] = point


def _answer(
    why: int, state: Array, values: list[float], parameters: list[float], dimension: int, swapped: bool
) -> Separation:
    """What a search left in its state, which becomes a part of the answer."""
    points = state[en.POINT_A : en.POINT_A + 6].reshape(2, 3)
    if swapped:
        points = points[::-1]
    answer = object.__new__(Separation)
    # What the initializer of a frozen dataclass does, at a third of its time.
    answer.__dict__.update(
        lower=values[en.LOWER],
        upper=values[en.UPPER],
        parameters=read_only(np.array(parameters)),
        points=read_only(points[:, :dimension]),
        status=STATUSES[why],
        evaluations=int(values[en.COUNT]),
    )
    return answer


def _between_hulls(a: Operand, b: Operand, tolerance: float, clearance: float) -> Separation:
    state = np.zeros(en.SCRATCH)
    hull_pair.hull_distance(a.dimension + 1, a.pool, int(a.table[1]), b.pool, int(b.table[1]), state)
    met = state[en.MET] > 0.0
    if met:
        state[en.UPPER] = state[en.LOWER] = 0.0
    why = int(es.verdict(state[en.LOWER], state[en.UPPER], met, tolerance, 0.0, clearance))
    return _answer(why if why >= 0 else es.ROUNDED, state, state.tolist(), [], a.dimension, False)


def _parameter(operand: Operand, s: float, part: float) -> float:
    """Of the curve, from that of a Bezier piece."""
    if operand.kind == FORMULA:
        return float(s)
    o = int(operand.table[bezier_ranges.BREAKS]) + int(part)
    low, high = operand.pool[o : o + 2]
    return float(min(max(low + s * (high - low), low), high))


def _center(shape: Any) -> Array:
    """The middle of a curve, kept with it; of other shapes the origin, about which nothing is packed."""
    if not isinstance(shape, (FormulaCurve, NurbsCurve)):
        return _ORIGIN
    kept: Array | None = vars(shape).get(_CENTER)
    if kept is None:
        if isinstance(shape, FormulaCurve):
            low, high = shape.bounding_box()
        else:
            low, high = shape.control_points.min(axis=0), shape.control_points.max(axis=0)
        kept = np.zeros(3)
        kept[: len(low)] = 0.5 * low + 0.5 * high
        vars(shape)[_CENTER] = kept
    return kept


def packed_operand(what: str, value: Any, center: Array = _ORIGIN) -> Operand:
    """A curve about a center, a point or a hull as the search reads it."""
    if isinstance(value, (FormulaCurve, NurbsCurve)):
        kept: dict[bytes, Operand] = vars(value).setdefault(_KEY, {})
        key = center.tobytes()
        if key not in kept:
            if len(kept) > 1:
                own = vars(value).get(_CENTER, _ORIGIN).tobytes()
                for other in [other for other in kept if other != own]:
                    del kept[other]
            kept[key] = _formula(value, center) if isinstance(value, FormulaCurve) else _spline(value, center)
        return kept[key]
    if not isinstance(value, (np.ndarray, list, tuple)):
        raise TypeError(
            f"{what} is {value!r}; expected a FormulaCurve, a NurbsCurve, a point (d,) or the vertices of a hull (k, d)"
        )
    if not (type(value) is np.ndarray and value.dtype == np.float64 and value.ndim in (1, 2) and _is_plain(value)):
        shape = np.shape(value)
        wanted: list[int | str] = ["d"] if len(shape) == 1 else ["k", "d"]
        value = real_array(what, value, wanted)
        if value.shape[-1] not in (2, 3):
            raise InputError(f"{what} has shape {shape}; expected a point (d,) or a hull (k, d) with d = 2 or 3")
    d = value.shape[-1]
    count = value.size // d
    flat = np.zeros((count, 3))
    flat[:, :d] = value
    return Operand(HULL, d, 1, _hull_table(d, count), flat.reshape(-1), 1)


def _is_plain(points: Array) -> bool:
    """Whether an array of doubles has finite points of two or three coordinates, so that nothing else is checked."""
    return points.size > 0 and points.shape[-1] in (2, 3) and all(map(isfinite, points.ravel().tolist()))


@lru_cache(maxsize=256)
def _hull_table(dimension: int, count: int) -> NDArray[np.int64]:
    return np.array([dimension, count], dtype=np.int64)


def _formula(curve: FormulaCurve, center: Array) -> Operand:
    table, pool = about(curve, center)
    return Operand(FORMULA, curve.dimension, 1, table, pool, int(table[formula.WORKSPACE]))


def _spline(curve: NurbsCurve, center: Array) -> Operand:
    """The record of `geometry/splines/bezier_ranges.py`."""
    n, dimension = curve.degree, curve.control_points.shape[1]
    local = NurbsCurve(curve.control_points - center[:dimension], curve.knots, n, curve.weights)
    pieces = local.bezier_pieces()
    points = np.zeros((*pieces.shape[:2], 4))
    points[..., :dimension], points[..., 3] = pieces[..., :-1], pieces[..., -1]
    rational = bool(np.ptp(pieces[..., -1]) > 0.0)
    if not rational:
        points /= points[0, 0, 3]
    table = np.zeros(bezier_ranges.BEZIER_RECORD, dtype=np.int64)
    table[[bezier_ranges.DIMENSION, bezier_ranges.DEGREE, bezier_ranges.PIECES]] = dimension, n, len(pieces)
    table[bezier_ranges.RATIONAL] = rational
    pool: list[Array] = []
    largest, used, factor = np.zeros(5), 0, 1.0
    largest[4] = np.abs(points[..., :3] / points[..., 3:]).max()
    for order in range(4):
        table[bezier_ranges.POINTS + order] = used
        if n >= order:
            # Differences are off by their points' rounding, which the largest of all of them bounds.
            largest[order] = factor * 2.0**order * np.abs(points).max()
            derived = factor * np.diff(points, n=order, axis=1)
            pool.append(derived.ravel())
            used += derived.size
            factor *= n - order
    i = np.arange(n)
    row = np.array([comb(n - 1, int(k)) for k in i], dtype=np.float64)
    both = np.array([[comb(2 * n - 2, int(j + k)) for k in i] for j in i], dtype=np.float64)
    gram = row[:, None] * row / (both * (2 * n - 1))
    for place, values in (
        (bezier_ranges.LARGEST, largest),
        (bezier_ranges.GRAM, gram.ravel()),
        (bezier_ranges.BREAKS, curve.breaks()),
    ):
        table[place] = used
        pool.append(values)
        used += values.size
    packed = np.concatenate(pool)
    if not isfinite(float(packed.sum())):
        raise InputError("control points overflow in the derivatives of the curve; expected a scale nearer to one")
    workspace = bezier_ranges.BEZIER_AT + 32 + 4 * (n + 2)
    return Operand(BEZIER, dimension, len(pieces), table, packed, workspace)
