"""How a dimension scatters about its value."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from assembly.errors import positive

__all__ = ["Distribution", "Normal", "Uniform"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Normal:
    """Normal about the parameter's value.

    Attributes
    ----------
    sigma : float
        Standard deviation, in the unit of the parameter.
    cut : float
        In sigmas: how far from its value the worst case has it. Samples are not cut.
    """

    sigma: float
    cut: float = 3.0

    def __post_init__(self) -> None:
        positive("sigma", self.sigma)
        positive("cut", self.cut)

    @property
    def half_width(self) -> float:
        """How far from its value the worst case has it."""
        return self.cut * self.sigma

    @property
    def mean_of_absolute(self) -> float:
        """The mean of how far it is from its value."""
        return sqrt(2.0 / pi) * self.sigma

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Differences from its value, (count,)."""
        return self.sigma * rng.standard_normal(count)


@dataclass(frozen=True)
class Uniform:
    """Anywhere within a distance from the parameter's value, with the same chance.

    Attributes
    ----------
    half_width : float
        In the unit of the parameter.
    """

    half_width: float

    def __post_init__(self) -> None:
        positive("half_width", self.half_width)

    @property
    def sigma(self) -> float:
        """Standard deviation."""
        return self.half_width / sqrt(3.0)

    @property
    def mean_of_absolute(self) -> float:
        """The mean of how far it is from its value."""
        return 0.5 * self.half_width

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Differences from its value, (count,)."""
        return rng.uniform(-self.half_width, self.half_width, count)


Distribution = Normal | Uniform
