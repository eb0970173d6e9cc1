"""Extremal pairs of a surface and a curve and how they move, from Python.

The curve C belongs to a second body: a curve in space, or a plane curve c in the parameters of one of that body's
surfaces, C(t) = S_c(c(t)) (an edge, or a trim of a face). With n the outward unit normal of the surface S,

    (C - S).S_u = (C - S).S_v = 0,   n.C_t = 0,   gap = n.(C - S)

(paper 001, eqs. 22 to 24). Configurations and axes are those of `proximity/extrema/pairs.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, vector
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.evaluate import CURVE_BREAKS, CURVE_COEFFICIENTS, OFFSETS, SURFACE_RECORD
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.pose import PoseLike, pose_row
from assembly.proximity.brep.records import EDGE, EDGE_RECORD, FACE
from assembly.proximity.brep.writer import edge_over
from assembly.proximity.extrema.feature_query import PAIR, feature_derivatives, find_features
from assembly.proximity.extrema.pairs import EXTREMAL, STATUSES, PairStatus, Side, as_face, placed_pair

__all__ = ["CurvePair", "curve_contact_jacobian", "curve_gap_gradient", "curve_gap_hessian", "extremal_curve_pair"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Ends of a curve are one point within this part of its size, and its tangents there one direction within this angle.
CLOSED = 1e-9
SMOOTH = 1e-6
# A plane curve is looked at so often in every span, for being inside of its surface's domain.
SAMPLES = 17


@dataclass(frozen=True, eq=False)
class CurvePair(ReadOnlyArrays):
    """An extremal pair of points of a surface and a curve.

    Attributes
    ----------
    parameters : (3,)
        u, v of the surface, t of the curve.
    points : (2, 3)
        The point of the surface and the point of the curve, world coordinates.
    normal : (3,)
        Outward unit normal of the surface at its point.
    gap : float
        normal . (curve - surface): positive outside, negative within.
    status : PairStatus
        LEFT_PATCH where an end of the curve is nearer than its inside: then the pair is that of the end.
    """

    parameters: Array = field(repr=False)
    points: Array
    normal: Array
    gap: float
    status: PairStatus


@dataclass(frozen=True, eq=False)
class _Packed:
    """A surface and a curve as one table and one pool, the larger size, and whether the curve has no ends."""

    table: Table
    pool: Array
    size: float
    endless: bool


_Key = tuple[NurbsSurface, bool, NurbsCurve, NurbsSurface | None]


def _space_points(curve: NurbsCurve, carrier: NurbsSurface | None, t: Array) -> tuple[Array, Array]:
    """Points and tangents in space, (n, 3) each."""
    c, d = curve.evaluate(t, 1)
    if carrier is None:
        return c, d
    try:
        s, su, sv = carrier.evaluate(c[:, 0], c[:, 1], 1)
    except InputError as error:
        raise InputError(f"curve leaves the domain of embedded_in: {error}") from None
    return s, su * d[:, :1] + sv * d[:, 1:]


@lru_cache(maxsize=64)
def _packed(key: _Key) -> _Packed:
    surface, is_reversed, curve, carrier = key
    breaks = curve.breaks()
    at = (breaks[:-1, None] + np.diff(breaks)[:, None] * np.linspace(0.0, 1.0, SAMPLES)).ravel()
    points, tangents = _space_points(curve, carrier, np.clip(at, *curve.domain))
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    first, last = tangents[0], tangents[-1]
    lengths = float(np.linalg.norm(first) * np.linalg.norm(last))
    endless = (
        extent > 0.0
        and bool(np.linalg.norm(points[0] - points[-1]) <= CLOSED * extent)
        and bool(np.linalg.norm(np.cross(first, last)) <= SMOOTH * lengths)
        and bool(first @ last > 0.0)
    )
    table: list[Table] = []
    pool: list[Array] = []
    workspace = 0
    for face in [Face(surface, reversed=is_reversed)] + ([] if carrier is None else [Face(carrier)]):
        record, numbers = face.packed()
        record = record.copy()
        record[list(OFFSETS)] += workspace
        table.append(record)
        pool.append(numbers)
        workspace += numbers.size
    record, numbers = curve.packed()
    record = record.copy()
    record[[CURVE_BREAKS, CURVE_COEFFICIENTS]] += workspace
    edge = edge_over(-1 if carrier is None else SURFACE_RECORD, sum(part.size for part in table), endless)
    size = max(surface.size, curve.size if carrier is None else carrier.size)
    return _Packed(np.concatenate([*table, record, edge]), np.concatenate([*pool, numbers]), size, endless)


@dataclass(frozen=True, eq=False)
class _Query:
    """Checked arguments as the kernels take them."""

    packed: _Packed
    features: tuple[tuple[int, int], tuple[int, int]]
    q: Array
    x: tuple[float, float, float, float]


def _query(
    surface: Side,
    q_s: PoseLike,
    curve: NurbsCurve,
    q_c: PoseLike,
    name: str,
    value: ArrayLike,
    embedded_in: Side | None,
) -> _Query:
    face = as_face("surface", surface)
    if not isinstance(curve, NurbsCurve):
        raise TypeError(f"curve is {curve!r}; expected a NurbsCurve")
    plane = curve.control_points.shape[1] == 2
    if plane and embedded_in is None:
        raise InputError("embedded_in is None; expected the surface in whose parameters the plane curve runs")
    if not plane and embedded_in is not None:
        raise InputError(f"embedded_in is {embedded_in!r}; expected None for a curve in space")
    carrier = None if embedded_in is None else as_face("embedded_in", embedded_in).surface
    q = np.empty((2, 7))
    for k, (label, pose) in enumerate((("q_s", q_s), ("q_c", q_c))):
        q[k] = pose_row(label, pose)
    packed = _packed((face.surface, face.reversed, curve, carrier))
    x = vector(name, value).tolist()
    limits = (*zip(face.surface.domain, face.surface.closed, strict=True), (curve.domain, packed.endless))
    for k, ((low, high), wraps) in enumerate(limits):
        if not low <= x[k] <= high:
            if not wraps:
                raise InputError(f"{name}[{k}] is {x[k]:g}; expected a parameter in [{low:g}, {high:g}]")
            x[k] = low + (x[k] - low) % (high - low)
    edge = packed.table.size - EDGE_RECORD
    return _Query(packed, ((FACE, 0), (EDGE, edge)), q, (x[0], x[1], x[2], 0.0))


def extremal_curve_pair(
    surface: Side,
    q_s: PoseLike,
    curve: NurbsCurve,
    q_c: PoseLike,
    start: ArrayLike,
    embedded_in: Side | None = None,
) -> CurvePair:
    """The extremal pair of a surface and a curve near a start: closest apart, deepest within.

    Parameters
    ----------
    surface : NurbsSurface, Face or BodyFace
        The whole surface; a face's loops are not looked at.
    q_s, q_c : Pose or (7,)
        Poses of the bodies of the surface and of the curve.
    curve : NurbsCurve
        In space (body coordinates), or plane: then (u, v) of `embedded_in`, which may run round its closed directions.
    start : (3,)
        u, v, t near the pair.
    embedded_in : NurbsSurface, Face or BodyFace, optional
        The surface of the curve's body on which a plane curve lies.

    Returns
    -------
    CurvePair
        A curve that leads away from the surface at an end is held there (LEFT_PATCH).

    Raises
    ------
    InputError
        Wrong shapes, NaN, zero quaternions, a start outside the patch or the curve, a plane curve without its surface
        or beyond its domain.
    """
    query = _query(surface, q_s, curve, q_c, "start", start, embedded_in)
    packed, out = query.packed, np.empty(PAIR)
    nothing = (0.0, 0.0, 0.0)
    store = packed.table, packed.pool
    status = find_features(store, query.features, query.q, query.x, nothing, packed.size, np.inf, out)
    parameters, points, normal, gap = placed_pair(out)
    return CurvePair(parameters[:3], points, normal, gap, STATUSES[status])


def _derivatives(
    surface: Side,
    q_s: PoseLike,
    curve: NurbsCurve,
    q_c: PoseLike,
    parameters: ArrayLike,
    embedded_in: Side | None,
) -> tuple[Array, Array, Array]:
    query = _query(surface, q_s, curve, q_c, "parameters", parameters, embedded_in)
    packed = query.packed
    first, hessian = np.full((5, 14), np.nan), np.full((12, 12), np.nan)
    nothing = (0.0, 0.0, 0.0)
    store = packed.table, packed.pool
    error, _isolated = feature_derivatives(
        store, query.features, query.q, query.x, nothing, packed.size, first, hessian
    )
    at = list(query.x[:3])
    if error == np.inf:
        raise InputError(
            f"parameters are {at}, where the surface or the curve has no tangent; expected a regular point"
        )
    if not error <= EXTREMAL:
        raise InputError(
            f"parameters are {at}, off an extremal pair by {error:.1e}; expected those of extremal_curve_pair"
        )
    return first[:3], first[4], hessian


def curve_contact_jacobian(
    surface: Side,
    q_s: PoseLike,
    curve: NurbsCurve,
    q_c: PoseLike,
    parameters: ArrayLike,
    embedded_in: Side | None = None,
) -> Array:
    """d(u, v, t) / d(q_s, q_c), (3, 14), by the contact velocity formulation.

    For any regular parameterization; at an extremum that is not isolated, the damped least-norm rates.

    Source: paper 001, appendix A, eqs. 22 to 24, with corrected signs: with A the shape operator of the surface
    (+1/r on a ball), t the curve's unit tangent, e across it, k = -n.C_tt / |C_t|^2, and (z1, z2) the relative
    velocities of `proximity/extrema/rates.py`, the tangent velocity a over the surface solves

        e.(I + gap A) a = e.z1,   t.(k (I + gap A) - A) a = k t.z1 - t.z2.

    Raises
    ------
    InputError
        Also where the parameters are not those of an extremal pair, or at a pole.
    """
    jacobian = _derivatives(surface, q_s, curve, q_c, parameters, embedded_in)[0]
    if not np.isfinite(jacobian).all():
        raise InputError(f"parameters are {np.asarray(parameters).tolist()}, at a pole, where parameters have no rates")
    return jacobian


def curve_gap_gradient(
    surface: Side,
    q_s: PoseLike,
    curve: NurbsCurve,
    q_c: PoseLike,
    parameters: ArrayLike,
    embedded_in: Side | None = None,
) -> Array:
    """d gap / d(q_s, q_c), (14,): the contact wrench, in quaternion coordinates, as `gap_gradient`."""
    return _derivatives(surface, q_s, curve, q_c, parameters, embedded_in)[1]


def curve_gap_hessian(
    surface: Side,
    q_s: PoseLike,
    curve: NurbsCurve,
    q_c: PoseLike,
    parameters: ArrayLike,
    embedded_in: Side | None = None,
) -> Array:
    """Second derivative of the gap, (12, 12), in the twists of the surface's body, then the curve's; symmetric.

    See `gap_hessian`.
    """
    return _derivatives(surface, q_s, curve, q_c, parameters, embedded_in)[2]
