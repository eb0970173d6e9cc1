"""Other starts than one that failed: about the pose where it ended, and scattered ones; the same in every run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.records import TAPES
from assembly.kinematics.body import Body
from assembly.kinematics.pose import retract

__all__ = ["Spread", "about", "far_starts", "moving_rows", "near_starts", "scattered"]

Array = NDArray[np.float64]
# How far about a pose others start, in sizes of the scene and radians: it may be a saddle by symmetry.
ABOUT = (0.0, 0.03, 0.3)
# By what rounds of starts grow wider where lengths are not known.
WIDER = 2.0


class Spread(NamedTuple):
    """How far about a pose other starts are, in the user's lengths; every round of them is wider by a factor."""

    size: float
    growth: float = 1.0

    @classmethod
    def of(cls, packed: Packed, q: Array) -> Spread:
        """That of a scene whose solve ended at poses (n, 7).

        Its size; where expressions say where bodies are, what these span there, and more and more: nobody knows the
        lengths that an expression is about, and they need not be those of shapes and joints.
        """
        if not packed.table[TAPES]:
            return cls(packed.scale)
        return cls(max(packed.scale, float(np.abs(q[:, :3] - packed.reference).max())), WIDER)


def near_starts(bodies: Sequence[Body], q: Array, spread: Spread) -> list[Array]:
    """Poses (n, 7) themselves, which a solve has other turns from, and poses about them."""
    rng = np.random.default_rng(0)
    moving = moving_rows(bodies)
    return [about(rng, q, moving, spread.size, reach) for reach in ABOUT]


def far_starts(bodies: Sequence[Body], q: Array, spread: Spread, count: int) -> Iterator[list[Array]]:
    """Scattered poses (n, 7) without end, so many at a time."""
    rng = np.random.default_rng(0)
    moving = moving_rows(bodies)
    size = spread.size
    while True:
        yield [scattered(rng, q, moving, size) for _ in range(count)]
        size *= spread.growth


def moving_rows(bodies: Sequence[Body]) -> list[int]:
    """The rows of poses (n, 7) that may change."""
    return [k for k, body in enumerate(bodies) if not body.fixed]


def about(rng: np.random.Generator, q: Array, moving: Sequence[int], size: float, reach: float) -> Array:
    """Poses (n, 7) near others: moved by about `reach`, in parts of the scene's size and radians."""
    moved = q.copy()
    sizes = np.repeat([size, 1.0], 3)
    moved[moving] = retract(q[moving], reach / np.sqrt(3.0) * sizes * rng.normal(size=(len(moving), 6)))
    return moved


def scattered(rng: np.random.Generator, q: Array, moving: Sequence[int], size: float) -> Array:
    """Poses (n, 7) shifted by up to the scene's size along each axis, and turned any way."""
    moved = q.copy()
    moved[moving, :3] += size * rng.uniform(-1.0, 1.0, (len(moving), 3))
    turns = rng.normal(size=(len(moving), 4))
    moved[moving, 3:] = turns / np.linalg.norm(turns, axis=1, keepdims=True)
    return moved
