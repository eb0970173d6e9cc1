"""Faces as patches: boxes in (u, v), each with two triangles, how far the surface is off them, a box and a normal cone.

Over a patch with Bezier points A_ij, weights w_ij and the bilinear interpolant B of its corners, S - B = (A - w B) / w
is no longer than the longest of the Bezier points of A - w B, each over its weight. B is off its two triangles by at
most a quarter of |P00 - P10 - P01 + P11|. The Bezier points of S lie in the box around the patch, those of the normal
in the cone (`proximity/bvh/normal_nets.py`). Every bound is rounded outward.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.bezier import elevation
from assembly.proximity.brep.edge_cells import CLEAR, OUTSIDE, box_sides
from assembly.proximity.bvh.cones import MARGIN, around_vectors
from assembly.proximity.bvh.normal_nets import Nets, bezier_product, nets_of, restricted

__all__ = ["Patches", "patches_by_angle", "patches_by_count"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Patches a face, at most, and the least extent of one against the face, where no halving makes a cone narrow.
_MOST, _FINEST = 20_000, 1e-4
# A patch is no longer than so many times its width unless it is short against its face, and one that the boundary
# enters no longer than a part of the face.
_ASPECT, _SHORT, _AT_BOUNDARY = 4.0, 0.03125, 0.125
# Patches are measured so many at a time, for the memory that their nets take.
_BATCH = 4096
# A round halves all patches whose chord error is above this part of the largest.
_ROUND = 0.5


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of one face.

    Attributes
    ----------
    piece : (n, 2) of int
        The Bezier piece: its span in u and in v.
    box : (n, 4)
        In the unit square of the piece: u from and to, v from and to.
    corners : (n, 4, 3)
        S at (low, low), (high, low), (high, high), (low, high).
    chord_error : (n,)
        No point of the patch is farther from its triangles, corners 0 1 2 and 0 2 3.
    low, high : (n, 3)
        A box around the patch.
    axis, half_angle : (n, 3), (n,)
        A cone around its outward normals.
    lengths, turns, bulges : (n, 2)
        About how long it is in u and in v, how far the normal turns, and how far it is off a straight line.
    """

    piece: Indices
    box: Array
    corners: Array
    chord_error: Array
    low: Array
    high: Array
    axis: Array
    half_angle: Array
    lengths: Array
    turns: Array
    bulges: Array

    def at(self, chosen: Indices | Mask) -> Patches:
        """Some of them."""
        return Patches(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @staticmethod
    def joined(parts: Sequence[Patches]) -> Patches:
        """Several as one."""
        return Patches(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Patches)))


class _Divided:
    """A face whose patches are halved."""

    def __init__(self, face: Face) -> None:
        self.face = face
        self.nets: Nets = nets_of(face)
        low, high = face.surface.bounding_box()
        self.size = float(np.linalg.norm(high - low))
        self.is_trimmed = face.outer is not None or bool(face.holes)
        p, q = face.surface.degree
        self._raised = elevation(p, p + 1), elevation(q, q + 1)

    def whole(self) -> Patches:
        """One patch a Bezier piece, without those outside the trim."""
        spans = np.indices(self.nets.points.shape[:2]).reshape(2, -1).T
        return self.inside(self.measured(spans, np.tile([0.0, 1.0, 0.0, 1.0], (len(spans), 1))))

    def parameters(self, patches: Patches) -> Array:
        """Boxes (n, 4) in (u, v): u from and to, v from and to."""
        rows = []
        for k, at in enumerate((self.nets.at_u, self.nets.at_v)):
            first, width = at[patches.piece[:, k]], np.diff(at)[patches.piece[:, k]]
            for side in range(2):
                x = patches.box[:, 2 * k + side]
                rows.append(np.where(x == 1.0, at[patches.piece[:, k] + 1], first + x * width))
        return np.stack(rows, axis=1)

    def sides(self, patches: Patches) -> Indices:
        """Where patches are: wholly inside the trim, outside, or neither."""
        if not self.is_trimmed:
            return np.full(len(patches.box), CLEAR)
        return box_sides(self.face, self.parameters(patches))

    def inside(self, patches: Patches) -> Patches:
        """Without those outside the trim."""
        return patches.at(self.sides(patches) != OUTSIDE) if self.is_trimmed else patches

    def measured(self, piece: Indices, box: Array) -> Patches:
        """Patches of pieces (n, 2) over boxes (n, 4)."""
        parts = [self._measured(piece[k : k + _BATCH], box[k : k + _BATCH]) for k in range(0, len(piece), _BATCH)]
        return Patches.joined(parts) if parts else self._measured(piece, box)

    def _measured(self, piece: Indices, box: Array) -> Patches:
        nets = self.nets
        at = piece[:, 0], piece[:, 1]
        points = restricted(nets.points[at], box)
        xyz = points[..., :3] / points[..., 3:]
        pad = MARGIN * nets.extent
        corners = xyz[:, [0, -1, -1, 0], [0, 0, -1, -1]]
        flat = xyz.reshape(len(xyz), -1, 3)
        normals = restricted(nets.normals[at], box)
        axis, half = around_vectors(normals.reshape(len(xyz), -1, 3), nets.slack[at], nets.poles[at])
        steps = np.linalg.norm(np.diff(xyz, axis=1), axis=3), np.linalg.norm(np.diff(xyz, axis=2), axis=3)
        return Patches(
            piece,
            box,
            corners,
            self._chord_error(points, corners) + pad,
            flat.min(axis=1) - pad,
            flat.max(axis=1) + pad,
            axis,
            half,
            np.stack([steps[0].sum(axis=1).max(axis=1), steps[1].sum(axis=2).max(axis=1)], axis=1),
            np.stack([_turn(normals), _turn(np.swapaxes(normals, 1, 2))], axis=1),
            np.stack([_bulge(xyz), _bulge(np.swapaxes(xyz, 1, 2))], axis=1),
        )

    def _chord_error(self, points: Array, corners: Array) -> Array:
        origin = corners[:, 0][:, None, None]
        square = np.stack([corners[:, [0, 3]], corners[:, [1, 2]]], axis=1) - origin
        shifted = np.concatenate([points[..., :3] - origin * points[..., 3:], points[..., 3:]], axis=3)
        in_u, in_v = self._raised
        rows = (in_u @ shifted.reshape(*shifted.shape[:2], -1)).reshape(-1, len(in_u), *shifted.shape[2:])
        raised = in_v @ rows
        off = raised[..., :3] - bezier_product(points[..., 3:], square)
        twist = corners[:, 0] - corners[:, 1] + corners[:, 2] - corners[:, 3]
        most = (np.linalg.norm(off, axis=3) / raised[..., 3]).max(axis=(1, 2))
        return np.asarray(most + 0.25 * np.linalg.norm(twist, axis=1))

    def halved(self, patches: Patches, in_v: Mask) -> Patches:
        """Both halves of every patch, but for those outside the trim."""
        low, high = patches.box.copy(), patches.box.copy()
        rows, first = np.arange(len(low)), np.where(in_v, 2, 0)
        middle = 0.5 * (low[rows, first] + low[rows, first + 1])
        low[rows, first + 1] = middle
        high[rows, first] = middle
        return self.inside(self.measured(np.concatenate([patches.piece] * 2), np.concatenate([low, high])))


