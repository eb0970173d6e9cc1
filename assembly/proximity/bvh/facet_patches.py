"""Faces as patches: boxes in (u, v), each with two triangles, how far the surface is off them, a box and a normal cone.

What holds for a patch is in `proximity/bvh/patch_measures.py`; here all faces of a body are halved together, a level at
a time, until all patches are as fine as asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.proximity.brep.body_nets import nets_of
from assembly.proximity.brep.box_sides import CLEAR, OUTSIDE
from assembly.proximity.bvh.patch_measures import PATCH, PATCH_DTYPE, measure_patches

__all__ = ["Patches", "patches_by_angle", "patches_by_count"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Patches a face, at most, and the least extent of one against the face, where no halving makes a cone narrow.
_MOST, _FINEST = 20_000, 1e-4
# A patch is no longer than so many times its width unless it is short against its face, and one that the boundary
# enters no longer than a part of the face.
_ASPECT, _SHORT, _AT_BOUNDARY = 4.0, 0.03125, 0.125
# A round halves all patches whose chord error is above this part of the largest.
_ROUND = 0.5


class Patches(NamedTuple):
    """Patches of the faces of a body.

    Attributes
    ----------
    face : (n,) of int
    piece : (n, 2) of int
        The Bezier piece: its span in u and in v.
    box : (n, 4)
        In the unit square of the piece: u from and to, v from and to.
    parameters : (n, 4)
        The same in (u, v) of the surface.
    side : (n,) of int
        Whether all of it is inside the face's trim (CLEAR), or the boundary may enter it.
    rows : (n, PATCH)
        What is measured.
    """

    face: Indices
    piece: Indices
    box: Array
    parameters: Array
    side: Indices
    rows: Array

    @property
    def measures(self) -> Any:
        """What is measured, records (n,) of PATCH_DTYPE.

        corners (4, 3): S at (low, low), (high, low), (high, high), (low, high). No point of the patch is farther than
        chord_error from its triangles, corners 0 1 2 and 0 2 3. low, high (3): a box. axis (3), half_angle: a cone
        around its outward normals. lengths, turns, bulges (2): about how long it is in u and in v, how far the normal
        turns, and how far it is off a straight line.
        """
        return rows_of(PATCH_DTYPE, self.rows)

    def at(self, chosen: Indices | Mask) -> Patches:
        """Some of them."""
        face, piece, box, parameters, side, rows = self
        return Patches(face[chosen], piece[chosen], box[chosen], parameters[chosen], side[chosen], rows[chosen])

    @staticmethod
    def joined(parts: Sequence[Patches]) -> Patches:
        """Several as one, sorted by faces; those of one face in the order of the parts."""
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        order = np.argsort(columns[0], kind="stable")
        return Patches(*(column[order] for column in columns))


class _Divided:
    """The faces of a body, whose patches are halved."""

    def __init__(self, faces: Sequence[Face]) -> None:
        self.nets = nets_of(tuple(faces))
        boxes = np.array([face.surface.bounding_box() for face in faces])
        self.sizes = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
        self._breaks = [face.surface.breaks() for face in faces]
        # Ends of the spans of all faces in a row, in u and in v.
        self._ends = [np.concatenate([at[k] for at in self._breaks]) for k in range(2)]
        sizes = np.array([[at[0].size, at[1].size] for at in self._breaks])
        self._first = np.cumsum(sizes, axis=0) - sizes

    def whole(self) -> Patches:
        """One patch a Bezier piece, without those outside the trim."""
        spans = [np.indices((u.size - 1, v.size - 1)).reshape(2, -1).T for u, v in self._breaks]
        face = np.repeat(np.arange(len(spans)), [len(rows) for rows in spans])
        piece = np.concatenate(spans)
        return self.measured(face, piece, np.tile([0.0, 1.0, 0.0, 1.0], (len(piece), 1)))

    def _parameters(self, face: Indices, piece: Indices, box: Array) -> Array:
        """Boxes (n, 4) in (u, v): u from and to, v from and to."""
        result = np.empty_like(box)
        for k, ends in enumerate(self._ends):
            place = self._first[face, k] + piece[:, k]
            start, stop = ends[place][:, None], ends[place + 1][:, None]
            x = box[:, 2 * k : 2 * k + 2]
            result[:, 2 * k : 2 * k + 2] = np.where(x == 1.0, stop, start + x * (stop - start))
        return result

    def measured(self, face: Indices, piece: Indices, box: Array) -> Patches:
        """Patches over boxes (n, 4) of pieces (n, 2), without those outside the trim."""
        nets = self.nets
        parameters = self._parameters(face, piece, box)
        side = nets.sides(face, parameters)
        if (side == OUTSIDE).any():
            inside = side != OUTSIDE
            face, piece, box, parameters, side = (row[inside] for row in (face, piece, box, parameters, side))
        rows = np.empty((len(face), PATCH))
        measure_patches(nets.table, nets.pool, face, np.ascontiguousarray(piece), box, nets.workspace(), rows)
        return Patches(face, piece, box, parameters, side, rows)

    def halved(self, patches: Patches, in_v: Mask) -> Patches:
        """Both halves of every patch, but for those outside the trim."""
        low, high = patches.box.copy(), patches.box.copy()
        rows, first = np.arange(len(low)), np.where(in_v, 2, 0)
        middle = 0.5 * (low[rows, first] + low[rows, first + 1])
        low[rows, first + 1] = middle
        high[rows, first] = middle
        face, piece = np.tile(patches.face, 2), np.tile(patches.piece, (2, 1))
        return self.measured(face, piece, np.concatenate([low, high]))

    def slender(self, patches: Patches) -> Mask:
        """Which are long and thin."""
        lengths = patches.measures.lengths
        least = np.maximum(_ASPECT * lengths.min(axis=1), _SHORT * self.sizes[patches.face])
        return np.asarray(lengths.max(axis=1) > least)


def patches_by_angle(faces: Sequence[Face], angle: float) -> Patches:
    """Patches whose cones have half angles of at most `angle`, as far as halving makes them so."""
    divided = _Divided(faces)
    done: list[Patches] = []
    active = divided.whole()
    counts = np.zeros(len(faces), dtype=np.int64)
    while True:
        measures = active.measures
        longest, sizes = measures.lengths.max(axis=1), divided.sizes[active.face]
        open_cone = (measures.half_angle > angle) & (longest > _FINEST * sizes)
        entered = (active.side != CLEAR) & (longest > _AT_BOUNDARY * sizes)
        more = open_cone | entered | divided.slender(active)
        counts += np.bincount(active.face[~more], minlength=len(faces))
        # A face that would have too many patches has no more.
        full = counts + 2 * np.bincount(active.face[more], minlength=len(faces)) > _MOST
        more &= ~full[active.face]
        done.append(active.at(~more))
        if not more.any():
            return Patches.joined(done)
        chosen, turned = active.at(more), open_cone[more]
        measures = chosen.measures
        in_v = measures.lengths[:, 1] > measures.lengths[:, 0]
        # A normal that turns in neither direction by what is told: the longer side, as for the shape.
        told = turned & (np.abs(measures.turns[:, 1] - measures.turns[:, 0]) > 1e-3 * angle)
        active = divided.halved(chosen, np.where(told, measures.turns[:, 1] > measures.turns[:, 0], in_v))


def patches_by_count(faces: Sequence[Face], count: int) -> Patches:
    """`count` patches of all faces together: those with the largest chord error are halved first."""
    divided = _Divided(faces)
    state = divided.whole()
    while 0 < len(state.face) < count:
        measures = state.measures
        # Flat patches are halved by their length.
        worth = measures.chord_error + 1e-9 * measures.lengths.max(axis=1)
        order = np.argsort(-worth, kind="stable")
        large = order[worth[order] >= _ROUND * worth[order[0]]][: count - len(worth)]
        chosen = np.zeros(len(worth), dtype=bool)
        chosen[large] = True
        some = state.at(chosen)
        lengths, bulges = some.measures.lengths, some.measures.bulges
        in_v = np.where(divided.slender(some), lengths[:, 1] > lengths[:, 0], bulges[:, 1] > bulges[:, 0])
        state = Patches.joined([state.at(~chosen), divided.halved(some, in_v)])
    return state
