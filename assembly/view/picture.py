"""What there is to see in a scene: bodies, contacts, targets, and the eye that looks at them.

Everything is placed about the middle of the scene and scaled to its size, so that a scene far from the origin, or
in micrometres, looks the same in a browser that computes with single precision.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import cycle

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.constraints.objectives import PointDistance
from assembly.errors import InputError, vector
from assembly.geometry import shapes
from assembly.geometry.face import Face
from assembly.kinematics.body import Body
from assembly.proximity.pairs import ContactPair
from assembly.solve.solution import Solution
from assembly.view.mesh import Mesh, body_mesh, face_mesh, joined

__all__ = ["DIRECTION", "FIELD_OF_VIEW", "Item", "Picture", "draw"]

Array = NDArray[np.float64]
Color = tuple[float, float, float]

# From the scene to the eye: from the front, a little from the right and from above.
DIRECTION = (0.65, -1.0, 0.3)
FIELD_OF_VIEW = 30.0  # degrees, from bottom to top
# Width over height that the picture is framed for; wider windows show more at the sides.
_ASPECT = 1.4
_MARGIN = 1.08

# A body that is named after a color has it; the others take the rest of the first nine in turn.
_NAMED: dict[str, Color] = {
    "blue": (0.16, 0.42, 0.85),
    "orange": (0.95, 0.52, 0.12),
    "green": (0.15, 0.66, 0.36),
    "purple": (0.53, 0.33, 0.78),
    "red": (0.86, 0.18, 0.20),
    "cyan": (0.10, 0.66, 0.75),
    "yellow": (0.93, 0.76, 0.15),
    "pink": (0.90, 0.42, 0.65),
    "brown": (0.58, 0.38, 0.25),
    "black": (0.13, 0.14, 0.16),
    "gray": (0.55, 0.57, 0.60),
    "white": (0.93, 0.93, 0.92),
}
_PALETTE = tuple(_NAMED.values())[:9]
_GRAY = np.array([0.60, 0.62, 0.66])
_TOUCHING: Color = (1.00, 0.72, 0.10)
_PENETRATING: Color = (0.95, 0.05, 0.65)
_WISH: Color = (0.16, 0.17, 0.20)
# Radius of markers, in parts of the scene's, and the gap below which surfaces interpenetrate.
_MARK = 0.014
_PENETRATION = -1e-9


@dataclass(frozen=True, eq=False)
class Item:
    """One thing to see.

    Attributes
    ----------
    path : tuple of str
        Its place in the tree of things.
    mesh : Mesh
        In its own coordinates, about their origin.
    matrix : (4, 4)
        From these to the picture's: rotation, scale and position.
    color : red, green, blue from 0 to 1
    in_front : bool
        Seen through what stands before it.
    """

    path: tuple[str, ...]
    mesh: Mesh
    matrix: Array
    color: Color
    in_front: bool = False

    @property
    def points(self) -> Array:
        """Vertices in the picture's coordinates, (n, 3)."""
        points: Array = self.mesh.vertices @ self.matrix[:3, :3].T + self.matrix[:3, 3]
        return points


@dataclass(frozen=True, eq=False)
class Picture:
    """Things to see, about the origin and of radius one, and the eye (3,) that looks at the origin, z upward."""

    items: tuple[Item, ...]
    eye: Array


