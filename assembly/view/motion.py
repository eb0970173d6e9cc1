"""Rotations of many things at once, and poses between two poses.

Between two poses a body moves along a screw, at a constant twist: the only way that does not depend on where its
origin was put, and the one that a hinge or a slide on a fixed body allows. With n the unit axis of the relative
rotation, a half its angle, and d the displacement of a point, at the part s of the way the point has moved by

    s n n.d + sin(s a) / sin(a) R(n, (s - 1) a) (d - n n.d).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["aligned", "between", "quaternions", "rotations", "sample_times", "turned"]

Array = NDArray[np.float64]
# Browsers interpolate positions along straight lines: samples are so close that a turn between two is at most this.
_DEGREES = 5.0


def rotations(e: Array) -> Array:
    """Rotations (..., 3, 3) of quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(e / np.linalg.norm(e, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternions(rotation: Array) -> Array:
    """Unit quaternions (k, 4) of rotations (k, 3, 3), each on the side of the one before."""
    a = rotation
    diagonal = np.einsum("kii->ki", a)
    trace = diagonal.sum(axis=1)
    # 4 e e^T; the row of the largest entry of its diagonal has no cancellation.
    products = np.empty((len(a), 4, 4))
    products[:, 0, 0] = 1.0 + trace
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        products[:, i + 1, i + 1] = 1.0 + 2.0 * diagonal[:, i] - trace
        products[:, 0, i + 1] = products[:, i + 1, 0] = a[:, k, j] - a[:, j, k]
        products[:, i + 1, j + 1] = products[:, j + 1, i + 1] = a[:, i, j] + a[:, j, i]
    largest = np.einsum("kii->ki", products).argmax(axis=1)
    e: Array = products[np.arange(len(a)), largest]
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    flips = np.where((e[1:] * e[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    e[1:] *= np.cumprod(flips)[:, None]
    return e


def aligned(directions: Array) -> Array:
    """Rotations (k, 3, 3) that take the z axis along directions (k, 3), turning no more than these do.

    A direction of zero length changes nothing.
    """
    result = np.empty((len(directions), 3, 3))
    rotation = np.eye(3)
    for k, way in enumerate(directions):
        length = np.linalg.norm(way)
        axis = rotation[:, 2]
        along = way / length if length > 0.0 else axis
        cosine = float(axis @ along)
        if cosine < -0.999999:
            # Half a turn, about the x axis: every axis across would be as short.
            rotation = rotation @ np.diag([1.0, -1.0, -1.0])
            axis, cosine = rotation[:, 2], -cosine
        x, y, z = np.cross(axis, along)
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        x_axis = (np.eye(3) + skew + skew @ skew / (1.0 + cosine)) @ rotation[:, 0]
        # Made orthonormal again: near half a turn the rounding of the last rotation is amplified.
        x_axis -= (x_axis @ along) * along
        x_axis /= np.linalg.norm(x_axis)
        rotation = np.column_stack([x_axis, np.cross(along, x_axis), along])
        result[k] = rotation
    return result


def _product(a: Array, b: Array) -> Array:
    a0, au, b0, bu = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    real = a0 * b0 - (au * bu).sum(axis=-1, keepdims=True)
    return np.concatenate([real, a0 * bu + b0 * au + np.cross(au, bu)], axis=-1)


def _relative(start: Array, end: Array) -> tuple[Array, Array]:
    """Unit axis (..., 3), zero where there is none, and half the angle (..., 1) of the shorter turn."""
    turn = _product(end, start * [1.0, -1.0, -1.0, -1.0])
    turn = np.where(turn[..., :1] < 0.0, -turn, turn)
    sine = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
    axis = np.divide(turn[..., 1:], sine, out=np.zeros_like(turn[..., 1:]), where=sine > 0.0)
    return axis, np.arctan2(sine, turn[..., :1])


def turned(start: Array, end: Array, part: Array) -> Array:
    """Quaternions (..., 4) a part (..., 1) of the way between two, at constant speed."""
    axis, half = _relative(start, end)
    return _product(np.concatenate([np.cos(part * half), np.sin(part * half) * axis], axis=-1), start)


def between(start: Array, end: Array, part: Array) -> Array:
    """Pose rows (..., 7) a part (..., 1) of the way between two, along a screw."""
    axis, half = _relative(start[..., 3:], end[..., 3:])
    step = end[..., :3] - start[..., :3]
    along = (step * axis).sum(axis=-1, keepdims=True) * axis
    across = step - along
    back = (part - 1.0) * half
    across = np.cos(back) * across + np.sin(back) * np.cross(axis, across)
    ratio = np.broadcast_to(part, half.shape).copy()
    np.divide(np.sin(part * half), np.sin(half), out=ratio, where=half > 0.0)
    position = start[..., :3] + part * along + ratio * across
    return np.concatenate([position, turned(start[..., 3:], end[..., 3:], part)], axis=-1)


def sample_times(q: Array) -> Array:
    """Times (k,), in frames, at which to show poses (frames, n, 7): each frame, and more where a body turns far."""
    if len(q) == 1:
        return np.zeros(1)
    _, half = _relative(q[:-1, :, 3:], q[1:, :, 3:])
    parts = np.maximum(np.ceil(np.rad2deg(2.0 * half.max(axis=(1, 2))) / _DEGREES), 1.0).astype(np.int64)
    within = [k + np.arange(count) / count for k, count in enumerate(parts)]
    return np.append(np.concatenate(within), len(q) - 1.0)
