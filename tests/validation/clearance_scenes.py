"""Scenes of two bodies that must not cross, and what solves and ticks make of them, as `crossing_judge` finds it.

    python -m tests.validation.clearance_scenes [FILE [SOLVES [TRACKS]]]

prints how solves and ticks end, by pairs of parts, and writes every outcome to a JSON file: that of a number is of the
same scene whatever the library does, so that files of two versions can be compared one to one.

Of six in ten starts the parts are brought to a signed distance of +-1e-6 to +-1e-1. Of others a point inside of one is
inside of the other one, the second one is wholly within the first, or they stand anywhere. Half of the scenes have an
objective that draws a point of the second part into the first one.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import assembly as asm
from tests.validation import exact_solids as exact
from tests.validation.crossing_judge import Motion, crossing_depth, least_signed_distance, sampled_distance

Array = NDArray[np.float64]

# Bodies that are in each other by less of the larger one's size only touch: a solve holds gaps to 1e-12 of the
# scene's, and extrema of faces that lean by less than 1e-9 are no better than that.
TOUCHING = 1e-9
TICKS, HELD_FOR, LOOKS = 60, 10, 25
# Shares of kinds of starts; the rest stand anywhere.
NEAR, PIERCED, NESTED = 0.6, 0.2, 0.1
# What has room for others within.
BIG = ("big box", "big ellipsoid")
# How a tick ends that promises nothing.
PROMISE_NOTHING = ("VIOLATED", "BAD_TARGET", "CHANGED")


@cache
def parts() -> dict[str, exact.Part]:
    corner = [(-0.6, -0.6), (0.6, -0.6), (0.6, -0.2), (-0.2, -0.2), (-0.2, 0.6), (-0.6, 0.6)]
    made = [
        exact.box(1.0, 0.7, 0.5),
        exact.plate(3.0, 2.0, 0.3, [(-0.7, 0.0, 0.5), (0.7, 0.1, 0.4)]),
        exact.pin(0.3, 1.2),
        exact.torus(0.6, 0.15),
        exact.ball(0.4),
        exact.polygonal(corner, 0.5, "L"),
        exact.polygonal(exact.star(5, 0.35, 0.8), 0.4, "star"),
        exact.box(1.6, 1.2, 1e-2, "thin 1e-2"),
        exact.box(1.6, 1.2, 1e-4, "thin 1e-4"),
        exact.box(4.0, 3.5, 3.0, "big box"),
        exact.sheet(1.5, 1.1),
        exact.ellipsoid(0.3, 0.5, 0.7),
        exact.ellipsoid(2.0, 2.2, 2.4, "big ellipsoid"),
        exact.capsule(0.2, 0.8),
        exact.tube(0.5, 0.4, 1.0),
    ]
    return {part.name: part for part in made}


class Start(NamedTuple):
    """Two parts by their names, the first one at the origin; where the second one stands, and how it came there."""

    first: str
    second: str
    pose: Array
    kind: str
    # The way out that it was moved along, and the signed distance.
    way: Array
    distance: float

    @property
    def a(self) -> exact.Part:
        return parts()[self.first]

    @property
    def b(self) -> exact.Part:
        return parts()[self.second]

    @property
    def size(self) -> float:
        return max(self.a.size, self.b.size)


def _direction(rng: np.random.Generator) -> Array:
    way = rng.normal(size=3)
    return np.asarray(way / np.linalg.norm(way))


def _turn(rng: np.random.Generator) -> Rotation:
    """Any, or with three in ten a number of quarter turns about z: flush faces."""
    if rng.random() < 0.7:
        return Rotation.random(random_state=int(rng.integers(1 << 30)))
    return Rotation.from_euler("z", 90 * rng.integers(4), degrees=True)


def _names(rng: np.random.Generator) -> tuple[str, str]:
    """Of two parts, one of which at least has an inside."""
    known = list(parts())
    while True:
        first, second = (known[k] for k in rng.integers(len(known), size=2))
        if parts()[first].is_closed or parts()[second].is_closed:
            return first, second


def brought_to(a: exact.Part, b: exact.Part, turn: Array, base: Array, way: Array, aim: float) -> Array | None:
    """The place along a way out of `base` where the least signed distance is `aim`, to 1 in 100.

    None where it is higher at once.
    """

    def above(t: float) -> float:
        return least_signed_distance(a, b, Motion(turn, base + t * way)) - aim

    # Samples are never too low, so that the lower end is in for certain; and the upper one goes out until it is out.
    low, high = 0.0, a.size + b.size + abs(aim)
    if sampled_distance(a, b, Motion(turn, base)) >= aim:
        return None
    while high - low > 0.5 * b.spacing:
        middle = 0.5 * (low + high)
        if sampled_distance(a, b, Motion(turn, base + middle * way)) < aim:
            low = middle
        else:
            high = middle
    while above(high) <= 0.0:
        high += b.spacing
    return np.asarray(base + way * brentq(above, low, high, xtol=0.01 * abs(aim), disp=False))


def _nested(rng: np.random.Generator, turn: Array) -> tuple[str, str, Array]:
    """A part wholly within a big one, their names and where."""
    first = BIG[rng.integers(len(BIG))]
    known = [name for name in parts() if name not in (*BIG, "plate")]
    second, big = known[rng.integers(len(known))], parts()[first]
    while True:
        place = rng.uniform(-1.0, 1.0, 3) * big.half_extents
        if big.distance(Motion(turn, place).apply(parts()[second].samples)).max() < -1e-3:
            return first, second, place


def _pierced(rng: np.random.Generator, a: exact.Part, b: exact.Part, turn: Array) -> Array:
    """Where a point inside of one part, or of a sheet, is at one inside of the other."""
    at, of = (points[rng.integers(len(points))] for points in (p.inner if p.is_closed else p.samples for p in (a, b)))
    return np.asarray(at - turn @ of)


def start(rng: np.random.Generator, aims: tuple[float, float] = (-6.0, -1.0), sides: Sequence[int] = (-1, 1)) -> Start:
    """A random one; where it is near the signed distance is 10 to some power of `aims`, with a sign of `sides`."""
    first, second = _names(rng)
    a, b = parts()[first], parts()[second]
    turn, way, base = _turn(rng), _direction(rng), rng.uniform(-0.5, 0.5, 3) * (rng.random() < 0.6)
    share, aim = rng.random(), 10.0 ** rng.uniform(*aims) * rng.choice(sides)
    matrix, place, kind = turn.as_matrix(), None, "near"
    if share < NEAR:
        place = brought_to(a, b, matrix, base, way, aim)
    elif share < NEAR + PIERCED:
        kind, place = "pierced", _pierced(rng, a, b, matrix)
    elif share < NEAR + PIERCED + NESTED:
        kind = "nested"
        first, second, place = _nested(rng, matrix)
    if place is None:
        kind, place = "anywhere", base + way * rng.uniform(0.0, 2.0)
    distance = least_signed_distance(parts()[first], parts()[second], Motion(matrix, place))
    return Start(first, second, np.r_[place, turn.as_quat(scalar_first=True)], kind, way, distance)


def clear_start(rng: np.random.Generator) -> Start:
    """One whose parts are apart, by 1e-4 at least."""
    while True:
        found = start(rng, aims=(-4.0, -0.5), sides=(1,))
        if found.distance > 0.99e-4:
            return found


class Way(NamedTuple):
    """From one pose to another one, of the second part: its center along a line, it turns about one axis."""

    begin: Start
    end: Array

    def at(self, part: float) -> Motion:
        turns = Rotation.from_quat([self.begin.pose[3:], self.end[3:]], scalar_first=True)
        turn = Rotation.from_rotvec(part * (turns[1] * turns[0].inv()).as_rotvec()) * turns[0]
        return Motion(turn.as_matrix(), (1.0 - part) * self.begin.pose[:3] + part * self.end[:3])

    def least(self, looks: int = LOOKS) -> float:
        """The least signed distance at so many poses of the way, both ends among them."""
        a, b = self.begin.a, self.begin.b
        return min(least_signed_distance(a, b, self.at(part)) for part in np.linspace(0.0, 1.0, looks))


def way(rng: np.random.Generator, begin: Start) -> Way:
    """A random step of 1e-3 to 0.5 from a start; one in two goes in again, by up to six times as much."""
    step = 10.0 ** rng.uniform(-3.0, -0.3)
    off = step * _direction(rng)
    if rng.random() < 0.5:
        off = -begin.way * step * rng.uniform(1.0, 6.0)
    turn = Rotation.from_rotvec(rng.normal(size=3) * step * rng.choice([0.0, 0.5, 1.5]))
    turned = turn * Rotation.from_quat(begin.pose[3:], scalar_first=True)
    return Way(begin, np.r_[begin.pose[:3] + off, turned.as_quat(scalar_first=True)])


def scene_of(begin: Start) -> asm.Assembly:
    """Its two bodies, the first one fixed."""
    a = asm.Body("a", begin.a.shape, fixed=True)
    b = asm.Body("b", begin.b.shape, begin.pose[:3], begin.pose[3:])
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Clearance())
    return scene


def _depth(begin: Start, q: Array) -> float:
    """How deep the bodies are in each other where a solution has them, in parts of the size."""
    seen = Motion.of(q[1]).seen_from(Motion.of(q[0]))
    return crossing_depth(begin.a, begin.b, seen) / begin.size


@dataclass(frozen=True)
class SolveOutcome:
    """How a solve ended, and how deep the bodies are in each other then, in parts of the larger one's size."""

    number: int
    pair: tuple[str, str]
    kind: str
    distance: float
    is_drawn: bool
    status: str
    depth: float
    moved: float
    objective: float
    iterations: int
    seconds: float

    @property
    def is_solved(self) -> bool:
        return self.status in ("SOLVED", "FITTED")

    @property
    def is_right(self) -> bool:
        """Whether the bodies are clear where it says so."""
        return not self.is_solved or self.depth <= TOUCHING


