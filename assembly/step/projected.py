"""Edges of solids projected onto the surfaces of their faces, where their curves in (u, v) are off.

A file that says its edges in space only leaves the curves on surfaces to OCCT, which follows edges to their tolerance;
other files have curves that are off by theirs. Such an edge is projected onto its surface. Where it lies beside its two
surfaces and these cross, their intersection nearest to the edge takes its place, so that both faces end at one curve;
where they are tangent there is none, and each face ends at its own projection. Edges whose tolerance is OCCT's least
are not looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.splines.curve import NurbsCurve
from assembly.step.occt import occt
from assembly.step.profiles import Spline, Unreadable, approximated, crossings, knot_row, point, profile
from assembly.step.surfaces import CONFUSION, Patch

__all__ = ["Side", "is_loose", "points_of", "projected"]

Array = NDArray[np.float64]
# How far a curve may be off its edge, over the size of the surface: less changes no digit that counts.
_OFF = 1e-10
# Deviation of the interpolation, over the shorter side of the surface's domain, as of all that is followed.
_FOLLOWED = 1e-10
# Places of a stretch at which a curve is compared with its edge.
_PLACES = 9
# Most steps of a projection, of which each gains digits, and the last one over the size, which is rounding's.
_STEPS, _LAST = 30, 1e-13
# Sine of the angle between two surfaces at which two thirds of the way to their intersection are gone; from 2.5 times
# as much on all of it. No edge is moved by more than some 7 times what it is off.
_CROSSING = 0.1
# Parts of the way that are none.
_TANGENT = 1e-9
# Least eigenvalue, relative, with which an intersection is solved for; the surfaces of smaller ones count as tangent.
_DAMPED = 1e-6


def _cross(a: Array, b: Array) -> Array:
    """Cross products of rows; NumPy's own takes ten times as long for a few."""
    x, y = a.T, b.T
    return np.array([x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]).T


def _dot(a: Array, b: Array) -> Array:
    """Products of rows."""
    made: Array = np.einsum("ij,ij->i", a, b)
    return made


def _norm(a: Array) -> Array:
    """Lengths of rows."""
    return np.sqrt(_dot(a, a))


def points_of(curve: Any, low: float, high: float) -> Callable[[Array], Array]:
    """Points of a curve of OCCT at parameters in an interval: of its spline where that is exact, which is quicker."""
    o = occt()
    exact = (o.Geom_Line, o.Geom_Circle, o.Geom_Ellipse, o.Geom_BSplineCurve, o.Geom_BezierCurve)
    flat = (o.Geom2d_Line, o.Geom2d_Circle, o.Geom2d_Ellipse, o.Geom2d_BSplineCurve, o.Geom2d_BezierCurve)
    if isinstance(curve, exact + flat):
        try:
            source, along, _ = profile(curve, low, high, cut=True)
            points, weights = source.cartesian
            made = NurbsCurve(points, source.knots, source.degree, weights)
        except (Unreadable, InputError):
            pass
        else:
            first, last = made.domain
            return lambda t: made.evaluate(np.minimum(np.maximum(along(t), first), last))
    return lambda t: np.array([point(curve.Value(x)) for x in t.tolist()])


