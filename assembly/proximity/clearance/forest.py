"""Trees of cells of several bodies in one growing block of memory, and the fronts of their pairs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly._columns import Columns
from assembly._record import place_of, rows_of
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.evaluate import CURVE, SURFACE
from assembly.proximity.clearance.body_cells import BodyCells, cells_of_body
from assembly.proximity.clearance.records import (
    CELL_FACE,
    COUNTS,
    COUNTS_SIZE,
    LINKS,
    LINKS_SIZE,
    NODE,
    NODE_SIZE,
    NODES,
    NODES_SIZE,
    NONE,
    PAIR,
    PAIR_SIZE,
    PARTED_SIZE,
)

__all__ = ["Fronts", "PackedForest"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Rows that there is room for at first, beside those of the first cells, and at most; so many more are large.
SPARE, MOST, LARGE = 1024, 1 << 20, 40_000
ROOM = 512
WORK = (3, 64)
# Points of each connected part of a boundary.
POINTS = 12
# Where records of surfaces and of curves have places in the pool.
_OF_SURFACE = [place_of(SURFACE, name) for name in ("breaks_u", "breaks_v", "coefficients", "cells")]
_OF_CURVE = [place_of(CURVE, name) for name in ("breaks", "coefficients")]
# Of the corners of a box.
_SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


class PackedForest:
    """The trees of several bodies.

    Parameters
    ----------
    shapes : sequence of tuple of Face
        Of every body its faces; equal ones share a tree.

    Attributes
    ----------
    arrays : tuple
        As kernels take them (`Forest`); another tuple where there was no more room in them.
    roots : list of int
        The row of every body's root.
    cells : list of BodyCells
        Of every body what was made once for its faces.
    """

    def __init__(self, shapes: Sequence[tuple[Face, ...]]) -> None:
        distinct = list(dict.fromkeys(shapes))
        self.made = [cells_of_body(faces) for faces in distinct]
        table, pool, faces, links, nodes = [], [], [], [], []
        at = used = face_at = row_at = 0
        first: dict[tuple[Face, ...], int] = {}
        for shape, cells in zip(distinct, self.made, strict=True):
            records = cells.faces.copy()
            rows = rows_of(CELL_FACE, records)
            rows.surface += at
            moved = _moved(cells, used, rows.surface - at)
            link = cells.links.copy()
            view = rows_of(LINKS, link)
            for field, by in (("child", row_at), ("face", face_at), ("rim", at)):
                column = view[field]
                column[column != NONE] += by
            first[shape] = row_at
            table.append(moved)
            pool.append(cells.pool)
            faces.append(records)
            links.append(link)
            nodes.append(cells.nodes)
            at, used = at + len(moved), used + len(cells.pool)
            face_at, row_at = face_at + len(records), row_at + len(link)
        self._fixed = np.concatenate(table), np.concatenate(pool), np.concatenate(faces)
        self._links = np.zeros((row_at + SPARE, LINKS_SIZE), dtype=np.int64)
        self._nodes = np.zeros((row_at + SPARE, NODE_SIZE))
        self._links[:row_at], self._nodes[:row_at] = np.concatenate(links), np.concatenate(nodes)
        self._used, self._first = np.array([row_at]), row_at
        self.arrays: tuple[NDArray[np.generic], ...] = (*self._fixed, self._links, self._nodes, self._used)
        self._shells: dict[int, list[Array]] = {}
        self.roots = [first[shape] for shape in shapes]
        self.cells = [self.made[distinct.index(shape)] for shape in shapes]

    @property
    def is_large(self) -> bool:
        """Whether so many cells were made on the way that it is better to begin anew."""
        return bool(self._used[0] > self._first + LARGE)

    def forget(self, fronts: Fronts) -> None:
        """Forget the cells that no front has, and that are above none it has, beside the first ones."""
        used, first = int(self._used[0]), self._first
        links = rows_of(LINKS, self._links[:used])
        child = links.child
        parent = np.full(used, NONE)
        above = np.flatnonzero(child != NONE)
        parent[child[above]] = parent[child[above] + 1] = above
        wanted = np.zeros(used, dtype=bool)
        at = np.unique(fronts.cells())
        while len(at):
            wanted[at] = True
            at = parent[at]
            at = np.unique(at[(at != NONE)])
            at = at[~wanted[at]]
        # Children come in pairs.
        begins = child[above[child[above] >= first]]
        begins = np.sort(begins[wanted[begins] | wanted[begins + 1]])
        kept = np.concatenate([np.arange(first), np.stack([begins, begins + 1], axis=1).ravel()])
        place = np.full(used + 1, NONE)
        place[kept] = np.arange(len(kept))
        self._links[: len(kept)], self._nodes[: len(kept)] = self._links[kept], self._nodes[kept]
        links = rows_of(LINKS, self._links[: len(kept)])
        links.child = place[links.child]
        self._used[0] = len(kept)
        fronts.renumber(place)

    @property
    def is_full(self) -> bool:
        """Whether a cell found no room for its children."""
        return bool(self._used[0] + 2 > len(self._links))

    def grow(self) -> bool:
        """Twice the room; False where that is more than a tree may have."""
        if 2 * len(self._links) > MOST:
            return False
        self._links = np.concatenate([self._links, np.zeros_like(self._links)])
        self._nodes = np.concatenate([self._nodes, np.zeros_like(self._nodes)])
        self.arrays = (*self._fixed, self._links, self._nodes, self._used)
        return True

    def room_in_bores(self, walls: Table, within: Table, turn: Array, shift: Array) -> float:
        """How far nodes are from the walls of bores in which they are, at least: `room_in_bore` of all at once.

        Parameters
        ----------
        walls, within : (n,) of int
            Rows of nodes, in pairs.
        turn, shift : (3, 3), (3,)
            The pose of the nodes that are within, seen from the walls' body.
        """
        # Plain records: columns as attributes take longer than all the sums.
        bore, node = (self._nodes[at].view(NODE)[:, 0] for at in (walls, within))
        is_cell = self._links[within].view(LINKS)[:, 0]["face"] != NONE
        of_box = node["center"][:, None] + _SIGNS @ (node["half"][..., None] * node["axes"])
        corners = np.where(is_cell[:, None, None], np.concatenate([node["corner"]] * 2, axis=1), of_box)
        off, axis = corners @ turn.T + (shift - bore["spine"])[:, None], bore["ruling"][:, None]
        along = off @ axis.transpose(0, 2, 1)
        flat = np.sqrt(((off - along * axis) ** 2).sum(axis=2))
        slant = bore["slant"][:, None]
        if not slant.any():
            return float((bore["bore"] - flat.max(axis=1) - node["disc"] - node["rho"]).min(initial=np.inf))
        # The level of a cone, and how much of a disc's radius that grows by: see `Level.most_of_circle`.
        lean = np.linalg.norm(np.cross(bore["ruling"], node["ruling"] @ turn.T), axis=1)
        part = np.cos(np.maximum(np.arcsin(slant[:, 0]) - np.arcsin(np.minimum(lean, 1.0)), 0.0))[:, None]
        discs = node["disc"][:, None] - np.where(_SIGNS[:, 0] > 0.0, node["less"][:, :1], node["less"][:, 1:])
        most = np.sqrt(1.0 - slant**2) * flat - slant * along[..., 0] + discs * part
        return float((bore["bore"] - most.max(axis=1) - node["rho"]).min(initial=np.inf))

    def shells(self, body: int) -> list[Array]:
        """Of every connected part of a body's boundary a few points of it, (n, 3)."""
        cells = self.cells[body]
        if body not in self._shells:
            rows = [cells.first[cells.component == part] for part in np.unique(cells.component)]
            some = [at[np.linspace(0, len(at) - 1, min(len(at), POINTS)).astype(int)] for at in rows]
            corners = rows_of(NODE, cells.nodes).corner[:, 0]
            self._shells[body] = [np.ascontiguousarray(corners[at]) for at in some]
        return self._shells[body]


