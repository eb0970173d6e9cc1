"""Following a hand: ticks of three paper clips, a long run, rings that are kept apart, and the manager of twelve."""

from __future__ import annotations

from collections import Counter
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from assembly.tracking.tick import TrackStatus
from benchmarks.facets import walk
from benchmarks.figures import figure
from benchmarks.hands import NEAR, TAUT, WIRE, linked_rings, paper_clips, ring_chain
from benchmarks.running import example
from benchmarks.scenes import MAJOR, MINOR

ABOUT = """\
Three paper clips, threaded through each other and touching, with a clearance, follow the hand of
`examples/follow_the_hand.py` over and over again, a tick a millisecond of the hand, as fast as possible: what a tick
takes is what Python waits for `tracker.step`. The wire's radius is 0.5 mm. Gaps anywhere are those of the center
curves, found without the library from polynomials, at every hundredth tick; how far the hand is ahead is as well of
these. A tick that is HELD found no further pose that holds and stays where it was. With a budget, 30 us for the loop
and the proof, what is not done then is left to the next tick: the first one is LATE, and stays where it was unless it
got to a pose that is proven. "The machine alone" is an empty loop in place of a tick, as long as the median tick. The
long run is the same chain behind a hand that goes around a circle of 3 mm twice a second: lengths of quaternions at
every hundredth tick, violations of the last tenth of all ticks against those of the first, and the memory of the
process after all against that after a tenth. Linked rings are those of "Wires", without their contacts and with a
clearance; linking numbers are Gauss's integrals. The manager's twelve rings make a chain; from call to call each
moves and turns a little, a fiftieth of the wire's radius a step."""

Array = NDArray[np.float64]
# Deepest crossing that counts as none, and the largest violation in parts of the wire's radius.
CLEAR, HOLDS = 1e-9, 1e-9
EVERY = 100
# Seconds that a tick may take where there is a budget.
BUDGET = 30e-6
BACK = 1.5  # seconds from the end of the hand's trace to its begin


