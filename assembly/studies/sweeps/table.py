"""The rows of a study: filled by runs in any order, or read from a folder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.studies.sweeps.chain import Start
from assembly.studies.sweeps.cutting import Run
from assembly.studies.sweeps.work import Chunk, ChunkDone

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
        # Statuses as places in a list of their names, and messages of those rows that have one.
        self.names = [NOT_DONE]
        self.status = np.zeros(len(values), dtype=np.uint8)
        self.messages: dict[int, str] = {}
        self.iterations = np.zeros(len(values), dtype=np.int64)
        self.starts: dict[int, Start | None] = {}
        self.done = [False] * len(runs)

    def take(self, done: ChunkDone) -> None:
        """Write what came of a chunk."""
        if not done.runs:
            return
        rows = self.rows(done.runs)
        self.names += [name for name in done.names if name not in self.names]
        codes = np.array([self.names.index(name) for name in done.names], dtype=np.uint8)
        self.measures[rows] = done.values
        self.status[rows] = codes[done.status]
        self.iterations[rows] = done.iterations
        self.messages.update({int(rows[k]): message for k, message in done.messages.items()})
        for number, starts in done.starts.items():
            self.starts.update(zip(self.runs[number].rows.tolist(), starts, strict=True))
        for number in done.runs:
            self.done[number] = True

    def rows(self, numbers: Sequence[int]) -> NDArray[np.int64]:
        """The rows (k,) of these runs."""
        return np.concatenate([self.runs[number].rows for number in numbers])

    def ready(self) -> list[int]:
        """Runs that are not done, and whose beginnings are known."""
        return [
            k for k, run in enumerate(self.runs) if not self.done[k] and (run.start is None or run.start in self.starts)
        ]

    def begun_by(self, number: int) -> list[int]:
        """Runs that are not done and begin at a run's rows."""
        return [k for k in self.runs[number].begins if not self.done[k]]

    def chunk(self, numbers: list[int]) -> Chunk:
        """What a worker is told of runs, one at least."""
        runs = [self.runs[number] for number in numbers]
        rows = self.rows(numbers)
        starts = [None if run.start is None else self.starts[run.start] for run in runs]
        counts, begin = [len(run.rows) for run in runs], [bool(run.begins) for run in runs]
        return Chunk(numbers, rows, self.values[rows], counts, starts, begin)

    @property
    def is_whole(self) -> bool:
        """Whether all rows are done."""
        return bool(self.status.all())

    @property
    def rows_left(self) -> int:
        """How many rows are not done."""
        return sum(len(run.rows) for run, is_done in zip(self.runs, self.done, strict=True) if not is_done)

    def run_of(self, row: int) -> int:
        """The run that a row belongs to."""
        return next(k for k, run in enumerate(self.runs) if (run.rows == row).any())

    def structured(self, fields: list[tuple[str, Any]], parameters: int) -> NDArray[np.void]:
        """A structured array with these fields: the row, parameters, measures, status, message, iterations."""
        table = np.empty(len(self.values), dtype=fields)
        names = [name for name, _ in fields]
        table[names[0]] = np.arange(len(table))
        for k, name in enumerate(names[1 : 1 + parameters]):
            table[name] = self.values[:, k]
        for k, name in enumerate(names[1 + parameters : -3]):
            table[name] = self.measures[:, k]
        status, message, iterations = names[-3:]
        table[status] = np.array(self.names, dtype=object)[self.status]
        table[message] = ""
        for row, text in self.messages.items():
            table[message][row] = text
        table[iterations] = self.iterations
        return table