def solved(number: int) -> SolveOutcome:
    """Solve the scene of a number."""
    rng = np.random.default_rng([1, number])
    begin = start(rng)
    scene = scene_of(begin)
    is_drawn = number % 2 == 1
    if is_drawn:
        held = rng.uniform(-0.5, 0.5, 3) * begin.b.half_extents
        target = rng.uniform(-0.7, 0.7, 3) * begin.a.half_extents
        scene.minimize(asm.PointDistance(scene.bodies[1].point(*held), target))
    clock = perf_counter()
    solution = scene.solve()
    seconds = perf_counter() - clock
    return SolveOutcome(
        number,
        (begin.first, begin.second),
        begin.kind,
        begin.distance,
        is_drawn,
        solution.status.name,
        _depth(begin, solution.q),
        float(np.linalg.norm(solution.q[1, :3] - begin.pose[:3])),
        solution.objective,
        solution.iterations,
        seconds,
    )


@dataclass(frozen=True)
class TrackOutcome:
    """How the ticks of a hand ended: their statuses, and those where the bodies are in each other, with their depths.

    `begins` is False where the clear start led to no tracker.
    """

    number: int
    pair: tuple[str, str]
    hand: str
    distance: float
    begins: bool
    statuses: list[str]
    depths: list[float]
    seconds: float

    @property
    def wrong(self) -> list[int]:
        """Ticks that promise what is not so."""
        ends = zip(self.statuses, self.depths, strict=True)
        return [k for k, (status, depth) in enumerate(ends) if status not in PROMISE_NOTHING and depth > TOUCHING]


