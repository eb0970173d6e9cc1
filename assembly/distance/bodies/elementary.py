"""Faces that are spheres, cylinders, tori or planes, and boundary curves that are lines or circles: which one, and a
proof of how far they may be from it.

What it is, is fitted to points and normals: of these surfaces p = c + r n with c the center, or on the axis or the
circle. What is proven does not rest on it: the equation of the surface, multiplied by powers of w, is a polynomial, and
its Bernstein coefficients bound it on the patches.
"""

from __future__ import annotations

from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.distance.bodies.patch_blocks import PatchBlock
from assembly.distance.bodies.records import NONE, SPINE_SIZE, spine_at
from assembly.distance.bodies.spines import CYLINDER, PLANE, SPHERE, TORUS
from assembly.geometry.splines import bezier
from assembly.geometry.splines.bezier_pieces import UNIT

__all__ = ["spine_row"]

Array = NDArray[np.float64]
# A face is taken for an elementary surface that it is as near to, in parts of its size.
_SAME = 1e-12
# Samples along either parameter of a patch; where the normals of a surface are no longer those of another kind.
_SAMPLES = np.array([0.1, 0.5, 0.9])
_RANK = 1e-7
# About as many patches of a face are sampled.
_FEW = 4


class _Elementary(NamedTuple):
    """An elementary surface; see `records.SPINE`."""

    kind: float
    center: Array
    axis: Array
    radius: float
    major: float


def spine_row(block: PatchBlock) -> Array | None:
    """The SPINE of the patches of a face, or of a boundary curve; None where they are no elementary surface."""
    p, q = block.degree
    if block.curve == NONE and (p > 2 or q > 2):
        return None
    points = (block.nets[..., :3] / block.nets[..., 3:]).reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if block.curve != NONE:
        found = _curve(points)
    else:
        found = _plane(points) if (block.nets[..., 3] == 1.0).all() else _round(block.nets)
    if found is None or not (
        found.kind == PLANE or found.radius + found.major > _RANK * size or found.kind == CYLINDER
    ):
        return None
    along = (points - found.center) @ found.axis
    center, half = found.center, 0.0
    if found.kind == CYLINDER:
        center = center + 0.5 * float(along.min() + along.max()) * found.axis
        half = 0.5 * float(np.ptp(along)) + 16.0 * UNIT * size
    if found.kind == PLANE:
        half = float(np.linalg.norm(points - center, axis=1).max()) * (1.0 + 8.0 * UNIT)
    off = _off(block.nets, found, points) + 64.0 * UNIT * (size + float(np.abs(points).max()))
    if not off <= _SAME * size + 256.0 * UNIT * float(np.abs(points).max()):
        return None
    row = np.zeros(SPINE_SIZE)
    spine = spine_at(row, 0)
    spine.kind, spine.center, spine.axis, spine.radius = found.kind, center, found.axis, found.radius
    spine.major, spine.half, spine.off = found.major, half, off
    return row


def _plane(points: Array) -> _Elementary | None:
    """The plane of control points."""
    middle = points.mean(axis=0)
    sizes, ways = np.linalg.svd(points - middle, full_matrices=False)[1:]
    if sizes[2] > _RANK * sizes[0]:
        return None
    normal = ways[2]
    return _Elementary(PLANE, middle, normal, 0.0, 0.0)


def _curve(points: Array) -> _Elementary | None:
    """The line or the circle that a curve with these control points may be."""
    middle = points.mean(axis=0)
    sizes, ways = np.linalg.svd(points - middle)[1:]
    if sizes[1:].max(initial=0.0) <= _RANK * sizes[0]:
        return _Elementary(CYLINDER, middle, ways[0], 0.0, 0.0)
    if sizes[2:].max(initial=0.0) > _RANK * sizes[0]:
        return None
    # The center is where the lines across both ends meet.
    ends, sides = points[[0, -1]], np.stack([points[1] - points[0], points[-1] - points[-2]])
    rows = np.concatenate([sides, ways[2:]])
    lengths = np.linalg.norm(rows, axis=1)
    if not lengths.min() > 0.0 or abs(float(np.linalg.det(rows / lengths[:, None]))) < 1e-6:
        return None
    center = np.linalg.solve(rows, np.append((sides * ends).sum(axis=1), ways[2] @ middle))
    return _Elementary(TORUS, center, ways[2], 0.0, float(np.linalg.norm(points[0] - center)))


@cache
def _basis(n: int) -> tuple[Array, Array]:
    """Bernstein polynomials of a degree at the samples, and their derivatives."""
    lower = bezier.bernstein(n - 1, _SAMPLES) if n else np.zeros((_SAMPLES.size, 0))
    slopes = n * (np.pad(lower, ((0, 0), (1, 0))) - np.pad(lower, ((0, 0), (0, 1))))
    return bezier.bernstein(n, _SAMPLES), slopes


