"""The order in which bodies of a large scene are eliminated, and the blocks of the factor that follow from it.

An envelope (`constraints/program/envelope.py`) keeps the zeros between a row's entries, which a chain has none of, a
tree or a grid many.
Bodies that meet few others leave first: the minimum degree order, from SuperLU (scipy). With it a tree has no fill at
all, and a square grid of 2,000 bodies a third of the work of its envelope.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.program.hessian_blocks import (
    ACROSS,
    BLOCK_HEADER,
    BLOCKS,
    COLUMN,
    COUNT,
    FACTORED,
    FIRST,
    MEETING,
    MEETING_AT,
    MEETING_ROW,
    PANEL,
    PLACE,
    POSITION,
)

__all__ = ["FEW", "block_record"]

Table = NDArray[np.int64]
# With so many moving bodies or fewer the dense matrix is small, and quicker to reach.
FEW = 32


def block_record(count: int, groups: Sequence[Sequence[int]]) -> Table:
    """The record of blocks (`constraints/program/hessian_blocks.py`) for so many moving bodies, numbered as among the
    unknowns.

    `groups` are those that meet in a row or in a term of the objective; negative numbers, of fixed ones, are left out.
    """
    pairs = sorted({pair for group in groups for pair in combinations(sorted({k for k in group if k >= 0}), 2)})
    place = _least_degree(count, pairs)
    rows: list[list[tuple[int, bool]]] = [[(k, False)] for k in range(count)]
    for a, b in pairs:
        p, q = int(place[a]), int(place[b])
        rows[min(p, q)].append((max(p, q), p > q))
    for row in rows:
        row.sort()
    panels = _fill([[column for column, _ in row] for row in rows])
    positions = [{column: k for k, column in enumerate(panel)} for panel in panels]
    meeting: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    for k, panel in enumerate(panels):
        for at, column in enumerate(panel[1:], 1):
            meeting[column].append((k, at))
    parts = {
        PLACE: place.tolist(),
        FIRST: _starts(rows),
        COLUMN: [column for row in rows for column, _ in row],
        POSITION: [2 * positions[k][column] + turned for k, row in enumerate(rows) for column, turned in row],
        PANEL: _starts(panels),
        ACROSS: [column for panel in panels for column in panel],
        MEETING: _starts(meeting),
        MEETING_ROW: [k for column in meeting for k, _ in column],
        MEETING_AT: [at for column in meeting for _, at in column],
    }
    header = [0] * BLOCK_HEADER
    header[COUNT], header[BLOCKS], header[FACTORED] = count, len(parts[COLUMN]), len(parts[ACROSS])
    size = BLOCK_HEADER
    for field, part in parts.items():
        header[field] = size
        size += len(part)
    return np.array(header + [value for part in parts.values() for value in part], dtype=np.int64)


def _starts(rows: Sequence[Sequence[object]]) -> list[int]:
    """Where every row begins if they stand one behind the other, and where the last one ends."""
    return [0, *np.cumsum([len(row) for row in rows]).tolist()]


def _least_degree(count: int, pairs: Sequence[tuple[int, int]]) -> Table:
    """The place of every body in the order of the factor."""
    if not pairs:
        return np.arange(count)
    # Loaded only here: it takes a tenth of a second.
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import splu

    a, b = np.array(pairs).T
    diagonal = np.arange(count)
    # Any values that need no pivoting do.
    values = np.concatenate([np.full(2 * a.size, -1.0), np.full(count, 1.0 + count)])
    rows, columns = np.concatenate([a, b, diagonal]), np.concatenate([b, a, diagonal])
    matrix = coo_matrix((values, (rows, columns)), shape=(count, count)).tocsc()
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.asarray(factor.perm_c, dtype=np.int64)


def _fill(rows: Sequence[Sequence[int]]) -> list[list[int]]:
    """The columns of every row of the factor, from those of the upper triangle: each row hands its own on to the next.

    That is the first one it meets, its parent in the tree of elimination.
    """
    panels: list[list[int]] = []
    inherited: list[set[int]] = [set() for _ in rows]
    for k, row in enumerate(rows):
        found = inherited[k].union(row)
        panel = sorted(found)
        panels.append(panel)
        if len(panel) > 1:
            found.discard(k)
            inherited[panel[1]] |= found
    return panels
