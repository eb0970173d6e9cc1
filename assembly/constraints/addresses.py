"""Addresses of the kernels that only some scenes ask for, compiled when a scene is packed that does."""

from __future__ import annotations

import numpy as np

from assembly._address import address_of
from assembly.constraints.trim_rows import trim_rows, trim_terms
from assembly.proximity.nearest_query import find_deepest, find_nearest
from assembly.proximity.solid_contact import search_solids, track_solids
from assembly.proximity.watch import look

__all__ = ["deepest", "solids", "trims", "watch"]

# Examples of arguments, for their types: a count, a number, and arrays of both.
_I, _F = np.int64(0), 0.0
_INTEGERS, _ROW, _BLOCK = np.zeros(1, dtype=np.int64), np.zeros(1), np.zeros((1, 1))
_PLACES = np.zeros((1, 1), dtype=np.int64)
_PACKED = (_INTEGERS, _ROW)


def solids() -> tuple[int, int, int]:
    """Of `track_solids`, `search_solids` and `find_nearest`."""
    return (
        address_of(track_solids, *_PACKED, _I, _I, _I, _I, _BLOCK, _BLOCK, _F, _BLOCK, _BLOCK, _I),
        address_of(search_solids, *_PACKED, _I, _I, _I, _I, _BLOCK, _I, _I, _BLOCK, _I),
        address_of(find_nearest, *_PACKED, _I, _I, _BLOCK, _F, _INTEGERS, _ROW),
    )


def deepest() -> int:
    """Of `find_deepest`."""
    return address_of(find_deepest, *_PACKED, _I, _I, _BLOCK, _F, _INTEGERS, _ROW)


def trims() -> tuple[int, int]:
    """Of `trim_rows` and `trim_terms`."""
    return (
        address_of(trim_rows, *_PACKED, _INTEGERS, _BLOCK, _BLOCK, _BLOCK, _BLOCK, _ROW, _BLOCK),
        address_of(trim_terms, *_PACKED, _I, _INTEGERS, _BLOCK, _PLACES, _BLOCK, _BLOCK, _BLOCK, _F, _BLOCK),
    )


def watch() -> int:
    """Of `look`."""
    return address_of(look, *_PACKED, _I, _ROW, _BLOCK, _BLOCK, _I)
