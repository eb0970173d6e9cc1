"""Faces that lie on a cylinder, a ball or a torus, and discs: exact hulls, and bores of walls from inside.

|S - c|^2 - r^2 = N / w^2 is rational. N is made as a Bezier net, whose points bound it; on an exact cylinder or ball
they vanish but for rounding. A torus is (|x|^2 + R^2 - r^2)^2 = 4 R^2 (|x|^2 - z^2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.splines import bezier
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.bvh.normal_nets import bezier_product

__all__ = ["Round", "round_holes", "round_of", "round_parts"]

Array = NDArray[np.float64]
# How far off a face may be from what it is recognized as, in parts of its size. Bounds are those of the face itself.
EXACT = 1e-12
# The same of cylinders, balls and circles, some of which files have to 1e-11.
NEARLY = 1e-10
# The same of holes, whose boundaries files may have as curves through points of circles.
HOLE = 1e-4
# A face around less of a cylinder than about half is no round body: both extents across the axis, over the radius.
HALF = 0.95
# A ball of more than this part of a face's size is no ball that the face goes around.
LARGEST_BALL = 0.7
ROUNDED_UP = 1.0 + 1e-15


@dataclass(frozen=True, eq=False)
class Round:
    """What a face lies on.

    Attributes
    ----------
    center, axis : (3,)
        Of a ball the axis is zero.
    half : float
        Half the length of a cylinder.
    radius : float
        From outside: of the cylinder, the ball, or the tube of a torus, not less than that of the face. From inside:
        not more.
    ring : float
        Of a torus, the radius of the circle of its middles; else 0.
    outward : bool
        Whether the body is within.
    """

    center: Array
    axis: Array
    half: float
    radius: float
    ring: float
    outward: bool


def _squares(pieces: Array, center: Array, project: Array) -> tuple[float, float]:
    """Bounds of |P (S - c)|^2, from below and above, over Bezier pieces (n, p + 1, q + 1, 4)."""
    w = pieces[..., 3:]
    a = (pieces[..., :3] - center * w) @ project
    # N / w^2 is a mean of the quotients of the points, with the positive weights of w^2.
    ratio = bezier_product(a, a).sum(axis=-1, keepdims=True) / bezier_product(w, w)
    return float(ratio.min()), float(ratio.max())


def _is_outward(face: Face, center: Array, project: Array) -> bool:
    (u0, u1), (v0, v1) = face.surface.domain
    u, v = u0 + 0.37 * (u1 - u0), v0 + 0.41 * (v1 - v0)
    away = project @ (np.ravel(face.surface.evaluate(u, v)) - center)
    return float(np.dot(np.ravel(face.normal(u, v)), away)) > 0.0


def _sphere(points: Array) -> tuple[Array, float]:
    """Center and radius of the ball, or the circle, through points, by least squares: 2 c.x + (r^2 - c.c) = x.x."""
    middle = points.mean(axis=0)
    q = points - middle
    solved = np.linalg.lstsq(np.column_stack([2.0 * q, np.ones(len(q))]), (q**2).sum(axis=1), rcond=None)[0]
    center = solved[:-1]
    return center + middle, float(np.sqrt(max(solved[-1] + center @ center, 0.0)))


def _radius(bounds: tuple[float, float], outward: bool, far: float) -> float:
    """A radius that the face is within, or beyond, with what rounding may do to coordinates."""
    rounding = 8e-16 * far
    if outward:
        return float(np.sqrt(bounds[1]) * ROUNDED_UP + rounding)
    return float(np.sqrt(max(bounds[0], 0.0)) / ROUNDED_UP - rounding)


def _ball(face: Face, points: Array, pieces: Array, size: float) -> Round | None:
    center, radius = _sphere(points)
    off = np.abs(np.linalg.norm(points - center, axis=1) - radius).max()
    if not 0.0 < radius < LARGEST_BALL * size or off > NEARLY * size:
        return None
    bounds = _squares(pieces, center, np.eye(3))
    if max(np.sqrt(bounds[1]) - radius, radius - np.sqrt(max(bounds[0], 0.0))) > NEARLY * size:
        return None
    outward = _is_outward(face, center, np.eye(3))
    far = float(np.abs(points).max())
    return Round(center, np.zeros(3), 0.0, _radius(bounds, outward, far), 0.0, outward)


def _cylinder(face: Face, points: Array, pieces: Array, size: float) -> Round | None:
    """A face with rulings in one of the parameters' directions."""
    for d in range(2):
        if face.surface.degree[d] != 1:
            continue
        net = np.swapaxes(pieces, 1, 2) if d == 0 else pieces
        ends = net[..., :3] / net[..., 3:]
        ways = (ends[:, :, -1] - ends[:, :, 0]).reshape(-1, 3)
        length = float(np.linalg.norm(ways[0]))
        axis = ways[0] / length if length > 0.0 else np.zeros(3)
        if length == 0.0 or np.abs(ways - (ways @ axis)[:, None] * axis).max() > EXACT * size:
            continue
        project = np.eye(3) - np.outer(axis, axis)
        basis = np.linalg.svd(project)[0][:, :2]
        flat = points @ basis
        middle, radius = _sphere(flat)
        center = basis @ middle
        off = np.abs(np.linalg.norm((points - center) @ project, axis=1) - radius).max()
        if off > NEARLY * size or not radius > 0.0:
            continue
        bounds = _squares(pieces, center, project)
        if max(np.sqrt(bounds[1]) - radius, radius - np.sqrt(max(bounds[0], 0.0))) > NEARLY * size:
            continue
        outward = _is_outward(face, center, project)
        if outward and np.ptp(flat, axis=0).min() < HALF * radius:
            continue
        along = (ends.reshape(-1, 3) - center) @ axis
        center = center + 0.5 * (along.min() + along.max()) * axis
        far = float(np.abs(points).max())
        half = float(0.5 * np.ptp(along)) * ROUNDED_UP + 8e-16 * far
        return Round(center, axis, half, _radius(bounds, outward, far), 0.0, outward)
    return None


