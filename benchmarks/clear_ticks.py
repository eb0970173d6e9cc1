"""Ticks with clearances: looks of a proof at bodies that move, its first look, and whole ticks of a box that tips over.

Who judges the bounds knows the bodies as what they are: a pin in a bore, a box on a plate, circles of tori and clips.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._address import address_of, clock_address
from assembly.proximity.clearance.answers import is_proven
from assembly.proximity.clearance.pair_looks import stay_clear
from assembly.proximity.clearance.proof import ClearanceProof
from benchmarks.figures import figure
from benchmarks.kernels import looks_along
from benchmarks.running import example

ABOUT = """\
A look proves that bodies are clear, or touch, at a pose and on the way there from the last one: what a proof adds to a
tick. Looks run one after the other in a kernel, each with its time; the least of some runs counts, and of these the
median and the longest. Bodies go 1e-3 of their size a look. A pin of 0.499 in a bore of 0.5, of a plate with two bores,
turns, slides and drifts; "covered" is the same pin at rest, where the motion bound tells all. In contact the pin slides
and turns along the wall, and a box lies flat on the plate over a bore's rim, both moved off by 1e-8. Linked tori have
radii of 0.6 and 0.15. The clips are those of "Tracking", three that touch, behind their hand; a clip has two neighbors.
A first look is that of a proof that has looked at nothing, a call from Python. Right is a look that proves its way and
whose bound is no larger than the gap, which is known of the pin, the box and the tori. A box that is drawn down beside
a bore tips over its rim: whole ticks from Python."""

Array = NDArray[np.float64]
REST = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
HOLES = [(-0.7, 0.0, 0.5), (0.7, 0.1, 0.4)]
PIN, RING, TUBE, BOX = 0.499, 0.6, 0.15, (0.4, 0.3, 0.2)
OPENED, TOUCHING, ROUNDING = 1e-8, 1e-9, 1e-12


def _faces(body: asm.Body) -> tuple[Any, ...]:
    return tuple(side.face for side in body.faces)


def _poses(places: Array, turns: Rotation) -> Array:
    """Poses (n, 2, 7) of a body at rest and one that moves."""
    q = np.empty((len(places), 2, 7))
    q[:, 0], q[:, 1, :3], q[:, 1, 3:] = REST, places, turns.as_quat(scalar_first=True)
    return q


def _wriggling_pin(k: Array) -> Array:
    """Drifting in its play, while it slides and turns."""
    way = 3.6e-3 * k
    x, y = 3e-4 * np.sin(0.05 * k) - 0.7, 3e-4 * np.cos(0.07 * k) - 3e-4
    places = np.column_stack([x, y, 0.25 * np.sin(way / 0.25)])
    return _poses(places, Rotation.from_euler("z", (way / PIN)[:, None]))


def _sliding_pin(k: Array) -> Array:
    """Along the bore's wall."""
    places = np.column_stack([np.full(len(k), 0.001 - 0.7), 0.0 * k, 0.25 * np.sin(3.6e-3 * k / 0.25)])
    return _poses(places, Rotation.from_euler("z", (1e-3 * k)[:, None]))


def _flat_box(k: Array) -> Array:
    places = np.column_stack([0.1 * np.sin(1e-3 * k) - 0.2, 0.1 * np.cos(1e-3 * k), np.full(len(k), 0.25)])
    return _poses(places, Rotation.from_euler("z", (1e-3 * k)[:, None]))


def _linked_ring(k: Array) -> Array:
    f = 1.5e-3 * k / 0.08
    places = 0.08 * np.column_stack([np.sin(f), np.sin(0.83 * f + 1.0), np.sin(0.71 * f + 2.0)]) + (0.6, 0.0, 0.0)
    tilt = np.column_stack([0.0 * k, 0.3 * np.sin(0.01 * k), 0.0 * k])
    return _poses(places, Rotation.from_euler("x", np.pi / 2.0) * Rotation.from_rotvec(tilt))


def _in_bore(q: Array) -> float:
    return 0.5 - PIN - float(np.hypot(q[1, 0] + 0.7, q[1, 1]))


def _over_plate(q: Array) -> float:
    return float(q[1, 2]) - 0.15 - 0.5 * BOX[2]


def _between_circles(q: Array) -> float:
    """The least distance of samples of the second circle from the first one, less both tubes."""
    around = np.linspace(0.0, 2.0 * np.pi, 2001)
    x = asm.Pose(q[1, :3], q[1, 3:]).apply(RING * np.column_stack([np.cos(around), np.sin(around), 0.0 * around]))
    return float(np.hypot(np.hypot(x[:, 0], x[:, 1]) - RING, x[:, 2]).min()) - 2.0 * TUBE


