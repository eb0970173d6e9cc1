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
# Singular values of normalized rows that are less count as zero; so do curvatures, relative to the largest one.
DEPENDENT, FLAT = 1e-7, 1e-8
# Redundant rows agree where what they ask for differs by no more than this part of it.
AGREE = 1e-7
# Without a metric all combinations of up to so many rows without a force are tried; violations up to WITHIN are none.
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

    With curvature along all that held rows leave, the step is the least one in that metric: a least distance program a
    parameter says which open rows hold. Without it several steps may be: all choices of rows are tried. None where
    there are too many for that, more than `MOST_OPEN`.
    """
    rows = np.flatnonzero(open_rows)
    metric = _metric(system, held)
    if metric is None and len(rows) > MOST_OPEN:
        return None
    chosen = (
        _tried(system, held, rows, sign)
        if metric is None
        else [_held_by_least_distance(system, held, rows, sign, metric, k) for k in range(system.rows_by.shape[1])]
    )
    found: list[Moves | None] = []
    known: dict[bytes, Moves] = {}
    for k, choice in enumerate(chosen):
        moves = None
        if choice is not None:
            moves = known.setdefault(choice.tobytes(), solve_system(system, choice))
            if not _holds(system, moves, rows, sign)[k]:
                moves = None
        found.append(moves)
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


def _holds(system: System, moves: Moves, rows: NDArray[np.int64], sign: float) -> Flags:
    """Of every parameter whether no open row is broken, and none pulls."""
    rates = sign * (system.jacobian[rows] @ moves.steps + system.rows_by[rows])
    forces = sign * moves.forces[rows]
    return (rates >= -WITHIN).all(axis=0) & (forces <= WITHIN).all(axis=0) & ~moves.contradicts


def _metric(system: System, held: Flags) -> Array | None:
    """B (n, d) of the steps B v that held rows leave, whose curvature is |v|^2; None where it is not positive."""
    scaled = system.jacobian[held]
    lengths = np.sqrt((scaled**2).sum(axis=1))
    scaled = scaled[lengths > DEPENDENT] / lengths[lengths > DEPENDENT, None]
    _, values, right = np.linalg.svd(scaled, full_matrices=True)
    basis = right[int(np.count_nonzero(values > DEPENDENT)) :].T
    curvatures, ways = np.linalg.eigh(basis.T @ system.hessian @ basis)
    if not (curvatures > FLAT * max(1.0, float(np.abs(system.hessian).max()))).all():
        return None
    metric: Array = basis @ (ways / np.sqrt(curvatures))
    return metric


def _held_by_least_distance(
    system: System, held: Flags, rows: NDArray[np.int64], sign: float, metric: Array, k: int
) -> Flags | None:
    """Rows that hold as parameter k grows or shrinks: of the least v with A v + rates >= 0 in the open rows.

    Its dual is a least square with multipliers of one sign (Lawson and Hanson, Solving Least Squares Problems, 23.4).
    None where there is no v.
    """
    from scipy.optimize import nnls  # a quarter of a second of import

    alone = System(
        system.jacobian, system.hessian, system.rows_by[:, [k]], system.slopes_by[:, [k]], system.is_least_move
    )
    rates = sign * (system.jacobian[rows] @ solve_system(alone, held).steps[:, 0] + system.rows_by[rows, k])
    across = system.jacobian[rows] @ metric
    lengths = np.sqrt((across**2).sum(axis=1))
    # Rows that no step within the held rows changes must hold already, to rounding.
    stays = lengths <= DEPENDENT * np.maximum(1.0, np.abs(system.jacobian[rows]).max(axis=1, initial=0.0))
    if (rates[stays] < -WITHIN).any():
        return None
    lacking = np.where(rates < -WITHIN, -rates, np.minimum(-rates, 0.0))[~stays]
    choice = held.copy()
    if not (lacking > 0.0).any():
        return choice
    parts = across[~stays] / lengths[~stays, None]
    lacking = lacking / lengths[~stays]
    lacking = lacking / np.abs(lacking).max()
    amounts, distance = nnls(np.vstack([parts.T, lacking]), np.append(np.zeros(parts.shape[1]), 1.0))
    if not distance > DEPENDENT:
        return None
    choice[rows[~stays][amounts > 0.0]] = True
    return choice


def _tried(system: System, held: Flags, rows: NDArray[np.int64], sign: float) -> list[Flags | None]:
    """The same of every parameter, by trying all choices, the smallest first."""
    found: list[Flags | None] = [None] * system.rows_by.shape[1]
    for size in range(len(rows) + 1):
        for chosen in combinations(rows.tolist(), size):
            choice = held.copy()
            choice[list(chosen)] = True
            for k in np.flatnonzero(_holds(system, solve_system(system, choice), rows, sign)):
                found[k] = choice if found[k] is None else found[k]
        if all(choice is not None for choice in found):
            break
    return found
