"""What happens along a step of a branch, and where exactly.

Events are zeros of functions of the length along the step. For contacts that clearances keep open these are gaps of
what is listed at the step's beginning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi, remainder, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from assembly.kinematics.pose import retract
from assembly.studies.branches.curve import Curve, LostError, Place, Point
from assembly.studies.branches.slots import Meeting, features_of
from assembly.studies.branches.surroundings import AT_BOUND, Surroundings

__all__ = ["Found", "Step", "closing"]

Array = NDArray[np.float64]
# Lengths along a branch are found to this; where features change, to this part of the step.
EXACT, EDGE = 1e-15, 1e-13
# A crossing is interpolated between so many points about it, within this part of the step to either side.
POINTS, ABOUT = 8, 0.3
# Points of a branch that are the same one.
SAME = 1e-7
# The zero of a gap that is listed anew is approached by so many secants: errors below 1e-3 are squared by each.
MOST_SECANTS = 4
# Slopes of gaps are central differences over twice this length.
NEARBY = 1e-6
# What is said to fall to less than this part of what it is at a step's ends is looked at there.
DOUBTFUL = 0.25
# Rates along a branch that are none.
STILL = 1e-9
# A contact comes to so many other features within a step, at most.
MOST_FEATURES = 8


class NotFoundError(Exception):
    """No point was found within a step: a shorter one may tell."""


@dataclass(frozen=True, eq=False)
class Found:
    """An event: what kind, the row or the name that it is of, how far along the step, where, and which bodies meet."""

    kind: str
    row: int
    along: float
    place: Place
    point: Point | None
    ends: bool = False
    meets: Meeting | None = None


class Step:
    """A step along a branch, from a point to the one after it, and the points between.

    Parameters
    ----------
    curve : Curve
    here, there : Point
    length : float
    ends : (float, float)
        Of the range of the parameter.
    around : Surroundings, optional
        Of a scene with clearances: what is around the point.
    """

    def __init__(
        self,
        curve: Curve,
        here: Point,
        there: Point,
        length: float,
        ends: tuple[float, float],
        around: Surroundings | None = None,
    ) -> None:
        self.curve, self.here, self.there, self.length, self.ends = curve, here, there, length, ends
        self.around = around

    def at(self, along: float) -> Point:
        """The point in the plane across the step's beginning at a part of its length."""
        if along == self.length:
            return self.there
        point = self.curve.corrected(self.here, along * self.here.tangent)
        if point is None:
            raise NotFoundError
        return point

    def events(self) -> list[Found]:
        """The events of the step, in order; none after one that ends the branch, or changes which rows hold."""
        found = [*self._at_ends(), *self._of_rows(), *self._of_features(), *self._turning(), *self._crossing()]
        if self.around is not None:
            found += self._of_gaps(self.around)
        found.sort(key=lambda event: event.along)
        for k, event in enumerate(found):
            if event.ends:
                return found[: k + 1]
        return found

    def _root(self, value: Callable[[Point], float]) -> tuple[float, Point]:
        """Where a value that has another sign at the end of the step is zero; its beginning, where it has not."""
        if value(self.here) * value(self.there) >= 0.0:
            return 0.0, self.here
        last: dict[float, Point] = {0.0: self.here}

        def at(along: float) -> float:
            last[along] = last.get(along) or self.at(along)
            return value(last[along])

        along = float(brentq(at, 0.0, self.length, xtol=EXACT, rtol=4.0 * np.finfo(float).eps))
        return along, last.get(along) or self.at(along)

    def _event(self, kind: str, row: int, value: Callable[[Point], float], ends: bool = False) -> Found:
        along, point = self._root(value)
        return Found(kind, row, along, point.place, point, ends)

    def _at_ends(self) -> list[Found]:
        """Where the parameter leaves its range."""
        low, high = self.ends
        value, rate = self.there.place.value, self.there.tangent[-1]
        if value == (high if rate > 0.0 else low):
            return [Found("end of range", -1, self.length, self.there.place, self.there, True)]
        end = high if value > high else low if value < low else None
        if end is None:
            return []
        bound = end
        event = self._event("end of range", -1, lambda point: point.place.value - bound, True)
        # The value is the end of the range, and not a rounding beside it.
        return [replace(event, place=replace(event.place, value=bound))]

    def _turning(self) -> list[Found]:
        """Where the parameter turns back."""
        if self.here.tangent[-1] * self.there.tangent[-1] < 0.0:
            return [self._event("turning point", -1, lambda point: float(point.tangent[-1]))]
        return []

    def _of_rows(self) -> list[Found]:
        """One-sided rows that reach their bounds, and that push no more.

        Raises
        ------
        NotFoundError
            One does and ceases to within the step: a shorter one tells where.
        """
        packed, held, here, there = self.here.place.packed, self.curve.held, self.here, self.there
        found = []
        for row in np.flatnonzero(packed.one_sided).tolist():
            is_contact = packed.pairs[row] >= 0
            if held[row]:
                values = -np.array([point.place.forces[row] for point in (here, there)])
                rates = -np.array([point.force_rates[row] for point in (here, there)])
                kind, value, least = "contact opened" if is_contact else "limit left", _force(row), 0.0
            else:
                values = np.array([point.residual[row] for point in (here, there)])
                rates = np.array([point.rates[row] for point in (here, there)])
                kind, value, least = (
                    "contact closed" if is_contact else "limit reached",
                    _gap(row),
                    self.curve.tolerance,
                )
            self._check_between(values, rates, value, -1.0 if held[row] else 1.0)
            if values[1] < -least <= values[0]:
                found.append(self._event(kind, row, value, True))
        return found

    def _of_gaps(self, around: Surroundings) -> list[Found]:
        """Contacts that clearances keep open, where they close."""
        try:
            before, after = around.gaps(self.here.place), around.gaps(self.there.place)
        except LostError:
            raise NotFoundError from None
        least, found = self.curve.tolerance, []
        for row in np.flatnonzero(~self.curve.held & (after < -least) & (before >= -least)).tolist():
            if before[row] <= 0.0 and self._slopes(around, self.here)[row] > STILL:
                raise NotFoundError
            event = self._event("contact closed", row, _listed_gap(around, row), True)
            if abs(around.gaps(event.place)[row]) > AT_BOUND:
                # It ended, and another one is nearer: a shorter step lists that.
                raise NotFoundError
            found.append(self._closed_anew(around, replace(event, meets=around.meeting(event.place, row))))
        near = ~self.curve.held & (np.minimum(before, after) >= -least) & (np.minimum(before, after) < self.length)
        near &= np.isfinite(before) & np.isfinite(after)
        if near.any():
            slopes = [self._slopes(around, point) for point in (self.here, self.there)]
            for row in np.flatnonzero(near).tolist():
                values, rates = np.array([before[row], after[row]]), np.array([each[row] for each in slopes])
                self._check_between(values, rates, _listed_gap(around, row), 1.0)
        return found

    def _slopes(self, around: Surroundings, point: Point) -> Array:
        """What listed gaps (m,) grow by along a point's tangent; NaN where that is not known."""
        try:
            gaps = [around.gaps(self.curve.ahead(point, along)) for along in (-NEARBY, NEARBY)]
        except LostError:
            raise NotFoundError from None
        with np.errstate(invalid="ignore"):
            slopes: Array = (gaps[1] - gaps[0]) / (2.0 * NEARBY)
        return slopes

    def _check_between(self, values: Array, rates: Array, value: Callable[[Point], float], sign: float) -> None:
        """Raise where what may not be negative, a value times a sign, is zero twice in the step.

        At its beginning, from where it grows; or about where the cubic with values and rates at both ends is least.
        """
        (before, after), (first, last) = values.tolist(), (self.length * rates).tolist()
        if after < 0.0:
            if before <= 0.0 and rates[0] > STILL:
                raise NotFoundError
            return
        if not first < 0.0 < last:
            return
        # In parts of the step, 3 a s^2 + 2 b s + first is zero where the cubic is least.
        a, b = first + last - 2.0 * (after - before), 3.0 * (after - before) - 2.0 * first - last
        root = sqrt(max(b * b - 3.0 * a * first, 0.0))
        s = -first / (b + root) if b > 0.0 else (root - b) / (3.0 * a)
        least = before + s * (first + s * (b + s * a))
        if least < DOUBTFUL * max(before, after) and sign * value(self.at(s * self.length)) < -AT_BOUND:
            raise NotFoundError

    def _closed_anew(self, around: Surroundings, event: Found) -> Found:
        """An event of a contact that closes, its zero that of gaps that are listed anew.

        Where bodies touch all along a circle a contact stays at its points as they move, so that along a step its gap
        is off by the square of the way.
        """
        found, start, before = event, 0.0, around.gaps(self.here.place)[event.row]
        gap, _ = around.anew(event.place, event.row)
        for _ in range(MOST_SECANTS):
            if not EXACT < abs(gap) < np.inf or before == gap:
                break
            along = found.along - gap * (found.along - start) / (gap - before)
            if not 0.0 < along < self.length:
                break
            start, before, point = found.along, gap, self.at(along)
            gap, meets = around.anew(point.place, event.row)
            found = replace(found, along=along, place=point.place, point=point, meets=meets)
        return found if abs(gap) <= AT_BOUND else event

    def _of_features(self) -> list[Found]:
        """Where contacts that hold come to another face, edge or vertex."""
        packed, found = self.here.place.packed, []
        for row in np.flatnonzero(self.curve.held & (packed.pairs >= 0)).tolist():
            now, last = (features_of(packed, point.place.state, row) for point in (self.here, self.there))
            along = 0.0
            for _ in range(MOST_FEATURES):
                if now == last:
                    break
                along, point = self._leaves(row, now, along)
                found.append(Found("contact over an edge", row, along, point.place, point))
                now = features_of(packed, point.place.state, row)
        return found

    def _leaves(self, row: int, features: tuple[float, ...], low: float) -> tuple[float, Point]:
        """Where the contact of a row leaves features that it is on up to a length, by halving."""
        packed, high, found = self.here.place.packed, self.length, self.there
        while high - low > max(EXACT, EDGE * self.length):
            middle = 0.5 * (low + high)
            point = self.at(middle)
            if features_of(packed, point.place.state, row) == features:
                low = middle
            else:
                high, found = middle, point
        return high, found

    def _crossing(self) -> list[Found]:
        """Where another branch crosses: the bordered determinant changes its sign.

        At the crossing itself rows have no one direction, and a corrector no step. The branch goes through it smoothly:
        determinant and poses are interpolated between points about it.
        """
        if not self.here.determinant * self.there.determinant < 0.0:
            return []
        middle = float(brentq(lambda s: self.at(s).determinant, 0.0, self.length, xtol=1e-3 * self.length, rtol=1e-3))
        nodes = np.cos(pi * (np.arange(POINTS) + 0.5) / POINTS)
        part = ABOUT * self.length
        points = [self.at(middle + part * node) for node in nodes.tolist()]
        values = np.polynomial.chebyshev.chebfit(nodes, [point.determinant for point in points], POINTS - 1)
        roots = np.polynomial.chebyshev.chebroots(values)
        real = roots[np.abs(roots.imag) < 1e-6].real
        if not real.size:
            raise NotFoundError
        root = float(real[np.abs(real).argmin()])
        near = points[int(np.abs(nodes - root).argmin())].place
        told = [np.append(self.curve.between(near, point.place), point.place.value) for point in points]
        series = np.polynomial.chebyshev.chebfit(nodes, np.array(told), POINTS - 1)
        there = np.array(np.polynomial.chebyshev.chebval(root, series))
        state, curve = near.state.copy(), self.curve
        q = state[: near.packed.contacts_at].reshape(-1, 7)
        steps = there[:-1].reshape(-1, 6) * np.repeat([curve.scale, 1.0], 3)
        q[curve.moving] = retract(q[curve.moving], steps)
        return [
            Found("crossing", -1, middle + part * root, Place(near.packed, state, float(there[-1]), near.forces), None)
        ]


