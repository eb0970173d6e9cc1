"""Extremal pairs of two surfaces and how they move, from Python.

A configuration row q is [x y z qw qx qy qz], body to world; a quaternion of any length but zero
stands for the rotation of its unit. Everything returned is in world axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays
from assembly._record import place_of
from assembly.errors import InputError, integer, real_array, vector
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.evaluate import OFFSETS, SURFACE_RECORD
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import BodyFace
from assembly.kinematics.pose import PoseLike, pose_row
from assembly.proximity.brep.records import FACE
from assembly.proximity.extrema.feature_query import PLACED, PLACED_PAIR, feature_derivatives, find_descent, find_pair
from assembly.proximity.extrema.feedback import CROSSED

__all__ = ["ContactPair", "PairStatus", "contact_jacobian", "descend", "extremal_pair", "gap_gradient", "gap_hessian"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
Side = NurbsSurface | Face | BodyFace
# How far from extremal a pair may be where its derivatives are asked for.
EXTREMAL = 1e-6


class PairStatus(Enum):
    """What became of a pair; the value says what to do."""

    CONVERGED = "the pair is extremal and isolated"
    SINGULAR = "extremal, but one of a continuum; the current one is kept"
    LEFT_PATCH = "no extremum inside: the pair is held at the end of a patch; extend it or start elsewhere"
    NOT_CONVERGED = "Newton did not converge; give a nearer start, or none for a global one"


STATUSES = tuple(PairStatus)
# Fields of a pair that a query writes. A call takes as long as what reads them by name from a record.
_PARAMETERS, _POINTS, _NORMAL, _GAP = (
    place_of(PLACED_PAIR, name) for name in ("parameters", "point_f", "normal", "gap")
)
# Where the records of the two surfaces are in the table of a query.
_SURFACES = 0, SURFACE_RECORD


@dataclass(frozen=True, eq=False)
class ContactPair(ReadOnlyArrays):
    """An extremal pair of points of two surfaces f and g.

    Attributes
    ----------
    parameters : (4,)
        u_f, v_f, u_g, v_g.
    points : (2, 3)
        The point of f and the point of g, world coordinates.
    normal : (3,)
        Outward unit normal of f at its point.
    gap : float
        normal . (g - f): positive apart, negative interpenetrating.
    status : PairStatus
    features : (str, str) or None
        Of a contact between solids the features that are closest: faces, edges or vertices. The parameters are then
        (u, v) of a face, (t, 0) of an edge, (0, 0) of a vertex.
    """

    parameters: Array = field(repr=False)
    points: Array
    normal: Array
    gap: float
    status: PairStatus
    features: tuple[str, str] | None = None


def as_face(name: str, side: Side) -> Face:
    """The face meant by a surface, a face, or a face of a body."""
    if isinstance(side, BodyFace):
        return side.face
    if isinstance(side, Face):
        return side
    if isinstance(side, NurbsSurface):
        return Face(side)
    raise TypeError(f"{name} is {side!r}; expected a NurbsSurface or a Face")


def _key(face: Face) -> tuple[NurbsSurface, bool]:
    return face.surface, face.reversed


@lru_cache(maxsize=64)
def _packed(f: tuple[NurbsSurface, bool], g: tuple[NurbsSurface, bool]) -> tuple[Table, Array, float]:
    """Two surfaces as one table and one pool, and the larger size."""
    record_f, pool_f = Face(f[0], reversed=f[1]).packed()
    record_g, pool_g = Face(g[0], reversed=g[1]).packed()
    record_g = record_g.copy()
    record_g[list(OFFSETS)] += pool_f.size
    return np.concatenate([record_f, record_g]), np.concatenate([pool_f, pool_g]), max(f[0].size, g[0].size)


def _configuration(q_f: PoseLike, q_g: PoseLike) -> Array:
    q = np.empty((2, 7))
    for k, (name, value) in enumerate((("q_f", q_f), ("q_g", q_g))):
        q[k] = pose_row(name, value)
    return q


def inside(name: str, parameters: Array, surfaces: tuple[NurbsSurface, NurbsSurface]) -> tuple[float, ...]:
    """Parameters as a tuple, wrapped; raises where one lies beyond the end of an open direction."""
    result = []
    for k, value in enumerate(parameters.tolist()):
        surface, direction = surfaces[k // 2], k % 2
        low, high = surface.domain[direction]
        if not low <= value <= high:
            if not surface.closed[direction]:
                raise InputError(f"{name}[{k}] is {value:g}; expected a parameter in [{low:g}, {high:g}]")
            value = low + (value - low) % (high - low)
        result.append(value)
    return tuple(result)


def extremal_pair(
    surface_f: Side, q_f: PoseLike, surface_g: Side, q_g: PoseLike, start: ArrayLike | None = None
) -> ContactPair:
    """The extremal pair of two surfaces: closest when apart, through touching and interpenetration.

    Parameters
    ----------
    surface_f, surface_g : NurbsSurface, Face or BodyFace
    q_f, q_g : Pose or (7,)
        Their bodies' poses.
    start : (4,), optional
        Parameters near the pair: Newton's method goes to the extremum near them. Without a start, bounding cells of
        both surfaces are searched; of the extrema found, those with opposed outward normals come first, then the one
        with the smallest |gap| is returned. This search is thorough, not certified.

    Returns
    -------
    ContactPair
        With a status that says whether the pair is extremal and isolated.

    Raises
    ------
    InputError
        Wrong shapes, NaN, zero quaternions, a start outside the patch.

    Notes
    -----
    (g - f).f_u = (g - f).f_v = n_f.g_u = n_f.g_v = 0: paper 001, section 3.2, in the form that is regular at contact.
    """
    f, g = as_face("surface_f", surface_f), as_face("surface_g", surface_g)
    q = _configuration(q_f, q_g)
    table, pool, size = _packed(_key(f), _key(g))
    if start is None:
        x: tuple[float, ...] = (np.nan, np.nan, np.nan, np.nan)
    else:
        x = inside("start", vector("start", start, 4), (f.surface, g.surface))
    out = np.empty(PLACED)
    status = find_pair(table, pool, _SURFACES, q, x, size, out)
    return _contact_pair(out, STATUSES[status])


def descend(
    surface_f: Side, q_f: PoseLike, surface_g: Side, q_g: PoseLike, start: ArrayLike, steps: int = 200
) -> ContactPair:
    """The nearest pair of two patches that a descent from any start leads to: points that never move apart.

    Newton's method alone may go to any extremum, or nowhere; this follows the distance down, and Newton's method
    finishes at the minimum.

    Parameters
    ----------
    surface_f, surface_g : NurbsSurface, Face or BodyFace
        The whole patches; trims are not seen.
    q_f, q_g : Pose or (7,)
        Their bodies' poses.
    start : (4,)
        Parameters u_f, v_f, u_g, v_g.
    steps : int
        The most steps.

    Returns
    -------
    ContactPair
        LEFT_PATCH: nearest at an end of a patch. NOT_CONVERGED also where the patches cross, and the points met, and no
        pair of a shallow penetration is beside them. Where they touch or overlap a little, that pair.

    Raises
    ------
    InputError, TypeError
        Naming the argument.
    """
    f, g = as_face("surface_f", surface_f), as_face("surface_g", surface_g)
    steps = integer("steps", steps, 1, 1_000_000)
    q = _configuration(q_f, q_g)
    table, pool, size = _packed(_key(f), _key(g))
    x = inside("start", vector("start", start, 4), (f.surface, g.surface))
    out = np.empty(PLACED)
    status = find_descent(table, pool, _SURFACES, q, x, size, steps, out)
    return _contact_pair(out, PairStatus.NOT_CONVERGED if status == CROSSED else STATUSES[status])


def _contact_pair(out: Array, status: PairStatus) -> ContactPair:
    return ContactPair(*placed_pair(out), status)


def placed_pair(out: Array) -> tuple[Array, Array, Array, float]:
    """Parameters, points (2, 3), normal and gap of a pair that a query wrote."""
    return out[_PARAMETERS:_POINTS], out[_POINTS:_NORMAL].reshape(2, 3), out[_NORMAL:_GAP], float(out[_GAP])


def _derivatives(
    surface_f: Side, q_f: PoseLike, surface_g: Side, q_g: PoseLike, parameters: ArrayLike
) -> tuple[Array, Array, Array]:
    f, g = as_face("surface_f", surface_f), as_face("surface_g", surface_g)
    q = _configuration(q_f, q_g)
    table, pool, size = _packed(_key(f), _key(g))
    x = inside("parameters", real_array("parameters", parameters, (4,)), (f.surface, g.surface))
    first, hessian = np.full((5, 14), np.nan), np.full((12, 12), np.nan)
    features = tuple((FACE, surface) for surface in _SURFACES)
    error, _isolated = feature_derivatives((table, pool), features, q, x, (0.0, 0.0, 0.0), size, first, hessian)
    if np.isfinite(first[4]).all() and not error <= EXTREMAL:
        raise InputError(
            f"parameters are {list(x)}, off an extremal pair by {error:.1e}; expected those of extremal_pair"
        )
    if not np.isfinite(first[4]).all():
        raise InputError(f"parameters are {list(x)}, where a surface has no tangent plane; expected a regular point")
    return first[:4], first[4], hessian


def contact_jacobian(surface_f: Side, q_f: PoseLike, surface_g: Side, q_g: PoseLike, parameters: ArrayLike) -> Array:
    """d(u_f, v_f, u_g, v_g) / d(q_f, q_g), (4, 14), by the contact velocity formulation.

    For any regular parameterization; at an extremum that is not isolated, the damped least-norm rates.

    Source: paper 001, appendix A, eqs. 10 to 21, with corrected signs (docs/derivations.md).

    Raises
    ------
    InputError
        Also where the parameters are not those of an extremal pair, or at a pole.
    """
    jacobian = _derivatives(surface_f, q_f, surface_g, q_g, parameters)[0]
    if not np.isfinite(jacobian).all():
        raise InputError(f"parameters are {np.asarray(parameters).tolist()}, at a pole, where parameters have no rates")
    return jacobian


def gap_gradient(surface_f: Side, q_f: PoseLike, surface_g: Side, q_g: PoseLike, parameters: ArrayLike) -> Array:
    """d gap / d(q_f, q_g), (14,): the contact wrench, in quaternion coordinates.

    In twists it is [-n, -(f - x_f) x n, n, (g - x_g) x n]: no parameter rates enter (envelope theorem).
    """
    return _derivatives(surface_f, q_f, surface_g, q_g, parameters)[1]


def gap_hessian(surface_f: Side, q_f: PoseLike, surface_g: Side, q_g: PoseLike, parameters: ArrayLike) -> Array:
    """Second derivative of the gap, (12, 12), in the twists of f, then g.

    Symmetric; along x + t dx, exp(t dw) e with constant twists the gap's second derivative is twist^T hessian twist.
    """
    return _derivatives(surface_f, q_f, surface_g, q_g, parameters)[2]
