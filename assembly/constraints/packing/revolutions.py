"""Revolution counts of angles at the start of a solve: poses do not tell how often an angle has gone around.

A driven angle starts on the turn of its value, one that is coupled to a driven coordinate on the turn that the coupling
asks for. Other coupled angles keep, in a warm start, the turn they have; otherwise they too are on the turn of their
coupling, where the other side is known. What is left takes, with all that couplings move with it, the turn whose
angles are least beyond their limits, and of several the one next to where the angle was, zero at first. An angle that
is beyond a stop by a little is at that stop, and not a turn farther within the limits: a stop that is touched is passed
by rounding half of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Coordinate, Equation

__all__ = ["Turns"]

Array = NDArray[np.float64]
# An angle beyond a stop by no more than this is at the stop.
AT_STOP = 1e-2
# Turns as near as each other by this, half a turn either way, are told apart by how near a stop is.
SAME = 1e-9
# Turns of an angle that are tried where couplings tell those of others from it, either way.
MOST_TURNS = 8


class _Turn(NamedTuple):
    """A turn of an angle, and what follows from it."""

    near: Array
    known: list[bool]
    beyond: float  # how far angles are beyond their limits, none of them by a little
    away: float  # how far the angle is from where it was
    from_stop: float

    def is_better(self, other: _Turn) -> bool:
        """Whether less is beyond limits, or as much and the angle nearer to where it was, or to a stop."""
        if abs(self.beyond - other.beyond) > SAME:
            return self.beyond < other.beyond
        if abs(self.away - other.away) > SAME:
            return self.away < other.away
        return self.from_stop < other.from_stop


@dataclass(frozen=True)
class _Values:
    """Values of coordinates at a start."""

    known: Mapping[Coordinate, float]

    def of(self, coordinate: Coordinate, near: float) -> float:
        """The value of a coordinate, of an angle on the turn nearest to a number."""
        value = self.known[coordinate]
        return value + 2.0 * pi * round((near - value) / (2.0 * pi)) if coordinate.is_angle else value


class Turns:
    """The angles of a scene, in the order of their tracked values.

    Parameters
    ----------
    angles : sequence of Coordinate
    equations : sequence of (Equation, int)
        All rows, and where the value of each is in the pool.
    """

    def __init__(self, angles: Sequence[Coordinate], equations: Sequence[tuple[Equation, int]]) -> None:
        self._angles = list(angles)
        self._places = {angle: k for k, angle in enumerate(angles)}
        self._drives: list[int | None] = [None] * len(angles)
        self._limits: dict[Coordinate, list[Equation]] = {}
        self._couplings = [equation for equation, _ in equations if len(equation.terms) > 1]
        for equation, at in equations:
            coordinate = equation.terms[0][1]
            if len(equation.terms) > 1:
                continue
            if equation.one_sided:
                self._limits.setdefault(coordinate, []).append(equation)
            elif coordinate in self._places:
                self._drives[self._places[coordinate]] = at
        # Driven angles, and where the pool has their values: near these, and that is all there is to do in a warm start
        # without couplings.
        self.driven = [(k, drive) for k, drive in enumerate(self._drives) if drive is not None]
        coupled = {coordinate for equation in self._couplings for _, coordinate in equation.terms}
        self._coupled = [angle in coupled for angle in angles]
        # Driven coordinates, slides too, and all that couplings move with them.
        self._targets = {
            equation.terms[0][1]: equation
            for equation, _ in equations
            if len(equation.terms) == 1 and not equation.one_sided and equation.source is not None
        }
        led = set(self._targets)
        for _ in self._couplings:
            for equation in self._couplings:
                sides = {coordinate for _, coordinate in equation.terms}
                if sides & led:
                    led |= sides
        self._led = [angle in led for angle in angles]
        # Coordinates whose values at a start tell turns.
        limited = [angle for angle in angles if angle in self._limits]
        told = [coordinate for equation in self._couplings for _, coordinate in equation.terms]
        self.told = list(dict.fromkeys([*limited, *told]))

    @property
    def coupled(self) -> bool:
        """Whether an angle is on a turn that another one tells."""
        return bool(self._couplings)

    @property
    def chosen(self) -> bool:
        """Whether the turn of an angle is told by its limits, or a coupling, and where bodies stand."""
        return bool(self._couplings) or any(angle in self._limits for angle in self._angles)

    def start(self, pool: Array, near: Array, warm: bool, measure: Callable[[], Array]) -> None:
        """Write where each angle is looked for into `near`, which has the values found last, zeros at first.

        `measure` gives the values of the coordinates `told` at the start, of angles on any turn.
        """
        known = [True] * len(near)
        for k, drive in enumerate(self._drives):
            if drive is not None:
                near[k] = pool[drive]
            elif not warm or self._led[k]:
                known[k] = False
        if all(known):
            return
        evaluate = _Values(dict(zip(self.told, measure().tolist(), strict=True)))
        self._follow_all(near, known, evaluate)
        while not all(known):
            unknown = [k for k, told in enumerate(known) if not told]
            # Of angles that are coupled one with limits tells more.
            root = next((k for k in unknown if self._angles[k] in self._limits), unknown[0])
            self._choose(root, near, known, evaluate)

    def _range(self, coordinate: Coordinate) -> tuple[float, float]:
        lower, upper = -inf, inf
        for limit in self._limits.get(coordinate, ()):
            if limit.terms[0][0] > 0.0:
                lower = max(lower, limit.current())
            else:
                upper = min(upper, -limit.current())
        return lower, upper

    def _choose(self, root: int, near: Array, known: list[bool], evaluate: _Values) -> None:
        """Find the turn of an angle, and of all that couplings move with it, by their limits."""
        angle = self._angles[root]
        known[root] = True
        if angle not in self._limits:
            # No angle that is coupled to it and not known has limits either.
            self._follow_all(near, known, evaluate)
            return
        value = evaluate.of(angle, float(near[root]))
        lower, upper = self._range(angle)
        within = lower - AT_STOP <= value <= upper + AT_STOP
        if within and not self._coupled[root] and abs(value - near[root]) < pi - SAME:
            # No other turn is as near.
            near[root] = value
            return
        before = float(near[root])
        first = round((min(max(value, lower), upper) - value) / (2.0 * pi))
        reach = MOST_TURNS if self._coupled[root] else 1
        turned = (value + 2.0 * pi * turn for turn in range(first - reach, first + reach + 1))
        best: _Turn | None = None
        for away, there in sorted((abs(there - before), there) for there in turned):
            if best is not None and best.beyond == 0.0 and away > best.away + SAME:
                break
            turn = self._turn(root, there, away, (near, known), evaluate)
            if best is None or turn.is_better(best):
                best = turn
        assert best is not None
        near[:], known[:] = best.near, best.known

    def _turn(self, root: int, there: float, away: float, before: tuple[Array, list[bool]], evaluate: _Values) -> _Turn:
        """What follows from an angle's value, where others were told before."""
        near, known = before[0].copy(), before[1].copy()
        near[root] = there
        self._follow_all(near, known, evaluate)
        beyond, from_stop = 0.0, inf
        for k in [root, *(k for k, now in enumerate(known) if now and not before[1][k])]:
            value = evaluate.of(self._angles[k], float(near[k]))
            lower, upper = self._range(self._angles[k])
            off = max(lower - value, value - upper)
            beyond += off if off > AT_STOP else 0.0
            from_stop = min(from_stop, abs(lower - value), abs(upper - value))
        return _Turn(near, known, beyond, away, from_stop)

    def _follow_all(self, near: Array, known: list[bool], evaluate: _Values) -> None:
        """Find the turns of all angles that couplings tell from what is known."""
        while not all(known) and any(self._follow(equation, near, known, evaluate) for equation in self._couplings):
            pass

    def _follow(self, equation: Equation, near: Array, known: list[bool], evaluate: _Values) -> bool:
        """Find the turn of one side of a coupling from the other; whether there was one to find."""
        for (factor, this), (other_factor, other) in (equation.terms, equation.terms[::-1]):
            k = self._places.get(this)
            j = self._places.get(other)
            if k is not None and not known[k] and (j is None or known[j]):
                target = self._targets.get(other)
                if target is not None:
                    value = target.current()
                else:
                    value = evaluate.of(other, 0.0 if j is None else float(near[j]))
                    lower, upper = self._range(other)
                    value = min(max(value, lower), upper)
                near[k] = (equation.current() - other_factor * value) / factor
                known[k] = True
                return True
        return False
