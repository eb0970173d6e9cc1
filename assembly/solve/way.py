"""What is known of the way of a solve from a solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays

__all__ = ["Way"]


@dataclass(frozen=True, eq=False)
class Way(ReadOnlyArrays):
    """How far a solve with `swept=True` got, and what was in its way.

    Attributes
    ----------
    part : float
        The proven part of the way from the values of the start to the present ones: 1 at its end.
    depth : float
        The largest possible overlap of bodies on the way, in the user's unit.
    obstacles : tuple of (str, str)
        The pairs of bodies that are in the way; none if the way goes to its end, or if something else ended it.
    place : (3,)
        Where the first of these pairs meets, or nearly does, in the world; NaN if that is not known.
    reason : str
        What ended the way; empty if it goes to its end.
    """

    part: float
    depth: float
    obstacles: tuple[tuple[str, str], ...]
    place: NDArray[np.float64]
    reason: str
