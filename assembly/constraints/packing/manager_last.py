"""Table and pool of a scene in which the contact manager is written last, when it is first needed.

A manager needs trees of facets, which take longer to make than all else of a scene. A start at which all holds, as
assembled machined parts have, is told without: then they are made when contacts are first asked for, if at all.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.manager import WatchedPairs, with_manager
from assembly.constraints.packing.scene_writer import SceneWriter
from assembly.constraints.program.records import MANAGER_RECORD

__all__ = ["ManagerLast"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]


class ManagerLast:
    """A table and a pool with the contact manager behind all else, once somebody has asked for them.

    Attributes
    ----------
    rows_table, rows_pool : arrays
        What there is of them so far: rows and terms, perhaps the manager as well.
    """

    rows_table: Table
    rows_pool: Array
    # What the manager is still to be written with, and of.
    _unwritten: tuple[SceneWriter, WatchedPairs] | None = None

    @property
    def table(self) -> Table:
        """The table with the contact manager of clearances."""
        if self._unwritten is not None:
            self._write_manager()
        return self.rows_table

    @property
    def pool(self) -> Array:
        """The pool with the contact manager of clearances."""
        if self._unwritten is not None:
            self._write_manager()
        return self.rows_pool

    def _write_manager(self) -> None:
        """Write the contact manager, if there is to be one and it is not written."""
        if self._unwritten is not None:
            writer, watched = self._unwritten
            self.rows_table, self.rows_pool = with_manager((self.rows_table, self.rows_pool), writer, watched)
            self._unwritten = None
            self._take_addresses()

    def _take_addresses(self) -> None:
        """Write the addresses of kernels into the table."""
        raise NotImplementedError  # a packed scene knows which it needs

    def without_manager(self) -> Table:
        """A table of its own in which no clearance has contacts, and nothing finds any."""
        table = self.rows_table.copy()
        table[MANAGER_RECORD] = -1
        return table
