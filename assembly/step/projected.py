"""Edges of solids projected onto the surfaces of their faces, where their curves in (u, v) are off.

A file that says its edges in space only leaves the curves on surfaces to OCCT, which follows edges to their tolerance;
other files have curves that are off by theirs. Such an edge is projected onto its surface. Where it lies beside its two
surfaces and these cross, their intersection nearest to the edge takes its place, so that both faces end at one curve;
where they are tangent there is none, and each face ends at its own projection. Edges whose tolerance is OCCT's least
are not looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from math import isclose
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.step.crossings import crossings
from assembly.step.edge_feet import AT_POLE, distance_across, fill_surface_points, move_between, move_to_feet
from assembly.step.occt import occt
from assembly.step.profiles import Direction, Spline, Unreadable, approximated, knot_row, profile, values_of
from assembly.step.surfaces import CONFUSION, Patch
from assembly.step.tracks import Track, track

__all__ = ["Side", "Space", "is_loose", "points_of", "projected", "space_of", "strays"]

Array = NDArray[np.float64]
# How far a curve may be off its edge, over the size of the surface: less changes no digit that counts.
_OFF = 1e-10
# Deviation of the interpolation, over the shorter side of the surface's domain, as of all that is followed.
_FOLLOWED = 1e-10
# Places of a stretch at which a curve is compared with its edge.
_PLACES = 9
# Places of a whole curve at which it is first asked whether it leaves its edge anywhere (`strays`).
_LOOKS = 33


def points_of(curve: Any, low: float, high: float) -> Callable[[Array], Array]:
    """Points of a curve of OCCT at parameters in an interval: of its spline where that is exact, which is quicker."""
    if is_exact(curve):
        try:
            source, along, _ = profile(curve, low, high, cut=True)
        except (Unreadable, InputError):
            pass
        else:
            return _tracked(curve, source, along)
    return values_of(curve)


def is_exact(curve: Any) -> bool:
    """Whether a curve of OCCT, in space or in the plane, is a spline or has one with the same points."""
    o = occt()
    exact = (o.Geom_Line, o.Geom_Circle, o.Geom_Ellipse, o.Geom_BSplineCurve, o.Geom_BezierCurve)
    flat = (o.Geom2d_Line, o.Geom2d_Circle, o.Geom2d_Ellipse, o.Geom2d_BSplineCurve, o.Geom2d_BezierCurve)
    return isinstance(curve, exact + flat)


def _tracked(curve: Any, source: Spline, along: Direction) -> Callable[[Array], Array]:
    return track(source, along) or values_of(curve)


class Space(NamedTuple):
    """An edge's curve in space, Geom_Curve, its ends, and its points."""

    curve: Any
    low: float
    high: float
    points: Callable[[Array], Array]


def space_of(edge: Any) -> Space | None:
    """The curve of an edge in space, if it has one."""
    o = occt()
    curve = o.BRep_Tool.Curve_s(edge, 0.0, 0.0)
    if curve is None:
        return None
    low, high = o.BRep_Tool.Range_s(edge)
    return Space(curve, low, high, points_of(curve, low, high))


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
        self.is_closed = patch.surface.closed
        self._flat = flat, low, high

    @cached_property
    def ground(self) -> tuple[NDArray[np.int64], Array, float]:
        """The surface as kernels read it."""
        surface = self.patch.surface
        return *surface._tables, surface.size

    @cached_property
    def profile(self) -> tuple[Spline, Direction, float]:
        """The curve, in OCCT's parameters of the surface, as `profiles.profile` has it.

        Raises
        ------
        Unreadable
            It has a degree that is too high.
        """
        return profile(*self._flat, cut=True)

    @cached_property
    def _points(self) -> Callable[[Array], Array]:
        made = values_of(self._flat[0])
        if is_exact(self._flat[0]):
            with suppress(Unreadable, InputError):
                source, along, _ = self.profile
                made = _tracked(self._flat[0], source, along)
        return made.with_maps((self.patch.u, self.patch.v)) if isinstance(made, Track) else made

    def ready(self) -> None:
        """Make its tables, which are otherwise made when they are asked for."""
        _ = self.ground, self._points

    def given(self, t: Array) -> Array:
        """Parameters (n, 2) of the surface on the curve."""
        if isinstance(self._points, Track):
            return self._points(t)
        there = self._points(t)
        return np.column_stack([self.patch.u(there[:, 0]), self.patch.v(there[:, 1])])

    def points(self, t: Array) -> Array:
        """Points (n, 3) of the surface on the curve, whose parameters count as the end where they are beyond it."""
        out = np.empty((t.size, 3))
        fill_surface_points(self.ground, np.ascontiguousarray(self.given(t)), out)
        return out

    def feet(self, points: Array, start: Array) -> Array:
        """Parameters (n, 2) of the surface's points that are nearest to others.

        Raises
        ------
        Unreadable
            Steps do not come to an end.
        """
        places = start.copy()
        if not move_to_feet(self.ground, points, places):
            raise Unreadable("an edge has no nearest points on its surface")
        return places


