"""STEP files read as bodies."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose, axes_quaternion
from assembly.step.faces import read_face
from assembly.step.occt import occt, parts, quiet, settings
from assembly.step.profiles import Unreadable
from assembly.step.references import references_of
from assembly.step.syntax import first_fault, is_step, mended
from assembly.step.tree import Color, Part, free_labels, leaves

__all__ = ["UNITS", "StepError", "StepWarning", "read_step"]

# Millimeters in a unit.
UNITS = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1e3, "in": 25.4, "ft": 304.8}
# A deviation [mm] below which a face is what the file says: OCCT takes nearer points for one.
EXACT = 1e-7
# Seconds that a damaged file may take, kernels that are compiled for the first time included.
PATIENCE = 240.0
# Beginnings of OCCT's names of entities that say nothing of shapes.
_BESIDE = (
    "StepBasic_Approval", "StepBasic_Date", "StepBasic_Person", "StepBasic_Organization", "StepBasic_Security",
    "StepBasic_Certification", "StepBasic_Contract", "StepBasic_CalendarDate", "StepBasic_LocalTime",
    "StepBasic_Address", "StepBasic_Action", "StepAP214_Applied", "StepAP203_Cc", "StepDimTol_",
)  # fmt: skip
# Exit codes from which on Windows means a crash; elsewhere they are negative.
ENDED = 0xC0000000
# What is raised in this one is raised again in the process that asked. It ends without OCCT's taking anything down.
# Arrays that come back as bytes beside the rest are read-only, as those of bodies are.
_APART = """
import os, pickle, sys
from assembly.step.reader import bodies_of
path, unit, strict, answer = sys.argv[1:]
try:
    found = bodies_of(path, unit, strict == "True", os.path.dirname(answer))
except Exception as error:
    found = error
arrays = []
rest = pickle.dumps(found, 5, buffer_callback=arrays.append)
with open(answer, "wb") as file:
    pickle.dump((rest, [bytes(array.raw()) for array in arrays]), file)
os._exit(0)
"""


class StepError(InputError):
    """A STEP file that cannot be read or written, or not whole; the text says which faces, and why."""


class StepWarning(UserWarning):
    """Something of a STEP file was left out or approximated; the text says what, and why."""


class _Damaged(StepError):
    """A file with entities that OCCT could not load, or with references that lead nowhere."""


class _Malformed(_Damaged):
    """A file whose text is damaged."""


@dataclass
class Shape:
    """Faces of one solid, or of one sheet, in the part's own coordinates."""

    faces: list[Face]
    color: Color | None
    name: str | None
    missing: list[str]
    inexact: list[str]


def checked_unit(unit: str) -> float:
    """Millimeters in a unit."""
    if not isinstance(unit, str) or unit not in UNITS:
        raise InputError(f"unit is {unit!r}; expected one of {', '.join(map(repr, UNITS))}")
    return UNITS[unit]


def document_of(path: str, folder: str | None = None) -> tuple[Any, int, list[str]]:
    """The file as a document of OCCT, in millimeters, the number of its faces, and files that it needs and are missing.

    Entities that OCCT cannot load may end the process when it makes shapes of them, or some later time, and text that
    is no STEP file's may hold up its parser for good: a file that has such is refused, unless there is a folder. Then
    OCCT is given what is whole of the text, from there.
    """
    # OCCT looks for files that this one refers to beside it only by a whole path.
    file = Path(path).absolute()
    text = file.read_bytes()
    if not is_step(text):
        raise StepError(f"path is {path!r}; expected a STEP file, which begins with ISO-10303-21")
    others = references_of(text, file.parent)
    whole = _whole(path, text, folder)
    for other in others.files:
        _whole(str(other), other.read_bytes(), folder, other.relative_to(file.parent))
    del text
    return (*_loaded(path, str(file) if folder is None else whole, folder is not None), others.missing)


def _whole(path: str, text: bytes, folder: str | None, name: Path = Path("whole.step")) -> str:
    """Where what is whole of a text is: in the folder, by a name."""
    fault = first_fault(text)
    if folder is None:
        if fault is None:
            return path
        if fault.is_lost:
            raise _Damaged(f"path is {path!r}; a reference in line {fault.line} leads nowhere")
        raise _Malformed(f"path is {path!r}; its text is damaged in line {fault.line}")
    file = Path(folder) / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(text if fault is None else mended(text))
    return str(file)


