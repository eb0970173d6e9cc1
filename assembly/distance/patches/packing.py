"""Surfaces, curves and points packed as Bezier patches for certified queries: tables of `distance/patches/nodes.py`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.distance.patches.nodes import PATCH_RECORD
from assembly.geometry.splines.bezier_packing import degree_tables
from assembly.geometry.splines.bezier_pieces import CENTER, ERROR, HEAD, REACH, UNIT, WEIGHT_RATIO
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["pack_patches"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def pack_patches(shape: NurbsSurface | NurbsCurve | Array) -> tuple[Ints, Array]:
    """Record and pool of a surface, a curve or a point; the packed shape is within `pool[ERROR]` of the given one.

    Errors are those of `bezier_packing.pack_pieces`, in two directions one after the other.
    """
    if isinstance(shape, NurbsSurface):
        points, weights = shape.control_points.reshape(-1, 3), shape.weights.ravel()
        breaks: tuple[Array, Array] = shape.breaks()
        p, q = shape.degree
    elif isinstance(shape, NurbsCurve):
        points, weights = shape.control_points, shape.weights
        breaks, (p, q) = (shape.breaks(), np.array([0.0, 1.0])), (shape.degree, 0)
    else:
        points, weights = shape.reshape(1, -1), np.ones(1)
        breaks, (p, q) = (np.array([0.0, 1.0]), np.array([0.0, 1.0])), (0, 0)
    center = np.zeros(3)
    center[: points.shape[1]] = 0.5 * points.min(axis=0) + 0.5 * points.max(axis=0)
    local = np.zeros((len(points), 3))
    local[:, : points.shape[1]] = points - center[: points.shape[1]]
    reach = float(np.sqrt((local**2).sum(axis=1).max())) * (1.0 + 8.0 * UNIT)
    rational = bool(weights.min() != weights.max())
    if isinstance(shape, NurbsSurface):
        net = NurbsSurface(
            local.reshape(shape.control_points.shape), shape.knots, shape.degree, shape.weights
        ).bezier_pieces()
    elif isinstance(shape, NurbsCurve):
        net = NurbsCurve(local, shape.knots, shape.degree, shape.weights).bezier_pieces()[:, None, :, None]
    else:
        net = np.array([0.0, 0.0, 0.0, 1.0]).reshape(1, 1, 1, 1, 4)
    net = net / weights[0] if not rational else np.ldexp(net, -int(np.frexp(weights.max())[1]))
    if not rational:
        net[..., 3] = 1.0
    head = np.zeros(HEAD)
    head[REACH] = reach
    head[ERROR] = (2.0 if rational else 1.0) * 16.0 * (p + q + 4) * UNIT * reach
    head[CENTER : CENTER + 3] = center
    head[WEIGHT_RATIO] = weights.max() / weights.min() * (1.0 + 4.0 * UNIT)
    blocks = [head, *breaks, degree_tables(p)[3 * (p + 1) : 6 * (p + 1)], degree_tables(q)[3 * (q + 1) : 6 * (q + 1)]]
    offsets = np.cumsum([0] + [block.size for block in blocks])
    record = np.array([p, q, net.shape[0], net.shape[1], rational, *offsets[1:]], dtype=np.int64)
    assert record.size == PATCH_RECORD
    return record, np.concatenate([*blocks, net.ravel()])
