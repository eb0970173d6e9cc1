"""Surfaces as OCCT has them: planes, cylinders, cones, spheres, tori, extrusions and revolutions as such.

OCCT's parameters of these surfaces are lengths and angles. If each of them is a function of one of our parameters, the
two functions are found along two lines of the surface and checked on a grid of points. Otherwise the surface is written
as a B-spline, which has our parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, tan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.forms import Cone, Cylinder, Extrusion, Plane, Revolution, Sphere, Torus
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.occt import occt

__all__ = ["Carrier", "carrier_of", "knots_of", "points_of", "reals_of", "spline_curve"]

Array = NDArray[np.float64]
# Places along a line of the surface at which its angle is followed.
_PLACES = 65
# How far OCCT's surface may be from ours, as a part of the size.
_EXACT = 1e-11


@dataclass(frozen=True, eq=False)
class Carrier:
    """A surface of OCCT, and the map from our (u, v) to its parameters.

    Attributes
    ----------
    geometry
        Geom_Surface.
    maps : two functions
        From our u, and from our v, to one of its parameters.
    swapped : bool
        Whether OCCT's first parameter is a function of our v, and not of our u.
    turned : bool
        Whether OCCT's normal is opposite to ours.
    plane : (3, 3) or None
        Origin, x and y of a plane, whose parameters are lengths along these; it has no maps.
    is_own : bool
        Whether OCCT's parameters are ours.
    """

    geometry: Any
    maps: tuple[Callable[[Array], Array], Callable[[Array], Array]] | None
    swapped: bool
    turned: bool
    plane: Array | None = None
    is_own: bool = False

    def at(self, uv: Array) -> Array:
        """OCCT's parameters (n, 2) of ours."""
        assert self.maps is not None
        mapped = np.column_stack([self.maps[0](uv[:, 0]), self.maps[1](uv[:, 1])])
        return mapped[:, ::-1] if self.swapped else mapped


def points_of(rows: Array) -> Any:
    """An array of points in space or in the plane."""
    o = occt()
    kind, single = (o.Points, o.gp_Pnt) if rows.shape[1] == 3 else (o.Points2d, o.gp_Pnt2d)
    array = kind(1, len(rows))
    for k, row in enumerate(rows.tolist(), 1):
        array.SetValue(k, single(*row))
    return array


def reals_of(row: Array) -> Any:
    """An array of numbers."""
    array = occt().Reals(1, len(row))
    for k, value in enumerate(row.tolist(), 1):
        array.SetValue(k, value)
    return array


def knots_of(row: Array) -> tuple[Any, Any]:
    """Distinct knots and how often they count."""
    distinct, times = np.unique(row, return_counts=True)
    counts = occt().Integers(1, distinct.size)
    for k, count in enumerate(times.tolist(), 1):
        counts.SetValue(k, count)
    return reals_of(distinct), counts


def spline_curve(points: Array, weights: Array, knots: Array, degree: int) -> Any:
    """A B-spline curve of OCCT, in space or in the plane."""
    o = occt()
    kind = o.Geom_BSplineCurve if points.shape[1] == 3 else o.Geom2d_BSplineCurve
    if np.ptp(weights) == 0.0:
        return kind(points_of(points), *knots_of(knots), degree)
    return kind(points_of(points), reals_of(weights), *knots_of(knots), degree)


def _clamped(surface: NurbsSurface) -> NurbsSurface:
    return surface if surface._is_clamped else surface.elevate(surface.degree)


def _same(x: Array) -> Array:
    return x


def bspline(surface: NurbsSurface) -> Carrier:
    """The surface with its own parameters."""
    o = occt()
    surface = _clamped(surface)
    net = surface.control_points
    n, m, _ = net.shape
    poles, weights = o.PointNet(1, n, 1, m), o.RealNet(1, n, 1, m)
    for i in range(n):
        for j in range(m):
            poles.SetValue(i + 1, j + 1, o.gp_Pnt(*net[i, j].tolist()))
            weights.SetValue(i + 1, j + 1, float(surface.weights[i, j]))
    (ku, cu), (kv, cv) = knots_of(surface.knots[0]), knots_of(surface.knots[1])
    made = o.Geom_BSplineSurface(poles, weights, ku, kv, cu, cv, *surface.degree)
    return Carrier(made, (_same, _same), False, False, is_own=True)


def carrier_of(surface: NurbsSurface) -> Carrier:
    """OCCT's surface for one of ours."""
    form = elementary_form(surface)
    found: Carrier | None = None
    if isinstance(form, Plane):
        return _plane(surface, form)
    if isinstance(form, (Cylinder, Cone, Sphere, Torus)):
        found = _round(surface, form)
    elif isinstance(form, Extrusion):
        found = _extrusion(surface, form)
    elif isinstance(form, Revolution):
        found = _revolution(surface, form)
    return found or bspline(surface)


