"""Nodes of a forest from outside: which there are, and which points are within what they stand for."""

from __future__ import annotations

import numpy as np

from assembly._record import rows_of
from assembly.proximity.clearance.forest import PackedForest
from assembly.proximity.clearance.halve import halve_cell
from assembly.proximity.clearance.records import LINKS, NODE, NONE


def tree_of(forest):
    """Links and nodes of a forest, the rows that are used."""
    used = int(forest.arrays[5][0])
    return rows_of(LINKS, forest.arrays[3][:used]), rows_of(NODE, forest.arrays[4][:used])


def leaves(forest):
    """Rows of the cells that have no children."""
    links, _ = tree_of(forest)
    return np.flatnonzero((links.face != NONE) & (links.child == NONE))


def halve_all(forest, rng, share=1.0, by_length=None):
    """Halve a random share of the cells without children, by length or by chord error, or by either."""
    for k in leaves(forest):
        if rng.random() < share:
            while not halve_cell(*forest.arrays, int(k), bool(rng.random() < 0.5) if by_length is None else by_length):
                assert forest.grow()


def forest_of(*shapes):
    return PackedForest(list(shapes))


def top(node, is_cell, n):
    """The most that n.x is over a node, for directions (m, 3)."""
    if is_cell:
        high = (n @ node.corner.T).max(axis=1)
    else:
        high = n @ node.center + np.abs(n @ node.axes.T) @ node.half
    along = n @ node.ruling
    across = np.linalg.norm(n - along[:, None] * node.ruling, axis=1)
    if not is_cell and node.less.any():
        # Two discs.
        h = node.half[0] * (n @ node.axes[0])
        high = n @ node.center + np.maximum(h - node.less[0] * across, -h - node.less[1] * across)
    return high + node.disc * across + node.rho


def nearest_on_segments(p, a, b):
    way = b - a
    square = (way * way).sum(axis=-1)
    part = ((p - a) * way).sum(axis=-1) / np.where(square > 0.0, square, 1.0)
    return a + np.clip(part, 0.0, 1.0)[..., None] * way


def nearest_on_triangles(p, a, b, c):
    """The nearest points of triangles, all arrays that broadcast to (..., 3)."""
    p, a, b, c = np.broadcast_arrays(p, a, b, c)
    found = nearest_on_segments(p, a, b)
    for start, end in ((b, c), (c, a)):
        other = nearest_on_segments(p, start, end)
        nearer = np.linalg.norm(other - p, axis=-1) < np.linalg.norm(found - p, axis=-1)
        found = np.where(nearer[..., None], other, found)
    n = np.cross(b - a, c - a)
    square = (n * n).sum(axis=-1)
    foot = p - ((p - a) * n).sum(axis=-1)[..., None] / np.where(square > 0.0, square, 1.0)[..., None] * n
    within = square > 0.0
    for start, end in ((a, b), (b, c), (c, a)):
        within &= (np.cross(end - start, foot - start) * n).sum(axis=-1) >= 0.0
    return np.where(within[..., None], foot, found)


def outside(forest, rows, points):
    """How far each point is, at most, outside of the cell that it is least outside of, by heights; inf: of all balls.

    Directions are that from the nearest point of the corners' triangles, and its parts along and across the ruling.
    """
    _, nodes = tree_of(forest)
    cells = nodes[rows]
    far = np.abs(points).max()
    off = points[:, None] - cells.center
    which, of = np.nonzero((off * off).sum(axis=-1) <= (cells.radius * (1.0 + 1e-12) + 1e-14 * far) ** 2)
    p, c, ruling = points[which], cells.corner[of], cells.ruling[of]
    x = nearest_on_triangles(p, c[:, 0], c[:, 1], c[:, 2])
    y = nearest_on_triangles(p, c[:, 0], c[:, 2], c[:, 3])
    nearer = np.linalg.norm(y - p, axis=-1) < np.linalg.norm(x - p, axis=-1)
    off = p - np.where(nearer[:, None], y, x)
    along = (off * ruling).sum(axis=-1)[:, None] * ruling
    most = np.zeros(len(p))
    for way in (off, along, off - along):
        length = np.linalg.norm(way, axis=-1)
        n = way / np.where(length > 0.0, length, 1.0)[:, None]
        high = np.einsum("mi,mji->mj", n, c).max(axis=-1)
        flat = n - (n * ruling).sum(axis=-1)[:, None] * ruling
        high += cells.disc[of] * np.linalg.norm(flat, axis=-1) + cells.rho[of]
        most = np.maximum(most, np.where(length > 0.0, (n * p).sum(axis=-1) - high, 0.0))
    best = np.full(len(points), np.inf)
    np.minimum.at(best, which, most)
    return best
