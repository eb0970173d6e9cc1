"""Which constraints cannot hold together: minimal sets, each of whose members is needed for the contradiction.

Where the sum of squared violations is stationary, J^T c = 0: violations carry one another like forces, and those of
zero carry nothing. What is violated there is a contradictory set already. Its members are left out one by one: what
stays contradictory without one does not need it (a deletion filter: Chinneck & Dravnieks, Locating minimal infeasible
constraint sets in linear programs, 1991). Whether a set can hold is asked of the solver, from the pose, from poses
about it and from scattered ones; so a set is contradictory, and minimal, as far as the solver sees.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing import Packed
from assembly.kinematics.pose import retract
from assembly.solve.jacobian import NoPairError, rows_of
from assembly.solve.rank import HELD
from assembly.solve.settings import VIOLATION
from assembly.solve.solution import Scene
from assembly.solve.subset import Problem, Snapshot

__all__ = ["conflicting_sets", "conflicts_at"]

Array = NDArray[np.float64]
# A violation below this part of the largest carries nothing.
IDLE = 1e-6
# A set holds that violates a part of what the whole one does, or what the loop takes for none; the largest of three
# coordinates changes with the pose.
PART, LEAST = 0.5, 4e-13
# How far about the pose starts are, in sizes of the scene and radians, since it may be a saddle by symmetry; and how
# many scattered ones there are, since it may be stuck.
ABOUT, SCATTERED = (0.0, 0.03, 0.3), 8


def conflicting_sets(snapshot: Snapshot) -> list[tuple[int, ...]]:
    """Disjoint minimal sets of constraints that cannot hold together, by their places; [] where all can."""
    starts = list(_starts(snapshot))
    left = list(range(len(snapshot.scene.constraints)))
    found: list[tuple[int, ...]] = []
    while left:
        violations = _attempt(snapshot, left, starts)
        if violations is None:
            break
        loaded = [k for k, value in zip(left, violations, strict=True) if value > IDLE * violations.max()]
        core = loaded if _attempt(snapshot, loaded, starts) is not None else left
        for k in list(core):
            without = [other for other in core if other != k]
            if without and _attempt(snapshot, without, starts) is not None:
                core = without
        found.append(tuple(core))
        left = [k for k in left if k not in core]
    return found


def conflicts_at(scene: Scene, packed: Packed, state: Array, fit: float) -> list[tuple[str, ...]]:
    """The same by their names, at the state that a solve left; what disagrees by no more than `fit` is no conflict."""
    try:
        rows = rows_of(packed, state)
    except NoPairError:
        # Then values that were driven since are not told from those of the solve.
        rows = None
    # Where all that is violated is so by less, contacts or limits do not hold, or nothing is to disagree.
    off = float(state[packed.results_at + VIOLATION]) / packed.scale
    held = max(min(max(fit, HELD) if off > fit else HELD, PART * off), LEAST)
    there = state if rows is None else rows.state
    found = conflicting_sets(Snapshot(scene, packed, there, rows, solved=True, held=held))
    return [tuple(scene.constraints[k].name for k in places) for places in sorted(found)]


def _attempt(snapshot: Snapshot, which: Sequence[int], starts: Sequence[Array]) -> Array | None:
    """Least violations of some constraints, from the start where they were least; None if they can hold."""
    problem = snapshot.problem(which)
    best: Array | None = None
    for q in starts:
        solution = problem.solve(q)
        if problem.holds(solution):
            return None
        violations = _of_places(problem, problem.violations(solution), snapshot, which)
        if best is None or violations.max() < best.max():
            best = violations
    return best


def _of_places(problem: Problem, violations: Array, snapshot: Snapshot, which: Sequence[int]) -> Array:
    """Violations of the constraints asked for; of those without rows 0."""
    named = dict(zip((item.name for item in problem.constraints), violations, strict=True))
    return np.array([named.get(snapshot.scene.constraints[k].name, 0.0) for k in which])


def _starts(snapshot: Snapshot) -> Iterator[Array]:
    """Poses to try, the pose itself first; the same in every run."""
    rng = np.random.default_rng(0)
    moving = [k for k, body in enumerate(snapshot.scene.bodies) if not body.fixed]
    sizes = np.repeat([snapshot.scene.scale, 1.0], 3)
    for reach in ABOUT:
        q = snapshot.q.copy()
        q[moving] = retract(q[moving], reach / np.sqrt(3.0) * sizes * rng.normal(size=(len(moving), 6)))
        yield q
    for _ in range(SCATTERED):
        q = snapshot.q.copy()
        q[moving, :3] += snapshot.scene.scale * rng.uniform(-1.0, 1.0, (len(moving), 3))
        turns = rng.normal(size=(len(moving), 4))
        q[moving, 3:] = turns / np.linalg.norm(turns, axis=1, keepdims=True)
        yield q
