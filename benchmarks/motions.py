"""Random motions of two wires that do not cross, and what a list of contacts misses, doubles or makes up."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.shapes.path import Path
from benchmarks.center_lines import Wire, paper_clip_wire, path_wire, torus_wire
from benchmarks.watching import Listed, Watch
from benchmarks.wire_oracle import Extrema, WireOracle

__all__ = ["PAIRS", "Errors", "compared", "random_motion", "wander"]

Array = NDArray[np.float64]
HOOK = Path((0, 0, 0), (0, 0, 1)).line(2.0).arc(0.7, 2.0, (1, 0, 0)).arc(0.5, 1.3, (0, 1, 0.3)).line(1.0)
RING = Path((1.0, 0, 0), (0, 1, 0)).line(1).arc(0.5, np.pi, (-1, 0, 0)).line(2).arc(0.5, np.pi, (1, 0, 0)).line(1)
ROD = Path((0, 0, -1), (0, 0, 1)).line(2.0)
# Name: (wire, surface, half extent of random places).
SHAPES: dict[str, tuple[Wire, asm.NurbsSurface, float]] = {
    "clip": (paper_clip_wire(), asm.shapes.paper_clip(), 10.0),
    "small clip": (paper_clip_wire(10.0, 5.0, 0.25), asm.shapes.paper_clip(10.0, 5.0, 0.25), 3.0),
    "torus": (torus_wire(1.0, 0.12), asm.shapes.torus(1.0, 0.12), 1.2),
    "wide torus": (torus_wire(1.4, 0.5), asm.shapes.torus(1.4, 0.5), 2.0),
    "hook": (path_wire(HOOK, 0.2), asm.shapes.pipe(HOOK, 0.2), 1.5),
    "ring": (path_wire(RING, 0.2), asm.shapes.pipe(RING, 0.2), 1.2),
    "rod": (path_wire(ROD, 0.15), asm.shapes.pipe(ROD, 0.15), 1.0),
}
PAIRS = (
    ("torus", "torus"),
    ("clip", "clip"),
    ("wide torus", "torus"),
    ("small clip", "small clip"),
    ("rod", "hook"),
    ("hook", "ring"),
    ("rod", "rod"),
    ("small clip", "rod"),
)
# Two points nearer than this, in lengths of the larger wire, are one: minima close to a fold are that uncertain.
SAME = 1e-5
# A minimum flatter than this, over the inverse length, is none that has to be found.
FLAT = 1e-6


@dataclass
class Errors:
    """What went wrong over a number of poses.

    Attributes
    ----------
    poses, contacts : int
        How many were compared; contacts are those that had to be listed.
    missed, doubled, strange : list of (2, 7) arrays
        Poses with a contact that is not listed, listed twice, or no minimum at all, once for each.
    """

    poses: int
    contacts: int
    missed: list[Array]
    doubled: list[Array]
    strange: list[Array]

    @classmethod
    def none(cls) -> Errors:
        """Of no poses."""
        return cls(0, 0, [], [], [])


def random_motion(rng: np.random.Generator, name_f: str, name_g: str, steps: int) -> Array:
    """Poses (steps, 2, 7): the second wire wanders about the first, near it, and turns back where it would cross."""
    (wire_f, _, extent_f), (wire_g, _, extent_g) = SHAPES[name_f], SHAPES[name_g]
    oracle = WireOracle([wire_f, wire_g])
    radius = wire_f.radius + wire_g.radius
    q = np.zeros((2, 7))
    while True:
        e = rng.normal(size=(2, 4))
        q[:, 3:] = e / np.linalg.norm(e, axis=1, keepdims=True)
        q[:, :3] = rng.normal(size=3)
        q[1, :3] += rng.uniform(-1.0, 1.0, 3) * 0.5 * (extent_f + extent_g)
        if 0.0 <= oracle.deepest(q) < radius:
            break
    length, size = rng.uniform(0.03, 0.4) * radius, 0.5 * (extent_f + extent_g)
    poses = [q.copy()]
    way = rng.normal(size=6)
    while len(poses) < steps:
        way = 0.8 * way + 0.6 * rng.normal(size=6)
        trial = q.copy()
        trial[1, :3] += length * way[:3] / np.sqrt(6.0)
        turn = Rotation.from_rotvec(length / size * way[3:] / np.sqrt(6.0))
        trial[1, 3:] = (turn * Rotation.from_quat(q[1, 3:], scalar_first=True)).as_quat(scalar_first=True)
        gap = oracle.deepest(trial)
        if gap < 0.0 or gap > 2.0 * radius:
            way = -way
            continue
        q = trial
        poses.append(q.copy())
    return np.array(poses)


def compared(listed: Listed, extrema: Extrema, tolerance: float, flat: float) -> tuple[int, int, int, int]:
    """How many contacts had to be listed, are missed, doubled, and made up, of one pair of bodies."""
    near = np.linalg.norm(listed.points[:, None] - extrema.points[None], axis=3).max(axis=2) < tolerance
    minimum = (extrema.index == 0) & (extrema.curvature > flat)
    due = minimum & (extrema.gap < listed.take[0] - tolerance)
    # A root that is all but a fold may be either side of it.
    real = near[:, minimum | (np.abs(extrema.curvature) < flat)].any(axis=1)
    return (
        int(due.sum()),
        int((due & ~near.any(axis=0)).sum()),
        int(np.maximum(near[:, minimum].sum(axis=0) - 1, 0).sum()),
        int((~real).sum()),
    )


@cache
def _judged(name_f: str, name_g: str) -> tuple[Watch, WireOracle]:
    """Two wires under watch, and who judges them; making a contact manager takes longer than a motion."""
    shapes = SHAPES[name_f], SHAPES[name_g]
    return Watch([surface for _, surface, _ in shapes]), WireOracle([wire for wire, _, _ in shapes])


def wander(rng: np.random.Generator, name_f: str, name_g: str, steps: int, errors: Errors) -> None:
    """A random motion, looked at step by step; every list is compared with all extrema."""
    watch, oracle = _judged(name_f, name_g)
    watch.forget()
    size = max(float(SHAPES[name][0].length.sum()) for name in (name_f, name_g))
    for q in random_motion(rng, name_f, name_g, steps):
        listed = watch.look(q)
        try:
            extrema = oracle.extrema(q)
        except ArithmeticError:  # a continuum, or a fold
            continue
        due, *counts = compared(listed, extrema, SAME * size, FLAT / size)
        errors.poses += 1
        errors.contacts += due
        for count, bad in zip(counts, (errors.missed, errors.doubled, errors.strange), strict=True):
            bad.extend([q] * count)
