"""Hypotheses on a patch under which a closest-point controller converges, and bounds of its gain.

A patch meets the hypotheses if, for an axis a,

    (1) its normals are within less than 45 degrees of a (so they span less than 90),
    (2) it is convex: it lies on one side of each of its tangent planes,
    (3) its shadow along a is convex: its boundary is not re-entrant.

Then |P - Q| has no stationary point on the patch, edges and corners included, but the closest one P*, for every Q
outside with P* in the interior. For let P be another one, c = P* - P, and cut the patch with the plane of a and c: by
(3) the cut is one arc, concave by (2), with tangents w at P and w* at P*. By (1) w and w* differ by less than 90
degrees, and c lies between them, so w.c > 0. Q = P* + E N, and w.N >= 0, for the arc is concave. So (Q - P).w > 0:
P comes closer to Q along the arc and is not stationary. `docs/controllers.md` has patches for which (1) or (3) fails.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, integer, positive, real_array, vector
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.controllers.control import Form, Side, form_number, surface_of
from assembly.proximity.controllers.runs import NEWTON, NEWTON_SATURATED, SWITCHING, attraction

__all__ = [
    "GainBounds",
    "Hypotheses",
    "convergence_hypotheses",
    "final_parameters",
    "gain_bounds",
    "gain_limit",
    "is_globally_convergent",
]

Array = NDArray[np.float64]
Method = Literal["newton", "newton_saturated", "controller"]
_METHODS = {"newton": NEWTON, "newton_saturated": NEWTON_SATURATED, "controller": SWITCHING}
_LIMITS = {NEWTON: 200, NEWTON_SATURATED: 200, SWITCHING: 1_000_000}
# How far a sample may be beyond a tangent plane, in sizes, and an outline turn outward, in radians: rounding.
_FLAT = 1e-10
_STRAIGHT = 1e-9


@dataclass(frozen=True)
class Hypotheses:
    """How far a patch meets the hypotheses of global convergence, at samples.

    Attributes
    ----------
    half_angle : float
        Of the cone around all normals, in radians; pi where the surface has a point without a normal.
    span : float
        The largest angle between two normals, in radians.
    excess : float
        How far the patch reaches beyond a tangent plane, as a part of its size: 0 if it is convex.
    reentrance : float
        The largest turn of the outline, seen along the cone's axis, in the wrong direction, in radians: 0 if convex.
    """

    half_angle: float
    span: float
    excess: float
    reentrance: float

    @property
    def hold(self) -> bool:
        """Whether all of them do."""
        return self.half_angle < 0.25 * np.pi and self.excess <= _FLAT and self.reentrance <= _STRAIGHT


@dataclass(frozen=True)
class GainBounds:
    """The least gains that outrun a motion: in the interior, and along u and v at the ends of the patch."""

    interior: float
    along_u: float
    along_v: float


def _cone(normals: Array) -> tuple[Array, float]:
    """Axis and half angle of the least cone around unit vectors, by steps toward the farthest one."""
    axis = normals.mean(axis=0)
    axis /= np.linalg.norm(axis) or 1.0
    best, angle = axis, np.pi
    for k in range(1, 400):
        cosines = normals @ axis
        far = int(cosines.argmin())
        found = float(np.arccos(np.clip(cosines[far], -1.0, 1.0)))
        if found < angle:
            best, angle = axis, found
        axis = axis + (normals[far] - axis) / (k + 1.0)
        axis = axis / np.linalg.norm(axis)
    return best, angle


def _outline(surface: NurbsSurface, u: Array, v: Array, axis: Array) -> float:
    """The largest turn to the right of the boundary, run through counterclockwise, seen against the axis."""
    one, two = np.ones_like(u), np.ones_like(v)
    parts = ((u, v[0] * one), (u[-1] * two, v), (u[::-1], v[-1] * one), (u[0] * two, v[::-1]))
    loop = np.concatenate([surface.evaluate(a[:-1], b[:-1]) for a, b in parts])
    steps = np.roll(loop, -1, axis=0) - loop
    x = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    x /= np.linalg.norm(x)
    flat = steps @ np.stack([x, np.cross(axis, x)], axis=1)
    following = np.roll(flat, -1, axis=0)
    turns = np.arctan2(
        flat[:, 0] * following[:, 1] - flat[:, 1] * following[:, 0], np.einsum("ij,ij->i", flat, following)
    )
    turns *= np.sign(turns.sum())
    return max(float(-turns.min()), 0.0) + 0.0


def convergence_hypotheses(surface: Side, samples: int = 25) -> Hypotheses:
    """The hypotheses under which the controller finds the closest point from every start, checked at samples.

    Parameters
    ----------
    surface : NurbsSurface, Face or BodyFace
        The whole patch; trims are not seen.
    samples : int
        A direction and span of the surface; 3 to 200.

    Raises
    ------
    InputError, TypeError
        Naming the argument.
    """
    patch = surface_of("surface", surface)
    samples = integer("samples", samples, 3, 200)
    u, v = (
        np.unique(np.concatenate([np.linspace(a, b, samples) for a, b in zip(at[:-1], at[1:], strict=True)]))
        for at in patch.breaks()
    )
    points, su, sv = (part.reshape(-1, 3) for part in patch.evaluate(u[:, None], v[None, :], 1))
    normals = np.cross(su, sv)
    length = np.linalg.norm(normals, axis=1)
    if not length.min() > 1e-9 * np.linalg.norm(su, axis=1).max() * np.linalg.norm(sv, axis=1).max():
        return Hypotheses(np.pi, np.pi, np.inf, np.pi)
    normals /= length[:, None]
    axis, half_angle = _cone(normals)
    above = below = span = 0.0
    for k in range(0, len(points), 256):
        heights = points @ normals[k : k + 256].T - np.einsum("ij,ij->i", points[k : k + 256], normals[k : k + 256])
        above, below = max(above, float(heights.max())), max(below, float(-heights.min()))
        span = max(span, float(np.arccos(np.clip((normals @ normals[k : k + 256].T).min(), -1.0, 1.0))))
    return Hypotheses(half_angle, span, min(above, below) / patch.size, _outline(patch, u, v, axis))


def is_globally_convergent(surface: Side, samples: int = 25) -> bool:
    """Whether the controller finds the closest point of a patch from every start, for every point outside near it.

    The hypotheses of `convergence_hypotheses`, at samples. They suffice; other patches may do as well.
    """
    return convergence_hypotheses(surface, samples).hold


def _projections(surface: Side, parameters: ArrayLike, point: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """D = P - Q, psi (2,), the first fundamental form and the second derivative of |D|^2 / 2, (2, 2) each."""
    u, v = vector("parameters", parameters, 2)
    p, su, sv, suu, suv, svv = surface_of("surface", surface).evaluate(u, v, 2)
    d = p - vector("point", point)
    tangents = np.stack([su, sv])
    first = tangents @ tangents.T
    return d, tangents @ d, first, first + np.array([[d @ suu, d @ suv], [d @ suv, d @ svv]])


def gain_bounds(surface: Side, parameters: ArrayLike, point: ArrayLike, closest: ArrayLike, speed: float) -> GainBounds:
    """The least gains with which |P - Q| - E falls while the point moves: theorem 1 of paper 000, corrected.

    B zeta |D| / (alpha |Psi|^2) in the interior, B zeta |D| / (E Psi_u^2) and B zeta |D| / (G Psi_v^2) along edges, for
    the contravariant form; alpha is the smallest eigenvalue of the first fundamental form, and zeta the length of the
    difference of D / |D| and its limit. They grow without bound towards the closest point: under motion a constant
    gain follows with a lag of the order of 1 / K.

    Parameters
    ----------
    surface : NurbsSurface, Face or BodyFace
    parameters : (2,)
        Of the witness point P.
    point : (3,)
        Q, in the axes of the surface's body.
    closest : (2,)
        Parameters of the closest point.
    speed : float
        B: a bound of the velocity of Q, seen from the surface.
    """
    speed = positive("speed", speed)
    d, psi, first, _second = _projections(surface, parameters, point)
    limit = _projections(surface, closest, point)[0]
    distance, nearest = float(np.linalg.norm(d)), float(np.linalg.norm(limit))
    if not nearest > 0.0:
        raise InputError(
            f"closest is {np.asarray(closest).tolist()}, where the point lies on the surface; expected a gap"
        )
    demand = speed * float(np.linalg.norm(d / distance - limit / nearest)) * distance
    both = np.linalg.solve(first, psi)
    alpha = float(np.linalg.eigvalsh(first)[0])
    supply = (alpha * float(both @ both), float(psi[0] ** 2 / first[0, 0]), float(psi[1] ** 2 / first[1, 1]))
    return GainBounds(*(demand / s if s > 0.0 else np.inf for s in supply))


def gain_limit(surface: Side, parameters: ArrayLike, point: ArrayLike, dt: float, form: Form = "unit") -> float:
    """The gain above which Euler steps of dt do not settle: 2 / (dt lambda).

    lambda is the largest eigenvalue of D^-1 H, H or I^-1 H (unit, covariant, contravariant form), H the second
    derivative of |P - Q|^2 / 2, I the first fundamental form, D = diag(|f_u|, |f_v|).

    Parameters
    ----------
    surface, parameters, point
        As in `gain_bounds`.
    dt : float
        Seconds.
    form : "unit", "covariant" or "contravariant"
    """
    dt = positive("dt", dt)
    kind = form_number(form)
    _d, _psi, first, second = _projections(surface, parameters, point)
    weights = (np.diag(1.0 / np.sqrt(np.diag(first))), np.eye(2), np.linalg.inv(first))[kind]
    return 2.0 / (dt * float(np.abs(np.linalg.eigvals(weights @ second)).max()))


def final_parameters(
    surface: Side, point: ArrayLike, starts: ArrayLike, method: Method = "controller", form: Form = "unit"
) -> tuple[Array, NDArray[np.bool_]]:
    """Where witness points end from many starts, (n, 2), and whether each came to rest: for regions of attraction.

    Parameters
    ----------
    surface : NurbsSurface, Face or BodyFace
    point : (3,)
        In the axes of the surface's body.
    starts : (n, 2)
    method : "newton", "newton_saturated" or "controller"
        Newton's method on psi = 0, where it leaves the patch a failure; the same with saturation; the controller with
        the gain that its eigenvalues allow.
    form : "unit", "covariant" or "contravariant"
        Newton's method has no contravariant form of its own: it is the covariant one.
    """
    patch = surface_of("surface", surface)
    if method not in _METHODS:
        raise InputError(f"method is {method!r}; expected one of {', '.join(_METHODS)}")
    begin = real_array("starts", starts, ("n", 2))
    table, pool = patch.packed()
    place = tuple(vector("point", point).tolist())
    out = np.empty((len(begin), 3))
    number = _METHODS[method]
    tolerance = 1e-10 * patch.size
    attraction((table, pool), place, begin, number, form_number(form), _LIMITS[number], tolerance, out)
    return out[:, :2], out[:, 2] <= tolerance