def _axes(origin: Array, z: Array, x: Array) -> Any:
    o = occt()
    return o.gp_Ax3(o.gp_Pnt(*origin.tolist()), o.gp_Dir(*z.tolist()), o.gp_Dir(*x.tolist()))


def _plane(surface: NurbsSurface, form: Plane) -> Carrier:
    net = surface.control_points
    x = net[-1, 0] - net[0, 0]
    x = x - (x @ form.normal) * form.normal
    if not x @ x > 0.0:
        x = net[0, -1] - net[0, 0]
        x = x - (x @ form.normal) * form.normal
    x /= np.linalg.norm(x)
    origin = net[0, 0] - ((net[0, 0] - form.point) @ form.normal) * form.normal
    geometry = occt().Geom_Plane(_axes(origin, form.normal, x))
    return Carrier(geometry, None, False, False, np.array([origin, x, np.cross(form.normal, x)]))


class _Lines:
    """The two lines of a surface along which its parameters are compared with OCCT's."""

    def __init__(self, surface: NurbsSurface) -> None:
        self.surface = surface
        self.ends = np.array(surface.domain)
        # Off the middle, which may be a place of symmetry.
        self.middle = self.ends @ [0.47, 0.53]

    def along(self, axis: int, x: Array) -> Array:
        """Points along u (axis 0) or v (1), the other parameter in the middle."""
        at = np.empty((len(x), 2))
        at[:, axis], at[:, 1 - axis] = np.clip(x, *self.ends[axis]), self.middle[1 - axis]
        points: Array = self.surface.evaluate(at[:, 0], at[:, 1])
        return points

    def sampled(self, axis: int) -> tuple[Array, Array]:
        """Places along a parameter, and their points."""
        low, high = self.ends[axis].tolist()
        x = np.linspace(low, high, _PLACES)
        return x, self.along(axis, x)


