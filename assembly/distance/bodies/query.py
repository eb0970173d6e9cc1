"""The search for the distance of two bodies, from Python."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._heap import PAIR
from assembly._record import place_of, size_of
from assembly.distance.bodies.descent import BODY_SEARCH
from assembly.distance.bodies.models import RESIDUAL
from assembly.distance.bodies.packing import KeptTree
from assembly.distance.bodies.pair import PAIR_DOUBLES
from assembly.distance.bodies.records import NONE
from assembly.distance.bodies.search import search_bodies
from assembly.distance.patches.pair import BASIS
from assembly.distance.piece_search import CROWDED

__all__ = ["Nearest", "Place", "Spot", "bodies_apart", "place_of_spot"]

Array = NDArray[np.float64]
SEARCH = size_of(BODY_SEARCH)
_LOWER, _UPPER, _PAIRS = (place_of(BODY_SEARCH, name) for name in ("lower", "upper", "pairs"))
_PATCHES, _PLACES, _WORLD = (place_of(BODY_SEARCH, name) for name in ("patches", "places", "world"))
_FACING, _BOXED = place_of(BODY_SEARCH, "facing"), place_of(BODY_SEARCH, "boxed")
# Pairs for which a heap has room at first.
_WAITING = 1024
# More halvings of each body than a search starts with.
_START = 16


@dataclass(frozen=True)
class Place:
    """A point of a body: on face number `face` at (u, v), or on its boundary curve number `curve` at t."""

    face: int
    curve: int
    parameters: tuple[float, float]


class Spot(NamedTuple):
    """A point of a body: on its patch of this number, at x and y from 0 to 1."""

    patch: int
    x: float
    y: float


class Nearest:
    """What a search found.

    Attributes
    ----------
    status : int
        What `piece_search.py` has of these.
    lower, upper : float
        Bounds of the distance.
    pairs : int
        Pairs of nodes that were looked at.
    points : (2, 3)
        The nearest points known, world axes; read-only.
    """

    __slots__ = ("_state", "lower", "pairs", "points", "status", "upper")

    def __init__(self, state: Array, status: int) -> None:
        self.status = status
        # What is not asked for by all stays in the state: a query takes microseconds.
        self._state = state
        state.flags.writeable = False
        self.lower: float = state.item(_LOWER)
        self.upper: float = state.item(_UPPER)
        self.pairs = int(state.item(_PAIRS))
        self.points: Array = state[_WORLD : _WORLD + 6].reshape(2, 3)

    def facing(self, side: int) -> float:
        """Cosine of the outward normal at the point of a side and the way to the other one; 0 on a boundary curve."""
        return float(self._state.item(_FACING + side))

    def is_boxed(self, side: int) -> bool:
        """Whether the box of the body of a side has the point of the other one."""
        return bool(self._state.item(_BOXED + side))

    def spot(self, side: int) -> Spot:
        """Where the point of a side is on its body."""
        x, y = self._state[_PLACES + 2 * side : _PLACES + 2 * side + 2].tolist()
        return Spot(int(self._state.item(_PATCHES + side)), x, y)


def place_of_spot(tree: KeptTree, spot: Spot) -> Place:
    """The face or the boundary curve on which a point of a body is."""
    face, curve, (low_u, high_u, low_v, high_v) = tree.patch_at(spot.patch)
    u = _between(low_u, high_u, spot.x)
    return Place(face, curve, (u, _between(low_v, high_v, spot.y) if curve == NONE else 0.0))


def bodies_apart(a: KeptTree, b: KeptTree, q: Array, tolerance: float, budget: int, clearance: float = -1.0) -> Nearest:
    """Bounds of the distance of two bodies at poses q (2, 7); below zero a clearance asks for the distance itself."""
    degree = max(a.degree, b.degree)
    state = np.empty(SEARCH)
    w, room = np.zeros(BASIS + 6 * (degree + 1)), np.empty(RESIDUAL + 4 * (degree + 3) ** 2)
    work, asked = (state, np.empty(PAIR_DOUBLES), w, room), (tolerance, clearance, float(budget))
    heap = np.empty(_WAITING * PAIR)
    first, second = (a, b) if id(a) <= id(b) else (b, a)
    with first.lock, second.lock:
        # For the start, which so does not depend on what was asked before.
        a.make_room(_START)
        b.make_room(_START)
        status, left = search_bodies(a.arrays, b.arrays, q, asked, heap, work, -1)
        while status == CROWDED:
            a.make_room(1)
            b.make_room(1)
            if (left + 1) * PAIR > heap.size:
                heap = np.concatenate([heap, np.empty(heap.size)])
            status, left = search_bodies(a.arrays, b.arrays, q, asked, heap, work, left)
    return Nearest(state, int(status))


def _between(low: float, high: float, x: float) -> float:
    """A place from 0 to 1 on a span; rounding does not lead out of it."""
    return min(max(low * (1.0 - x) + high * x, low), high)
