"""What postures without a reference are measured from: where each solve starts, however the loop gets on from there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.objective_terms import (
    POSTURE,
    POSTURE_POSITION,
    TERM,
    TERM_BODY,
    TERM_FOLLOWS,
    TERM_KIND,
)
from assembly.constraints.program.objective_terms import TERM_PARAMETERS as PARAMETERS
from assembly.constraints.program.records import TERM_TABLE, TERMS

__all__ = ["following_none", "postures_from"]

Array = NDArray[np.float64]


def following_none(packed: Packed) -> NDArray[np.int64]:
    """A table for a run of the loop that measures postures from where they were measured before."""
    table = packed.table.copy()
    table[table[TERM_TABLE] :][: TERM * table[TERMS]].reshape(-1, TERM)[:, TERM_FOLLOWS] = 0
    return table


@contextmanager
def postures_from(packed: Packed, q: Array) -> Iterator[None]:
    """Postures that would follow the start of each solve are measured from poses (n, 7) meanwhile."""
    table, pool = packed.table, packed.pool
    terms = range(table[TERM_TABLE], table[TERM_TABLE] + TERM * table[TERMS], TERM)
    following = [at for at in terms if table[at + TERM_KIND] == POSTURE and table[at + TERM_FOLLOWS] == 1]
    try:
        for at in following:
            table[at + TERM_FOLLOWS] = 0
            place = table[at + PARAMETERS] + POSTURE_POSITION
            row = q[table[at + TERM_BODY]]
            pool[place : place + 3] = (row[:3] - packed.reference) / packed.scale
            pool[place + 3 : place + 7] = row[3:]
        yield
    finally:
        for at in following:
            table[at + TERM_FOLLOWS] = 1
