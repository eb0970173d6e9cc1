"""What the compiled call of a tick takes and tells, kept from tick to tick."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._address import address_of
from assembly._lent import lent_table
from assembly._record import place_of, size_of
from assembly.constraints.program.records import CLOCK_AT
from assembly.proximity.clearance.pair_looks import stay_clear
from assembly.solve.loop_address import loop_address
from assembly.tracking.proven_pose import QUICK, ProvenPose
from assembly.tracking.tick_kernel import LENGTHS, MOVES_ROW, NOT_ASKED, ORDERS, PROOF_ROW, run_tick

if TYPE_CHECKING:
    from assembly.constraints.packing.scene import Packed

__all__ = ["TickCall"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
PROVES, UNTIL, FOUND = (place_of(ORDERS, name) for name in ("proves", "until", "found"))
TOLERANCE, TOUCHING = place_of(LENGTHS, "tolerance"), place_of(LENGTHS, "touching")


@cache
def _proof_address() -> int:
    return address_of(stay_clear)


class TickCall:
    """The compiled call of a tick.

    Parameters
    ----------
    packed : Packed
    work : sequence of array
        What `solve_program` takes behind the table: pool, settings, state, history, doubles and integers.
    """

    def __init__(self, packed: Packed, work: tuple[Array | Table, ...]) -> None:
        self._end_effectors = packed.end_effectors
        orders, lengths = np.zeros(size_of(ORDERS), dtype=np.int64), np.zeros(size_of(LENGTHS))
        for name, number in (
            ("loop", loop_address(packed.end_effectors)),
            ("proof", _proof_address()),
            ("budget", QUICK),
            ("clock", int(packed.table[CLOCK_AT])),
        ):
            orders[place_of(ORDERS, name)] = number
        # Numbers are written and read through views in half the time that arrays take.
        self._orders: Any = orders.data
        self._lengths: Any = lengths.data
        state = work[2]
        parts = state[: packed.contacts_at].reshape(-1, 7), state[packed.results_at : packed.memory_at]
        self._proof: tuple[Table, Array] = np.zeros((0, 4), dtype=np.int64), np.zeros((0, 6))
        # Where no pair has rows, there is no contact manager. The tables do not keep what they lend.
        self._kept = packed.table, packed.without_manager(), work, orders, lengths
        self._lent, self._lent_alone = (
            lent_table((table, *work, orders, lengths, *parts, *self._proof)) for table in self._kept[:2]
        )

    def run(self, without_rows: bool, tolerance: float) -> int:
        """Run the loop; how it ended. Clearances may have no rows."""
        self._orders[PROVES], self._lengths[TOLERANCE] = 0, tolerance
        return int(run_tick(self._lent_alone if without_rows else self._lent, self._end_effectors))

    def run_and_prove(
        self, without_rows: bool, tolerance: float, last: ProvenPose, until: int
    ) -> tuple[int, int | None]:
        """Run the loop, and prove the straight way to where it led; how they ended, None where that does not hold.

        Parameters
        ----------
        without_rows : bool
        tolerance : float
            The largest violation at which constraints hold.
        last : ProvenPose
        until : int
            When the time of the proof is over [ns]; 0 for never.
        """
        proof, moves = last.proof, last.moves
        proof.forget_cells()
        lent, before = proof.lent, self._proof
        if lent is not before[0] or moves is not before[1]:
            self._proof = lent, moves
            for table in (self._lent, self._lent_alone):
                table[[PROOF_ROW, MOVES_ROW]] = lent_table((lent, moves))
        orders, lengths = self._orders, self._lengths
        orders[PROVES], orders[UNTIL] = 1, until
        lengths[TOLERANCE], lengths[TOUCHING] = tolerance, last.touching
        code = int(run_tick(self._lent_alone if without_rows else self._lent, self._end_effectors))
        found = orders[FOUND]
        return code, None if found == NOT_ASKED else found
