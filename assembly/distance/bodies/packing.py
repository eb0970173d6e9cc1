"""The tree of a body: packed once from its faces, kept, and grown by searches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import accumulate
from math import comb
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of, size_of
from assembly._turn import in_child
from assembly.distance.bodies.boundary_patches import boundary_patches
from assembly.distance.bodies.elementary import spine_row
from assembly.distance.bodies.nodes import plant_tree
from assembly.distance.bodies.patch_blocks import PatchBlock, patches_of
from assembly.distance.bodies.records import (
    BODY_HEAD,
    LINKS,
    NODE,
    NONE,
    PATCH,
    PATCH_SIZE,
    SPAN,
    USED,
)
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.bezier_packing import degree_tables
from assembly.geometry.splines.bezier_pieces import UNIT

__all__ = ["KeptTree", "tree_of", "tree_of_boundary"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Arrays = tuple[Ints, Array, Ints, Array, Array]
_HEAD = size_of(BODY_HEAD)
_PATCH_FIELDS: tuple[str, ...] = PATCH.names or ()
_FACE_AT, _SPAN_AT, _BORDER_AT = (place_of(PATCH, name) for name in ("face", "span", "border"))
# Before center and half of a BODY_HEAD.
_HEAD_NUMBERS: tuple[str, ...] = (BODY_HEAD.names or ())[:-2]
# Nodes for which there is room at first, beside the whole patches.
_SPARE = 128


@dataclass(eq=False)
class KeptTree:
    """The tree of a body, as kernels read it, and who is at it.

    Attributes
    ----------
    arrays
        Table, pool, links, nodes and nets (`records.BodyTree`).
    degree : int
        The largest degree of a patch in one direction.
    lock
        Searches make nodes: one at a time.
    """

    arrays: Arrays
    degree: int
    lock: RLock = field(default_factory=RLock)

    def patch_at(self, number: int) -> tuple[int, int, list[float]]:
        """Face and boundary curve of a patch, and its low u, high u, low v, high v; of a curve its t, and 0 to 1."""
        table, pool = self.arrays[:2]
        row = table[PATCH_SIZE * number : PATCH_SIZE * (number + 1)].tolist()
        span = row[_SPAN_AT]
        return row[_FACE_AT], row[_FACE_AT + 1], pool[span : span + SPAN].tolist()

    def make_room(self, halvings: int) -> None:
        """Room for as many halvings, and twice as many nodes where there is none."""
        table, pool, links, nodes, nets = self.arrays
        # TREE_STATE, which a record would take longer to read.
        count, used_nets = links.item(0), links.item(1)
        needed = 14 * (self.degree + 1) ** 2 * halvings
        if (count + 2 * halvings) * NODE <= nodes.size and used_nets + needed <= nets.size:
            return
        more_links = np.empty(2 * links.size, dtype=np.int64)
        more_nodes, more_nets = np.empty(2 * nodes.size), np.empty(2 * nets.size + needed)
        used, at = USED + LINKS * count, NODE * count
        more_links[:used], more_nodes[:at] = links[:used], nodes[:at]
        more_nets[:used_nets] = nets[:used_nets]
        self.arrays = table, pool, more_links, more_nodes, more_nets


@cache
def _tables(degree: int) -> Array:
    """Value and derivatives of the Bernstein polynomials at 1/2, and factors C(n, k - s) C(2, s) / C(n + 2, k)."""
    n = degree
    times = np.zeros((n + 3, 3))
    for k in range(n + 3):
        for s in range(3):
            if 0 <= k - s <= n:
                times[k, s] = comb(n, k - s) * comb(2, s) / comb(n + 2, k)
    return np.concatenate([degree_tables(n)[3 * (n + 1) : 6 * (n + 1)], times.ravel()])


@lru_cache(maxsize=256)
def tree_of(faces: tuple[Face, ...]) -> KeptTree:
    """The tree of a body with these faces."""
    center, half = _box_of(faces)
    blocks = [patches_of(face, number, center) for number, face in enumerate(faces)]
    blocks += [curves for block in blocks if block.trimmed for curves in boundary_patches(faces[block.face], block)]
    return _planted(faces, blocks, center, half)


@lru_cache(maxsize=256)
def tree_of_boundary(face: Face, curve: int) -> KeptTree:
    """The tree of one of the curves that bound a face, by its number."""
    center, half = _box_of((face,))
    blocks = boundary_patches(face, patches_of(face, 0, center), curve)
    return _planted((face,), list(blocks), center, half)


# Other threads may be amid searches that make nodes of them.
in_child(tree_of.cache_clear)
in_child(tree_of_boundary.cache_clear)


def _box_of(faces: Sequence[Face]) -> tuple[Array, Array]:
    """Center and half extents of the box around all control points."""
    low, high = faces[0].surface.bounding_box()
    for face in faces[1:]:
        lower, upper = face.surface.bounding_box()
        low, high = np.minimum(low, lower), np.maximum(high, upper)
    return 0.5 * low + 0.5 * high, 0.5 * (high - low)


def _planted(faces: Sequence[Face], blocks: list[PatchBlock], center: Array, half: Array) -> KeptTree:
    """The tree of all patches."""
    count = sum(len(block.nets) for block in blocks)
    table, pool = _static(faces, blocks, count, center)
    pool[:_HEAD] = _head(blocks, count, center, half)
    points = [block.nets.ravel() for block in blocks]
    given = points[0] if len(points) == 1 else np.concatenate(points)
    largest = max((p + 1) * (q + 1) for p, q in (block.degree for block in blocks))
    nets = np.empty(given.size // 4 * 7 + 7 * _SPARE * largest)
    room = 3 * count + _SPARE
    links, nodes = np.empty(USED + LINKS * room, dtype=np.int64), np.empty(NODE * room)
    plant_tree((table, links), (pool, nodes, nets, given), np.empty(5 * count, dtype=np.int64))
    return KeptTree((table, pool, links, nodes, nets), max(max(block.degree) for block in blocks))


def _head(blocks: list[PatchBlock], count: int, center: Array, half: Array) -> list[float]:
    """A BODY_HEAD as its doubles."""
    # Control points of boundary curves may be outside of the box of the faces. No weight is above one.
    curves = [block.nets[..., :3] / block.nets[..., 3:] for block in blocks if block.curve != NONE]
    farthest = max((float((points**2).sum(axis=-1).max()) for points in curves), default=0.0)
    lightest = min(block.lightest for block in blocks)
    values = {
        "reach": max(float(half @ half), farthest) ** 0.5 * (1.0 + 8.0 * UNIT),
        "error": max(block.error for block in blocks),
        "weight_ratio": (1.0 + 4.0 * UNIT) / lightest,
        "rational": float(lightest != 1.0),
        "patches": float(count),
        "degree": float(max(sum(block.degree) for block in blocks)),
    }
    return [*(values[name] for name in _HEAD_NUMBERS), *center.tolist(), *(half * (1.0 + 8.0 * UNIT)).tolist()]


@cache
def _all_tables(degrees: tuple[int, ...]) -> tuple[Array, dict[int, int]]:
    """A pool with room for a BODY_HEAD and tables of some degrees, and where these begin."""
    parts = [np.zeros(_HEAD), *(_tables(degree) for degree in degrees)]
    starts = accumulate(part.size for part in parts)
    return np.concatenate(parts), dict(zip(degrees, starts, strict=False))


def _static(faces: Sequence[Face], blocks: list[PatchBlock], count: int, center: Array) -> tuple[Ints, Array]:
    """Table and pool: what is told of patches, tables of their degrees, spines and trims."""
    tables, at = _all_tables(tuple(sorted({degree for block in blocks for degree in block.degree})))
    parts = [tables, *(block.spans.ravel() for block in blocks)]
    pool_at = tables.size + SPAN * count
    table = np.empty((count, PATCH_SIZE), dtype=np.int64)
    more: list[Ints] = []
    table_at, first = table.size, 0
    spine_of_face: dict[int, int] = {}
    borders: dict[int, int] = {}
    for block in blocks:
        trim = NONE
        # A curve lies on what its face is.
        place = NONE if block.curve == NONE else spine_of_face.get(block.face, NONE)
        if (spine := spine_row(block, faces[block.face], center)) is not None:
            place = pool_at
            parts.append(spine)
            pool_at += spine.size
            if block.curve == NONE:
                spine_of_face[block.face] = place
        if block.trimmed:
            trim = table_at
            trim_table, trim_pool = faces[block.face].packed_trim(table_at, pool_at)
            more.append(trim_table)
            parts.append(trim_pool)
            table_at, pool_at = table_at + trim_table.size, pool_at + trim_pool.size
        (p, q), n = block.degree, len(block.nets)
        values = {
            "degree_u": p, "degree_v": q, "face": block.face, "curve": block.curve, "sign": block.sign,
            "single": int(block.curve == NONE and n == 1), "node": NONE, "net": NONE,
            "tables_u": at[p], "tables_v": at[q], "span": tables.size, "trim": trim, "spine": place, "border": NONE,
        }  # fmt: skip
        table[first : first + n] = [values[name] for name in _PATCH_FIELDS]
        if block.curve != NONE and block.face not in borders:
            borders[block.face] = first
        first += n
    for face, border in borders.items():
        of_face = (table[:, _FACE_AT] == face) & (table[:, _FACE_AT + 1] == NONE)
        table[of_face, _BORDER_AT] = border
    return np.concatenate([table.ravel(), *more]) if more else table.ravel(), np.concatenate(parts)
