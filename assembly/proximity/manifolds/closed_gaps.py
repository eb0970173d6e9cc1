"""Rows of all manifolds of two bodies whose gaps are closed: every way in which the bodies hold each other there.

Beside planes, lines, shafts and cones these are balls in their sockets: a ball of the socket's radius touches it in all
directions that both faces have; and balls in hollow cones and on rims of bores, along a circle. What conforms only in
part of a wall, as a shaft in half a bore, has rows of its planes and lines, and none all around.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cone, Cylinder, Sphere
from assembly.proximity.manifolds.ball_manifolds import touched_circles
from assembly.proximity.manifolds.elementary_faces import ElementaryFace, elementary_faces
from assembly.proximity.manifolds.flat_manifolds import flat_manifolds
from assembly.proximity.manifolds.line_manifolds import line_manifolds
from assembly.proximity.manifolds.manifold import Manifold
from assembly.proximity.manifolds.round_manifolds import round_manifolds

__all__ = ["closed_gaps", "wall_manifolds", "walls"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]
# Directions of a ball, along each parameter of its face.
DIRECTIONS = 9
# Directions about the axis of a wall in which a ball may touch it.
AROUND = 12
# What is as near to a surface, in parts of its radius, is on it; so many steps of Newton's method lead there.
ON_FACE, STEPS = 1e-8, 6
# A surface that goes all around does to within so much [rad].
ALL_AROUND = 1e-9


def closed_gaps(
    shapes: tuple[Faces, Faces], turn: Array, shift: Array, within: tuple[float, float]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Normals and places (m, 3) of all rows of two bodies whose manifolds are between two gaps, in the first's axes.

    And which of the rows (m,) are of flat faces that lie on each other.

    Parameters
    ----------
    shapes : (tuple of Face, tuple of Face)
        Of both bodies.
    turn, shift : (3, 3), (3,)
        The second body is at x -> turn x + shift, seen from the first.
    within : (float, float)
    """
    flat = flat_manifolds(shapes, turn, shift, within)
    found = [
        *flat,
        *line_manifolds(shapes, turn, shift, within),
        *wall_manifolds(shapes, turn, shift, within),
    ]
    balls = [_balls(shapes, turn, shift, within), *_seats(shapes, turn, shift, within)]
    normals = np.concatenate([*(manifold.normals for _, manifold in found), *(rows[0] for rows in balls)])
    places = np.concatenate([*(manifold.places for _, manifold in found), *(rows[1] for rows in balls)])
    return normals, places, np.arange(len(normals)) < sum(len(manifold.gaps) for _, manifold in flat)


def wall_manifolds(
    shapes: tuple[Faces, Faces], turn: Array, shift: Array, within: tuple[float, float]
) -> list[tuple[tuple[int, int], Manifold]]:
    """Manifolds of walls that are whole, of both bodies; only walls that fit are asked for that."""
    (faces, ones), (others, twos) = map(walls, shapes)
    found = round_manifolds((ones, twos), turn, shift, within)
    return [((i, j), manifold) for (i, j), manifold in found if _is_whole(faces[i]) and _is_whole(others[j])]


@lru_cache(maxsize=256)
def walls(faces: Faces) -> tuple[Faces, tuple[ElementaryFace, ...]]:
    """The cylinders and cones among a body's faces that go all around."""
    found = [
        (face, one)
        for face in faces
        for one in elementary_faces((face,))
        if isinstance(one.form, Cylinder | Cone) and one.form.turn.angle > 2.0 * np.pi - ALL_AROUND
    ]
    return tuple(face for face, _ in found), tuple(one for _, one in found)


@lru_cache(maxsize=1024)
def _is_whole(face: Face) -> bool:
    """Whether a face has all of its surface, as far as points all over it tell."""
    return bool(face.contains(*_grid(face)).all())


@lru_cache(maxsize=256)
def _spheres(faces: Faces) -> tuple[tuple[Face, Sphere, bool], ...]:
    """The spheres among a body's faces: face, form, whether it is a ball."""
    return tuple(
        (face, one.form, one.is_outward)
        for face in faces
        for one in elementary_faces((face,))
        if isinstance(one.form, Sphere)
    )


