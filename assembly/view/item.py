"""Things to see, where they are at each moment, and the eye that looks at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.body import Body
from assembly.view.mesh import Mesh
from assembly.view.motion import rotations
from assembly.view.outline import Lines
from assembly.view.style import Style

__all__ = ["FIELD_OF_VIEW", "Color", "Item", "Picture", "Place", "Stations", "framed"]

Array = NDArray[np.float64]
Color = tuple[float, float, float]

FIELD_OF_VIEW = 30.0  # degrees, from bottom to top
# Width over height that the picture is framed for; wider windows show more at the sides.
_ASPECT = 1.4
_MARGIN = 1.08


@dataclass(frozen=True, eq=False)
class Item:
    """One thing to see.

    Attributes
    ----------
    path : tuple of str
        Its place in the tree of things.
    mesh : Mesh
        In its own coordinates, about their origin.
    color : red, green, blue from 0 to 1
    position : (3,) or (k, 3)
        Of that origin in the picture, the same always or at each of the picture's times.
    rotation : (3, 3) or (k, 3, 3)
        From its own axes to the picture's.
    scale : (3,) or (k, 3)
        Along its own axes.
    in_front : bool
        Seen through what stands before it.
    opacity : float
        From 0 to 1.
    lines : Lines, optional
        Edges to be drawn over the mesh, in the same coordinates.
    hides : bool
        Whether it is a glyph that solids may hide, and that pages show through them where that is asked for.
    said : str
        What it is, in words, for whoever points at it.
    label : str
        Its name, where it can have one written beside it.
    """

    path: tuple[str, ...]
    mesh: Mesh
    color: Color
    position: Array
    rotation: Array = field(default_factory=lambda: np.eye(3))
    scale: Array = field(default_factory=lambda: np.ones(3))
    in_front: bool = False
    opacity: float = 1.0
    lines: Lines | None = None
    hides: bool = False
    said: str = ""
    label: str = ""

    @property
    def kind(self) -> str:
        """What it is one of: "bodies", "joints", "contacts", "targets", "ellipsoids" or "places"."""
        return self.path[0]

    @property
    def matrix(self) -> Array:
        """From its own coordinates to the picture's at the first time, (4, 4)."""
        result = np.eye(4)
        result[:3, :3] = self.rotation.reshape(-1, 3, 3)[0] * self.scale.reshape(-1, 3)[0]
        result[:3, 3] = self.position.reshape(-1, 3)[0]
        return result

    @property
    def points(self) -> Array:
        """Vertices in the picture's coordinates at the first time, (n, 3)."""
        matrix = self.matrix
        points: Array = self.mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        return points


@dataclass(frozen=True, eq=False)
class Picture:
    """Things to see, about the origin and of radius one.

    Attributes
    ----------
    items : tuple of Item
    eye : (3,)
        It looks at the origin, z upward.
    times : (k,)
        Increasing from zero, in frames of a trajectory; a single zero where nothing moves.
    scale : float
        From lengths of the scene to those of the picture.
    style : Style
    """

    items: tuple[Item, ...]
    eye: Array
    times: Array
    scale: float = 1.0
    style: Style = field(default_factory=Style)


class Stations:
    """Where bodies stand in the world at each of several times.

    Parameters
    ----------
    bodies : sequence of Body
    q : (k, n, 7)
        One row per body, at each time.
    """

    def __init__(self, bodies: Sequence[Body], q: Array) -> None:
        self._column = {id(body): b for b, body in enumerate(bodies)}
        self._positions = q[:, :, :3]
        self._rotations = rotations(q[:, :, 3:])

    @property
    def count(self) -> int:
        """How many times there are."""
        return len(self._positions)

    def rotation(self, body: Body) -> Array:
        """From the body's axes to the world's, (k, 3, 3)."""
        result: Array = self._rotations[:, self._column[id(body)]]
        return result

    def points(self, body: Body, coordinates: Array) -> Array:
        """Points (m, 3) of a body in the world, (k, m, 3); of one point (3,), (k, 3)."""
        position = self._positions[:, self._column[id(body)]]
        moved: Array = coordinates @ np.swapaxes(self.rotation(body), 1, 2)
        return moved + (position if coordinates.ndim == 1 else position[:, None])


@dataclass(frozen=True)
class Place:
    """From the world to the picture: the point (3,) that becomes the origin, then a scale."""

    middle: Array
    scale: float

    def __call__(self, points: Array) -> Array:
        """Points (..., 3) of the world in the picture."""
        return (points - self.middle) * self.scale


def framed(points: Array, direction: Array) -> tuple[Place, float]:
    """Where to place points (n, 3) so that the eye sees them filling its view; and its distance."""
    toward = direction / np.linalg.norm(direction)
    right = np.cross([0.0, 0.0, 1.0], toward)
    # Seen straight from above or below, x points to the right.
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([1.0, 0.0, 0.0])
    axes = np.column_stack([right, np.cross(toward, right), toward])
    corner = points[0]
    seen = (points - corner) @ axes
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    seen -= middle
    radius = float(np.linalg.norm(seen, axis=1).max()) or 1.0
    half = np.tan(np.deg2rad(0.5 * FIELD_OF_VIEW))
    needed = seen[:, 2] + np.maximum(np.abs(seen[:, 0]) / _ASPECT, np.abs(seen[:, 1])) / half
    # Never so near that a single point, or a flat scene, is at the camera or behind it.
    distance = max(_MARGIN * float(needed.max()) / radius, 1.2)
    return Place(corner + axes @ middle, 1.0 / radius), distance
