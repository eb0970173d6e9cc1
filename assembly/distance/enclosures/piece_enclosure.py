"""Convex sets around a piece of a curve, for display: those of the search of `distance/enclosures/queries.py`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.distance.enclosures import enclosure as e
from assembly.distance.enclosures.queries import BOUNDS, Bound, Operand, packed_operand
from assembly.errors import InputError, number, real_array
from assembly.geometry.splines import bezier_ranges
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.formula_curve import FormulaCurve

__all__ = ["Enclosure", "enclosure"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Enclosure(ReadOnlyArrays):
    """Convex sets that hold the piece of a curve over an interval, rounding included.

    Attributes
    ----------
    interval : (float, float)
    ends : (2, d)
        The curve's points there: the foci of the ellipsoid.
    length : float
        Length u of the ellipsoid |x - ends[0]| + |x - ends[1]| <= u, and a bound of the length of arc.
    width : float
        u^2 - |chord|^2 without its cancellation: the square of the ellipsoid's short axes.
    radius : float
        Of the capsule around the chord.
    """

    interval: tuple[float, float]
    ends: Array
    length: float
    width: float
    radius: float
    _record: Array = field(repr=False)

    def support(self, directions: ArrayLike, bound: Bound = "auto") -> Array:
        """Upper bounds of n.C over the piece for directions n (k, d), which are made unit vectors."""
        n = real_array("directions", directions, ("k", self.ends.shape[1]))
        size = np.linalg.norm(n, axis=1)
        if not (size > 0.0).all():
            raise InputError("directions has a zero row; expected directions")
        if not isinstance(bound, str) or bound not in BOUNDS:
            raise InputError(f"bound is {bound!r}; expected one of {', '.join(BOUNDS)}")
        rows = np.zeros((len(n), 3))
        rows[:, : n.shape[1]] = n / size[:, None]
        out = np.empty(len(n))
        e.supports(self._record, rows, BOUNDS[bound], out)
        return out


def enclosure(curve: FormulaCurve | NurbsCurve, t0: float, t1: float) -> Enclosure:
    """The convex sets around a curve over [t0, t1].

    Raises
    ------
    InputError, TypeError
        No curve, or an interval outside the domain or, of a spline, across a knot.
    """
    if not isinstance(curve, (FormulaCurve, NurbsCurve)):
        raise TypeError(f"curve is {curve!r}; expected a FormulaCurve or a NurbsCurve")
    first, last = number("t0", t0), number("t1", t1)
    low, high = curve.domain
    if not low <= first < last <= high:
        raise InputError(f"t0, t1 are {first:g}, {last:g}; expected t0 < t1 in the domain [{low:g}, {high:g}]")
    operand = packed_operand("curve", curve)
    part, s0, s1 = _local(operand, first, last)
    record = np.zeros(e.PIECE)
    e.enclose(operand.kind, operand.table, operand.pool, np.empty(operand.workspace), part, s0, s1, record)
    d = operand.dimension
    return Enclosure(
        interval=(first, last),
        ends=record[e.P0 : e.P0 + 6].reshape(2, 3)[:, :d].copy(),
        length=float(record[e.LENGTH] * (1.0 + 1e-15) + 2.0 * record[e.OFF]),
        width=float(record[e.WIDE]),
        radius=float(record[e.RADIUS]),
        _record=record,
    )


def _local(operand: Operand, first: float, last: float) -> tuple[int, float, float]:
    """The smooth part of an interval, and its ends there."""
    if operand.kind == e.FORMULA:
        return 0, first, last
    o = int(operand.table[bezier_ranges.BREAKS])
    breaks = operand.pool[o : o + operand.parts + 1]
    part = int(np.clip(np.searchsorted(breaks, first, side="right") - 1, 0, operand.parts - 1))
    low, high = breaks[part : part + 2]
    if last > high:
        raise InputError(
            f"t0, t1 are {first:g}, {last:g}, across the knot {high:g}; expected an interval within a span"
        )
    return part, float((first - low) / (high - low)), float((last - low) / (high - low))
