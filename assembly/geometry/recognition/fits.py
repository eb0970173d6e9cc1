"""Which cylinder, cone, sphere or torus samples of a surface may lie on.

A first guess is made of points p and unit normals n: all normals of a cylinder are across one direction, those of a
cone have one angle with it; p = c + r n for the center c of a sphere, the axis of a cylinder, the circle of a torus;
and the normals of what is turned about an axis meet that. Then Newton's method takes the distances of the points to
their least squares, so that what is left is the rounding of points alone. Nothing is proven here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.nets import Samples

__all__ = ["Fit", "axis_of_normals", "fits", "frame_along", "loose_of", "moved", "polished", "rigid_rates"]

Array = NDArray[np.float64]
Kind = Literal["cylinder", "cone", "sphere", "torus"]
# A first guess that is farther off than this, in parts of the size, is not improved.
_LOOSE = 1e-5
# Singular values below this part of the largest one are none, in guesses and in steps of Newton's method.
_RANK, _WEAK = 1e-7, 1e-12
_STEPS = 4
_UNIT = np.finfo(float).eps


class Fit(NamedTuple):
    """A surface that samples may lie on.

    Attributes
    ----------
    kind : str
    origin : (3,)
        The center, a point of the axis, or the apex.
    axes : (3, 3)
        Rows: two unit directions across the axis, and the axis.
    shape : array
        The radius; the half angle of a cone; both radii of a torus, the larger one first.
    """

    kind: Kind
    origin: Array
    axes: Array
    shape: Array


def loose_of(tolerance: float) -> float:
    """How far off a first guess may be where so much is allowed of what it becomes."""
    return max(_LOOSE, 100.0 * tolerance)


def frame_along(axis: Array) -> Array:
    """Unit vectors, right-handed, the last one along an axis."""
    z = axis / np.linalg.norm(axis)
    x = np.zeros(3)
    x[np.argmin(np.abs(z))] = 1.0
    x -= (x @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def residuals(fit: Fit, local: Array) -> tuple[Array, Array, Array]:
    """Distances of points in the frame of a fit, their gradients (n, 3), and their rates with the shape."""
    if fit.kind == "sphere":
        far = np.linalg.norm(local, axis=1)
        return far - fit.shape[0], local / far[:, None], np.full((len(local), 1), -1.0)
    rho, z = np.hypot(local[:, 0], local[:, 1]), local[:, 2]
    out = local * [1.0, 1.0, 0.0] / rho[:, None]
    if fit.kind == "cylinder":
        return rho - fit.shape[0], out, np.full((len(local), 1), -1.0)
    if fit.kind == "cone":
        c, s = np.cos(fit.shape[0]), np.sin(fit.shape[0])
        return rho * c - z * s, out * c - [0.0, 0.0, s], -(rho * s + z * c)[:, None]
    beyond = rho - fit.shape[0]
    tube = np.hypot(beyond, z)
    gradient = out * (beyond / tube)[:, None]
    gradient[:, 2] = z / tube
    return tube - fit.shape[1], gradient, np.stack([-beyond / tube, np.full(len(z), -1.0)], axis=1)


def rigid_rates(local: Array, gradient: Array) -> Array:
    """How values with these gradients change as their frame moves and turns: (n, 6)."""
    return -np.concatenate([gradient, np.cross(local, gradient)], axis=1)


def moved(origin: Array, axes: Array, step: Array) -> tuple[Array, Array]:
    """A frame moved by the first three of six numbers and turned by the last three, all along its own axes."""
    a, b, c = step[3:6].tolist()
    turned = np.array([[1.0, c, -b], [-c, 1.0, a], [b, -a, 1.0]]) @ axes
    z = turned[2] / np.linalg.norm(turned[2])
    x = turned[0] - (turned[0] @ z) * z
    x /= np.linalg.norm(x)
    return origin + step[:3] @ axes, np.stack([x, np.cross(z, x), z])


def polished(fit: Fit, points: Array) -> tuple[Fit, float]:
    """The fit of least squares, and how far the points are from it at most."""
    best, least = fit, np.inf
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            local = (points - fit.origin) @ fit.axes.T
            off, gradient, rates = residuals(fit, local)
            worst = float(np.abs(off).max())
            if not worst < least:
                break
            best, least = fit, worst
            if worst <= 4.0 * _UNIT:
                break
            matrix = np.concatenate([rigid_rates(local, gradient), rates], axis=1)
            if not np.isfinite(matrix).all():
                break
            step = np.linalg.lstsq(matrix, -off, rcond=_WEAK)[0]
            fit = Fit(fit.kind, *moved(fit.origin, fit.axes, step), fit.shape + step[6:])
    return best, least


def _through(points: Array, normals: Array) -> tuple[Array, float]:
    """c and r of p = c + r n, in the least squares of any dimension."""
    count, d = points.shape
    rows = np.concatenate([np.tile(np.eye(d), (count, 1)), normals.reshape(-1, 1)], axis=1)
    solution = np.linalg.lstsq(rows, points.ravel(), rcond=None)[0]
    return solution[:d], float(solution[d])


def axis_of_normals(points: Array, normals: Array, loose: float) -> tuple[Array, Array] | None:
    """A point c and the direction a of an axis that all normals meet: (p x n).a = n.(a x c)."""
    sizes, ways = np.linalg.svd(np.concatenate([np.cross(points, normals), -normals], axis=1), full_matrices=False)[1:]
    if len(sizes) < 6 or sizes[5] > loose * sizes[0]:
        return None
    axis, moment = ways[5, :3], ways[5, 3:]
    length = float(np.linalg.norm(axis))
    if length < _RANK:
        return None
    axis = axis / length
    return np.cross(moment / length, axis), axis


def _cylinder(points: Array, normals: Array, ways: Array) -> Fit:
    across = ways[:2]
    center, radius = _through(points @ across.T, normals @ across.T)
    return Fit("cylinder", center @ across, frame_along(ways[2]), np.array([abs(radius)]))


def _cone(points: Array, normals: Array, loose: float) -> Fit | None:
    """The cone whose tangent planes go through one point, and whose normals have one angle with one direction."""
    mean = normals.mean(axis=0)
    sizes, ways = np.linalg.svd(normals - mean, full_matrices=False)[1:]
    sine = float(abs(mean @ ways[2]))
    if sizes[2] > loose * sizes[0] or not 0.0 < sine < 1.0:
        return None
    apex = np.linalg.lstsq(normals, (normals * points).sum(axis=1), rcond=_WEAK)[0]
    axis = ways[2] if ways[2] @ (points.mean(axis=0) - apex) > 0.0 else -ways[2]
    return Fit("cone", apex, frame_along(axis), np.array([np.arcsin(sine)]))


def _torus(points: Array, normals: Array, loose: float) -> Fit | None:
    found = axis_of_normals(points, normals, loose)
    if found is None:
        return None
    foot, axis = found
    along = (points - foot) @ axis
    beside = points - foot - along[:, None] * axis
    radii = np.linalg.norm(beside, axis=1)
    if not radii.min() > 0.0:
        return None
    outward = (normals * beside).sum(axis=1) / radii
    center, radius = _through(np.stack([radii, along], axis=1), np.stack([outward, normals @ axis], axis=1))
    return Fit("torus", foot + center[1] * axis, frame_along(axis), np.array([center[0], abs(radius)]))


def _guesses(samples: Samples, loose: float) -> Iterator[Fit | None]:
    points, normals = samples.points, samples.normals
    sizes, ways = np.linalg.svd(normals, full_matrices=False)[1:]
    if sizes[2] <= loose * sizes[0] and sizes[1] > _RANK * sizes[0]:
        yield _cylinder(points, normals, ways)
    yield _cone(points, normals, loose)
    center, radius = _through(points, normals)
    yield Fit("sphere", center, np.eye(3), np.array([abs(radius)]))
    with np.errstate(all="ignore"):
        yield _torus(points, normals, loose)


def fits(samples: Samples, tolerance: float) -> Iterator[Fit]:
    """What samples lie on to within a tolerance, one after another; cylinders come before cones."""
    loose = loose_of(tolerance)
    for guess in _guesses(samples, loose):
        if guess is None or not np.isfinite(guess.shape).all():
            continue
        with np.errstate(all="ignore"):
            first = np.abs(residuals(guess, (samples.points - guess.origin) @ guess.axes.T)[0]).max()
        if first <= loose:
            fit, off = polished(guess, samples.points)
            if off <= tolerance:
                yield fit
