"""How far convex hulls of two bodies are to be moved along a direction until they are parted, and the least way.

The depth along a unit vector n is h(n) = max over a of n.x - min over b of n.y, where a and b are given by pieces: the
hull of some points, and a disc of radius r across an axis u, and a ball of radius s, whose largest n.x is

    max over points of n.p + r sqrt(1 - (n.u)^2) + s.

Cylinders, cones, balls and tubes from outside are such pieces, exactly. Walls of bores need none: they are within the
hull of their rims, at which other faces end.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.records import FLAT, LINKS, NODE, NONE

__all__ = ["HullDepths", "highest_nodes"]

Array = NDArray[np.float64]
# Directions that are followed downhill, the most steps of each, and how much a step is cut where it leads up.
FOLLOWED, STEPS, CUT = 4, 60, 0.4
# The first step, the last one, and directions around the subgradient that are tried: h has creases, and grows with the
# square of a step across a smooth minimum, so that 1e-5 leaves 1e-10 of it.
WIDEST, NARROWEST, AROUND = 0.3, 1e-5, np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)


class _Pieces(NamedTuple):
    """Points (n, 3), each with an axis (n, 3), the radius (n,) of a disc across it, and the radius (n,) of a ball."""

    points: Array
    axes: Array
    disc: Array
    ball: Array

    def moved(self, turn: Array, shift: Array) -> _Pieces:
        """The same pieces at a pose."""
        return self._replace(points=self.points @ turn.T + shift, axes=self.axes @ turn.T)

    def highest(self, ways: Array) -> Array:
        """The largest n.x (n, ways) of every piece."""
        across = np.sqrt(np.maximum(1.0 - (self.axes @ ways.T) ** 2, 0.0))
        return np.asarray(self.points @ ways.T + self.disc[:, None] * across + self.ball[:, None])

    def farthest(self, n: Array) -> Array:
        """The place (3,) at which n.x is largest."""
        k = int(self.highest(n[None]).argmax())
        across = n - (n @ self.axes[k]) * self.axes[k]
        size = np.linalg.norm(across)
        rim = self.disc[k] / size * across if size > 0.0 else 0.0
        return np.asarray(self.points[k] + rim + self.ball[k] * n)


def highest_nodes(cells: BodyCells) -> tuple[list[int], list[int]]:
    """The rows of nodes that are exact hulls of whole round faces, and of the first cells of all other faces."""
    links, nodes = rows_of(LINKS, cells.links), rows_of(NODE, cells.nodes)
    whole, single, queue = [], [], [0]
    while queue:
        k = queue.pop()
        if links.face[k] != NONE:
            single.append(k)
        elif nodes.disc[k] + nodes.rho[k] > 0.0:
            whole.append(k)
        else:
            queue += [int(links.child[k]), int(links.child[k]) + 1]
    return whole, single


@lru_cache(maxsize=128)
def _pieces_of(cells: BodyCells) -> _Pieces:
    """What a body's hull is the hull of: whole round faces, and cells of others."""
    links, nodes = rows_of(LINKS, cells.links), rows_of(NODE, cells.nodes)
    whole, single = highest_nodes(cells)
    single = [k for k in single if links.form[k] == FLAT or nodes.bore[k] == 0.0]
    half = nodes.half[whole, :1] * nodes.ruling[whole]
    points = [nodes.center[whole] - half, nodes.center[whole] + half, nodes.corner[single].reshape(-1, 3)]
    count = np.array([1] * (2 * len(whole)) + [4] * len(single))
    row = np.repeat(np.array(2 * whole + single), count)
    # A cone is narrower at one of its ends.
    less = np.concatenate([nodes.less[whole, 1], nodes.less[whole, 0], np.zeros(len(row) - 2 * len(whole))])
    table = np.column_stack([np.concatenate(points), nodes.ruling[row], nodes.disc[row] - less, nodes.rho[row]])
    # Cells share corners.
    table = np.unique(table, axis=0)
    return _Pieces(np.ascontiguousarray(table[:, :3]), np.ascontiguousarray(table[:, 3:6]), table[:, 6], table[:, 7])


class HullDepths:
    """The hulls of bodies a and b, the second at a pose seen from the first."""

    def __init__(self, a: BodyCells, b: BodyCells, turn: Array, shift: Array) -> None:
        self._first, self._second = _pieces_of(a), _pieces_of(b).moved(turn, shift)

    def depths(self, ways: Array) -> Array:
        """h of unit vectors (n, 3)."""
        return np.asarray(self._first.highest(ways).max(axis=0) + self._second.highest(-ways).max(axis=0))

    def slope(self, n: Array) -> Array:
        """The subgradient of h."""
        return self._first.farthest(n) - self._second.farthest(-n)

    def _lower(self, n: Array, step: float) -> tuple[float, Array]:
        """The lowest of several directions a step from one: along the subgradient, and around, for it has creases."""
        down = self.slope(n)
        down = down - (down @ n) * n
        size = float(np.linalg.norm(down))
        if size == 0.0:
            down = np.eye(3)[np.abs(n).argmin()]
            down = down - (down @ n) * n
            size = float(np.linalg.norm(down))
        down /= size
        tried = n - step * (np.cos(AROUND)[:, None] * down + np.sin(AROUND)[:, None] * np.cross(n, down))
        tried /= np.sqrt((tried**2).sum(axis=1))[:, None]
        found = self.depths(tried)
        return float(found.min()), tried[found.argmin()]

    def least(self, ways: Array) -> Array:
        """The direction times the depth of the least one that is found from unit vectors (n, 3)."""
        depths = self.depths(ways)
        best, n = float(depths.min()), ways[depths.argmin()]
        for k in np.argsort(depths, kind="stable")[:FOLLOWED]:
            at, depth, step = ways[k], float(depths[k]), WIDEST
            for _ in range(STEPS):
                if step < NARROWEST:
                    break
                found, other = self._lower(at, step)
                if found < depth:
                    at, depth = other, found
                else:
                    step *= CUT
            if depth < best:
                best, n = depth, at
        return np.asarray(best * n)
