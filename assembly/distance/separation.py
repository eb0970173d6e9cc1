"""The answer of a certified distance query: two true bounds, and the points that prove the upper one.

    lower <= d <= upper,    d = min |a(s) - b(t)|

holds in floating point whatever the status; the status says why the search ended.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays, read_only

__all__ = ["Separation", "SeparationStatus"]


class SeparationStatus(Enum):
    """Why a query ended; the value says what that means."""

    CONVERGED = "the two bounds are within the tolerance of each other"
    SEPARATED = "farther apart than the clearance"
    NOT_SEPARATED = "not farther apart than the clearance: the points prove it, or a crossing"
    HIT = "the shapes meet, which is proven"
    DISJOINT = "the shapes do not meet, which is proven"
    UNDECIDED = "the distance is within the tolerance of what was asked; ask with a smaller tolerance"
    ROUNDED = "the bounds are as close as doubles let them be at coordinates of this size, not within the tolerance"
    BUDGET_SPENT = "the budget was spent first: the bounds are true and wide; allow more evaluations"


@dataclass(frozen=True, eq=False)
class Separation(ReadOnlyArrays):
    """Bounds of the distance of two shapes.

    Attributes
    ----------
    lower, upper : float
        lower <= distance <= upper, rounding included.
    parameters : (k,)
        Parameters of the points: one for a curve, two for a surface, none for a point or a hull; those of a first.
    points : (2, d)
        A point of a and a point of b, `upper` apart or less but for the rounding of their coordinates.
    status : SeparationStatus
    evaluations : int
        Pairs of pieces whose distance was bounded.
    """

    lower: float
    upper: float
    parameters: NDArray[np.float64] = field(repr=False)
    points: NDArray[np.float64]
    status: SeparationStatus
    evaluations: int

    if not TYPE_CHECKING:

        def __getattr__(self, name):
            """Parameters and points of an answer that a kernel wrote: views of its row, made when they are read."""
            written = self.__dict__.get("_written")
            if written is None or name not in ("parameters", "points"):
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            row, dimension, curves = written
            value = row[2 : 2 + curves] if name == "parameters" else row[4:10].reshape(2, 3)[:, :dimension]
            self.__dict__[name] = read_only(value)
            return self.__dict__[name]

    @property
    def converged(self) -> bool:
        """Whether the question was answered within the tolerance."""
        return self.status not in _OPEN


_OPEN = (SeparationStatus.UNDECIDED, SeparationStatus.ROUNDED, SeparationStatus.BUDGET_SPENT)
