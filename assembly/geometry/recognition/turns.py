"""How far a surface goes around an axis, by the control points of parts of its pieces."""

from __future__ import annotations

from functools import lru_cache
from math import pi

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.forms import Turn
from assembly.geometry.recognition.nets import Net
from assembly.geometry.splines import bezier

__all__ = ["turn_of"]

Array = NDArray[np.float64]
# A piece is cut into so many parts along either parameter, so that no part goes around by half a turn.
_PARTS = 4
# Points that are nearer to the axis than this, in parts of the size, have no direction; smaller gaps are rounding.
_AT_AXIS, _GAP = 1e-9, 1e-9


@lru_cache(maxsize=64)
def _cut(degree: int) -> Array:
    """Matrix (parts * (degree + 1), degree + 1) from Bezier points of a piece to those of its parts, one by one."""
    rest, parts = np.eye(degree + 1), []
    for k in range(_PARTS, 1, -1):
        first, rest = bezier.divided(rest, 1.0 / k)
        parts.append(first)
    return np.concatenate([*parts, rest])


def turn_of(net: Net, origin: Array, axes: Array) -> Turn:
    """How far a net that does not meet an axis, or at poles alone, goes around it."""
    p, q = (n - 1 for n in net.pieces.shape[2:4])
    flat = net.pieces.reshape(-1, p + 1, q + 1, 4)
    flat = np.concatenate([(flat[..., :3] - origin * flat[..., 3:]) @ axes[:2].T, flat[..., 3:]], axis=-1)
    rows = np.matmul(_cut(p), flat.reshape(len(flat), p + 1, -1)).reshape(len(flat), -1, q + 1, 3)
    parts = np.matmul(_cut(q), rows).reshape(len(flat), _PARTS, p + 1, _PARTS, q + 1, 3)
    parts = parts.swapaxes(2, 3).reshape(-1, (p + 1) * (q + 1), 3)
    z = (parts[..., 0] + 1.0j * parts[..., 1]) / parts[..., 2]
    far = np.abs(z) > _AT_AXIS
    z = np.where(far, z, z[np.arange(len(z)), np.argmax(far, axis=1), None])
    first = np.angle(z[:, 0])
    beside = np.angle(z * z[:, :1].conj())
    low = (first + beside.min(axis=1)) % (2.0 * pi)
    high = low + np.ptp(beside, axis=1)
    order = np.argsort(low)
    low, high = low[order], np.maximum.accumulate(high[order])
    gaps = np.append(low[1:], low[0] + 2.0 * pi) - high
    # What goes on beyond a whole turn covers the beginning.
    gaps[:-1] = np.minimum(gaps[:-1], low[1:] - (high[-1] - 2.0 * pi))
    k = int(np.argmax(gaps))
    if gaps[k] <= _GAP:
        return Turn(axes[0].copy(), 2.0 * pi)
    start = float(low[(k + 1) % len(low)])
    return Turn(np.cos(start) * axes[0] + np.sin(start) * axes[1], 2.0 * pi - float(gaps[k]))
