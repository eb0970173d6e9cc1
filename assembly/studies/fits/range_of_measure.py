"""The least and the largest value of a measure over poses that hold, reached from a solution by short steps.

The measure is an objective, linear along some motions: a solve would step as far as it may, out of a hole and through
walls. So the proximal point method goes there: the measure and w |x - x_k|^2 from the pose x_k, with w such that the
step is no longer than a length where nothing shortens it. It rests at corners of what contacts, limits and clearances
allow, and at points of curved ones. From where it rests the measure alone is solved, which is exact.

That is a local answer. One-sided contacts have several corners, so other starts are tried as well: poses that are held
while all bodies are drawn a little aside, to either side, and the other end. The best is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite, nan, pi
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._turn import in_turn
from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Coordinate
from assembly.constraints.model.objectives import Objective, Posture
from assembly.derivatives.measure import Measure
from assembly.errors import InputError
from assembly.kinematics.pose import retract
from assembly.solve.attempts.starts import moving_rows
from assembly.solve.clearance_proof import judge_end
from assembly.solve.interruption import CTRL_C
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
# In sizes of the scene: the first step, the longest one, and the gain of a step at which it rests, a slope of 0.03.
# Twice as long, and thin walls may be stepped through; half as long, and it takes more of them. Where nothing is in the
# way but limits, steps that nothing shortens grow.
_FIRST, _LONGEST, _REST = 0.01, 0.32, 1e-5
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


@in_turn
def play(scene: Assembly, solution: Solution, of: Measure) -> Play:
    """The range of a measure over all poses that one-sided contacts, clearances and limits allow.

    Joints, driven values and two-sided contacts hold; objectives of the scene do not count. Poses are reached from the
    solution in short steps, so that a pin stays in its hole.

    Parameters
    ----------
    scene : Assembly
    solution : Solution
        A successful one of the scene.
    of : Measure
        A position, a distance, or a coordinate of a joint.

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
    nominal = of.value(solution)
    descents = _Descents(scene, of, MeasureTerm(of, scene.packed().scale))
    begin = _Start(solution.q, _turns_of(solution), nominal)
    starts = [begin, *descents.aside(begin)]
    ends: list[End] = []
    for sign in (1.0, -1.0):
        found: list[End] = []
        for start in starts:
            found.append(descents.end(start, sign))
            if found[-1].status is Status.UNBOUNDED:
                break
        ends.append(_farthest(scene, found, sign))
        if isfinite(ends[-1].value):
            last = ends[-1].solution
            starts.append(_Start(last.q, _turns_of(last), ends[-1].value))
    return Play(of, nominal, *ends)


class _Start(NamedTuple):
    """Poses (n, 7), the angles there, and what is measured: an angle there is within half a turn of it."""

    q: Array
    turns: Turns
    value: float


def _turns_of(solution: Solution) -> Turns:
    """The angles of a solution, past whole turns."""
    packed = solution._packed
    return dict(zip(packed._angles, solution._state[packed.angles].tolist(), strict=True))


def _farthest(scene: Assembly, ends: Sequence[End], sign: float) -> End:
    """The farthest of the ends at which it is known that bodies are clear; the first one where that is none."""
    left = list(ends)
    while left:
        best = left[0]
        for end in left[1:]:
            best = _better(best, end, sign)
        if not best.solution.success or _is_clear(scene, best):
            return best
        left.remove(best)
    return replace(ends[0], value=nan)


def _is_clear(scene: Assembly, end: End) -> bool:
    """Whether the bodies at an end are known to be clear; where they are not, its solution is STALLED."""
    packed = end.scene.packed()
    if packed.keeps_apart:
        # Bodies and clearances are those of the scene: so is what is kept of them for proofs.
        packed.proofs = scene.packed().proofs
        judge_end(end.solution, end.scene._settings({}, CTRL_C, warm=True), CTRL_C)
        CTRL_C.is_over()  # What a signal's handler raised is raised here.
    return end.solution.success


def _better(best: End, end: End, sign: float) -> End:
    """The farther one of two ends; of those that are equal but for rounding the first."""
    if end.status is Status.UNBOUNDED or not isfinite(best.value):
        return end
    if not isfinite(end.value):
        return best
    gain = sign * (best.value - end.value)
    return end if gain > 1e-12 * max(abs(best.value), end.scene.packed().scale) else best


