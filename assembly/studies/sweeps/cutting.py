"""How a plan is cut into runs, by its rows alone: which row starts from which, whoever computes them.

Of 10,000 rows in their order every 1,024th is solved first, one from the other. From each of these every 32nd of the
rows up to the next one is, and from each of these the 31 rows up to the next one. Each of these chains is a run. Of
more rows the first of them are every 32,768th, and so on: no chain is longer than 32, so that workers need not wait for
one.
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
    count, stride = len(order), 1
    while stride * RUN < count:
        stride *= RUN
    rows, starts = [order[::stride]], [-1]
    # Of every place in the order the run that it is in.
    owner = np.zeros(count, dtype=np.int64)
    while stride > 1:
        stride //= RUN
        for head in range(0, count, stride * RUN):
            places = slice(head + stride, head + stride * RUN, stride)
            if head + stride < count:
                owner[places] = len(rows)
                rows.append(order[places])
                starts.append(head)
    begins: list[list[int]] = [[] for _ in rows]
    for number, start in enumerate(starts[1:], 1):
        begins[owner[start]].append(number)
    return [
        Run(own, None if start < 0 else int(order[start]), tuple(others))
        for own, start, others in zip(rows, starts, begins, strict=True)
    ]


def cut_apart(count: int) -> list[Run]:
    """Runs of rows that have nothing to do with each other."""
    rows = np.arange(count, dtype=np.int64)
    return [Run(rows[at : at + RUN], None, ()) for at in range(0, count, RUN)]