def _torus(face: Face, pieces: Array, size: float) -> Round | None:
    """The hull of a torus that a closed surface lies on."""
    if not all(face.surface.closed):
        return None
    u, v = (np.linspace(*ends, 33)[:-1] for ends in face.surface.domain)
    grid = face.surface.evaluate(u[:, None], v[None, :])
    for way in (0, 1):
        middles = grid.mean(axis=1 - way)
        center = middles.mean(axis=0)
        _, spread, axes = np.linalg.svd(middles - center)
        if spread[2] > 1e-9 * size:
            continue
        # Samples of equal parameters are not of equal angles: the radii come from heights and distances of the points.
        q = grid.reshape(-1, 3) - center
        z = q @ axes[2]
        across = np.linalg.norm(q - z[:, None] * axes[2], axis=1)
        design = np.column_stack([2.0 * across, np.ones(len(z))])
        ring, rest = np.linalg.lstsq(design, across**2 + z**2, rcond=None)[0].tolist()
        tube = float(np.sqrt(max(rest + ring**2, 0.0)))
        if not 0.0 < tube < ring or np.abs(np.hypot(across - ring, z) - tube).max() > 10.0 * EXACT * size:
            continue
        more = _beyond_torus(pieces, center, axes[2], (ring, tube))
        if more < 10.0 * EXACT * size:
            radius = (tube + more) * ROUNDED_UP + 8e-16 * float(np.abs(grid).max())
            return Round(center, axes[2], 0.0, radius, float(ring), True)
    return None


def _beyond_torus(pieces: Array, center: Array, axis: Array, radii: tuple[float, float]) -> float:
    """How far a surface may be outside of a torus.

    The left side of its equation less the right one grows by 8 R^2 r a length from the tube, and by more farther out.
    """
    ring, tube = radii
    w = pieces[..., 3:]
    a = pieces[..., :3] - center * w
    square = bezier_product(a, a).sum(axis=-1, keepdims=True)
    height = a @ axis[:, None]
    ww, hh = bezier_product(w, w), bezier_product(height, height)
    left = square + (ring**2 - tube**2) * ww
    top = bezier_product(left, left) - 4.0 * ring**2 * bezier_product(square - hh, ww)
    return max(float((top / bezier_product(ww, ww)).max()), 0.0) / (4.0 * ring**2 * tube)


def _affine_plane(face: Face) -> tuple[Array, Array, Array] | None:
    """Of a flat face whose surface is an affine map of (u, v): where (0, 0) is, and its derivatives."""
    net = face.surface.control_points
    if net.shape != (2, 2, 3) or np.ptp(face.surface.weights) > 0.0 or face.outer is None:
        return None
    (u0, u1), (v0, v1) = face.surface.domain
    along, across = (net[1, 0] - net[0, 0]) / (u1 - u0), (net[0, 1] - net[0, 0]) / (v1 - v0)
    if np.abs(net[1, 1] - net[1, 0] - net[0, 1] + net[0, 0]).max() > EXACT * float(np.abs(net).max()):
        return None
    return net[0, 0] - u0 * along - v0 * across, along, across


