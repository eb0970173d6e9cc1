"""Edges of solids projected onto the surfaces of their faces, where their curves in (u, v) are off.

A file that says its edges in space only leaves the curves on surfaces to OCCT, which follows edges to their tolerance;
other files have curves that are off by theirs. Such an edge is projected onto its surface. Where it lies beside its two
surfaces and these cross, their intersection nearest to the edge takes its place, so that both faces end at one curve;
where they are tangent there is none, and each face ends at its own projection. Edges whose tolerance is OCCT's least
are not looked at.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.step.occt import occt
from assembly.step.profiles import Spline, Unreadable, approximated, crossings, knot_row, point
from assembly.step.surfaces import CONFUSION, Patch

__all__ = ["Side", "is_loose", "projected"]

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
    return np.column_stack([x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]])


class Side:
    """A surface, and the curve on it that is given for an edge.

    Parameters
    ----------
    flat
        Geom2d_Curve.
    patch
        The surface.
    """

    def __init__(self, flat: Any, patch: Patch) -> None:
        self.flat, self.patch = flat, patch
        self.low, self.high = np.array(patch.surface.domain).T
        self.is_closed = np.array(patch.surface.closed)

    def given(self, t: Array) -> Array:
        """Parameters (n, 2) of the surface on the curve."""
        there = np.array([point(self.flat.Value(x)) for x in t.tolist()])
        return np.column_stack([self.patch.u(there[:, 0]), self.patch.v(there[:, 1])])

    def _frame(self, uv: Array) -> tuple[Array, Array, Array]:
        side = self.high - self.low
        at = np.clip(np.where(self.is_closed, self.low + np.mod(uv - self.low, side), uv), self.low, self.high)
        s, su, sv = self.patch.surface.evaluate(at[:, 0], at[:, 1], 1)
        return s, su, sv

    def step(self, uv: Array, points: Array) -> tuple[Array, Array, Array]:
        """Gauss-Newton's step (n, 2) toward the feet of points, how far above the surface they are, and its normals."""
        s, su, sv = self._frame(uv)
        off = points - s
        a, b, c = (su * su).sum(axis=1), (su * sv).sum(axis=1), (sv * sv).sum(axis=1)
        f, g = (su * off).sum(axis=1), (sv * off).sum(axis=1)
        # Where a parameter has no direction, at poles, it stays.
        is_whole = a * c - b * b > 1e-12 * a * c
        both = np.column_stack([c * f - b * g, a * g - b * f]) / np.where(is_whole, a * c - b * b, 1.0)[:, None]
        alone = np.column_stack([f / np.maximum(a, 1e-300), g / np.maximum(c, 1e-300)])
        is_long = np.sqrt(np.column_stack([a, c])) * (self.high - self.low) > 1e-9 * self.patch.surface.size
        step = np.where(is_whole[:, None], both, np.where(is_long, alone, 0.0))
        normals = _cross(su, sv)
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
        return step, (normals * off).sum(axis=1), normals

    def moved(self, uv: Array, step: Array) -> Array:
        """Parameters after a step, within an open domain."""
        there = uv + step
        return np.where(self.is_closed, there, np.clip(there, self.low, self.high))

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
            far = float((np.abs(there - uv) / (self.high - self.low)).max())
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

    def __init__(self, space: Any, own: Side, other: Side | None) -> None:
        self.space, self.own, self.other = space, own, other
        self.size = own.patch.surface.size

    def points(self, t: Array) -> Array:
        """Of the edge (n, 3)."""
        return np.array([point(self.space.Value(x)) for x in t.tolist()])

    def off(self, t: Array) -> float:
        """How far the curve on the surface is from where the projection is, across the curve, at most.

        What the curve is ahead or behind on its way does not count.
        """
        given, there = self.own.given(t), self.projection(t)
        _, su, sv = self.own._frame(given)
        across = su * (there - given)[:, :1] + sv * (there - given)[:, 1:]
        slopes = np.gradient(given, t, axis=0)
        along = su * slopes[:, :1] + sv * slopes[:, 1:]
        along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
        across -= (across * along).sum(axis=1)[:, None] * along
        return float(np.linalg.norm(across, axis=1).max())

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
            cosine = (normals * normals_there).sum(axis=1)
            if count < 2:
                # Feet of the edge itself, by one step.
                sine = np.linalg.norm(_cross(normals, normals_there), axis=1)
                share = -np.expm1(-((sine / _CROSSING) ** 4))
                if count == 0:
                    continue
                if share.max() <= _TANGENT:
                    return points
            sums, gaps = (high + high_there) / (2.0 + 2.0 * cosine + _DAMPED), high - high_there
            gaps = gaps / (2.0 - 2.0 * cosine + _DAMPED)
            back = sums[:, None] * (normals + normals_there) + gaps[:, None] * (normals - normals_there)
            found = found - back
            if float((share * np.linalg.norm(back, axis=1)).max()) <= last:
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
    made = _Edge(space, own, other)
    try:
        if not made.off(np.linspace(low, high, 2 * _PLACES)) > _OFF * made.size:
            return None
        return approximated(made.projection, made.joints(low, high), _FOLLOWED * float(own.patch.sides.min()))
    except Unreadable:
        return None
