"""The least and the largest value of a measure over poses that hold, reached from a solution by short steps.

The measure is an objective, linear along some motions: a solve would step as far as it may, out of a hole and through
walls. So the proximal point method goes there: the measure and w |x - x_k|^2 from the pose x_k, with w such that the
step is no longer than a length where nothing shortens it. It rests at corners of what contacts, limits and clearances
allow, and at points of curved ones. From where it rests the measure alone is solved, which is exact.

That is a local answer. One-sided contacts have several corners, so other starts are tried as well: poses that are held
while all bodies are drawn a little aside, to either side, and the other end. The best is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf, isfinite, nan, pi
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Coordinate
from assembly.constraints.model.objectives import Objective, Posture
from assembly.derivatives.measure import Measure
from assembly.errors import InputError
from assembly.kinematics.pose import retract
from assembly.solve.attempts.starts import moving_rows
from assembly.solve.scene import Status
from assembly.solve.solution import Solution
from assembly.studies.fits.result import End, Play

if TYPE_CHECKING:
    from assembly.constraints.model.expression import Expression
    from assembly.studies.fits.measure_term import MeasureTerm

__all__ = ["play"]

Array = NDArray[np.float64]
# Angles that are tracked, past whole turns: poses do not tell these.
Turns = Mapping[Coordinate, float]
# In sizes of the scene: the first step, the longest one, and the gain of a step at which it rests, a slope of 0.003.
# Twice as long, and thin walls may be stepped through; half as long, and it takes more of them. Where nothing is in the
# way but limits, steps that nothing shortens grow.
_FIRST, _LONGEST, _REST = 0.01, 0.32, 1e-7
# Steps until the measure is solved for alone, whatever it does: by then it went 2 sizes, or 60 where steps grow.
_STEPS = 200
# A step that is not this part of the last one is shortened by something.
_FREE = 0.9
# Steps that fail are tried again at a quarter of the length, so often.
_SHORTER = 4
# [scene's size, rad] How far bodies are drawn aside for other starts, and in how many directions.
_ASIDE, _DIRECTIONS = 0.03, 1
# [rad] Angles are taken from near where they are: as far from there they are asked for anew. A joint without a stop
# that turned so often about is free to.
_NEAR, _TURNED = 2.0, 4.0 * pi


def play(scene: Assembly, solution: Solution, of: Measure) -> Play:
    """The range of a measure over all poses that one-sided contacts, clearances and limits allow.

    Joints, driven values and two-sided contacts are held; objectives of the scene do not count. Poses are reached from
    the solution, in short steps, so that a pin stays in its hole.

    Parameters
    ----------
    scene : Assembly
    solution : Solution
        A successful one of the scene.
    of : Measure
        A place, a distance, or a coordinate of a joint.

    Returns
    -------
    Play
        `least` and `most` with their poses; check `success`. An end that is unbounded is infinite.

    Raises
    ------
    InputError, TypeError
        A solution that failed or of another scene, a measure of another kind.
    """
    # With CasADi, which stacks without play do not need.
    from assembly.studies.fits.measure_term import MeasureTerm

    if not isinstance(of, Measure):
        raise TypeError(f"of is {of!r}; expected a Measure")
    if not isinstance(solution, Solution):
        raise TypeError(f"solution is {solution!r}; expected a Solution")
    if not solution.success:
        raise InputError(f"solution ended {solution.status.name}; expected a successful one")
    if solution._scene.bodies != scene.bodies:
        raise InputError("solution is one of another scene, or of this one with other bodies; expected its own")
    term, nominal = MeasureTerm(of, scene.packed().scale), of.value(solution)
    turns = _turns_of(solution)
    starts = [(solution.q, turns, nominal), *((*found, nominal) for found in _aside(scene, solution.q, turns))]
    ends: list[End] = []
    for sign in (1.0, -1.0):
        best: End | None = None
        for q, turns, value in starts:
            end = _Descent(scene, of, term, sign).end(q, turns, value)
            best = end if best is None else _better(best, end, sign)
            if best.status is Status.UNBOUNDED:
                break
        assert best is not None
        ends.append(best)
        if isfinite(best.value):
            starts.append((best.solution.q, _turns_of(best.solution), best.value))
    return Play(of, nominal, *ends)


def _better(best: End, end: End, sign: float) -> End:
    """The farther one of two ends; of those that are equal but for rounding the first."""
    if end.status is Status.UNBOUNDED or not isfinite(best.value):
        return end
    if not isfinite(end.value):
        return best
    gain = sign * (best.value - end.value)
    return end if gain > 1e-12 * max(abs(best.value), end.scene.packed().scale) else best


def _turns_of(solution: Solution) -> Turns:
    """The angles of a solution, past whole turns."""
    packed = solution._packed
    return dict(zip(packed._angles, solution._state[packed.angles].tolist(), strict=True))


def _aside(scene: Assembly, q: Array, turns: Turns) -> Iterator[tuple[Array, Turns]]:
    """Poses that hold, with bodies drawn aside from poses (n, 7): some directions, and each of them mirrored."""
    rng, moving = np.random.default_rng(0), moving_rows(scene.bodies)
    sizes = np.repeat([scene.packed().scale, 1.0], 3)
    for _ in range(_DIRECTIONS):
        way = _ASIDE / np.sqrt(3.0) * sizes * rng.normal(size=(len(moving), 6))
        for side in (1.0, -1.0):
            aim = q.copy()
            aim[moving] = retract(q[moving], side * way)
            near = _with(scene, Posture(aim))
            with near._angles_near(turns):
                found = near.solve(q)
            if found.success:
                yield found.q, _turns_of(found)


def _with(scene: Assembly, *objectives: Objective) -> Assembly:
    """The scene's bodies and constraints with other objectives."""
    result = Assembly(scene.bodies)
    result._take_constraints(scene.constraints)
    result.minimize(*objectives)
    return result


