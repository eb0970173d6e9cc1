"""Studies: a sweep here, on processes and on Dask; what a chunk costs; all branches of an arm; branches followed."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from importlib.util import find_spec
from math import pi
from multiprocessing import get_context
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from benchmarks.figures import figure
from benchmarks.planar_four_bars import FourBar
from benchmarks.running import example
from benchmarks.six_axis_arm import Arm, angles_of, hand_of, is_found

ABOUT = """\
Sweeps: planar four-bars with a coupler of 3 and a rocker of 2.5 over angles of the crank, alone and with lengths of
coupler and ground (the longest, so that the size of the scene depends on it), one measure, each from its neighbor;
least of several runs. Processes, threads and Dask: the same angles, more of them, on two cores, where there are two;
least of several runs in turn after a first one, and on a busy machine no better than what others leave. Dask: a
`LocalCluster` of four workers with the settings of `examples/cluster_study.py`. A chunk: what a study in chunks of
0.1 s takes beyond what its worker does, when all goes there and back pickled. The arm: six axes with the numbers of
the UR5 and hands that random angles reach, `solve_all(starts="all")` against the closed form. Followed: the rocker's
angle of a crank-rocker, of a double rocker that no link turns in, and of a drag link, against cosines."""
NO_DASK = " Dask's `distributed` is not installed here (extra `cluster`), so its rows are left out."

Array = NDArray[np.float64]
# Lengths of crank, coupler, rocker and ground.
CRANK_ROCKER = (1.0, 3.0, 2.5, 3.2)
LOOPS = {"crank-rocker": CRANK_ROCKER, "double rocker": (2.0, 2.2, 2.1, 4.5), "drag link": (3.0, 1.2, 3.1, 1.0)}
WORKERS = 4


class Sweep:
    """A four-bar, its angle, two of its lengths, and what is measured."""

    def __init__(self) -> None:
        bar = FourBar(*CRANK_ROCKER)
        bar.crank.angle = 0.7
        self.scene, self.of = bar.scene, asm.Measure(bar.rocker, name="swing")
        for body, row in zip(self.scene.bodies, bar.q, strict=True):
            body.pose = asm.Pose(row[:3], row[3:])
        self.angle = asm.Parameter(bar.crank, "angle", name="angle")
        self.coupler = asm.Parameter(bar.wrist.frame_a, "origin", "x", name="coupler")
        self.ground = asm.Parameter(bar.rocker.frame_a, "origin", "x", name="ground")

    def plan(self, count: int, length: asm.Parameter | None = None) -> asm.Plan:
        """One turn of the crank; with a length, a grid of as many angles as lengths within 3 percent."""
        if length is None:
            return asm.grid({self.angle: np.linspace(0.7, 6.9, count)})
        side = round(count**0.5)
        lengths = length.value * np.linspace(0.97, 1.03, side)
        return asm.grid({self.angle: np.linspace(0.7, 6.9, side), length: lengths})

    def study(self, plan: asm.Plan, **options: Any) -> asm.Study:
        """The study of a plan."""
        return asm.study(self.scene, plan, self.of, **options)


class Here:
    """An executor of this process, to which all goes pickled, as to another one; it adds up what its chunks took."""

    _max_workers = 1

    def __init__(self) -> None:
        self.seconds, self.chunks = 0.0, 0

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Future[Any]:
        """A future that is done."""
        function, arguments = pickle.loads(pickle.dumps((function, arguments)))
        done = function(*arguments)
        self.seconds, self.chunks = self.seconds + done.seconds, self.chunks + 1
        future: Future[Any] = Future()
        future.set_result(pickle.loads(pickle.dumps(done)))
        return future


def _least(calls: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Seconds of each, the least of some repeats in turn."""
    least = dict.fromkeys(calls, np.inf)
    for _ in range(repeats):
        for name, call in calls.items():
            begin = perf_counter()
            call()
            least[name] = min(least[name], perf_counter() - begin)
    return least