class Side:
    """A surface, and the curve on it that is given for an edge.

    Parameters
    ----------
    flat
        Geom2d_Curve.
    patch
        The surface.
    low, high
        Ends of the curve.
    """

    def __init__(self, flat: Any, patch: Patch, low: float, high: float) -> None:
        self.patch = patch
        self.low, self.high = np.array(patch.surface.domain).T
        self.side = self.high - self.low
        self.is_closed = np.array(patch.surface.closed)
        # Where a coordinate ends; one that comes around does not.
        self._least, self._most = np.where(self.is_closed, [[-np.inf], [np.inf]], [self.low, self.high])
        self._is_ring = bool(self.is_closed.any())
        self._flat = flat, low, high

    @cached_property
    def _points(self) -> Callable[[Array], Array]:
        return points_of(*self._flat)

    def given(self, t: Array) -> Array:
        """Parameters (n, 2) of the surface on the curve."""
        there = self._points(t)
        return np.array([self.patch.u(there[:, 0]), self.patch.v(there[:, 1])]).T

    def _frame(self, uv: Array) -> tuple[Array, Array, Array]:
        at = np.where(self.is_closed, self.low + np.mod(uv - self.low, self.side), uv) if self._is_ring else uv
        at = np.minimum(np.maximum(at, self.low), self.high)
        s, su, sv = self.patch.surface.evaluate(at[:, 0], at[:, 1], 1)
        return s, su, sv

    def step(self, uv: Array, points: Array) -> tuple[Array, Array, Array]:
        """Gauss-Newton's step (n, 2) toward the feet of points, how far above the surface they are, and its normals."""
        s, su, sv = self._frame(uv)
        off = points - s
        a, b, c = _dot(su, su), _dot(su, sv), _dot(sv, sv)
        f, g = _dot(su, off), _dot(sv, off)
        # Where a parameter has no direction, at poles, it stays.
        both, product = a * c - b * b, a * c
        is_whole = both > 1e-12 * product
        step = np.array([c * f - b * g, a * g - b * f]).T / np.where(is_whole, both, 1.0)[:, None]
        if not is_whole.all():
            alone = np.array([f / np.maximum(a, 1e-300), g / np.maximum(c, 1e-300)]).T
            is_long = np.sqrt(np.array([a, c]).T) * self.side > 1e-9 * self.patch.surface.size
            step = np.where(is_whole[:, None], step, np.where(is_long, alone, 0.0))
        normals = _cross(su, sv)
        normals /= np.maximum(_norm(normals), 1e-300)[:, None]
        return step, _dot(normals, off), normals

    def moved(self, uv: Array, step: Array) -> Array:
        """Parameters after a step, within an open domain."""
        made: Array = np.minimum(np.maximum(uv + step, self._least), self._most)
        return made

    def feet(self, points: Array, start: Array) -> Array:
        """Parameters (n, 2) of the surface's points that are nearest to others.

        Raises
        ------
        Unreadable
            Steps do not come to an end.
        """
        uv, far, before = start, np.inf, np.inf
        for _ in range(_STEPS):
            there = self.moved(uv, self.step(uv, points)[0])
            far = float((np.abs(there - uv) / self.side).max())
            uv = there
            # The last steps are rounding's, whatever the coordinates.
            if far <= _LAST or not far <= 0.25 or (far <= 1e3 * _LAST and far >= 0.5 * before):
                break
            before = far
        if not far <= 1e3 * _LAST:
            raise Unreadable("an edge has no nearest points on its surface")
        return uv


