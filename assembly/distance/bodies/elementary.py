"""Faces that are spheres, cylinders, tori or planes, and boundary curves that are lines or circles, as SPINEs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.distance.bodies.patch_blocks import PatchBlock
from assembly.distance.bodies.records import NONE, SPINE_SIZE, spine_at
from assembly.distance.bodies.spines import CYLINDER, PLANE, SPHERE, TORUS
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.curves import Circle, Line, curve_form
from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.fits import loose_of
from assembly.geometry.recognition.forms import Cylinder, Form, Freeform, Plane, Sphere, Torus
from assembly.geometry.recognition.nets import exactness, has_no_motion
from assembly.geometry.splines.bezier_pieces import UNIT

__all__ = ["spine_row"]

Array = NDArray[np.float64]
_ROUNDED_UP = 1.0 + 8.0 * UNIT


def spine_row(block: PatchBlock, face: Face, center: Array) -> Array | None:
    """The SPINE of the patches of a face, or of a boundary curve; None where they are no elementary surface.

    Parameters
    ----------
    block : PatchBlock
    face : Face
        That the patches are of.
    center : (3,)
        What was subtracted from its points.
    """
    if block.curve == NONE and _is_point(face):
        # A point is a ball of no radius.
        row = np.zeros(SPINE_SIZE)
        spine = spine_at(row, 0)
        spine.kind, spine.center, spine.axis, spine.off = SPHERE, block.nets[0, 0, 0, :3], (0.0, 0.0, 1.0), block.error
        return row
    if block.curve == NONE and _is_free(block, face, center):
        return None
    surface_form = elementary_form(face.surface) if block.curve == NONE else None
    if isinstance(surface_form, Freeform):
        return None
    row = np.zeros(SPINE_SIZE)
    spine = spine_at(row, 0)
    points = (block.nets[..., :3] / block.nets[..., 3:]).reshape(-1, 3)
    if surface_form is None:
        form = curve_form([block.nets[:, :, 0]])
        if form is None:
            return None
        _write_curve(spine, form, points)
    elif not _write_surface(spine, surface_form, center, points):
        return None
    spine.off += block.error
    return row


def _is_point(face: Face) -> bool:
    low, high = face.surface.bounding_box()
    return bool(low.tolist() == high.tolist())


def _is_free(block: PatchBlock, face: Face, center: Array) -> bool:
    """Whether the patches of a face tell that it is no elementary surface."""
    surface = face.surface
    size = surface.size
    if not size > 0.0:
        return True
    low, high = surface.bounding_box()
    loose = loose_of(exactness(size, max(-min(low.tolist()), max(high.tolist()))) / size)
    spans = 1 if len(block.nets) == 1 else surface.breaks()[0].size - 1
    pieces = block.nets.reshape(spans, -1, *block.nets.shape[1:])
    return has_no_motion(pieces, 0.5 * low + 0.5 * high - center, size, loose)


def _write_curve(spine: np.record, form: Line | Circle, points: Array) -> None:
    """A line is a cylinder of no radius, a circle a torus with a tube of none."""
    spine.off = form.deviation
    if isinstance(form, Line):
        _write_cylinder(spine, form.point, form.direction, points)
        return
    spine.kind, spine.center, spine.axis, spine.major = TORUS, form.center, form.axis, form.radius


def _write_cylinder(spine: np.record, point: Array, axis: Array, points: Array) -> None:
    """Axis and length of a cylinder on which some points are."""
    along = (points - point) @ axis
    low, high = float(along.min()), float(along.max())
    spine.kind, spine.center, spine.axis = CYLINDER, point + 0.5 * (low + high) * axis, axis
    spine.half = 0.5 * (high - low) * _ROUNDED_UP + 64.0 * UNIT * float(np.abs(points).max())


def _write_surface(spine: np.record, form: Form, center: Array, points: Array) -> bool:
    """Write what a surface is, about a center; False where that is none of these."""
    if isinstance(form, Plane):
        middle = points.mean(axis=0)
        spine.kind, spine.center, spine.axis = PLANE, middle, form.normal
        spine.half = float(np.linalg.norm(points - middle, axis=1).max()) * _ROUNDED_UP
    elif isinstance(form, Cylinder):
        _write_cylinder(spine, form.point - center, form.axis, points)
        spine.radius = form.radius
    elif isinstance(form, Sphere):
        spine.kind, spine.center, spine.axis = SPHERE, form.center - center, (0.0, 0.0, 1.0)
        spine.radius = form.radius
    elif isinstance(form, Torus):
        spine.kind, spine.center, spine.axis = TORUS, form.center - center, form.axis
        spine.radius, spine.major = form.minor, form.major
    else:
        return False
    spine.off = form.deviation
    return True
