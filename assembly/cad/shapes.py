"""Shapes of OCCT as faces of bodies; each shape is read once, however often it is used."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.cad.libraries import shown
from assembly.cad.locations import SCALE_ROUNDING, pose_of
from assembly.errors import InputError, items, text
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.step.bodies import read_shape, solids_in, unique
from assembly.step.documents import StepWarning
from assembly.step.images import image_of, placement_of
from assembly.step.occt import occt, parts
from assembly.step.tree import Color

__all__ = ["Bodies", "Label", "color_of", "from_occt"]

# Rounding of points of copies, and of distances of points that were moved, over their coordinates.
SAME, MOVED = 1e-12, 1e-10
# Parts of a surface's domain at which it is compared with another, and where OCCT's numbers mean "without end".
AT, FAR = ((0.1, 0.2), (0.7, 0.4), (0.3, 0.9)), 1e50
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Label:
    """What a face is called, and its color, either of which may be None; and shapes that the face was in."""

    face: Any
    name: str | None = None
    color: Color | None = None
    wholes: Sequence[Any] = ()


@dataclass
class _Read:
    """A shape, its faces as OCCT has them, and as we do; those that cannot be read are None."""

    shape: Any
    theirs: list[Any]
    ours: list[Face | None]
    missing: list[str]
    labeled: dict[tuple[Any, ...], list[Face]]


class Bodies:
    """Makes bodies of shapes, with names that are distinct.

    Parameters
    ----------
    strict : bool
        Raise where a face cannot be read; otherwise it is left out, with a warning.
    fixed : iterable of str
        Names of bodies that do not move.
    """

    def __init__(self, strict: bool, fixed: Iterable[str]) -> None:
        if not isinstance(strict, (bool, np.bool_)):
            raise InputError(f"strict is {strict!r}; expected True or False")
        if isinstance(fixed, str):
            raise InputError(f"fixed is {fixed!r}; expected several names, [{fixed!r}]")
        self.bodies: list[Body] = []
        self._fixed = {text("a name in fixed", name) for name in items("fixed", fixed, "names of bodies")}
        self._strict = bool(strict)
        self._taken: set[str] = set()
        self._read: list[_Read] = []
        self._known = occt().ShapeMap()

    def add(
        self, name: str, shapes: Sequence[Any], pose: Pose, color: Color | None, labels: Sequence[Label] = ()
    ) -> Body:
        """Add a body.

        Parameters
        ----------
        name
            Followed by a number where it is taken.
        shapes
            TopoDS_Shapes in the body's coordinates; without faces there is a body without a shape.
        pose
            Where the body stands.
        color
        labels
            Names and colors of faces; the first one of a face counts, and those of other faces do not.
        """
        name = unique(name, self._taken)
        faces = [face for shape in shapes for face in self._faces(name, shape, labels)]
        if len(shapes) > 1:
            faces = _distinct(faces)
        body = Body(name, faces or None, pose.position, pose.quaternion, name in self._fixed, color)
        self.bodies.append(body)
        return body

    def finished(self, what: str) -> list[Body]:
        """All bodies of an argument.

        Raises
        ------
        InputError
            No body with faces; a name of `fixed` that no body has.
        """
        if not any(body.faces for body in self.bodies):
            raise InputError(f"{what} has no faces; expected solids, shells or faces")
        unknown = sorted(self._fixed - self._taken)
        if unknown:
            known = ", ".join(repr(body.name) for body in self.bodies)
            raise InputError(f"fixed names {unknown[0]!r}; expected one of {known}")
        return self.bodies

    def _faces(self, name: str, shape: Any, labels: Sequence[Label]) -> list[Face]:
        read = self._once(shape)
        if read.missing:
            told = f"body {name!r}; not read: {'; '.join(read.missing[:10])}"
            if self._strict:
                raise InputError(f"{told}; pass strict=False to read the rest")
            warnings.warn(told, StepWarning, stacklevel=4)
        said: dict[int, Label] = {}
        for label in labels:
            for k in _places(read, label):
                before = said.get(k, Label(None))
                said[k] = Label(None, before.name or label.name, before.color or label.color)
        key = tuple((k, label.name, label.color) for k, label in sorted(said.items()))
        if key not in read.labeled:
            read.labeled[key] = _labeled(read.ours, said)
        return read.labeled[key]

    def _once(self, shape: Any) -> _Read:
        place = int(self._known.FindIndex(shape))
        # The map takes shapes of opposite sides for one.
        if place and self._read[place - 1].shape.IsEqual(shape):
            return self._read[place - 1]
        o = occt()
        made = read_shape(shape, lambda _: (None, None), None, 1.0)
        theirs = [o.as_face(face) for face in parts(shape, o.TopAbs_FACE)]
        ours = {face.name: face for face in made.faces}
        read = _Read(shape, theirs, [ours.get(f"face {k}") for k in range(1, len(theirs) + 1)], made.missing, {})
        if not place:
            self._known.Add(shape)
            self._read.append(read)
        return read


def _labeled(faces: Sequence[Face | None], said: dict[int, Label]) -> list[Face]:
    """Faces under the names and in the colors that are said of them."""
    taken = {face.name or "" for k, face in enumerate(faces) if face is not None and not said.get(k, Label(None)).name}
    found = []
    for k, face in enumerate(faces):
        if face is None:
            continue
        label = said.get(k)
        if label is not None:
            face = copy.copy(face)
            face.color = label.color
            if label.name:
                face.name = unique(label.name, taken)
        found.append(face)
    return found


def _distinct(faces: Sequence[Face]) -> list[Face]:
    """The faces of several shapes, under distinct names."""
    taken: set[str] = set()
    found = []
    for k, face in enumerate(faces, 1):
        name = f"face {k}" if (face.name or "").startswith("face ") else face.name or f"face {k}"
        face = copy.copy(face)
        face.name = unique(name, taken)
        found.append(face)
    return found


def _places(read: _Read, label: Label) -> list[int]:
    """Which faces of a shape a label is of."""
    places = _places_in(read.theirs, label.face)
    if places:
        return places
    for whole in label.wholes:
        o = occt()
        before = [o.as_face(face) for face in parts(whole, o.TopAbs_FACE)]
        places = _places_in(before, label.face)
        if places and _is_moved(before, read.theirs):
            return places
    return []


def _places_in(faces: Sequence[Any], wanted: Any) -> list[int]:
    """Which of the faces a face is: the same, the same elsewhere, what is left of it, or a copy of that.

    Operations that cut a face leave its surface to what remains; that of a copy has the same numbers.
    """
    for same in ("IsSame", "IsPartner"):
        places = [k for k, face in enumerate(faces) if getattr(face, same)(wanted)]
        if places:
            return places
    o = occt()
    bare = o.TopLoc_Location()
    surface = o.BRep_Tool.Surface_s(o.as_face(wanted), bare)
    # One object stands for a surface as long as it is kept.
    places = [k for k, face in enumerate(faces) if o.BRep_Tool.Surface_s(face, o.TopLoc_Location()) is surface]
    if places:
        return places
    points = _points(o.as_face(wanted))
    scale = max(1.0, float(np.abs(points).max()))
    return [k for k, face in enumerate(faces) if np.abs(_points(face) - points).max() <= SAME * scale]


def _is_moved(before: Sequence[Any], after: Sequence[Any]) -> bool:
    """Whether the second faces are the first ones, in their order, moved as one: distances are the same."""
    if len(before) != len(after):
        return False
    rows = [np.concatenate([_points(face) for face in faces]) for faces in (before, after)]
    scale = max(1.0, float(np.abs(rows[0]).max()), float(np.abs(rows[1]).max()))
    apart = [np.linalg.norm(points[:, None] - points[None, :4], axis=2) for points in rows]
    return bool(np.abs(apart[0] - apart[1]).max() <= MOVED * scale)


def _points(face: Any) -> Array:
    """Points of the surface that a face is a part of, (n, 3), at parameters that do not depend on the face."""
    surface = occt().BRep_Tool.Surface_s(face)
    u0, u1, v0, v1 = surface.Bounds()
    found = []
    for s, t in AT:
        point = surface.Value(_between(u0, u1, s), _between(v0, v1, t))
        found.append((point.X(), point.Y(), point.Z()))
    return np.array(found)


def _between(low: float, high: float, part: float) -> float:
    """A parameter between two, of which either may be infinite."""
    if low > -FAR:
        return low + part * (high - low if high < FAR else 1.0)
    return high - part if high < FAR else part


def color_of(color: Any) -> Color | None:
    """Red, green and blue (sRGB) of a color of either library, or None."""
    if color is None:
        return None
    o = occt()
    # OCCT keeps single precision.
    values = color.wrapped.GetRGB().Values(o.Quantity_TOC_sRGB)
    red, green, blue = (min(1.0, max(0.0, round(x, 6))) for x in values)
    return red, green, blue


def from_occt(shape: Any, name: str = "part", *, fixed: Iterable[str] = (), strict: bool = True) -> list[Body]:
    """The solids of an OCCT shape, one body each; shells and faces outside of any solid are bodies, too.

    Parameters
    ----------
    shape : OCP.TopoDS.TopoDS_Shape
        Lengths are not converted. Equal solids at several locations share their faces: geometry is in the solid's own
        coordinates, and the body's pose is its location. Where that mirrors or scales, the body is an image of the
        solid.
    name : str
        Of the body; of several "part", "part 2" and so on. Faces are "face 1", "face 2" in OCCT's order.
    fixed : iterable of str
        Names of bodies that do not move.
    strict : bool
        Whether to raise if a face cannot be read. Otherwise it is left out, and a warning says which and why.

    Returns
    -------
    list of Body

    Raises
    ------
    TypeError, InputError
        No such shape, one without faces, or with faces that cannot be read, named with the reasons.
    ImportError
        OCCT is not installed.
    """
    o = occt()
    if not isinstance(shape, o.TopoDS_Shape):
        raise TypeError(f"shape is {shown(shape)}; expected a TopoDS_Shape, of a CadQuery or build123d object .wrapped")
    text("name", name)
    made = Bodies(strict, fixed)
    images: list[tuple[Any, float, Any]] = []
    for piece in () if shape.IsNull() else solids_in(shape):
        own = piece.Located(o.TopLoc_Location())
        if abs(piece.Location().Transformation().ScaleFactor() - 1.0) <= SCALE_ROUNDING:
            made.add(name, [own], pose_of(piece.Location(), repr(name)), None)
            continue
        pose, factor = placement_of(piece.Location())
        same = (image for known, scale, image in images if scale == factor and known.IsEqual(own))
        image = next(same, None)
        if image is None:
            image, _ = image_of(own, bool, factor)
            images.append((own, factor, image))
        made.add(name, [image], pose, None)
    return made.finished("shape")
