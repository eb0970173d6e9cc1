"""Which turn an angle is on when a solve starts: angles go on past a whole turn, poses do not tell how often.

A driven angle starts on the turn of its value, one that is coupled to a driven freedom on the turn that the coupling
asks for. Other coupled angles keep, in a warm start, the turn they have; otherwise they too are on the turn of their
coupling, where the other side is known, within its limits. What is left is looked for within its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.constraint import Coordinate, Equation

__all__ = ["Turns"]

Array = NDArray[np.float64]
Evaluate = Callable[[Coordinate, float], float]


class Turns:
    """The angles of a scene, in the order of their tracked values.

    Parameters
    ----------
    angles : sequence of Coordinate
    equations : sequence of (Equation, int)
        All rows, and where the value of each is in the pool.
    """

    def __init__(self, angles: Sequence[Coordinate], equations: Sequence[tuple[Equation, int]]) -> None:
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
        self._driven = [(k, drive) for k, drive in enumerate(self._drives) if drive is not None]
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

    @property
    def coupled(self) -> bool:
        """Whether an angle is on a turn that another one tells."""
        return bool(self._couplings)

    def follow_drives(self, pool: Array, near: Array) -> None:
        """Driven angles near their values; all there is to do in a warm start without couplings."""
        for k, drive in self._driven:
            near[k] = pool[drive]

    def start(self, pool: Array, near: Array, warm: bool, evaluate: Evaluate) -> None:
        """Write where each angle is looked for into `near`, which has the values found last of a warm start.

        `evaluate` gives the value of a coordinate at the start, an angle nearest to a number.
        """
        known, angles = [True] * len(near), list(self._places)
        for k, drive in enumerate(self._drives):
            if drive is not None:
                near[k] = pool[drive]
            elif not warm or self._led[k]:
                known[k] = not self._coupled[k]
                near[k] = self._within_limits(angles[k]) if not warm else near[k]
        while not all(known):
            if not any(self._follow(equation, near, known, evaluate) for equation in self._couplings):
                # Nothing tells: it is where its limits are.
                known[known.index(False)] = True

    def _range(self, coordinate: Coordinate) -> tuple[float, float]:
        limits = self._limits.get(coordinate, [])
        lower = max((e.current() for e in limits if e.terms[0][0] > 0.0), default=-inf)
        return lower, min((-e.current() for e in limits if e.terms[0][0] < 0.0), default=inf)

    def _within_limits(self, angle: Coordinate) -> float:
        lower, upper = self._range(angle)
        if upper - lower < 2.0 * pi:
            return 0.5 * (lower + upper)
        # Angles are found within pi of this: all of them are within the limits.
        return min(max(0.0, lower + pi), upper - pi)

    def _follow(self, equation: Equation, near: Array, known: list[bool], evaluate: Evaluate) -> bool:
        """Find the turn of one side of a coupling from the other; whether there was one to find."""
        for (factor, this), (other_factor, other) in (equation.terms, equation.terms[::-1]):
            k = self._places.get(this)
            j = self._places.get(other)
            if k is not None and not known[k] and (j is None or known[j]):
                target = self._targets.get(other)
                if target is not None:
                    value = target.current()
                else:
                    value = evaluate(other, 0.0 if j is None else float(near[j]))
                    lower, upper = self._range(other)
                    value = min(max(value, lower), upper)
                near[k] = (equation.current() - other_factor * value) / factor
                known[k] = True
                return True
        return False