def _turn(normals: Array) -> Array:
    """How far normals (n, rows, columns, 3) turn along the rows, at most."""
    length = np.linalg.norm(normals, axis=3, keepdims=True)
    unit = normals / np.where(length > 0.0, length, 1.0)
    both = (length[:, 1:, :, 0] > 0.0) & (length[:, :-1, :, 0] > 0.0)
    return np.asarray(np.where(both, np.linalg.norm(np.diff(unit, axis=1), axis=3), 0.0).sum(axis=1).max(axis=1))


def _bulge(xyz: Array) -> Array:
    """How far points (n, rows, columns, 3) are off the straight lines between the ends of rows, at most."""
    x = np.linspace(0.0, 1.0, xyz.shape[1])[:, None, None]
    line = (1.0 - x) * xyz[:, :1] + x * xyz[:, -1:]
    return np.asarray(np.linalg.norm(xyz - line, axis=3).max(axis=(1, 2)))


def _slender(patches: Patches, size: float) -> Mask:
    """Which are long and thin."""
    lengths = patches.lengths
    return np.asarray(lengths.max(axis=1) > np.maximum(_ASPECT * lengths.min(axis=1), _SHORT * size))


def patches_by_angle(face: Face, angle: float) -> tuple[Patches, Array]:
    """Patches whose cones have half angles of at most `angle`, as far as halving makes them so, and their boxes."""
    divided = _Divided(face)
    done: list[Patches] = []
    active = divided.whole()
    count = 0
    while True:
        longest = active.lengths.max(axis=1)
        open_cone = (active.half_angle > angle) & (longest > _FINEST * divided.size)
        slender = _slender(active, divided.size)
        entered = np.zeros(len(longest), dtype=bool)
        if divided.is_trimmed:
            entered = (divided.sides(active) != CLEAR) & (longest > _AT_BOUNDARY * divided.size)
        more = open_cone | slender | entered
        count += int((~more).sum())
        done.append(active.at(~more))
        if not more.any() or count + 2 * int(more.sum()) > _MOST:
            done.append(active.at(more))
            break
        chosen, turned = active.at(more), open_cone[more]
        in_v = chosen.lengths[:, 1] > chosen.lengths[:, 0]
        # A normal that turns in neither direction by what is told: the longer side, as for the shape.
        told = turned & (np.abs(np.diff(chosen.turns, axis=1)[:, 0]) > 1e-3 * angle)
        active = divided.halved(chosen, np.where(told, chosen.turns[:, 1] > chosen.turns[:, 0], in_v))
    patches = Patches.joined(done)
    return patches, divided.parameters(patches)


def patches_by_count(faces: Sequence[Face], count: int) -> list[tuple[Patches, Array]]:
    """`count` patches of all faces together: those with the largest chord error are halved first."""
    divided = [_Divided(face) for face in faces]
    state = [one.whole() for one in divided]
    while sum(len(part.box) for part in state) < count:
        # Flat patches are halved by their length.
        worth = np.concatenate([part.chord_error + 1e-9 * part.lengths.max(axis=1) for part in state])
        if not len(worth):
            break
        order = np.argsort(-worth, kind="stable")
        large = order[worth[order] >= _ROUND * worth[order[0]]][: count - len(worth)]
        chosen = np.zeros(len(worth), dtype=bool)
        chosen[large] = True
        at = 0
        for k, (one, part) in enumerate(zip(divided, state, strict=True)):
            mine = chosen[at : at + len(part.box)]
            at += len(part.box)
            if not mine.any():
                continue
            some = part.at(mine)
            longer, bulgier = (x[:, 1] > x[:, 0] for x in (some.lengths, some.bulges))
            in_v = np.where(_slender(some, one.size), longer, bulgier)
            state[k] = Patches.joined([part.at(~mine), one.halved(some, in_v)])
    return [(part, one.parameters(part)) for one, part in zip(divided, state, strict=True)]
