"""What a worker does: runs of rows, solved and measured, and given back as plain numbers."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError
from assembly.solve.attempts.starts import moving_rows, scattered
from assembly.solve.solution import Solution
from assembly.studies.sweeps.chain import ERROR, Chain, Start, Told
from assembly.studies.sweeps.measuring import Column, measured
from assembly.studies.sweeps.processor import kernels_of

__all__ = ["ChunkDone", "Job", "RunDone", "Task", "Worker"]

Array = NDArray[np.float64]


class Job(NamedTuple):
    """What a study is of; `seed` of random starts."""

    scene: Assembly
    parameters: tuple[Parameter, ...]
    columns: tuple[Column, ...]
    seed: int | None


class Task(NamedTuple):
    """A run: its number, its rows, their values (k, p), where it begins, and whether others begin at its rows."""

    number: int
    rows: list[int]
    values: Array
    start: Start | None
    begins_others: bool


class RunDone(NamedTuple):
    """What came of a run, one row per place in the lists; `starts` are where others may begin, None without one."""

    number: int
    rows: list[int]
    status: list[str]
    messages: list[str]
    iterations: list[int]
    values: list[list[float]]
    starts: list[Start | None]


class ChunkDone(NamedTuple):
    """Runs, the seconds that they took, the processor that the kernels are compiled for, whether Ctrl-C ended it."""

    runs: list[RunDone]
    seconds: float
    kernels: str
    interrupted: bool = False


class Worker:
    """Solves runs of one study. What a run comes to depends on the run alone, whatever was computed before it."""

    def __init__(self, job: Job) -> None:
        self._job = job
        # Lists of its own, and nothing packed: what the user's scene met before, and meets after, is not its business.
        self._scene = copy.copy(job.scene)
        self._chain = Chain(self._scene, job.parameters)
        self._nothing = [float("nan")] * len(job.columns)

    def compute(self, tasks: Sequence[Task], say: Callable[[int], bool] = lambda _: True) -> ChunkDone:
        """Solve runs; where `say`, which hears how many rows were solved, says no, or Ctrl-C, those that are done."""
        begin = perf_counter()
        done: list[RunDone] = []
        is_interrupted = False
        try:
            for task in tasks:
                done.append(self._run(task))
                if not say(len(task.rows)):
                    break
        except KeyboardInterrupt:
            is_interrupted = True
        return ChunkDone(done, perf_counter() - begin, kernels_of(), is_interrupted)

    def solution(self, task: Task, row: int) -> Told:
        """That of one row of a run."""
        self._begin(task)
        at = task.rows.index(row)
        return [self._row(k, values) for k, values in zip(task.rows[: at + 1], task.values.tolist(), strict=False)][-1]

    def _begin(self, task: Task) -> None:
        """Forget what solves before have changed: places for contacts, corners, what is proven of pairs."""
        packed = self._scene._packed
        if packed is None or packed.kept or packed.contacts:
            self._scene._has_changed()
            self._scene._crowding = 1
        if self._job.seed is None:
            self._chain.begin(task.start)

    def _run(self, task: Task) -> RunDone:
        self._begin(task)
        done = RunDone(task.number, task.rows, [], [], [], [], [])
        for row, values in zip(task.rows, task.values.tolist(), strict=True):
            told = self._row(row, values)
            found, error = self._nothing, ""
            if told.solution is not None:
                found, error = self._measured(told.solution)
            done.status.append(ERROR if error else told.status)
            done.messages.append(error or told.message)
            done.iterations.append(told.iterations)
            done.values.append(found)
            if task.begins_others:
                done.starts.append(self._chain.place)
        return done

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