def _angle(lines: _Lines, axis: int, angle: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """The angle of points along a parameter, continuous from its low end."""
    x, points = lines.sampled(axis)
    table = np.unwrap(angle(points))

    def followed(at: Array) -> Array:
        near = np.interp(at, x, table)
        found = angle(lines.along(axis, at))
        return np.asarray(found + 2.0 * pi * np.round((near - found) / (2.0 * pi)))

    return followed


def _proven(
    surface: NurbsSurface, geometry: Any, maps: tuple[Callable[[Array], Array], Callable[[Array], Array]], around: int
) -> Carrier | None:
    """A carrier whose points are ours on a grid; which way its normal goes is found there."""
    ends = np.array(surface.domain)
    (u0, u1), (v0, v1) = ends.tolist()
    u, v = np.repeat(np.linspace(u0, u1, 9), 9), np.tile(np.linspace(v0, v1, 9), 9)
    first = Carrier(geometry, maps, around == 1, False)
    there = first.at(np.column_stack([u, v]))
    points = surface.evaluate(u, v)
    off = [np.abs(_coordinates(geometry.Value(*at)) - p).max() for at, p in zip(there.tolist(), points, strict=True)]
    if not max(off) <= _EXACT * (surface.size + float(np.abs(points).max())):
        return None
    steps = [float(np.diff(one(x))[0]) for one, x in zip(maps, ends + [[0.0, 0.0]], strict=True)]
    turned = (steps[0] * steps[1] < 0.0) != (around == 1)
    return Carrier(geometry, maps, around == 1, turned)


def _coordinates(p: Any) -> Array:
    return np.array([p.X(), p.Y(), p.Z()])


def _around(surface: NurbsSurface, origin: Array, axis: Array) -> int | None:
    """Which parameter runs around an axis: along the other one the angle is the same."""
    lines = _Lines(surface)
    for k in (0, 1):
        _, points = lines.sampled(1 - k)
        out = points - origin - ((points - origin) @ axis)[:, None] * axis
        far = np.linalg.norm(out, axis=1)
        longest = int(np.argmax(far))
        beside = np.linalg.norm(np.cross(out, out[longest] / far[longest]), axis=1)
        if beside.max() <= 1e-9 * surface.size and (out @ out[longest] > -1e-9 * surface.size * far[longest]).all():
            return k
    return None


def _sphere_axis(surface: NurbsSurface, center: Array) -> Array | None:
    """The axis about which a sphere's parameters turn: that of the circles of one of them."""
    lines = _Lines(surface)
    for k in (0, 1):
        _, points = lines.sampled(k)
        rows = points - points.mean(axis=0)
        axis: Array = np.linalg.svd(rows)[2][2]
        if np.abs(rows @ axis).max() <= 1e-10 * surface.size and _around(surface, center, axis) == k:
            return axis
    return None


def _round(surface: NurbsSurface, form: Cylinder | Cone | Sphere | Torus) -> Carrier | None:
    o = occt()
    origin = form.point if isinstance(form, Cylinder) else form.apex if isinstance(form, Cone) else form.center
    axis = _sphere_axis(surface, form.center) if isinstance(form, Sphere) else form.axis
    around = None if axis is None else _around(surface, origin, axis)
    if axis is None or around is None:
        return None
    lines = _Lines(surface)
    _, ring = lines.sampled(around)
    x = ring[0] - origin
    x = x - (x @ axis) * axis
    x /= np.linalg.norm(x)
    if np.cross(x, ring[1] - ring[0]) @ axis < 0.0:
        # Angles that grow with ours begin with zero.
        axis = -axis
    y = np.cross(axis, x)

    def heading(points: Array) -> Array:
        return np.asarray(np.arctan2((points - origin) @ y, (points - origin) @ x))

    turn = _angle(lines, around, heading)
    other = 1 - around
    if isinstance(form, Cylinder):
        geometry = o.Geom_CylindricalSurface(_axes(origin, axis, x), form.radius)

        def rise(at: Array) -> Array:
            return np.asarray((lines.along(other, at) - origin) @ axis)

    elif isinstance(form, Cone):
        # OCCT's axis begins at a circle with a radius: at the wide end, where the cone opens along it.
        wide = form.heights[1]
        sign = 1.0 if axis @ form.axis > 0.0 else -1.0
        base = form.apex + wide * form.axis
        geometry = o.Geom_ConicalSurface(_axes(base, axis, x), sign * form.half_angle, wide * tan(form.half_angle))
        slant = cos(form.half_angle)

        def rise(at: Array) -> Array:
            return np.asarray((lines.along(other, at) - base) @ axis / slant)

    else:
        major = form.major if isinstance(form, Torus) else 0.0
        if isinstance(form, Torus):
            geometry = o.Geom_ToroidalSurface(_axes(origin, axis, x), form.major, form.minor)
        else:
            geometry = o.Geom_SphericalSurface(_axes(origin, axis, x), form.radius)

        def latitude(points: Array) -> Array:
            up = (points - origin) @ axis
            out = np.linalg.norm(points - origin - up[:, None] * axis, axis=1)
            return np.asarray(np.arctan2(up, out - major))

        followed = _angle(lines, other, latitude)

        def rise(at: Array) -> Array:
            return followed(at)

    maps = (turn, rise) if around == 0 else (rise, turn)
    return _proven(surface, geometry, maps, around)


def _edge_curve(surface: NurbsSurface, across: int) -> Any:
    """The edge of a surface at the low end of a parameter, as a curve of OCCT."""
    surface = _clamped(surface)
    net, weights = (np.moveaxis(row, across, 0)[0] for row in (surface.control_points, surface.weights))
    return spline_curve(net, weights, surface.knots[1 - across], surface.degree[1 - across])


def _extrusion(surface: NurbsSurface, form: Extrusion) -> Carrier | None:
    o = occt()
    along = form.along
    lines = _Lines(surface)
    if _winds(lines.sampled(1 - along)[1], form.direction):
        return None
    start = lines.along(along, np.array([lines.ends[along, 0]]))[0]
    geometry = o.Geom_SurfaceOfLinearExtrusion(_edge_curve(surface, along), o.gp_Dir(*form.direction.tolist()))

    def rise(at: Array) -> Array:
        return np.asarray((lines.along(along, at) - start) @ form.direction)

    # OCCT's first parameter is that of the curve.
    return _proven(surface, geometry, (_same, rise) if along == 1 else (rise, _same), 1 - along)


def _winds(points: Array, direction: Array) -> bool:
    """Whether a curve goes round more than once, seen along a direction.

    What is extruded of it may lie over itself, as a helix's band does, and OCCT would take one turn for another.
    """
    steps = np.diff(points, axis=0)
    across = np.linalg.svd(direction[None])[2][1:]
    x, y = (steps @ across.T).T
    turns = np.unwrap(np.arctan2(y, x))
    return bool(np.ptp(turns) > 2.0 * pi * (1.0 + 2.0 / _PLACES))


def _revolution(surface: NurbsSurface, form: Revolution) -> Carrier | None:
    o = occt()
    around = form.around
    lines = _Lines(surface)
    _, ring = lines.sampled(around)
    axis = form.axis
    x = ring[0] - form.point
    x = x - (x @ axis) * axis
    if not np.linalg.norm(x) > 1e-9 * surface.size:
        return None
    if np.cross(x, ring[1] - ring[0]) @ axis < 0.0:
        axis = -axis
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)
    line = o.gp_Ax1(o.gp_Pnt(*form.point.tolist()), o.gp_Dir(*axis.tolist()))
    geometry = o.Geom_SurfaceOfRevolution(_edge_curve(surface, around), line)
    turn = _angle(lines, around, lambda points: np.arctan2((points - form.point) @ y, (points - form.point) @ x))
    return _proven(surface, geometry, (turn, _same) if around == 0 else (_same, turn), around)
