"""Balls inside of closed bodies, and the translations of one body at which balls of both overlap.

Two bodies cross where a ball inside of one and a ball inside of the other overlap. Translated by t, balls about a and b
of radii r and s overlap where |a - b - t| < r + s, so a few balls tell of most translations that are too short.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.forest import PackedForest
from assembly.proximity.clearance.hull_depths import highest_nodes
from assembly.proximity.clearance.inside import winding_of
from assembly.proximity.clearance.records import NODE
from assembly.proximity.manifolds.elementary_faces import NEARLY

__all__ = ["Overlaps", "inscribed_balls", "overlaps_at"]

Array = NDArray[np.float64]
# Centers that are tried along each side of the box around a body, in parts of its half width. Few are enough: balls
# only spare looks.
PLACES = np.array([-0.8, -0.4, 0.0, 0.4, 0.8])
# How many balls a body has at most, and the least radius in parts of the largest one's.
MOST, LEAST = 24, 0.05
# Places in the stack of a ray, and what rounding may add to a radius, in parts of the body's coordinates.
STACK, ROUNDING = 1024, 1e-12
# How far a face may be from the wall of its exact hull, in parts of the body's size: by its own deviation from what it
# lies on, and by that and the slope of a cone, which the hull is larger by.
OFF = 4.0 * NEARLY
# A cylinder of less half length, in parts of its radius, is a disc.
DISC = 1e-6
# Into how many parts cells are divided to be measured.
CHUNKS = 8


def _room(centers: Array, cells: BodyCells) -> Array:
    """How far points (n, 3) are from a body's boundary, at least."""
    nodes = rows_of(NODE, cells.nodes)
    whole, single = highest_nodes(cells)
    room = np.full(len(centers), np.inf)
    for k in whole:
        # On a cylinder, a cone, a ball or a tube; that of a disc is none.
        node = nodes[k]
        off = centers - node.center
        along = off @ node.ruling
        across = np.sqrt(np.maximum((off**2).sum(axis=1) - along**2, 0.0))
        if node.rho == 0.0 and node.half[0] < DISC * node.disc:
            room = np.minimum(room, np.hypot(np.maximum(across - node.disc, 0.0), along) - node.half[0])
        elif node.rho == 0.0:
            # The line through both ends of a ruling, in the half plane of the axis and the point.
            length = 2.0 * node.half[0]
            narrower = node.less[0] * (length + 2.0 * along) + node.less[1] * (length - 2.0 * along)
            sides = np.hypot(length, node.less[0] - node.less[1])
            room = np.minimum(room, np.abs(across - node.disc + 0.5 * narrower / length) * length / sides)
        else:
            room = np.minimum(room, np.abs(np.hypot(across - node.disc, along) - node.rho))
    for some in np.array_split(np.array(single, dtype=np.int64), CHUNKS):
        part = nodes[some]
        off = centers[:, None] - part.center
        beside = np.abs(np.einsum("mij,nmj->nmi", part.axes, off)) - part.half
        far = np.sqrt((np.maximum(beside, 0.0) ** 2).sum(axis=2))
        room = np.minimum(room, far.min(axis=1, initial=np.inf))
    return room


@lru_cache(maxsize=128)
def inscribed_balls(faces: tuple[Face, ...]) -> tuple[Array, Array]:
    """Centers (n, 3) and radii (n,) of balls inside of a body, in its coordinates; none of an open one.

    Radii are lower bounds of the distance to the boundary, by closed forms of round faces, and boxes around
    the first cells of others.
    """
    forest = PackedForest((faces,))
    (cells,) = forest.made
    if not cells.is_closed:
        return np.empty((0, 3)), np.empty(0)
    root = rows_of(NODE, cells.nodes)[0]
    spread = np.maximum(root.half, root.disc) + root.rho
    centers = root.center + np.array(list(product(PLACES, repeat=3))) * spread @ root.axes
    radii = _room(centers, cells) - (ROUNDING * cells.far + OFF * cells.size)
    order = np.argsort(-radii, kind="stable")
    stack, found = np.zeros(STACK, dtype=np.int64), np.empty(1, dtype=np.int64)
    kept: list[int] = []
    for k in order.tolist():
        if len(kept) == MOST or radii[k] <= (LEAST * radii[kept[0]] if kept else 0.0):
            break
        # What is well within a ball that is known adds little.
        near = np.linalg.norm(centers[kept] - centers[k], axis=1) < 0.5 * radii[kept]
        if near.any():
            continue
        winding_of(forest.arrays, forest.roots[0], centers[k : k + 1], stack, found)
        if found[0] == 1:
            kept.append(k)
    return centers[kept], radii[kept]


class Overlaps:
    """Translations at which balls of two bodies overlap.

    Parameters
    ----------
    first, second : (centers (n, 3), radii (n,))
        Balls inside of each body, in the world.
    """

    def __init__(self, first: tuple[Array, Array], second: tuple[Array, Array]) -> None:
        self._first, self._second = first, second
        self.centers = (first[0][:, None] - second[0]).reshape(-1, 3)
        self.radii = np.add.outer(first[1], second[1]).ravel()

    def add(self, center: Array, radius: float) -> None:
        """Another ball of translations at which the bodies cross."""
        self.centers = np.append(self.centers, center[None], axis=0)
        self.radii = np.append(self.radii, radius)

    def deepest(self) -> tuple[float, Array]:
        """By how much two balls overlap where nothing is translated, the most, and a point (3,) in the middle of that.

        No translation by less undoes it. Below zero where none do.
        """
        depths = self.radii - np.linalg.norm(self.centers, axis=1)
        best = int(depths.argmax())
        (a, r), (b, s) = (
            (centers[k], radii[k])
            for (centers, radii), k in zip((self._first, self._second), divmod(best, len(self._second[1])), strict=True)
        )
        # On the line from the second center through the first both balls have what is between these places.
        way, far = a - b, float(np.linalg.norm(a - b))
        n = way / far if far > 0.0 else np.zeros(3)
        low, high = max(far - r, -s), min(far + r, s)
        return float(depths[best]), b + 0.5 * (low + high) * n

    def beyond(self, n: Array, length: float) -> float:
        """The least length along a unit direction, no less than one given, that is in no ball."""
        along = self.centers @ n
        half = self.radii**2 - (self.centers**2).sum(axis=1) + along**2
        met = half > 0.0
        low, high = along[met] - np.sqrt(half[met]), along[met] + np.sqrt(half[met])
        while True:
            within = high[(low <= length) & (high > length)]
            if not len(within):
                return length
            length = float(within.max())


def overlaps_at(shapes: tuple[tuple[Face, ...], tuple[Face, ...]], poses: tuple[Array, Array]) -> Overlaps:
    """Those of two bodies at poses (7,) each."""
    posed = []
    for faces, row in zip(shapes, poses, strict=True):
        centers, radii = inscribed_balls(faces)
        posed.append((centers @ rotation_matrix(row[3:]).T + row[:3], radii))
    return Overlaps(*posed)
