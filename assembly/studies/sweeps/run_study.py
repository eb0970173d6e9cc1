"""Studies: designs by the thousand, solved along branches, on one machine or many, watched, stopped and resumed."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import closing, nullcontext
from functools import partial
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from assembly._progress import Advance, Progress, checked_progress, watched
from assembly._turn import in_turn
from assembly.assembly import Assembly
from assembly.derivatives.implicit import check_is_of, the_scene
from assembly.derivatives.measure import Measure
from assembly.derivatives.numbers import RowNumber, TargetNumber
from assembly.derivatives.response import values_set
from assembly.errors import InputError, positive
from assembly.studies.sweeps.folder import Folder
from assembly.studies.sweeps.identity import manifest_of
from assembly.studies.sweeps.measuring import Column, columns_of
from assembly.studies.sweeps.plans import Plan, as_plan
from assembly.studies.sweeps.result import Study, new_study
from assembly.studies.sweeps.scheduling import Executor, StudyError, Take, in_process, on_executor, sent
from assembly.studies.sweeps.table import Table
from assembly.studies.sweeps.work import ChunkDone, Job

__all__ = ["study"]

_LOG = logging.getLogger("assembly.studies")
Compute = Callable[[Take, Advance], None]
# Columns that every table has.
OWN = ("row", "status", "message", "iterations")


def study(
    scene: Assembly,
    plan: Any,
    of: Any,
    *,
    executor: Executor | None = None,
    folder: str | PathLike[str] | None = None,
    progress: Progress = False,
    chunk_seconds: float = 0.5,
    swept: bool = False,
) -> Study:
    """Solve a scene for every row of a plan, and measure it.

    Parameters
    ----------
    scene : Assembly
        Its numbers are restored afterwards.
    plan : Plan, or iterable of dictionaries Parameter -> value
        ``asm.grid``, ``asm.sobol``, ``asm.latin_hypercube``, ``asm.rows``, ``asm.starts``.
    of : Measure or function of a solution, several, or a mapping of names to them
        Measures to compute for every row. Functions return finite numbers; for workers they must be importable.
    executor : Executor, optional
        Where to compute: an executor of `concurrent.futures`, `mpi4py.futures` or executorlib, or a client of Dask; by
        default in this process. The results have the same bits.
    folder : str or path, optional
        Where finished parts are kept. A call with the folder of an earlier one continues it.
    progress : bool or callable
        True shows a progress bar; a function is called with the numbers of finished and of all rows, and stops the
        study by returning True.
    chunk_seconds : float
        About how long a chunk for a worker takes; it does not change the results.
    swept : bool
        Under a clearance, whether the way from one row to the next has to be clear, as in solves with `swept=True`. A
        row on the other side of something is BLOCKED, and its message says by which bodies. Every run of rows begins at
        a pose to which runs before it have come.

    Returns
    -------
    Study
        One row per design, those that failed as well. After Ctrl-C the rows that are done.

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used; the folder of another study.
    StudyError
        Workers run kernels of different processors.
    """
    the_scene(scene)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"executor is {executor!r}; expected an Executor with submit, or a client of Dask")
    checked_progress(progress)
    seconds = positive("chunk_seconds", chunk_seconds)
    columns = columns_of(of)
    if executor is None:
        calls_back = callable(progress) or not all(isinstance(column.of, Measure) for column in columns)
        return in_turn(_here, calls_back)(scene, (plan, columns, folder, swept), progress, seconds)
    asked = _asked(scene, plan, columns, folder, swept)

    def on_workers(take: Take, _: Advance) -> None:
        # Workers have scenes of their own, and other threads the turn of this one.
        on_executor(sent(scene, asked.job), asked.table, seconds, take, executor)

    return _found(asked, on_workers, progress, is_told=True)


class _Asked(NamedTuple):
    """What a study is asked for: its job, its rows, its plan, and where finished parts are kept."""

    job: Job
    table: Table
    designs: Plan
    kept: Folder | None


def _here(scene: Assembly, given: tuple[Any, ...], progress: Progress, seconds: float) -> Study:
    """A study in this process, which has the scene's turn until it ends: its numbers are those of rows meanwhile."""
    asked: _Asked = _asked(scene, *given)
    parameters = asked.designs.parameters

    def in_this_process(take: Take, say: Advance) -> None:
        in_process(asked.job, asked.table, seconds, take, say)

    with values_set(parameters, np.array([parameter.value for parameter in parameters])):
        return _found(asked, in_this_process, progress, is_told=False)