@contextmanager
def _all_cores() -> Iterator[int]:
    """Let this process, and those that it starts, run on all cores; how many these are."""
    if not hasattr(os, "sched_setaffinity"):
        yield os.cpu_count() or 1
        return
    mine = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
        yield len(os.sched_getaffinity(0))
    finally:
        os.sched_setaffinity(0, mine)


def _sweeps(sweep: Sweep, quick: bool) -> list[dict[str, Any]]:
    """Designs one after the other in this process."""
    count, repeats = (1_024, 1) if quick else (10_000, 3)
    figures = []
    for what, length in (("angles", None), ("angles and couplers", sweep.coupler), ("angles and sizes", sweep.ground)):
        plan = sweep.plan(count, length)
        solved = int(sweep.study(plan).success.sum())
        seconds = _least({what: partial(sweep.study, plan)}, repeats)[what]
        name = f"{count:,} four-bars, {what}"
        figures.append(figure(f"{name}: solved", "count", solved, of=count, reach=count))
        figures.append(figure(f"{name}: a design, one core", "seconds", seconds / count, reach=60e-6))
    return figures


def _chunks(sweep: Sweep, quick: bool) -> list[dict[str, Any]]:
    """What handing out, sending and taking back chunks costs, with a folder and without."""
    plan = sweep.plan(1_024 if quick else 10_000, sweep.coupler)
    figures = []
    for what in ("a chunk", "a chunk kept in a folder"):
        parts = []
        for _ in range(1 if quick else 2):
            here = Here()
            with TemporaryDirectory() as place:
                options = {"folder": place} if "folder" in what else {}
                begin = perf_counter()
                sweep.study(plan, executor=here, chunk_seconds=0.1, **options)
                spent = perf_counter() - begin
            parts.append(((spent - here.seconds) / here.chunks, spent / here.seconds - 1.0))
        figures.append(figure(f"{what} beyond its rows", "seconds", min(part[0] for part in parts)))
        figures.append(
            figure(f"{what} of 0.1 s: overhead over rows", "ratio", min(part[1] for part in parts), reach=0.05)
        )
    return figures


def _threads(sweep: Sweep, count: int, repeats: int) -> list[dict[str, Any]]:
    """Compiled calls on one thread and on two."""
    columns, start = {sweep.angle: np.linspace(0.7, 1.0, count)}, sweep.scene.solve()

    def solved(threads: int) -> asm.Batch:
        return sweep.scene.solve_many(start, parameters=columns, threads=threads)

    least = _least({"one": lambda: solved(1), "two": lambda: solved(2)}, repeats)
    ratio = least["two"] / least["one"]
    return [
        figure("`solve_many`: a design, one thread", "seconds", least["one"] / count),
        figure("`solve_many`: two threads over one", "ratio", ratio, reach=1.0 / 1.8),
    ]


def _bits(found: asm.Study) -> list[bytes]:
    """The numbers of a study."""
    return [found[name].tobytes() for name in (*found.measures, "iterations")]


def _workers(sweep: Sweep, quick: bool) -> list[dict[str, Any]]:
    """One process, two, and four workers of Dask: the same study in turn."""
    count, repeats = (2_000, 1) if quick else (150_000, 3)
    plan, spawn = sweep.plan(count), get_context("spawn")
    with ExitStack() as open_ones:
        executors: dict[str, Any] = {
            name: open_ones.enter_context(ProcessPoolExecutor(number, mp_context=spawn))
            for name, number in (("one process", 1), ("two processes", 2))
        }
        if find_spec("distributed"):
            executors["Dask"] = open_ones.enter_context(_dask())
        for executor in executors.values():  # workers start and load what they need
            sweep.study(sweep.plan(64 * 2 * WORKERS), executor=executor, chunk_seconds=0.01)
        found: dict[str, asm.Study] = {}

        def run(name: str) -> None:
            found[name] = sweep.study(plan, executor=executors[name])

        least = _least({name: partial(run, name) for name in executors}, repeats)
    same = sum(_bits(found[name]) == _bits(found["one process"]) for name in executors)
    figures = [
        figure(
            f"{count:,} four-bars on workers: the same bits", "count", same, of=len(executors), reach=len(executors)
        ),
        figure("one process: a design", "seconds", least["one process"] / count),
        figure("two processes over one", "ratio", least["two processes"] / least["one process"], reach=1.0 / 1.9),
    ]
    if "Dask" in least:
        ratio = least["Dask"] / least["two processes"]
        figures.append(figure(f"Dask, {WORKERS} workers, over two processes", "ratio", ratio, reach=1.1))
    return figures


