"""Curves of OCCT as rational splines, and the maps from OCCT's parameters to ours.

OCCT runs along circles by the angle, for which there is no rational form. On an arc of half-angle h about its middle,
written as the rational quadratic with the weights 1, cos h, 1 (Piegl & Tiller, The NURBS Book, section 7.3), the
parameter s in [-1, 1] and the angle a from the middle are related by

    tan(a / 2) = s tan(h / 2)

because both sides are projective parameters of the arc with equal values at its two ends and in its middle. Full
circles and longer arcs are joined of equal arcs of at most a quarter turn, which makes the map once continuously
differentiable.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import ceil, cos, pi, tan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import AssemblyError
from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve_parts import CORNER
from assembly.step.occt import occt

__all__ = [
    "Direction", "Spline", "Straight", "Turning", "Unreadable", "approximated", "arc", "profile", "spline", "values_of",
]  # fmt: skip

Array = NDArray[np.float64]
# Part of the extent by which surfaces reach beyond their face, so that trims lie inside their domain.
SLACK = 1.0 / 32.0
# Angles that differ by less are one.
_SAME_ANGLE = 1e-6
# Degree of curves that are interpolated, most halvings of a stretch, and most stretches that are halved at once: of a
# curve with one sharp turn there are few, of one that is not smooth all.
_DEGREE, _HALVINGS, _HALVED = 7, 26, 4096


class Unreadable(AssemblyError):
    """Why a face cannot be read."""


@dataclass(frozen=True)
class Spline:
    """Homogeneous control points (n, ..., d + 1), knots and degree of one direction."""

    points: Array
    knots: Array
    degree: int

    @property
    def cartesian(self) -> tuple[Array, Array]:
        """Control points and weights."""
        return self.points[..., :-1] / self.points[..., -1:], self.points[..., -1]


def spline(points: Array, knots: Array, degree: int, weights: Array | None = None) -> Spline:
    """A spline of control points (n, d)."""
    made = np.ones((len(points), points.shape[1] + 1))
    made[:, :-1] = points
    if weights is not None:
        made *= weights[:, None]
    return Spline(made, knots, degree)


@dataclass(frozen=True)
class Straight:
    """A parameter that is kept: a length, which changes with the unit, or a parameter of a spline."""

    is_length: bool

    def __call__(self, x: Array) -> Array:
        """Our parameter."""
        return x

    def joints(self, low: float, high: float) -> Array:
        """Where the map is not smooth between two parameters of OCCT: nowhere."""
        return np.empty(0)


@dataclass(frozen=True)
class Turning:
    """An angle on [low, high], mapped to the parameter of `spans` equal rational arcs, `radius` long a radian."""

    low: float
    high: float
    spans: int
    radius: float
    is_length = True

    @classmethod
    def over(cls, low: float, high: float, radius: float) -> Turning:
        """Angles of [low, high], or the whole turn from `low` where that is nearly all."""
        slack = SLACK * (high - low)
        if high - low + 2.0 * slack >= 2.0 * pi - _SAME_ANGLE:
            eighth = round(low / (0.25 * pi)) * 0.25 * pi
            start = eighth if abs(low - eighth) < _SAME_ANGLE else low
            return cls(start, start + 2.0 * pi, 4, radius)
        return cls.between(low - slack, high + slack, radius)

    @classmethod
    def between(cls, low: float, high: float, radius: float) -> Turning:
        """Angles of [low, high] and no more."""
        return cls(low, high, max(1, ceil((high - low) / (0.5 * pi) - _SAME_ANGLE)), radius)

    @property
    def step(self) -> float:
        """Angle of one arc."""
        return (self.high - self.low) / self.spans

    def joint(self, k: Array) -> Array:
        """Parameters of the joints between arcs; beyond the domain they go on with its period."""
        turns, within = np.divmod(k, self.spans)
        return self.radius * (self._ends[within.astype(np.int64)] + turns * (self.high - self.low))

    @cached_property
    def _ends(self) -> Array:
        """Angles where arcs begin and end."""
        return np.linspace(self.low, self.high, self.spans + 1)

    @property
    def knots(self) -> Array:
        """Knots of the arcs."""
        return self.radius * _ring_knots(self.low, self.high, self.spans)

    def __call__(self, x: Array) -> Array:
        """Our parameter of an angle."""
        k = np.floor((x - self.low) / self.step)
        s = tan_ratio(x - self.low - (k + 0.5) * self.step, self.step)
        # The ends of an arc have one value, whichever arc they are computed from.
        k, s = np.where(s >= 1.0 - 1e-14, k + 1.0, k), np.where(np.abs(s) >= 1.0 - 1e-14, -1.0, s)
        low = self.joint(k)
        return np.asarray(low + 0.5 * (1.0 + s) * self.radius * self.step)

    def joints(self, low: float, high: float) -> Array:
        """Angles between two angles where arcs meet."""
        first, last = np.ceil((low - self.low) / self.step), np.floor((high - self.low) / self.step)
        return np.asarray(self.low + self.step * np.arange(first, last + 1.0))


Direction = Straight | Turning


def tan_ratio(angle: Array, step: float) -> Array:
    """Where in [-1, 1] an angle from the middle of a rational arc lies."""
    return np.asarray(np.tan(0.5 * angle) / tan(0.25 * step))


def arc(map_: Turning) -> Spline:
    """Unit arc (cos, sin) of the angles of a map, homogeneous in the plane."""
    return Spline(_ring(map_.low, map_.high, map_.spans), map_.knots, 2)


@lru_cache(maxsize=256)
def _ring_knots(low: float, high: float, spans: int) -> Array:
    """Knots of an arc by the angle, not to be changed."""
    ends = np.linspace(low, high, spans + 1)
    ends[-1] = low + (high - low)
    return bezier.full_knots(ends, 2)


@lru_cache(maxsize=256)
def _ring(low: float, high: float, spans: int) -> Array:
    """Control points of an arc of the unit circle, not to be changed: many arcs of a body have the same angles."""
    half = 0.5 * ((high - low) / spans)
    at = low + half * np.arange(2 * spans + 1)
    weights = np.where(np.arange(at.size) % 2 == 1, cos(half), 1.0)
    ring = np.column_stack([np.cos(at), np.sin(at)])
    # Quarter turns are exact: sin(pi) is not zero in doubles.
    ring = np.where(np.abs(ring) < 1e-15, 0.0, ring)
    if high - low >= 2.0 * pi - _SAME_ANGLE:
        ring[-1] = ring[0]
    # The middle control point of an arc lies 1 / cos h out; in homogeneous form that is the weight's inverse.
    return np.column_stack([ring, weights])


def approximated(
    function: Callable[[Array], Array],
    breaks: Array,
    tolerance: float,
    counts: Callable[[Array], Array] | None = None,
) -> tuple[Spline, float]:
    """A piecewise polynomial through a function, (n,) -> (n, d), that is smooth between breaks.

    Interpolates at Chebyshev's points of each piece, ends included, and halves pieces until they fit. `counts`, if
    given, is from values (n, d) to by how much a deviation there counts in each coordinate, at most one.

    Returns
    -------
    spline, deviation
        The largest distance found at points between those of the interpolation.

    Raises
    ------
    Unreadable
        Some piece cannot be made to fit.
    """
    parts, solve, check = _interpolation()
    found: list[tuple[Array, Array, Array]] = []
    worst = 0.0
    low, high = breaks[:-1], breaks[1:]
    # Stretches of one halving are asked for at once.
    for depth in range(_HALVINGS + 1):
        asked = function((low[:, None] + (high - low)[:, None] * parts).ravel()).reshape(len(low), len(parts), -1)
        pieces = solve @ asked[:, : _DEGREE + 1]
        pieces[:, 0], pieces[:, -1] = asked[:, 0], asked[:, _DEGREE]
        between = asked[:, _DEGREE + 1 :]
        off = np.abs(check @ pieces - between)
        if counts is not None:
            off *= counts(between.reshape(-1, between.shape[2])).reshape(between.shape)
        errors = off.max(axis=(1, 2))
        fits = ~(errors > tolerance)
        found.append((low[fits], high[fits], pieces[fits]))
        worst = max(worst, float(errors[fits].max(initial=0.0)))
        if fits.all():
            break
        if depth == _HALVINGS or np.count_nonzero(~fits) > max(_HALVED, breaks.size):
            raise Unreadable(f"a curve bends too sharply to be followed to {tolerance:.1g}")
        low, high = low[~fits], high[~fits]
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    begins, ends, stack = found[0]
    if len(found) > 1:
        begins, ends, stack = (np.concatenate(column) for column in zip(*found, strict=True))
        order = np.argsort(begins)
        begins, ends, stack = begins[order], ends[order], stack[order]
    stack[1:, 0] = stack[:-1, -1]
    at = np.append(begins[:1], ends)
    if counts is not None:
        _smooth(stack, at, ~np.isin(at[1:-1], breaks))
    return spline(bezier.joined(stack), bezier.full_knots(at, _DEGREE), _DEGREE), worst


def _smooth(stack: Array, at: Array, halved: NDArray[np.bool_]) -> None:
    """Give pieces (n, degree + 1, d) one derivative where a stretch was halved and the derivatives make a corner.

    Of short pieces a small deviation does. It is the mean of both, that of the longer piece with more weight, whose
    deviation is the smaller one.
    """
    lengths = np.diff(at)[:, None]
    before, after = stack[:-1, -1] - stack[:-1, -2], stack[1:, 1] - stack[1:, 0]
    mean = (before + after) / (lengths[:-1] + lengths[1:])
    jump = np.linalg.norm(after / lengths[1:] - before / lengths[:-1], axis=1)
    k = np.flatnonzero(halved & (jump > CORNER * np.linalg.norm(mean, axis=1)))
    joint = stack[k, -1]
    stack[k, -2], stack[k + 1, 1] = joint - lengths[k] * mean[k], joint + lengths[k + 1] * mean[k]


@lru_cache(maxsize=1)
def _interpolation() -> tuple[Array, Array, Array]:
    """Where a stretch is asked for, first its nodes; from values there to control points; from these to the others."""
    nodes = 0.5 - 0.5 * np.cos(np.linspace(0.0, pi, _DEGREE + 1))
    between = 0.5 - 0.5 * np.cos(np.linspace(0.0, pi, 3 * _DEGREE + 1))
    solve = np.asarray(np.linalg.inv(bezier.bernstein(_DEGREE, nodes)), dtype=np.float64)
    return np.concatenate([nodes, between]), solve, bezier.bernstein(_DEGREE, between)


def point(p: Any) -> Array:
    """Coordinates of a point, vector or direction in space or in the plane."""
    return np.array(p.Coord())


def reals(array: Any) -> Array:
    """Values of a one-dimensional array."""
    return np.array(list(map(array.Value, range(array.Lower(), array.Upper() + 1))), dtype=np.float64)


def knot_row(knots: Any, times: Any) -> Array:
    """Knots repeated as often as they count."""
    return np.repeat(reals(knots), reals(times).astype(np.int64))


def _bspline(curve: Any) -> Spline:
    """Of a B-spline or Bezier curve of OCCT, in space or in the plane, that is not periodic."""
    n = curve.NbPoles()
    # Elements of the array cost a tenth of the curve's own.
    points = list(map(curve.Poles().Value, range(1, n + 1)))
    poles = np.array(list(map(type(points[0]).Coord, points)))
    weights = np.array([curve.Weight(k) for k in range(1, n + 1)]) if curve.IsRational() else None
    degree = curve.Degree()
    if degree > bezier.MAX_DEGREE:
        raise Unreadable(f"a spline has degree {degree}, more than {bezier.MAX_DEGREE}")
    if hasattr(curve, "Knots"):
        knots = knot_row(curve.Knots(), curve.Multiplicities())
    else:
        knots = np.repeat([0.0, 1.0], degree + 1)
    return spline(poles, knots, degree, weights)


def _open_spline(curve: Any) -> Any:
    """A B-spline curve that is not periodic."""
    if not curve.IsPeriodic():
        return curve
    part = curve.Copy()
    part.SetNotPeriodic()
    return part


def _cut_spline(curve: Any, low: float, high: float) -> Any:
    """A B-spline curve from one parameter to another, its ends control points."""
    first, last = curve.FirstParameter(), curve.LastParameter()
    near = 1e-12 * (last - first)
    if not (low > first + near or high < last - near):
        if min(curve.Multiplicity(1), curve.Multiplicity(curve.NbKnots())) > curve.Degree():
            return _open_spline(curve)
        # Periodic curves among others, whose ends are no control points.
        low, high = first, last
    part = curve.Copy()
    part.Segment(low, high)
    return part


def _conic_axes(curve: Any) -> tuple[Array, Array, Array, float]:
    """Center, the two half-axes as vectors, and a mean radius, of a circle, an ellipse or a hyperbola."""
    position = curve.Position()
    x, y = point(position.XDirection()), point(position.YDirection())
    if isinstance(curve, (occt().Geom_Circle, occt().Geom2d_Circle)):
        major = minor = curve.Radius()
    else:
        major, minor = curve.MajorRadius(), curve.MinorRadius()
    return point(position.Location()), major * x, minor * y, 0.5 * (major + minor)


def profile(curve: Any, low: float, high: float, *, cut: bool) -> tuple[Spline, Direction, float]:
    """A curve of OCCT, in space or in the plane, from one of its parameters to another.

    Parameters
    ----------
    curve
        Geom_Curve or Geom2d_Curve.
    low, high
        OCCT's parameters.
    cut : bool
        End exactly there. Otherwise splines are left whole and other curves reach a little beyond.

    Returns
    -------
    spline, map, deviation
        The map leads from OCCT's parameters to the spline's; the deviation is zero for what is exact.
    """
    o = occt()
    # Most of those that are no lines.
    if isinstance(curve, (o.Geom_BSplineCurve, o.Geom2d_BSplineCurve)):
        return _bspline(_cut_spline(curve, low, high) if cut else _open_spline(curve)), Straight(False), 0.0
    if isinstance(curve, (o.Geom_TrimmedCurve, o.Geom2d_TrimmedCurve)):
        return profile(curve.BasisCurve(), low, high, cut=cut)
    slack = 0.0 if cut else SLACK * (high - low)
    if isinstance(curve, (o.Geom_Line, o.Geom2d_Line)):
        ends = np.array([low - slack, high + slack])
        place = curve.Position()
        along = place.Direction()
        return (
            spline(point(place.Location()) + ends[:, None] * point(along), np.repeat(ends, 2), 1),
            Straight(True),
            0.0,
        )
    if isinstance(curve, (o.Geom_Circle, o.Geom2d_Circle, o.Geom_Ellipse, o.Geom2d_Ellipse)):
        center, x, y, radius = _conic_axes(curve)
        turning = Turning.between(low, high, radius) if cut else Turning.over(low, high, radius)
        ring = arc(turning)
        flat = ring.points
        space = flat[:, :1] * x + flat[:, 1:2] * y + flat[:, 2:] * center
        return Spline(np.column_stack([space, flat[:, 2]]), ring.knots, 2), turning, 0.0
    if isinstance(curve, (o.Geom_BezierCurve, o.Geom2d_BezierCurve)):
        if cut and (low > 1e-12 or high < 1.0 - 1e-12):
            # A cut Bezier curve runs over [0, 1] again.
            part = curve.Copy()
            part.Segment(low, high)
            made = _bspline(part)
            return Spline(made.points, low + (high - low) * made.knots, made.degree), Straight(False), 0.0
        return _bspline(curve), Straight(False), 0.0
    if isinstance(curve, (o.Geom_Parabola, o.Geom2d_Parabola)):
        # P(t) = origin + t^2 / (4 focal) x + t y; its blossom at both ends is the middle control point.
        place, a, b = curve.Position(), low - slack, high + slack
        squares, ways = np.array([a * a, a * b, b * b]), np.array([a, 0.5 * (a + b), b])
        x, y = point(place.XDirection()) / (4.0 * curve.Focal()), point(place.YDirection())
        net = point(place.Location()) + squares[:, None] * x + ways[:, None] * y
        return spline(net, np.repeat([a, b], 3), 2), Straight(True), 0.0
    # Hyperbolas, offsets: nothing but their smoothness is used.
    values = values_of(curve)
    size = max(1e-300, float(np.abs(np.subtract(*values(np.array([low, high])))).max()))
    made, error = approximated(values, np.linspace(low, high, 9), 1e-9 * size)
    return made, Straight(False), error


def values_of(curve: Any) -> Callable[[Array], Array]:
    """Points of any curve of OCCT at its parameters: of a hyperbola without asking for each."""
    if isinstance(curve, (occt().Geom_Hyperbola, occt().Geom2d_Hyperbola)):
        center, x, y, _ = _conic_axes(curve)
        return lambda t: center + np.cosh(t)[:, None] * x + np.sinh(t)[:, None] * y
    return lambda t: np.array([curve.Value(each).Coord() for each in t.tolist()])
