"""Violation against the time of a tick, as the steps a tick may take vary."""

from __future__ import annotations

from typing import Any

import numpy as np

import assembly as asm
from benchmarks.figures import figure
from benchmarks.hands import WIRE
from benchmarks.pictures import curve
from benchmarks.running import example
from benchmarks.tracking import hand_of

ABOUT = """\
The three paper clips of `examples/follow_the_hand.py` behind its hand, with one to eight steps a tick; more are taken
where the constraints do not hold after them. The lag is how far the followed point is from where eight steps a tick
have it at the same time: what a tick with fewer steps leaves to the next one. Violations are over the wire's radius."""

STEPS = (1, 2, 3, 5, 8)


def run(quick: bool) -> dict[str, Any]:
    """A line of violations, one of lags."""
    ticks = 60 if quick else 5_000
    module = example("follow_the_hand")
    found = {}
    for count in STEPS[::4] if quick else STEPS:
        chain = module.paper_clips()
        blue = chain.body("blue")
        tracker = chain.tracker(follow=blue.point(*module.END), iterations=count)
        begin = asm.Pose(tracker.q[2, :3], tracker.q[2, 3:]).apply(module.END)
        log = tracker.run(hand_of(module, begin, ticks), stride=1)
        ends = np.array([asm.Pose(q[2, :3], q[2, 3:]).apply(module.END) for q in log.q])
        found[count] = (log, ends)
    last = found[max(found)][1]
    lags = {count: np.linalg.norm(ends - last, axis=1) for count, (_log, ends) in found.items()}
    figures = []
    for count, (log, _ends) in found.items():
        what = f"{count} step{'s' if count > 1 else ''} a tick"
        figures += [
            figure(f"{what}: median tick", "seconds", log.median),
            figure(f"{what}: worst violation", "error", log.worst_violation / WIRE, reach=1e-9),
            figure(f"{what}: median lag, mm", "error", float(np.median(lags[count]))),
        ]
    violation = {"worst violation": [(log.median, log.worst_violation / WIRE) for log, _ in found.values()]}
    lag = {"median lag, mm": [(log.median, float(np.median(lags[k]))) for k, (log, _) in found.items()]}
    return {
        "about": ABOUT,
        "figures": figures,
        "curves": [curve("Following a hand", "seconds a tick, median", "violation, lag", violation | lag)],
    }
