"""The least translation found that parts two bodies which cross, or of which one is within the other.

Convex hulls are parted along n by h(n) = max over a of n.x - min over b of n.y, whose least value over unit vectors is
the least translation, exactly, where both bodies are convex. It is sought from many directions and along its
subgradient, the difference of the points that carry it. Of others shorter ways may exist, out of a hole or over a step:
along each of many directions lengths are looked for at which the proof says CLEAR, the shortest of all first.
Balls inside of both bodies tell which are too short without a look.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from itertools import product

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.hull_depths import HullDepths
from assembly.proximity.clearance.inscribed import overlaps_at
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import FLAT, LINKS, NODE

__all__ = ["least_translation"]

Array = NDArray[np.float64]
# Normals of flat faces that are tried of each body, and directions of edges between such faces.
NORMALS, EDGES = 12, 12
# Sine of an angle below which two of these have no direction across.
PARALLEL = 1e-6
# A translation is this part longer than found to part, and looks for it stop at this part of it.
FARTHER, CLOSE = 1e-6, 1e-3
# Other directions are of use where they are shorter by this factor.
SHORTER = 0.95
# The first length along a direction, in parts of the longest, and how much longer the next one is.
FIRST, NEXT = 1e-3, 1.3
# Looks along other directions than that of the hulls, and pairs of nodes of each: what is clear by a usual margin takes
# a few hundred.
LOOKS, BUDGET = 200, 1000


def _directions(a: BodyCells, b: BodyCells, turn: Array) -> tuple[Array, Array]:
    """Directions (n, 3) that are tried, seen from a: of a grid, of both boxes, of flat faces; and across edges of both.

    Polytopes are parted along a normal of one of them, or across an edge of each.
    """
    grid = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    found, edges = [grid], []
    for cells, rotation in ((a, np.eye(3)), (b, turn)):
        links, nodes = rows_of(LINKS, cells.links), rows_of(NODE, cells.nodes)
        flat = nodes.ruling[cells.first][links.form[cells.first] == FLAT]
        # Of opposite faces one is enough: both ways are tried.
        largest = np.take_along_axis(flat, np.abs(flat).argmax(axis=1)[:, None], axis=1)
        distinct = np.unique(np.round(flat * np.sign(largest), 6), axis=0)[:NORMALS]
        for ways in (nodes.axes[0], distinct):
            found += [ways @ rotation.T, -ways @ rotation.T]
        edges.append(_across(distinct, distinct)[:EDGES] @ rotation.T)
    across = _across(*edges)
    ways = np.concatenate(found)
    length = np.linalg.norm(ways, axis=1)
    return ways[length > 0.0] / length[length > 0.0, None], np.concatenate([across, -across])


def _across(one: Array, other: Array) -> Array:
    """Distinct unit vectors (n, 3) across each of two sets of them, of opposite ones one."""
    ways = np.cross(one[:, None], other[None]).reshape(-1, 3)
    length = np.linalg.norm(ways, axis=1)
    ways = ways[length > PARALLEL] / length[length > PARALLEL, None]
    largest = np.take_along_axis(ways, np.abs(ways).argmax(axis=1)[:, None], axis=1)
    distinct = np.unique(np.round(ways * np.sign(largest), 6), axis=0)
    return np.asarray(distinct / np.linalg.norm(distinct, axis=1)[:, None])


class _Translated:
    """Pair k of a proof at poses (n, 7), its second body translated."""

    def __init__(self, proof: ClearanceProof, k: int, q: Array) -> None:
        self._proof, self._k, self._q = proof, k, q
        a, b = proof.pairs[k]
        self.overlaps = overlaps_at((proof.faces[a], proof.faces[b]), (q[a], q[b]))
        self.looks = 0

    def is_clear(self, way: Array, budget: int | None = BUDGET) -> bool:
        """Whether the pair is found clear where its second body is translated so.

        Where the two cross, no translation by less than the depth undoes it, so the ball about this one is kept.
        """
        moved = self._q.copy()
        moved[self._proof.pairs[self._k][1], :3] += way
        self.looks += 1
        (answer,) = self._proof.look(moved, 0.0, which=[self._k], budget=budget)
        if answer.verdict is Verdict.CROSSING:
            self.overlaps.add(way, answer.depth)
        return answer.verdict is Verdict.CLEAR

    def shortened(self, n: Array, low: float, high: float) -> float:
        """The least length along a direction that is found clear between one that is not and one that is."""
        while high - low > CLOSE * high:
            low = self.overlaps.beyond(n, low)
            middle = 0.5 * (low + high)
            if middle >= high:
                break
            low, high = (low, middle) if self.is_clear(middle * n) else (middle, high)
        return high

    def shortest(self, ways: Array, most: float) -> Array | None:
        """The shortest translation found along directions (n, 3) that is shorter than `most`; None if none is.

        The shortest of the next lengths of all directions is looked at first: the first that is clear is the answer.
        """
        lengths = [self.overlaps.beyond(n, FIRST * most) for n in ways]
        queue = [(length, k, 0.0) for k, length in enumerate(lengths) if length < most]
        heapify(queue)
        until = self.looks + LOOKS
        while queue and self.looks < until:
            length, k, before = heappop(queue)
            free = self.overlaps.beyond(ways[k], length)
            if free == length and self.is_clear(length * ways[k]):
                return np.asarray(self.shortened(ways[k], before, length) * ways[k])
            following = free if free > length else self.overlaps.beyond(ways[k], NEXT * length)
            if following < most:
                heappush(queue, (following, k, length))
        return None


def least_translation(proof: ClearanceProof, k: int, q: Array) -> Array | None:
    """The least translation (3,) of the second body of pair k, in the world, that is found to part it from the first.

    None where none is. An upper bound; exact to 1e-3 of it where both bodies are convex and flat.
    """
    a, b = proof.pairs[k]
    world, turn_b = rotation_matrix(q[a, 3:]), rotation_matrix(q[b, 3:])
    turn, shift = world.T @ turn_b, (q[b, :3] - q[a, :3]) @ world
    first, second = proof.cells_of_both(k)
    ways, across = _directions(first, second, turn)
    way = world @ HullDepths(first, second, turn, shift).least(np.concatenate([ways, across]))
    most = float(np.linalg.norm(way)) * (1.0 + FARTHER) + FARTHER * max(first.size, second.size)
    n = way / np.linalg.norm(way)
    translated = _Translated(proof, k, q)
    # How deep they are in each other tells which ways are too short.
    translated.is_clear(np.zeros(3))
    if not translated.is_clear(most * n, None):
        return None
    # First cells of what is round are thicker than it: the way along hulls is shortened by any part.
    most = translated.shortened(n, translated.overlaps.beyond(n, 0.0), most) * (1.0 + FARTHER)
    shorter = translated.shortest(np.concatenate([n[None], ways @ world.T]), SHORTER * most)
    return np.asarray(most * n if shorter is None else (1.0 + FARTHER) * shorter)
