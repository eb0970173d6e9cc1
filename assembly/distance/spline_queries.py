"""The answers of the kernels for spline curves, points and surfaces, as objects.

Spline curves are searched by halving Bezier pieces (`distance/curves/search.py`, `point_curve.py`), with capsules
before that if a clearance is asked about (`capsules.py`); surfaces are searched by patches
(`distance/patches/search.py`), also against a curve that is given by a formula.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._address import address_of
from assembly.distance.curves.capsules import OPEN, capsule_tree, compare_curves, compare_point
from assembly.distance.curves.point_curve import UNFINISHED, nearest_on_curve, point_distance
from assembly.distance.curves.search import ANSWER, curve_distance
from assembly.distance.operands import coordinates, is_formula, share_a_point
from assembly.distance.patches.packing import pack_patches
from assembly.distance.patches.search import PATCH_ANSWER, patch_distance
from assembly.distance.piece_search import MEETING
from assembly.distance.separation import Separation, SeparationStatus
from assembly.geometry.expression.formula import WORKSPACE
from assembly.geometry.splines.bezier_packing import pack_point
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

if TYPE_CHECKING:
    from assembly.distance.patches.formula_packing import Formula

__all__ = [
    "compared",
    "from_pairs",
    "nearest_address",
    "quick_answer",
    "spline_distance",
    "surface_distance",
    "turned",
    "written_answer",
]

Array = NDArray[np.float64]
# Tolerance, clearance (below zero: none), budget and polish, as kernels take them.
Question = tuple[float, float, int, bool]
_WHERE_THEY_ARE = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]] * 2)
# By the number a kernel returns.
_DISTANCE = (
    SeparationStatus.CONVERGED,
    SeparationStatus.SEPARATED,
    SeparationStatus.NOT_SEPARATED,
    SeparationStatus.UNDECIDED,
    SeparationStatus.BUDGET_SPENT,
    SeparationStatus.NOT_SEPARATED,
)
_COLLISION = (
    SeparationStatus.CONVERGED,
    SeparationStatus.DISJOINT,
    SeparationStatus.HIT,
    SeparationStatus.UNDECIDED,
    SeparationStatus.BUDGET_SPENT,
    SeparationStatus.HIT,
)


def _capsules(curve: NurbsCurve) -> Array:
    """The tree of capsules that is kept with a curve."""
    kept: Array | None = curve.__dict__.get("_capsules")
    if kept is None:
        kept = curve.__dict__["_capsules"] = capsule_tree(*curve._packed_pieces)
    return kept


def compared(a: Any, b: Any, clearance: float) -> int:
    """What capsules say about two curves, or a curve and a point, that need no checks; OPEN about anything else."""
    if type(a) is not NurbsCurve:
        a, b = b, a
        if type(a) is not NurbsCurve:
            return OPEN
    d = a.control_points.shape[1]
    if type(b) is NurbsCurve:
        return int(compare_curves(_capsules(a), _capsules(b), clearance)) if d == b.control_points.shape[1] else OPEN
    place = coordinates(b, d)
    return OPEN if place is None else int(compare_point(_capsules(a), *place, clearance))


@cache
def nearest_address() -> int:
    """The address of `nearest_on_curve`."""
    return address_of(nearest_on_curve)


def quick_answer(a: Any, b: Any, question: Question, out: Array) -> int:
    """What a kernel answers for two curves, or a curve and a point, that need no checks; -1 for anything else."""
    if type(a) is not NurbsCurve:
        return -1
    d = a.control_points.shape[1]
    if type(b) is NurbsCurve:
        if d != b.control_points.shape[1]:
            return -1
        record, pool = b._packed_pieces
        return int(curve_distance(*a._packed_pieces, record, pool, question, d == 2, out))
    place = coordinates(b, d)
    if place is None or not question[3]:
        return -1
    record, pool = a._packed_pieces
    code = int(point_distance(record, pool, place, question, nearest_address(), out))
    return code if code != UNFINISHED else from_pairs(a, b, question, out)


def from_pairs(a: NurbsCurve, point: Array, question: Question, out: Array) -> int:
    """The search for pairs of curves, one of which is a point."""
    record, pool = pack_point(point)
    return int(curve_distance(*a._packed_pieces, record, pool, question, False, out))


def spline_distance(a: Any, b: Any, question: Question) -> Separation:
    """The answer of a kernel for checked operands."""
    if isinstance(a, NurbsSurface) or isinstance(b, NurbsSurface):
        return surface_distance(a, b, question)
    if type(a) is np.ndarray:
        if type(b) is np.ndarray:
            return _point_point(a.ravel(), b.ravel(), question)
        return turned(spline_distance(b, a, question))
    if type(b) is np.ndarray:
        b = b.ravel()
    out = np.empty(ANSWER)
    code = quick_answer(a, b, question, out)
    if code < 0:
        code = from_pairs(a, b, question, out)
    return written_answer(a, b, code, out, question)


def _patches(shape: Any) -> tuple[NDArray[np.int64], Array, Formula | None]:
    """Bezier patches of a shape, and the curve given by a formula that they stand for; kept with all but points."""
    if type(shape) is np.ndarray:
        return (*pack_patches(shape), None)
    kept: tuple[NDArray[np.int64], Array, Formula | None] | None = shape.__dict__.get("_packed_patches")
    if kept is None:
        if is_formula(shape):
            from assembly.distance.patches.formula_packing import pack_formula

            kept = pack_formula(shape)
        else:
            kept = (*pack_patches(shape), None)
        shape.__dict__["_packed_patches"] = kept
    return kept


def _surfaces_apart(a: NurbsSurface, b: NurbsSurface, question: Question) -> Separation:
    """The answer for two surfaces: bodies of one face each, where they are."""
    from assembly.distance.bodies.packing import tree_of
    from assembly.distance.bodies.query import bodies_apart, place_of_spot
    from assembly.geometry.faces.face import whole_face

    tolerance, clearance, budget, _polish = question
    trees = tree_of((whole_face(a),)), tree_of((whole_face(b),))
    found = bodies_apart(*trees, _WHERE_THEY_ARE, tolerance, budget, clearance)
    parameters = np.array([place_of_spot(trees[side], found.spot(side)).parameters for side in range(2)])
    status = _status(a, b, found.status, np.array([found.lower, found.upper]), question)
    return Separation(found.lower, found.upper, parameters.ravel(), found.points, status, found.pairs)


def surface_distance(a: Any, b: Any, question: Question) -> Separation:
    """The answer where one is a surface, which goes first, and the other no hull."""
    if isinstance(a, NurbsSurface) and isinstance(b, NurbsSurface) and question[3]:
        return _surfaces_apart(a, b, question)
    out = np.empty(PATCH_ANSWER)
    swap = not isinstance(a, NurbsSurface)
    first, second = (b, a) if swap else (a, b)
    record, pool, kept = _patches(second)
    # Room for the formula's runs is a call's own.
    curve = None if kept is None else (*kept, np.empty(int(kept[0][WORKSPACE])))
    code = int(patch_distance(*_patches(first)[:2], record, pool, curve, question, out))
    count = 2 if isinstance(second, NurbsSurface) else 0 if type(second) is np.ndarray else 1
    own = out[4 : 4 + count]
    parameters = np.concatenate([own, out[2:4]] if swap else [out[2:4], own])
    points = out[6:12].reshape(2, 3)
    status = _status(a, b, code, out, question)
    return Separation(float(out[0]), float(out[1]), parameters, points[::-1] if swap else points, status, int(out[12]))


def _status(a: Any, b: Any, code: int, out: Array, question: Question) -> SeparationStatus:
    """What a kernel's number means."""
    tolerance, clearance, _budget, _polish = question
    if clearance == 0.0:
        status = _COLLISION[code]
        if status is SeparationStatus.UNDECIDED and share_a_point(a, b):
            return SeparationStatus.HIT
    else:
        status = _DISTANCE[code]
    if (code == 0 or code == 3) and not out[1] - out[0] <= tolerance:
        return SeparationStatus.ROUNDED
    return status