class _Descent:
    """The way from a pose to where sign times a measure is least."""

    def __init__(self, scene: Assembly, measure: Measure, term: MeasureTerm, sign: float) -> None:
        self._scene, self._measure, self._term, self._sign = scene, measure, term, sign
        packed = scene.packed()
        # An angle with a stop on this side does not turn for ever.
        stops = measure.thing.limits if term.turns else None
        self._turned = _TURNED if stops is None or stops[0 if sign > 0.0 else 1] is None else inf
        self._size, self._may_grow = packed.scale, not (packed.keeps_apart or packed.contacts)

    def end(self, q: Array, turns: Turns, value: float) -> End:
        """From poses (n, 7) and the angles there; a measured one is within half a turn of `value`."""
        term, size, sign = self._term, self._size, self._sign
        begin = center = value if term.turns else 0.0
        length, last, failed = _FIRST * size, inf, 0
        goal, near, rests = term.objective(sign, center), None, False
        start: Array | Solution = q
        for _ in range(_STEPS):
            if near is None:
                # The term's slope is about one.
                near = _with(self._scene, goal, Posture(weight=0.5 / length))
            with near._angles_near(turns):
                found = near.solve(start)
            before = start if isinstance(start, np.ndarray) else start.q
            moved = self._moved(before, found.q)
            if not found.success or moved > 4.0 * length:
                if failed == _SHORTER:
                    break
                length, near, last, failed, start = 0.25 * length, None, inf, failed + 1, before
                continue
            start, turns = found, _turns_of(found)
            if self._at(goal, before) - self._at(goal, found.q) < _REST * size:
                rests = True
                break
            if self._may_grow and moved > _FREE * last and length < _LONGEST * size:
                length, near, start = 2.0 * length, None, found.q
            last = moved
            if term.turns:
                beyond = float(self._at(goal, found.q)) * sign / term.unit
                if abs(beyond) > _NEAR:
                    center += beyond
                    goal, near, start = term.objective(sign, center), None, found.q
                if abs(center - begin) > self._turned:
                    break
        q = start if isinstance(start, np.ndarray) else start.q
        alone = _with(self._scene, goal)
        with alone._angles_near(turns):
            solution = alone.solve(q, radius=_FIRST)
        if term.turns and abs(center - begin) > self._turned:
            solution.status = Status.UNBOUNDED
        reached = self._measure.value(solution)
        if term.turns:
            reached = center + self._at(goal, solution.q) * sign / term.unit
        if rests and self._moved(q, solution.q) > 4.0 * _FIRST * size:
            # It jumped, to where no short steps lead.
            reached = nan
        return End.of(alone, solution, reached, sign)

    def _at(self, goal: Expression, q: Array) -> float:
        rows = [self._scene.bodies.index(body) for body in self._term.bodies]
        return float(goal.values(q[rows])[0])

    def _moved(self, q: Array, other: Array) -> float:
        """How far the bodies went, in the user's unit, and turns times half the scene's size."""
        away = np.abs(other[:, :3] - q[:, :3]).max()
        turned = 2.0 * np.sqrt(np.clip(1.0 - np.abs((q[:, 3:] * other[:, 3:]).sum(axis=1)), 0.0, None) * 2.0).max()
        return float(max(away, 0.5 * self._size * turned))
