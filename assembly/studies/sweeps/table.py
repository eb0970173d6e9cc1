"""The rows of a study: filled by runs in any order, or read from a folder."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.studies.sweeps.chain import Start
from assembly.studies.sweeps.cutting import Run
from assembly.studies.sweeps.work import RunDone, Task

__all__ = ["NOT_DONE", "Table"]

Array = NDArray[np.float64]
# Rows that an interrupted study did not come to.
NOT_DONE = "NOT_DONE"


class Table:
    """The rows of a plan (n, p) and what came of them; `starts` are those of runs that others begin at.

    Attributes
    ----------
    done : list of bool
        Of every run.
    measures : (n, m)
    """

    def __init__(self, values: Array, runs: list[Run], columns: int) -> None:
        self.values, self.runs = values, runs
        self.measures = np.full((len(values), columns), np.nan)
        self.status = np.full(len(values), NOT_DONE, dtype=object)
        self.message = np.full(len(values), "", dtype=object)
        self.iterations = np.zeros(len(values), dtype=np.int64)
        self.starts: dict[int, Start | None] = {}
        self.done = [False] * len(runs)

    def take(self, done: RunDone) -> None:
        """Write what came of a run."""
        rows = done.rows
        self.measures[rows] = done.values
        self.status[rows] = done.status
        self.message[rows] = done.messages
        self.iterations[rows] = done.iterations
        self.starts.update(zip(rows, done.starts, strict=False))
        self.done[done.number] = True

    def ready(self) -> list[int]:
        """Runs that are not done, and whose beginnings are known."""
        return [
            k for k, run in enumerate(self.runs) if not self.done[k] and (run.start is None or run.start in self.starts)
        ]

    def begun_by(self, number: int) -> list[int]:
        """Runs that are not done and begin at a run's rows."""
        return [k for k in self.runs[number].begins if not self.done[k]]

    def task(self, number: int) -> Task:
        """What a worker is told of a run."""
        run = self.runs[number]
        start = None if run.start is None else self.starts[run.start]
        return Task(number, run.rows.tolist(), self.values[run.rows], start, bool(run.begins))

    @property
    def rows_left(self) -> int:
        """How many rows are not done."""
        return sum(len(run.rows) for run, is_done in zip(self.runs, self.done, strict=True) if not is_done)

    def run_of(self, row: int) -> int:
        """The run that a row belongs to."""
        return next(k for k, run in enumerate(self.runs) if row in run.rows)

    def structured(self, fields: list[tuple[str, Any]], parameters: int) -> NDArray[np.void]:
        """A structured array with these fields: the row, parameters, measures, status, message, iterations."""
        table = np.empty(len(self.values), dtype=fields)
        names = [name for name, _ in fields]
        table[names[0]] = np.arange(len(table))
        for k, name in enumerate(names[1 : 1 + parameters]):
            table[name] = self.values[:, k]
        for k, name in enumerate(names[1 + parameters : -3]):
            table[name] = self.measures[:, k]
        for name, column in zip(names[-3:], (self.status, self.message, self.iterations), strict=True):
            table[name] = column
        return table