def _loaded(path: str, file: str, damaged: bool) -> tuple[Any, int]:
    """`document_of` a file that has the form of one, and is, or is made of, the one at the path."""
    o = occt()
    # Settings exist once there is a reader.
    reader = o.STEPCAFControl_Reader()
    auto = o.XCAFDoc_ShapeTool.AutoNaming_s()
    try:
        o.XCAFDoc_ShapeTool.SetAutoNaming_s(False)
        with settings({"read.stepcaf.subshapes.name": 1, "read.step.product.mode": 1}):
            if reader.ReadFile(file) != o.IFSelect_RetDone:
                raise StepError(f"path is {path!r}; expected a STEP file, and OCCT cannot parse it")
            if not damaged and (broken := _broken_entities(reader)):
                raise _Damaged(f"path is {path!r}; {broken} of its entities are damaged")
            document = o.TDocStd_Document(o.TCollection_ExtendedString("XmlOcaf"))
            o.XCAFDoc_DocumentTool.SetLengthUnit_s(document, 1e-3)
            for mode in ("SetColorMode", "SetNameMode"):
                getattr(reader, mode)(True)
            if not reader.Transfer(document):
                raise StepError(f"path is {path!r}; OCCT finds no shapes in it")
    finally:
        o.XCAFDoc_ShapeTool.SetAutoNaming_s(auto)
    return document, _face_count(reader)


def _broken_entities(reader: Any) -> int:
    """Number of entities that OCCT could not load, and that it may make shapes or colors of."""
    model = reader.Reader().WS().Model()
    broken = (k for k in range(1, model.NbEntities() + 1) if model.IsErrorEntity(k))
    return sum(not _is_beside(type(model.Value(k)).__name__) for k in broken)


def _is_beside(kind: str) -> bool:
    """Whether entities of a kind say nothing of shapes: who made them and when, solid angles, dimensions."""
    return kind.endswith("AndSolidAngleUnit") or kind.startswith(_BESIDE)


def _read_apart(path: str, unit: str, strict: bool, damage: str) -> tuple[list[Body], list[str]]:
    """`bodies_of` in another process, which OCCT may end, or not end."""
    with TemporaryDirectory() as folder:
        answer = Path(folder) / "answer"
        try:
            ended = subprocess.run(
                [sys.executable or "python", "-P", "-c", _APART, path, unit, str(strict), str(answer)],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path))},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                check=False,
                timeout=PATIENCE,
                text=True,
                errors="replace",
            )
        except subprocess.TimeoutExpired:
            raise StepError(f"{damage}, and reading the rest took more than {PATIENCE:g} seconds") from None
        except OSError as error:
            raise StepError(f"{damage}, and no other process can be started to read it: {error}") from None
        if 0 < ended.returncode < ENDED:
            raise StepError(f"{damage}, and another process cannot read it: {ended.stderr.strip()[-200:]}")
        if ended.returncode != 0:
            raise StepError(f"{damage}, and OCCT cannot read the rest")
        rest, arrays = pickle.loads(answer.read_bytes())
    found = pickle.loads(rest, buffers=arrays)
    if isinstance(found, Exception):
        raise found
    return found  # type: ignore[no-any-return]  # It is what the child found.


def _face_count(reader: Any) -> int:
    """Number of faces in the file."""
    model = reader.Reader().WS().Model()
    kinds = ("StepShape_AdvancedFace", "StepShape_FaceSurface")
    return sum(type(model.Value(k)).__name__ in kinds for k in range(1, model.NbEntities() + 1))


def solids_of(path: str) -> Iterator[Any]:
    """OCCT's shapes of the bodies that `read_step` makes, in their order."""
    document = document_of(path)[0]
    root = occt().XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    for label in free_labels(root):
        for leaf in leaves(label, occt().TopLoc_Location(), None, None):
            yield from _shapes(Part(leaf.label))


def _shapes(part: Part) -> Iterator[Any]:
    """What becomes bodies of a part."""
    return solids_in(part.shape)


