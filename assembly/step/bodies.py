"""Bodies made of documents and shapes of OCCT."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from assembly._garbage import uncollected
from assembly.errors import AssemblyError
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.step.documents import Document, StepError, document_of
from assembly.step.edges import Edges
from assembly.step.faces import read_faces
from assembly.step.images import image_of, placement_of
from assembly.step.occt import occt, parts, quiet
from assembly.step.profiles import Unreadable
from assembly.step.tree import Color, Leaf, Part, entry_of, free_labels, leaves

__all__ = ["Source", "Unrepaired", "bodies_in", "read_shape", "solids_in", "solids_of", "unique"]

# Deviations below this [mm] are not reported: OCCT takes points that are nearer to each other for one.
EXACT = 1e-7


@dataclass
class Shape:
    """Faces of one solid, or of one sheet, in the part's own coordinates.

    `is_doubtful` says that OCCT has another part of the surface for one of them, `is_against` that the outer wire of
    one has the material on its right.
    """

    faces: list[Face]
    color: Color | None
    name: str | None
    missing: list[str]
    inexact: list[str]
    slits: list[str] = field(default_factory=list)
    is_doubtful: bool = False
    is_against: bool = False


class Unrepaired(AssemblyError):
    """A face of a document without OCCT's repairs cannot be read; with them it may be."""


@dataclass(frozen=True, eq=False)
class Source:
    """A file as a document of OCCT, in millimeters, with the number of its faces.

    `absent` has the names of missing files that it refers to. The document of a damaged file holds its undamaged
    entities. `names` are those of the bodies, in order, if the document does not have them. `advance` is called with
    numbers of faces that were read. Of a document without `repairs`, one face that cannot be read is enough to give up.
    `others` are the documents that have the parts of labels, by the entries of these, all without repairs.
    """

    file: Path
    document: Any
    count: int
    absent: tuple[str, ...] = ()
    damaged: bool = False
    names: tuple[str | None, ...] = ()
    advance: Callable[[int], object] = bool
    repairs: bool = True
    others: Mapping[str, Document] = field(default_factory=dict)


def solids_of(path: str) -> Iterator[Any]:
    """OCCT's shapes of the bodies that `read_step` makes, in their order."""
    document = document_of(path)
    root = occt().XCAFDoc_DocumentTool.ShapeTool_s(document.made.Main())
    for label in free_labels(root):
        for leaf in leaves(label, occt().TopLoc_Location(), None, None, document.others):
            yield from solids_in(Part(leaf.label).shape)


def solids_in(shape: Any) -> Iterator[Any]:
    """Solids of a shape, and then its shells and faces that are in no solid."""
    o = occt()
    yield from parts(shape, o.TopAbs_SOLID)
    yield from parts(shape, o.TopAbs_SHELL, o.TopAbs_SOLID)
    yield from parts(shape, o.TopAbs_FACE, o.TopAbs_SHELL)


