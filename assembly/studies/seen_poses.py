"""Poses of bodies relative to those that clearances keep them apart from, and their deviation from a way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.proof import ClearanceProof

__all__ = ["SeenPoses"]

Array = NDArray[np.float64]


class SeenPoses:
    """Poses (n, 7) of a scene, as the pairs of a proof see them: the second body of each from the first."""

    def __init__(self, proof: ClearanceProof) -> None:
        self._from, self._seen = np.array(proof.pairs, dtype=np.int64).T
        seen = [proof.cells_of(k) for k in range(len(proof.pairs))]
        self._middles = np.array([cells.middle for cells in seen])
        self._radii = np.array([cells.extent for cells in seen])

    def _relative(self, q: Array) -> tuple[Array, Array]:
        """Of all pairs the turn (quaternion) of the second body and the place of its middle, seen from the first."""
        a, b = q[self._from], q[self._seen]
        back = a[:, 3:] * [1.0, -1.0, -1.0, -1.0]
        middles = b[:, :3] + _rotated(b[:, 3:], self._middles) - a[:, :3]
        return _product(back, b[:, 3:]), _rotated(back, middles)

    def bend(self, before: Array, middle: Array, after: Array) -> float:
        """How far the pose in the middle of a step is from the middle of the straight ways of the proof."""
        (e0, x0), (e2, x2) = self._relative(before), self._relative(after)
        e2 = np.where((e0 * e2).sum(axis=1, keepdims=True) < 0.0, -e2, e2)
        turn = e0 + e2
        return self._farthest((turn / np.linalg.norm(turn, axis=1, keepdims=True), 0.5 * (x0 + x2)), middle)

    def apart(self, q: Array, other: Array) -> float:
        """How far points of bodies, seen from others, are apart at two poses, at most."""
        return self._farthest(self._relative(q), other)

    def _farthest(self, seen: tuple[Array, Array], q: Array) -> float:
        turn, place = self._relative(q)
        # |e - f| is twice the sine of a quarter of the angle between them.
        chord = np.minimum(np.linalg.norm(turn - seen[0], axis=1), np.linalg.norm(turn + seen[0], axis=1))
        angle = 4.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
        return float((np.linalg.norm(place - seen[1], axis=1) + self._radii * angle).max())


def _product(a: Array, b: Array) -> Array:
    """Products (m, 4) of unit quaternions."""
    real = a[:, :1] * b[:, :1] - (a[:, 1:] * b[:, 1:]).sum(axis=1, keepdims=True)
    return np.concatenate([real, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])], axis=1)


def _rotated(e: Array, x: Array) -> Array:
    """Vectors (m, 3), turned by unit quaternions (m, 4)."""
    twice = 2.0 * np.cross(e[:, 1:], x)
    return x + e[:, :1] * twice + np.cross(e[:, 1:], twice)
