"""Designs solved one from the other, without leaving the branch.

A solve of new numbers from the solution of numbers nearby is Newton's method from a point near the root, or from one
that is not. That it is near is seen from its first step: residuals that it leaves at most a sixteenth of belong to the
root that continues the branch (Deuflhard, Newton Methods for Nonlinear Problems, 2011, sections 3.2 and 5.1). Where
it leaves more the numbers are gone to in shorter steps. The motion of a branch shrinks with the step, that of a jump
does not: where steps of 1/256 are not enough, and bodies still move far in one, or it cannot be solved, the branch ends
before these numbers.

What is swept is solved by swept solves (`studies/swept_solve.py`), which stay on their branch by themselves, and end
where something is in the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.packing.corners import body_of
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.response import set_values
from assembly.errors import InputError
from assembly.solve.contact_pairs import listed_contacts
from assembly.solve.diagnosis.nearby_poses import moves
from assembly.solve.scene import Status
from assembly.solve.solution import Solution

__all__ = ["BRANCH_ENDED", "ERROR", "REFUSED", "Chain", "Start", "Told"]

Array = NDArray[np.float64]
# What a row may be beside a `Status`.
BRANCH_ENDED, REFUSED, ERROR = "BRANCH_ENDED", "REFUSED", "ERROR"
# Statuses that say of a continued solve that nothing holds nearby.
NOTHING_NEAR = (Status.INFEASIBLE, Status.STALLED, Status.ITERATION_LIMIT, Status.CONTACT_LOST)
# The part of the residual that the first step leaves at most.
CONTRACTION = 1.0 / 16.0
# Residuals of nothing that was asked for, over the scene's size and unit.
NOTHING = 1e-9
# The shortest part of the way between two rows that is gone at a time: at 1/64, 68 of 1,343 four-bars that were drawn
# widely were missed though the branch reaches them along the line; at 1/256, 2, for 29 percent more steps of the loop.
SHORTEST = 1.0 / 256.0
# Iterations of such a step: one that continues the branch takes fewer.
FEW_ITERATIONS = 12
# What bodies may move in such a step where the first step of Newton's method says little, as where a limit is reached:
# over the scene's size, and radians. Branches that are farther apart are told apart.
STILL = 0.05
# Bodies that are apart by less where a solve failed, in parts of the size, may be in its way.
NEAR = 1e-2
# Columns of a history: what rows are off by, and the slope of the objective.
RESIDUAL, SLOPE = 1, 2


class Start(NamedTuple):
    """Numbers (p,) and the pose (n, 7) of their solution."""

    values: Array
    q: Array


class Told(NamedTuple):
    """How a row ended: the solution where there is one."""

    status: str
    message: str = ""
    iterations: int = 0
    solution: Solution | None = None


class Chain:
    """Solves along rows of numbers, each from the last one that was solved.

    Parameters
    ----------
    scene : Assembly
        Solves of it do not begin elsewhere by themselves any more.
    parameters : several Parameter
    swept : bool
        Whether the way from one row to the next has to be clear.
    """

    def __init__(self, scene: Assembly, parameters: Sequence[Parameter], swept: bool = False) -> None:
        self._scene, self._parameters, self._swept = scene, list(parameters), swept
        self._numbers = [parameter._number for parameter in parameters]
        self._now = [number.get() for number in self._numbers]
        self._has_objective = bool(scene.objectives)
        # The numbers that the scene has itself.
        self._own = self._now
        # The last row that was solved.
        self._last: Solution | None = None
        self._at: list[float] = []

    def begin(self, start: Start | None) -> None:
        """Begin at a start, or at the solution of the scene as it is."""
        values = self._own if start is None else start.values.tolist()
        self._last = None
        self._put(values)
        self._scene._stays_near = start is not None
        solution = self._scene.solve(None if start is None else start.q)
        self._scene._stays_near = True
        if solution.success:
            self._last, self._at = solution, values

    @property
    def place(self) -> Start | None:
        """Where another chain may begin: at the last row that was solved."""
        return None if self._last is None else Start(np.array(self._at), np.array(self._last.q))

    def to(self, values: list[float]) -> Told:
        """Solve the scene with other numbers."""
        try:
            if self._last is None:
                told = self._first(values)
            else:
                told = self._next(self._last, values)
        except InputError as error:
            set_values(self._parameters, np.array(self._now))
            return Told(REFUSED, str(error))
        except Exception as error:  # one row that fails is a row that failed
            set_values(self._parameters, np.array(self._now))
            return Told(ERROR, f"{type(error).__name__}: {error}")
        if told.solution is not None:
            self._last, self._at = told.solution, values
        return told

    def from_poses(self, q: Array) -> Told:
        """Solve the scene as it is from poses (n, 7), and from nowhere else."""
        self._scene._stays_near = True
        try:
            return _told(self._scene.solve(q))
        except Exception as error:
            return Told(ERROR, f"{type(error).__name__}: {error}")

    def _put(self, values: list[float]) -> None:
        """Set those numbers that differ; where one is refused, as a limit by a limit, in another order."""
        try:
            for number, now, value in zip(self._numbers, self._now, values, strict=True):
                if now != value:
                    number.set(value)
        except InputError:
            set_values(self._parameters, np.array(values))
        self._now = values

    def _first(self, values: list[float]) -> Told:
        """From the scene's own poses, and from elsewhere."""
        self._put(values)
        self._scene._stays_near = False
        try:
            return _told(self._scene.solve())
        finally:
            self._scene._stays_near = True

    def _next(self, last: Solution, values: list[float]) -> Told:
        """From the last row, at once or in shorter steps."""
        self._put(values)
        if self._swept:
            return _told_of_way(self._scene.solve(last, swept=True))
        solution = self._scene.solve(last)
        if solution.success and self._is_near(solution):
            return Told(solution.status.name, "", solution.iterations, solution)
        if not solution.success and solution.status not in NOTHING_NEAR:
            return _told(solution)
        return self._in_steps(last, values, solution.iterations)

    def _in_steps(self, last: Solution, values: list[float], iterations: int) -> Told:
        """From the last row to other numbers along the line between them."""
        begin, end = np.array(self._at), np.array(values)
        part, step = 0.0, 0.5
        while part < 1.0:
            there = min(1.0, part + step)
            self._put(values if there == 1.0 else (begin + there * (end - begin)).tolist())
            solution = self._scene.solve(last, max_iterations=FEW_ITERATIONS)
            iterations += solution.iterations
            is_short = step <= SHORTEST
            is_still = is_short and solution.success and self._moves_little(last, solution)
            if solution.success and (is_still or self._is_near(solution)):
                last, part, step = solution, there, min(2.0 * step, 0.5)
            elif is_short:
                message = f"the branch ends {part:.2f} of the way from the last row that was solved{_nearest(solution)}"
                return Told(BRANCH_ENDED, message, iterations)
            else:
                step *= 0.5
        return Told(last.status.name, "", iterations, last)

    def _is_near(self, solution: Solution) -> bool:
        """Whether all steps say that the solution continues the branch."""
        rows = solution._rows
        off = rows[:, RESIDUAL]
        if self._has_objective:
            off = np.maximum(off, rows[:, SLOPE])
        before = np.inf
        for after in off.tolist():
            if after > CONTRACTION * before:
                return False
            if after <= NOTHING:
                break
            before = after
        return True

    def _moves_little(self, last: Solution, solution: Solution) -> bool:
        """Whether no body is far from where it was, where rows come and go, and steps say little for it."""
        packed = last._ended.packed
        if not (packed.one_sided.any() or packed.contacts):
            return False
        return bool(np.abs(moves(last.q, solution.q, packed.scale)).max() <= STILL)


