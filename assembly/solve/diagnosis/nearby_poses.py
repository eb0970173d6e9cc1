"""Poses near a pose along its free motions: how many degrees of freedom they have, and a path through them.

Bodies are moved along a motion and put back onto the constraints by a solve, which takes the nearest pose.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.pose import multiply, retract
from assembly.solve.dense.groups import Group, groups_of
from assembly.solve.dense.jacobian import rows_of
from assembly.solve.diagnosis.subset import Problem
from assembly.solve.interruption import Interruption
from assembly.solve.result import Result

__all__ = ["finite_dof", "path"]

Array = NDArray[np.float64]
# How far bodies are moved, in sizes of the scene and radians, to count degrees of freedom at another pose.
REACH = 0.02
# Number of mixtures of free motions that are tried, and how far bodies may be off such a motion, in parts of its
# length.
MIXTURES, ASTRAY = 2, 0.3
# Bodies have followed a motion if they went at least this part of its length after they were put back.
ARRIVED = 0.25
# Solves slow down near a singular pose; with violations below this they still tell where bodies went.
ROUGH = 1e-6
# Singular values above this count as independent directions of motion.
DISTINCT = 0.1
# Longest step of a path; longer ones are divided.
STEP = 0.05


def moved(q: Array, motion: Array, size: float) -> Array:
    """Poses (n, 7) moved by twists (n, 6), lengths over `size`."""
    return retract(q, motion * np.repeat([size, 1.0], 3))


def moves(q: Array, other: Array, size: float) -> Array:
    """Twists (n, 6), lengths over `size`, that move poses to others."""
    twists = np.zeros((len(q), 6))
    twists[:, :3] = (other[:, :3] - q[:, :3]) / size
    for twist, e, f in zip(twists, q[:, 3:], other[:, 3:], strict=True):
        w, *u = multiply(f, e * [1.0, -1.0, -1.0, -1.0])
        sine = float(np.linalg.norm(u))
        if sine > 0.0:
            # The shorter way around.
            twist[3:] = np.array(u) * (2.0 * np.arctan2(sine, abs(w)) / sine) * np.copysign(1.0, w)
    return twists


def _at(problem: Problem, solution: Result, interruption: Interruption) -> list[Group]:
    """The groups at a solution of a problem of two-sided rows."""
    rows = rows_of(problem.packed, solution._state)
    counted = np.ones(len(rows.owners), dtype=bool)
    return groups_of(
        solution._scene.bodies, problem.constraints, rows, counted, fit=problem.held, interruption=interruption
    )


def finite_dof(problem: Problem, groups: Sequence[Group], q: Array, size: float, interruption: Interruption) -> int:
    """The least degrees of freedom found near a pose, group by group.

    Where rows are independent the poses that hold them are a smooth surface of that dimension. Else bodies are moved
    along mixtures of their free motions: if these are possible and end with as many degrees of freedom, so can all the
    others, for a mixture is like any. If not, along every free motion and back.

    Parameters
    ----------
    problem : Problem
        Of the rows that count.
    groups : sequence of Group
        At the pose.
    q : (n, 7)
    size : float
        The scene's size.
    interruption : Interruption
        TimeoutError where its time is over before.
    """
    walks = Walks(problem, [group for group in groups if group.balanced.rank < len(group.rows)], q, size, interruption)
    rng = np.random.default_rng(0)
    for _ in range(MIXTURES if walks.groups else 0):
        parts = [rng.normal(size=group.dof) for group in walks.groups]
        walks.go([part / np.linalg.norm(part) if part.size else part for part in parts])
    doubtful = [not walks.regular(g) for g in range(len(walks.groups))]
    for k in range(max((group.dof for group, doubt in zip(walks.groups, doubtful, strict=True) if doubt), default=0)):
        for sign in (1.0, -1.0):
            walks.go(
                [
                    sign * np.eye(group.dof)[k] if doubt and k < group.dof else np.zeros(group.dof)
                    for group, doubt in zip(walks.groups, doubtful, strict=True)
                ]
            )
    regular = sum(group.dof for group in groups) - sum(group.dof for group in walks.groups)
    return regular + sum(walks.least(g) for g in range(len(walks.groups)))


class Walks:
    """Short ways along free motions of groups, and what was found at their ends."""

    def __init__(
        self, problem: Problem, groups: Sequence[Group], q: Array, size: float, interruption: Interruption
    ) -> None:
        self.groups = groups
        self._problem = problem
        self._q = q
        self._size = size
        self._interruption = interruption
        self._free = [group.balanced.free(interruption) for group in groups]
        # For each group: the way that was meant, the way that bodies went, degrees of freedom there.
        self._ends: list[list[tuple[Array, Array, int]]] = [[] for _ in groups]

    def go(self, parts: Sequence[Array]) -> None:
        """Move every group along a unit mixture of its free motions, or leave it where it is."""
        motion = np.zeros((len(self._q), 6))
        reach = np.ones(len(parts))
        for g, (group, part) in enumerate(zip(self.groups, parts, strict=True)):
            if part.any():
                twists = (part @ self._free[g]).reshape(-1, 6)
                reach[g] = REACH / np.linalg.norm(twists, axis=1).max()
                motion[list(group.places)] = reach[g] * twists
        solution = self._problem.solve(moved(self._q, motion, self._size), self._interruption)
        violation = self._problem.violations(solution).max(initial=0.0)
        if not violation <= ROUGH:
            return
        holds = self._problem.holds(solution)
        found = _at(self._problem, solution, self._interruption) if holds else []
        there = {group.places: group.dof for group in found}
        gone = moves(self._q, solution.q, self._size)
        for g, (group, part) in enumerate(zip(self.groups, parts, strict=True)):
            if part.any():
                way = self._free[g] @ gone[list(group.places)].ravel() / reach[g]
                self._ends[g].append((part, way, there.get(group.places, group.dof)))

    def regular(self, g: int) -> bool:
        """Whether a group went everywhere it was meant to go, and has as many degrees of freedom there."""
        return len(self._ends[g]) > 0 and all(
            np.linalg.norm(way - part) <= ASTRAY and dof == self.groups[g].dof for part, way, dof in self._ends[g]
        )

    def least(self, g: int) -> int:
        """The least degrees of freedom of a group at the end of a way, and no more than directions in which it went."""
        least = self.groups[g].dof
        if self._ends[g] and not self.regular(g):
            least = min([least, *(dof for _, way, dof in self._ends[g] if np.linalg.norm(way) >= ARRIVED)])
            sizes = np.linalg.svd(np.array([way for _, way, _ in self._ends[g]]), compute_uv=False)
            least = min(least, int(np.count_nonzero(sizes > DISTINCT)))
        return least


def path(problem: Problem, q: Array, motion: Array, size: float, levels: Array, interruption: Interruption) -> Array:
    """Poses at rising distances along a motion that goes on as the constraints let it, (levels, n, 7).

    Where it cannot go on, the poses stay.

    Parameters
    ----------
    problem : Problem
        Of the rows that count.
    q : (n, 7)
        Where it begins.
    motion : (n, 6)
        Lengths over `size`.
    size : float
    levels : (k,)
        Distances, in lengths of the motion, rising from 0.
    interruption : Interruption
        TimeoutError where its time is over before.
    """
    poses = np.empty((len(levels), *q.shape))
    solution: Result | None = None
    length = float(np.linalg.norm(motion))
    widest = float(np.linalg.norm(motion, axis=1).max()) / length
    gone = 0.0
    blocked = False
    for k, level in enumerate(levels):
        # Levels that are the same up to rounding ask for no step.
        count = int(np.ceil((level - gone) * length * widest / STEP - 1e-9))
        for _ in range(0 if blocked else count):
            step = (level - gone) * length / count
            trial = problem.solve(moved(q, step / np.linalg.norm(motion) * motion, size), interruption, solution)
            way = moves(q, trial.q, size)
            if not problem.holds(trial) or not np.vdot(way, motion) >= ARRIVED * step * np.linalg.norm(motion):
                blocked = True
                break
            q, solution = trial.q, trial
            motion = _onward(problem, solution, motion, interruption)
        gone = level
        poses[k] = q
    return poses


def _onward(problem: Problem, solution: Result, motion: Array, interruption: Interruption) -> Array:
    """What of a motion is free at the next pose."""
    onward = np.zeros_like(motion)
    for group in _at(problem, solution, interruption):
        places = list(group.places)
        free = group.balanced.free(interruption)
        onward[places] = (free.T @ (free @ motion[places].ravel())).reshape(-1, 6)
    return onward
