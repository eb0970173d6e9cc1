"""Elements of a body's tree: what a node without children stands for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Elements"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Elements(NamedTuple):
    """Elements of a tree: feature, box of parameters (n, 4), box in space, cone (see `FacetTree`)."""

    feature: Indices
    parameters: Array
    low: Array
    high: Array
    axis: Array
    half_angle: Array

    def at(self, chosen: Indices | NDArray[np.bool_]) -> Elements:
        """Some of them."""
        return Elements(
            self.feature[chosen],
            self.parameters[chosen],
            self.low[chosen],
            self.high[chosen],
            self.axis[chosen],
            self.half_angle[chosen],
        )

    @staticmethod
    def joined(parts: Sequence[Elements]) -> Elements:
        """Several as one."""
        three = np.empty((0, 3))
        none = Elements(np.empty(0, dtype=np.int64), np.empty((0, 4)), three, three, three, np.empty(0))
        return Elements(*(np.concatenate(columns) for columns in zip(none, *parts, strict=True)))
