"""What a study found: one row per design, as a table, pictures, and the best of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._html import printed
from assembly._read_only import ReadOnlyArrays
from assembly._turn import in_turn
from assembly.errors import InputError, integer, items
from assembly.solve.solution import Solution
from assembly.studies.sweeps.fronts import not_dominated
from assembly.studies.sweeps.plans import Plan
from assembly.studies.sweeps.table import Table
from assembly.studies.sweeps.work import Job, Worker

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from assembly.assembly import Assembly

__all__ = ["Study"]

HELD = ("SOLVED", "FITTED")
# Kinds of failures that are printed.
SHOWN = 6


@dataclass(frozen=True, eq=False)
class Study(ReadOnlyArrays):
    """The designs of a plan and what came of them; print it for a summary.

    Attributes
    ----------
    table : (n,) structured array
        One row per design, in the plan's order: "row", the parameters, the measures, "status", "message", "iterations".
        Measures of a row that has no solution are NaN. `status` is the name of a `Status`, or "BRANCH_ENDED": its
        branch ends between the row before and this one; "REFUSED": the scene cannot have its numbers; "ERROR": a
        measure, or the solve, raised; "NOT_DONE": the study was interrupted before.
    plan : Plan
    measures : tuple of str
        Names of their columns.
    units : tuple of str
        Theirs.
    interrupted : bool
        Whether rows are left that were not come to.
    kernels : str
        The processor that the kernels were compiled for. With the same one the bits are the same, whoever computes.
    """

    table: NDArray[np.void]
    plan: Plan
    measures: tuple[str, ...]
    units: tuple[str, ...]
    interrupted: bool
    kernels: str
    _rows: Table = field(repr=False)
    _job: Job = field(repr=False)

    def __len__(self) -> int:
        return len(self.table)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column, (n,)."""
        self._check_column("name", name)
        column: NDArray[Any] = self.table[name]
        return column

    @property
    def success(self) -> NDArray[np.bool_]:
        """Which rows have a solution, (n,)."""
        found: NDArray[np.bool_] = np.isin(self.table["status"].astype(str), HELD)
        return found

    def best(self, measure: str, *, largest: bool = False) -> np.void:
        """The row with the least of a measure, or the largest; of equal ones the first.

        Raises
        ------
        InputError
            No such measure, or no row has a solution.
        """
        self._check_measure("measure", measure)
        rows = np.flatnonzero(self.success)
        if not len(rows):
            raise InputError(f"no row has a solution: {self._counts()}; expected one at least")
        values = self.table[measure][rows]
        row: np.void = self.table[rows[np.argmax(values) if largest else np.argmin(values)]]
        return row

    def pareto(self, *, minimize: str | Sequence[str] = (), maximize: str | Sequence[str] = ()) -> NDArray[np.void]:
        """The rows that no other row is better than in one of these measures and as good in all.

        Returns
        -------
        (k,) structured array
            In the order of the first measure; of equal rows the first.

        Raises
        ------
        InputError
            No such measures.
        """
        named = [*_names("minimize", minimize), *_names("maximize", maximize)]
        if not named:
            raise InputError("minimize and maximize are empty; expected measures")
        for name in named:
            self._check_measure("pareto", name)
        rows = np.flatnonzero(self.success)
        signs = [1.0] * len(_names("minimize", minimize)) + [-1.0] * len(_names("maximize", maximize))
        costs = np.stack([sign * self.table[name][rows] for sign, name in zip(signs, named, strict=True)], axis=1)
        return self.table[rows[not_dominated(costs)]]

    def solution(self, row: int) -> Solution:
        """The solution of a row, with the same bits: its run is solved again up to it, and the scene is left as it is.

        Raises
        ------
        InputError
            No such row, or it has no solution.
        """
        k = integer("row", row, 0, len(self) - 1)
        if not self.success[k]:
            raise InputError(f"row {k} is {self.table['status'][k]}; expected one that has a solution")
        return _solved_again(self._job.scene, self._job, self._rows, k)

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame`, its index the row.

        Raises
        ------
        ImportError
            Without pandas.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("to_pandas needs pandas, which is not installed; install the extra tables") from None
        return pandas.DataFrame({name: self.table[name] for name in self.table.dtype.names or ()}).set_index("row")

    def to_xarray(self) -> Any:
        """The measures and statuses of a grid as an `xarray.Dataset`, a dimension a parameter.

        Raises
        ------
        InputError
            The plan is no grid.
        ImportError
            Without xarray.
        """
        if not self.plan.axes:
            raise InputError(f"the plan is {self.plan!r}; expected a grid, or to_pandas")
        try:
            import xarray
        except ImportError:
            raise ImportError("to_xarray needs xarray, which is not installed; install the extra tables") from None
        names, shape = self.plan.names, tuple(map(len, self.plan.axes))
        fields = [*self.measures, "status", "iterations"]
        data = {name: (names, self.table[name].reshape(shape)) for name in fields}
        return xarray.Dataset(data, coords=dict(zip(names, self.plan.axes, strict=True)))

    def plot(self, measure: str | None = None, other: str | None = None, *, axes: Axes | None = None) -> Axes:
        """A measure over the parameters, or one measure over another one with the front of both, by matplotlib.

        One parameter gives a line, two a map of colors, more the values in the order of the rows.

        Parameters
        ----------
        measure : str, optional
            By default the first.
        other : str, optional
            Then dots of `measure` (across) and `other` (up), with the rows of `pareto` for least ones, or, of a name
            with "-" before it, largest ones.
        axes : matplotlib Axes, optional
            Where it is drawn.

        Raises
        ------
        ImportError
            Without matplotlib, of the extra `plot`.
        """
        from assembly.view.study_plot import plot_study

        return plot_study(self, measure, other, axes)

    def __repr__(self) -> str:
        return f"Study({self.plan.kind}, {len(self)} rows, {self._counts()})"

    def _repr_html_(self) -> str:
        return printed(self)

    def __str__(self) -> str:
        lines = [f"{len(self)} designs ({self.plan.kind}): {self._counts()}"]
        held = self.success
        for parameter, values in zip(self.plan.names, self.plan.values.T, strict=True):
            lines.append(f"  {parameter}: {values.min():.6g} to {values.max():.6g}")
        for name, unit in zip(self.measures, self.units, strict=True):
            values = self.table[name][held]
            label = f"{name} [{unit}]" if unit else name
            lines.append(f"  {label}: {values.min():.8g} to {values.max():.8g}" if len(values) else f"  {label}: none")
        said = Counter(self.table["message"][~held].tolist())
        for message, count in [item for item in said.most_common(SHOWN) if item[0]]:
            lines.append(f"  {count} x {message}")
        if self.interrupted:
            lines.append("  interrupted; the same call goes on from here if it has a folder=")
        return "\n".join(lines)

    def _counts(self) -> str:
        counts = Counter(self.table["status"].tolist())
        return ", ".join(f"{count} {status}" for status, count in counts.most_common())

    def _check_column(self, argument: str, name: Any) -> None:
        if name not in (self.table.dtype.names or ()):
            known = ", ".join(map(repr, self.table.dtype.names or ()))
            raise InputError(f"{argument} is {name!r}; expected one of {known}")

    def _check_measure(self, argument: str, name: Any) -> None:
        if name not in self.measures:
            raise InputError(f"{argument} is {name!r}; expected one of {', '.join(map(repr, self.measures))}")


@in_turn
def _solved_again(_: Assembly, job: Job, rows: Table, k: int) -> Solution:
    """The solution of a row of a study of a scene, whose numbers are others meanwhile."""
    from assembly.derivatives.response import values_set

    with values_set(job.parameters, [parameter.value for parameter in job.parameters]):
        told = Worker(job).solution(rows.chunk([rows.run_of(k)]), k)
    assert told.solution is not None
    return told.solution


def _names(argument: str, given: str | Sequence[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else items(argument, given, "names of measures")


def new_study(table: Table, plan: Plan, job: Job, kernels: str) -> Study:
    """A study of a table."""
    names = [*plan.names, *(column.name for column in job.columns)]
    fields: list[tuple[str, Any]] = [("row", np.int64), *((name, np.float64) for name in names)]
    fields += [("status", object), ("message", object), ("iterations", np.int64)]
    return Study(
        table=table.structured(fields, len(plan.names)),
        plan=plan,
        measures=tuple(column.name for column in job.columns),
        units=tuple(column.unit for column in job.columns),
        interrupted=not table.is_whole,
        kernels=kernels,
        _rows=table,
        _job=job,
    )