@contextmanager
def _dask() -> Iterator[Any]:
    """A client of workers on this machine."""
    import dask
    from distributed import Client, LocalCluster

    local = {"n_workers": WORKERS, "threads_per_worker": 1, "dashboard_address": None}
    with (
        dask.config.set(example("cluster_study").QUIET),
        LocalCluster(**local) as cluster,
        Client(cluster) as client,
    ):
        client.run(sys.path.extend, sys.path)
        yield client


def _arm(quick: bool) -> list[dict[str, Any]]:
    """All branches of random hands."""
    arm, rng, count = Arm(), np.random.default_rng(2), 10 if quick else 200
    exact = eight = expected = branches = 0
    seconds = []
    for _ in range(count):
        hand = hand_of(rng.uniform(-pi, pi, 6))
        arm.reach(hand)
        begin = perf_counter()
        found = arm.scene.solve_all(starts="all")
        seconds.append(perf_counter() - begin)
        every = angles_of(hand)
        reached = sum(is_found(angles, found) for angles in every)
        exact += reached == len(every) == len(found)
        eight += len(every) == 8
        expected, branches = expected + len(every), branches + reached
    return [
        figure("six axes: poses with exactly their branches", "count", exact, of=count, reach=count),
        figure("six axes: branches found", "count", branches, of=expected, reach=expected),
        figure("six axes: poses with eight of them", "count", eight, of=count),
        figure("six axes: a pose, mean", "seconds", float(np.mean(seconds)), reach=50e-3),
        figure("six axes: a pose, the slowest", "seconds", max(seconds)),
    ]


def _ends(bar: FourBar) -> list[float]:
    """Where a rocker turns back; one with a single dead center swings from there through pi to the mirror image."""
    centers = bar.dead_centers()
    return [centers[0], 2.0 * pi - centers[0]] if len(centers) == 1 else centers


def _followed() -> list[dict[str, Any]]:
    """Branches of three loops along the rocker's angle, all around."""
    figures, as_many = [], 0
    for name, lengths in LOOPS.items():
        bar = FourBar(*lengths)
        bar.rocker.angle = bar.swing
        angle, start = asm.Parameter(bar.rocker, "angle"), bar.scene.solve(bar.q)
        for _ in range(2):  # the first call loads what both need
            begin = perf_counter()
            branch = asm.follow(bar.scene, angle, -10.0, 10.0, start=start)
            seconds = perf_counter() - begin
        turns = [event.value for event in branch.events_of("turning point")]
        ends = _ends(bar)
        as_many += len(turns) == len(ends)
        if ends and len(turns) == len(ends):
            worst = float(np.abs(np.subtract(sorted(turns), ends)).max())
            figures.append(figure(f"{name}: turning points against cosines", "error", worst, reach=1e-9))
        figures.append(figure(f"{name}: the loop closes to", "error", branch.closure, reach=1e-10))
        figures.append(figure(f"{name}: followed around", "seconds", seconds))
    what = "loops: as many turning points as cosines tell"
    return [figure(what, "count", as_many, of=len(LOOPS), reach=len(LOOPS)), *figures]


def run(quick: bool) -> dict[str, Any]:
    """Time sweeps, count branches, and find what they are off by."""
    sweep = Sweep()
    figures = [*_sweeps(sweep, quick), *_chunks(sweep, quick)]
    with _all_cores() as cores:
        if cores > 1:
            figures += [*_threads(sweep, *((1_000, 1) if quick else (20_000, 5))), *_workers(sweep, quick)]
    about = ABOUT if find_spec("distributed") else ABOUT + NO_DASK
    return {"about": about, "figures": [*figures, *_arm(quick), *_followed()]}