def _circle(face: Face, chain: range, plane: tuple[Array, Array, Array], outward: bool) -> Round | None:
    """The circle that a loop of a flat face is, as a cylinder without length."""
    origin, along, across = plane
    axis = np.cross(along, across)
    axis /= np.linalg.norm(axis)
    pieces, points = [], []
    for curve in (face.boundary[k] for k in chain):
        bezier = curve.bezier_pieces()
        w = bezier[..., -1:]
        space = origin * w + bezier[..., :1] * along + bezier[..., 1:2] * across
        pieces.append(np.concatenate([space, w], axis=-1)[:, :, None])
        uv = curve.evaluate(np.linspace(*curve.domain, 9))
        points.append(origin + uv[:, :1] * along + uv[:, 1:] * across)
    samples = np.concatenate(points)
    basis = np.linalg.svd(np.eye(3) - np.outer(axis, axis))[0][:, :2]
    middle, radius = _sphere(samples @ basis)
    x, y = (samples @ basis - middle).T
    # A slot along an arc does not go around its center.
    if abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())) < 4.0 * radius**2:
        return None
    center = basis @ middle + (samples[0] @ axis) * axis
    off = (NEARLY if outward else HOLE) * float(np.linalg.norm(np.ptp(samples, axis=0)))
    if not radius > 0.0 or np.abs(np.linalg.norm(samples - center, axis=1) - radius).max() > off:
        return None
    bounds = [_squares(part, center, np.eye(3)) for part in pieces]
    least, most = min(low for low, _ in bounds), max(high for _, high in bounds)
    if max(np.sqrt(most) - radius, radius - np.sqrt(max(least, 0.0))) > off:
        return None
    far = float(np.abs(face.surface.control_points).max())
    return Round(center, axis, 8e-16 * far + EXACT * far, _radius((least, most), outward, far), 0.0, outward)


def _disc(face: Face) -> Round | None:
    """A flat face whose outer boundary is a circle."""
    plane = _affine_plane(face)
    return None if plane is None else _circle(face, face.chains[0], plane, True)


def round_holes(face: Face) -> list[Round]:
    """The round holes of a flat face: all of it is outside of the cylinders that these bound."""
    plane = _affine_plane(face)
    found = [] if plane is None else [_circle(face, chain, plane, False) for chain in face.chains[1:]]
    return [hole for hole in found if hole is not None]


def round_of(face: Face) -> Round | None:
    """What a face lies on, or None where that is no cylinder, ball or torus, and the face no disc."""
    surface = face.surface
    if max(surface.degree) < 2:
        return _disc(face)
    u, v = (np.linspace(*ends, 9) for ends in surface.domain)
    points = surface.evaluate(u[:, None], v[None, :]).reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    pieces = surface.bezier_pieces().reshape(-1, surface.degree[0] + 1, surface.degree[1] + 1, 4)
    found = _ball(face, points, pieces, size) or _cylinder(face, points, pieces, size)
    if found is None:
        found = _torus(face, pieces, size)
        if found is not None and not _is_outward_of_tube(face, found):
            return None
    return found


def _is_outward_of_tube(face: Face, found: Round) -> bool:
    (u0, u1), (v0, v1) = face.surface.domain
    u, v = u0 + 0.37 * (u1 - u0), v0 + 0.41 * (v1 - v0)
    q = np.ravel(face.surface.evaluate(u, v)) - found.center
    across = q - (q @ found.axis) * found.axis
    middle = found.ring * across / np.linalg.norm(across)
    return float(np.dot(np.ravel(face.normal(u, v)), q - middle)) > 0.0


def _strip(surface: NurbsSurface, direction: int, k: int) -> NurbsSurface:
    """Span k of a surface in one direction, and all of the other."""
    pieces, at = surface.bezier_pieces(), list(surface.breaks())
    part = slice(k, k + 1)
    pieces = pieces[part] if direction == 0 else pieces[:, part]
    at[direction] = at[direction][k : k + 2]
    # Joined along u, then along v.
    along_u = np.stack([bezier.joined(pieces[:, j]) for j in range(pieces.shape[1])])
    points = bezier.joined(np.moveaxis(along_u, 1, 2)).swapaxes(0, 1)
    knots = [bezier.full_knots(ends, degree) for ends, degree in zip(at, surface.degree, strict=True)]
    return NurbsSurface(points[..., :3] / points[..., 3:], knots, surface.degree, points[..., 3])


def round_parts(face: Face) -> tuple[int, list[Round | None]]:
    """What the spans of a face without a boundary lie on: the direction of the spans, and one entry a span.

    A wire with half balls on its ends is one face; its spans along it are exact. One entry where the whole face is.
    """
    whole = round_of(face)
    if whole is not None or face.boundary:
        return 0, [whole]
    for d in (0, 1):
        spans = len(face.surface.breaks()[d]) - 1
        if spans > 1:
            parts = [round_of(Face(_strip(face.surface, d, k), reversed=face.reversed)) for k in range(spans)]
            if any(part is not None for part in parts):
                return d, parts
    return 0, [None]
