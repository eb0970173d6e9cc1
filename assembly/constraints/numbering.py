"""The order of bodies among the unknowns: such that bodies which meet in a row stand close together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["number_bodies"]


def number_bodies(fixed: Sequence[bool], groups: Sequence[Sequence[int]]) -> NDArray[np.int64]:
    """The place of every body among the moving ones, -1 for a fixed one.

    Groups are bodies that meet in a row. The reverse Cuthill-McKee order keeps them near one another; scenes of few
    bodies keep the order they were given in, which costs nothing.
    """
    moving = np.flatnonzero(~np.asarray(fixed, dtype=bool))
    slots = np.full(len(fixed), -1, dtype=np.int64)
    slots[moving] = np.arange(moving.size)
    if moving.size <= 4:
        return slots
    # Loaded only here: it takes a tenth of a second.
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    pairs = {(slots[a], slots[b]) for group in groups for a in group for b in group if slots[a] >= 0 and slots[b] >= 0}
    if not pairs:
        return slots
    rows, columns = np.array(sorted(pairs)).T
    graph = csr_matrix((np.ones(rows.size), (rows, columns)), shape=(moving.size, moving.size))
    order = reverse_cuthill_mckee(graph, symmetric_mode=True)
    slots[moving[order]] = np.arange(moving.size)
    return slots
