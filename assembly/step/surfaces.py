"""Surfaces of OCCT as NURBS surfaces, exact wherever a rational form exists.

Planes, cylinders, cones, spheres, tori and swept surfaces become finite patches a little larger than the face; Bezier
and B-spline surfaces are kept as they are. Only offset surfaces, and what is swept from curves without rational form,
are approximated.
"""

from __future__ import annotations

from functools import cached_property
from math import cos, pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines import bezier
from assembly.geometry.splines.known_surface import known_surface
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.occt import occt
from assembly.step.profiles import (
    SLACK,
    Direction,
    Spline,
    Straight,
    Turning,
    Unreadable,
    arc,
    knot_row,
    point,
    profile,
)
from assembly.step.turned_nets import fill_turned

__all__ = ["Patch", "patch"]

Array = NDArray[np.float64]
Box = tuple[float, float, float, float]
# Distances [mm] below which OCCT takes two points for one.
CONFUSION = 1e-7
# A parameter that is a length.
LENGTH = Straight(True)


class Patch:
    """A surface, the maps from OCCT's (u, v) to its own, and how far it is from what the file says [mm].

    Attributes
    ----------
    lengths : (float, float)
        Lengths of the domain in u and in v.
    is_straight : bool
        Whether OCCT's parameters are ours.
    """

    def __init__(self, surface: NurbsSurface, u: Direction, v: Direction, deviation: float = 0.0) -> None:
        self.surface, self.u, self.v, self.deviation = surface, u, v, deviation
        (a, b), (c, d) = surface.domain
        self.lengths = b - a, d - c
        self.is_straight = isinstance(u, Straight) and isinstance(v, Straight)

    @cached_property
    def sides(self) -> Array:
        """Lengths of the domain in u and in v."""
        return np.array(self.lengths)

    @cached_property
    def scales(self) -> Array:
        """Our lengths in one of OCCT's, in u and in v."""
        return np.array([along.radius if isinstance(along, Turning) else 1.0 for along in (self.u, self.v)])

    @cached_property
    def periods(self) -> tuple[float, float]:
        """Periods in u and v; 0 where the surface is not closed."""
        (u, v), (closed_u, closed_v) = self.lengths, self.surface.closed
        return (u if closed_u else 0.0), (v if closed_v else 0.0)

    @cached_property
    def period(self) -> Array:
        """Periods in u and v; infinite where the surface is not closed."""
        return np.where(self.surface.closed, self.sides, np.inf)

    def counts(self, places: Array) -> Array:
        """By what share of itself a difference in our u, and in our v, counts at places (n, 2): by one but at poles.

        Around a pole it counts as what it is in space, over the size of the surface.
        """
        surface, bits = self.surface, self.surface._pole_bits
        u, v = (
            row if closed else np.clip(row, *ends)
            for row, closed, ends in zip(places.T, surface.closed, surface.domain, strict=True)
        )
        made = np.ones((len(places), 2))
        for axis, row in enumerate(surface.evaluate(u, v, 1)[1:]):
            if bits & (12, 3)[axis]:
                made[:, axis] = np.minimum(1.0, np.linalg.norm(row, axis=1) * self.lengths[axis] / surface.size)
        return made


def _slack(low: float, high: float, least: float = -np.inf, most: float = np.inf) -> tuple[float, float]:
    """An interval made a little larger, within bounds; an end within the slack of its bound goes there."""
    slack = SLACK * (high - low)
    return max(least, low - slack), min(most, high + slack)


def _surface(net: Array, knots: tuple[Array, Array], degree: tuple[int, int]) -> NurbsSurface:
    return NurbsSurface(net[..., :3] / net[..., 3:], knots, degree, net[..., 3])


def _turned(shape: Spline, turning: Turning, v: Direction, origin: Array, axis: Array, deviation: float) -> Patch:
    """A profile turned about an axis; ends of it that lie on the axis are poles."""
    ring = arc(turning)
    net, weights = np.empty((len(ring.points), len(shape.points), 3)), np.empty((len(ring.points), len(shape.points)))
    fill_turned(np.ascontiguousarray(shape.points), ring.points, origin, axis, CONFUSION, net, weights)
    knots, degree = (ring.knots, shape.knots), (2, shape.degree)
    made = (
        known_surface(net, knots, degree, weights) if shape.degree <= 2 else NurbsSurface(net, knots, degree, weights)
    )
    return Patch(made, turning, v, deviation)


def _plane(surface: Any, box: Box) -> Patch:
    place = surface.Position()
    u, v = _slack(*box[:2]), _slack(*box[2:])
    axes = [p.Coord() for p in (place.Location(), place.XDirection(), place.YDirection())]
    # Four corners: plain floats cost a tenth of arrays.
    columns = list(zip(*axes, strict=True))
    net = np.array([[[o + a * x + b * y for o, x, y in columns] for b in v] for a in u])
    return Patch(known_surface(net, (_doubled(u), _doubled(v)), (1, 1)), LENGTH, LENGTH)


