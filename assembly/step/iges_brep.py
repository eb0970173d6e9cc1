"""Bodies in the other files that OCCT reads and writes: IGES, and its own BREP."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from assembly._file_names import checked_suffix, read_elsewhere
from assembly.errors import file_path
from assembly.kinematics.body import Body
from assembly.solve.solution import Solution
from assembly.step.bodies import Source, bodies_in
from assembly.step.documents import StepError, StepWarning, checked_unit
from assembly.step.occt import occt, parts, quiet, settings
from assembly.step.placed import placed_bodies
from assembly.step.writer import document_of_bodies

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["read_brep", "read_iges", "write_brep", "write_iges"]

_IGES, _BREP = (".igs", ".iges"), (".brep", ".brp")
# Gaps of faces that are sewn to solids [mm]: what IGES files of other programs have at their edges.
_SEWN = 1e-3
# IGES' number of solids by their boundaries (manifold solid B-rep objects).
_SOLID = 186


def read_iges(path: str | PathLike[str], *, unit: str = "mm", strict: bool = True) -> list[Body]:
    """The bodies of an IGES file, as `read_step` reads those of a STEP file.

    Faces that a file has one by one, without solids, are sewn where their edges are nearer than 0.001 mm; what closes
    becomes a body, and so does the rest.

    Parameters
    ----------
    path : str or path
    unit : {"mm", "um", "cm", "m", "in", "ft"}
        Lengths are converted to it, whatever the file's own unit.
    strict : bool
        Raise where a face cannot be read; otherwise it is left out, with a warning.

    Raises
    ------
    StepError
        No IGES file, nothing in it, or faces that cannot be read.
    FileNotFoundError, ImportError
        No such file; no OCCT.
    """
    file = _there(path)
    scale = 1.0 / checked_unit(unit)
    o = occt()
    with quiet():
        reader = o.IGESCAFControl_Reader()
        for mode in ("SetColorMode", "SetNameMode"):
            getattr(reader, mode)(True)
        document = _document()
        if not _is_iges(file) or reader.ReadFile(str(file)) != o.IFSelect_RetDone or not reader.Transfer(document):
            missing = f"expected an IGES file with shapes, and OCCT finds none{read_elsewhere(file, _IGES)}"
            raise StepError(f"path is {str(file)!r}; {missing}")
        shape, names = reader.OneShape(), _names_of_solids(reader.IGESModel())
        solids = len(parts(shape, o.TopAbs_SOLID))
        if not solids:
            document = _document_with(_sewn(shape))
    names = names if len(names) == solids else ()
    return _bodies(Source(file, document, len(parts(shape, o.TopAbs_FACE)), names=names), scale, strict)


def read_brep(path: str | PathLike[str], *, unit: str = "mm", strict: bool = True) -> list[Body]:
    """The bodies of a BREP file, OCCT's own, whose lengths are taken for millimeters; see `read_iges`."""
    file = _there(path)
    scale = 1.0 / checked_unit(unit)
    o = occt()
    with quiet():
        shape = o.TopoDS_Shape()
        if not o.BRepTools.Read_s(shape, str(file), o.BRep_Builder()) or shape.IsNull():
            missing = f"expected a BREP file with a shape, and OCCT finds none{read_elsewhere(file, _BREP)}"
            raise StepError(f"path is {str(file)!r}; {missing}")
        document = _document_with(shape)
    return _bodies(Source(file, document, len(parts(shape, o.TopAbs_FACE))), scale, strict)


def write_iges(
    path: str | PathLike[str], what: Assembly | Solution | Body | Sequence[Body], *, unit: str = "mm"
) -> None:
    """Write bodies to an IGES file (solids, in millimeters), each where it stands; see `write_step`.

    Names of solids and colors come back from there; names of faces, and of bodies that do not close, do not.

    Raises
    ------
    StepError, InputError, ImportError
        As `write_step`, and a path that does not end in .igs or .iges.
    """
    file = checked_suffix(path, *_IGES)
    o = occt()
    # Settings exist once there is a writer; 1 writes solids rather than single faces.
    o.IGESCAFControl_Writer()
    with quiet(), settings({"write.iges.brep.mode": 1}):
        document = document_of_bodies(file, what, checked_unit(unit))
        writer = o.IGESCAFControl_Writer()
        for mode in ("SetColorMode", "SetNameMode"):
            getattr(writer, mode)(True)
        if not writer.Transfer(document.made) or not writer.Write(str(file)):
            raise StepError(f"path is {str(file)!r}; OCCT cannot write there")


