"""What a solve works in, and the compiled call of one that goes on from a solution in the same memory.

Every array that Python gives to a kernel costs 0.1 us, and to read a number from one as much. So the arrays of a solve
that goes on are lent by a table of their addresses, as those of a tick are, and what it tells is read through views.
"""

from __future__ import annotations

from ctypes import addressof, c_char
from threading import get_ident
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly._lent import lent_table
from assembly._record import place_of, size_of
from assembly.constraints.packing.scene import Packed
from assembly.solve.interruption import CTRL_C
from assembly.solve.loop.settings import COUNT, HISTORY
from assembly.solve.loop.workspace import workspace_needed
from assembly.solve.loop_address import loop_address
from assembly.solve.scene_settings import scene_settings
from assembly.solve.straight_kernel import ORDERS, run_straight

__all__ = ["Workspace", "new_workspace"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Rows of history that are kept, beside the first.
MOST_HISTORY = 1000
ITERATIONS = place_of(ORDERS, "iterations")


def new_workspace(packed: Packed) -> tuple[Array, Array, Table]:
    """The workspace of a solve of a packed scene: its history, and two blocks of memory.

    Zeros, because a solve leaves whole records in its state, including fields that their kind does not use.
    """
    doubles, integers = workspace_needed(packed.rows_table)
    return np.zeros((MOST_HISTORY + 1, HISTORY)), np.zeros(int(doubles)), np.zeros(int(integers), dtype=np.int64)


class Workspace:
    """Memory of one solve at a time, of a packed scene or a twin of it.

    Attributes
    ----------
    arrays : three arrays
        What `solve_program` takes behind the state: history, doubles and integers.
    """

    __slots__ = ("_history", "_kept", "_lent", "_orders", "_pool", "_thread", "arrays")

    def __init__(self, packed: Packed) -> None:
        self.arrays = new_workspace(packed)
        # Whose arrays are lent, and on which thread.
        self._pool: Array | None = None
        self._thread = 0
        self._kept: tuple[Any, ...] = ()

    def go_on(self, packed: Packed, state: Array) -> int:
        """Run the loop on a state that a solution has left, which is written to; how it ended."""
        if self._thread != get_ident():
            self._lend(packed)
        elif self._pool is not packed.rows_pool:
            self._lend_numbers(packed)
        return int(run_straight(self._lent, state, packed.end_effectors))

    def rows_of_history(self) -> bytes:
        """The figures of every iteration that `go_on` made, and of the start."""
        rows: bytes = self._history[: HISTORY * (self._orders[ITERATIONS] + 1)].tobytes()
        return rows

    def _lend_numbers(self, packed: Packed) -> None:
        """Lend table and pool of a twin of whose were lent, as where rows of a study have other numbers."""
        self._pool = None
        arrays = packed.rows_table, packed.rows_pool
        row: Any
        array: Any
        for row, array in zip(self._lent, arrays, strict=False):
            # What `ctypes.data` of an array tells, in a fifth of the time.
            row[0], row[1] = addressof(c_char.from_buffer(array)), array.size
        self._kept = (*arrays, *self._kept[2:])
        self._pool = packed.rows_pool

    def _lend(self, packed: Packed) -> None:
        """Lend the arrays of a packed scene, and settings for this thread."""
        # A signal's handler may raise anywhere below: what is lent is then nobody's.
        self._thread = 0
        settings = scene_settings({}, CTRL_C, not packed.is_implicit, True)
        orders = np.zeros(size_of(ORDERS), dtype=np.int64)
        orders[place_of(ORDERS, "loop")] = loop_address(packed.end_effectors)
        orders[place_of(ORDERS, "count_at")] = packed.results_at + COUNT
        # Where angles are coupled, they are started before.
        driven = [] if packed.has_coupled_angles else packed.driven_angles
        angles = np.array(driven, dtype=np.int64).reshape(-1, 2)
        lent = packed.rows_table, packed.rows_pool, settings, *self.arrays, orders, angles
        self._lent = lent_table(lent)
        # The table does not keep what it lends.
        self._kept = lent
        self._orders: Any = orders.data
        self._history: Any = self.arrays[0].reshape(-1).data
        self._pool, self._thread = packed.rows_pool, get_ident()
