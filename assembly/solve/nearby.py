"""Poses near a pose along its free motions: how many freedoms they have, and a path through them.

Bodies are moved along a motion and put back onto the constraints by a solve, which takes the nearest pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.pose import multiply, retract
from assembly.solve.groups import Group, groups_of
from assembly.solve.jacobian import rows_of
from assembly.solve.rank import HELD
from assembly.solve.solution import Solution
from assembly.solve.subset import Problem

__all__ = ["finite_dof", "path"]

Array = NDArray[np.float64]
# How far bodies are moved to count freedoms there, in sizes of the scene and radians.
REACH = 0.02
# Bodies that are put back by more than the rest of this part of the way could not go there.
ARRIVED = 0.25
# Toward a singular pose a solve slows down; with violations below this it tells where bodies went all the same.
ROUGH = 1e-6
# What counts as a direction of its own among the ways that bodies went.
DISTINCT = 0.1
# A longer step of a path is divided.
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


def _at(problem: Problem, solution: Solution, size: float) -> list[Group]:
    """The groups at a solution of a problem of two-sided rows."""
    rows = rows_of(problem.packed, solution._state)
    return groups_of(solution._scene.bodies, problem.constraints, rows, np.ones(len(rows.owners), dtype=bool))


def _directions(groups: Sequence[Group]) -> Iterator[list[Array]]:
    """Along every free motion and back, all groups at once; then two mixtures, the same in every run."""
    for k in range(max(group.dof for group in groups)):
        for sign in (1.0, -1.0):
            yield [sign * np.eye(group.dof)[k] if k < group.dof else np.zeros(group.dof) for group in groups]
    rng = np.random.default_rng(0)
    for _ in range(2):
        mixture = [rng.normal(size=group.dof) for group in groups]
        yield [part / np.linalg.norm(part) if part.size else part for part in mixture]


def finite_dof(problem: Problem, groups: Sequence[Group], q: Array, size: float) -> int:
    """The least degrees of freedom found near a pose, group by group.

    Parameters
    ----------
    problem : Problem
        Of the rows that count.
    groups : sequence of Group
        At the pose.
    q : (n, 7)
    size : float
        The scene's size.
    """
    least = [group.dof for group in groups]
    ways: list[list[Array]] = [[] for _ in groups]
    for parts in _directions(groups):
        motion = np.zeros((len(q), 6))
        reach = np.ones(len(groups))
        for g, (group, part) in enumerate(zip(groups, parts, strict=True)):
            if part.any():
                twists = (part @ group.balanced.free).reshape(-1, 6)
                reach[g] = REACH / np.linalg.norm(twists, axis=1).max()
                motion[list(group.places)] = reach[g] * twists
        solution = problem.solve(moved(q, motion, size))
        violation = problem.violations(solution).max(initial=0.0)
        if not violation <= ROUGH:
            continue
        holds = violation <= HELD
        there = {group.places: group.dof for group in _at(problem, solution, size)} if holds else {}
        gone = moves(q, solution.q, size)
        for g, (group, part) in enumerate(zip(groups, parts, strict=True)):
            if part.any():
                way = group.balanced.free @ gone[list(group.places)].ravel() / reach[g]
                ways[g].append(way)
                if np.linalg.norm(way) >= ARRIVED:
                    least[g] = min(least[g], there.get(group.places, group.dof))
    for g, own in enumerate(ways):
        if own:
            sizes = np.linalg.svd(np.array(own), compute_uv=False)
            least[g] = min(least[g], int(np.count_nonzero(sizes > DISTINCT)))
    return sum(least)


def path(problem: Problem, q: Array, motion: Array, size: float, levels: Array) -> Array:
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
    """
    poses = np.empty((len(levels), *q.shape))
    solution: Solution | None = None
    length = float(np.linalg.norm(motion))
    widest = float(np.linalg.norm(motion, axis=1).max()) / length
    gone = 0.0
    blocked = False
    for k, level in enumerate(levels):
        # Levels that are the same up to rounding ask for no step.
        count = int(np.ceil((level - gone) * length * widest / STEP - 1e-9))
        for _ in range(0 if blocked else count):
            step = (level - gone) * length / count
            trial = problem.solve(moved(q, step / np.linalg.norm(motion) * motion, size), solution)
            way = moves(q, trial.q, size)
            if not problem.holds(trial) or not np.vdot(way, motion) >= ARRIVED * step * np.linalg.norm(motion):
                blocked = True
                break
            q, solution = trial.q, trial
            motion = _onward(problem, solution, motion, size)
        gone = level
        poses[k] = q
    return poses


def _onward(problem: Problem, solution: Solution, motion: Array, size: float) -> Array:
    """What of a motion is free at the next pose."""
    onward = np.zeros_like(motion)
    for group in _at(problem, solution, size):
        places = list(group.places)
        free = group.balanced.free
        onward[places] = (free.T @ (free @ motion[places].ravel())).reshape(-1, 6)
    return onward
