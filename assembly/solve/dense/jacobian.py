"""The rows of a scene at a pose, as a dense matrix in the twists of all bodies.

A contact whose pair is at a fold has four more rows and unknowns (`proximity/extrema/lifted_pair.py`), rows U in the
unknowns
and J in the twists. What it asks of the twists alone is N^T J dx = 0, with N^T U = 0 and N orthonormal: one row
where U has full rank, which is along the gap's gradient; three for two flat faces that lie on each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.errors import InputError
from assembly.solve.dense.row_table import rows_at

__all__ = ["NoPairError", "Rows", "moving_columns", "rows_of"]

Array = NDArray[np.float64]
# Curvature over the scene's size below which a pair's coordinates move nothing.
FLAT = 1e-6


class NoPairError(InputError):
    """A contact has no extremal pair at a pose; `contact` is its place among the contacts."""

    def __init__(self, contact: int, name: str) -> None:
        super().__init__(f"q leaves contact {name!r} without an extremal pair; expected a pose where it has one")
        self.contact = contact


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows at a pose; lengths over the scene's size.

    Attributes
    ----------
    residual : (m,)
    jacobian : (m, 6 n)
        In the twists of all bodies, in the scene's order.
    owners : (m,) int
        The constraint of each row.
    program_rows : (m,) int
        The row of the program each comes from; several from that of a flat contact.
    shares : (m,)
        How much of that row is in it: multipliers z of these rows belong to one of the program, the sum of
        shares * z. Where there is one row, z = y / share.
    one_sided, drives : (m,) bool
        Whether a row is >= 0; whether a driven value or a limit asks for it.
    state : array
        The state, with the tracked values found.
    """

    residual: Array
    jacobian: Array
    owners: NDArray[np.int64]
    program_rows: NDArray[np.int64]
    shares: Array
    one_sided: NDArray[np.bool_]
    drives: NDArray[np.bool_]
    state: Array


def rows_of(packed: Packed, state: Array) -> Rows:
    """The rows of a packed scene at a state, which is left as it is.

    Raises
    ------
    NoPairError
        A contact has no extremal pair at this pose.
    InputError
        An expression has no finite value or slope there.
    """
    m, pairs, n = packed.rows, packed.pair_rows, packed.count
    state = state.copy()
    free = np.empty(pairs, dtype=np.int64)
    residual, jacobian = np.empty(m + 4 * pairs), np.empty((m + 4 * pairs, 6 * n + 4 * pairs))
    lost = rows_at(packed.table_at(state), packed.pool, state, free, residual, jacobian)
    if lost >= 0 and packed.seek_penetration():
        lost = rows_at(packed.table_at(state), packed.pool, state, free, residual, jacobian)
    if lost >= 0:
        raise NoPairError(lost, packed.pair_name(lost))
    finite = np.isfinite(residual[:m]) & np.isfinite(jacobian[:m, : 6 * n]).all(axis=1)
    if not finite.all():
        owner = int(packed.owners[np.flatnonzero(~finite)[0]])
        raise InputError(
            f"constraint {owner + 1} of the scene has no finite value or slope at this pose; expected both"
        )
    which = np.arange(m)
    shares = np.ones(m)
    if (free >= 0).any():
        which, shares, residual, jacobian = _reduced(m, n, _places(packed, free), residual, jacobian)
    return Rows(
        residual[: len(which)],
        jacobian[: len(which), : 6 * n],
        packed.owners[which],
        which,
        shares,
        packed.one_sided[which],
        packed.drives[which],
        state,
    )


def _places(packed: Packed, free: NDArray[np.int64]) -> NDArray[np.int64]:
    """For every row of the program: where its pair is among the free ones, or -1."""
    places = np.full(packed.rows, -1, dtype=np.int64)
    paired = packed.pairs >= 0
    places[paired] = free[packed.pairs[paired]]
    return places


def _reduced(
    m: int, n: int, places: NDArray[np.int64], residual: Array, jacobian: Array
) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Program rows, shares, residuals and Jacobian after the coordinates of pairs at folds are eliminated."""
    which: list[int] = []
    shares: list[float] = []
    residuals: list[Array] = []
    blocks: list[Array] = []
    for r in range(m):
        place = places[r]
        if place < 0:
            which.append(r)
            shares.append(1.0)
            residuals.append(residual[r : r + 1])
            blocks.append(jacobian[r : r + 1, : 6 * n])
            continue
        own = [r, *range(m + 4 * place, m + 4 * place + 4)]
        u = jacobian[own, 6 * n + 4 * place : 6 * n + 4 * place + 4]
        basis = _left_null_space(u)
        which += [r] * len(basis)
        shares += basis[:, 0].tolist()
        residuals.append(basis @ residual[own])
        blocks.append(basis @ jacobian[own, : 6 * n])
    return np.array(which, dtype=np.int64), np.array(shares), np.concatenate(residuals), np.concatenate(blocks)


def _left_null_space(u: Array) -> Array:
    """Rows N^T with N^T u = 0, the gap's share of each not negative."""
    left, sizes, _ = np.linalg.svd(u)
    rank = int(np.count_nonzero(sizes > FLAT * max(1.0, sizes[0])))
    basis: Array = left[:, rank:].T
    return np.where(basis[:, :1] < 0.0, -basis, basis)


def moving_columns(places: Sequence[int]) -> NDArray[np.int64]:
    """Columns of the twists of some bodies."""
    return (6 * np.asarray(places, dtype=np.int64)[:, None] + np.arange(6)).ravel()