class _Looks:
    """A proof of bodies on their way, which may overlap by what touches; its second bodies are moved off first."""

    def __init__(self, bodies: list[asm.Body], poses: Array, off: tuple[float, float, float], slimmer: float) -> None:
        pairs = [(i, j) for j in range(len(bodies)) for i in range(j)]
        self._shapes, self._pairs, self._slimmer = [_faces(body) for body in bodies], pairs, slimmer
        self.poses, self._touching = poses, max(slimmer, TOUCHING)
        self._moves = np.zeros((len(pairs), 6))
        self._moves[:, :3] = off
        self.off = float(np.linalg.norm(off))

    def _first(self) -> tuple[ClearanceProof, bool, float]:
        proof = ClearanceProof(self._shapes, self._pairs, [0.0] * len(self._pairs))
        proof.make_slimmer(self._slimmer)
        begin = perf_counter()
        proven = all(map(is_proven, proof.look(self.poses[0], self._touching, self._moves)))
        return proof, proven, perf_counter() - begin

    def first_look(self) -> float:
        """Seconds of it."""
        return self._first()[2]

    def times(self, runs: int) -> Array:
        """Seconds of every look: the least of some runs."""
        addresses = address_of(stay_clear), clock_address()
        least = np.full(len(self.poses), np.inf)
        for _ in range(runs):
            proof, _, _ = self._first()
            codes, taken = (np.zeros(len(self.poses), dtype=np.int64) for _ in range(2))
            looks_along(addresses, proof.lent, self.poses, self._moves, self._touching, codes, taken)
            least = np.minimum(least, 1e-9 * taken)
        return least

    def right(self, gap: Callable[[Array], float] | None) -> int:
        """How many looks prove their way, by bounds that are no larger than gaps."""
        proof, proven, _ = self._first()
        count = 0
        for q in self.poses if proven else ():
            if proof.stays_clear(q, self._touching, self._moves):
                bounds, _ = proof.clear_bounds(q, self._moves)
                count += gap is None or float(bounds.min()) - self.off <= gap(q) + ROUNDING
        return count


def _clips(looks: int) -> _Looks:
    """Three that touch, on the way that ticks of a tracker lead them."""
    module = example("follow_the_hand")
    chain = module.paper_clips()
    tracker = chain.tracker(follow=chain.body("blue").point(*module.END))
    hand = module.hand(asm.Pose(tracker.q[2, :3], tracker.q[2, 3:]).apply(module.END))
    log = tracker.run(asm.Trace(hand.times[:looks], hand.targets[:looks]))
    size = max(body.size for body in chain.bodies)
    return _Looks(list(chain.bodies), np.ascontiguousarray(log.q), (0.0, 0.0, 0.0), TOUCHING * size)


def _cases(looks: int) -> dict[str, tuple[_Looks, Callable[[Array], float] | None, float]]:
    """What looks, who knows its gap, and what a look is to take."""
    k = np.arange(looks, dtype=float)
    plate = asm.Body("plate", asm.shapes.plate(3.0, 2.0, 0.3, HOLES), fixed=True)
    pin, box = asm.Body("pin", asm.shapes.solid_cylinder(PIN, 1.2)), asm.Body("box", asm.shapes.box(*BOX))
    rings = [asm.Body(name, asm.shapes.torus(RING, TUBE)) for name in ("ring", "other")]
    still = np.repeat(_wriggling_pin(k[:1]), looks, axis=0)
    none, aside, up = (0.0, 0.0, 0.0), (-OPENED, 0.0, 0.0), (0.0, 0.0, OPENED)
    return {
        "plate and pin, moving": (_Looks([plate, pin], _wriggling_pin(k), none, 0.0), _in_bore, 8e-6),
        "plate and pin, covered": (_Looks([plate, pin], still, none, 0.0), _in_bore, 0.8e-6),
        "line contact of a pin in its bore": (_Looks([plate, pin], _sliding_pin(k), aside, 0.0), _in_bore, 20e-6),
        "box flat over a rim": (_Looks([plate, box], _flat_box(k), up, 0.0), _over_plate, 20e-6),
        "linked tori": (_Looks(rings, _linked_ring(k), none, 0.0), _between_circles, 15e-6),
        "three clips that touch": (_clips(looks), None, 30e-6),
    }


def _tipping(ticks: int) -> list[dict[str, Any]]:
    """A box that tips over a rim."""
    plate = asm.Body("plate", asm.shapes.plate(3.0, 2.0, 0.3, HOLES), fixed=True)
    box = asm.Body("box", asm.shapes.box(*BOX), (-0.2, 0.0, 0.3))
    scene = asm.Assembly([plate, box])
    scene.constrain(asm.Clearance())
    tracker = scene.tracker(box.point(0.0, 0.0, 0.0))
    angle = 0.02 * np.arange(ticks)
    seconds, held = np.empty(ticks), 0
    for k, target in enumerate(np.column_stack([0.1 * np.sin(angle) - 0.2, 0.1 * np.cos(angle), np.full(ticks, 0.2)])):
        begin = perf_counter()
        step = tracker.step(target)
        seconds[k] = perf_counter() - begin
        held += step.proved and step.status.name in ("FOLLOWED", "APPROACHING")
    # The first tick makes what others work in.
    return [
        figure("a box that tips over a rim, a tick", "seconds", float(np.median(seconds[1:]))),
        figure("a box that tips over a rim, the longest tick", "seconds", float(seconds[1:].max())),
        figure("a box that tips over a rim, proven and not HELD", "count", held, of=ticks),
    ]


def run(quick: bool) -> dict[str, Any]:
    """Times of looks, and how many are right."""
    looks, runs = (50, 2) if quick else (1500, 30)
    figures, right, asked = [], 0, 0
    for name, (case, gap, reach) in _cases(looks).items():
        seconds = case.times(runs)[1:]
        figures.append(figure(f"{name}, a look", "seconds", float(np.median(seconds)), reach=reach))
        figures.append(figure(f"{name}, the longest look", "seconds", float(seconds.max())))
        right, asked = right + case.right(gap), asked + looks
        if name == "plate and pin, moving":
            first = float(np.median([case.first_look() for _ in range(runs)]))
            figures.append(figure("plate and pin, a first look", "seconds", first, reach=400e-6))
    figures.append(figure("looks that are right", "count", right, of=asked, reach=asked))
    return {"about": ABOUT, "figures": [*figures, *_tipping(100 if quick else 300)]}
