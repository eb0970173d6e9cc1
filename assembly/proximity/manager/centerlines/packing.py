"""Spines of wires as kernels read them (`proximity/manager/wires.py`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.shapes.centerline import Spine
from assembly.proximity.manager import wires as layout

__all__ = ["pack_centerline"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
_BALL_ROUNDING = 1e-15
# Parts of pieces turn by no more than this; lines are cut to so many times the length of such a part of the
# sharpest, and into no more than so many.
_TURN, _LINE, _MOST = 0.3, 2.0, 64
# Curvatures differ that are off by more, over the largest.
_JUMP = 1e-9


def pack_centerline(centerline: Spine, scale: float, table_at: int = 0, pool_at: int = 0) -> tuple[Table, Array, int]:
    """The records of a spine.

    Parameters
    ----------
    spine : Spine
    scale : float
        Lengths are divided by it.
    table_at, pool_at : int
        Where the arrays will stand in a larger table and pool: offsets in the records are absolute.

    Returns
    -------
    table, pool : arrays
        To be appended there.
    offset : int
        Of the spine's record in the table.
    """
    numbers = np.array([centerline.radius / scale, scale * centerline.curvature.max(), centerline.sense])
    counts = _counts(centerline)
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    half = 0.5 * (centerline.length / counts)[owner]
    place = half * (1.0 + 2.0 * (np.arange(len(owner)) - first[owner]))
    pieces = np.stack([scale * centerline.curvature, centerline.length / scale, centerline.turn, first, counts], axis=1)
    points, tangents, normals = (np.concatenate(rows) for rows in zip(*(
        centerline.frames(k, place[owner == k]) for k in range(len(counts))
    ), strict=True))  # fmt: skip
    parts = np.concatenate([
        points / scale, tangents, normals,
        np.stack([scale * centerline.curvature[owner], half / scale, owner, place / scale], axis=1),
        *_beyond(centerline, owner, scale),
    ], axis=1)  # fmt: skip
    ends = np.array([
        centerline.frames(int(k), middle + np.array([-reach, 0.0, reach]))[0]
        for k, middle, reach in zip(owner, place, half, strict=True)
    ])  # fmt: skip
    children, balls = _tree(ends, scale)
    table = np.zeros(layout.SPINE, dtype=np.int64)
    record = layout.centerline_at(table, 0)
    record.pieces, record.parts = len(counts), len(owner)
    record.closed, record.along = centerline.closed, centerline.along
    doubles = (numbers, pieces, parts, balls)
    at = pool_at + np.cumsum([0, *(block.size for block in doubles)])
    record.numbers, record.piece_pool, record.part_pool, record.node_pool = at[:4]
    record.node_table = table_at + layout.SPINE
    return np.append(table, children), np.concatenate([block.ravel() for block in doubles]), table_at


def _beyond(centerline: Spine, owner: NDArray[np.int64], scale: float) -> tuple[Array, Array]:
    """Whether the curvature jumps where parts start and end, (m, 2), and the vectors beyond, (m, 6)."""
    count = len(centerline.length)
    starts = centerline.curvature[:, None] * centerline.normal
    ends = np.array([centerline.frames(k, centerline.length[k : k + 1])[2][0] for k in range(count)])
    ends *= centerline.curvature[:, None]
    before, after = np.roll(ends, 1, axis=0), np.roll(starts, -1, axis=0)
    jumps = np.stack([np.linalg.norm(before - starts, axis=1), np.linalg.norm(after - ends, axis=1)], axis=1)
    kinks = jumps > _JUMP * centerline.curvature.max()
    if not centerline.closed:
        kinks[0, 0] = kinks[-1, 1] = False
    change = owner[1:] != owner[:-1]
    border = np.stack([np.append(True, change), np.append(change, True)], axis=1)
    return (border & kinks[owner]).astype(float), scale * np.concatenate([before, after], axis=1)[owner]


def _counts(centerline: Spine) -> NDArray[np.int64]:
    """Into how many parts pieces are cut."""
    finest = _TURN / max(float(centerline.curvature.max()), 1e-300)
    lines = np.minimum(centerline.length / (_LINE * finest), _MOST)
    counts = np.where(centerline.curvature > 0.0, centerline.curvature * centerline.length / _TURN, lines)
    return np.maximum(np.ceil(counts), 1).astype(np.int64)


def _tree(ends: Array, scale: float) -> tuple[Table, Array]:
    """Children and balls of the nodes over parts (m, 3, 3), where they begin, their middles and ends; halved each."""
    middle = 0.5 * (ends[:, 0] + ends[:, 2])
    # No point of an arc of up to half a circle is farther from the middle of its chord than an end, or its own middle.
    reach = np.linalg.norm(ends - middle[:, None], axis=2).max(axis=1)
    children: list[int] = [0]
    balls = [np.zeros(4)]
    ranges = [(0, len(middle))]
    at = 0
    while at < len(ranges):
        low, high = ranges[at]
        part, radii = middle[low:high], reach[low:high, None]
        center = 0.5 * ((part - radii).min(axis=0) + (part + radii).max(axis=0))
        radius = (np.linalg.norm(part - center, axis=1) + radii[:, 0]).max()
        size = float(radius + np.abs(center).max())
        balls[at] = np.append(center, radius + 8.0 * _BALL_ROUNDING * size) / scale
        if high - low == 1:
            children[at] = -1 - low
        else:
            children[at] = len(ranges)
            cut = (low + high) // 2
            ranges += [(low, cut), (cut, high)]
            children += [0, 0]
            balls += [np.zeros(4), np.zeros(4)]
        at += 1
    return np.array(children, dtype=np.int64), np.array(balls)
