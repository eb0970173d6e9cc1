"""Bodies that cross at the pose of a solution."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints import layout
from assembly.constraints.clearance import Clearance
from assembly.constraints.constraint import Constraint
from assembly.constraints.contact import Contact
from assembly.constraints.joint import Joint
from assembly.constraints.packing import Packed
from assembly.kinematics.body import Body
from assembly.proximity import watch, watch_memory
from assembly.proximity.solid_contact import PAIR_GAP, TRACK

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["crossing_pairs", "free_pairs", "joined_pairs", "pairs_that_cross"]

Array = NDArray[np.float64]
Pair = tuple[Body, Body]
# What is in each other by less, in parts of the scene's size, may be so by rounding.
ROUNDED = 1e-10
# How deep looks see, in parts of that size. A deep look of wires that cross often finds so much that it lacks room for
# the rest, so that there are several.
DEPTHS = (0.005, 0.015, 0.05)


class _Watched(Clearance):
    """A clearance of given pairs, any bodies of which may be moved, and extrema alone."""

    corners = False

    def __init__(self, pairs: Sequence[Pair], name: str) -> None:
        super().__init__(dict.fromkeys(body for pair in pairs for body in pair), name=name)
        self._pairs = list(pairs)

    def pairs(self, bodies: Sequence[Body]) -> list[Pair]:
        """Those that were given."""
        return self._pairs


def _key(a: Body, b: Body) -> frozenset[int]:
    return frozenset((id(a), id(b)))


def _shaped_pairs(bodies: Iterable[Body], constraints: Iterable[Constraint]) -> list[Pair]:
    """All pairs of bodies with shapes that no clearance lets overlap."""
    clearances = [item for item in constraints if isinstance(item, Clearance)]
    excluded = {_key(*pair) for item in clearances for pair in item.exclude}
    shaped = [body for body in bodies if body.faces]
    return [(a, b) for a, b in combinations(shaped, 2) if _key(a, b) not in excluded]


def _ties(constraints: Iterable[Constraint]) -> set[frozenset[int]]:
    return {_key(*item.bodies) for item in constraints if isinstance(item, Joint)}


def free_pairs(bodies: Iterable[Body], constraints: Sequence[Constraint]) -> list[Pair]:
    """Pairs of bodies that no joint ties directly, but those that a clearance lets overlap."""
    ties = _ties(constraints)
    return [pair for pair in _shaped_pairs(bodies, constraints) if _key(*pair) not in ties]


def joined_pairs(bodies: Iterable[Body], constraints: Sequence[Constraint]) -> list[Pair]:
    """Pairs of bodies that a joint ties directly, but those that a clearance lets overlap."""
    ties = _ties(constraints)
    return [pair for pair in _shaped_pairs(bodies, constraints) if _key(*pair) in ties]


def crossing_pairs(solution: Solution, pairs: Sequence[Pair]) -> tuple[tuple[str, str], ...]:
    """Names of those pairs whose bodies cross elsewhere than at contacts that the scene has, or are in each other.

    Raises
    ------
    InputError
        Bodies of sizes that clearances cannot have.
    """
    contacts = [item for item in solution._scene.constraints if isinstance(item, Contact)]
    given = solution._parameters[: len(contacts)]
    return pairs_that_cross(solution._scene.bodies, pairs, solution.q, solution._touching, contacts, given)


def pairs_that_cross(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    q: Array,
    touching: float,
    contacts: Sequence[Contact] = (),
    given: Array | None = None,
) -> tuple[tuple[str, str], ...]:
    """Names of those pairs whose bodies are in each other at poses q, (n, 7), by more than touching.

    Contacts of the scene, `given` as tracked, (k, TRACK), are no crossings.

    Raises
    ------
    InputError
        Bodies of sizes that clearances cannot have.
    """
    if not pairs:
        return ()
    name = "crossings"
    while any(item.name == name for item in contacts):
        name += "'"
    packed = Packed(bodies, [*contacts, _Watched(pairs, name)], ())
    q = q.copy()
    q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    tracked = np.full((packed.pair_rows, TRACK), np.nan)
    if given is not None:
        tracked[: len(given)] = given
    found = _seen(packed, q, tracked, len(contacts), touching)
    return tuple((a.name, b.name) for k, (a, b) in enumerate(pairs) if k in found)


def _seen(packed: Packed, q: Array, known: Array, contacts: int, touching: float) -> set[int]:
    """Places of pairs that looks of several depths find to cross."""
    count = watch_memory.PAIR_MEMORY * len(packed.guarded[0])
    deep = max(ROUNDED, touching)
    found = set()
    for depth in DEPTHS:
        state = packed.new_state()
        memory = state[packed.memory_at :]
        memory[watch_memory.OVERLAP] = touching
        pairs = memory[watch_memory.MEMORY_HEADER :][:count].reshape(-1, watch_memory.PAIR_MEMORY)
        pairs[:, watch_memory.REACH] = depth
        tracked = known.copy()
        watch.look(packed.table, packed.pool, packed.table[layout.WATCH], memory, q, tracked, watch.EVERYTHING)
        found |= set(np.flatnonzero(pairs[:, watch_memory.CROSSED] == 1.0).tolist())
        gaps = tracked[contacts:, PAIR_GAP]
        found |= {pair for gap, (pair, _) in zip(gaps, packed.listed(state), strict=True) if pair >= 0 and gap < -deep}
    return found
