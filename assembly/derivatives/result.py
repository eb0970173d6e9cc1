"""Sensitivity: the derivatives of measures of a solution by parameters, and what has none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._html import Table, as_html
from assembly._read_only import ReadOnlyArrays, read_only
from assembly.derivatives.kkt import System, solve_system
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError

__all__ = ["Layout", "Moved", "Sensitivity"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Layout(NamedTuple):
    """Where twists of bodies stand among unknowns, and rows of constraints among multipliers.

    Attributes
    ----------
    bodies, constraints : tuple of str
        Names.
    blocks : tuple of int
        Of every body its block of six unknowns; -1: it does not move.
    spans : sequence of (rows,) int
        Of every constraint its rows.
    lengths : (m,) bool
        Whether a row is a length.
    """

    bodies: tuple[str, ...]
    constraints: tuple[str, ...]
    blocks: tuple[int, ...]
    spans: Sequence[NDArray[np.int64]]
    lengths: Flags


class Least(NamedTuple):
    """Of a least move the rows that hold (m,), and how many unknowns and measured coordinates the equations have."""

    held: Flags
    unknowns: int
    coordinates: int


class Moved(NamedTuple):
    """What unknowns and multipliers (n + m, p) change by a unit of each parameter, scaled, and their units.

    Multipliers of a least move are computed from its equations (`derivatives/linearized.py`) when they are read.
    """

    layout: Layout
    numbers: Array
    scale: float
    unit: float
    least: Least | None = None
    equations: Array | None = None

    def forces(self) -> Array:
        """What multipliers (m, p) change by."""
        m, p = len(self.layout.lengths), self.numbers.shape[1]
        if self.least is None or self.equations is None:
            return self.numbers[len(self.numbers) - m :]
        held, n, e = self.least
        ends = np.cumsum([(m + e) * n, n * n, m * p])
        rows, hessian, rows_by = np.split(self.equations[: ends[-1]], ends[:-1])
        system = System(rows.reshape(-1, n)[:m], hessian.reshape(n, n), rows_by.reshape(m, p), np.zeros((n, p)), True)
        return solve_system(system, held).forces


@dataclass(frozen=True, eq=False)
class Sensitivity(ReadOnlyArrays):
    """Derivatives of measures by parameters at a solution: `d[x, r]`; print it for a table.

    Attributes
    ----------
    of : tuple of Measure
    wrt : tuple of Parameter
    matrix : (m, p)
        One row per measure, one column per parameter; NaN where there is no derivative, and `reasons` has why.
    shrinking, growing : (m, p)
        The derivatives from below and from above. They differ where a one-sided row is at its bound without a force.
    undetermined : (m,) bool
        Measures that a free motion changes: of these the derivative is that of the least move. And forces that rows
        which repeat each other share: of these it is that of the least forces.
    rank : int
        Of the rows that hold at the solution.
    reasons : mapping of parameter's name to str
    """

    of: tuple[Measure, ...]
    wrt: tuple[Parameter, ...]
    matrix: Array
    shrinking: Array
    growing: Array
    undetermined: Flags
    rank: int
    reasons: Mapping[str, str]
    # What twists and multipliers are made of when they are read.
    _moved: Moved

    @classmethod
    def smooth(
        cls,
        of: tuple[Measure, ...],
        wrt: tuple[Parameter, ...],
        matrix: Array,
        undetermined: Flags,
        rank: int,
        moved: Moved,
    ) -> Sensitivity:
        """Derivatives that are the same from both sides, in arrays of nobody else.

        A frozen dataclass takes 6 us to fill and to protect, a fifth of what all of a four-bar's derivatives do.
        """
        matrix.flags.writeable = undetermined.flags.writeable = False
        made = object.__new__(cls)
        made.__dict__.update(
            of=of,
            wrt=wrt,
            matrix=matrix,
            shrinking=matrix,
            growing=matrix,
            undetermined=undetermined,
            rank=rank,
            reasons={},
            _moved=moved,
        )
        return made

    def __getitem__(self, pair: tuple[Measure, Parameter]) -> float:
        """The derivative of a measure by a parameter; NaN where there is none."""
        measure, parameter = pair
        return float(self.matrix[_place("measure", measure, self.of), _place("parameter", parameter, self.wrt)])

    def one_sided(self, measure: Measure, parameter: Parameter) -> tuple[float, float]:
        """The derivatives as the parameter shrinks, and as it grows."""
        at = _place("measure", measure, self.of), _place("parameter", parameter, self.wrt)
        return float(self.shrinking[at]), float(self.growing[at])

    @cached_property
    def twists(self) -> Mapping[str, Array]:
        """Of every body, by name, its twists a unit of each parameter (p, 6); `poses` has them by parameter."""
        moved = self._moved
        scales = np.repeat([moved.scale, 1.0], 3)
        none = np.zeros((6, len(self.wrt)))
        blocks = [moved.numbers[6 * k : 6 * k + 6] if k >= 0 else none for k in moved.layout.blocks]
        return {name: read_only(block.T * scales) for name, block in zip(moved.layout.bodies, blocks, strict=True)}

    @cached_property
    def multipliers(self) -> Mapping[str, Array]:
        """Derivatives of `Solution.multipliers`: of every constraint, by name, (rows, p)."""
        moved, layout = self._moved, self._moved.layout
        forces = moved.forces() * moved.unit
        forces = np.where(layout.lengths[:, None], forces / moved.scale, forces)
        return {name: read_only(forces[rows]) for name, rows in zip(layout.constraints, layout.spans, strict=True)}

    @property
    def poses(self) -> dict[str, dict[Parameter, Array]]:
        """Of every body, by name, its twist (6,) a unit of each parameter: world axes, at its origin."""
        return {name: dict(zip(self.wrt, rows, strict=True)) for name, rows in self.twists.items()}

    def __str__(self) -> str:
        heads = [f"{item.name} [{item.unit}]" if item.unit else item.name for item in self.wrt]
        names = [f"{item.name} [{item.unit}]" for item in self.of]
        first = max(map(len, ["d / d", *names]))
        widths = [max(len(head), 14) for head in heads]
        lines = ["  ".join([f"{'d / d':<{first}}", *(f"{h:>{w}}" for h, w in zip(heads, widths, strict=True))])]
        for i, name in enumerate(names):
            cells = [f"{self._cell(i, k):>{width}}" for k, width in enumerate(widths)]
            way = "rows that repeat each other share it" if self.of[i].kind == "wrench" else "a free motion changes it"
            note = f"  undetermined: {way}" if self.undetermined[i] else ""
            lines.append("  ".join([f"{name:<{first}}", *cells]) + note)
        lines.append(f"rank {self.rank} of the rows that hold")
        return "\n".join([*lines, *(f"{name}: {reason}" for name, reason in self.reasons.items())])

    def _repr_html_(self) -> str:
        heads = [f"{item.name} [{item.unit}]" if item.unit else item.name for item in self.wrt]
        rows = [
            (f"{item.name} [{item.unit}]", *(self._cell(i, k) for k in range(len(heads))))
            for i, item in enumerate(self.of)
        ]
        notes = [f"{item.name}: undetermined" for item, free in zip(self.of, self.undetermined, strict=True) if free]
        notes += [f"{name}: {reason}" for name, reason in self.reasons.items()]
        return as_html(Table(("d / d", *heads), list(rows)), f"rank {self.rank} of the rows that hold", *notes)

    def _cell(self, i: int, k: int) -> str:
        low, high = self.shrinking[i, k], self.growing[i, k]
        if np.isnan(self.matrix[i, k]) and np.isfinite(low) and np.isfinite(high):
            return f"{low:.6g} | {high:.6g}"
        return "none" if np.isnan(self.matrix[i, k]) else f"{self.matrix[i, k]:.8g}"


def _place(what: str, item: object, items: Sequence[object]) -> int:
    for k, other in enumerate(items):
        if other is item:
            return k
    raise InputError(f"{what} is {item!r}; expected one of {list(items)!r}")
