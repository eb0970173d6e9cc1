"""Loop: a closed chain of plane curves in the parameters (u, v) of a surface.

On a surface that is closed in u or v a loop lives in the unrolled plane: its coordinates may run beyond the domain,
and it may come back one period away from where it began, as once around a cylinder.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays, read_only
from assembly.errors import InputError, items, number, vector
from assembly.geometry.faces.trim_table import build
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_packing import signed_area

__all__ = ["Loop"]

Array = NDArray[np.float64]
# Curves that end this part of the loop's size from where the next one begins are joined.
TOLERANCE = 1e-9
# Curves smaller than this part of the loop's size are left out.
NO_LENGTH = 1e-12
# What rounding may make of an area, as a part of the size's square, for loops of up to thousands of corners.
_ROUNDING = 1e-9
_NO_TURN = read_only(np.zeros(2))


def _checked_period(value: Sequence[float]) -> tuple[float, float]:
    u, v = vector("period", value, 2).tolist()
    if min(u, v) < 0.0:
        raise InputError(f"period is [{u:g}, {v:g}]; expected lengths in u and v, zero where the surface is not closed")
    return u, v


def curve_ends(curve: NurbsCurve) -> Array:
    """First and last point of a curve, (2, d)."""
    if curve._is_clamped:
        return curve.control_points[[0, -1]]
    pieces = curve.bezier_pieces()
    ends = np.array([pieces[0, 0], pieces[-1, -1]])
    return np.asarray(ends[:, :-1] / ends[:, -1:])


def all_ends(curves: Sequence[NurbsCurve]) -> Array:
    """First and last points of curves, (n, 2, d)."""
    if all(len(curve.control_points) == 2 and curve._is_clamped for curve in curves):
        return np.array([curve.control_points for curve in curves])
    return np.array([curve_ends(curve) for curve in curves])


def _largest_side(curve: NurbsCurve) -> float:
    """The larger side of the box around a plane curve's control points."""
    if len(curve.control_points) == 2:
        (u, v), (x, y) = curve.control_points.tolist()
        return float(max(abs(u - x), abs(v - y)))
    return float(np.ptp(curve.control_points, axis=0).max())


def _clamped(curve: NurbsCurve) -> NurbsCurve:
    """The same curve with its first and last control point at its ends."""
    return curve if curve._is_clamped else curve.elevate(curve.degree)


def with_ends(curve: NurbsCurve, start: Array, end: Array) -> NurbsCurve:
    """A curve whose ends are moved a little."""
    points = curve.control_points.copy()
    points[0], points[-1] = start, end
    return NurbsCurve(points, curve.knots, curve.degree, curve.weights, name=curve.name)


def moved(curve: NurbsCurve, shift: Array) -> NurbsCurve:
    """A plane curve moved by a vector."""
    if not shift.any():
        return curve
    return NurbsCurve(curve.control_points + shift, curve.knots, curve.degree, curve.weights, name=curve.name)


