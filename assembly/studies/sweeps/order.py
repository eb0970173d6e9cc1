"""In which order the rows of a plan are solved: so that a row's neighbors in the order are near it in the numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["curve_order", "snake_order"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
# Bits of a place along the curve, of all dimensions together, and of one of them.
KEY_BITS, MOST_BITS = 62, 16


def snake_order(shape: tuple[int, ...]) -> Rows:
    """Rows of a grid, the last axis fastest, there and back: neighbors differ by one step along one axis."""
    order = np.arange(shape[-1], dtype=np.int64)
    size = shape[-1]
    for count in reversed(shape[:-1]):
        order = np.concatenate([(order if k % 2 == 0 else order[::-1]) + k * size for k in range(count)])
        size *= count
    return order


def curve_order(parts: Array) -> Rows:
    """Rows (n, p), in parts of their ranges from 0 to 1, along a Hilbert curve: it jumps nowhere.

    Notes
    -----
    J. Skilling, Programming the Hilbert curve, AIP Conference Proceedings 707 (2004), 381. Rows of one cell of the
    curve stay in their order; of more than 62 numbers the first 62 count.
    """
    used = parts[:, :KEY_BITS]
    dimensions = used.shape[1]
    bits = min(MOST_BITS, KEY_BITS // dimensions)
    cells = np.minimum((np.clip(used, 0.0, 1.0) * 2.0**bits).astype(np.int64), 2**bits - 1)
    axes = [cells[:, k].copy() for k in range(dimensions)]
    _to_transposed(axes, bits)
    keys = np.zeros(len(parts), dtype=np.int64)
    for bit in range(bits - 1, -1, -1):
        for axis in axes:
            keys = (keys << 1) | ((axis >> bit) & 1)
    return np.argsort(keys, kind="stable")


def _to_transposed(axes: list[Rows], bits: int) -> None:
    """Coordinates turned, in place, into the bits of the place along the curve, those of each axis apart."""
    level = 1 << (bits - 1)
    while level > 1:
        low = level - 1
        for axis in axes:
            is_set = (axis & level) != 0
            exchanged = np.where(is_set, 0, (axes[0] ^ axis) & low)
            axes[0] ^= np.where(is_set, low, exchanged)
            if axis is not axes[0]:
                axis ^= exchanged
        level >>= 1
    for before, axis in zip(axes, axes[1:], strict=False):
        axis ^= before
    gray = np.zeros_like(axes[0])
    level = 1 << (bits - 1)
    while level > 1:
        gray = np.where((axes[-1] & level) != 0, gray ^ (level - 1), gray)
        level >>= 1
    for axis in axes:
        axis ^= gray