def solids_in(shape: Any) -> Iterator[Any]:
    """Solids of a shape, and then its shells and faces that are in no solid."""
    o = occt()
    yield from parts(shape, o.TopAbs_SOLID)
    yield from parts(shape, o.TopAbs_SHELL, o.TopAbs_SOLID)
    yield from parts(shape, o.TopAbs_FACE, o.TopAbs_SHELL)


def read_shape(
    shape: Any, said: Callable[[Any], tuple[str | None, Color | None]], color: Color | None, scale: float
) -> Shape:
    """The faces of a shape, those that cannot be read left out and told.

    Parameters
    ----------
    shape
        TopoDS_Shape.
    said
        Name and color of the shape and of its faces, None where there is none.
    color
        Of the shape if it says none.
    scale : float
        Our unit of length in a millimeter.
    """
    o = occt()
    edges = o.ShapeMap()
    o.TopExp.MapShapes_s(shape, o.TopAbs_EDGE, edges)
    name, own_color = said(shape)
    made = Shape([], own_color or color, name, [], [])
    taken: set[str] = set()
    for k, face in enumerate(parts(shape, o.TopAbs_FACE), 1):
        face = o.as_face(face)
        own, tint = said(face)
        label = unique(own or f"face {k}", taken)
        try:
            read = read_face(face, edges, label, scale)
        except Unreadable as reason:
            made.missing.append(f"{label!r}: {reason}")
            continue
        if read.deviation > EXACT:
            made.inexact.append(f"{label!r} to {read.deviation:.1g} mm")
        read.face.color = tint
        made.faces.append(read.face)
    return made


def unique(name: str, taken: set[str]) -> str:
    """The name, with a number where it is taken; taken now."""
    candidate, k = name, 2
    while candidate in taken:
        candidate, k = f"{name} {k}", k + 1
    taken.add(candidate)
    return candidate


def _pose(location: Any, scale: float) -> Pose:
    transform = location.Transformation()
    rows = np.array([[transform.Value(i, j) for j in (1, 2, 3, 4)] for i in (1, 2, 3)])
    if np.abs(rows[:, :3].T @ rows[:, :3] - np.eye(3)).max() > 1e-9 or np.linalg.det(rows[:, :3]) < 0.0:
        raise Unreadable("its placement is mirrored or scaled, which no rigid body can be")
    return Pose(scale * rows[:, 3], axes_quaternion(rows[:, :3]))


def read_step(path: str | PathLike[str], *, unit: str = "mm", strict: bool = True) -> list[Body]:
    """The solids of a STEP file, a body each.

    A part that the file's assembly uses several times becomes as many bodies, which share their faces. Geometry stays
    in the part's own coordinates; the body's pose is the placement that the assembly gives it. Names are those of
    the parts, and "nut" is followed by "nut 2"; faces have the names that the file gives them, or "face 1", "face 2"
    in its order (around voids always: OCCT does not read those names). `body.color` and `face.color` are the file's, or
    None.

    Planes, cylinders, cones, spheres, tori, swept surfaces and splines are exact rational surfaces, and so are their
    trims, up to curves around an axis that have no rational form (helices, intersections): those are followed to
    1e-10 of the face's extent in (u, v). Ends of edges that the file leaves apart within its tolerance are joined.
    Faces are a little smaller than the patches of their surfaces. Shells and faces outside of any solid become bodies
    too. What bounds no face, as wires, points and annotations, is not read. Files of parts that the file refers to are
    looked for beside it.

    Parameters
    ----------
    path
        A file of AP203, AP214 or AP242.
    unit : {"mm", "um", "cm", "m", "in", "ft"}
        Lengths are converted to it, whatever the file's own unit.
    strict : bool
        Raise where a face cannot be read, or the text is damaged. Otherwise faces are left out, statements too, and
        warnings say which and why.

    Returns
    -------
    list of Body
        In the order of the file.

    Raises
    ------
    StepError
        Not a STEP file, nothing in it, a text that is damaged in a line, or faces that cannot be read, named with the
        reasons.
    FileNotFoundError
        No such file.
    ImportError
        OCCT is not installed: pip install "assembly-solver[step]".

    Warns
    -----
    StepWarning
        Faces that are left out, or were approximated by more than 1e-7 mm (offset surfaces); damage to the file; files
        that it refers to and that are not there.
    """
    checked_unit(unit)
    if not isinstance(strict, (bool, np.bool_)):
        raise InputError(f"strict is {strict!r}; expected True or False")
    file = Path(fspath(path))
    if not file.is_file():
        raise FileNotFoundError(f"path is {str(file)!r}; {'a folder' if file.is_dir() else 'no such file'}")
    damage = ""
    try:
        bodies, left = bodies_of(str(file), unit, bool(strict))
    except _Damaged as reason:
        damage = str(reason)
        if strict and isinstance(reason, _Malformed):
            raise StepError(f"{damage}; pass strict=False for what is whole of it") from None
    if damage:
        bodies, left = _read_apart(str(file), unit, bool(strict), damage)
        left.append(f"{damage}, and what OCCT makes of the rest was read")
    for line in left:
        warnings.warn(line, StepWarning, stacklevel=2)
    return bodies