def _samples(nets: Array) -> tuple[Array, Array]:
    """Points and unit normals of some patches."""
    nets = nets[:: max(1, len(nets) // _FEW)]
    (b, db), (c, dc) = _basis(nets.shape[1] - 1), _basis(nets.shape[2] - 1)
    rows, slopes = np.tensordot(nets, b, (1, 1)), np.tensordot(nets, db, (1, 1))
    s, su, sv = (np.tensordot(x, y, (1, 1)) for x, y in ((rows, c), (slopes, c), (rows, dc)))
    s, su, sv = (np.moveaxis(x, 1, -1).reshape(-1, 4) for x in (s, su, sv))
    w = s[:, 3:]
    points = s[:, :3] / w
    normals = np.cross((su[:, :3] - su[:, 3:] * points) / w, (sv[:, :3] - sv[:, 3:] * points) / w)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    keep = length[:, 0] > 1e-9 * float(length.max(initial=0.0))
    return points[keep], normals[keep] / length[keep]


def _fit(points: Array, normals: Array) -> tuple[Array, float]:
    """c and r of p = c + r n, in the least squares of any dimension."""
    count, d = points.shape
    rows = np.concatenate([np.tile(np.eye(d), (count, 1)), normals.reshape(-1, 1)], axis=1)
    solution, *_ = np.linalg.lstsq(rows, points.ravel(), rcond=None)
    return solution[:d], float(solution[d])


def _round(nets: Array) -> _Elementary | None:
    """The sphere, the cylinder or the torus that rational patches may be."""
    points, normals = _samples(nets)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    sizes, ways = np.linalg.svd(normals, full_matrices=False)[1:]
    if sizes[2] <= _RANK * sizes[0]:
        if sizes[1] <= _RANK * sizes[0]:
            return _plane(points)
        across = ways[:2]
        center, radius = _fit(points @ across.T, normals @ across.T)
        return _Elementary(CYLINDER, center @ across, ways[2], abs(radius), 0.0)
    center, radius = _fit(points, normals)
    if np.abs(center + radius * normals - points).max() <= _RANK * size:
        return _Elementary(SPHERE, center, np.array([0.0, 0.0, 1.0]), abs(radius), 0.0)
    return _torus(points, normals)


def _torus(points: Array, normals: Array) -> _Elementary | None:
    """The torus whose axis all normals meet: (p x n).a = n.(a x c) for its direction a and a point c."""
    middle = points.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    away = (points - middle) / size
    sizes, ways = np.linalg.svd(np.concatenate([np.cross(away, normals), -normals], axis=1), full_matrices=False)[1:]
    if sizes[5] > _RANK * sizes[0] or sizes[4] <= _RANK * sizes[0]:
        return None
    axis, moment = ways[5, :3], ways[5, 3:]
    length = float(np.linalg.norm(axis))
    if length < _RANK:
        return None
    axis, moment = axis / length, moment / length
    foot = middle + size * np.cross(moment, axis)
    along = (points - foot) @ axis
    beside = points - foot - along[:, None] * axis
    radii = np.linalg.norm(beside, axis=1)
    outward = (normals * beside).sum(axis=1) / radii
    center, radius = _fit(np.stack([radii, along], axis=1), np.stack([outward, normals @ axis], axis=1))
    if not center[0] > abs(radius) * (1.0 + 1e-9):
        return None
    return _Elementary(TORUS, foot + center[1] * axis, axis, abs(radius), float(center[0]))


def _times(f: Array, g: Array) -> Array:
    """Products of polynomials (n, p + 1, q + 1), coefficients times binomials."""
    result = np.zeros((f.shape[0], f.shape[1] + g.shape[1] - 1, f.shape[2] + g.shape[2] - 1))
    for i in range(g.shape[1]):
        for j in range(g.shape[2]):
            result[:, i : i + f.shape[1], j : j + f.shape[2]] += f * g[:, i : i + 1, j : j + 1]
    return result


@cache
def _binomials(m: int, n: int) -> Array:
    """Products of binomials of the degrees m - 1 and n - 1."""
    rows = [np.array([comb(size - 1, k) for k in range(size)], dtype=float) for size in (m, n)]
    return np.outer(*rows)


def _off(nets: Array, found: _Elementary, points: Array) -> float:
    """How far the patches may be from an elementary surface."""
    if found.kind == PLANE:
        return float(np.abs((points - found.center) @ found.axis).max())
    if found.kind == CYLINDER and found.radius == 0.0:
        away = points - found.center
        return float(np.linalg.norm(away - np.outer(away @ found.axis, found.axis), axis=1).max())
    scaled = nets * _binomials(*nets.shape[1:3])[..., None]
    w = scaled[..., 3]
    x = [scaled[..., c] - found.center[c] * w for c in range(3)]
    z = sum(found.axis[c] * x[c] for c in range(3))
    square = sum(_times(part, part) for part in x)
    heavy = _times(w, w)
    lightest = float(nets[..., 3].min()) ** 2
    r, major = found.radius, found.major
    if found.kind == TORUS and r == 0.0:
        value = square - major**2 * heavy
        beside = float(np.abs((points - found.center) @ found.axis).max())
        return beside + float(np.abs(value / _binomials(*value.shape[1:3])).max()) / (lightest * major)
    if found.kind == TORUS:
        # ((R - rho)^2 + z^2 - r^2) ((R + rho)^2 + z^2 - r^2), the second of which is at least R^2 - r^2.
        inner = square + (major**2 - r**2) * heavy
        value = _times(inner, inner) - 4.0 * major**2 * _times(square - _times(z, z), heavy)
        least = lightest**2 * (major**2 - r**2)
    else:
        value = square - r**2 * heavy
        least = lightest
        if found.kind == CYLINDER:
            value = value - _times(z, z)
    return float(np.abs(value / _binomials(*value.shape[1:3])).max()) / (least * r)