def _nearest(solution: Solution) -> str:
    """Which bodies that clearances keep apart are nearest where a solve failed: they may be in the way."""
    packed = solution._packed
    if not packed.keeps_apart:
        return ""
    found = [
        (pair.gap - kept.minimum, number)
        for number, kept, pair in listed_contacts(solution)
        if isinstance(kept, Clearance)
    ]
    gap, number = min(found, default=(np.inf, -1))
    if gap > NEAR * packed.scale:
        return ""
    names = " and ".join(sorted(body_of(side).name for side in packed.kept_pairs[number]))
    return f"; {names} are {gap:.2g} apart there"


def _told_of_way(solution: Solution) -> Told:
    """How a swept solve ended."""
    way = solution.way
    if solution.success or way is None or solution.status is not Status.BLOCKED:
        return _told(solution)
    message = f"blocked {way.part:.6g} of the way from the last row that was solved: {way.reason}"
    return Told(solution.status.name, message, solution.iterations)


def _told(solution: Solution) -> Told:
    """How a solve ended, in a sentence that costs no other solves."""
    if solution.success:
        return Told(solution.status.name, "", solution.iterations, solution)
    name, off = max(solution.violations.items(), key=lambda item: item[1], default=("", 0.0))
    worst = f"; {name!r} is off by {off:.3g}" if off > 0.0 else ""
    return Told(solution.status.name, solution.status.value + worst, solution.iterations)
