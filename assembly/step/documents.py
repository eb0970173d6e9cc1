"""STEP files as documents of OCCT, and what may be wrong with them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from assembly._file_names import read_elsewhere
from assembly.errors import InputError
from assembly.step.occt import occt, parts, settings
from assembly.step.references import references_of
from assembly.step.syntax import first_fault, is_step, mended
from assembly.step.tree import entry_of

__all__ = ["UNITS", "Damaged", "Malformed", "StepError", "StepWarning", "checked_unit", "document_of"]

# Millimeters in a unit.
UNITS = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1e3, "in": 25.4, "ft": 304.8}
# Beginnings of OCCT's names of entities that say nothing of shapes.
_BESIDE = (
    "StepBasic_Approval", "StepBasic_Date", "StepBasic_Person", "StepBasic_Organization", "StepBasic_Security",
    "StepBasic_Certification", "StepBasic_Contract", "StepBasic_CalendarDate", "StepBasic_LocalTime",
    "StepBasic_Address", "StepBasic_Action", "StepAP214_Applied", "StepAP203_Cc", "StepDimTol_",
)  # fmt: skip


# What OCCT looks for in each two edges of a wire and in each two wires of a face, edges that run back along the one
# before, and gaps between edges.
_REPAIRS = (
    "FixSelfIntersectionMode", "FixIntersectingWiresMode", "FixOrientationMode", "FixNotchedEdgesMode",
    "FixLackingMode",
)  # fmt: skip


class StepError(InputError):
    """A STEP file that cannot be read or written, or not whole; the text says which faces, and why."""


class StepWarning(UserWarning):
    """Something of a STEP file was left out or approximated; the text says what, and why."""


class Damaged(StepError):
    """A file with entities that OCCT could not load, or with references that lead nowhere."""


class Malformed(Damaged):
    """A file whose text is damaged."""


def checked_unit(unit: str, name: str = "unit") -> float:
    """Millimeters in a unit."""
    if not isinstance(unit, str) or unit not in UNITS:
        raise InputError(f"{name} is {unit!r}; expected one of {', '.join(map(repr, UNITS))}")
    return UNITS[unit]


class Document(NamedTuple):
    """A file as a document of OCCT, in millimeters.

    Attributes
    ----------
    made
        TDocStd_Document.
    faces : int
        How many it and the others have.
    missing : list of str
        Files that it needs and that are not there.
    path : str
        Of the file.
    others : dict
        Files that it refers to, read by themselves without repairs, by the entries of the labels that stand for them.
    """

    made: Any
    faces: int
    missing: list[str]
    path: str
    others: dict[str, Document]


def document_of(path: str, folder: str | None = None, *, repairs: bool = True) -> Document:
    """A file as a document of OCCT.

    OCCT looks for wires that cross themselves or others, comparing each two of their edges, for edges that run back
    along the one before and for gaps, and mends them. Without repairs it does not: faces are checked when they are made
    of them. It repairs all that other files have, whatever it is told, so those that refer to no others are read by
    themselves as well.

    OCCT may crash, at once or later, where it makes shapes of entities that it could not load, and its parser may never
    end on text that is not a STEP file's. So a damaged file is refused, unless a folder is given: then the undamaged
    statements are written to a file in that folder, which OCCT reads instead.
    """
    # OCCT looks for files that this one refers to beside it only by a whole path.
    file = Path(path).absolute()
    text = file.read_bytes()
    if not is_step(text):
        elsewhere = read_elsewhere(file, (".step", ".stp"))
        raise StepError(f"path is {path!r}; expected a STEP file, which begins with ISO-10303-21{elsewhere}")
    others = references_of(text, file.parent)
    whole = _whole(path, text, folder)
    for other in others.files:
        _whole(str(other), other.read_bytes(), folder, other.relative_to(file.parent))
    del text
    made, count, reader = _loaded(path, str(file) if folder is None else whole, folder is not None, repairs)
    alone: dict[str, Document] = {}
    # What is left of a damaged file is read with all repairs anyway.
    for entry, other in (_entries_of(others.last, reader) if folder is None else {}).items():
        alone[entry] = document_of(str(other), repairs=False)
        count += alone[entry].faces
    return Document(made, count, others.missing, path, alone)


def _entries_of(files: dict[str, Path], reader: Any) -> dict[str, Path]:
    """The files of which a reader has made shapes, by the entries of the labels of these, from those by their names."""
    if not files:
        return {}
    o, found = occt(), {}
    try:
        known = reader.ExternFiles()
    except TypeError:
        # Wheels of OCCT 7 have no type for this list: shapes of other files then are those that OCCT has repaired.
        return {}
    for name, file in files.items():
        key = o.TCollection_AsciiString(name)
        label = known.Find(key).GetLabel() if known.IsBound(key) else None
        if label is not None and not label.IsNull() and parts(o.XCAFDoc_ShapeTool.GetShape_s(label), o.TopAbs_FACE):
            found[entry_of(label)] = file
    return found


def _whole(path: str, text: bytes, folder: str | None, name: Path = Path("whole.step")) -> str:
    """The path at which a text's undamaged statements are: in the folder, by a name."""
    fault = first_fault(text)
    if folder is None:
        if fault is None:
            return path
        if fault.is_lost:
            raise Damaged(f"path is {path!r}; a reference in line {fault.line} leads nowhere")
        raise Malformed(f"path is {path!r}; its text is damaged in line {fault.line}")
    file = Path(folder) / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(text if fault is None else mended(text))
    return str(file)