def _doubled(ends: tuple[float, float]) -> Array:
    """The knots of a line."""
    low, high = ends
    return np.array([low, low, high, high])


def _round(surface: Any, box: Box) -> Patch:
    """Cylinder, cone, sphere or torus: a line or an arc in the plane of the axes x and z, turned about z."""
    o = occt()
    place = surface.Position()
    origin, x, axis = point(place.Location()), point(place.XDirection()), point(place.Direction())
    up = axis
    # A left-handed placement turns the other way round.
    if not place.Direct():
        axis = -axis
    low, high = box[2:]
    v: Direction = LENGTH
    if isinstance(surface, o.Geom_CylindricalSurface):
        radius = surface.Radius()
        ends = _slack(low, high)
        shape = _ruling(origin, x, up, (radius, radius), ends, ends)
    elif isinstance(surface, o.Geom_ConicalSurface):
        angle, base = surface.SemiAngle(), surface.RefRadius()
        apex = -base / sin(angle)
        near = CONFUSION / abs(sin(angle))
        if low < apex - near and high > apex + near:
            raise Unreadable("a cone goes through its apex")
        # The side on which most of the face lies.
        least, most = (apex, np.inf) if high - apex > apex - low else (-np.inf, apex)
        ends = _slack(low, high, least, most)
        first, last = (0.0 if end == apex else base + end * sin(angle) for end in ends)
        radius = max(abs(first), abs(last))
        shape = _ruling(origin, x, up, (first, last), (ends[0] * cos(angle), ends[1] * cos(angle)), ends)
    else:
        if isinstance(surface, o.Geom_SphericalSurface):
            center, minor = origin, surface.Radius()
            radius = minor
            v = Turning.between(*_slack(low, high, -0.5 * pi, 0.5 * pi), minor)
        else:
            minor, radius = surface.MinorRadius(), surface.MajorRadius()
            center = origin + radius * x
            v = Turning.over(low, high, minor)
        flat = arc(v)
        ring = flat.points
        space = minor * (ring[:, :1] * x + ring[:, 1:2] * up) + ring[:, 2:] * center
        shape = Spline(np.column_stack([space, ring[:, 2]]), flat.knots, 2)
    return _turned(shape, Turning.over(box[0], box[1], radius), v, origin, axis, 0.0)


def _ruling(
    origin: Array,
    x: Array,
    up: Array,
    radii: tuple[float, float],
    heights: tuple[float, float],
    ends: tuple[float, float],
) -> Spline:
    """The line between two points in a plane of an axis, with its parameters there."""
    rows = list(zip(origin.tolist(), x.tolist(), up.tolist(), strict=True))
    net = [[o + r * out + h * along for o, out, along in rows] + [1.0] for r, h in zip(radii, heights, strict=True)]
    return Spline(np.array(net), _doubled(ends), 1)


def _extruded(surface: Any, box: Box) -> Patch:
    shape, u, deviation = profile(surface.BasisCurve(), box[0], box[1], cut=False)
    v = np.array(_slack(*box[2:]))
    along = point(surface.Direction())
    net = np.repeat(shape.points[:, None], 2, axis=1)
    net[..., :3] += shape.points[:, None, 3:] * v[None, :, None] * along
    return Patch(_surface(net, (shape.knots, np.repeat(v, 2)), (shape.degree, 1)), u, LENGTH, deviation)


def _axis_crossings(surface: Any, low: float, high: float) -> tuple[float, float]:
    """A profile's range, kept from crossing the axis where only the slack would."""
    o = occt()
    curve = surface.BasisCurve()
    while isinstance(curve, o.Geom_TrimmedCurve):
        curve = curve.BasisCurve()
    if not isinstance(curve, o.Geom_Line):
        return low, high
    ends = np.array(_slack(low, high))
    origin, axis = point(surface.Location()), point(surface.Direction())
    start, along = point(curve.Position().Location()) - origin, point(curve.Position().Direction())
    start, along = start - (start @ axis) * axis, along - (along @ axis) * axis
    if along @ along < 1e-24:
        return float(ends[0]), float(ends[1])
    nearest = -(start @ along) / (along @ along)
    if np.linalg.norm(start + nearest * along) < CONFUSION:
        bounds = (nearest, np.inf) if high - nearest > nearest - low else (-np.inf, nearest)
        ends = np.array(_slack(low, high, *bounds))
    return float(ends[0]), float(ends[1])


