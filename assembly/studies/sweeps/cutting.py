"""How a plan is cut into runs, by its rows alone: who begins where, whatever computes them, and when.

Of the rows in their order every 1,024th is solved first, one from the other. From each of these every 32nd of the
rows up to the next one is, and from each of these the 31 rows up to the next one. Each of these chains is a run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["RUN", "Run", "cut", "cut_apart"]

# Rows of a run, and the runs that a coarser one begins.
RUN = 32


class Run(NamedTuple):
    """Rows that are solved one after the other.

    Attributes
    ----------
    rows : (k,) int
        Rows of the plan.
    start : int or None
        The row at whose pose the first one begins; None: where the scene stands.
    begins : tuple of int
        The runs that begin at rows of this one, by their numbers.
    """

    rows: NDArray[np.int64]
    start: int | None
    begins: tuple[int, ...]


def cut(order: NDArray[np.int64]) -> list[Run]:
    """The runs of rows in an order (n,), those first from which others begin."""
    coarse = order[:: RUN * RUN]
    blocks = [order[at : at + RUN * RUN] for at in range(0, len(order), RUN * RUN)]
    middle = [block[RUN::RUN] for block in blocks]
    # Numbers: the coarse run, one of every block that has more than 32 rows, then the fine ones.
    runs: list[Run] = []
    numbered = 1
    numbers = []
    for rows in middle:
        numbers.append(numbered if len(rows) else None)
        numbered += bool(len(rows))
    fine: list[Run] = []
    of_block: list[list[int]] = []
    for block in blocks:
        of_block.append([])
        for at in range(0, len(block), RUN):
            rows = block[at + 1 : at + RUN]
            if len(rows):
                of_block[-1].append(numbered + len(fine))
                fine.append(Run(rows, int(block[at]), ()))
    first = [own[0] for own, block in zip(of_block, blocks, strict=True) if len(block) > 1]
    runs.append(Run(coarse, None, (*(number for number in numbers if number is not None), *first)))
    for block, rows, own in zip(blocks, middle, of_block, strict=True):
        if len(rows):
            runs.append(Run(rows, int(block[0]), tuple(own[1:])))
    return runs + fine


def cut_apart(count: int) -> list[Run]:
    """Runs of rows that have nothing to do with each other."""
    rows = np.arange(count, dtype=np.int64)
    return [Run(rows[at : at + RUN], None, ()) for at in range(0, count, RUN)]
