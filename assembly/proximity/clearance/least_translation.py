"""The least translation found that parts two bodies which cross, or of which one is within the other.

Convex hulls are parted along n by h(n) = max over a of n.x - min over b of n.y, whose least value over unit vectors is
the least translation, exactly, where both bodies are convex. It is sought from many directions and along its
subgradient, the difference of the points that carry it. Of others shorter ways may exist, out of a hole or over a step:
along each of many directions the first place is looked for at which the proof says CLEAR.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import FLAT, LINKS, NODE

__all__ = ["least_translation"]

Array = NDArray[np.float64]
# Directions of hulls that are followed downhill, steps of each, and how much a step is cut where it leads up.
FOLLOWED, STEPS, CUT = 8, 60, 0.5
# The first step, and directions around the subgradient that are tried.
WIDEST, AROUND = 0.3, np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
# Normals of flat faces that are tried of each body, and directions of edges between such faces.
NORMALS, EDGES = 12, 12
# Sine of an angle below which two of these have no direction across.
PARALLEL = 1e-6
# A translation is this part longer than found to part, and looks for it stop at this part of it.
FARTHER, CLOSE = 1e-6, 1e-3
# Other directions are of use where they are shorter by this factor.
SHORTER = 0.95
# The first length along a direction, in parts of the longest, and looks between it and that.
FIRST, LENGTHS = 1e-3, 10


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


class _Hulls:
    """Two convex hulls, and how far they have to be moved along a direction to be parted."""

    def __init__(self, a: BodyCells, b: BodyCells, turn: Array, shift: Array) -> None:
        self.points, self.thick = [], []
        for cells, rotation, place in ((a, np.eye(3), np.zeros(3)), (b, turn, shift)):
            nodes = rows_of(NODE, cells.nodes)[cells.first]
            self.points.append(nodes.corner.reshape(-1, 3) @ rotation.T + place)
            self.thick.append(np.repeat(nodes.rho + nodes.disc, 4))

    def depths(self, ways: Array) -> Array:
        """h of unit vectors (n, 3)."""
        one, other = (points @ ways.T for points in self.points)
        found = (one + self.thick[0][:, None]).max(axis=0) - (other - self.thick[1][:, None]).min(axis=0)
        return np.asarray(found)

    def slope(self, n: Array) -> Array:
        """The subgradient of h."""
        i = int((self.points[0] @ n + self.thick[0]).argmax())
        j = int((self.points[1] @ n - self.thick[1]).argmin())
        return np.asarray(self.points[0][i] - self.points[1][j])

    def _lower(self, n: Array, step: float) -> tuple[float, Array]:
        """The lowest of several directions a step from one: along the subgradient, and around, for it has creases."""
        down = self.slope(n)
        down = down - (down @ n) * n
        if not down.any():
            down = np.eye(3)[np.abs(n).argmin()]
            down = down - (down @ n) * n
        down /= np.linalg.norm(down)
        tried = n - step * (np.cos(AROUND)[:, None] * down + np.sin(AROUND)[:, None] * np.cross(n, down))
        tried /= np.linalg.norm(tried, axis=1)[:, None]
        found = self.depths(tried)
        return float(found.min()), tried[found.argmin()]

    def least(self, ways: Array) -> Array:
        """The direction times the depth of the least one that is found."""
        depths = self.depths(ways)
        best, n = float(depths.min()), ways[depths.argmin()]
        for k in np.argsort(depths)[:FOLLOWED]:
            at, depth, step = ways[k], float(depths[k]), WIDEST
            for _ in range(STEPS):
                found, other = self._lower(at, step)
                if found < depth:
                    at, depth = other, found
                else:
                    step *= CUT
            if depth < best:
                best, n = depth, at
        return np.asarray(best * n)


class _Translated:
    """Pair k of a proof at poses (n, 7), its second body translated.

    Where the two cross, no translation by less than the depth undoes it: what is that near to a translation at which
    they do crosses as well, and is not looked at.
    """

    def __init__(self, proof: ClearanceProof, k: int, q: Array) -> None:
        self._proof, self._k, self._q = proof, k, q
        self._crossing, self._depths = np.empty((0, 3)), np.empty(0)

    def is_clear(self, way: Array) -> bool:
        """Whether the pair is found clear where its second body is translated so."""
        if (np.linalg.norm(self._crossing - way, axis=1) < self._depths).any():
            return False
        moved = self._q.copy()
        moved[self._proof.pairs[self._k][1], :3] += way
        (answer,) = self._proof.look(moved, 0.0, which=[self._k])
        if answer.verdict is Verdict.CROSSING:
            self._crossing = np.append(self._crossing, way[None], axis=0)
            self._depths = np.append(self._depths, answer.depth)
        return answer.verdict is Verdict.CLEAR

    def first_clear(self, n: Array, most: float) -> float:
        """The least length along a direction, no more than the most, at which it is clear; inf if none is found."""
        low = 0.0
        for length in most * np.geomspace(FIRST, 1.0, LENGTHS):
            if self.is_clear(length * n):
                high = float(length)
                while high - low > CLOSE * high:
                    middle = 0.5 * (low + high)
                    low, high = (low, middle) if self.is_clear(middle * n) else (middle, high)
                return high
            low = float(length)
        return np.inf


def least_translation(proof: ClearanceProof, k: int, q: Array) -> Array | None:
    """The least translation (3,) of the second body of pair k, in the world, that is found to part it from the first.

    None where none is. An upper bound; exact to 1e-3 of it where both bodies are convex and flat.
    """
    a, b = proof.pairs[k]
    world, turn_b = rotation_matrix(q[a, 3:]), rotation_matrix(q[b, 3:])
    turn, shift = world.T @ turn_b, (q[b, :3] - q[a, :3]) @ world
    first, second = proof.cells_of_both(k)
    ways, across = _directions(first, second, turn)
    way = world @ _Hulls(first, second, turn, shift).least(np.concatenate([ways, across]))
    most = float(np.linalg.norm(way)) * (1.0 + FARTHER) + FARTHER * max(first.size, second.size)
    best = way / np.linalg.norm(way) * most
    translated = _Translated(proof, k, q)
    # How deep they are in each other tells which ways are too short.
    translated.is_clear(np.zeros(3))
    if not translated.is_clear(best):
        return None
    for k_way, n in enumerate([best / most, *(ways @ world.T)]):
        # First cells of what is round are thicker than it: the way along hulls is shortened by any part.
        shorter = (1.0 if k_way == 0 else SHORTER) * float(np.linalg.norm(best))
        found = translated.first_clear(n, shorter)
        if found < shorter:
            best = found * (1.0 + FARTHER) * n
    return np.asarray(best)