def _revolution(surface: Any, box: Box) -> Patch:
    o = occt()
    low, high = _axis_crossings(surface, *box[2:])
    curve = surface.BasisCurve()
    basis = curve
    while isinstance(basis, o.Geom_TrimmedCurve):
        basis = basis.BasisCurve()
    line = isinstance(basis, o.Geom_Line)
    # An arc must not turn through the axis: it is cut at the ends of the face, without slack.
    conic = isinstance(basis, (o.Geom_Circle, o.Geom_Ellipse)) and high - low < 2.0 * pi - 1e-6
    shape, v, deviation = profile(curve, low, high, cut=line or conic)
    origin, axis = point(surface.Location()), point(surface.Direction())
    points, _ = shape.cartesian
    reach = float(np.linalg.norm(np.cross(points - origin, axis), axis=1).max())
    return _turned(shape, Turning.over(box[0], box[1], max(reach, CONFUSION)), v, origin, axis, deviation)


def _net(surface: Any) -> tuple[Array, tuple[Array, Array], tuple[int, int]]:
    """Homogeneous net, knots and degrees of a B-spline or Bezier surface that is not periodic."""
    degree = (surface.UDegree(), surface.VDegree())
    if max(degree) > bezier.MAX_DEGREE:
        raise Unreadable(f"the surface has degree {degree}, more than {bezier.MAX_DEGREE}")
    n, m = surface.NbUPoles(), surface.NbVPoles()
    rational = surface.IsURational() or surface.IsVRational()
    net = np.ones((n, m, 4))
    # Elements of the array cost a tenth of the surface's own.
    each = surface.Poles().Value
    points = [each(i, j) for i in range(1, n + 1) for j in range(1, m + 1)]
    net[..., :3] = np.array(list(map(type(points[0]).Coord, points))).reshape(n, m, 3)
    if rational:
        net[..., 3] = [[surface.Weight(i, j) for j in range(1, m + 1)] for i in range(1, n + 1)]
        net[..., :3] *= net[..., 3:]
    if hasattr(surface, "UKnots"):
        knots = (
            knot_row(surface.UKnots(), surface.UMultiplicities()),
            knot_row(surface.VKnots(), surface.VMultiplicities()),
        )
    else:
        knots = (np.repeat([0.0, 1.0], degree[0] + 1), np.repeat([0.0, 1.0], degree[1] + 1))
    return net, knots, degree


def _free(surface: Any, deviation: float) -> Patch:
    copy = surface.Copy()
    if hasattr(copy, "SetUNotPeriodic"):
        if copy.IsUPeriodic():
            copy.SetUNotPeriodic()
        if copy.IsVPeriodic():
            copy.SetVNotPeriodic()
    net, knots, degree = _net(copy)
    # An edge that closes, or shrinks to a point, to OCCT's confusion does so exactly.
    for axis in (0, 1):
        edges = np.moveaxis(net, axis, 0)
        clamped = all(np.ptp(k) == 0.0 for k in (knots[axis][: degree[axis] + 1], knots[axis][-degree[axis] - 1 :]))
        if not clamped:
            continue
        points = edges[..., :3] / edges[..., 3:]
        if np.abs(edges[0] - edges[-1]).max() < CONFUSION:
            edges[-1] = edges[0]
        for end in (0, -1):
            if np.ptp(points[end], axis=0).max() < CONFUSION:
                edges[end, :, :3] = points[end].mean(axis=0) * edges[end, :, 3:]
    return Patch(_surface(net, knots, degree), Straight(False), Straight(False), deviation)


def patch(surface: Any, box: Box) -> Patch:
    """The part of a surface in which a face lies.

    Parameters
    ----------
    surface
        Geom_Surface.
    box
        u_min, u_max, v_min, v_max of the face.

    Raises
    ------
    Unreadable
        Saying why.
    """
    o = occt()
    while isinstance(surface, o.Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    if isinstance(surface, o.Geom_Plane):
        return _plane(surface, box)
    if isinstance(surface, o.Geom_ElementarySurface):
        return _round(surface, box)
    if isinstance(surface, o.Geom_SurfaceOfLinearExtrusion):
        return _extruded(surface, box)
    if isinstance(surface, o.Geom_SurfaceOfRevolution):
        return _revolution(surface, box)
    if isinstance(surface, (o.Geom_BSplineSurface, o.Geom_BezierSurface)):
        return _free(surface, 0.0)
    part = o.Geom_RectangularTrimmedSurface(surface, *box)
    wanted = 1e-6
    fit = o.GeomConvert_ApproxSurface(part, wanted, o.GeomAbs_C2, o.GeomAbs_C2, 9, 9, 200, 1)
    if not fit.HasResult():
        raise Unreadable(f"a {type(surface).__name__.removeprefix('Geom_')} cannot be approximated to {wanted:g} mm")
    return _free(fit.Surface(), float(fit.MaxError()))
