"""BodyFace: one face of a body, and what it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import read_only
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cone, Cylinder, Form, Plane, Sphere, Torus
from assembly.kinematics.face_forms import FaceKind, axis_of, center_of, form_of, kind_of

if TYPE_CHECKING:
    from assembly.kinematics.body import Body
    from assembly.kinematics.frame import Frame

__all__ = ["BodyFace"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BodyFace:
    """One face of a body, and what it is, in the body's coordinates.

    The kind is that of its whole surface, to 1e-10 of its size, whatever its degrees, knots and weights. An attribute
    that a kind does not have raises an `InputError` that says what the face is.
    """

    body: Body
    face: Face
    name: str

    def __repr__(self) -> str:
        return f"{self.body.name}.face({self.name!r})"

    @property
    def kind(self) -> FaceKind:
        """Plane, cylinder, cone, sphere, torus, extrusion, revolution, or spline where it is none of these."""
        return kind_of(form_of(self.face))

    @property
    def normal(self) -> Array:
        """The outward unit normal of a plane, (3,); elsewhere a normal has a place: `face.face.normal(u, v)`."""
        form = form_of(self.face)
        if not isinstance(form, Plane):
            raise self._has_no("normal", "a plane; a point of another face has one, face.face.normal(u, v)")
        return read_only(self.face.sign * form.normal)

    @property
    def axis(self) -> Array:
        """The unit direction of the axis, (3,).

        A cylinder, a torus, an extrusion and a revolution have one without a sense: its largest component is positive.
        That of a cone goes from its apex to the face.
        """
        axis = axis_of(self.face)
        if axis is None:
            raise self._has_no("axis", "a cylinder, cone, torus, extrusion or revolution")
        return read_only(axis)

    @property
    def radius(self) -> float:
        """Radius of a cylinder or a sphere."""
        form = form_of(self.face)
        if isinstance(form, (Cylinder, Sphere)):
            return form.radius
        raise self._has_no("radius", "a cylinder or a sphere; a torus has major_radius and minor_radius")

    @property
    def major_radius(self) -> float:
        """From the axis of a torus to the middle of its tube."""
        return self._torus("major_radius").major

    @property
    def minor_radius(self) -> float:
        """Radius of the tube of a torus."""
        return self._torus("minor_radius").minor

    @property
    def half_angle(self) -> float:
        """Between the axis of a cone and its lines [rad]."""
        return self._cone("half_angle").half_angle

    @property
    def apex(self) -> Array:
        """The apex of a cone, (3,), on the face or not."""
        return read_only(self._cone("apex").apex)

    @property
    def is_hole(self) -> bool:
        """Whether a cylinder, cone, sphere or torus is hollow: the outward normal goes toward its axis or center.

        Of a torus, toward the middle of its tube.
        """
        form = form_of(self.face)
        if isinstance(form, (Cylinder, Cone, Sphere, Torus)):
            return form.outward != (self.face.sign > 0)
        raise self._has_no("inside", "a cylinder, cone, sphere or torus")

    @property
    def center(self) -> Array:
        """Where its frame stands, (3,): on the axis beside the centroid, the center of a sphere or a torus.

        Of planes, extrusions and splines it is the centroid.
        """
        return read_only(center_of(self.face))

    @property
    def centroid(self) -> Array:
        """Center of its area, (3,)."""
        return read_only(self.face.centroid())

    @property
    def area(self) -> float:
        """Its area."""
        return self.face.area()

    @property
    def form(self) -> Form:
        """All that is known of its surface; see `assembly/geometry/recognition/forms.py`."""
        return form_of(self.face)

    def frame(self) -> Frame:
        """The frame at its center: z is a plane's outward normal, or the axis; of a sphere the axes are the body's."""
        kind, center = self.kind, self.center
        if kind == "spline":
            raise self._has_no("frame", "a face of a kind that has an axis, a normal or a center")
        if kind == "sphere":
            return self.body.frame(center)
        return self.body.frame(center, self.normal if kind == "plane" else self.axis)

    def at_least(self, point: Array) -> float:
        """What its distance of a point (3,) is at least: that of the box around its surface's control points."""
        low, high = self.face.surface.bounding_box()
        return float(np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0.0)))

    def distance(self, point: NDArray[np.float64] | tuple[float, float, float]) -> float:
        """How far a point (3,) in the body's coordinates is from the face, within its boundary.

        That no point of it is nearer is proven, to 1e-12 of the size; to some 1e-6 on the axis of a cone or of another
        turned curve, where nearest points are a circle. In the material of the body a point is as far as outside of it.
        """
        from assembly.selection.nearness import distance_to_face

        return distance_to_face(self.face, point)

    def _take(self, face: Face) -> None:
        """Be another face: of a body whose shape was made anew."""
        self.__dict__["face"] = face

    def _torus(self, what: str) -> Torus:
        form = form_of(self.face)
        if isinstance(form, Torus):
            return form
        raise self._has_no(what, "a torus")

    def _cone(self, what: str) -> Cone:
        form = form_of(self.face)
        if isinstance(form, Cone):
            return form
        raise self._has_no(what, "a cone")

    def _has_no(self, what: str, expected: str) -> InputError:
        return InputError(f"{self!r} is a {self.kind} and has no {what}; expected {expected}")
