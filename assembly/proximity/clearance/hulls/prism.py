"""The hole of a flat face whose boundary is convex, of straight sides and arcs, and what is before and behind it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.hulls.discs import Discs

__all__ = ["NO_ARCS", "Arcs", "Prism"]

Array = NDArray[np.float64]
# Directions across an arc along which there are half spaces.
TANGENTS = 5


class Arcs(NamedTuple):
    """Arcs of a convex boundary: of each a point is within if it is so along all normals of the arc.

    Attributes
    ----------
    centers, middles : (n, 3)
        `middles` are unit vectors from the center to the middle of each arc.
    radii, halves : (n,)
        How far each arc goes from its middle either way [rad].
    """

    centers: Array
    middles: Array
    radii: Array
    halves: Array


NO_ARCS = Arcs(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty(0))


class Prism(NamedTuple):
    """What is within a convex boundary of straight sides and arcs, and before and behind it.

    Attributes
    ----------
    axis : (3,)
        Across the boundary.
    inward, borders : (n, 3), (n,)
        Of each straight side, a unit vector from it into the prism, and its height along that.
    arcs : Arcs
    is_one_sided : bool
        Whether a half line along the axis stays in it, and none against that.
    """

    axis: Array
    inward: Array
    borders: Array
    arcs: Arcs = NO_ARCS
    is_one_sided: bool = False
    is_wall: bool = True

    def depths(self, discs: Discs) -> Array:
        """How far discs (m,) are from each side and arc, at least: (n, m); below zero where they may be beyond it."""
        straight = -discs.reach(-self.inward).T - self.borders[:, None]
        off = discs.centers - self.arcs.centers[:, None]
        off = off - (off @ self.axis)[..., None] * self.axis
        along = (off * self.arcs.middles[:, None]).sum(axis=2)
        across = np.linalg.norm(off - along[..., None] * self.arcs.middles[:, None], axis=2)
        # The normal that leads farthest is the one toward the center of the disc, or next to that.
        beyond = np.maximum(np.arctan2(across, along) - self.arcs.halves[:, None], 0.0)
        # Leaning discs are within those across the axis.
        round_ = self.arcs.radii[:, None] - np.hypot(along, across) * np.cos(beyond) - discs.radii
        return np.asarray(np.concatenate([straight, round_]))

    def depth(self, discs: Discs) -> Array:
        """How far discs (m,) are within, at least; below zero where they may not be."""
        return np.asarray(self.depths(discs).min(axis=0))

    def depth_of(self, points: Array) -> Array:
        """How far points (m, 3) are within."""
        return self.depth(Discs.of_points(points))

    def planes(self, near: Array) -> tuple[Array, Array]:
        """Some half spaces that it is in: unit vectors inward, and the heights of their borders.

        Of an arc one is where it is nearest to a point (3,).
        """
        off = near - self.arcs.centers
        off = off - (off @ self.axis)[:, None] * self.axis
        sideways = np.cross(self.axis, self.arcs.middles)
        toward = np.arctan2((off * sideways).sum(axis=1), (off * self.arcs.middles).sum(axis=1))
        nearest = np.clip(toward, -self.arcs.halves, self.arcs.halves)
        angles = np.concatenate(
            [nearest[:, None], self.arcs.halves[:, None] * np.linspace(-1.0, 1.0, TANGENTS)], axis=1
        )
        ways = np.cos(angles)[..., None] * self.arcs.middles[:, None] + np.sin(angles)[..., None] * sideways[:, None]
        heights = (ways * self.arcs.centers[:, None]).sum(axis=2) + self.arcs.radii[:, None]
        inward = np.concatenate([self.inward, -ways.reshape(-1, 3)])
        return inward, np.concatenate([self.borders, -heights.ravel()])

    def posed(self, turn: Array, shift: Array) -> Prism:
        """The same after x -> turn x + shift."""
        inward, arcs = self.inward @ turn.T, self.arcs
        moved = arcs._replace(centers=arcs.centers @ turn.T + shift, middles=arcs.middles @ turn.T)
        borders = self.borders + inward @ shift
        return self._replace(axis=turn @ self.axis, inward=inward, borders=borders, arcs=moved)

    def scaled(self, left: float, shift: Array) -> Prism:
        """The same after x -> left x + shift."""
        arcs = self.arcs._replace(centers=left * self.arcs.centers + shift, radii=left * self.arcs.radii)
        return self._replace(borders=left * self.borders + self.inward @ shift, arcs=arcs)
