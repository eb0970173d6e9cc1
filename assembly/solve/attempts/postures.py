"""Reference poses of postures without a reference: those where each solve starts, whatever the loop does then."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.objective_terms import POSTURE, TERM, TERM_RECORD, posture_at
from assembly.constraints.program.records import TERM_TABLE, TERMS

__all__ = ["following_none", "postures_from", "rows_measured_from"]

Array = NDArray[np.float64]


def _terms(table: NDArray[np.int64]) -> Any:
    """The records of the objective's terms, in the table itself."""
    return rows_of(TERM_RECORD, table[table[TERM_TABLE] :][: TERM * table[TERMS]].reshape(-1, TERM))


def following_none(table: NDArray[np.int64]) -> NDArray[np.int64]:
    """A copy of a table for a run of the loop that measures postures from where they were measured before."""
    table = table.copy()
    _terms(table).follows = 0
    return table


def _refer(packed: Packed, terms: Any, pool: Array, q: Array) -> None:
    """Write poses (n, 7) that postures of terms are measured from into a pool."""
    for term in terms:
        reference = posture_at(pool, term.parameters)
        reference.position[:] = (q[term.body, :3] - packed.reference) / packed.scale
        reference.quaternion[:] = q[term.body, 3:]


def rows_measured_from(packed: Packed, q: Array) -> NDArray[np.int64]:
    """A table without a contact manager for a run of the loop that measures postures from poses (n, 7)."""
    table = packed.without_manager()
    terms = _terms(table)
    following = np.flatnonzero((terms.kind == POSTURE) & (terms.follows == 1))
    _refer(packed, terms[following], packed.rows_pool, q)
    terms.follows[following] = 0
    return table


@contextmanager
def postures_from(packed: Packed, q: Array) -> Iterator[None]:
    """Postures that would follow the start of each solve are measured from poses (n, 7) meanwhile."""
    terms = _terms(packed.table)
    following = np.flatnonzero((terms.kind == POSTURE) & (terms.follows == 1))
    try:
        _refer(packed, terms[following], packed.pool, q)
        terms.follows[following] = 0
        yield
    finally:
        terms.follows[following] = 1
