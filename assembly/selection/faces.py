"""Faces: those of a body, selected by kind, size and place."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, positive
from assembly.kinematics.body_face import BodyFace
from assembly.kinematics.face_forms import is_flat
from assembly.selection.selection import EQUAL, Selection, are_parallel, checked_place, is_about, shown

__all__ = ["Faces"]

Array = NDArray[np.float64]


class Faces(Selection[BodyFace]):
    """Faces of a body in the order they were given: a tuple of `BodyFace`, and what selects among them.

    Lengths are equal that differ by less than 1e-6 of the body's size, directions that differ by 1e-6 rad; points and
    directions are in the body's coordinates. Selections of a scalar argument that is left out take any.
    """

    _word = "face"
    _kinds: ClassVar[dict[str, tuple[str, ...]]] = {
        "plane": ("PLANE",),
        "cylinder": ("CYLINDER",),
        "cone": ("CONE",),
        "sphere": ("SPHERE",),
        "torus": ("TORUS",),
        "extrusion": ("EXTRUSION",),
        "revolution": ("REVOLUTION",),
        "spline": ("SPLINE", "BSPLINE", "BEZIER", "OTHER"),
    }

    def planes(self, normal: ArrayLike | None = None, at: ArrayLike | None = None) -> Self:
        """Planes, with this outward normal (of any length), through this point."""
        along = is_about("normal", normal)
        place = None if at is None else checked_place("at", at)

        def fits(face: BodyFace) -> bool:
            if not is_flat(face.face):
                return False
            if along is not None and not are_parallel(face.normal, along, same_sense=True):
                return False
            return place is None or self._equal(float(face.normal @ (place - face.center)), 0.0)

        return self._chosen(fits, f".planes{shown(normal=normal, at=at)}")

    def cylinders(self, radius: float | None = None, axis: ArrayLike | None = None, hole: bool | None = None) -> Self:
        """Cylinders, with this radius, an axis along this direction in either sense, hollow (holes) or full."""
        return self._round("cylinder", "radius", radius, axis, hole)

    def cones(self, half_angle: float | None = None, axis: ArrayLike | None = None, hole: bool | None = None) -> Self:
        """Cones, with this angle between axis and lines [rad], an axis along this direction, hollow or full."""
        return self._round("cone", "half_angle", half_angle, axis, hole)

    def spheres(self, radius: float | None = None, hole: bool | None = None) -> Self:
        """Spheres, with this radius, hollow (sockets) or full."""
        return self._round("sphere", "radius", radius, None, hole)

    def tori(
        self,
        major_radius: float | None = None,
        minor_radius: float | None = None,
        axis: ArrayLike | None = None,
        hole: bool | None = None,
    ) -> Self:
        """Tori, with these radii, an axis along this direction, hollow (grooves) or full."""
        large = self._round("torus", "major_radius", major_radius, axis, hole)
        said = shown(major_radius=major_radius, minor_radius=minor_radius, axis=axis, hole=hole)
        found = large if minor_radius is None else large._round("torus", "minor_radius", minor_radius, None, None)
        return type(self)(found, f"{self._said}.tori{said}", self)

    def largest(self) -> Self:
        """The face of the largest area; of several that are as large, the first."""
        if not self:
            return self._chosen(lambda face: True, ".largest()")
        areas = np.array([face.area for face in self])
        first = int(np.argmax(areas >= areas.max() * (1.0 - 1e-9)))
        return type(self)((self[first],), f"{self._said}.largest()", self)

    def named(self, pattern: str) -> Self:
        """Those whose names fit a pattern: * stands for any letters, ? for one, [abc] for one of these."""
        if not isinstance(pattern, str):
            raise TypeError(f"pattern is {pattern!r}; expected a string such as 'top*'")
        return self._chosen(lambda face: fnmatchcase(face.name, pattern), f".named({pattern!r})")

    def _round(self, kind: str, attribute: str, value: float | None, axis: ArrayLike | None, hole: bool | None) -> Self:
        asked = None if value is None else positive(attribute, value)
        along = is_about("axis", axis)
        if hole is not None and not isinstance(hole, (bool, np.bool_)):
            raise InputError(f"hole is {hole!r}; expected True, False or None")

        def fits(face: BodyFace) -> bool:
            if face.kind != kind:
                return False
            if asked is not None:
                off = abs(getattr(face, attribute) - asked)
                if off > EQUAL * (1.0 if attribute == "half_angle" else self._size()):
                    return False
            if along is not None and not are_parallel(face.axis, along):
                return False
            return hole is None or face.is_hole == hole

        words = {"cylinder": "cylinders", "cone": "cones", "sphere": "spheres", "torus": "tori"}
        said = f".{words[kind]}{shown(**{attribute: value, 'axis': axis, 'hole': hole})}"
        return self._chosen(fits, said)

    def _kind(self, item: BodyFace) -> str:
        return item.kind

    def _direction(self, item: BodyFace) -> Array | None:
        return item.normal if is_flat(item.face) else None

    def _described(self, item: BodyFace) -> str:
        return f"{item.name!r} ({_said_of(item)})"


def _said_of(face: BodyFace) -> str:
    """Kind and sizes of a face."""
    kind = face.kind
    if kind == "plane":
        return f"plane, normal {_rounded(face.normal)}"
    if kind not in ("cylinder", "cone", "sphere", "torus"):
        return kind
    sizes = {
        "cylinder": lambda: f"radius {face.radius:.6g}",
        "sphere": lambda: f"radius {face.radius:.6g}",
        "cone": lambda: f"half angle {face.half_angle:.6g}",
        "torus": lambda: f"radii {face.major_radius:.6g} and {face.minor_radius:.6g}",
    }[kind]()
    axis = "" if kind == "sphere" else f", axis {_rounded(face.axis)}"
    return f"{'hollow ' if face.is_hole else ''}{kind}, {sizes}{axis}"


def _rounded(direction: Array) -> str:
    x, y, z = (np.round(direction, 6) + 0.0).tolist()
    return f"({x:g}, {y:g}, {z:g})"
