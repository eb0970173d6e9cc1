"""Whether a body is made of boxes, cylinders and balls, told by its faces and their volumes."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.forms import Cylinder, Plane, Sphere
from assembly.kinematics.body import Body
from assembly.proximity.features.mass import mass_properties
from assembly.proximity.features.places import shells_of

__all__ = ["Primitive", "primitives_of"]

Array = NDArray[np.float64]
# Lengths of a primitive and directions that are equal, in parts.
_EQUAL = 1e-9


@dataclass(frozen=True, eq=False)
class Primitive(ReadOnlyArrays):
    """A box, a cylinder along its z axis, or a ball.

    Attributes
    ----------
    kind : str
        "box", "cylinder" or "sphere".
    lengths : tuple of float
        The three sides, radius and length, or the radius.
    center : (3,)
    axes : (3, 3)
        Its axes as columns, in body coordinates.
    """

    kind: str
    lengths: tuple[float, ...]
    center: Array
    axes: Array


def primitives_of(body: Body) -> list[Primitive] | None:
    """The primitives of which a body is made, one a piece; None for another one, and for one that encloses nothing."""
    faces = tuple(side.face for side in body.faces)
    found = []
    for piece in shells_of(faces):
        primitive = _primitive_of(body.name, piece)
        if primitive is None:
            return None
        found.append(primitive)
    return found


def _primitive_of(name: str, faces: tuple[Face, ...]) -> Primitive | None:
    try:
        volume = mass_properties(name, faces, 1.0).volume
    except InputError:
        return None
    forms = [elementary_form(face.surface) for face in faces]
    planes = [form for form in forms if isinstance(form, Plane)]
    cylinders = [form for form in forms if isinstance(form, Cylinder)]
    found = None
    if len(forms) == len(planes) == 6:
        found = _box(planes)
    elif len(planes) == 2 and cylinders and len(forms) == 2 + len(cylinders):
        found = _cylinder(planes, cylinders)
    elif len(forms) == 1 and isinstance(forms[0], Sphere):
        found = Primitive("sphere", (forms[0].radius,), forms[0].center, np.eye(3))
    # Faces of such forms bound nothing else of this volume.
    return found if found is not None and abs(_volume(found) - volume) <= _EQUAL * volume else None


def _volume(primitive: Primitive) -> float:
    if primitive.kind == "box":
        return float(np.prod(primitive.lengths))
    if primitive.kind == "cylinder":
        return pi * primitive.lengths[0] ** 2 * primitive.lengths[1]
    return 4.0 / 3.0 * pi * primitive.lengths[0] ** 3


def _box(planes: list[Plane]) -> Primitive | None:
    """Three pairs of parallel planes at right angles."""
    axes, sides, middles, left = [], [], [], list(planes)
    while left:
        first = left.pop(0)
        others = [plane for plane in left if np.linalg.norm(np.cross(plane.normal, first.normal)) < _EQUAL]
        if len(others) != 1:
            return None
        left = [plane for plane in left if plane is not others[0]]
        low, high = sorted((float(first.normal @ first.point), float(first.normal @ others[0].point)))
        axes.append(first.normal)
        sides.append(high - low)
        middles.append(0.5 * (low + high))
    frame = np.column_stack(axes)
    if np.abs(frame.T @ frame - np.eye(3)).max() > _EQUAL:
        return None
    center = frame @ np.array(middles)
    if np.linalg.det(frame) < 0.0:
        frame[:, 2] *= -1.0
    return Primitive("box", tuple(sides), center, frame)


def _cylinder(planes: list[Plane], cylinders: list[Cylinder]) -> Primitive | None:
    """Walls of one cylinder between two planes across its axis."""
    first = cylinders[0]
    size = first.radius
    for wall in cylinders:
        apart = wall.point - first.point
        across = apart - (apart @ first.axis) * first.axis
        is_same = abs(wall.radius - size) <= _EQUAL * size and np.linalg.norm(across) <= _EQUAL * size
        if not is_same or not wall.outward or np.linalg.norm(np.cross(wall.axis, first.axis)) > _EQUAL:
            return None
    if any(np.linalg.norm(np.cross(plane.normal, first.axis)) > _EQUAL for plane in planes):
        return None
    low, high = sorted(float(first.axis @ (plane.point - first.point)) for plane in planes)
    across = np.eye(3)[np.argmin(np.abs(first.axis))]
    side = np.cross(across, first.axis)
    side /= np.linalg.norm(side)
    axes = np.column_stack([side, np.cross(first.axis, side), first.axis])
    return Primitive("cylinder", (size, high - low), first.point + 0.5 * (low + high) * first.axis, axes)
