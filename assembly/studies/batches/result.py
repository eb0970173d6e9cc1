"""What a batch of solves ended with: rows as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from assembly._html import printed
from assembly._read_only import ReadOnlyArrays
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError
from assembly.solve.scene import Status

__all__ = ["Batch"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Batch(ReadOnlyArrays):
    """n solves of a scene, one row each, in the given order; print it for a summary.

    Attributes
    ----------
    q : (n, bodies, 7)
        Poses; for a row that failed, those at which its solve ended.
    status : (n,) of Status
    objective : (n,)
        In the user's units.
    feasibility : (n,)
        Largest violation of a constraint, in the user's units, evaluated at `q`.
    iterations : (n,)
        Steps of the loop.
    alone : (n,) of bool
        Whether the row was solved on its own, because the compiled loop was not enough.
    parameters : tuple of Parameter
    values : (n, p)
        Of the parameters.
    of : tuple of Measure
    measures : (n, m)
        Measures; NaN in rows that failed.
    seconds : float
        Time of all rows together.
    """

    q: Array
    status: NDArray[np.object_]
    objective: Array
    feasibility: Array
    iterations: NDArray[np.int64]
    alone: NDArray[np.bool_]
    parameters: tuple[Parameter, ...] = field(repr=False)
    values: Array = field(repr=False)
    of: tuple[Measure, ...] = field(repr=False)
    measures: Array = field(repr=False)
    seconds: float

    def __len__(self) -> int:
        return len(self.q)

    @property
    def success(self) -> NDArray[np.bool_]:
        """Which rows are SOLVED or FITTED, (n,)."""
        return np.array([item is Status.SOLVED or item is Status.FITTED for item in self.status], dtype=bool)

    def measure(self, name: str) -> Array:
        """The column (n,) of a measure by its name."""
        names = [item.name for item in self.of]
        if name not in names:
            raise InputError(
                f"name is {name!r}; expected one of {', '.join(map(repr, names)) or 'none, of=() was given'}"
            )
        column: Array = self.measures[:, names.index(name)]
        return column

    def __repr__(self) -> str:
        return f"Batch({len(self)} rows, {int(self.success.sum())} solved)"

    def _repr_html_(self) -> str:
        return printed(self)

    def __str__(self) -> str:
        lines = [f"{len(self)} rows in {self.seconds:.3g} s, {int(self.alone.sum())} of them by themselves"]
        for status in Status:
            count = sum(item is status for item in self.status)
            if count:
                lines.append(f"  {status.name:<16}{count:>8}")
        for k, item in enumerate(self.of):
            column = self.measures[self.success, k]
            if column.size:
                lines.append(f"  {item.name}: {column.min():.6g} to {column.max():.6g}")
        return "\n".join(lines)
