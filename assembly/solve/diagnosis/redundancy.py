"""Redundant constraints, as minimal sets.

Constraints are taken in the order they were given. Where one adds less to the rank than it has, what it lacks is in the
span of earlier ones; those that are not needed for that are left out one by one (a deletion filter).

Ranks come from the combinations D of rows that vanish, D R = 0, which are few. Those that leave out the rows beyond a
set S are dependencies within S, so

    rank R_S = |S| - (p - rank of the columns of D beyond S),    p the number of combinations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.solve.dense.rank import Balanced
from assembly.solve.interruption import Interruption

__all__ = ["dependent_sets"]

# Entries of orthonormal combinations that count as zero: combinations are only as exact as the pose.
ABSENT = 1e-5


def dependent_sets(balanced: Balanced, owners: NDArray[np.int64], interruption: Interruption) -> list[tuple[int, ...]]:
    """Sets of owners of rows: the last of a set repeats what the others say, or a single one repeats itself."""
    if balanced.rank == len(balanced.rows):
        return []
    combinations = balanced.dependencies(interruption)
    # Rows that are tilted against each other turn combinations by about as much.
    absent = max(ABSENT, balanced.tolerance)
    # A row that is in no combination is independent of all others.
    taking_part = np.linalg.norm(combinations, axis=0) > absent
    rows = {int(owner): np.flatnonzero(owners == owner) for owner in np.unique(owners[taking_part])}

    def rank(which: Sequence[int]) -> int:
        interruption.check("redundant_sets")
        inside = np.concatenate([*(rows[k] for k in which), np.empty(0, dtype=np.int64)])
        beyond = np.delete(combinations, inside, axis=1)
        sizes = np.linalg.svd(beyond, compute_uv=False) if beyond.size else np.empty(0)
        return len(inside) - (len(combinations) - int(np.count_nonzero(sizes > absent)))

    found: list[tuple[int, ...]] = []
    earlier: list[int] = []
    for owner, own in rows.items():
        alone = rank([owner])
        if alone < len(own):
            found.append((owner,))
        grown = rank([*earlier, owner]) - rank(earlier)
        if grown < alone:
            needed = list(earlier)
            # The last ones are tried first, so that the earliest rows that explain it remain.
            for other in reversed(earlier):
                without = [k for k in needed if k != other]
                if rank([*without, owner]) - rank(without) == grown:
                    needed = without
            found.append((*needed, owner))
        if grown > 0:
            earlier.append(owner)
    return found
