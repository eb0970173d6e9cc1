"""Constraints that ask what others ask already, as minimal sets.

Constraints are taken in the order they were given. Where one adds less to the rank than it has, what it lacks is
in the span of earlier ones; those that are not needed for that are left out one by one (a deletion filter).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.solve.rank import Balanced

__all__ = ["dependent_sets"]

# The part of a vanishing combination of rows below which a row does not take part.
ABSENT = 1e-6


def dependent_sets(balanced: Balanced, owners: NDArray[np.int64]) -> list[tuple[int, ...]]:
    """Sets of owners of rows: the last of a set repeats what the others say, or a single one repeats itself."""
    if balanced.rank == len(balanced.rows):
        return []
    # A row that is in no vanishing combination is independent of all others.
    taking_part = np.abs(balanced.dependencies).max(axis=0) > ABSENT
    rows = {int(owner): np.flatnonzero(owners == owner) for owner in np.unique(owners[taking_part])}
    found: list[tuple[int, ...]] = []
    earlier: list[int] = []
    for owner, own in rows.items():
        rank = balanced.rank_of(own)
        if rank < len(own):
            found.append((owner,))
        grown = _grown(balanced, rows, earlier, owner)
        if grown < rank:
            needed = list(earlier)
            # The last are tried first: the first that explain it stay.
            for other in reversed(earlier):
                without = [k for k in needed if k != other]
                if _grown(balanced, rows, without, owner) == grown:
                    needed = without
            found.append((*needed, owner))
        if grown > 0:
            earlier.append(owner)
    return found


def _grown(balanced: Balanced, rows: dict[int, NDArray[np.int64]], earlier: list[int], owner: int) -> int:
    """By how much a constraint raises the rank of others."""
    before = np.concatenate([*(rows[k] for k in earlier), np.empty(0, dtype=np.int64)])
    return balanced.rank_of(np.concatenate([before, rows[owner]])) - balanced.rank_of(before)
