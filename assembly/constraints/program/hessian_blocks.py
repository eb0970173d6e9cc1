"""The Hessian of the Lagrangian of a large scene, in blocks of six by six: for a body, or two with a common row.

An n x n matrix of thousands of unknowns is almost all zeros, and memory that is touched for the first time in every
solve costs more than the arithmetic. So scenes of many bodies have a record of blocks
(`constraints/packing/elimination_order.py`), whose rows stand in the order of the factor: a header
(`BLOCK_HEADER_RECORD`) and the lists that it names.

A block has the orientation that it has in the upper triangle in the order of the unknowns. Block e is in the six rows
from 6 e on of an array of six columns. Where lifted pairs have unknowns of their own, the matrix is dense within an
envelope, as in a small scene (`constraints/program/envelope.py`).
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of

# Header of the record: counts, then where lists begin, counted from the record (their lengths in parentheses).
BLOCK_HEADER_RECORD = record_dtype(
    "i8",
    count=1,  # N, moving bodies
    blocks=1,  # of the Hessian
    factored=1,  # blocks of the factor
    place=1,  # (N) row of the body whose twist is number k among the unknowns
    first=1,  # (N + 1) first block of every row of the Hessian, the one on the diagonal
    column=1,  # (blocks) column of a block, not before its row
    position=1,  # (blocks) twice a block's place in its row of the factor, plus one if it is transposed there
    panel=1,  # (N + 1) first block of every row of the factor
    across=1,  # (factored) columns of the factor's blocks, ascending within a row
    meeting=1,  # (N + 1) for every column: where its list of the rows above that have a block in it begins
    meeting_row=1,  # these rows
    meeting_at=1,  # the place of that block in each of these rows
    factorize_address=1,  # kernel that makes the factor
    solve_address=1,  # kernel that solves by it
)
blocks_at = record_view(BLOCK_HEADER_RECORD)
COUNT = place_of(BLOCK_HEADER_RECORD, "count")
BLOCKS = place_of(BLOCK_HEADER_RECORD, "blocks")
FACTORED = place_of(BLOCK_HEADER_RECORD, "factored")
PLACE = place_of(BLOCK_HEADER_RECORD, "place")
FIRST = place_of(BLOCK_HEADER_RECORD, "first")
COLUMN = place_of(BLOCK_HEADER_RECORD, "column")
POSITION = place_of(BLOCK_HEADER_RECORD, "position")
PANEL = place_of(BLOCK_HEADER_RECORD, "panel")
ACROSS = place_of(BLOCK_HEADER_RECORD, "across")
MEETING = place_of(BLOCK_HEADER_RECORD, "meeting")
MEETING_ROW = place_of(BLOCK_HEADER_RECORD, "meeting_row")
MEETING_AT = place_of(BLOCK_HEADER_RECORD, "meeting_at")
FACTORIZE_AT = place_of(BLOCK_HEADER_RECORD, "factorize_address")
SOLVE_AT = place_of(BLOCK_HEADER_RECORD, "solve_address")
BLOCK_HEADER = size_of(BLOCK_HEADER_RECORD)


@kernel(inline=True)
def is_blocked(order):
    """Whether the Hessian is kept by blocks now."""
    folds = order.folds
    return folds[folds.shape[0] - 1, 1] == 1


@kernel(inline=True)
def choose_storage(order, n):
    """Choose blocks if the scene has a record of them and all n unknowns are of bodies."""
    folds, blocks = order.folds, order.blocks
    by_blocks = blocks.size > 0 and n == 6 * blocks_at(blocks, 0).count
    folds[folds.shape[0] - 1, 1] = 1 if by_blocks else 0


@kernel(inner=True)
def block_row(blocks, at, other):
    """First row in the array of blocks of the block of the unknowns from `at` on and from `other` on."""
    layout = blocks_at(blocks, 0)
    p = blocks[layout.place + at // 6]
    q = blocks[layout.place + other // 6]
    column = max(p, q)
    e = blocks[layout.first + min(p, q)]
    while blocks[layout.column + e] != column:
        e += 1
    return 6 * e


@kernel(inline=True)
def spot(order, at, other):
    """Row and column of the Hessian's array where the block of the unknowns at.. and other.., at <= other, begins."""
    if is_blocked(order):
        return block_row(order.blocks, at, other), 0
    return at, other


@kernel(inner=True)
def clear_patch(order, f, g):
    """Clear the patch for the terms of two bodies. Returns where their twists f, g stand in it (negative: fixed)."""
    patch = order.scratch[1:]
    for i in range(12):
        for j in range(12):
            patch[i, j] = 0.0
    if f >= 0 and g >= 0:
        return (0, 6) if f < g else (6, 0)
    return (0 if f >= 0 else -1), (0 if g >= 0 else -1)


@kernel(inner=True)
def add_patch(order, f, g, hessian):
    """Hessian += the patch, of the bodies whose twists are at f.. and g.."""
    blocks, patch = order.blocks, order.scratch[1:]
    low = min(f, g)
    high = max(f, g)
    if low < 0:
        low = high
    if low < 0:
        return
    at = block_row(blocks, low, low)
    for i in range(6):
        for j in range(i, 6):
            hessian[at + i, j] += patch[i, j]
    if high == low:
        return
    at = block_row(blocks, low, high)
    for i in range(6):
        for j in range(6):
            hessian[at + i, j] += patch[i, 6 + j]
    at = block_row(blocks, high, high)
    for i in range(6):
        for j in range(i, 6):
            hessian[at + i, j] += patch[6 + i, 6 + j]
