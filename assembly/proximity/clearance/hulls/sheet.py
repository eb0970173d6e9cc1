"""Flat faces for balls: how far a ball's center is from the face itself, not from the plane that it lies in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.curves import Circle
from assembly.proximity.clearance.hulls.boundary_pieces import BoundaryPieces, boundary_pieces
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.manifolds.flat_map import FlatMap

__all__ = ["FlatFace", "Sheet"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FlatFace:
    """A flat face in its own axes, with the circles that the curves of its boundary are on."""

    face: Face
    flat: FlatMap
    normal: Array
    circles: list[Circle | None]

    @cached_property
    def pieces(self) -> BoundaryPieces | None:
        """The sides and arcs of its boundary; None where others are in it. Few faces are ever asked."""
        return boundary_pieces(self.face, self.flat, self.normal, range(len(self.circles)), self.circles)

    def nearest(self, points: Array, pieces: BoundaryPieces) -> Array:
        """Of points (m, 3) the nearest ones of the face (m, 3)."""
        ways = np.stack([self.flat.along, self.flat.across])
        at = np.linalg.solve(ways @ ways.T, ways @ (points - self.flat.origin).T)
        foot = self.flat.origin + at.T @ ways
        inside = self.face.locate(*at) >= 0
        sides = pieces.ends - pieces.begins
        off = points[:, None] - pieces.begins
        part = np.clip((off * sides).sum(axis=2) / (sides**2).sum(axis=1), 0.0, 1.0)
        on_sides = pieces.begins + part[..., None] * sides
        arcs = pieces.arcs
        sideways = np.cross(self.normal, arcs.middles)
        off = points[:, None] - arcs.centers
        angles = np.arctan2((off * sideways).sum(axis=2), (off * arcs.middles).sum(axis=2))
        angles = np.clip(angles, -arcs.halves, arcs.halves)[..., None]
        on_arcs = arcs.centers + arcs.radii[:, None] * (np.cos(angles) * arcs.middles + np.sin(angles) * sideways)
        found = np.concatenate([on_sides, on_arcs], axis=1)
        best = np.linalg.norm(points[:, None] - found, axis=2).argmin(axis=1)
        return np.where(inside[:, None], foot, np.take_along_axis(found, best[:, None, None], axis=1)[:, 0])


class Sheet(NamedTuple):
    """A flat face at x -> turn x + shift, where `turn` may scale as well."""

    flat: FlatFace
    turn: Array
    shift: Array
    # No half line is known to miss it.
    axis: Array = np.zeros(3)
    is_one_sided: bool = False
    is_wall: bool = True

    @classmethod
    def of(cls, face: Face, flat: FlatMap, normal: Array, circles: list[Circle | None]) -> Sheet:
        """A face in its own axes."""
        return cls(FlatFace(face, flat, normal, circles), np.eye(3), np.zeros(3))

    def depth(self, discs: Discs) -> Array:
        """How far the centers of discs (m,) are away: of balls, which are points with a radius, their centers."""
        return self.depth_of(discs.centers)

    def depth_of(self, points: Array) -> Array:
        """How far points (m, 3) are away; what has a boundary of other curves than arcs is at all of them."""
        pieces = self.flat.pieces
        if pieces is None:
            return np.full(len(points), -np.inf)
        off = points - self._nearest(points, pieces)
        return np.asarray(np.linalg.norm(off, axis=1) - pieces.off)

    def _nearest(self, points: Array, pieces: BoundaryPieces) -> Array:
        own = np.asarray(np.linalg.solve(self.turn, (points - self.shift).T).T, dtype=np.float64)
        return np.asarray(self.flat.nearest(own, pieces) @ self.turn.T + self.shift)

    def planes(self, near: Array) -> tuple[Array, Array]:
        """The half space at whose border it is, where it is next to a point (3,); none of a point that is on it."""
        pieces = self.flat.pieces
        if pieces is None:
            return np.empty((0, 3)), np.empty(0)
        foot = self._nearest(near[None], pieces)
        inward = near - foot
        length = float(np.linalg.norm(inward))
        if not length > 0.0:
            return np.empty((0, 3)), np.empty(0)
        inward /= length
        return inward, (inward * foot).sum(axis=1) + pieces.off

    def posed(self, turn: Array, shift: Array) -> Sheet:
        """The same after x -> turn x + shift."""
        return self._replace(turn=turn @ self.turn, shift=turn @ self.shift + shift)

    def scaled(self, left: float, shift: Array) -> Sheet:
        """The same after x -> left x + shift."""
        return self._replace(turn=left * self.turn, shift=left * self.shift + shift)
