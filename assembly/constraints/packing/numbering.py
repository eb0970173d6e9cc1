"""The order of bodies among the unknowns: bodies with a common row are close together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["gathering_order", "number_bodies", "reverse_cuthill_mckee"]


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
    number = blocks.tolist()
    meeting: list[set[int]] = [set() for _ in range(moving.size)]
    for group in groups:
        own = {number[body] for body in group} - {-1}
        for block in own:
            meeting[block] |= own
    if any(meeting):
        blocks[moving[reverse_cuthill_mckee(meeting)]] = np.arange(moving.size)
    return blocks


def reverse_cuthill_mckee(meeting: Sequence[Iterable[int]]) -> list[int]:
    """The reverse Cuthill-McKee order of a graph, as scipy has it, whose modules take a tenth of a second to load.

    Parameters
    ----------
    meeting : sequence of iterable of int
        The neighbors of every node.
    """
    rows = [sorted(row) for row in meeting]
    # A node that is its own neighbor counts twice.
    degree = [len(row) + (node in row) for node, row in enumerate(rows)]
    order: list[int] = []
    seen = [False] * len(rows)
    for seed in np.argsort(np.array(degree, dtype=np.int32)).tolist():
        if seen[seed]:
            continue
        seen[seed] = True
        level = [seed]
        while level:
            order += level
            following: list[int] = []
            for node in level:
                new = [other for other in rows[node] if not seen[other]]
                for other in new:
                    seen[other] = True
                following += sorted(new, key=degree.__getitem__)
            level = following
    return order[::-1]


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
