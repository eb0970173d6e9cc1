"""Boxes around groups of cells, all groups at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Boxes", "Groups", "boxes_around"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
ROUNDED_UP = 1.0 + 1e-14
# A box along the principal axes is taken where it has this part less of a volume than one along the body's.
SMALLER = 1.02


class Groups(NamedTuple):
    """Members of groups, one group after another: `members[starts[k]:starts[k + 1]]` are those of group k."""

    members: Table
    starts: Table

    @classmethod
    def of(cls, groups: list[Table]) -> Groups:
        """Of the members of each group, none of which is empty."""
        ends = np.cumsum([len(group) for group in groups])
        return cls(np.concatenate(groups), np.append(0, ends[:-1]))

    @property
    def owner(self) -> Table:
        """The number of the group that each member is listed for."""
        return np.repeat(np.arange(len(self.starts)), np.diff(np.append(self.starts, len(self.members))))


class Boxes(NamedTuple):
    """Centers (n, 3), axes as rows (n, 3, 3) and half widths (n, 3) of boxes; radii (n,) of balls about the centers."""

    center: Array
    axes: Array
    half: Array
    radius: Array


def boxes_around(corners: Array, rho: Array, disc: Array, rulings: Array, groups: Groups) -> Boxes:
    """Boxes around groups of cells: along principal axes of their corners, or along those of the body.

    Parameters
    ----------
    corners : (m, 4, 3)
        Of all cells.
    rho, disc : (m,)
        How far a cell may be from the hull of its corners: in any direction, and beside that across its ruling.
    rulings : (m, 3)
        Unit vectors; of cells without a disc they may be zero.
    groups : Groups
        Numbers of cells.
    """
    owner, starts = groups.owner, groups.starts
    points, around = corners[groups.members], (rho + disc)[groups.members]
    cells = points, rho[groups.members], disc[groups.members], rulings[groups.members]
    count = np.bincount(owner)
    middle = np.add.reduceat(points.mean(axis=1), starts) / count[:, None]
    off = points - middle[owner, None]
    scatter = np.add.reduceat(np.matmul(off.swapaxes(1, 2), off), starts)
    principal = np.linalg.eigh(scatter)[1].swapaxes(1, 2)[:, ::-1].copy()
    principal[np.linalg.det(principal) < 0.0, 2] *= -1.0
    own = _extents(cells, groups, principal)
    straight = _extents(cells, groups, np.broadcast_to(np.eye(3), principal.shape))
    volumes = [(half + 0.05 * half.max(axis=1, keepdims=True)).prod(axis=1) for _, half in (own, straight)]
    along = (volumes[1] < SMALLER * volumes[0])[:, None]
    center, half = (np.where(along, b, a) for a, b in zip(own, straight, strict=True))
    axes = np.where(along[..., None], np.eye(3), principal)
    far = np.sqrt(((points - center[owner, None]) ** 2).sum(axis=2)).max(axis=1) + around
    radius = np.minimum(np.maximum.reduceat(far, starts), np.linalg.norm(half, axis=1))
    return Boxes(center, axes, half * ROUNDED_UP, radius * ROUNDED_UP)


def _extents(cells: tuple[Array, Array, Array, Array], groups: Groups, axes: Array) -> tuple[Array, Array]:
    """Centers and half widths of boxes along axes around cells: corners, rho, discs and their rulings."""
    points, rho, disc, rulings = cells
    own = axes[groups.owner]
    heights = np.matmul(points, own.swapaxes(1, 2))
    # The part of an axis across a ruling by a cross product: a flat face is exactly flat.
    thick = rho[:, None] + disc[:, None] * np.linalg.norm(np.cross(own, rulings[:, None]), axis=2)
    low = np.minimum.reduceat(heights.min(axis=1) - thick, groups.starts)
    high = np.maximum.reduceat(heights.max(axis=1) + thick, groups.starts)
    center = np.matmul(0.5 * (low + high)[:, None], axes)[:, 0]
    return center, 0.5 * (high - low)
