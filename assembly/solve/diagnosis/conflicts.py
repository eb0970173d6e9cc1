"""Which constraints cannot hold together: minimal sets, each of whose members is needed for the contradiction.

Where the sum of squared violations is stationary, J^T c = 0: violations carry one another like forces, and those of
zero carry nothing. What is violated there is a contradictory set already. Its members are left out one by one: what
stays contradictory without one does not need it (a deletion filter: Chinneck & Dravnieks, Locating minimal infeasible
constraint sets in linear programs, 1991). Whether a set can hold is asked of the solver, from the pose, from poses
about it and from scattered ones; so a set is contradictory, and minimal, as far as the solver sees. Where a solve came
near to holding all without an end, that was not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.trim_contact import TrimContact
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.records import TAPES
from assembly.solve.attempts.starts import far_starts, near_starts
from assembly.solve.dense.jacobian import NoPairError, rows_of
from assembly.solve.dense.rank import HELD
from assembly.solve.diagnosis.subset import Problem, Snapshot
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.loop.settings import VIOLATION
from assembly.solve.scene import Scene, Status

__all__ = ["conflicting_sets", "conflicts_at"]

Array = NDArray[np.float64]
# Constraints violated by less than this part of the largest violation are not taken for part of a conflict.
IDLE = 1e-6
# Numbers of scattered starts, since solves from starts near the pose may get stuck, and of rounds of further starts
# from which a set is tried before it is called a conflict.
SCATTERED, ROUNDS = 4, 8
# What came to less than this part of a least violation, and to no end, may come to nothing.
ENDED = 0.01
# A set holds that violates a part of what the whole one does, or what the loop takes for none; the largest of three
# coordinates changes with the pose.
PART, LEAST = 0.5, 4e-13


class _Start(NamedTuple):
    """Poses (n, 7) of a start, and whether its bodies are assembled first: one often succeeds where the other fails."""

    q: Array
    gathers: bool


def conflicting_sets(snapshot: Snapshot, interruption: Interruption) -> list[tuple[int, ...]]:
    """Disjoint minimal sets of constraints that cannot hold together, by their places; [] where all can.

    TimeoutError where the interruption's time is over before: what was found by then may not be all there is.
    """
    attempt = partial(_attempt, snapshot, interruption)
    bodies, spread = snapshot.scene.bodies, snapshot.spread
    far = far_starts(bodies, snapshot.q, spread, SCATTERED)
    starts = [_Start(q, gathers=False) for q in near_starts(bodies, snapshot.q, spread)]
    starts += [_Start(q, gathers) for q in next(far) for gathers in (True, False)]
    more = [_Start(q, gathers) for _ in range(ROUNDS) for q in next(far) for gathers in (True, False)]
    left = list(range(len(snapshot.scene.constraints)))
    found: list[tuple[int, ...]] = []
    while left:
        violations = attempt(left, starts)
        if violations is None:
            break
        least = max(IDLE * violations.max(), LEAST)
        loaded = {k for k, value in zip(left, violations, strict=True) if value > least}
        # A trim has no meaning without its contact.
        items = snapshot.scene.constraints
        contacts = {item.contact.name for item in (items[k] for k in loaded) if isinstance(item, TrimContact)}
        core = [k for k in left if k in loaded or items[k].name in contacts]
        # If the violated constraints can hold by themselves, the solve was only stuck, at a pole of an angle say, which
        # says nothing about the others.
        if len(core) < len(left) and attempt(core, starts) is None:
            break
        for k in list(core):
            without = [other for other in core if other != k]
            if without and attempt(without, starts) is not None:
                core = without
        # Sets that can hold get stuck from some starts and not from others: the few constraints are tried from many
        # starts.
        if attempt(core, more) is None:
            break
        found.append(tuple(core))
        left = [k for k in left if k not in core]
    return found


def conflicts_at(scene: Scene, packed: Packed, state: Array, fit: float) -> list[tuple[str, ...]]:
    """The same by their names, at the state that a solve left; what disagrees by no more than `fit` is no conflict."""
    try:
        rows = rows_of(packed, state)
    except NoPairError:
        # Values driven since the solve cannot be told from those of the solve then.
        rows = None
    # If all violations are smaller, either contacts or limits do not hold, or no disagreement is allowed.
    off = float(state[packed.results_at + VIOLATION]) / packed.scale
    held = max(min(max(fit, HELD) if off > fit else HELD, PART * off), LEAST)
    there = state if rows is None else rows.state
    found = conflicting_sets(Snapshot(scene, packed, there, rows, solved=True, held=held), CTRL_C)
    return [tuple(scene.constraints[k].name for k in places) for places in sorted(found)]


def _attempt(
    snapshot: Snapshot, interruption: Interruption, which: Sequence[int], starts: Sequence[_Start]
) -> Array | None:
    """Least violations of some constraints, from the start where they were least; None if they may hold.

    They may where a solve that found no end came nearer to it than all that ended at a least violation, by far where
    violations are lengths and angles; but where a contact nears a fold of its pair, its violation vanishes there and
    tells nothing.
    """
    problem = snapshot.problem(which)
    best: Array | None = None
    ended = unended = np.inf
    for start in starts:
        solution = problem.solve(start.q, interruption, gathers=start.gathers)
        if problem.holds(solution):
            return None
        violations = _of_places(problem, problem.violations(solution), snapshot, which)
        if solution.status is Status.INFEASIBLE:
            ended = min(ended, violations.max())
        elif not problem.packed.contacts:
            unended = min(unended, violations.max())
        if best is None or violations.max() < best.max():
            best = violations
    return None if unended < (ENDED if not problem.packed.table[TAPES] else 1.0) * ended else best


def _of_places(problem: Problem, violations: Array, snapshot: Snapshot, which: Sequence[int]) -> Array:
    """Violations of the constraints asked for; of those without rows 0."""
    named = dict(zip((item.name for item in problem.constraints), violations, strict=True))
    return np.array([named.get(snapshot.scene.constraints[k].name, 0.0) for k in which])
