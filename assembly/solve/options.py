"""Options of a solve."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError, check_options, integer, number
from assembly.solve.loop.settings import (
    ALLOWED_OVERLAP,
    FEASIBILITY,
    FINAL_UPDATE,
    FIT,
    ITERATIONS,
    PENALTY,
    PENALTY_FLOOR,
    RADIUS,
    SECOND_ORDER,
    SETTINGS,
    STATIONARITY,
)

__all__ = ["Options", "touching_part"]
# The most that may be called touching.
_MOST_TOUCHING = 1e-3


def touching_part(value: float) -> float:
    """What may be called touching, in parts of a size; raises for what is not from 0 to 0.001."""
    touching = number("touching", value)
    if not 0.0 <= touching <= _MOST_TOUCHING:
        raise InputError(f"touching is {touching:g}; expected a number from 0 to {_MOST_TOUCHING:g}")
    return touching


@dataclass(frozen=True)
class Options:
    """Options of `Assembly.solve`. Lengths are relative to the scene's size, the largest body's diagonal.

    Attributes
    ----------
    tolerance : float
        Largest violation of a constraint that counts as held.
    stationarity : float
        Largest component of the Lagrangian's gradient that counts as zero, for an objective whose
        largest weight is scaled to one.
    max_iterations : int
        Steps of the loop.
    penalty : float
        First mu of the augmented Lagrangian; a smaller one holds constraints harder from the start.
    penalty_floor : float
        Smallest mu while violations shrink; where they do not, it falls further, to 1e-10.
    radius : float
        First bound of a step: lengths relative to the scene's size, and radians.
    fit : float
        What constraints of joints, couplings and driven values that repeat each other may disagree by, as those of CAD
        files do; such a solve ends FITTED. 0: they are to agree to the tolerance.
    touching : float
        What bodies of a contact or a clearance may be in each other where the solve begins: so much is called touching,
        they need not be parted, and no contact of these goes deeper. For parts of files 1e-6 is right, say.
    keep_topology : bool
        Under a clearance, whether bodies are never put together without it, from a start at which joints or contacts
        do not hold, or from which an objective draws bodies together: to there they may pass through each other
        (`Solution.put_together` tells).
    verbose : int
        1 prints a table of the iterations after the solve; nothing is printed at 0.
    """

    tolerance: float = 2e-13
    stationarity: float = 1e-10
    max_iterations: int = 300
    penalty: float = 1e-2
    penalty_floor: float = 1e-6
    radius: float = 0.2
    fit: float = 1e-6
    touching: float = 1e-9
    keep_topology: bool = False
    verbose: int = 0

    def __post_init__(self) -> None:
        integer("max_iterations", self.max_iterations, 0, 10**9)
        integer("verbose", self.verbose, 0, 1)
        if not isinstance(self.keep_topology, bool):
            raise TypeError(f"keep_topology is {self.keep_topology!r}; expected True or False")
        for name, high in (("tolerance", 1e-2), ("stationarity", 1e-2), ("penalty", 1e3), ("radius", 1.0)):
            value = number(name, getattr(self, name))
            if not 0.0 < value <= high:
                raise InputError(f"{name} is {value:g}; expected a number above 0 and at most {high:g}")
        fit = number("fit", self.fit)
        if not 0.0 <= fit <= 1e-2:
            raise InputError(f"fit is {fit:g}; expected a number from 0 to 0.01")
        touching_part(self.touching)
        floor = number("penalty_floor", self.penalty_floor)
        if not 1e-12 <= floor <= self.penalty:
            raise InputError(f"penalty_floor is {floor:g}; expected a number from 1e-12 to penalty {self.penalty:g}")

    @classmethod
    def of(cls, options: dict[str, Any]) -> Options:
        """Options from keyword arguments; an unknown name raises and lists the known ones."""
        check_options(options, [field.name for field in fields(cls)])
        return cls(**options)

    def settings(self, warm: bool = False) -> NDArray[np.float64]:
        """The array that the compiled loop reads; a warm start knows its multipliers and holds constraints at once."""
        out = np.zeros(SETTINGS)
        out[FEASIBILITY] = self.tolerance
        out[STATIONARITY] = self.stationarity
        out[ITERATIONS] = self.max_iterations
        out[PENALTY] = self.penalty_floor if warm else self.penalty
        out[PENALTY_FLOOR] = self.penalty_floor
        out[RADIUS] = self.radius
        out[FIT] = self.fit
        out[FINAL_UPDATE] = 1.0
        out[ALLOWED_OVERLAP] = self.touching
        out[SECOND_ORDER] = 1.0
        return out
