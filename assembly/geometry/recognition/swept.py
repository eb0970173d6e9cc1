"""Surfaces whose control points are those of a curve that goes along lines, or around an axis.

The weights of such a net are products of those of the curve and of those along its way, a_i b_j. Then

    extrusion    the control points of one line differ by multiples of its direction,
    revolution   the control points (x, y) are w_ij rho_j (c_i, s_i), and z of them is that of the profile, z_j,

with (c, s) a curve on the unit circle: c^2 + s^2 = 1, which its Bezier points show. A point of a surface with the same
weights is a mean of control points, and so no farther off than the worst of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.fits import axis_of_normals, frame_along, loose_of, moved, rigid_rates
from assembly.geometry.recognition.nets import Net, Samples, bezier_dot

__all__ = ["Lines", "Rings", "lines_of", "rings_of"]

Array = NDArray[np.float64]
_STEPS = 3
_WEAK = 1e-12
# Rings are sampled where they are wider than this, in parts of the size.
_NARROW = 1e-6


class Lines(NamedTuple):
    """An extrusion: which parameter runs along its lines, their direction, and how far it may be off."""

    along: int
    direction: Array
    deviation: float


class Rings(NamedTuple):
    """A revolution: which parameter runs around, the frame of its axis, and how far it may be off."""

    around: int
    origin: Array
    axes: Array
    deviation: float


def _rows(net: Net, direction: int) -> tuple[Array, Array]:
    """All control points and weights as rows, one a control point of the other direction: (k, l, 3), (k, l)."""
    order = (1, 3, 0, 2, 4) if direction == 0 else (0, 2, 1, 3, 4)
    spans_u, spans_v, m, n, _ = net.pieces.shape
    shape = (spans_v * n, spans_u * m) if direction == 0 else (spans_u * m, spans_v * n)
    points = net.points.transpose(order).reshape(*shape, 3)
    return points, net.pieces.transpose(order).reshape(*shape, 4)[..., 3]


def _split_weights(weights: Array) -> tuple[Array, Array, float]:
    """Weights as products a_i b_j, and how far points may be off for what they are not, in parts of the size."""
    columns, rows = weights[:, 0], weights[0] / weights[0, 0]
    # A mean with weights that are off by a part d is off by no more than about 2 d of the extent of its points.
    return columns, rows, 2.0 * float(np.abs(weights / np.outer(columns, rows) - 1.0).max())


def lines_of(net: Net, tolerance: float) -> Lines | None:
    """Whether a net is that of parallel lines."""
    for along in (0, 1):
        points, weights = _rows(net, along)
        off = _split_weights(weights)[2]
        if off > tolerance:
            continue
        ways = (points - points[:, :1]).reshape(-1, 3)
        longest = ways[np.argmax((ways**2).sum(axis=1))]
        if not longest.any():
            continue
        direction = np.linalg.svd(ways, full_matrices=False)[2][0]
        if direction @ longest < 0.0:
            direction = -direction
        beside = ways - np.outer(ways @ direction, direction)
        off += float(np.linalg.norm(beside, axis=1).max())
        if off <= tolerance:
            return Lines(along, direction, off)
    return None


def _axis(samples: Samples, around: int, loose: float) -> tuple[Array, Array] | None:
    """The frame of an axis about which samples of one value of a parameter are rings."""
    with np.errstate(all="ignore"):
        guess = axis_of_normals(samples.points, samples.normals, loose)
    if guess is None:
        return None
    origin, axes = guess[0], frame_along(guess[1])
    rings = samples.grid if around == 0 else samples.grid.swapaxes(0, 1)
    for _ in range(_STEPS):
        local = (rings - origin) @ axes.T
        rho = np.hypot(local[..., 0], local[..., 1])
        local = local[:, (rho > _NARROW).all(axis=0)]
        if not local.size:
            return None
        rho = np.hypot(local[..., 0], local[..., 1])
        out = local * [1.0, 1.0, 0.0] / rho[..., None]
        up = np.broadcast_to([0.0, 0.0, 1.0], local.shape)
        rows, off = [], []
        # Radii and heights along one ring are to be the same.
        for value, gradient in ((rho, out), (local[..., 2], up)):
            rates = rigid_rates(local.reshape(-1, 3), gradient.reshape(-1, 3)).reshape(*local.shape[:2], 6)
            rows.append((rates - rates.mean(axis=0)).reshape(-1, 6))
            off.append((value - value.mean(axis=0)).ravel())
        step = np.linalg.lstsq(np.concatenate(rows), -np.concatenate(off), rcond=_WEAK)[0]
        origin, axes = moved(origin, axes, step)
    return origin, axes


def rings_of(net: Net, samples: Samples, tolerance: float) -> Rings | None:
    """Whether a net is that of a curve that is turned about an axis."""
    for around in (0, 1):
        points, weights = _rows(net, around)
        columns, along, off = _split_weights(weights)
        frame = _axis(samples, around, loose_of(tolerance)) if off <= tolerance else None
        if frame is None:
            continue
        origin, axes = frame
        local = (points - origin) @ axes.T
        off += float(np.ptp(local[..., 2], axis=1).max())
        # The widest ring, in parts of its radius, is the curve on the unit circle, (c, s, 1) times weights.
        start = local[:, 0, :2]
        radii = np.linalg.norm(start, axis=1)
        widest = int(np.argmax(radii))
        if not radii[widest] > _NARROW:
            continue
        circle = local[widest, :, :2] / radii[widest]
        complex_circle, complex_start = circle @ [1.0, 1.0j], start @ [1.0, 1.0j]
        turned = complex_start * complex_circle[0].conjugate()
        off += float(np.abs(local[..., :2] @ [1.0, 1.0j] - np.outer(turned, complex_circle)).max())
        degree = net.pieces.shape[2 + around] - 1
        flat = np.concatenate([circle * along[:, None], along[:, None]], axis=1).reshape(-1, degree + 1, 3)
        curve = np.moveaxis(flat, -1, 1)[..., None]
        square = bezier_dot(curve, curve * np.array([1.0, 1.0, -1.0])[:, None, None])
        heavy = bezier_dot(curve[:, 2:], curve[:, 2:])
        # |c| - 1 = (|c|^2 - 1) / (|c| + 1).
        off += float(np.abs(square / heavy).max()) * float(np.abs(turned).max())
        if off <= tolerance:
            return Rings(around, origin, axes, off)
    return None
