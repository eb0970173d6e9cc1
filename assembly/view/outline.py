"""Edges of bodies as thin lines: the boundaries of their faces.

Neighboring faces have the same corners on the edge they share, so that it is drawn once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.meshing.border import border
from assembly.kinematics.body import Body

if TYPE_CHECKING:
    from assembly.view.mesh import Mesh

__all__ = ["ANGLE", "Lines", "body_lines", "extent", "turning"]

Array = NDArray[np.float64]
# Degrees by which boundaries, and meshes, turn from corner to corner; more where there are many faces, each small.
ANGLE = 7.5
_MANY, _COARSEST = 100, 2.0
# In parts of the extent: largest distance of a chord from its arc, and of points that count as one.
_TOLERANCE, _SAME = 1e-3, 1e-6
# The angle between chords [rad] of a boundary that is measured and not drawn.
_COARSE = 0.25 * np.pi

# A cache: chords (k, 2, 3) of the boundaries of faces, by tolerance and angle. Bodies may share faces.
_known: WeakKeyDictionary[Face, dict[tuple[float, float], Array]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Lines:
    """Straight lines between points (n, 3): segments (k, 2) of int."""

    points: Array
    segments: NDArray[np.int64]

    def about(self, point: Array) -> Lines:
        """The lines moved so that a point comes to the origin."""
        return Lines(self.points - point, self.segments)


def _chords(face: Face, tolerance: float, angle: float) -> Array:
    found = _known.setdefault(face, {})
    if (tolerance, angle) not in found:
        chords = border(face, tolerance, angle).points
        # Steps along a pole have no length.
        found[tolerance, angle] = chords[(chords[:, 0] != chords[:, 1]).any(axis=1)]
    return found[tolerance, angle]


def turning(count: int, angle: float = ANGLE) -> float:
    """Angle [rad] that meshes and boundaries of so many faces may turn from corner to corner; for few of them [deg]."""
    return float(np.deg2rad(angle * np.clip(np.sqrt(count / _MANY), 1.0, _COARSEST)))


def extent(faces: Sequence[Face]) -> float:
    """About the diagonal of the box around faces, as far as they go within their surfaces."""
    boxes = []
    for face in faces:
        # Around a closed surface, or without a loop, a face may go far beyond its boundary.
        if face.outer is None or face.outer.turn.any():
            boxes.append(np.array(face.surface.bounding_box()))
        else:
            chords = _chords(face, face.surface.size, _COARSE)
            boxes.append(np.stack([chords.min(axis=(0, 1)), chords.max(axis=(0, 1))]))
    corners = np.concatenate(boxes)
    return float(np.linalg.norm(np.ptp(corners, axis=0)))


def body_lines(body: Body, mesh: Mesh | None = None, angle: float = ANGLE) -> Lines | None:
    """Edges of a body, in body coordinates, and those within its faces that its mesh tells of.

    None for a body without edges, or drawn by a picture. Boundaries turn by the angle [deg] from corner to corner.
    """
    faces = [side.face for side in body.faces]
    if not faces or body.picture is not None:
        return None
    size = extent(faces)
    chords = [_chords(face, _TOLERANCE * size, turning(len(faces), angle)) for face in faces]
    if mesh is not None:
        chords.append(mesh.vertices[mesh.creases])
    points = np.concatenate(chords).reshape(-1, 3)
    if not len(points):
        return None
    _, first, place = np.unique(np.round(points / (_SAME * size)), axis=0, return_index=True, return_inverse=True)
    segments = np.unique(np.sort(place.reshape(-1, 2), axis=1), axis=0)
    return Lines(points[first], segments[segments[:, 0] != segments[:, 1]])
