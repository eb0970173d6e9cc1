"""Bounds on the derivatives of a surface, from its Bezier nets.

With S = N / w, Leibniz' rule solved for the highest derivative of S,

    w S_kl = N_kl - sum over (i, j) < (k, l) of C(k, i) C(l, j) w_(k-i)(l-j) S_ij,

bounds it by the nets of the derivatives of N and of w and the bounds of the lower ones.
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["derivative_bounds"]

Array = NDArray[np.float64]
_ORDERS = [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]


def _nets(net: Array, widths: tuple[Array, Array]) -> dict[tuple[int, int], Array]:
    """Nets of the derivatives of a patch (spans_u, spans_v, p + 1, q + 1, 4), zero where the degree is too low."""
    nets = {(0, 0): net}
    for k, l in _ORDERS:
        axis = 2 if k else 3
        before = nets[(k - 1, l) if k else (k, l - 1)]
        degree = before.shape[axis] - 1
        if degree == 0:
            nets[k, l] = np.zeros_like(before)
            continue
        width = widths[0][:, None] if k else widths[1][None, :]
        nets[k, l] = np.diff(before, axis=axis) * (degree / width)[..., None, None, None]
    return nets


def derivative_bounds(surface: NurbsSurface) -> Array:
    """Bounds (3,) on the first, second and third derivative of the surface along unit directions in (u, v)."""
    net = surface.bezier_pieces().copy()
    weight = net[..., 3].min(axis=(2, 3))
    low = (net[..., :3] / net[..., 3:]).min(axis=(2, 3), keepdims=True)
    high = (net[..., :3] / net[..., 3:]).max(axis=(2, 3), keepdims=True)
    # About the middle of each patch: its derivatives are the same, its bounds are smaller.
    net[..., :3] -= 0.5 * (low + high) * net[..., 3:]
    at_u, at_v = surface.breaks()
    nets = _nets(net, (np.diff(at_u), np.diff(at_v)))
    largest = {key: np.linalg.norm(value[..., :3], axis=-1).max(axis=(2, 3)) for key, value in nets.items()}
    weights = {key: np.abs(value[..., 3]).max(axis=(2, 3)) for key, value in nets.items()}
    bounds = {(0, 0): 0.5 * np.linalg.norm(high - low, axis=-1)[..., 0, 0]}
    for k, l in _ORDERS:
        total = largest[k, l]
        for i in range(k + 1):
            for j in range(l + 1):
                if (i, j) != (k, l):
                    total = total + comb(k, i) * comb(l, j) * weights[k - i, l - j] * bounds[i, j]
        bounds[k, l] = total / weight
    d = {key: float(value.max()) for key, value in bounds.items()}
    return np.array(
        [
            np.hypot(d[1, 0], d[0, 1]),
            max(d[2, 0], d[0, 2]) + d[1, 1],
            # The largest value of 3 cos^2 sin is 2 / sqrt(3).
            max(d[3, 0], d[0, 3]) + 2.0 / np.sqrt(3.0) * (d[2, 1] + d[1, 2]),
        ]
    )
