"""The order of bodies among the unknowns: such that bodies which meet in a row stand close together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["gathering_order", "number_bodies"]


def number_bodies(fixed: Sequence[bool], groups: Sequence[Sequence[int]]) -> NDArray[np.int64]:
    """Which block of six unknowns every body has, numbers from 0 on; -1 for a fixed one.

    Groups are bodies that meet in a row. The reverse Cuthill-McKee order keeps them near one another; scenes of few
    bodies keep the order they were given in, which costs nothing.
    """
    moving = np.flatnonzero(~np.asarray(fixed, dtype=bool))
    blocks = np.full(len(fixed), -1, dtype=np.int64)
    blocks[moving] = np.arange(moving.size)
    if moving.size <= 4:
        return blocks
    # Loaded only here: it takes a tenth of a second.
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    pairs = {
        (blocks[a], blocks[b]) for group in groups for a in group for b in group if blocks[a] >= 0 and blocks[b] >= 0
    }
    if not pairs:
        return blocks
    rows, columns = np.array(sorted(pairs)).T
    graph = csr_matrix((np.ones(rows.size), (rows, columns)), shape=(moving.size, moving.size))
    order = reverse_cuthill_mckee(graph, symmetric_mode=True)
    blocks[moving[order]] = np.arange(moving.size)
    return blocks


def gathering_order(fixed: Sequence[bool], rows: Sequence[Sequence[int]]) -> list[tuple[int, list[int]]]:
    """Bodies one after the other, each with the rows that it shares with bodies before it alone.

    `rows` has the bodies of every row. Fixed bodies stand; where a group of bodies has none of these, the first one
    of it stands.
    """
    meeting: list[set[int]] = [set() for _ in fixed]
    for row, group in enumerate(rows):
        for body in group:
            meeting[body].add(row)
    stands = [bool(value) for value in fixed]
    order: list[tuple[int, list[int]]] = []
    ready = [body for body, value in enumerate(stands) if value]
    for seed in [*ready, *range(len(stands))]:
        queue = [seed]
        stands[seed] = True
        while queue:
            placed = queue.pop(0)
            for row in sorted(meeting[placed]):
                for body in rows[row]:
                    if not stands[body]:
                        stands[body] = True
                        held = [r for r in sorted(meeting[body]) if all(stands[other] for other in rows[r])]
                        order.append((body, held))
                        queue.append(body)
    return [(body, held) for body, held in order if held]
