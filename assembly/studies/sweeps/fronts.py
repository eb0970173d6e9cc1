"""Which rows are best in one way or another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["not_dominated"]


def not_dominated(costs: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rows of costs (n, m) that no other row is below in one column and not above in all; sorted by their costs.

    Of equal rows the first.
    """
    order = np.lexsort(costs.T[::-1])
    front: list[int] = []
    kept = np.empty((0, costs.shape[1]))
    # A row is dominated by rows before it in this order alone.
    for row in order:
        if not (kept <= costs[row]).all(axis=1).any():
            front.append(int(row))
            kept = costs[front]
    return np.array(front, dtype=np.int64)