def written_answer(a: NurbsCurve, b: Any, code: int, out: Array, question: Question) -> Separation:
    """What a kernel wrote, as a result."""
    tolerance, clearance, _budget, _polish = question
    lower, upper, *_, evaluations = out.tolist()
    if code == MEETING and upper > clearance > 0.0:
        # The distance is zero; how far apart the two points may be is their rounding alone.
        upper = clearance
    converged = code == 0 and upper - lower <= tolerance
    answer = object.__new__(Separation)
    # What the initializer of a frozen dataclass does, at a third of its time; arrays are made when they are read.
    fields = answer.__dict__
    fields["lower"] = lower
    fields["upper"] = upper
    fields["_written"] = out, a.control_points.shape[1], 1 if type(b) is np.ndarray else 2
    fields["status"] = SeparationStatus.CONVERGED if converged else _status(a, b, code, out, question)
    fields["evaluations"] = int(evaluations)
    return answer


def turned(answer: Separation) -> Separation:
    """The same with the two points in the other order."""
    answer.__dict__["points"] = answer.points[::-1]
    return answer


def _point_point(a: Array, b: Array, question: Question) -> Separation:
    """Two points; their difference, its square and its root are rounded seven times at most."""
    tolerance, clearance, _budget, _polish = question
    distance = math.dist(a, b)
    lower, upper = distance * (1.0 - 1e-15), distance * (1.0 + 1e-15)
    if clearance == 0.0:
        status = SeparationStatus.DISJOINT if lower > 0.0 else SeparationStatus.HIT
    elif clearance > 0.0:
        status = SeparationStatus.SEPARATED if lower > clearance else SeparationStatus.UNDECIDED
        if upper <= clearance:
            status = SeparationStatus.NOT_SEPARATED
    else:
        status = SeparationStatus.CONVERGED if upper - lower <= tolerance else SeparationStatus.ROUNDED
    return Separation(lower, upper, np.empty(0), np.stack([a, b]), status, 1)
