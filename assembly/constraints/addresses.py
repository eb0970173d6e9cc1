"""Addresses of the kernels that only some scenes ask for, compiled when a scene is packed that does."""

from __future__ import annotations

from assembly._address import address_of
from assembly.constraints.trim_rows import trim_rows, trim_terms
from assembly.proximity.nearest_query import find_deepest, find_nearest
from assembly.proximity.solid_contact import search_solids, track_solids
from assembly.proximity.watch import look

__all__ = ["deepest", "solids", "trims", "watch"]


def solids() -> tuple[int, int, int]:
    """Of `track_solids`, `search_solids` and `find_nearest`."""
    return address_of(track_solids), address_of(search_solids), address_of(find_nearest)


def deepest() -> int:
    """Of `find_deepest`."""
    return address_of(find_deepest)


def trims() -> tuple[int, int]:
    """Of `trim_rows` and `trim_terms`."""
    return address_of(trim_rows), address_of(trim_terms)


def watch() -> int:
    """Of `look`."""
    return address_of(look)
