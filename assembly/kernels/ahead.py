"""Kernels compiled ahead, in parallel processes."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

from tqdm import tqdm

from assembly._kernel.targets import refuse_portable
from assembly.kernels.listing import Item

__all__ = ["compile_all", "default_workers", "shares"]

# More have nothing to do: the longest compilation takes a fifth of all. A worker takes up to 1.5 GB of memory.
_MOST_WORKERS = 6
# What it costs to optimize code, in parts of what it costs to translate it: an entry is optimized as a whole, but what
# another entry of the same process translated is not translated again.
_OPTIMIZING = 0.35


def default_workers() -> int:
    """As many processes as there are processors for this one, up to a few."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(count, _MOST_WORKERS)


def shares(items: list[Item], workers: int) -> list[list[Item]]:
    """Who compiles what, largest first: kernels that share sources go to the same worker, as far as its share reaches.

    Costs are estimated in bytes of sources.
    """

    def added(item: Item, translated: set[Path]) -> float:
        return _OPTIMIZING * _size(item.sources) + _size(item.sources - translated)

    largest_first = sorted(items, key=lambda item: _size(item.sources), reverse=True)
    seen: set[Path] = set()
    total = 0.0
    for item in largest_first:
        total += added(item, seen)
        seen |= item.sources
    count = min(workers, len(items))
    parts: list[list[Item]] = [[] for _ in range(count)]
    translated: list[set[Path]] = [set() for _ in range(count)]
    costs = [0.0] * count
    for item in largest_first:
        more = [added(item, known) for known in translated]
        with_room = [k for k in range(count) if costs[k] + more[k] <= total / count]
        k = min(with_room, key=lambda k: more[k]) if with_room else min(range(count), key=lambda k: costs[k] + more[k])
        parts[k].append(item)
        translated[k] |= item.sources
        costs[k] += more[k]
    return parts


def _size(sources: frozenset[Path] | set[Path]) -> int:
    return sum(path.stat().st_size for path in sources)


def compile_all(items: list[Item], workers: int, variables: Mapping[str, str]) -> None:
    """Compile these for the cache, with these environment variables, and show the progress.

    Raises
    ------
    RuntimeError
        A kernel cannot be compiled, with its name; the cause is what Numba says. Or a process was ended.
    """
    try:
        _compile_in_processes(shares(items, workers), variables)
    except BaseException:
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise


def _compile_in_processes(waiting: list[list[Item]], variables: Mapping[str, str]) -> None:
    """Compile shares, a process each; one that has done its own goes on with others'."""
    count = sum(map(len, waiting))
    fresh = multiprocessing.get_context("spawn")  # Numba reads the variables when it is imported
    running: dict[Future[None], tuple[int, Item]] = {}
    with _environment(variables):
        pools = [ProcessPoolExecutor(1, mp_context=fresh, initializer=_begin_worker) for _ in waiting]

        def go_on(k: int) -> None:
            """The next one of a worker's share; when that is done, the last one of the longest."""
            longest = max(waiting, key=len)
            if waiting[k] or longest:
                item = waiting[k].pop(0) if waiting[k] else longest.pop()
                running[pools[k].submit(_compile_one, item)] = k, item

        for k in range(len(pools)):
            go_on(k)
        with tqdm(desc="compiling kernels", total=count, unit="kernel") as bar:
            while running:
                for done in wait(running, return_when=FIRST_COMPLETED).done:
                    k, item = running.pop(done)
                    _check(done, item)
                    bar.update()
                    go_on(k)
    for pool in pools:
        pool.shutdown()


def _check(done: Future[None], item: Item) -> None:
    error = done.exception()
    if isinstance(error, BrokenProcessPool):
        raise RuntimeError(f"the process that compiled {item.name} was ended; is there memory for it?") from error
    if error is not None:
        raise RuntimeError(f"{item.name} cannot be compiled") from error


def _begin_worker() -> None:
    """In a worker: the progress bar has the word, the parent hears of interrupts, and nothing goes on without it."""
    logging.getLogger("assembly").setLevel(logging.ERROR)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    refuse_portable()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _compile_one(item: Item) -> None:
    """Runs in a worker, which keeps what kernels have in common."""
    item.entry.compiled.compile(item.types)


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Environment variables for the processes that are started meanwhile."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
