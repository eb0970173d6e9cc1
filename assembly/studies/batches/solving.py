"""A batch of solves: rows through the loop in slices, on threads, and remaining rows one by one."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.packing.scene import Packed
from assembly.derivatives.measure import Measure
from assembly.derivatives.numbers import FrameOrigin
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError, integer, items
from assembly.solve.interruption import CTRL_C, STATUSES
from assembly.solve.loop.settings import ASK_ADDRESS, COUNT, OBJECTIVE, SCATTER, SOLVED, UNSURE, VIOLATION
from assembly.solve.loop_address import loop_address
from assembly.solve.solution import Solution
from assembly.solve.workspace import new_workspace
from assembly.studies.batches.columns import parameter_columns, set_all, writes_of
from assembly.studies.batches.measured import can_measure, measured
from assembly.studies.batches.result import Batch
from assembly.studies.batches.rows import Desk, Span, Writes, solve_rows
from assembly.studies.batches.starts import begun_states, starts_of

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["forget_solves", "solve_many", "solve_slices"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
# Rows of a slice: what a thread solves before anybody can stop it. A slice begins in some 10 us. Chosen.
SLICE = 128
# Slices whose rows are told at a time: what it takes to tell any rows is then a hundredth of four-bars' solves. Chosen.
TOLD = 8
# By the codes of the loop; None of those that are no statuses.
_STATUSES = np.array([*STATUSES, None], dtype=object)


@dataclass(frozen=True)
class _Asked:
    """What a batch is asked for."""

    scene: Assembly
    starts: Array | list[Solution]
    parameters: tuple[Parameter, ...]
    values: Array
    of: tuple[Measure, ...]
    options: Mapping[str, Any]
    count: int

    def start(self, k: int) -> Array | Solution:
        """Where row k begins."""
        return self.starts[k if len(self.starts) > 1 else 0]


def solve_many(
    scene: Assembly,
    q0s: Any,
    parameters: Mapping[Parameter, Any] | None,
    of: Iterable[Measure],
    threads: int | None,
    retry: bool,
    options: Mapping[str, Any],
) -> Batch:
    """See `Assembly.solve_many`."""
    begin = perf_counter()
    count = _processors() if threads is None else integer("threads", threads, 1, 1024)
    if not isinstance(retry, (bool, np.bool_)):
        raise InputError(f"retry is {retry!r}; expected True or False")
    if options.get("verbose"):
        raise InputError(f"verbose is {options['verbose']!r} of a batch; expected 0, a table is of one solve")
    measures = items("of", of, "measures")
    for item in measures:
        if not isinstance(item, Measure):
            raise TypeError(f"of has {item!r}; expected a Measure")
    starts = starts_of(scene, q0s)
    columns = parameter_columns(scene, parameters)
    rows = len(columns[1]) if columns[0] else len(starts)
    if len(starts) not in (1, rows):
        raise InputError(f"q0s has {len(starts)} rows; expected 1, or {rows} as parameters have")
    asked = _Asked(scene, starts, *columns, measures, options, rows)
    out = _empty(asked)
    left = _by_the_loop(asked, out, min(count, -(-rows // SLICE)), bool(retry))
    _by_themselves(asked, out, left, count)
    return Batch(**out, parameters=asked.parameters, values=asked.values, of=measures, seconds=perf_counter() - begin)


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _empty(asked: _Asked) -> dict[str, Any]:
    """The arrays of a result."""
    n = asked.count
    return {
        "q": np.empty((n, len(asked.scene.bodies), 7)),
        "status": np.full(n, None, dtype=object),
        "objective": np.empty(n),
        "feasibility": np.empty(n),
        "iterations": np.zeros(n, dtype=np.int64),
        "alone": np.zeros(n, dtype=bool),
        "measures": np.full((n, len(asked.of)), np.nan),
    }


def _by_the_loop(asked: _Asked, out: dict[str, Any], threads: int, retry: bool) -> Sequence[int]:
    """Solve what is a run of the loop and nothing else; the rows that are left."""
    scene, everything = asked.scene, range(asked.count)
    first = asked.start(0)
    scene._take_seats(first)
    packed = scene.packed()
    if not packed.is_loop_alone or scene._lower_pairs or scene._nearest:
        return everything
    if not all(can_measure(packed, item) for item in asked.of):
        return everything
    packed.refresh()
    writes = writes_of(packed, asked.parameters, asked.values, asked.count)
    places = any(isinstance(item._number, FrameOrigin) for item in asked.parameters)
    begun = None if writes is None else begun_states(scene, packed, asked.starts, bool(asked.parameters), places)
    if writes is None or begun is None:
        return everything
    warm = isinstance(asked.starts, list)
    settings = scene._settings(dict(asked.options), CTRL_C, warm)
    left = np.zeros(asked.count, dtype=bool)

    def tell(rows: Rows, ended: Array) -> None:
        codes = ended[:, packed.results_at].astype(np.int64)
        missed = codes != SOLVED if retry else codes == UNSURE
        if not warm and packed.chooses_turns:
            # Bodies that were assembled may be on other turns.
            missed |= ended[:, packed.results_at + SCATTER] == 1.0
        left[rows] = missed
        _tell(packed, asked, out, rows, ended, writes)

    _solve_on_threads(packed, settings, writes, begun, asked.count, threads, tell)
    if isinstance(asked.starts, list):
        left |= np.array([item._fit is not None for item in asked.starts])
    return np.flatnonzero(left).tolist()


def _solve_on_threads(
    packed: Packed,
    settings: Array,
    writes: Writes,
    begun: Array,
    count: int,
    threads: int,
    tell: Callable[[Rows, Array], None],
) -> None:
    """Solve all rows in slices; `tell` hears of some slices at a time with which states their rows ended.

    A thread tells its own while others solve. So states take memory for a few slices, and no thread waits until
    all rows are told.
    """
    remaining = iter(range(0, count, SLICE))
    if threads > 1:
        settings = settings.copy()
        settings[ASK_ADDRESS] = 0.0

    def work() -> None:
        solve = _solver(packed, settings)
        ended = np.empty((min(TOLD * SLICE, count), packed.memory_at))
        taken: list[Rows] = []

        def tell_taken() -> None:
            rows = np.concatenate(taken)
            tell(rows, ended[: len(rows)])
            taken.clear()

        # The next slice is taken under the interpreter's lock. The one that is shorter is the last of its thread.
        for first in remaining:
            rows = np.arange(first, min(first + SLICE, count))
            at = SLICE * len(taken)
            own = Writes(writes.places, writes.turns, writes.numbers[first : first + SLICE])
            solve(own, begun[first : first + SLICE] if len(begun) > 1 else begun, ended[at : at + len(rows)])
            if threads == 1:
                CTRL_C.is_over()
            taken.append(rows)
            if len(taken) == TOLD:
                tell_taken()
        if taken:
            tell_taken()

    _over_threads(work, remaining, threads)


def _solver(packed: Packed, settings: Array) -> Callable[[Writes, Array, Array], None]:
    """Solves rows in memory of its own: these numbers, from these states, to those in which they end."""
    loop = loop_address(packed.end_effectors)
    own = packed.rows_table.copy(), packed.rows_pool.copy(), np.zeros(packed._state_size)
    # Signatures have plain tuples.
    desk = tuple(Desk(*own, *new_workspace(packed)))

    def solve(writes: Writes, begun: Array, ended: Array) -> None:
        span = Span(0, len(ended), loop)
        solve_rows(desk, settings, tuple(writes), begun, ended, tuple(span), packed.end_effectors)

    return solve


def solve_slices(packed: Packed, settings: Array, writes: Writes, begun: Array, ended: Array) -> None:
    """Solve all rows in place; an exception of a signal's handler is raised between slices.

    Rows begin with the states in `begun`, and end with those in `ended`, as `solve_rows` has them.
    """
    solve = _solver(packed, settings)
    for first in range(0, len(ended), SLICE):
        rows = slice(first, first + SLICE)
        own = Writes(writes.places, writes.turns, writes.numbers[rows])
        solve(own, begun[rows] if len(begun) > 1 else begun, ended[rows])
        CTRL_C.is_over()


def _over_threads(work: Callable[[], None], remaining: Iterator[int], threads: int) -> None:
    """Do work in so many threads, which take from the remaining parts; an exception in one ends all of them."""
    if threads == 1:
        work()
        return
    with ThreadPoolExecutor(threads) as pool:
        try:
            # Threads that began already go on while others are submitted: an exception here ends them as well.
            futures = [pool.submit(work) for _ in range(threads)]
            # Of those that have ended: others go on until there is nothing left to take.
            for future in wait(futures, return_when=FIRST_EXCEPTION).done:
                future.result()
        except BaseException:
            for _ in remaining:
                pass
            raise


def _tell(packed: Packed, asked: _Asked, out: dict[str, Any], rows: Rows, ended: Array, writes: Writes) -> None:
    """What these rows of the loop ended with."""
    results = ended[:, packed.results_at :]
    codes = results[:, 0].astype(np.int64)
    out["q"][rows] = ended[:, : packed.contacts_at].reshape(len(rows), -1, 7)
    out["status"][rows] = _STATUSES[np.minimum(codes, len(STATUSES))]
    out["objective"][rows] = results[:, OBJECTIVE] * packed.unit
    out["iterations"][rows] = results[:, COUNT]
    residuals = ended[:, packed.residuals_at : packed.results_at]
    off = np.where(packed.one_sided, np.maximum(-residuals, 0.0), np.abs(residuals))
    out["feasibility"][rows] = np.where(results[:, VIOLATION] == np.inf, np.inf, off.max(axis=1, initial=0.0))
    solved = codes == SOLVED
    if asked.of and solved.any():
        held = rows[solved]
        own = Writes(writes.places, writes.turns, writes.numbers[held])
        columns = asked.parameters, asked.values[held] if asked.parameters else asked.values
        out["measures"][held] = measured(packed, asked.of, ended[solved], own, columns)


def _by_themselves(asked: _Asked, out: dict[str, Any], rows: Sequence[int], threads: int) -> None:
    """Solve rows with all that `Assembly.solve` tries.

    What solves of clearances leave in a scene, slots for contacts and proofs, changes the bits of the next one. So each
    row begins with a scene that was never solved, and rows from starts go over threads, each of which has its own.
    Numbers are those of joints and bodies, which all threads share: rows that have them go one after the other.
    """
    if not len(rows):
        return
    has_clearances = any(isinstance(item, Clearance) for item in asked.scene.constraints)
    if not has_clearances or isinstance(asked.starts, list):
        _one_by_one(asked, out, rows, asked.scene.solve)
    elif asked.parameters:
        _one_by_one(asked, out, rows, _unsolved(asked.scene))
    else:
        remaining = iter(rows)
        _over_threads(
            lambda: _one_by_one(asked, out, remaining, _unsolved(asked.scene)), remaining, min(threads, len(rows))
        )


def forget_solves(scene: Assembly) -> None:
    """Have a scene as if it was never solved: without slots for contacts, corners, and what was proven of pairs."""
    packed = scene._packed
    if packed is None or packed.kept or packed.contacts:
        scene._has_changed()
        scene._crowding = 1


def _unsolved(scene: Assembly) -> Callable[..., Solution]:
    """Solve with a scene of the same bodies and constraints that knows of no other solve."""
    own = copy.copy(scene)
    forget_solves(own)
    # Trees of bodies are written once: most of what it takes to pack a scene with clearances.
    packed = own.packed()
    packed._write_manager()
    unsolved, own_scene, seen = packed, own._scene, own._seen

    def solve(start: Array | Solution, **options: Any) -> Solution:
        forget_solves(own)
        own._packed, own._scene, own._seen = unsolved.twin(), own_scene, seen
        own._packed.proofs = []
        return own.solve(start, **options)

    return solve


def _one_by_one(asked: _Asked, out: dict[str, Any], rows: Iterable[int], solve: Callable[..., Solution]) -> None:
    before = [item.value for item in asked.parameters]
    try:
        for k in rows:
            if asked.parameters:
                set_all(asked.parameters, asked.values[k].tolist())
            solution = solve(asked.start(k), **asked.options)
            out["q"][k], out["status"][k], out["alone"][k] = solution.q, solution.status, True
            out["objective"][k], out["feasibility"][k] = solution.objective, solution.feasibility
            out["iterations"][k] = solution.iterations
            told = [item.value(solution) for item in asked.of] if solution.success else np.nan
            out["measures"][k] = told
    finally:
        if asked.parameters:
            set_all(asked.parameters, before)