def write_brep(
    path: str | PathLike[str], what: Assembly | Solution | Body | Sequence[Body], *, unit: str = "mm"
) -> None:
    """Write bodies to a BREP file, OCCT's own, in millimeters; see `write_step`.

    BREP files have no names and no colors: what is read from one has the name of the file.

    Raises
    ------
    StepError, InputError, ImportError
        As `write_step`, and a path that does not end in .brep or .brp.

    Warns
    -----
    StepWarning
        Several bodies, whose names are lost.
    """
    file = checked_suffix(path, *_BREP)
    o = occt()
    with quiet():
        document = document_of_bodies(file, what, checked_unit(unit))
        if not o.BRepTools.Write_s(o.XCAFDoc_ShapeTool.GetShape_s(document.root), str(file)):
            raise StepError(f"path is {str(file)!r}; OCCT cannot write there")
    names = [body.name for body, _ in placed_bodies(what) if body.faces]
    if len(names) > 1:
        warnings.warn(
            f"{file.name}: BREP files have no names: those of {len(names)} bodies are left out",
            StepWarning,
            stacklevel=2,
        )


def _there(path: str | PathLike[str]) -> Path:
    file = file_path("path", path)
    if not file.is_file():
        raise FileNotFoundError(f"path is {str(file)!r}; {'a folder' if file.is_dir() else 'no such file'}")
    return file


def _is_iges(file: Path) -> bool:
    """Whether the first line has the mark of a start section where it is in every IGES file."""
    with file.open("rb") as stream:
        line = stream.readline(200)
    return line[72:73] in (b"S", b"B", b"C")


def _names_of_solids(model: Any) -> tuple[str | None, ...]:
    """The names that a file gives its solids, in its order: of properties, where labels have eight characters only."""
    solids = (model.Entity(k) for k in range(1, model.NbEntities() + 1))
    found = [solid for solid in solids if solid.TypeNumber() == _SOLID]
    return tuple(solid.NameValue().ToCString() if solid.HasName() else None for solid in found)


def _document() -> Any:
    o = occt()
    document = o.TDocStd_Document(o.TCollection_ExtendedString("XmlOcaf"))
    o.XCAFDoc_DocumentTool.SetLengthUnit_s(document, 1e-3)
    return document


def _document_with(shape: Any) -> Any:
    o = occt()
    document, auto = _document(), o.XCAFDoc_ShapeTool.AutoNaming_s()
    # OCCT would name it by its kind.
    o.XCAFDoc_ShapeTool.SetAutoNaming_s(False)
    try:
        o.XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).AddShape(shape, False)
    finally:
        o.XCAFDoc_ShapeTool.SetAutoNaming_s(auto)
    return document


def _sewn(shape: Any) -> Any:
    """A compound of the solids that faces close to, and of what is left."""
    o = occt()
    sewing = o.BRepBuilderAPI_Sewing(_SEWN)
    for face in parts(shape, o.TopAbs_FACE):
        sewing.Add(face)
    sewing.Perform()
    builder, compound = o.BRep_Builder(), o.TopoDS_Compound()
    builder.MakeCompound(compound)
    result = sewing.SewedShape()
    for shell in parts(result, o.TopAbs_SHELL):
        solid = o.BRepBuilderAPI_MakeSolid(o.as_shell(shell)).Solid() if shell.Closed() else shell
        if shell.Closed():
            o.BRepLib.OrientClosedSolid_s(solid)
        builder.Add(compound, solid)
    for face in parts(result, o.TopAbs_FACE, o.TopAbs_SHELL):
        builder.Add(compound, face)
    return compound


def _bodies(source: Source, scale: float, strict: bool) -> list[Body]:
    bodies, left = bodies_in(source, scale, strict)
    for line in left:
        warnings.warn(line, StepWarning, stacklevel=3)
    return bodies