def _moved(cells: BodyCells, used: int, surfaces: Table) -> Table:
    """A body's table with places in the pool as they are behind others."""
    table = cells.table.copy()
    for places, fields in ((surfaces, _OF_SURFACE), (cells.curves, _OF_CURVE)):
        table[np.add.outer(places, fields)] += used
    return table


class Fronts:
    """The fronts of pairs of bodies; see `Front`.

    Parameters
    ----------
    forest : PackedForest
    pairs : sequence of (int, int)
        Numbers of bodies.
    needed : sequence of float
        Of every pair what gaps have to be larger than.
    resolution : float
        The size of pairs of cells that stay open, in parts of the larger body's size.
    budget : int
        After so many pairs of nodes in a look pairs of cells stay open.

    Attributes
    ----------
    arrays : tuple
        As kernels take them (`Front`); another tuple where there was no more room in them.
    """

    def __init__(
        self,
        forest: PackedForest,
        pairs: Sequence[tuple[int, int]],
        needed: Sequence[float],
        resolution: float = 1e-7,
        budget: int = 20_000,
    ) -> None:
        n = len(pairs)
        self._pair, self._counts = np.zeros((n, PAIR_SIZE)), np.zeros((n, COUNTS_SIZE), dtype=np.int64)
        self.pair, self.counts = Columns(PAIR, self._pair), Columns(COUNTS, self._counts)
        both = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self.counts.body_a, self.counts.body_b = both.T
        roots = np.array(forest.roots)
        self.counts.root_a, self.counts.root_b = roots[both].T
        self.counts.budget = budget
        size, far = np.array([[cells.size, cells.far] for cells in forest.cells]).T
        self.pair.needed = needed
        self.pair.resolution = resolution * size[both].max(axis=1)
        self.pair.far = far[both].sum(axis=1)
        self._room(ROOM)

    def _room(self, room: int) -> None:
        n = len(self._pair)
        # In the second half are the fronts that come back where a look that goes on does not end clear.
        both = 2 * room
        self.parted, self.nodes = np.zeros((n, both, PARTED_SIZE)), np.zeros((n, both, NODES_SIZE), dtype=np.int64)
        self._next, self._waiting = (
            (np.zeros((room, PARTED_SIZE)), np.zeros((room, NODES_SIZE), dtype=np.int64)) for _ in range(2)
        )
        self._work = np.zeros(WORK)
        self.arrays: tuple[NDArray[np.generic], ...] = (
            *(self._pair, self._counts, self.parted, self.nodes),
            *(*self._next, *self._waiting, self._work),
        )

    @property
    def left(self) -> tuple[Array, Table]:
        """Of the pair that was looked at last, and not found clear, the rows that its look left."""
        return self._next

    def _rows(self) -> list[np.recarray]:
        counts, kept, half = self.counts.count, self.counts.aside * (self.pair.underway > 0.0), self.nodes.shape[1] // 2
        rows = [rows_of(NODES, nodes[:count]) for nodes, count in zip(self.nodes, counts, strict=True)]
        return rows + [rows_of(NODES, nodes[half : half + n]) for nodes, n in zip(self.nodes, kept, strict=True) if n]

    def take_back(self, k: int) -> None:
        """Give up a look at pair k whose time was over: its front is again what it was before."""
        half, count = self.nodes.shape[1] // 2, int(self.counts.aside[k])
        for rows in (self.parted[k], self.nodes[k]):
            rows[:count] = rows[half : half + count]
        self.counts.count[k], self.pair.soonest[k] = count, self.pair.soonest_aside[k]
        self.counts.earlier[k], self.pair.underway[k] = 0, 0.0

    def cells(self) -> Table:
        """The rows of all nodes in the fronts."""
        return np.concatenate([side for rows in self._rows() for side in (rows.a, rows.b)])

    def renumber(self, place: Table) -> None:
        """Nodes have other rows by now."""
        for rows in self._rows():
            rows.a, rows.b = place[rows.a], place[rows.b]

    def grow(self) -> bool:
        """Twice the room for every front; False where that is more than one may have."""
        room = self.parted.shape[1] // 2
        if 2 * room > MOST:
            return False
        parted, nodes = self.parted, self.nodes
        self._room(2 * room)
        self.parted[:, :room], self.nodes[:, :room] = parted[:, :room], nodes[:, :room]
        for k in np.flatnonzero(self.pair.underway).tolist():
            kept = slice(2 * room, 3 * room)
            self.parted[k, kept], self.nodes[k, kept] = parted[k, room:], nodes[k, room:]
        return True