def _targets(rng: np.random.Generator, begin: Start, held: Array, hand: str) -> Array:
    """Where the hand is at every tick: anywhere around for a while, or slowly through the first part and out of it."""
    at = Motion.of(begin.pose).apply(held[None])[0]
    reach = begin.a.half_extents + 0.3 * begin.b.size
    if hand == "jumps":
        return np.asarray(np.repeat(rng.uniform(-1.0, 1.0, (TICKS // HELD_FOR, 3)) * reach, HELD_FOR, axis=0))
    through = rng.uniform(-0.5, 0.5, 3) * begin.a.half_extents
    return np.asarray(at + np.linspace(0.0, 2.0, TICKS + 1)[1:, None] * (through - at))


def tracked(number: int) -> TrackOutcome:
    """Follow the hand of a number, from a clear start: jumping, or slow and straight."""
    rng = np.random.default_rng([2, number])
    begin = clear_start(rng)
    scene, hand = scene_of(begin), ("jumps", "slow")[number % 2]
    held = rng.uniform(-0.5, 0.5, 3) * begin.b.half_extents
    pair, seconds = (begin.first, begin.second), 0.0
    statuses: list[str] = []
    depths: list[float] = []
    try:
        tracker = scene.tracker(scene.bodies[1].point(*held))
    except asm.errors.InputError:
        return TrackOutcome(number, pair, hand, begin.distance, False, statuses, depths, seconds)
    for target in _targets(rng, begin, held, hand):
        step = tracker.step(target)
        statuses.append(step.status.name)
        seconds += step.seconds
        depths.append(0.0 if step.status.name in PROMISE_NOTHING else _depth(begin, step.q))
    return TrackOutcome(number, pair, hand, begin.distance, True, statuses, depths, seconds)


def _table(title: str, rows: Iterable[tuple[str, str]]) -> None:
    """Print counts of what came, by a heading."""
    counts: dict[str, Counter[str]] = {}
    for heading, what in rows:
        counts.setdefault(heading, Counter())[what] += 1
    print(title)
    for heading in sorted(counts):
        print(f"  {heading}: " + ", ".join(f"{many} {what}" for what, many in counts[heading].most_common()))


def report(solves: list[SolveOutcome], tracks: list[TrackOutcome]) -> None:
    """Print how they ended."""
    ends = [f"{s.status}{' clear' if s.depth <= TOUCHING else ' crossing'}" for s in solves]
    _table("solves", [("all", end) for end in ends])
    for title, key in (("by kind", lambda s: s.kind), ("drawn", lambda s: str(s.is_drawn))):
        _table(title, [(key(s), end) for s, end in zip(solves, ends, strict=True)])
    _table("by part", [(name, end) for s, end in zip(solves, ends, strict=True) for name in sorted(set(s.pair))])
    _table("SOLVED and crossing by pair", [("pairs", " and ".join(sorted(s.pair))) for s in solves if not s.is_right])
    if solves:
        median, late = 1e3 * np.quantile([s.seconds for s in solves], [0.5, 0.99])
        print(f"{median:.2f} ms a solve at the median, {late:.0f} ms at 99 of 100")
    told = [(t, k) for t in tracks for k in range(len(t.statuses))]
    wrong = {(t.number, k) for t in tracks for k in t.wrong}
    _table("ticks", [(t.hand, t.statuses[k] + " crossing" * ((t.number, k) in wrong)) for t, k in told])
    _table("trackers", [(t.hand, "begins" if t.begins else "begins not") for t in tracks])
    _table("wrong ticks by pair", [("pairs", " and ".join(sorted(t.pair))) for t in tracks for _ in t.wrong])


def main(file: str = "", solves: int = 900, tracks: int = 150) -> int:
    """Run, print and write; how many are wrong."""
    solved(0), tracked(0)
    ends, ways = [solved(k) for k in range(solves)], [tracked(k) for k in range(tracks)]
    report(ends, ways)
    if file:
        Path(file).write_text(json.dumps({"solves": [asdict(s) for s in ends], "tracks": [asdict(t) for t in ways]}))
    return sum(not s.is_right for s in ends) + sum(len(t.wrong) for t in ways)


if __name__ == "__main__":
    sys.exit(main("".join(sys.argv[1:2]), *map(int, sys.argv[2:4])) > 0)