def _loaded(path: str, file: str, damaged: bool, repairs: bool) -> tuple[Any, int, Any]:
    """The document of a file with the syntax of one, that at the path or what is whole of it, its faces, its reader."""
    o = occt()
    # OCCT has its settings only after a reader was made.
    reader = o.STEPCAFControl_Reader()
    auto = o.XCAFDoc_ShapeTool.AutoNaming_s()
    try:
        o.XCAFDoc_ShapeTool.SetAutoNaming_s(False)
        with settings({"read.stepcaf.subshapes.name": 1, "read.step.product.mode": 1}):
            if reader.ReadFile(file) != o.IFSelect_RetDone:
                raise StepError(f"path is {path!r}; expected a STEP file, and OCCT cannot parse it")
            shapes, styles, faces = _counted(reader)
            if shapes and not damaged:
                raise Damaged(f"path is {path!r}; {shapes} of its entities are damaged")
            if styles:
                warnings.warn(
                    f"{Path(path).name}: {styles} of its styles are damaged: colors are left out",
                    StepWarning,
                    stacklevel=6,
                )
            if not repairs:
                # It has whom to tell this only after a file is read.
                left_out = o.Texts()
                for mode in _REPAIRS:
                    left_out.Bind(o.TCollection_AsciiString(f"FixShape.{mode}"), o.TCollection_AsciiString("0"))
                reader.SetShapeFixParameters(left_out)
            document = o.TDocStd_Document(o.TCollection_ExtendedString("XmlOcaf"))
            o.XCAFDoc_DocumentTool.SetLengthUnit_s(document, 1e-3)
            # Of styles only these make something.
            for mode in ("SetColorMode", "SetLayerMode", "SetGDTMode", "SetMatMode", "SetViewMode"):
                getattr(reader, mode)(not styles and mode == "SetColorMode")
            reader.SetNameMode(True)
            if not reader.Transfer(document):
                raise StepError(f"path is {path!r}; OCCT finds no shapes in it")
    finally:
        o.XCAFDoc_ShapeTool.SetAutoNaming_s(auto)
    return document, faces, reader


def _counted(reader: Any) -> tuple[int, int, int]:
    """Numbers of entities that OCCT could not load, those that shapes are made of and those of style, and of faces.

    OCCT does not read those of style if it is told to make no colors.
    """
    o, model = occt(), reader.Reader().WS().Model()
    entities = model.Entities()
    broken: list[str] = []
    if model.Reports().NbEntities():
        everything = range(1, model.NbEntities() + 1)
        broken = [type(model.Value(k)).__name__ for k in filter(model.IsErrorEntity, everything)]
        broken = [kind for kind in broken if not _is_beside(kind)]
    styles = sum(kind.startswith("StepVisual_") for kind in broken)
    flat = sum(map(_is_flat, _each(_of_kind(entities, o.StepGeom_Axis2Placement3d))))
    bare = sum(map(_is_bare, _each(_of_kind(entities, o.StepGeom_Pcurve))))
    faces = _of_kind(entities, o.StepShape_FaceSurface).NbEntities()
    return len(broken) - styles + flat + bare, styles, faces


def _of_kind(entities: Any, kind: Any) -> Any:
    """Those of OCCT's list that are of a kind; it chooses among thousands without an object of Python for each."""
    return entities.Typed(kind.get_type_descriptor_s())


def _each(chosen: Any) -> Iterator[Any]:
    """The entities of a list of OCCT."""
    chosen.Start()
    while chosen.More():
        yield chosen.Value()
        chosen.Next()


def _is_flat(placement: Any) -> bool:
    """Whether the location of a placement in space is a point of the plane: OCCT would read a third coordinate."""
    location = placement.Location()
    return location is not None and location.NbCoordinates() < 3


def _is_bare(on_surface: Any) -> bool:
    """Whether what a curve on a surface refers to as its curve is none, which OCCT would use as if it were one."""
    there = on_surface.ReferenceToCurve()
    return there is not None and (there.NbItems() < 1 or not isinstance(there.ItemsValue(1), occt().StepGeom_Curve))


def _is_beside(kind: str) -> bool:
    """Whether entities of a kind say nothing of shapes: who made them and when, solid angles, dimensions."""
    return kind.endswith("AndSolidAngleUnit") or kind.startswith(_BESIDE)