def _force(row: int) -> Callable[[Point], float]:
    """The multiplier of a row at a point."""
    return lambda point: float(point.place.forces[row])


def _gap(row: int) -> Callable[[Point], float]:
    """The residual of a row at a point."""
    return lambda point: float(point.residual[row])


def _listed_gap(around: Surroundings, row: int) -> Callable[[Point], float]:
    """By how much a listed contact is open at a point."""

    def gap(point: Point) -> float:
        try:
            return float(around.gaps(point.place)[row])
        except LostError:
            raise NotFoundError from None

    return gap


def closing(step: Step, start: Point, is_angle: bool) -> tuple[Found, float] | None:
    """Where a step comes back to the start of the branch, if it does, and how far from it; an angle by whole turns."""
    curve = step.curve
    border = curve.bordering(start.tangent)

    def gap(point: Point) -> Array:
        apart = (point.place.value - start.place.value) / curve.unit
        apart = remainder(apart, 2.0 * pi) if is_angle else apart
        gap = np.zeros(len(start.tangent))
        gap[: curve.columns.size], gap[-1] = curve.between(start.place, point.place), apart
        return gap

    if len(border) != len(step.here.tangent):
        return None
    before, after = gap(step.here), gap(step.there)
    if not border @ before < 0.0 <= border @ after or np.linalg.norm(before) > 2.0 * step.length:
        return None
    along, point = step._root(lambda point: float(border @ gap(point)))
    off = float(np.linalg.norm(gap(point)))
    if off > SAME or border @ point.tangent < 0.0:
        return None
    return Found("closed loop", -1, along, point.place, point, True), off
