"""What a proof says of a pair of bodies."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays, read_only

__all__ = ["Answer", "Contacts", "Verdict", "is_proven"]

Array = NDArray[np.float64]
NOWHERE = read_only(np.full(3, np.nan))


class Verdict(Enum):
    """What two bodies are to each other; the value says it in a sentence."""

    CLEAR = "apart by at least the bound, and neither is within the other"
    TOUCHING = "clear once one of them is moved, or made slimmer, by no more than the depth"
    CROSSING = "their boundaries cross, and no translation by less than the depth undoes it"
    ENCLOSED = "one is wholly within the other, their boundaries apart by at least the bound"
    UNDECIDED = "none of this is proven within the budget"


@dataclass(frozen=True, eq=False)
class Answer(ReadOnlyArrays):
    """What is proven of a pair of bodies.

    Attributes
    ----------
    verdict : Verdict
    bound : float
        A lower bound of the distance of their boundaries; -inf where none is known.
    depth : float
        See `Verdict`.
    place : (3,)
        Of a crossing, where it was found, in the world; else NaN. Both boundaries are as near as cells that prove it
        are to them; of wires it is a point of a piece's spine.
    swept : bool
        Whether the way from the last look is proven as well.
    part : float
        Of that way, up to where it was looked at.
    """

    verdict: Verdict
    bound: float = -np.inf
    depth: float = 0.0
    place: Array = field(default_factory=lambda: NOWHERE)
    swept: bool = False
    part: float = 1.0


class Contacts(NamedTuple):
    """Contacts of a pair of bodies, in the world.

    Attributes
    ----------
    normals, places : (m, 3)
        Unit vectors from the first body to the second, and points of the second.
    gaps : (m,)
        Over the least gap.
    """

    normals: Array
    places: Array
    gaps: Array


def is_proven(answer: Answer) -> bool:
    """Whether bodies are clear, or only touch."""
    return answer.verdict in (Verdict.CLEAR, Verdict.TOUCHING)
