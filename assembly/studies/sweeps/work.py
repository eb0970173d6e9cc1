"""What a worker does: runs of rows, solved and measured, and given back as arrays of a chunk's rows.

The process that hands out chunks takes part in every row that any worker solves. So what goes there and back is a few
arrays for a chunk, whose cost a row is small, and not some objects for a row.
"""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Iterator
from time import perf_counter
from typing import Any, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from assembly._garbage import uncollected
from assembly.assembly import Assembly
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError
from assembly.solve.attempts.starts import moving_rows, scattered
from assembly.solve.solution import Solution
from assembly.studies.batches.solving import forget_solves
from assembly.studies.sweeps.chain import ERROR, Chain, Start, Told
from assembly.studies.sweeps.measuring import Column, measured
from assembly.studies.sweeps.processor import kernels_of

__all__ = ["Chunk", "ChunkDone", "Job", "Task", "Worker"]

Array = NDArray[np.float64]


class Job(NamedTuple):
    """What a study is of; `seed` of random starts; whether ways between rows have to be clear."""

    scene: Assembly
    parameters: tuple[Parameter, ...]
    columns: tuple[Column, ...]
    seed: int | None
    swept: bool = False


class Task(NamedTuple):
    """A run: its number, its rows, their values (k, p), where it begins, and whether others begin at its rows."""

    number: int
    rows: list[int]
    values: Array
    start: Start | None
    begins_others: bool


class Chunk(NamedTuple):
    """Runs for a worker.

    Their numbers, the rows (k,) of all and their values (k, p); of each run its count of rows, where it begins, and
    whether others begin at its rows.
    """

    numbers: list[int]
    rows: NDArray[np.int64]
    values: Array
    counts: list[int]
    starts: list[Start | None]
    begins_others: list[bool]

    def tasks(self) -> Iterator[Task]:
        """Run by run."""
        end = 0
        for number, count, start, begins in zip(
            self.numbers, self.counts, self.starts, self.begins_others, strict=True
        ):
            first, end = end, end + count
            yield Task(number, self.rows[first:end].tolist(), self.values[first:end], start, begins)


class ChunkDone(NamedTuple):
    """What came of a chunk, in the order of its rows.

    Attributes
    ----------
    runs : list of int
        The runs that are done.
    names : tuple of str
        The statuses that rows have.
    status : (k,) int
        Places in `names`.
    messages : dict of int -> str
        Of rows that have one, by their places.
    iterations : (k,) int
    values : (k, m)
        Measures.
    starts : dict of int -> list
        Of runs at whose rows others begin: where these may begin, None without a place.
    seconds : float
        That the chunk took.
    kernels : str
        The processor that the kernels are compiled for.
    interrupted : bool
        Whether Ctrl-C ended it.
    """

    runs: list[int]
    names: tuple[str, ...]
    status: NDArray[np.uint8]
    messages: dict[int, str]
    iterations: NDArray[np.int32]
    values: Array
    starts: dict[int, list[Start | None]]
    seconds: float
    kernels: str
    interrupted: bool = False

    @classmethod
    def of(cls, rows: Rows, seconds: float, kernels: str, interrupted: bool = False) -> Self:
        """Of rows that were collected one by one."""
        names = tuple(dict.fromkeys(rows.status))
        places = {name: k for k, name in enumerate(names)}
        return cls(
            rows.runs,
            names,
            np.array([places[name] for name in rows.status], dtype=np.uint8),
            {k: message for k, message in enumerate(rows.messages) if message},
            np.array(rows.iterations, dtype=np.int32),
            np.array(rows.values, dtype=np.float64).reshape(len(rows.status), -1),
            rows.starts,
            seconds,
            kernels,
            interrupted,
        )

    def __reduce__(self) -> tuple[Callable[[bytes], ChunkDone], tuple[bytes]]:
        """As bytes: Dask sends each array by itself, and of coarse rows there are two for each."""
        content = [_stacked(self.starts) if name == "starts" else each for name, each in self._asdict().items()]
        return _from_bytes, (pickle.dumps(content),)


def _stacked(starts: dict[int, list[Start | None]]) -> tuple[Any, ...]:
    """Starts of runs as arrays: which run each is of, whether there is one, and those that there are."""
    each = [start for of_run in starts.values() for start in of_run]
    there = [start for start in each if start is not None]
    counts = [len(of_run) for of_run in starts.values()]
    arrays = [np.array([start[k] for start in there]) for k in range(len(Start._fields))]
    return list(starts), counts, [start is not None for start in each], arrays