def read_shape(
    shape: Any, said: Callable[[Any], tuple[str | None, Color | None]], color: Color | None, scale: float
) -> Shape:
    """The faces of a shape, those that cannot be read left out and told, apart from them those that are slits.

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
    edges = Edges(shape)
    name, own_color = said(shape)
    made = Shape([], own_color or color, name, [], [])
    taken: set[str] = set()
    faces = [o.as_face(face) for face in parts(shape, o.TopAbs_FACE)]
    names, tints = [], []
    for k, face in enumerate(faces, 1):
        own, tint = said(face)
        names.append(unique(own or f"face {k}", taken))
        tints.append(tint)
    read = read_faces(faces, edges, names, scale)
    made.is_doubtful = edges.is_doubtful
    for face, label, tint, one in zip(faces, names, tints, read, strict=True):
        if isinstance(one, Unreadable):
            if _is_slit(face):
                made.slits.append(repr(label))
            else:
                made.missing.append(f"{label!r}: {one}")
            continue
        if one.deviation > EXACT:
            made.inexact.append(f"{label!r} to {one.deviation:.1g} mm")
        made.is_against |= one.is_against
        one.face.color = tint
        made.faces.append(one.face)
    return made


def _outward(shape: Any, made: Shape, is_repaired: bool) -> Shape:
    """What was read of a shape, turned inside out where OCCT has turned it.

    OCCT judges which side of a shell is outside by the faces as it reads them, and those with poles may be wrong: where
    it has another part of the surface, or has repaired it, or took the rest of a sphere before it was written.
    """
    o = occt()
    bits = {face.surface._pole_bits for face in made.faces}
    doubtful = made.is_doubtful or bool(bits & {3, 12}) or is_repaired and bits != {0}
    if not doubtful or made.missing or shape.ShapeType() != o.TopAbs_SOLID:
        return made
    if len(parts(shape, o.TopAbs_SHELL)) == 1 and sum(face.volume_integral() for face in made.faces) < 0.0:
        for face in made.faces:
            face.reversed = not face.reversed
    return made


def _is_slit(face: Any) -> bool:
    """Whether a face is nowhere wider than its edges are exact: it has no area, and nothing is missing without it."""
    o = occt()
    if o.BRep_Tool.Surface_s(face) is None:
        return False
    along, over = o.GProp_GProps(), o.GProp_GProps()
    o.BRepGProp.LinearProperties_s(face, along)
    o.BRepGProp.SurfaceProperties_s(face, over)
    edges = [o.as_edge(edge) for edge in parts(face, o.TopAbs_EDGE)]
    tolerance = max((o.BRep_Tool.Tolerance_s(edge) for edge in edges), default=0.0)
    return bool(abs(over.Mass()) <= tolerance * along.Mass())


def unique(name: str, taken: set[str]) -> str:
    """The name, with a number where it is taken; taken now."""
    candidate, k = name, 2
    while candidate in taken:
        candidate, k = f"{name} {k}", k + 1
    taken.add(candidate)
    return candidate


def _part_read(leaf: Leaf, factor: float, scale: float, repairs: bool) -> list[Shape]:
    """What is read of a part, of a file without repairs with these where they are needed.

    Raises
    ------
    Unrepaired
        They are, and the part is not in a document of its own.
    """
    made = _shapes_of(leaf.label, factor, scale, repairs and leaf.home is None)
    # Areas of a loop that crosses itself cancel: a face with none is judged with repairs, which cut it. Of a wire that
    # runs the wrong way OCCT turns the face instead, unless it has repaired it before.
    needs_repairs = any(shape.missing or shape.slits or shape.is_against for shape in made)
    if not needs_repairs or repairs and leaf.home is None:
        return made
    if leaf.home is None:
        raise Unrepaired(f"{leaf.name!r} has a face that cannot be read")
    o, again = occt(), document_of(leaf.home.path)
    label = o.TDF_Label()
    o.TDF_Tool.Label_s(again.made.GetData(), entry_of(leaf.label), label, False)
    return made if label.IsNull() else _shapes_of(label, factor, scale, is_repaired=True)


def _shapes_of(label: Any, factor: float, scale: float, is_repaired: bool) -> list[Shape]:
    """The solids and sheets of the part of a label, scaled about its origin."""
    original = Part(label)
    images = (image_of(shape, original.said, factor) for shape in solids_in(original.shape))
    return [_outward(shape, read_shape(shape, told, original.color, scale), is_repaired) for shape, told in images]


def bodies_in(source: Source, scale: float, strict: bool) -> tuple[list[Body], list[str]]:
    """The bodies of a document, and what there is to warn of; lengths are millimeters times `scale`."""
    file, count = source.file, source.count
    o = occt()
    with quiet(), uncollected():
        root = o.XCAFDoc_DocumentTool.ShapeTool_s(source.document.Main())
        bodies: list[Body] = []
        missing: list[str] = []
        inexact: list[str] = []
        slits: list[str] = []
        built = 0
        taken: set[str] = set()
        read: dict[tuple[str, str, float], list[Shape]] = {}
        said = iter(source.names)
        for label in free_labels(root):
            for leaf in leaves(label, o.TopLoc_Location(), file.stem, None, source.others):
                try:
                    pose, factor = placement_of(leaf.location, scale)
                except Unreadable as reason:
                    missing.append(f"{leaf.name!r}: {reason}")
                    continue
                # A scaled or mirrored image is read as another part, but the file's number of faces has it only once.
                key = leaf.home.path if leaf.home else "", entry_of(leaf.label), factor
                if key not in read:
                    read[key] = _part_read(leaf, factor, scale, source.repairs)
                    faces = sum(len(shape.faces) + len(shape.missing) + len(shape.slits) for shape in read[key])
                    if sum(other[:2] == key[:2] for other in read) == 1:
                        source.advance(faces)
                        built += faces
                    for shape in read[key]:
                        missing += [f"{leaf.name!r}, {text}" for text in shape.missing]
                        inexact += [f"{leaf.name!r}, {text}" for text in shape.inexact]
                        slits += [f"{leaf.name!r}, {text}" for text in shape.slits]
                for shape in read[key]:
                    own, at = next(said, None) or shape.name, leaf.name or file.stem
                    if shape.faces:
                        name = unique(own or at, taken)
                        body = Body(name, shape.faces, pose.position, pose.quaternion)
                        body.color = leaf.color or shape.color
                        bodies.append(body)
    lost = [f"{count - built} of {count} faces, of which OCCT makes nothing"] if built < count else []
    # Faces that an undamaged file has beyond those of its bodies belong to no shape: nothing is missing.
    if strict and (missing or (lost and source.damaged)):
        raise StepError(
            f"path is {str(file)!r}; {_listed('not read', missing + lost)}; pass strict=False to read the rest"
        )
    away = [f"{name!r}, which it refers to and which is not there" for name in source.absent]
    if not bodies:
        raise StepError(f"path is {str(file)!r}; it has no faces" + (f"; {_listed('not read', away)}" if away else ""))
    missing += lost + away
    lines = (("not read", missing), ("left out, as they have no area", slits), ("approximated", inexact))
    return bodies, [f"{file.name}: {_listed(what, told)}" for what, told in lines if told]


def _listed(what: str, lines: list[str], most: int = 10) -> str:
    more = f"; and {len(lines) - most} more" if len(lines) > most else ""
    return f"{what}: {'; '.join(lines[:most])}{more}"
