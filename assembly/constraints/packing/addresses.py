"""Addresses of kernels that only some scenes need, compiled when such a scene is packed."""

from __future__ import annotations

from functools import cache

from assembly._address import address_of
from assembly.constraints.program.block_factor import factorize_blocks, solve_blocks
from assembly.constraints.program.contact import contact_rows
from assembly.constraints.program.lifted_contact import free_row, free_terms
from assembly.constraints.program.place import place_terms
from assembly.constraints.program.tapes import run_scene_tape
from assembly.constraints.program.trim import trim_rows
from assembly.constraints.program.trim_corners import trim_sides
from assembly.constraints.program.trim_hessian import trim_terms
from assembly.proximity.extrema.global_start import start_surfaces
from assembly.proximity.extrema.lifted_pair import coordinate_lengths, has_stayed, is_extremal
from assembly.proximity.features.nearest_query import find_deepest, find_nearest
from assembly.proximity.features.solid_contact import search_solids, track_solids
from assembly.proximity.manager.contact_place import mark_places
from assembly.proximity.manager.motion_bounds import measure_parts, went_beyond
from assembly.proximity.manager.update import update

__all__ = [
    "blocks",
    "contacts",
    "deepest",
    "place_objectives",
    "places",
    "sides",
    "solids",
    "surfaces",
    "tapes",
    "trims",
    "manager",
]

# A kernel stays where it is, and finding out where takes as long as a tenth of what a small scene is packed in.
_address = cache(address_of)


def blocks() -> tuple[int, int]:
    """Of `factorize_blocks` and `solve_blocks`."""
    return _address(factorize_blocks), _address(solve_blocks)


def contacts() -> int:
    """Of `contact_rows`."""
    return _address(contact_rows)


def surfaces() -> list[int]:
    """Of `start_surfaces`, `coordinate_lengths`, `free_row`, `free_terms` and `is_extremal`."""
    return [_address(entry) for entry in (start_surfaces, coordinate_lengths, free_row, free_terms, is_extremal)]


def tapes() -> int:
    """Of `run_scene_tape`."""
    return _address(run_scene_tape)


def solids() -> tuple[int, int, int]:
    """Of `track_solids`, `search_solids` and `find_nearest`."""
    return _address(track_solids), _address(search_solids), _address(find_nearest)


def deepest() -> int:
    """Of `find_deepest`."""
    return _address(find_deepest)


def places() -> int:
    """Of `mark_places`."""
    return _address(mark_places)


def trims() -> tuple[int, int]:
    """Of `trim_rows` and `trim_terms`."""
    return _address(trim_rows), _address(trim_terms)


def place_objectives() -> int:
    """Of `place_terms`."""
    return address_of(place_terms)


def sides() -> int:
    """Of `trim_sides`."""
    return _address(trim_sides)


def manager() -> tuple[int, int, int, int]:
    """Of `update`, `has_stayed`, `measure_parts` and `went_beyond`."""
    return _address(update), _address(has_stayed), _address(measure_parts), _address(went_beyond)
