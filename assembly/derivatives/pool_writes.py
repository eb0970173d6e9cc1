"""Where the pool of a packed scene has the numbers of parameters: what a batch writes there, row by row.

The scene stays in the unit that it has: one whose size follows a parameter is solved over the size that it has now.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.packing.scene_size import check_reach
from assembly.derivatives.numbers import FrameOrigin, RowNumber, TargetNumber
from assembly.derivatives.parameter import Parameter
from assembly.errors import FARTHEST

__all__ = ["PoolWrite", "check_writes", "pool_writes"]

Array = NDArray[np.float64]
# Numbers of a frame in the pool, and of a term before its target.
FRAME, MARK = 12, 3


class PoolWrite(NamedTuple):
    """A place of the pool that a parameter is written to: (sign * value - offset) / unit.

    Attributes
    ----------
    place : int
    sign, offset, unit : float
    """

    place: int
    sign: float
    offset: float
    unit: float

    def numbers(self, values: Array) -> Array:
        """What the pool has for values (n,)."""
        numbers: Array = (self.sign * values - self.offset) / self.unit
        return numbers


def pool_writes(packed: Packed, parameter: Parameter) -> list[PoolWrite] | None:
    """The places of a parameter; None where its value changes more than numbers at places of their own."""
    number = parameter._number
    if isinstance(number, RowNumber):
        return _of_row(packed, number) or None
    if isinstance(number, TargetNumber):
        axis = number.axis
        return [
            PoolWrite(at + axis, 1.0, float(packed.reference[axis]), packed.scale)
            for term, at in packed._targets
            if term is number.term
        ] or None
    if isinstance(number, FrameOrigin):
        return _of_frame(packed, number) or None
    return None


def check_writes(name: str, write: PoolWrite, numbers: Array, scale: float) -> None:
    """Raise where a length is so many times the scene's size that squares of it overflow."""
    if numbers.size and not np.abs(numbers).max() <= FARTHEST:
        check_reach(f"a value of {name!r}", float(np.abs(numbers).max()) * write.unit, scale)


def _of_row(packed: Packed, number: RowNumber) -> list[PoolWrite]:
    """Of a driven value, a limit or an offset."""
    found = []
    for equation, at, unit in packed._sources:
        assert equation.source is not None
        owner, attribute = equation.source
        if owner is number.owner and attribute == number.attribute:
            found.append(PoolWrite(at, equation.place()[2], 0.0, unit))
    return found


def _of_frame(packed: Packed, number: FrameOrigin) -> list[PoolWrite]:
    """Of a coordinate of a frame's origin, wherever the frame is."""
    found = []
    at = packed.frames_at
    for pair in packed._frames:
        for frame in (pair.frame_a, pair.frame_b):
            if getattr(frame, "base", frame) is number.frame:
                found.append(PoolWrite(at + number.axis, 1.0, 0.0, packed.scale))
            at += FRAME
    for term, place in packed._targets:
        mark = getattr(term, "frame", None)
        if mark is not None and getattr(mark, "base", mark) is number.frame:
            found.append(PoolWrite(place - MARK + number.axis, 1.0, 0.0, packed.scale))
    return found
