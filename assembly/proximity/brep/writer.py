"""What kernels read is written into two arrays: a table of integers and a pool of doubles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.brep.records import EDGE_RECORD, edge_at

__all__ = ["Writer", "edge_over"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]


class Writer:
    """A table and a pool that grow at their ends.

    Parameters
    ----------
    table_at, pool_at : int
        Where they will stand in larger ones: offsets in records are absolute.

    Attributes
    ----------
    table_at, pool_at : int
        Where the next parts will begin.
    """

    def __init__(self, table_at: int = 0, pool_at: int = 0) -> None:
        self.table_at, self.pool_at = table_at, pool_at
        self._table: list[Table] = [np.empty(0, dtype=np.int64)]
        self._pool: list[Array] = [np.empty(0)]

    def add(self, table: Sequence[int] | Table = (), pool: Sequence[float] | Array = ()) -> tuple[int, int]:
        """Append; returns where the parts begin. Until `arrays`, an array that was given may still be filled."""
        at = self.table_at, self.pool_at
        # Parts are many and small: nothing is written of what is empty.
        if len(table):
            self._table.append(np.asarray(table, dtype=np.int64).ravel())
            self.table_at += self._table[-1].size
        if len(pool):
            self._pool.append(np.asarray(pool, dtype=np.float64).ravel())
            self.pool_at += self._pool[-1].size
        return at

    def arrays(self) -> tuple[Table, Array]:
        """All that was added."""
        return np.concatenate(self._table), np.concatenate(self._pool)


def edge_over(surface: int, curve: int, endless: bool) -> Table:
    """An edge by itself: a curve on a surface, or in space with surface -1."""
    edge = np.full(EDGE_RECORD, -1, dtype=np.int64)
    record = edge_at(edge, 0)
    record.surface, record.curve = surface, curve
    record.start = record.end = -1 if endless else 0
    return edge
