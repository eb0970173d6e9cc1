"""A study on a cluster: the six-bar of dexterity_study.py on the workers of Dask, with the bits of one process.

`LocalCluster` starts workers on this machine; for other machines use `Client("tcp://scheduler:8786")`, without any
other change. Prints how long one process and the workers take, and that all numbers are the same. Takes the extra
`cluster`.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np

import assembly as asm

sys.path.insert(0, str(Path(__file__).resolve().parent))
from dexterity_study import six_bar, speed, transmission  # noqa: E402  # It stands beside this file.

# What Dask does all the time besides takes a fifth of a core for four workers, and with these settings a fortieth:
# profiles that nobody looks at here, statistics 50 times a second, memory and disks twice a second and more.
QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}


def designs(count: int) -> tuple[asm.Assembly, asm.Plan, dict[str, object]]:
    scene, radius, length, dexterity = six_bar()
    plan = asm.sobol({radius: (15.0, 45.0), length: (60.0, 110.0)}, count)
    return scene, plan, {"speed": partial(speed, scene, dexterity), "transmission": transmission}


def main(count: int = 8192, workers: int = 4) -> asm.Study:
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise SystemExit("Dask's distributed is not installed; install the extra cluster") from None

    begin = perf_counter()
    alone = asm.study(*designs(count))
    print(f"here      {perf_counter() - begin:7.2f} s   {alone!r}")
    local = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    with dask.config.set(QUIET), LocalCluster(**local) as cluster, Client(cluster) as client:
        client.run(sys.path.insert, 0, str(Path(__file__).resolve().parent))
        asm.study(*designs(64 * workers), executor=client, chunk_seconds=0.01)  # workers load what they need
        begin = perf_counter()
        spread = asm.study(*designs(count), executor=client)
        print(f"{workers} workers {perf_counter() - begin:7.2f} s   {spread!r}")
    same = all(np.array_equal(alone[name], spread[name], equal_nan=True) for name in alone.measures)
    print("the same bits" if same else "other bits")
    return spread


if __name__ == "__main__":
    main()
