"""Kernels compiled ahead, in parallel processes."""

from __future__ import annotations

import logging
import multiprocessing
import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager

from tqdm import tqdm

from assembly.kernels.listing import Item

__all__ = ["compile_all", "default_workers"]

# More have nothing to do: the longest compilation takes a sixth of all. A worker takes up to 1.5 GB of memory.
_MOST_WORKERS = 6


def default_workers() -> int:
    """As many processes as there are processors for this one, up to a few."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(count, _MOST_WORKERS)


def compile_all(items: list[Item], workers: int, variables: Mapping[str, str]) -> None:
    """Compile what a cache has not, with these environment variables, and show the progress.

    Raises
    ------
    RuntimeError
        A kernel cannot be compiled, with its name; the cause is what Numba says.
    """
    largest_first = sorted(items, key=lambda item: item.source_size, reverse=True)
    fresh = multiprocessing.get_context("spawn")  # Numba reads the variables when it is imported
    with (
        _environment(variables),
        ProcessPoolExecutor(min(workers, len(items)), mp_context=fresh, initializer=_say_errors_only) as pool,
    ):
        running = {pool.submit(_compile_one, item): item for item in largest_first}
        for done in tqdm(as_completed(running), "compiling kernels", len(running), unit="kernel"):
            try:
                done.result()
            except Exception as error:
                pool.shutdown(cancel_futures=True)
                raise RuntimeError(f"{running[done].name} cannot be compiled") from error


def _say_errors_only() -> None:
    """In a worker: the progress bar says that kernels are compiled."""
    logging.getLogger("assembly").setLevel(logging.ERROR)


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
