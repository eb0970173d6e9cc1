"""Edges of faces as curves of OCCT, in space and in the parameters of its surface.

A curve along a parameter is taken from the surface; lines and circles are lines and circles, those in planes exactly.
Other curves in a plane, and curves on surfaces with our parameters, keep their control points; any other is
interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.curves import Circle, Line, curve_form
from assembly.geometry.recognition.nets import exactness
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.carriers import Carrier, spline_curve
from assembly.step.crossings import crossings
from assembly.step.occt import occt
from assembly.step.profiles import Spline, Unreadable, approximated

__all__ = ["EdgeCurves", "Laid", "nearness"]

Array = NDArray[np.float64]
# Deviation of edges that are interpolated, over the size of the surface.
FOLLOWED = 1e-10
# What points are off by where coordinates are large, over these: some twenty roundings.
_ROUNDED = 5e-15
# Most steps to the place at which a curve has gone some way, and the parts of its whole way at which they end, and that
# may be left.
_STEPS, _LAST, _LEFT = 20, 1e-15, 1e-12


def nearness(length: float, surface: NurbsSurface) -> float:
    """How near curves on a surface are followed: to a length, and what its coordinates are rounded by."""
    return length + _ROUNDED * float(np.abs(surface.control_points).max())


class Laid(NamedTuple):
    """An edge as OCCT has it.

    Attributes
    ----------
    flat, space
        Geom2d_Curve in the parameters of the surface, and Geom_Curve, which have one parameter.
    low, high : float
        Its range.
    backwards : bool
        Whether our curve runs against them.
    """

    flat: Any
    space: Any
    low: float
    high: float
    backwards: bool


class _Gone:
    """How far a curve has gone along a line or around a circle, from its start, and where it has gone how far.

    Parameters
    ----------
    measure
        A length or an angle at parameters.
    joints
        Parameters between which it is smooth, the ends included.
    period
        Of the angle.
    """

    def __init__(self, measure: Callable[[Array], Array], joints: Array, period: float = 0.0) -> None:
        self._measure, self._period = measure, period
        self._at = sampled(joints, 33)
        row = measure(self._at)
        self._table = np.unwrap(row, period=period) if period else row
        self._first = float(self._table[0])
        self._table -= self._first
        self.length = float(self._table[-1])
        self.is_forward = bool((np.diff(self._table) > 0.0).all())

    def at(self, t: Array) -> Array:
        """How far it has gone at parameters."""
        found = self._measure(t) - self._first
        if self._period:
            found += self._period * np.round((np.interp(t, self._at, self._table) - found) / self._period)
        return np.asarray(found)

    def places(self, gone: Array) -> Array:
        """Parameters at which it has gone so far.

        Raises
        ------
        Unreadable
            Steps do not come to an end.
        """
        t = np.interp(gone, self._table, self._at)
        slope = np.gradient(self._at, self._table)
        for _ in range(_STEPS):
            left = gone - self.at(t)
            if np.abs(left).max() <= _LAST * self.length:
                break
            t = np.clip(t + left * np.interp(gone, self._table, slope), self._at[0], self._at[-1])
        if not np.abs(left).max() <= _LEFT * self.length:
            raise Unreadable("a curve cannot be followed along a line or a circle")
        return np.asarray(t)


class EdgeCurves:
    """Curves on a surface of ours as edges on the surface of OCCT that stands for it."""

    def __init__(self, surface: NurbsSurface, carrier: Carrier) -> None:
        self.surface, self.carrier, self.geometry = surface, carrier, carrier.geometry

    def of(self, curve: NurbsCurve) -> Laid:
        """A curve of (u, v) as an edge."""
        return self.line(curve) or self._curve(curve)

    def at(self, uv: Array) -> Array:
        """Points of the surface; parameters may be off the domain by rounding."""
        low, high = np.array(self.surface.domain).T
        uv = np.clip(uv, low, high)
        return self.surface.evaluate(uv[:, 0], uv[:, 1])

    @cached_property
    def nearness(self) -> float:
        """How near edges are followed in space."""
        return nearness(FOLLOWED * self.surface.size, self.surface)

    @cached_property
    def is_affine(self) -> bool:
        """Whether points of a plane are linear in our parameters."""
        surface = self.surface
        if surface.degree != (1, 1) or surface.control_points.shape != (2, 2, 3) or np.ptp(surface.weights) > 0.0:
            return False
        net = surface.control_points
        twist = float(np.abs(net[1, 1] - net[1, 0] - net[0, 1] + net[0, 0]).max())
        return twist <= exactness(surface.size, float(np.abs(net).max()))

    def extended(self, uv: Array) -> Array:
        """Points of an affine plane at any parameters."""
        net = self.surface.control_points
        (u0, u1), (v0, v1) = self.surface.domain
        sides = np.array([(net[1, 0] - net[0, 0]) / (u1 - u0), (net[0, 1] - net[0, 0]) / (v1 - v0)])
        points: Array = net[0, 0] + (uv - [u0, v0]) @ sides
        return points

    def line(self, curve: NurbsCurve) -> Laid | None:
        """Curve in (u, v), curve in space, range, and whether it runs backwards, of a line along a parameter."""
        o = occt()
        ends = curve.control_points
        if len(ends) > 2 or self.carrier.plane is not None:
            return None
        for axis in (0, 1):
            if ends[0, axis] != ends[1, axis]:
                continue
            there = self.carrier.at(ends)
            across = 1 - axis if self.carrier.swapped else axis
            there[:, across] = there[0, across]
            first, last = there[:, 1 - across]
            along = o.gp_Dir2d(*np.eye(2)[1 - across].tolist())
            start = np.zeros(2)
            start[across] = there[0, across]
            flat = o.Geom2d_Line(o.gp_Pnt2d(*start.tolist()), along)
            space = (self.geometry.UIso, self.geometry.VIso)[across](float(there[0, across]))
            return Laid(flat, space, float(min(first, last)), float(max(first, last)), bool(first > last))
        return None

    def _curve(self, curve: NurbsCurve) -> Laid:
        if self.carrier.plane is not None:
            return self._in_plane(curve, self.carrier.plane)
        low, high = curve.domain
        joints = self._joints(curve)
        space, _ = approximated(lambda t: self.at(curve.evaluate(t)), joints, self.nearness)
        points, weights = space.cartesian
        if self.carrier.is_own:
            flat = spline_curve(curve.control_points, curve.weights, curve.knots, curve.degree)
        else:
            known = self._known(curve, space, joints)
            if known is not None:
                return known
            flat = self._flat(curve.evaluate, joints)
        return Laid(flat, spline_curve(points, weights, space.knots, space.degree), low, high, False)

    def _flat(self, places: Callable[[Array], Array], joints: Array) -> Any:
        """A curve in the parameters of OCCT's surface, from our (u, v) at its parameters."""
        # Each parameter in parts of its own extent: one may be an angle, the other thousands of millimeters.
        extent = np.ptp(self.carrier.at(np.array(self.surface.domain).T), axis=0)
        mapped, _ = approximated(lambda t: self.carrier.at(places(t)) / extent, joints, FOLLOWED)
        points, weights = mapped.cartesian
        return spline_curve(extent * points, weights, mapped.knots, mapped.degree)

    def _known(self, curve: NurbsCurve, space: Spline, joints: Array) -> Laid | None:
        """The line or the circle that a curve is, if it is one; None if it turns back on it."""
        o = occt()
        points, weights = space.cartesian
        pieces = NurbsCurve(points, space.knots, space.degree, weights).bezier_pieces()
        form = curve_form([pieces], self.nearness)
        start = self.at(curve.evaluate(joints[:1]))[0]
        if isinstance(form, Line):
            way = self.at(curve.evaluate(joints[-1:]))[0] - start
            way /= max(float(np.linalg.norm(way)), 1e-300)
            made = o.Geom_Line(o.gp_Pnt(*start.tolist()), o.gp_Dir(*way.tolist()))
            gone = _Gone(lambda t: (self.at(curve.evaluate(t)) - start) @ way, joints)
        elif isinstance(form, Circle):
            x = start - form.center
            x = x - (x @ form.axis) * form.axis
            x /= np.linalg.norm(x)
            y = np.cross(form.axis, x)

            def angle(t: Array) -> Array:
                out = self.at(curve.evaluate(t)) - form.center
                return np.asarray(np.arctan2(out @ y, out @ x))

            gone = _Gone(angle, joints, 2.0 * pi)
            axis = form.axis
            if gone.length < 0.0:
                gone, axis = _Gone(lambda t: -angle(t), joints, 2.0 * pi), -axis
            place = o.gp_Ax2(*(o.gp_Pnt(*form.center.tolist()), o.gp_Dir(*axis.tolist()), o.gp_Dir(*x.tolist())))
            made = o.Geom_Circle(place, form.radius)
        else:
            return None
        if not gone.is_forward or isinstance(form, Circle) and gone.length > 2.0 * pi * (1.0 + _LEFT):
            return None
        try:
            flat = self._flat(lambda s: curve.evaluate(gone.places(s)), gone.at(joints))
        except Unreadable:
            return None
        return Laid(flat, made, 0.0, gone.length, False)

    def _joints(self, curve: NurbsCurve) -> Array:
        """Parameters between which a curve on the surface is smooth."""
        low, high = curve.domain
        breaks = curve.breaks()
        at = sampled(breaks, 17)
        cuts = crossings(curve.evaluate(at), at, curve.evaluate, self.surface.breaks())
        joints = np.unique(np.clip(np.append(breaks, cuts), low, high))
        return np.append(joints[:-1][np.diff(joints) > 1e-9 * (high - low)], high)

    def _in_plane(self, curve: NurbsCurve, plane: Array) -> Laid:
        """The same of a curve in a plane: a line or a circle if it is one."""
        o = occt()
        origin, axes = plane[0], plane[1:]
        low, high = curve.domain
        joints = self._joints(curve)
        if self.is_affine:
            points, weights = self.extended(curve.control_points), curve.weights
            knots, degree = curve.knots, curve.degree
        else:
            space, _ = approximated(lambda t: self.at(curve.evaluate(t)), joints, self.nearness)
            (points, weights), knots, degree = space.cartesian, space.knots, space.degree
        inside = (points - origin) @ axes.T
        whole = NurbsCurve(np.column_stack([inside, np.zeros(len(inside))]), knots, degree, weights)
        # The points are rounded where they are in space, which may be far out.
        size, far = float(np.linalg.norm(np.ptp(inside, axis=0))), float(np.abs(points).max())
        form = curve_form([whole.bezier_pieces()], exactness(size, far))
        if isinstance(form, Line):
            way = inside[-1] - inside[0]
            length = float(np.linalg.norm(way))
            space_way = o.gp_Dir(*(way @ axes).tolist())
            flat = o.Geom2d_Line(o.gp_Pnt2d(*inside[0].tolist()), o.gp_Dir2d(*way.tolist()))
            start = o.gp_Pnt(*(origin + inside[0] @ axes).tolist())
            return Laid(flat, o.Geom_Line(start, space_way), 0.0, length, False)
        if isinstance(form, Circle):
            at = sampled(whole.breaks(), 9)
            out = whole.evaluate(at)[:, :2] - form.center[:2]
            angles = np.unwrap(np.arctan2(out[:, 1], out[:, 0]))
            turn = float(angles[-1] - angles[0])
            if (np.diff(angles) * turn > 0.0).all() and abs(turn) < 2.0 * pi + 1e-9:
                return self._arc(form, out[0], min(abs(turn), 2.0 * pi), turn > 0.0, plane)
        flat = spline_curve(inside, weights, knots, degree)
        return Laid(flat, spline_curve(origin + inside @ axes, weights, knots, degree), low, high, False)

    def _arc(self, form: Circle, start: Array, turn: float, left: bool, plane: Array) -> Laid:
        """A circle in a plane from the direction where it starts, counterclockwise or clockwise."""
        o = occt()
        origin, axes = plane[0], plane[1:]
        x, center = start / np.linalg.norm(start), form.center[:2]
        sense = 1.0 if left else -1.0
        flat = o.Geom2d_Circle(o.gp_Ax2d(o.gp_Pnt2d(*center.tolist()), o.gp_Dir2d(*x.tolist())), form.radius, left)
        place = o.gp_Ax2(
            o.gp_Pnt(*(origin + center @ axes).tolist()),
            o.gp_Dir(*(sense * np.cross(*axes)).tolist()),
            o.gp_Dir(*(x @ axes).tolist()),
        )
        return Laid(flat, o.Geom_Circle(place, form.radius), 0.0, turn, False)