class _Descents:
    """Ways from poses to where a measure is least or most; scenes that are solved for it are packed once."""

    def __init__(self, scene: Assembly, measure: Measure, term: MeasureTerm) -> None:
        self._scene, self._measure, self._term = scene, measure, term
        self._stops = measure.thing.limits if term.turns else None
        packed = scene.packed()
        self._size, self._may_grow = packed.scale, not (packed.keeps_apart or packed.contacts)
        self._known: dict[tuple[float, float, float], tuple[Expression, Assembly]] = {}
        # How many times as many places for contacts scenes have turned out to need.
        self._crowding = scene._crowding

    def _turned(self, sign: float) -> float:
        """How far an angle turns before it is free to: one with a stop on this side does not turn for ever."""
        return _TURNED if self._stops is None or self._stops[0 if sign > 0.0 else 1] is None else inf

    def aside(self, begin: _Start) -> Iterator[_Start]:
        """Poses that hold, with bodies drawn aside from others: some directions, and each of them mirrored."""
        q = begin.q
        rng, moving = np.random.default_rng(0), moving_rows(self._scene.bodies)
        sizes = np.repeat([self._size, 1.0], 3)
        drawn = self._with(Posture())
        for _ in range(_DIRECTIONS):
            way = _ASIDE / np.sqrt(3.0) * sizes * rng.normal(size=(len(moving), 6))
            for side in (1.0, -1.0):
                aim = q.copy()
                aim[moving] = retract(q[moving], side * way)
                found = self._solved(drawn, q, begin.turns, aim)
                if found.success:
                    yield _Start(found.q, _turns_of(found), begin.value)

    def _with(self, *objectives: Objective) -> Assembly:
        """The scene's bodies and constraints with other objectives."""
        result = Assembly(self._scene.bodies)
        result._take_constraints(self._scene.constraints)
        result.minimize(*objectives)
        result._crowding = self._crowding
        return result

    def _solved(
        self,
        scene: Assembly,
        start: Array | Solution,
        turns: Turns,
        reference: Array | None = None,
        **options: float,
    ) -> Solution:
        """A solve from a start and no other one, whose end nothing proves; postures are measured from a reference."""
        scene._take_seats(start, None)
        settings = scene._settings(options, CTRL_C, isinstance(start, Solution))
        with scene._angles_near(turns):
            solution = scene._solved(settings, start, None, CTRL_C, reference, judges=False)
        CTRL_C.is_over()  # What a signal's handler raised is raised here.
        self._crowding = max(self._crowding, scene._crowding)
        return solution

    def _asked(self, sign: float, center: float, length: float = inf) -> tuple[Expression, Assembly]:
        """The term and the scene of sign times the measure, with steps of a length where it is finite."""
        key = sign, center, length
        if key not in self._known:
            goal = self._term.objective(sign, center)
            # The term's slope is about one.
            near = () if length == inf else (Posture(weight=0.5 / length),)
            self._known[key] = goal, self._with(goal, *near)
        return self._known[key]

    def end(self, begun: _Start, sign: float) -> End:
        """Where sign times the measure is least, from a start."""
        term, size, turns = self._term, self._size, begun.turns
        begin = center = begun.value if term.turns else 0.0
        length, last, failed, rests = _FIRST * size, inf, 0, False
        start: Array | Solution = begun.q
        goal, near = self._asked(sign, center, length)
        for _ in range(_STEPS):
            found = self._solved(near, start, turns)
            before = start if isinstance(start, np.ndarray) else start.q
            moved = self._moved(before, found.q)
            if not found.success or moved > 4.0 * length:
                if failed == _SHORTER:
                    break
                length, last, failed, start = 0.25 * length, inf, failed + 1, before
                goal, near = self._asked(sign, center, length)
                continue
            start, turns = found, _turns_of(found)
            if self._at(goal, before) - self._at(goal, found.q) < _REST * size:
                rests = True
                break
            if self._may_grow and moved > _FREE * last and length < _LONGEST * size:
                length, start = 2.0 * length, found.q
            last = moved
            if term.turns:
                beyond = float(self._at(goal, found.q)) * sign / term.unit
                if abs(beyond) > _NEAR:
                    center, start = center + beyond, found.q
                if abs(center - begin) > self._turned(sign):
                    break
            if start is not found:
                goal, near = self._asked(sign, center, length)
        ended = start if isinstance(start, np.ndarray) else start.q
        return self._alone(_Start(ended, turns, center), sign, begin, rests)

    def _alone(self, start: _Start, sign: float, begin: float, rests: bool) -> End:
        """The measure solved for alone, which is exact; an angle began at `begin`, and its center is the start's."""
        q, turns, center = start
        goal, alone = self._asked(sign, center)
        solution = self._solved(alone, q, turns, radius=_FIRST)
        if self._term.turns and abs(center - begin) > self._turned(sign):
            solution.status = Status.UNBOUNDED
        reached = self._measure.value(solution)
        if self._term.turns:
            reached = center + self._at(goal, solution.q) * sign / self._term.unit
        if rests and self._moved(q, solution.q) > 4.0 * _FIRST * self._size:
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
