"""A study on a thousand machines, simulated: how long it takes, and what machines that fail cost.

A discrete-event simulation of `asm.study`: one process cuts the plan into runs, gives chunks of them to machines as
these become free, and writes what is finished. A machine that fails loses its chunk; that is noticed some time later,
and the chunk is given to another one. How much the times of rows differ, and what a run costs the process that hands it
out and writes it, are measured first on a four-bar; the mean time of a row is set to that of scenes with contacts.
Prints a table.
"""

from __future__ import annotations

import heapq
import pickle
from contextlib import closing
from dataclasses import dataclass
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from assembly.derivatives.response import values_set
from assembly.studies.sweeps.cutting import Run, cut
from assembly.studies.sweeps.folder import Folder
from assembly.studies.sweeps.measuring import columns_of
from assembly.studies.sweeps.table import Table
from assembly.studies.sweeps.work import Job, Worker

ROWS, MACHINES, ROW = 2**20, 1000, 0.05  # rows; machines; seconds a row takes on average
CHUNK = 1.0  # seconds a chunk takes, about
MESSAGE = 1e-3  # seconds that a chunk costs the process that hands it out, besides its runs: as Dask says of itself
DETECTED, RESTARTED = 10.0, 60.0  # seconds until a failure is found out; until a machine is back


@dataclass
class Costs:
    """Of runs how long a row takes, in parts of the mean; seconds that a run costs the process that hands it out."""

    rows: NDArray[np.float64]
    handing: float


@dataclass
class Outcome:
    """Seconds in all, and how many machines fail; parts of the machines' time that is useful, and lost with failures.

    `handing` is the part of the time in which the process that hands out chunks is busy.
    """

    seconds: float
    failures: int
    useful: float
    lost: float
    handing: float
    rows: int


def measured() -> Costs:
    """What a study of a four-bar costs, run by run, as a worker solves it."""
    ground, crank = asm.Body("ground", fixed=True), asm.Body("crank")
    rod, rocker = asm.Body("rod", position=(1, 0.5, 0)), asm.Body("rocker", position=(4, 0, 0))
    drive = asm.Revolute(ground, crank, "drive", angle=0.7)
    pin = asm.Revolute(crank.frame(at=(1.5, 0, 0)), rod, "pin")
    out = asm.Revolute(ground.frame(at=(4, 0, 0)), rocker, "out")
    scene = asm.Assembly([ground, crank, rod, rocker])
    scene.constrain(drive, pin, asm.Revolute(rod.frame(at=(4, 0, 0)), rocker.frame(at=(3, 0, 0)), "joint"), out)
    angle, length = asm.Parameter(drive, "angle"), asm.Parameter(pin.frame_a, "origin", "x", name="crank")
    plan = asm.sobol({angle: (0.7, 2.7), length: (1.4, 1.6)}, 1024)
    table = Table(plan.values, plan.runs(), 1)
    rows, handing = [], []
    now = [angle.value, length.value]
    with TemporaryDirectory() as place, closing(Folder(place, {})) as folder, values_set(plan.parameters, now):
        worker = Worker(Job(scene, plan.parameters, columns_of(asm.Measure(out)), None))
        worker.compute(table.chunk([0]))  # what is loaded and packed once is no row's
        while ready := table.ready():
            for number in ready:
                begin = process_time()
                done = worker.compute(table.chunk([number]))
                rows.append((process_time() - begin) / len(done.status))
                begin = process_time()
                pickle.dumps(table.chunk([number]))
                done = pickle.loads(pickle.dumps(done))
                table.take(done)
                folder.write(done, table)
                handing.append(process_time() - begin)
    return Costs(np.array(rows) / np.mean(rows), float(np.median(handing)))


class Simulation:
    """One study; `between` are seconds between failures of a machine, on average."""

    def __init__(self, runs: list[Run], costs: Costs, machines: int, between: float, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.runs, self.costs, self.rng, self.between, self.machines = runs, costs, rng, between, machines
        self.work = [ROW * len(run.rows) * float(rng.choice(costs.rows)) for run in runs]
        self.ready = [0]
        self.events: list[tuple[float, int, str, list[int]]] = []
        self.idle, self.count = machines, 0
        # When the process that hands out is free again, and how long it was busy.
        self.free_at, self.busy = 0.0, 0.0
        self.useful = self.lost = 0.0
        self.failures = 0

    def run(self) -> Outcome:
        """Until all rows are there."""
        now, rows, left = 0.0, 0, len(self.runs)
        self._give(now)
        while left:
            now, _, what, chunk = heapq.heappop(self.events)
            if what == "done":
                rows += sum(len(self.runs[k].rows) for k in chunk)
                left -= len(chunk)
                self.useful += sum(self.work[k] for k in chunk)
                for k in chunk:
                    for other in self.runs[k].begins:
                        heapq.heappush(self.ready, other)
                self.idle += 1
            elif what == "found out":
                for k in chunk:
                    heapq.heappush(self.ready, k)
            else:
                self.idle += 1
            self._give(now)
        total = now * self.machines
        return Outcome(now, self.failures, self.useful / total, self.lost / total, self.busy / now, rows)

    def _give(self, now: float) -> None:
        """Chunks to machines that have none."""
        while self.idle and self.ready:
            self.idle -= 1
            chunk, seconds = [], 0.0
            while self.ready and (not chunk or seconds < CHUNK):
                chunk.append(heapq.heappop(self.ready))
                seconds += ROW * len(self.runs[chunk[-1]].rows)
            handing = MESSAGE + self.costs.handing * len(chunk)
            begin = self.free_at = max(now, self.free_at) + handing
            self.busy += handing
            needed, fails = sum(self.work[k] for k in chunk), self.rng.exponential(self.between)
            if fails < needed:
                self.failures += 1
                self.lost += fails
                self._later(begin + fails + DETECTED, "found out", chunk)
                self._later(begin + fails + RESTARTED, "back", [])
            else:
                self._later(begin + needed, "done", chunk)

    def _later(self, when: float, what: str, chunk: list[int]) -> None:
        self.count += 1
        heapq.heappush(self.events, (when, self.count, what, chunk))


def simulated(costs: Costs, machines: int, between: float, rows: int = ROWS, seed: int = 0) -> Outcome:
    return Simulation(cut(np.arange(rows, dtype=np.int64)), costs, machines, between, seed).run()


def main(rows: int = ROWS) -> list[Outcome]:
    costs = measured()
    spread = np.percentile(costs.rows, [5, 95])
    print(
        f"rows take {spread[0]:.2f} to {spread[1]:.2f} of the mean; a run is handed out in {1e6 * costs.handing:.0f} us"
    )
    outcomes = []
    for machines, between in ((1, np.inf), (100, np.inf), (MACHINES, np.inf), (MACHINES, 36000.0), (MACHINES, 3600.0)):
        found = simulated(costs, machines, between, rows)
        outcomes.append(found)
        print(
            f"{machines:5d} machines, a failure in {between / 3600.0:4.0f} h of each: {found.seconds:9.1f} s, "
            f"{found.failures:3d} failures, useful {100 * found.useful:5.1f} %, lost {100 * found.lost:4.2f} %, "
            f"handing out {100 * found.handing:5.1f} % of the time"
        )
    return outcomes


if __name__ == "__main__":
    main()