def hand_of(module: Any, begin: Array, ticks: int) -> asm.Trace:
    """The example's trace again and again, so many samples of it."""
    once = module.hand(begin)
    ends = once.targets[[-1, 0]]
    whole = asm.Trace.concatenate([once, asm.Trace.through(ends, [0.0, BACK])] * -(-ticks // (len(once) - 1)))
    return asm.Trace(whole.times[:ticks], whole.targets[:ticks])


def _held(module: Any, q: Array) -> Array:
    """Where the point is that the hand holds."""
    return asm.Pose(q[2, :3], q[2, 3:]).apply(module.END)


def _tracker(module: Any, budget: float | None = None) -> tuple[asm.Tracker, Array]:
    """A tracker of the example's chain, and where the hand begins."""
    chain = module.paper_clips()
    tracker = chain.tracker(follow=chain.body("blue").point(*module.END), budget=budget)
    return tracker, _held(module, tracker.q)


def machine_alone(seconds: float, count: int) -> Array:
    """What empty loops take that take so long at the median."""
    taken, rounds = np.empty(count), range(1000)
    for wanted in (min(100, count), count):
        for k in range(wanted):
            begin = perf_counter()
            for _ in rounds:
                pass
            taken[k] = perf_counter() - begin
        if wanted < count:
            rounds = range(max(1, round(1000 * seconds / float(np.median(taken[:wanted])))))
    return taken


def ticks_of_clips(ticks: int, budget: float | None) -> list[dict[str, Any]]:
    """Times, statuses and violations of ticks."""
    module, judge = example("follow_the_hand"), paper_clips()
    tracker, begin = _tracker(module, budget)
    hand = hand_of(module, begin, ticks)
    log = tracker.run(hand, stride=EVERY)
    deepest = min(judge.deepest(q) for q in log.q)
    ahead = [np.linalg.norm(_held(module, q) - to) for q, to in zip(log.q, hand.targets[::EVERY], strict=True)]
    what = f"three clips, {ticks:,} ticks" + (f", a budget of {1e6 * budget:.0f} us" if budget else "")
    alone = machine_alone(log.median, ticks)
    rows = [
        figure(f"{what}, median", "seconds", log.median, reach=20e-6),
        figure(f"{what}, 99 of 100", "seconds", log.percentile(99.0)),
        figure(f"{what}, 999 of 1,000", "seconds", log.percentile(99.9), reach=80e-6),
        figure(f"{what}, longest", "seconds", log.percentile(100.0)),
        figure(f"{what}, 999 of 1,000, the machine alone", "seconds", float(np.percentile(alone, 99.9))),
    ]
    rows += [figure(f"{what}, {status.name}", "count", log.count(status), of=ticks) for status in TrackStatus]
    good = int((log.feasibility <= HOLDS * WIRE).sum())
    return [
        *rows,
        figure(f"{what}, violation within {HOLDS:g} of the wire's radius", "count", good, of=ticks),
        figure(f"{what}, worst violation over the wire's radius", "error", log.worst_violation / WIRE),
        figure(f"{what}, deepest crossing anywhere, mm", "error", max(0.0, -deepest), reach=CLEAR),
        figure(f"{what}, how far the hand is ahead, mean, mm", "ratio", float(np.mean(ahead))),
    ]


def _memory() -> float:
    """Bytes of this process that are in memory; not a number where the system does not tell."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return 4096.0 * int(file.read().split()[1])
    except OSError:
        return float("nan")


def drift(ticks: int) -> list[dict[str, Any]]:
    """What many ticks add up to."""
    tracker, begin = _tracker(example("follow_the_hand"))
    # Written at once, so that its pages do not count as what ticks take.
    violations, lengths, memory = np.full(ticks, np.inf), 0.0, float("nan")
    statuses: Counter[str] = Counter()
    for k in range(ticks):
        angle = 4e-3 * np.pi * k
        step = tracker.step(begin + 3.0 * np.array([np.cos(angle) - 1.0, np.sin(angle), 0.0]))
        violations[k] = step.feasibility
        statuses[step.status.name] += 1
        if k % EVERY == 0:
            lengths = max(lengths, float(np.abs(np.linalg.norm(step.q[:, 3:], axis=1) - 1.0).max()))
        if k == ticks // 10:
            memory = _memory()
    first, last = (violations[part].max() for part in (slice(ticks // 10), slice(-(ticks // 10), None)))
    what = f"{ticks:,} ticks around a circle"
    rows = [
        figure(f"{what}, not HELD", "count", ticks - statuses["HELD"] - statuses["VIOLATED"], of=ticks),
        figure(f"{what}, quaternions off the unit", "error", lengths, reach=1e-15),
        figure(f"{what}, worst violation over the wire's radius", "error", violations.max() / WIRE, reach=HOLDS),
        figure(f"{what}, violation of the last tenth over that of the first", "ratio", last / first, reach=1.5),
    ]
    growth = _memory() / memory
    return rows if np.isnan(growth) else [*rows, figure(f"{what}, memory", "ratio", growth, reach=1.01)]


def kept_apart(count: int, name: str, distance: float, solved_goal: int | None) -> list[dict[str, Any]]:
    """Linked rings drawn to targets, with a clearance."""
    rings = linked_rings(count, distance)
    drag = rings.drag
    drag.scene.constrain(asm.Clearance())
    drag.scene.solve(rings.q[0])
    seconds, ends = [], []
    for q, target, links in zip(rings.q, rings.targets, rings.links, strict=True):
        drag.grip.target = target
        begin = perf_counter()
        solution = drag.scene.solve(q)
        seconds.append(perf_counter() - begin)
        end = solution.q
        ends.append((solution.success, drag.deepest(end) > -CLEAR, bool((drag.links(end) == links).all())))
    solved, clear, linked = np.sum(ends, axis=0).tolist()
    what = f"linked rings, targets {name}"
    return [
        figure(f"{what}: solved", "count", solved, of=count, reach=solved_goal),
        figure(f"{what}: solved, clear and linked", "count", int(np.all(ends, axis=1).sum()), of=count, reach=solved),
        figure(f"{what}: clear, solved or not", "count", clear, of=count),
        figure(f"{what}: linked as before, solved or not", "count", linked, of=count),
        figure(f"{what}: a cold solve", "seconds", float(np.median(seconds))),
    ]


def manager_of_rings(count: int, steps: int) -> list[dict[str, Any]]:
    """Updates of rings that move."""
    drag = ring_chain(count)
    bodies = [asm.Body(body.name, body.faces[0].face) for body in drag.scene.bodies]
    manager = asm.Manager(bodies)
    poses = walk(drag.scene.q, steps, 0.02 * MINOR, MAJOR)
    manager.update(poses[0])
    seconds = np.empty(steps)
    for k, q in enumerate(poses):
        begin = perf_counter()
        manager.update(q)
        seconds[k] = perf_counter() - begin
    rings = f"{'twelve' if count == 12 else count} rings"
    return [
        figure(f"manager of {rings}, an update", "seconds", float(np.median(seconds)), reach=30e-6),
        figure(f"manager of {rings}, 99 of 100 updates", "seconds", float(np.quantile(seconds, 0.99))),
    ]


def run(quick: bool, ticks: int | None = None) -> dict[str, Any]:
    """Times, counts and violations; fewer ticks where it is told."""
    count = 2 if quick else 50
    return {
        "about": ABOUT,
        "figures": [
            *ticks_of_clips(ticks or (200 if quick else 100_000), None),
            *ticks_of_clips(ticks or (200 if quick else 100_000), BUDGET),
            *drift(1_000 if quick else ticks or 100_000),
            *kept_apart(count, "near", NEAR, count),
            *kept_apart(count, "out of reach", TAUT, count),
            *(manager_of_rings(3, 30) if quick else manager_of_rings(12, 5_000)),
        ],
    }