class _Edge:
    """An edge in space, the surface that it is projected onto, and the one on its other side if there is one."""

    def __init__(self, space: Space, own: Side, other: Side | None) -> None:
        self.space, self.own, self.other = space, own, other
        self.size = own.patch.surface.size

    def off(self, t: Array) -> float:
        """How far the curve on the surface is from where the projection is, across the curve, at most.

        Differences along the curve do not count.
        """
        given = self.own.given(t)
        return float(distance_across(self.own.ground, t, np.ascontiguousarray(given), self._from(t, given)))

    def ends_at_pole(self, low: float, high: float) -> bool:
        """Whether the curve that is given begins or ends where a parameter has no direction."""
        return bool((self.own.patch.counts(self.own.given(np.array([low, high]))) <= AT_POLE).any())

    def projection(self, t: Array) -> Array:
        """Parameters (n, 2) on the surface, of the intersection where there is one."""
        return self._from(t, self.own.given(t))

    def _from(self, t: Array, start: Array) -> Array:
        """The same from the parameters on the curve that is given."""
        points = np.ascontiguousarray(self.space.points(t))
        if self.other is not None:
            move_between(
                self.own.ground, self.other.ground, points, np.concatenate([start, self.other.given(t)], axis=1)
            )
        return self.own.feet(points, start)

    def joints(self, low: float, high: float) -> Array:
        """Parameters between which the projection is smooth: between knots of the edge and of the surface."""
        space, breaks = self.space.curve, np.array([low, high])
        while hasattr(space, "BasisCurve"):
            space = space.BasisCurve()
        if hasattr(space, "Knots"):
            knots = knot_row(space.Knots(), space.Multiplicities())
            breaks = np.unique(np.append(breaks, knots[(knots > low) & (knots < high)]))
        at = np.unique(np.linspace(breaks[:-1], breaks[1:], _PLACES))
        values = self.projection(at)
        joints = []
        for axis, knots in enumerate(self.own.patch.surface.breaks()):
            if self.own.is_closed[axis]:
                knots = np.unique(np.concatenate([knots + k * (knots[-1] - knots[0]) for k in (-1.0, 0.0, 1.0)]))
            # What is at a knot but for rounding is at it.
            near = knots[np.abs(values[:, axis, None] - knots).argmin(axis=1)]
            is_at = np.abs(values[:, axis] - near) <= 1e-11 * (knots[-1] - knots[0])
            values[is_at, axis] = near[is_at]
            joints.append(knots)
        cuts = np.unique(np.append(breaks, crossings(values, at, self.projection, joints)))
        kept: Array = cuts[np.append(True, np.diff(cuts) > 1e-9 * (high - low))]
        kept[-1] = high
        return kept


def is_loose(edge: Any) -> bool:
    """Whether an edge has a tolerance of its own, beyond what OCCT gives all, which it finds by samples."""
    tool = occt().BRep_Tool
    return tool.Tolerance_s(edge) > 2.0 * CONFUSION and not tool.Degenerated_s(edge)


def strays(space: Space | None, own: Side, tolerance: float) -> bool:
    """Whether the curve on a surface that is given for an edge leaves it by more than its tolerance somewhere.

    Points of both are compared at the same parameters; more than one and a half tolerances between them counts.
    """
    if space is None:
        return False
    t = np.linspace(space.low, space.high, _LOOKS)
    gaps = own.points(t) - space.points(t)
    return bool((gaps * gaps).sum(axis=1).max() > (1.5 * tolerance) ** 2)


def projected(space: Space, own: Side, other: Side | None, low: float, high: float) -> tuple[Spline, float] | None:
    """The curve in our (u, v) of a loose edge that is projected onto a surface; None where the one there is will do.

    Parameters
    ----------
    space
        The edge.
    own, other
        Its surface, and the one of the face beyond it.
    low, high
        Ends of its curves on surfaces.

    Returns
    -------
    spline, deviation
        The deviation is that of the interpolation, in (u, v).
    """
    near = {"rel_tol": 1e-9, "abs_tol": 1e-9 * (high - low)}
    if not (isclose(space.low, low, **near) and isclose(space.high, high, **near)):
        return None
    made = _Edge(space, own, other)
    try:
        if not made.off(np.linspace(low, high, 2 * _PLACES)) > _OFF * made.size:
            return None
        # Beside a pole a turn counts as what it is in space. At the pole itself it is all that tells the direction of
        # an edge, where the next one begins.
        counts = own.patch.counts if own.patch.surface._pole_bits and not made.ends_at_pole(low, high) else None
        return approximated(made.projection, made.joints(low, high), _FOLLOWED * float(own.patch.sides.min()), counts)
    except Unreadable:
        return None