def _matrix(rotation: Array, position: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, position
    return matrix


@lru_cache(maxsize=1)
def _ball() -> Mesh:
    return face_mesh(Face(shapes.sphere(1.0)), 400)


def _rod(start: Array, end: Array, radius: float, head: float = 0.0) -> Mesh:
    """A round rod between two points; with a head, the last 2.5 radii of it are a cone of that radius."""
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    tip = min(2.5 * head, 0.5 * length)
    shaft = face_mesh(Face(shapes.cylinder(radius, length - tip)), 400)
    parts = [shaft.transformed(_matrix(np.eye(3), np.array([0.0, 0.0, 0.5 * (length - tip)])))]
    if head > 0.0:
        cone = face_mesh(Face(shapes.cone(head, tip)), 400)
        parts.append(cone.transformed(_matrix(np.eye(3), np.array([0.0, 0.0, length - 0.5 * tip]))))
    return joined(parts).transformed(_matrix(np.column_stack([across, np.cross(axis, across), axis]), start))


def _colors(bodies: Sequence[Body]) -> Iterator[Color]:
    """Colors by name, the other bodies in turn with those that no name has taken."""
    names = [body.name.strip().lower() for body in bodies]
    free = [color for color in _PALETTE if color not in [_NAMED.get(name) for name in names]]
    turns = cycle(free or _PALETTE)
    for body, name in zip(bodies, names, strict=True):
        color = np.array(_NAMED[name] if name in _NAMED else next(turns))
        red, green, blue = (0.75 * color + 0.25 * _GRAY if body.fixed else color).tolist()
        yield red, green, blue


def _contact(name: str, pair: ContactPair, place: _Place) -> Iterator[Item]:
    """A ball at each point, and the normal of the first surface as an arrow."""
    color = _PENETRATING if pair.gap * place.scale < _PENETRATION else _TOUCHING
    f, g = place(pair.points)
    for label, point in (("point", f), ("other point", g)):
        yield Item(("contacts", name, label), _ball(), _matrix(_MARK * np.eye(3), point), color, in_front=True)
    arrow = _rod(np.zeros(3), 7.0 * _MARK * pair.normal, 0.22 * _MARK, 0.7 * _MARK)
    yield Item(("contacts", name, "normal"), arrow, _matrix(np.eye(3), f), color, in_front=True)


def _wish(name: str, target: Array, point: Array) -> Iterator[Item]:
    """A cross at the target, a ball at the point that is drawn to it, and a line between them."""
    arms = 3.0 * _MARK * np.eye(3)
    cross = joined([_rod(-arm, arm, 0.3 * _MARK) for arm in arms])
    yield Item(("targets", name, "target"), cross, _matrix(np.eye(3), target), _WISH)
    yield Item(("targets", name, "point"), _ball(), _matrix(0.8 * _MARK * np.eye(3), point), _WISH)
    if np.linalg.norm(target - point) > 2.0 * _MARK:
        line = _rod(np.zeros(3), target - point, 0.25 * _MARK)
        yield Item(("targets", name, "line"), line, _matrix(np.eye(3), point), _WISH)


@dataclass(frozen=True)
class _Place:
    """From the world to the picture: the point (3,) that becomes the origin, then a scale."""

    middle: Array
    scale: float

    def __call__(self, points: Array) -> Array:
        return (points - self.middle) * self.scale


def _frame(points: Array, direction: Array) -> tuple[_Place, float]:
    """Where to place points (n, 3) so that the eye sees them filling its view; and its distance."""
    toward = direction / np.linalg.norm(direction)
    right = np.cross([0.0, 0.0, 1.0], toward)
    # Straight from above or below, x is to the right.
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([1.0, 0.0, 0.0])
    axes = np.column_stack([right, np.cross(toward, right), toward])
    corner = points[0]
    seen = (points - corner) @ axes
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    seen -= middle
    radius = float(np.linalg.norm(seen, axis=1).max()) or 1.0
    half = np.tan(np.deg2rad(0.5 * FIELD_OF_VIEW))
    needed = seen[:, 2] + np.maximum(np.abs(seen[:, 0]) / _ASPECT, np.abs(seen[:, 1])) / half
    # Not so near that a single point or a flat scene fills nothing and hides behind the eye.
    distance = max(_MARGIN * float(needed.max()) / radius, 1.2)
    return _Place(corner + axes @ middle, 1.0 / radius), distance


def draw(scene: Assembly, solution: Solution | None = None, direction: ArrayLike = DIRECTION) -> Picture:
    """Place everything there is to see.

    Parameters
    ----------
    scene : Assembly
    solution : Solution, optional
        One of this scene: bodies stand where it says, and its contacts are shown. Without one, bodies stand where
        they were made.
    direction : (3,)
        From the scene to the eye.

    Raises
    ------
    InputError, TypeError
        A scene without bodies, a solution of other bodies, or something that is neither.
    """
    if not isinstance(scene, Assembly):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    if solution is not None and not isinstance(solution, Solution):
        raise TypeError(f"solution is {solution!r}; expected a Solution, or None")
    if not scene.bodies:
        raise InputError("scene has no bodies; expected one at least")
    toward = vector("direction", direction)
    if not np.linalg.norm(toward) > 0.0:
        raise InputError(f"direction is {toward.tolist()}; expected a direction other than zero")
    poses = {body: body.pose if solution is None else solution.pose(body) for body in scene.bodies}
    meshes = {body: body_mesh(body) for body in scene.bodies}
    wishes = [
        (objective.target, poses[objective.point.body].apply(objective.point.coordinates))
        for _, objective in scene.objectives
        if isinstance(objective, PointDistance)
    ]
    points = [
        poses[body].apply(np.zeros((1, 3)) if (mesh := meshes[body]) is None else mesh.vertices)
        for body in scene.bodies
    ]
    place, distance = _frame(np.concatenate([*points, *np.reshape(wishes, (-1, 1, 3))]), toward)

    items: list[Item] = []
    for (body, mesh), color in zip(meshes.items(), _colors(scene.bodies), strict=True):
        rotation, position = poses[body].matrix[:3, :3], poses[body].position
        if mesh is None:
            items.append(Item(("bodies", body.name), _ball(), _matrix(_MARK * np.eye(3), place(position)), color))
            continue
        # About its own middle, for a shape that was drawn far from the origin of its body.
        middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
        about = Mesh(mesh.vertices - middle, mesh.normals, mesh.triangles)
        matrix = _matrix(place.scale * rotation, place(rotation @ middle + position))
        items.append(Item(("bodies", body.name), about, matrix, color))
    if solution is not None:
        for name, pair in solution.contacts.items():
            if np.isfinite(pair.points).all():
                items.extend(_contact(name, pair, place))
    for k, (target, point) in enumerate(wishes):
        items.extend(_wish(f"target {k + 1}", place(target), place(point)))
    return Picture(tuple(items), distance * toward / np.linalg.norm(toward))