def _grid(face: Face) -> tuple[Array, Array]:
    """Parameters all over a surface, in the middles of parts of it, (k,) each."""
    parts = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    (u0, u1), (v0, v1) = face.surface.domain
    u, v = np.meshgrid(u0 + (u1 - u0) * parts, v0 + (v1 - v0) * parts, indexing="ij")
    return u.ravel(), v.ravel()


@lru_cache(maxsize=256)
def _points(face: Face) -> Array:
    """Points of a face, all over it."""
    u, v = _grid(face)
    inside = face.contains(u, v)
    return np.asarray(face.surface.evaluate(u[inside], v[inside]))


def _has(face: Face, points: Array, size: float) -> NDArray[np.bool_]:
    """Which points near a surface are on its face, to within a part of a size, by steps of Newton's method."""
    u, v = _grid(face)
    known = np.asarray(face.surface.evaluate(u, v))
    nearest = np.linalg.norm(points[:, None] - known[None], axis=2).argmin(axis=1)
    u, v = u[nearest], v[nearest]
    (u0, u1), (v0, v1) = face.surface.domain
    for _ in range(STEPS):
        at, along_u, along_v = face.surface.evaluate(u, v, 1)
        # In parts of the domain: its two sides may be of any size, and singular values are cut by their ratio.
        slopes = np.stack([(u1 - u0) * along_u, (v1 - v0) * along_v], axis=2)
        step = np.einsum("kij,kj->ki", np.linalg.pinv(slopes), points - at)
        u, v = np.clip(u + (u1 - u0) * step[:, 0], u0, u1), np.clip(v + (v1 - v0) * step[:, 1], v0, v1)
    off = np.linalg.norm(points - face.surface.evaluate(u, v), axis=1)
    return np.asarray((off <= ON_FACE * size) & face.contains(u, v))


def _balls(shapes: tuple[Faces, Faces], turn: Array, shift: Array, within: tuple[float, float]) -> tuple[Array, Array]:
    """Normals and places (m, 3) of balls in sockets of their radius, or but for gaps."""
    low, high = within
    normals, places = [np.empty((0, 3))], [np.empty((0, 3))]
    for one, form, is_ball in _spheres(shapes[0]):
        for other, second, is_second_ball in _spheres(shapes[1]):
            off = turn @ second.center + shift - form.center
            play = (second.radius - form.radius) if is_ball else (form.radius - second.radius)
            most, least = play + float(np.linalg.norm(off)), play - float(np.linalg.norm(off))
            if is_ball == is_second_ball or least < low or most > high:
                continue
            points = _points(one)
            out = (points - form.center) / form.radius
            on_second = (form.center + off + second.radius * out - shift) @ turn
            kept = _has(other, on_second, second.radius)
            normals.append(out[kept] if is_ball else -out[kept])
            places.append(points[kept])
    return np.concatenate(normals), np.concatenate(places)


@lru_cache(maxsize=256)
def _hollow_walls(faces: Faces) -> tuple[Cylinder | Cone, ...]:
    """The bores and hollow cones among a body's faces that are whole."""
    found = zip(*walls(faces), strict=True)
    return tuple(
        one.form
        for face, one in found
        if isinstance(one.form, Cylinder | Cone) and not one.is_outward and _is_whole(face)
    )


def _seats(
    shapes: tuple[Faces, Faces], turn: Array, shift: Array, within: tuple[float, float]
) -> Iterator[tuple[Array, Array]]:
    """Normals and places (m, 3) of balls in hollow walls, where they touch these or their rims all around."""
    low, high = within
    for k in range(2):
        for wall in _hollow_walls(shapes[k]):
            for face, ball, is_ball in _spheres(shapes[1 - k]):
                center = turn @ ball.center + shift if k == 0 else (ball.center - shift) @ turn
                for points, normals in touched_circles(wall, center, AROUND) if is_ball else ():
                    gaps = np.einsum("ij,ij->i", center - points, normals) - ball.radius
                    if not (low <= gaps.min() and gaps.max() <= high):
                        continue
                    places = center - ball.radius * normals
                    own = (places - shift) @ turn if k == 0 else places @ turn.T + shift
                    kept = _has(face, own, ball.radius)
                    yield (normals[kept], places[kept]) if k == 0 else (-normals[kept] @ turn.T, own[kept])
