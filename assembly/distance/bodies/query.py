"""The search for the distance of two bodies, from Python."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._heap import PAIR
from assembly._record import size_of
from assembly.distance.bodies.descent import BODY_SEARCH, body_search_at
from assembly.distance.bodies.models import RESIDUAL
from assembly.distance.bodies.packing import KeptTree
from assembly.distance.bodies.pair import PAIR_DOUBLES
from assembly.distance.bodies.records import PATCH, patch_at, patch_span_at
from assembly.distance.bodies.search import CROWDED, search_bodies
from assembly.distance.patches.pair import BASIS

__all__ = ["Nearest", "Place", "bodies_apart"]

Array = NDArray[np.float64]
_SEARCH = size_of(BODY_SEARCH)
_PATCH = size_of(PATCH)
# Pairs for which a heap has room at first.
_WAITING = 1024


@dataclass(frozen=True)
class Place:
    """A point of a body: on face number `face` at (u, v), or on its boundary curve number `curve` at t."""

    face: int
    curve: int
    parameters: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Nearest:
    """What a search found: bounds, the nearest points known (2, 3) in world axes, where they are, pairs looked at.

    `status` is CONVERGED or SPENT (`search.py`). `boxed`: whether the point of b is in the box of a, that of a in the
    box of b.
    """

    lower: float
    upper: float
    points: Array
    places: tuple[Place, Place]
    boxed: tuple[bool, bool]
    pairs: int
    status: int


def bodies_apart(a: KeptTree, b: KeptTree, q: Array, tolerance: float, budget: int) -> Nearest:
    """Bounds of the distance of two bodies at poses q (2, 7)."""
    degree = max(a.degree, b.degree)
    state = np.empty(_SEARCH)
    work = (state, np.empty(PAIR_DOUBLES), np.zeros(BASIS + 6 * (degree + 1)), np.empty(RESIDUAL + 4 * (degree + 3) ** 2))
    heap = np.empty(_WAITING * PAIR)
    first, second = (a, b) if id(a) <= id(b) else (b, a)
    with first.lock, second.lock:
        status, left = search_bodies(a.arrays, b.arrays, q, (tolerance, float(budget)), heap, work, -1)
        while status == CROWDED:
            a.grow()
            if b is not a:
                b.grow()
            if (left + 1) * PAIR > heap.size:
                heap = np.concatenate([heap, np.empty(heap.size)])
            status, left = search_bodies(a.arrays, b.arrays, q, (tolerance, float(budget)), heap, work, left)
    found = body_search_at(state, 0)
    places = _place(a, int(found.patches[0]), found.places[:2]), _place(b, int(found.patches[1]), found.places[2:])
    points = found.world.reshape(2, 3)
    boxed = bool(found.boxed[0]), bool(found.boxed[1])
    return Nearest(float(found.lower), float(found.upper), points, places, boxed, int(found.pairs), int(status))


def _place(tree: KeptTree, number: int, x: Array) -> Place:
    """A place in the unit square of a patch as one of its face."""
    table, pool = tree.arrays[:2]
    patch = patch_at(table, _PATCH * number)
    span = patch_span_at(pool, patch.span)
    u = _between(float(span.low_u), float(span.high_u), float(x[0]))
    v = _between(float(span.low_v), float(span.high_v), float(x[1])) if patch.curve < 0 else 0.0
    return Place(int(patch.face), int(patch.curve), (u, v))


def _between(low: float, high: float, x: float) -> float:
    """A place from 0 to 1 on a span; rounding does not lead out of it."""
    return min(max(low * (1.0 - x) + high * x, low), high)