class _Edge:
    """An edge in space, the surface that it is projected onto, and the one on its other side if there is one."""

    def __init__(self, space: Any, low: float, high: float, own: Side, other: Side | None) -> None:
        self.space, self.own, self.other = space, own, other
        self.points = points_of(space, low, high)
        self.size = own.patch.surface.size

    def off(self, t: Array) -> float:
        """How far the curve on the surface is from where the projection is, across the curve, at most.

        What the curve is ahead or behind on its way does not count.
        """
        given, there = self.own.given(t), self.projection(t)
        _, su, sv = self.own._frame(given)
        across = su * (there - given)[:, :1] + sv * (there - given)[:, 1:]
        slopes = np.gradient(given, t, axis=0)
        along = su * slopes[:, :1] + sv * slopes[:, 1:]
        along /= np.maximum(_norm(along), 1e-300)[:, None]
        across -= _dot(across, along)[:, None] * along
        return float(_norm(across).max())

    def projection(self, t: Array) -> Array:
        """Parameters (n, 2) on the surface, of the intersection where there is one."""
        points, start = self.points(t), self.own.given(t)
        if self.other is not None:
            points = self._crossing(points, start, self.other.given(t), self.other)
        return self.own.feet(points, start)

    def _crossing(self, points: Array, own: Array, there: Array, other: Side) -> Array:
        """Points moved to both surfaces, as far as these cross."""
        found, share = points, np.zeros(len(points))
        last = _LAST * (self.size + float(np.abs(points).max()))
        for count in range(_STEPS):
            step, high, normals = self.own.step(own, found)
            step_there, high_there, normals_there = other.step(there, found)
            own, there = self.own.moved(own, step), other.moved(there, step_there)
            cosine = _dot(normals, normals_there)
            if count < 2:
                # Feet of the edge itself, by one step.
                sine = _norm(_cross(normals, normals_there))
                share = -np.expm1(-((sine / _CROSSING) ** 4))
                if count == 0:
                    continue
                if share.max() <= _TANGENT:
                    return points
            sums, gaps = (high + high_there) / (2.0 + 2.0 * cosine + _DAMPED), high - high_there
            gaps = gaps / (2.0 - 2.0 * cosine + _DAMPED)
            back = sums[:, None] * (normals + normals_there) + gaps[:, None] * (normals - normals_there)
            found = found - back
            if float((share * _norm(back)).max()) <= last:
                break
        moved: Array = points + share[:, None] * (found - points)
        return moved

    def joints(self, low: float, high: float) -> Array:
        """Parameters between which the projection is smooth: between knots of the edge and of the surface."""
        space, breaks = self.space, np.array([low, high])
        while hasattr(space, "BasisCurve"):
            space = space.BasisCurve()
        if hasattr(space, "Knots"):
            knots = knot_row(space.Knots(), space.Multiplicities())
            breaks = np.unique(np.append(breaks, knots[(knots > low) & (knots < high)]))
        at = np.unique(np.linspace(breaks[:-1], breaks[1:], _PLACES))
        values = self.projection(at)
        found = [breaks]
        for axis, knots in enumerate(self.own.patch.surface.breaks()):
            if self.own.is_closed[axis]:
                knots = np.unique(np.concatenate([knots + k * (knots[-1] - knots[0]) for k in (-1.0, 0.0, 1.0)]))
            # What is at a knot but for rounding is at it, whichever points are asked for together.
            near = knots[np.abs(values[:, axis, None] - knots).argmin(axis=1)]
            is_at = np.abs(values[:, axis] - near) <= 1e-11 * (knots[-1] - knots[0])
            values[is_at, axis] = near[is_at]
            there = crossings(
                values[:, axis], at, lambda t, axis=axis: float(self.projection(np.array([t]))[0, axis]), knots
            )
            found.append(np.array(there))
        joints = np.unique(np.concatenate(found))
        kept: Array = joints[np.append(True, np.diff(joints) > 1e-9 * (high - low))]
        kept[-1] = high
        return kept


def is_loose(edge: Any) -> bool:
    """Whether an edge has a tolerance of its own, beyond what OCCT gives all, which it finds by samples."""
    o = occt()
    return o.BRep_Tool.Tolerance_s(edge) > 2.0 * CONFUSION and not o.BRep_Tool.Degenerated_s(edge)


def projected(edge: Any, own: Side, other: Side | None, low: float, high: float) -> tuple[Spline, float] | None:
    """The curve in our (u, v) of a loose edge that is projected onto a surface; None where the one there is will do.

    Parameters
    ----------
    edge
        TopoDS_Edge.
    own, other
        Its surface, and the one of the face beyond it.
    low, high
        Ends of its curves.

    Returns
    -------
    spline, deviation
        The deviation is that of the interpolation, in (u, v).
    """
    o = occt()
    space = o.BRep_Tool.Curve_s(edge, 0.0, 0.0)
    if space is None or not np.allclose(o.BRep_Tool.Range_s(edge), (low, high), rtol=1e-9, atol=1e-9 * (high - low)):
        return None
    made = _Edge(space, low, high, own, other)
    try:
        if not made.off(np.linspace(low, high, 2 * _PLACES)) > _OFF * made.size:
            return None
        return approximated(made.projection, made.joints(low, high), _FOLLOWED * float(own.patch.sides.min()))
    except Unreadable:
        return None
