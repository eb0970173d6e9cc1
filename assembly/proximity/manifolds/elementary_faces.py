"""The faces of a body that are planes, cylinders, cones, spheres or tori, and which way each looks; found once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.forms import Cone, Cylinder, Form, Plane, Sphere, Torus
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["NEARLY", "ElementaryFace", "elementary_faces", "nearly_elementary"]

Array = NDArray[np.float64]
# [size of a face] Cylinders, balls and circles of files are off by some 1e-11; what they are off by is in their radii.
NEARLY = 1e-10


@dataclass(frozen=True, eq=False)
class ElementaryFace(ReadOnlyArrays):
    """A face that lies on an elementary surface.

    Attributes
    ----------
    form : Plane, Cylinder, Cone, Sphere or Torus
        What its surface is, in the axes of the body.
    is_outward : bool
        Whether its outward normal points away from the axis or center; of a plane, along `form.normal`.
    box : (2, 3)
        Its surface's least and largest coordinates.
    """

    form: Plane | Cylinder | Cone | Sphere | Torus
    is_outward: bool
    box: Array


@lru_cache(maxsize=128)
def elementary_faces(faces: tuple[Face, ...]) -> tuple[ElementaryFace, ...]:
    """Those of a body's faces that lie on elementary surfaces."""
    found = []
    for face in faces:
        form = nearly_elementary(face.surface)
        if isinstance(form, Plane | Cylinder | Cone | Sphere | Torus):
            is_outward = (face.sign > 0) == (isinstance(form, Plane) or form.outward)
            found.append(ElementaryFace(form, is_outward, np.array(face.surface.bounding_box())))
    return tuple(found)


def nearly_elementary(surface: NurbsSurface) -> Form:
    """What a surface is exactly if that is elementary, else what it is to within `NEARLY` of its size."""
    exact = elementary_form(surface)
    if isinstance(exact, Plane | Cylinder | Cone | Sphere | Torus):
        return exact
    return elementary_form(surface, NEARLY * surface.size)