@partial(in_turn, calls_back=False)
def _asked(
    scene: Assembly, plan: Any, columns: tuple[Column, ...], folder: str | PathLike[str] | None, swept: bool
) -> _Asked:
    """What the arguments of `study` ask for."""
    designs = as_plan(plan)
    for parameter in designs.parameters:
        check_is_of("plan", scene, parameter)
    names = [*OWN, *designs.names]
    for column in columns:
        if column.name in names:
            raise InputError(
                f"of has the name {column.name!r}, which another column has; expected one of its own: name="
            )
    for name in designs.names:
        if name in OWN:
            raise InputError(f"plan has a parameter of the name {name!r}, as every table; expected another one: name=")
    _check_swept(scene, designs, swept)
    job = Job(scene, designs.parameters, columns, designs.seed if designs.kind == "starts" else None, swept)
    table = Table(designs.values, designs.runs(), len(columns))
    kept = None if folder is None else Folder(folder, manifest_of(scene, designs, columns, swept))
    return _Asked(job, table, designs, kept)


def _check_swept(scene: Assembly, designs: Plan, swept: bool) -> None:
    """Raise where ways between rows cannot be asked for."""
    if not isinstance(swept, bool):
        raise TypeError(f"swept is {swept!r}; expected True or False")
    if not swept:
        return
    if designs.kind == "starts":
        raise InputError("swept is True with starts, between which there is no way; expected another plan")
    if not scene.packed().keeps_apart:
        raise InputError("swept is True where no clearance keeps bodies apart; expected one, asm.Clearance()")
    for parameter in designs.parameters:
        if not isinstance(parameter._number, (RowNumber, TargetNumber)):
            raise InputError(
                f"swept is True for {parameter.name}, which changes the bodies or the joints; expected driven values, "
                "limits, offsets and targets"
            )


def _found(asked: _Asked, compute: Compute, progress: Progress, is_told: bool) -> Study:
    """What is found where `compute` computes what is left; `is_told` whether chunks are told as they come."""
    kept = asked.kept
    with closing(kept) if kept is not None else nullcontext():
        kernels = _computed(asked.table, kept, compute, progress, is_told)
    return new_study(asked.table, asked.designs, asked.job, kernels)


def _computed(table: Table, kept: Folder | None, compute: Compute, progress: Progress, is_told: bool) -> str:
    """Fill the table; the processor of the kernels that did."""
    if kept is not None:
        kept.read(table)
    kernels = kept.kernels if kept is not None else ""
    count = len(table.values)
    found = count - table.rows_left
    _LOG.info("a study of %d rows begins, %d are done", count, found)
    with watched(progress, "study", count, "row") as advance:
        if found:
            advance(found)

        def take(done: ChunkDone) -> bool:
            nonlocal kernels
            if kernels and done.kernels != kernels:
                raise StudyError(
                    f"rows were computed by kernels for {kernels}, and others now by kernels for {done.kernels}, which "
                    "may round otherwise; expected one kind: fresh processes as workers take portable ones"
                )
            kernels = done.kernels
            table.take(done)
            if kept is not None:
                kept.write(done, table)
            solved = len(done.status)
            _LOG.debug("a chunk of %d runs, %d rows, took %.3f s", len(done.runs), solved, done.seconds)
            return advance(solved) if is_told else True

        try:
            compute(take, advance)
        except KeyboardInterrupt:
            _LOG.warning("the study was interrupted with %d of %d rows done", count - table.rows_left, count)
    return kernels
