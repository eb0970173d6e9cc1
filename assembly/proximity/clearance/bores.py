"""Bores of a body, and which parts of its boundary are outside of each of them.

A bore is a line with a radius: no point of a wall on a cylinder is nearer to its axis than that, and neither is one of
a flat face whose round hole the bore ends in, for the face is what is outside of that circle. Of other parts cells tell
how near to the line they are. Of a conical bore the level about its axis (`separation.most_in_bore`) stands for the
distance from a line: over all that is outside it is no less than over the wall. A node of the tree is outside of the
least of its parts, so that a pin that is within is clear of all of them at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.boxes import Groups
from assembly.proximity.clearance.round_faces import Round

__all__ = ["Bores", "bores_of", "distances_of_parts"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Axes that are nearer to each other than this over a body, in parts of its size, are one.
SAME = 1e-9
# What rounding does to distances of points from an axis, in parts of the largest coordinate.
ROUNDING = 1e-15


@dataclass(frozen=True, eq=False)
class Bores:
    """Axes of bores, or centers of hollow balls, b rows.

    Attributes
    ----------
    center, axis : (b, 3)
        The axis is zero for a ball.
    slant : (b,)
        The sine of the angle of a cone's wall to the axis; else zero.
    least : (parts, b)
        No point of a part is nearer to the axis than this, or has a lower level; 0 where nothing is known.
    own : (parts, b) of bool
        Whether a part is a wall of the bore, or a flat face with a hole around it.
    size : float
        Of the body.
    """

    center: Array
    axis: Array
    slant: Array
    least: Array
    own: NDArray[np.bool_]
    size: float

    def nearest(self, groups: Groups, points: Array, rulings: Array | None = None) -> tuple[Table, Array]:
        """The nearest bore that nodes are outside of, or -1, and its radius.

        Parameters
        ----------
        groups : Groups
            Numbers of the parts that each node has cells of.
        points : (n, m, 3)
            The center of each node, or corners of a cell. The second nearest of these counts: a cell is of the bore of
            which it has a chord, though it may have a corner at another one.
        rulings : (n, 3), optional
            Directions of cells that cannot have another axis than these.
        """
        n = len(groups.starts)
        best, bore, radius = np.full(n, np.inf), np.full(n, -1), np.zeros(n)
        for b, (center, axis, slant) in enumerate(zip(self.center, self.axis, self.slant, strict=True)):
            least = np.minimum.reduceat(self.least[groups.members, b], groups.starts)
            usable = np.logical_or.reduceat(self.own[groups.members, b], groups.starts)
            if rulings is not None:
                # The same axis along the ruling is so far off over the body.
                least = least - 2.0 * self.size * np.linalg.norm(np.cross(axis, rulings), axis=1)
                # The wall of a cone has none, nor has that of a ball.
                usable &= (rulings.any(axis=1) == axis.any()) | (slant > 0.0)
            off = points - center
            off = off - (off @ axis)[..., None] * axis
            far = np.sort(np.linalg.norm(off, axis=2), axis=1)[:, min(1, points.shape[1] - 1)]
            score = np.where(usable & (least > 0.0), far / np.maximum(least, SAME * self.size), np.inf)
            # Of bores about one axis the conical one, as far as nodes have parts of it.
            score -= SAME * (slant > 0.0)
            better = score < best
            best[better], bore[better], radius[better] = score[better], b, least[better]
        return bore, radius


def bores_of(
    rounds: list[Round | None], holes: list[list[Round]], part: Table, cells: np.recarray, size: float
) -> Bores | None:
    """The bores of a body, or None.

    Parameters
    ----------
    rounds : list
        What each part lies on.
    holes : list of list
        The round holes of each part.
    part : (n,) of int
        Of every cell the part that it is of.
    cells : (n,) of NODE
    size : float
        Of the body.
    """
    found = [
        [*own, *([one] if one is not None and not one.outward else [])] for one, own in zip(rounds, holes, strict=True)
    ]
    distinct: list[Round] = []
    cones = [bore for own in found for bore in own if bore.slant > 0.0]
    for bore in (bore for own in found for bore in own):
        # What the mouth of a cone holds, the cone holds.
        if any(_is_mouth(bore, cone, size) for cone in cones):
            continue
        if all(_apart(bore, other, size) > SAME * size for other in distinct):
            distinct.append(bore)
    if not distinct:
        return None
    least, own = np.zeros((len(found), len(distinct))), np.zeros((len(found), len(distinct)), dtype=bool)
    for b, bore in enumerate(distinct):
        if bore.axis.any():
            least[:, b] = distances_of_parts(bore, part, cells, len(found))
        for p, bores in enumerate(found):
            for one in bores:
                off = _apart(one, bore, size)
                if off <= SAME * size:
                    own[p, b], least[p, b] = True, one.radius - off
                elif bore.slant > 0.0 and one.slant == 0.0 and one.axis.any():
                    level = _level_of_hole(one, bore, size)
                    own[p, b] |= abs(level - bore.radius) <= 4.0 * SAME * size
                    least[p, b] = max(least[p, b], level)
    return Bores(
        np.array([bore.center for bore in distinct]),
        np.array([bore.axis for bore in distinct]),
        np.array([bore.slant for bore in distinct]),
        least,
        own,
        size,
    )


def _is_mouth(hole: Round, cone: Round, size: float) -> bool:
    """Whether a hole of a flat face is where a conical bore is widest."""
    if hole.slant > 0.0 or not hole.axis.any() or float(np.linalg.norm(hole.center - cone.center)) > SAME * size:
        return False
    return abs(_level_of_hole(hole, cone, size) - cone.radius) <= 4.0 * SAME * size


def _level_of_hole(hole: Round, bore: Round, size: float) -> float:
    """What the level of a conical bore is at least over a flat face around a hole; -1 where that is elsewhere."""
    lean = float(np.linalg.norm(np.cross(hole.axis, bore.axis)))
    off = hole.center - bore.center
    along = float(off @ bore.axis)
    beside = float(np.linalg.norm(off - along * bore.axis))
    # A cylinder of some length is no hole of a flat face.
    if max(lean * size, beside, hole.half) > SAME * size:
        return -1.0
    pad = beside + hole.half + 2.0 * lean * size
    return float(np.sqrt(1.0 - bore.slant**2) * hole.radius - bore.slant * along - 2.0 * pad)


def _apart(one: Round, other: Round, size: float) -> float:
    """How far two axes, or two centers, are apart over a body."""
    if one.axis.any() != other.axis.any():
        return np.inf
    off = one.center - other.center
    if one.slant != other.slant or (one.slant > 0.0 and one.axis @ other.axis < 0.0):
        return np.inf
    if one.slant == 0.0:
        off = off - (off @ other.axis) * other.axis
    return float(np.linalg.norm(off) + 2.0 * size * np.linalg.norm(np.cross(one.axis, other.axis)))


def distances_of_parts(bore: Round, part: Table, cells: np.recarray, count: int) -> Array:
    """How far parts are from the axis of a bore, or their least level, by a plane between that and each cell."""
    off = cells.corner - bore.center
    along = off @ bore.axis
    corners = off - along[..., None] * bore.axis
    cosine = float(np.sqrt(1.0 - bore.slant**2))
    normals = cells.axes[:, 2] - (cells.axes[:, 2] @ bore.axis)[:, None] * bore.axis
    best = np.full(len(corners), -np.inf if bore.slant > 0.0 else 0.0)
    for ways in (corners.mean(axis=1), normals):
        lengths = np.linalg.norm(ways, axis=1)
        units = ways / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        heights = cosine * (corners * units[:, None]).sum(axis=2)
        lower, upper = heights - bore.slant * along, heights + bore.slant * along
        best = np.maximum(best, np.maximum(lower.min(axis=1), -upper.max(axis=1)))
    far = float(np.abs(cells.corner).max())
    least = np.full(count, np.inf)
    np.minimum.at(least, part, best - (cells.rho + cells.disc) - ROUNDING * far)
    return np.asarray(np.maximum(least, 0.0))