class Loop(ReadOnlyArrays):
    """A closed chain of curves in (u, v), head to tail.

    Parameters
    ----------
    curves : NurbsCurve or several
        Plane curves; each begins where the one before it ends.
    tolerance : float
        Gaps up to this part of the loop's size are closed, by moving both ends to their middle.
    period : (float, float), optional
        Periods of u and v, 0 where the surface is not closed; curves are then moved by whole periods to where
        the one before them ends. A face gives the periods of its surface.

    Attributes
    ----------
    curves : tuple of NurbsCurve
        Joined exactly.
    turn : (2,) array
        From the loop's start to its end: zero, or a period in u or in v for a loop around the surface.

    Raises
    ------
    InputError
        A curve that is not plane, a gap between two curves, with its size, or curves that cross or touch.
    """

    def __init__(
        self,
        curves: NurbsCurve | Iterable[NurbsCurve],
        *,
        tolerance: float = TOLERANCE,
        period: Sequence[float] | None = None,
    ) -> None:
        self._make(curves, tolerance, None if period is None else _checked_period(period), "loop")
        (u, v), (x, y) = self._box()
        # In the unrolled plane: seams meet one period away, and whether anything else does is for a face to see.
        chain = range(len(self.curves))
        table = build(self.curves, (chain,), (not self.turn.any(),), (), ((u, x), (v, y)), (0.0, 0.0))
        found = table.crossing(TOLERANCE)
        if found is not None:
            u, v = found[2]
            raise InputError(
                f"loop crosses or touches itself near (u, v) = ({u:.6g}, {v:.6g}); expected a loop without crossings"
            )

    @classmethod
    def unchecked(
        cls, curves: NurbsCurve | Iterable[NurbsCurve], tolerance: float, period: tuple[float, float] | None, name: str
    ) -> Loop:
        """A loop by its name in messages; whether it crosses itself is looked at later, with all loops of a face."""
        loop = object.__new__(cls)
        loop._make(curves, tolerance, period, name)
        return loop

    @classmethod
    def known(cls, curves: tuple[NurbsCurve, ...], size: float) -> Loop:
        """A loop of a size whose curves meet exactly, on a surface that is open both ways."""
        loop = object.__new__(cls)
        loop.curves, loop.size, loop.turn = curves, size, _NO_TURN
        loop.tolerance, loop.period = TOLERANCE, (0.0, 0.0)
        return loop

    def _make(
        self, curves: NurbsCurve | Iterable[NurbsCurve], tolerance: float, period: tuple[float, float] | None, name: str
    ) -> None:
        parts = [curves] if isinstance(curves, NurbsCurve) else items(name, curves, "one NurbsCurve or several")
        if not parts:
            raise InputError(f"{name} is empty; expected at least one curve")
        for k, curve in enumerate(parts):
            if not isinstance(curve, NurbsCurve):
                raise TypeError(f"{name}[{k}] is {curve!r}; expected a NurbsCurve")
            if curve.control_points.shape[1] != 2:
                raise InputError(f"{name}[{k}] is a curve in space; expected a plane curve in (u, v)")
        self.tolerance = number("tolerance", tolerance)
        self.period = (0.0, 0.0) if period is None else period
        self.curves = tuple(parts)
        low, high = self._box()
        self.size = float(np.linalg.norm(high - low))
        if not self.size > 0.0:
            raise InputError(f"{name} is a single point; expected a loop")
        # Files have edges of no length where something else was once; they have no direction.
        parts = [c for c in parts if _largest_side(c) > NO_LENGTH * self.size]
        self._join([_clamped(curve) for curve in parts], period is not None, name)

    def _join(self, parts: list[NurbsCurve], known: bool, name: str) -> None:
        ends = all_ends(parts)
        if (ends[1:, 0] == ends[:-1, 1]).all() and (ends[0, 0] == ends[-1, 1]).all():
            self.curves, self.turn = tuple(parts), read_only(np.zeros(2))
            return
        allowed = self.tolerance * self.size
        periods = np.array(self.period)
        whole = np.where(periods > 0.0, periods, 1.0)
        gaps = ends[1:, 0] - ends[:-1, 1]
        jumps = np.where(periods > 0.0, np.round(gaps / whole) * periods, 0.0)
        lengths = np.linalg.norm(gaps - jumps, axis=1)
        if (lengths > allowed).any():
            k = int(np.argmax(lengths > allowed))
            raise InputError(
                f"{name} is open: a gap of {lengths[k]:.3g} between curves {k} and {k + 1}; "
                f"expected curves that meet within {allowed:.3g}"
            )
        if jumps.any():
            shifts = np.concatenate([np.zeros((1, 2)), -np.cumsum(jumps, axis=0)])
            parts = [moved(curve, shift) for curve, shift in zip(parts, shifts, strict=True)]
            ends = ends + shifts[:, None]
        turn = ends[-1, 1] - ends[0, 0]
        snapped = np.where(periods > 0.0, np.round(turn / whole) * periods, 0.0)
        if known and np.abs(snapped / whole).sum() > 1.0:
            raise InputError(f"{name} turns {(snapped / whole).tolist()} times around; expected at most once")
        if not known:
            # Only a face knows its periods: what may be one is left to it.
            snapped = np.where(np.abs(turn) > allowed, turn, 0.0)
            if np.count_nonzero(snapped) == 2:
                snapped = np.zeros(2)
        length = float(np.linalg.norm(turn - snapped))
        if length > allowed:
            raise InputError(
                f"{name} is open: a gap of {length:.3g} between its end and its start; "
                f"expected curves that meet within {allowed:.3g}"
            )
        # Corner k is where curve k begins.
        before = np.roll(ends[:, 1], 1, axis=0)
        before[0] -= snapped
        exact = ends[:, 0] == before
        # A turn is exact if either end follows from the other, so that to join once more moves nothing.
        turns = (turn == snapped) | (ends[0, 0] + snapped == ends[-1, 1])
        exact[0] |= turns
        corners = np.where(exact, ends[:, 0], 0.5 * (before + ends[:, 0]))
        after = np.roll(corners, -1, axis=0)
        after[-1] = np.where(turns, ends[-1, 1], corners[0] + snapped)
        differs = (ends[:, 0] != corners).any(axis=1) | (ends[:, 1] != after).any(axis=1)
        for k in np.flatnonzero(differs).tolist():
            parts[k] = with_ends(parts[k], corners[k], after[k])
        self.curves = tuple(parts)
        self.turn = read_only(snapped)

    def _box(self) -> tuple[Array, Array]:
        points = np.concatenate([curve.control_points for curve in self.curves])
        return points.min(axis=0), points.max(axis=0)

    def __repr__(self) -> str:
        around = f", turning by {self.turn.tolist()}" if self.turn.any() else ""
        return f"Loop({len(self.curves)} curves{around})"

    @property
    def area(self) -> float:
        """Signed area, positive counterclockwise; of a loop that turns, of no meaning."""
        return signed_area(self.curves)

    @property
    def is_clockwise(self) -> bool:
        """Whether its signed area is negative."""
        if all(len(curve.control_points) == 2 for curve in self.curves):
            # Cross products of corners, relative to the first one. Where rounding might decide the whole area is asked.
            rows = [curve.control_points[0].tolist() for curve in self.curves]
            (u, v), area = rows[0], 0.0
            for (a, b), (c, d) in pairwise(rows):
                area += (a - u) * (d - v) - (b - v) * (c - u)
            if abs(area) > _ROUNDING * self.size**2:
                return area < 0.0
        return self.area < 0.0

    def reversed(self) -> Loop:
        """The same loop run the other way round."""
        turned = object.__new__(Loop)
        turned.tolerance, turned.period, turned.size = self.tolerance, self.period, self.size
        turned.curves = tuple(curve.reversed() for curve in self.curves[::-1])
        turned.turn = read_only(-self.turn)
        return turned