def _from_bytes(content: bytes) -> ChunkDone:
    """A chunk that was pickled."""
    done = ChunkDone(*pickle.loads(content))
    runs, counts, is_there, arrays = cast("Any", done.starts)
    remaining, each = map(Start, *arrays), iter(is_there)
    return done._replace(
        starts={
            run: [next(remaining) if next(each) else None for _ in range(count)]
            for run, count in zip(runs, counts, strict=True)
        }
    )


class Rows:
    """Rows of a chunk as they are collected: those of whole runs, and of one under way."""

    def __init__(self) -> None:
        self.runs: list[int] = []
        self.status: list[str] = []
        self.messages: list[str] = []
        self.iterations: list[int] = []
        self.values: list[list[float]] = []
        self.starts: dict[int, list[Start | None]] = {}

    def add(self, status: str, message: str, iterations: int, values: list[float]) -> None:
        """Add a row."""
        self.status.append(status)
        self.messages.append(message)
        self.iterations.append(iterations)
        self.values.append(values)

    def cut(self, count: int) -> None:
        """Leave out all but the first rows."""
        for column in (self.status, self.messages, self.iterations, self.values):
            del column[count:]


class Worker:
    """Solves runs of one study. What a run comes to depends on the run alone, whatever was computed before it."""

    def __init__(self, job: Job) -> None:
        self._job = job
        # Lists of its own, and nothing packed: what the user's scene met before, and meets after, is not its business.
        self._scene = copy.copy(job.scene)
        self._chain = Chain(self._scene, job.parameters, job.swept)
        self._nothing = [float("nan")] * len(job.columns)

    def compute(self, chunk: Chunk, say: Callable[[int], bool] = lambda _: True) -> ChunkDone:
        """Solve runs; where `say`, which hears how many rows were solved, says no, or Ctrl-C, those that are done."""
        begin = perf_counter()
        found, is_interrupted = Rows(), False
        try:
            for task in chunk.tasks():
                with uncollected():
                    starts = self._run(task, found)
                if task.begins_others:
                    found.starts[task.number] = starts
                found.runs.append(task.number)
                if not say(len(task.rows)):
                    break
        except KeyboardInterrupt:
            is_interrupted = True
        # Ctrl-C may come anywhere in a run: its rows are left out.
        found.cut(sum(chunk.counts[: len(found.runs)]))
        return ChunkDone.of(found, perf_counter() - begin, kernels_of(), is_interrupted)

    def solution(self, chunk: Chunk, row: int) -> Told:
        """That of one row of a chunk's first run."""
        task = next(chunk.tasks())
        self._begin(task)
        at = task.rows.index(row)
        return [self._row(k, values) for k, values in zip(task.rows[: at + 1], task.values.tolist(), strict=False)][-1]

    def _begin(self, task: Task) -> None:
        """Forget what solves before have changed, and begin where the run begins."""
        forget_solves(self._scene)
        if self._job.seed is None:
            self._chain.begin(task.start)

    def _run(self, task: Task, found: Rows) -> list[Start | None]:
        """Solve a run; the places at which others may begin."""
        self._begin(task)
        starts: list[Start | None] = []
        for row, values in zip(task.rows, task.values.tolist(), strict=True):
            told = self._row(row, values)
            numbers, error = self._nothing, ""
            if told.solution is not None:
                numbers, error = self._measured(told.solution)
            found.add(ERROR if error else told.status, error or told.message, told.iterations, numbers)
            if task.begins_others:
                starts.append(self._chain.place)
        return starts

    def _row(self, row: int, values: list[float]) -> Told:
        if self._job.seed is None:
            return self._chain.to(values)
        return self._chain.from_poses(self._start_of(row))

    def _start_of(self, row: int) -> Array:
        """The poses of a random start; of row 0 the bodies' own."""
        scene, seed = self._scene, self._job.seed
        if row == 0:
            return scene.q
        rng = np.random.default_rng([seed or 0, row])
        return scattered(rng, scene.q, moving_rows(scene.bodies), scene.packed().scale)

    def _measured(self, solution: Solution) -> tuple[list[float], str]:
        """The numbers of a solution, and what is wrong with one of them."""
        found, wrong = [], ""
        for column in self._job.columns:
            try:
                found.append(measured(column, solution))
            except InputError as error:
                found.append(float("nan"))
                wrong = wrong or str(error)
            except Exception as error:
                found.append(float("nan"))
                wrong = wrong or f"measure {column.name!r} raised {type(error).__name__}: {error}"
        return found, wrong