def bodies_of(path: str, unit: str, strict: bool, folder: str | None = None) -> tuple[list[Body], list[str]]:
    """The bodies of a file, also of one that is damaged if there is a folder, and what there is to warn of."""
    with quiet():
        document, count, absent = document_of(path, folder)
        found = Source(Path(path), document, count, tuple(absent), folder is not None)
        return bodies_in(found, 1.0 / checked_unit(unit), strict)


@dataclass(frozen=True, eq=False)
class Source:
    """A file as a document of OCCT, in millimeters, with the number of its faces.

    `absent` are files that it refers to and that are not there; of a damaged file what is whole is in the document.
    """

    file: Path
    document: Any
    count: int
    absent: tuple[str, ...] = ()
    damaged: bool = False


def bodies_in(source: Source, scale: float, strict: bool) -> tuple[list[Body], list[str]]:
    """The bodies of a document, and what there is to warn of; lengths are millimeters times `scale`."""
    file, count = source.file, source.count
    o = occt()
    with quiet():
        root = o.XCAFDoc_DocumentTool.ShapeTool_s(source.document.Main())
        bodies: list[Body] = []
        missing: list[str] = []
        inexact: list[str] = []
        built = 0
        taken: set[str] = set()
        read: dict[str, list[Shape]] = {}
        for label in free_labels(root):
            for leaf in leaves(label, o.TopLoc_Location(), file.stem, None):
                entry = o.TCollection_AsciiString()
                o.TDF_Tool.Entry_s(leaf.label, entry)
                key = entry.ToCString()
                if key not in read:
                    part = Part(leaf.label)
                    read[key] = [read_shape(shape, part.said, part.color, scale) for shape in _shapes(part)]
                    for shape in read[key]:
                        built += len(shape.faces) + len(shape.missing)
                        missing += [f"{leaf.name!r}, {text}" for text in shape.missing]
                        inexact += [f"{leaf.name!r}, {text}" for text in shape.inexact]
                for shape in read[key]:
                    try:
                        pose = _pose(leaf.location, scale)
                    except Unreadable as reason:
                        missing.append(f"{leaf.name!r}: {reason}")
                        continue
                    if shape.faces:
                        name = unique(shape.name or leaf.name or file.stem, taken)
                        body = Body(name, shape.faces, pose.position, pose.quaternion)
                        body.color = leaf.color or shape.color
                        bodies.append(body)
    lost = [f"{count - built} of {count} faces, of which OCCT makes nothing"] if built < count else []
    # Those of a file that is not damaged are of no shape.
    if strict and (missing or (lost and source.damaged)):
        raise StepError(
            f"path is {str(file)!r}; {_listed('not read', missing + lost)}; pass strict=False to go without"
        )
    away = [f"{name!r}, which it refers to and which is not there" for name in source.absent]
    if not bodies:
        raise StepError(f"path is {str(file)!r}; it has no faces" + (f"; {_listed('not read', away)}" if away else ""))
    missing += lost + away
    lines = (("not read", missing), ("approximated", inexact))
    return bodies, [f"{file.name}: {_listed(what, told)}" for what, told in lines if told]


def _listed(what: str, lines: list[str], most: int = 10) -> str:
    more = f"; and {len(lines) - most} more" if len(lines) > most else ""
    return f"{what}: {'; '.join(lines[:most])}{more}"
