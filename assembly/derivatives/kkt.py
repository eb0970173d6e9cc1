"""How the solution of rows and an objective moves when numbers change: the implicit function theorem.

With rows c(x, p) = 0, multipliers y and L = f + y . c, a solution has L_x = 0 and c = 0, and moves along

    [ H  J^T ] [dx]      [L_xp]
    [ J  0   ] [dy]  = - [c_p ]

with H = L_xx. The step is the least one that rows ask for, and one within what they leave; so rows that repeat each
other do no harm. One-sided rows at their bound without a force hold only where that is asked of them: then the
derivative has a side (docs/sensitivity.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Moves", "System", "one_sided_moves", "solve_system"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# Singular values of rows of length one that count as none; curvatures over the largest that do.
DEPENDENT, FLAT = 1e-7, 1e-8
# What rows that repeat each other may ask for differently, over what is asked, and still agree.
AGREE = 1e-7
# Rows without a force, all of whose combinations are tried; what they may be broken by.
MOST_OPEN, WITHIN = 10, 1e-9


@dataclass(frozen=True, eq=False)
class System:
    """Rows (m, n), the Hessian (n, n) of the Lagrangian, and what a unit of each parameter adds.

    Attributes
    ----------
    jacobian, hessian : (m, n), (n, n)
    rows_by, slopes_by : (m, p), (n, p)
        Of residuals, and of the slopes of the Lagrangian.
    is_least_move : bool
        Whether the Hessian only chooses the least move, so that what rows leave is free.
    """

    jacobian: Array
    hessian: Array
    rows_by: Array
    slopes_by: Array
    is_least_move: bool = False


@dataclass(frozen=True, eq=False)
class Moves:
    """What solutions do a unit of each parameter.

    Attributes
    ----------
    steps, forces : (n, p), (m, p)
    free : (n, d)
        Orthonormal motions that neither rows nor the objective's curvature tell anything about.
    rank : int
        Of the rows that hold.
    contradicts : (p,) bool
        Rows ask for what they cannot have together: there is no solution beside this one.
    drifts : (p,) bool
        The objective has a slope along a motion without curvature.
    shared : (m, k)
        Forces of rows of length one that are in balance with each other: rows that repeat each other share a force.
    """

    steps: Array
    forces: Array
    free: Array
    rank: int
    contradicts: Flags
    drifts: Flags
    shared: Array


def solve_system(system: System, held: Flags) -> Moves:
    """The derivative with rows that are held, (m,), at their bound; the others have no force."""
    n, count = system.slopes_by.shape
    rows = np.flatnonzero(held)
    jacobian, asked = system.jacobian[rows], system.rows_by[rows]
    lengths = np.sqrt((jacobian**2).sum(axis=1))
    scales = np.where(lengths > DEPENDENT, 1.0 / np.maximum(lengths, DEPENDENT), 0.0)
    left, values, right = np.linalg.svd(jacobian * scales[:, None], full_matrices=True)
    rank = int(np.count_nonzero(values > DEPENDENT))
    scaled = asked * np.where(scales > 0.0, scales, 1.0)[:, None]
    along = left.T @ scaled
    size = np.abs(scaled).max(axis=0, initial=0.0)
    contradicts = np.abs(along[rank:]).max(axis=0, initial=0.0) > AGREE * np.maximum(size, AGREE)
    steps = -right[:rank].T @ (along[:rank] / values[:rank, None])
    basis = right[rank:].T
    free, drifts = np.zeros((n, 0)), np.zeros(count, dtype=bool)
    if basis.shape[1]:
        lacking = -basis.T @ (system.slopes_by + system.hessian @ steps)
        form = basis.T @ system.hessian @ basis
        curvatures, ways = np.linalg.eigh(0.5 * (form + form.T))
        level = np.abs(curvatures) <= FLAT * max(1.0, float(np.abs(system.hessian).max()))
        amounts = ways.T @ lacking
        drifts = np.abs(amounts[level]).max(axis=0, initial=0.0) > AGREE * (1.0 + np.abs(lacking).max(axis=0))
        amounts = amounts / np.where(level, np.inf, curvatures)[:, None]
        steps = steps + basis @ (ways @ amounts)
        free = basis if system.is_least_move else basis @ ways[:, level]
    pulled = -right[:rank] @ (system.slopes_by + system.hessian @ steps)
    forces = np.zeros((len(held), count))
    forces[rows] = scales[:, None] * (left[:, :rank] @ (pulled / values[:rank, None]))
    shared = np.zeros((len(held), len(rows) - rank))
    shared[rows] = scales[:, None] * left[:, rank:]
    return Moves(steps, forces, free, rank, contradicts, drifts, shared)


def one_sided_moves(system: System, held: Flags, open_rows: Flags, sign: float) -> Moves | None:
    """The derivative as parameters grow (1), or shrink (-1), each alone, where open rows may hold or leave their bound.

    None where no choice of them, or more than one with different steps, is a solution; at most `MOST_OPEN` are tried.
    """
    rows = np.flatnonzero(open_rows)
    if len(rows) > MOST_OPEN:
        return None
    count = system.rows_by.shape[1]
    found: list[Moves | None] = [None] * count
    for size in range(len(rows) + 1):
        for chosen in combinations(rows.tolist(), size):
            choice = held.copy()
            choice[list(chosen)] = True
            moves = solve_system(system, choice)
            rates = sign * (system.jacobian[rows] @ moves.steps + system.rows_by[rows])
            forces = sign * moves.forces[rows]
            holds = (rates >= -WITHIN).all(axis=0) & (forces <= WITHIN).all(axis=0) & ~moves.contradicts
            for k in np.flatnonzero(holds):
                found[k] = found[k] or moves
        if all(moves is not None for moves in found):
            break
    best = [moves or solve_system(system, held) for moves in found]
    lost = np.array([moves is None for moves in found])
    return Moves(
        np.column_stack([moves.steps[:, k] for k, moves in enumerate(best)]),
        np.column_stack([moves.forces[:, k] for k, moves in enumerate(best)]),
        max((moves.free for moves in best), key=lambda free: free.shape[1]),
        min(moves.rank for moves in best),
        lost | np.array([bool(moves.contradicts[k]) for k, moves in enumerate(best)]),
        np.array([bool(moves.drifts[k]) for k, moves in enumerate(best)]),
        max((moves.shared for moves in best), key=lambda shared: shared.shape[1]),
    )
