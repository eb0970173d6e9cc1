"""Spines of wires as kernels read them (`proximity/spine_curve.py`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.spine import Spine
from assembly.proximity import spine_curve as layout

__all__ = ["pack_spine"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
_ROUNDING = 1e-15
# Parts of pieces turn by no more than this; lines are cut to so many times the length of such a part of the
# sharpest, and into no more than so many.
_TURN, _LINE, _MOST = 0.4, 4.0, 64


def pack_spine(spine: Spine, scale: float, table_at: int = 0, pool_at: int = 0) -> tuple[Table, Array, int]:
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
    count = len(spine.length)
    numbers = np.array([spine.radius / scale, scale * spine.curvature.max(), spine.sense])
    pieces = np.concatenate([
        spine.start / scale, spine.tangent, spine.normal, scale * spine.curvature[:, None],
        spine.length[:, None] / scale, spine.turn[:, None],
    ], axis=1)  # fmt: skip
    parts = _parts(spine)
    children, balls = _tree(spine, parts, scale)
    record = np.zeros(layout.SPINE, dtype=np.int64)
    record[layout.PIECES], record[layout.CLOSED], record[layout.ALONG] = count, spine.closed, spine.along
    doubles = (numbers, pieces, parts / [1.0, scale, scale], balls)
    at = pool_at + np.cumsum([0, *(part.size for part in doubles)])
    record[[layout.NUMBERS, layout.PIECE_POOL, layout.PART_POOL, layout.NODE_POOL]] = at[:4]
    record[layout.NODE_TABLE] = table_at + layout.SPINE
    return np.append(record, children), np.concatenate([part.ravel() for part in doubles]), table_at


def _parts(spine: Spine) -> Array:
    """Parts of pieces, (m, 3): the piece, from and to."""
    finest = _TURN / max(float(spine.curvature.max()), 1e-300)
    rows = []
    for k, (bend, length) in enumerate(zip(spine.curvature, spine.length, strict=True)):
        count = bend * length / _TURN if bend > 0.0 else min(length / (_LINE * finest), _MOST)
        at = np.linspace(0.0, length, max(int(np.ceil(count)), 1) + 1)
        rows += [(k, low, high) for low, high in zip(at[:-1], at[1:], strict=True)]
    return np.array(rows)


def _tree(spine: Spine, parts: Array, scale: float) -> tuple[Table, Array]:
    """Children and balls of the nodes: halves of the parts, down to single ones."""
    ends = np.array([spine.points(int(k), np.array([low, 0.5 * (low + high), high]))[0] for k, low, high in parts])
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
        balls[at] = np.append(center, radius + 8.0 * _ROUNDING * size) / scale
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
