"""What keeps bodies apart for certain before any search: boxes around faces, and planes between bodies.

A face is within the hull of its control points, so that whatever holds of these holds of it. Of a flat face, whose
surface may go on beyond it, it is the control points of its boundary curves.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.contact import side_faces
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.brep.solid import solid_of

__all__ = ["Posed", "boxes_apart", "plane_between"]

Array = NDArray[np.float64]
# What rounding may make of a point, in parts of the largest coordinate.
ROUNDING = 1e-14
# Points of a body that are taken along each of its boundary curves, and along either parameter of a closed face.
ALONG = 4


def flat_map(face: Face) -> tuple[Array, Array] | None:
    """Of a face whose surface is an affine map of (u, v): where (0, 0) is (3,), and its derivatives (2, 3)."""
    surface = face.surface
    net = surface.control_points
    if net.shape != (2, 2, 3) or not face.boundary or np.ptp(surface.weights) != 0.0:
        return None
    (low_u, high_u), (low_v, high_v) = surface.domain
    across, along = net[1, 0] - net[0, 0], net[0, 1] - net[0, 0]
    if np.abs(net[1, 1] - net[0, 0] - across - along).max() > ROUNDING * np.abs(net).max():
        return None
    rates = np.stack([across / (high_u - low_u), along / (high_v - low_v)])
    return net[0, 0] - np.array([low_u, low_v]) @ rates, rates


def hull_of(face: Face) -> Array:
    """Points (n, 3) in whose hull a face is."""
    affine = flat_map(face)
    if affine is None:
        return face.surface.control_points.reshape(-1, 3)
    origin, rates = affine
    hull: Array = origin + np.concatenate([curve.control_points for curve in face.boundary]) @ rates
    return hull


@dataclass(frozen=True, eq=False)
class Posed:
    """A body where it stands, and what of it is needed again for every pair.

    Attributes
    ----------
    body : Body
    row : (7,)
        Its pose.
    """

    body: Body
    row: Array = field(repr=False)

    @cached_property
    def faces(self) -> tuple[Face, ...]:
        """Its faces."""
        return side_faces(self.body)

    @cached_property
    def rotation(self) -> Array:
        """From its axes to the world's, (3, 3)."""
        return rotation_matrix(self.row[3:])

    def placed(self, points: Array) -> Array:
        """Points (n, 3) of the body in the world."""
        moved: Array = points @ self.rotation.T + self.row[:3]
        return moved

    @cached_property
    def nets(self) -> tuple[Array, ...]:
        """Points in the world in whose hulls the faces are."""
        return tuple(self.placed(hull_of(face)) for face in self.faces)

    @cached_property
    def rounding(self) -> float:
        """By how much those may be off where they stand."""
        return ROUNDING * max(float(np.abs(net).max()) for net in self.nets)

    @cached_property
    def boxes(self) -> Array:
        """Boxes around all faces along the world's axes, lower and upper corners (2, n, 3)."""
        low = np.array([net.min(axis=0) for net in self.nets]) - self.rounding
        return np.stack([low, np.array([net.max(axis=0) for net in self.nets]) + self.rounding])

    @cached_property
    def box(self) -> Array:
        """The box around the body, (2, 3)."""
        return np.stack([self.boxes[0].min(axis=0), self.boxes[1].max(axis=0)])

    @cached_property
    def is_closed(self) -> bool:
        """Whether it has an inside: no edge is one face's alone."""
        return all(edge.face_b is not None for edge in solid_of(self.faces).edges)

    @cached_property
    def samples(self) -> Array:
        """Some points of the body's surface in the world, (n, 3)."""
        found: list[Array] = []
        part = (np.arange(ALONG) + 0.5) / ALONG
        for face in self.faces:
            for curve in face.boundary:
                low, high = curve.domain
                at = curve.evaluate(low + (high - low) * part)
                found.append(face.surface.evaluate(at[:, 0], at[:, 1]))
            if not face.boundary:
                (low_u, high_u), (low_v, high_v) = face.surface.domain
                u, v = np.meshgrid(low_u + (high_u - low_u) * part, low_v + (high_v - low_v) * part)
                found.append(face.surface.evaluate(u.ravel(), v.ravel()))
        return self.placed(np.concatenate(found))

    @cached_property
    def own_box(self) -> Array:
        """The box around the body along its own axes, (2, 3)."""
        points = np.concatenate([hull_of(face) for face in self.faces])
        return np.stack([points.min(axis=0) - self.rounding, points.max(axis=0) + self.rounding])

    def may_enclose(self, other: Posed) -> bool:
        """Whether the other body may be inside of this one, by the box along this one's axes."""
        points = (other.samples - self.row[:3]) @ self.rotation
        return bool(((self.own_box[0] <= points) & (points <= self.own_box[1])).all())


def boxes_apart(a: Posed, b: Posed) -> float:
    """No face of one body is nearer than this to any of the other one, by the boxes around them."""
    between = np.maximum(a.boxes[0][:, None] - b.boxes[1][None], b.boxes[0][None] - a.boxes[1][:, None])
    return float(np.linalg.norm(np.maximum(between, 0.0), axis=2).min()) * (1.0 - ROUNDING)


def plane_between(a: Posed, b: Posed, normal: Array) -> float:
    """How far apart two bodies are along a normal from a to b, but for rounding; negative where they pass each other.

    Positive, no two points are nearer than this. Negative, no point of one is deeper in the other than that: moved by
    so much along the normal the bodies have no point in common.
    """
    length = float(np.linalg.norm(normal))
    if not length > 0.5:
        return -np.inf
    upper = max(float((net @ normal).max()) for net in a.nets)
    lower = min(float((net @ normal).min()) for net in b.nets)
    return (lower - upper) / length
