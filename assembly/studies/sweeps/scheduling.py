"""Runs handed to workers in chunks of about the requested duration, until all are done.

Of an executor nothing is used but `submit`, and that its futures say when they are done.
"""

from __future__ import annotations

import heapq
import os
import pickle
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Protocol

from assembly._turn import in_turn
from assembly.errors import AssemblyError, InputError
from assembly.studies.sweeps.table import Table
from assembly.studies.sweeps.task import Parcel, compute
from assembly.studies.sweeps.work import ChunkDone, Job, Worker

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Executor", "Take", "StudyError", "Waiting", "in_process", "on_executor", "sent"]

# What a row is taken to take before any is measured, in seconds.
FIRST_GUESS = 1e-3
# Chunks that a worker has to come at least, where there are rows for them. With two of them at a worker, one that is
# half as fast as others ends with them.
SHARES = 4
# The part of the requested time that a chunk takes at least, near the end too. A chunk costs c besides its solves, and
# a worker waits half a chunk at the end: with chunks of m the sum of both is least for m = 2 SHARES c. With Dask c is
# about 6 ms, of client, scheduler and worker together: 50 ms, a tenth of the default.
LEAST_PART = 0.1
# Chunks that wait for each worker, so that none is idle while a chunk comes back.
AHEAD = 2
# Takes a chunk that is done: whether the study goes on.
Take = Callable[[ChunkDone], bool]


class Executor(Protocol):
    """What runs a function elsewhere: of `concurrent.futures`, `mpi4py.futures`, executorlib, or a client of Dask."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Any:
        """A future of fn(*args)."""


class StudyError(AssemblyError, RuntimeError):
    """A study's workers were ended, or disagree about what they compute with."""


class Waiting:
    """Runs that are ready, the coarse ones first, and how long a row takes."""

    def __init__(self, table: Table, seconds: float, workers: int) -> None:
        self._table, self._seconds, self._workers = table, seconds, workers
        self._ready = table.ready()
        # Rows of these, and all that no worker has yet.
        self._at_hand = sum(len(table.runs[number].rows) for number in self._ready)
        self._left = table.rows_left
        self._spent, self._solved = 0.0, 0

    def __bool__(self) -> bool:
        return bool(self._ready)

    def took(self, done: ChunkDone) -> None:
        """Learn how long rows take, and which runs may begin now."""
        for run in done.runs:
            for number in self._table.begun_by(run):
                heapq.heappush(self._ready, number)
                self._at_hand += len(self._table.runs[number].rows)
        self._solved += len(done.status)
        self._spent += done.seconds

    def chunk(self) -> list[int]:
        """The next runs: for so many seconds, or less near the end, down to a tenth of them."""
        a_row = self._spent / self._solved if self._solved else FIRST_GUESS
        # A single worker has nobody to end together with.
        share = a_row * self._left / (SHARES * self._workers if self._workers > 1 else 1)
        least = LEAST_PART * self._seconds
        most = max(min(self._seconds, share), least) / a_row
        if self._at_hand < self._left:
            # Others wait for what these runs begin: shared out, but nothing that takes less than a chunk costs.
            most = min(most, max(self._at_hand / self._workers, 0.5 * least / SHARES / a_row))
        chosen: list[int] = []
        rows = 0
        while self._ready and (not chosen or rows < most):
            number = heapq.heappop(self._ready)
            chosen.append(number)
            rows += len(self._table.runs[number].rows)
        self._left -= rows
        self._at_hand -= rows
        return chosen


def in_process(job: Job, table: Table, seconds: float, take: Take, say: Callable[[int], bool]) -> None:
    """Compute a study here; `say` hears how many rows were solved, and may end it."""
    worker = Worker(job)
    waiting = Waiting(table, seconds, 1)
    goes_on = True

    def heard(count: int) -> bool:
        nonlocal goes_on
        goes_on = say(count)
        return goes_on

    while waiting and goes_on:
        done = worker.compute(table.chunk(waiting.chunk()), heard)
        take(done)
        if done.interrupted:
            raise KeyboardInterrupt
        waiting.took(done)


def on_executor(packed: Parcel, table: Table, seconds: float, take: Take, executor: Executor) -> None:
    """Compute a study on workers, who are sent a packed job. What they have not begun is called off where it ends."""
    workers = _workers_of(executor)
    waiting = Waiting(table, seconds, workers)
    answers: SimpleQueue[Any] = SimpleQueue()
    under_way: set[Any] = set()
    try:
        while waiting or under_way:
            while waiting and len(under_way) < AHEAD * workers:
                chunk = Parcel(pickle.dumps(table.chunk(waiting.chunk())))
                future = executor.submit(compute, packed, chunk)
                under_way.add(future)
                future.add_done_callback(answers.put)
            future = answers.get()
            under_way.discard(future)
            try:
                done: ChunkDone = future.result()
            except BrokenExecutor as error:
                raise StudyError(
                    "a worker was ended, and with it its executor; expected workers with the memory they need: with a "
                    "folder= the same call goes on from what is finished"
                ) from error
            goes_on = take(done)
            if done.interrupted:
                raise KeyboardInterrupt
            if not goes_on:
                return
            waiting.took(done)
    finally:
        for future in under_way:
            future.cancel()


@in_turn
def sent(_: Assembly, job: Job) -> Parcel:
    """What workers are sent with every chunk of a study of a scene."""
    return Parcel(_pickled(job))


def _pickled(job: Job) -> bytes:
    try:
        return pickle.dumps(job)
    except Exception as error:
        try:
            import cloudpickle
        except ImportError:
            pass
        else:
            packed: bytes = cloudpickle.dumps(job)
            return packed
        raise InputError(
            f"of has what cannot be sent to workers: {error}; expected functions of a module, or executor=None"
        ) from error


def _workers_of(executor: Any) -> int:
    """How many chunks an executor computes at a time, where it says so; it decides nothing but the size of chunks."""
    count = getattr(executor, "_max_workers", None)
    if count is None and hasattr(executor, "nthreads"):
        count = sum(executor.nthreads().values())
    return count if isinstance(count, int) and count > 0 else os.cpu_count() or 1
