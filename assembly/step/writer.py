"""Bodies written to STEP files."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from assembly._file_names import other_format
from assembly.errors import AssemblyError, file_path
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.solve.solution import Solution
from assembly.step.bodies import unique
from assembly.step.documents import StepError, StepWarning, checked_unit
from assembly.step.occt import occt, quiet, settings
from assembly.step.placed import placed_bodies
from assembly.step.solids import sewn
from assembly.step.tree import Color

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["write_step"]


def _named(label: Any, name: str) -> None:
    o = occt()
    o.TDataStd_Name.Set_s(label, o.TCollection_ExtendedString(name, True))


def _color(color: Color) -> Any:
    o = occt()
    return o.Quantity_Color(*map(float, color), o.Quantity_TOC_sRGB)


class OcctDocument:
    """A document of OCCT with one assembly, to which parts are added."""

    def __init__(self, name: str) -> None:
        o = occt()
        self.made = o.TDocStd_Document(o.TCollection_ExtendedString("XmlOcaf"))
        o.XCAFDoc_DocumentTool.SetLengthUnit_s(self.made, 1e-3)
        self.shapes = o.XCAFDoc_DocumentTool.ShapeTool_s(self.made.Main())
        self.colors = o.XCAFDoc_DocumentTool.ColorTool_s(self.made.Main())
        self.root = self.shapes.NewShape()
        _named(self.root, name)

    def part(self, body: Body, scale: float) -> tuple[Any, bool]:
        """Label of the body's faces as a part, and whether they close."""
        o = occt()
        faces = [side.face for side in body.faces]
        made = sewn(faces, scale)
        label = self.shapes.AddShape(made.shape, False)
        _named(label, body.name)
        if body.color is not None:
            self.colors.SetColor(label, _color(body.color), o.XCAFDoc_ColorSurf)
        for side, images in zip(body.faces, made.faces, strict=True):
            for image in images:
                sub = self.shapes.AddSubShape(label, image)
                if not sub.IsNull():
                    _named(sub, side.name)
                    if side.face.color is not None:
                        self.colors.SetColor(sub, _color(side.face.color), o.XCAFDoc_ColorSurf)
        return label, made.closed

    def place(self, part: Any, name: str, pose: Pose, scale: float, color: Color | None) -> None:
        """One more instance of a part; a color where it is not the part's."""
        o = occt()
        w, x, y, z = pose.quaternion.tolist()
        transform = o.gp_Trsf()
        transform.SetTransformation(o.gp_Quaternion(x, y, z, w), o.gp_Vec(*(scale * pose.position).tolist()))
        label = self.shapes.AddComponent(self.root, part, o.TopLoc_Location(transform))
        _named(label, name)
        if color is not None:
            self.colors.SetColor(label, _color(color), o.XCAFDoc_ColorSurf)


def write_step(
    path: str | PathLike[str], what: Assembly | Solution | Body | Sequence[Body], *, unit: str = "mm"
) -> None:
    """Write bodies to a STEP file (AP214, in millimeters), each where it stands.

    The file has one assembly. Bodies that share their faces are instances of one part if their names follow from its
    name ("nut", "nut 2"), so that `read_step` gives the same bodies again: names, poses, colors, names and colors of
    faces. Closed faces are written as a solid, others as shells; a body in several pieces is read as several bodies.
    Planes, cylinders, cones, spheres, tori, extrusions and revolutions are written as such, whatever their parameters,
    and all others as B-splines, exactly; of the edges, lines in (u, v) and curves in planes are exact and others are
    followed to 1e-10 of the surface's size. A face that winds more than once around a surface that is written as a
    B-spline is written in parts of half a turn.

    Parameters
    ----------
    path
        Where to write.
    what : Assembly, Solution, Body or several bodies
        Bodies of a solution have its poses. Bodies without faces are left out with a warning.
    unit : {"mm", "um", "cm", "m", "in", "ft"}
        Unit of the bodies' lengths; they are converted to millimeters.

    Raises
    ------
    StepError
        Nothing to write, faces that cannot be written, a path that cannot be written to or whose suffix is another
        format's.
    ImportError
        OCCT is not installed: pip install "assembly-solver[step]".
    """
    scale = checked_unit(unit)
    placed_bodies(what)  # bad bodies first
    file = file_path("path", path)
    other = other_format(file, (".step", ".stp"))
    if other is not None:
        raise StepError(f"path is {str(file)!r}, a name of {other[0]} files; expected .step or .stp; {other[1]}")
    o = occt()
    # Settings exist once there is a writer.
    writer = o.STEPCAFControl_Writer()
    with quiet(), settings({"write.stepcaf.subshapes.name": 1, "write.step.assembly": 1}):
        document = document_of_bodies(file, what, scale)
        for mode in ("SetColorMode", "SetNameMode"):
            getattr(writer, mode)(True)
        if not writer.Transfer(document.made, o.STEPControl_AsIs):
            raise StepError(f"path is {str(file)!r}; OCCT cannot turn the bodies into STEP")
        if writer.Write(str(file)) != o.IFSelect_RetDone:
            raise StepError(f"path is {str(file)!r}; OCCT cannot write there")


def document_of_bodies(file: Path, what: Assembly | Solution | Body | Sequence[Body], scale: float) -> OcctDocument:
    """A document of one assembly, named after a file; bodies that share their faces are instances of one part.

    `scale` is millimeters in the bodies' unit. Bodies without faces are left out, and a warning says so.
    """
    placed = placed_bodies(what)
    bare = [body.name for body, _ in placed if not body.faces]
    with quiet():
        document = OcctDocument(file.stem)
        parts: dict[tuple[int, ...], tuple[Any, Body]] = {}
        taken: set[str] = set()
        for body, pose in placed:
            if not body.faces:
                continue
            key = tuple(id(side.face) for side in body.faces)
            base = parts.get(key)
            if base is None or unique(base[1].name, set(taken)) != body.name:
                try:
                    label, _ = document.part(body, scale)
                except AssemblyError as error:
                    raise StepError(f"what has body {body.name!r}, which cannot be written: {error}") from error
                base = (label, body)
                parts.setdefault(key, base)
            taken.add(body.name)
            own = None if body.color == base[1].color else body.color
            document.place(base[0], body.name, pose, scale, own)
        if not taken:
            raise StepError("what has no body with faces; expected something to write")
        document.shapes.UpdateAssemblies()
    if bare:
        names = ", ".join(map(repr, bare))
        warnings.warn(f"{file.name}: bodies without faces are left out: {names}", StepWarning, stacklevel=3)
    return document
