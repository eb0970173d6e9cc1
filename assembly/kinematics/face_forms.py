"""The kind of a face, and its axis, radius and center, for selections and mates."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.elementary import elementary_form, is_plane
from assembly.geometry.recognition.forms import (
    Cone,
    Cylinder,
    Extrusion,
    Form,
    Plane,
    Revolution,
    Sphere,
    Torus,
)

__all__ = ["FaceKind", "axis_of", "center_of", "form_of", "is_flat", "kind_of", "settled"]

Array = NDArray[np.float64]
FaceKind = Literal["plane", "cylinder", "cone", "sphere", "torus", "extrusion", "revolution", "spline"]
# [size of a face] What is a plane, a cylinder and so on but for this is one: those of files are off by some 1e-11.
NEARLY = 1e-10
# Components of a direction that differ by less are equal, so that rounding does not choose its sense.
_EVEN = 1e-9
_KINDS: dict[type, FaceKind] = {
    Plane: "plane",
    Cylinder: "cylinder",
    Cone: "cone",
    Sphere: "sphere",
    Torus: "torus",
    Extrusion: "extrusion",
    Revolution: "revolution",
}


def form_of(face: Face) -> Form:
    """What the surface of a face is, to 1e-10 of its size."""
    size = face.surface.size
    return elementary_form(face.surface, NEARLY * size if size > 0.0 else None)


def is_flat(face: Face) -> bool:
    """Whether the surface of a face is a plane, without asking what else it is."""
    size = face.surface.size
    return size > 0.0 and is_plane(face.surface, NEARLY * size)


def kind_of(form: Form) -> FaceKind:
    """The name of a form; "spline" for one that is none of the others."""
    return _KINDS.get(type(form), "spline")


def settled(axis: Array) -> Array:
    """A direction in the sense in which its largest component is positive, of equal ones the last of z, y, x."""
    size = np.abs(axis)
    # The last of the largest: z before y before x.
    largest = int(np.flatnonzero(size >= size.max() - _EVEN)[-1])
    return axis if axis[largest] > 0.0 else -axis


def axis_of(face: Face) -> Array | None:
    """The axis of a form that has one; of a plane and a sphere None.

    A cone's goes from its apex to where the face is. Others have no sense of their own: `settled` chooses.
    """
    form = form_of(face)
    if isinstance(form, Cone):
        return form.axis
    if isinstance(form, (Cylinder, Torus, Revolution)):
        return settled(form.axis)
    return settled(form.direction) if isinstance(form, Extrusion) else None


def center_of(face: Face) -> Array:
    """Where the frame of a face stands: on its axis beside the centroid of its area, or at its center.

    Of a plane, an extrusion and a spline it is the centroid.
    """
    form = form_of(face)
    if isinstance(form, (Sphere, Torus)):
        return form.center.copy()
    centroid = face.centroid()
    if isinstance(form, (Cylinder, Cone, Revolution)):
        point = form.apex if isinstance(form, Cone) else form.point
        return np.asarray(point + ((centroid - point) @ form.axis) * form.axis)
    if isinstance(form, Plane):
        # The centroid is known to 1e-10, the plane to rounding.
        return np.asarray(centroid - ((centroid - form.point) @ form.normal) * form.normal)
    return centroid
