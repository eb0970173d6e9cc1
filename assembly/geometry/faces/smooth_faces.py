"""A face cut into smooth ones along the creases of its surface."""

from __future__ import annotations

from itertools import pairwise

from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.seams.region_cuts import cut_in_two, cut_open
from assembly.geometry.seams.region_pieces import Piece, Uncut
from assembly.geometry.seams.region_strips import area_of, corners_of, strip, winds
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["has_creases", "smooth_faces"]

Loops = list[list[Piece]]
Interval = tuple[float, float]


def has_creases(face: Face) -> bool:
    """Whether the surface of a face has a crease anywhere."""
    return any(lines.size > 0 for lines in face.surface._creases)


def smooth_faces(face: Face) -> list[Face]:
    """The face cut along the creases of its surface, parameters as they are; itself where there are none.

    Raises
    ------
    InputError
        A loop touches a crease without crossing it, so that parts would touch themselves.
    """
    if not has_creases(face):
        return [face]
    try:
        if face.outer is None and not face.holes:
            return [
                _made(face, _part(face.surface, u, v)) for u in _spans(face.surface, 0) for v in _spans(face.surface, 1)
            ]
        return _cells(face, *cut_open(face))
    except (Uncut, InputError) as error:
        raise InputError(f"{face!r} has a crease and cannot be cut along it: {error}") from error


def _cells(face: Face, surface: NurbsSurface, chains: Loops) -> list[Face]:
    """The smooth parts of a face with loops, which go round an opened surface as chains."""
    parts: list[Face] = []
    for u, column in _strips(surface, 0, chains):
        for v, cell in _strips(surface, 1, column):
            if not cell:
                continue
            piece = _part(surface, u, v)
            corners = [corners_of(loop) for loop in cell]
            curves = [[each.curve for each in loop] for loop in cell]
            outer = [area_of(each) > 0.0 for each in corners]
            for k in range(len(cell)):
                if outer[k]:
                    inner = (h for h in range(len(cell)) if not outer[h] and winds(corners[k], corners[h][0]))
                    parts.append(_made(face, piece, curves[k], [curves[h] for h in inner]))
    return parts


def _strips(surface: NurbsSurface, axis: int, chains: Loops) -> list[tuple[Interval, Loops]]:
    """The spans between creases, and what chains go round there."""
    result = []
    spans = _spans(surface, axis)
    for span in spans[:-1]:
        below, chains = cut_in_two(chains, surface, axis, span[1])
        result.append((span, below))
    return [*result, (spans[-1], chains)]


def _spans(surface: NurbsSurface, axis: int) -> list[Interval]:
    """The parts of the domain between creases; two where the surface closes with its only crease."""
    low, high = surface.domain[axis]
    lines = surface._creases[axis]
    inside = [float(at) for at in lines if at > low]
    if lines.size and not inside:
        at = surface.breaks()[axis]
        inside = [float(at[len(at) // 2]) if len(at) > 2 else 0.5 * (low + high)]
    return list(pairwise([low, *inside, high]))


def _part(surface: NurbsSurface, u: Interval, v: Interval) -> NurbsSurface:
    """The part of a surface over a rectangle of its domain."""
    for axis, span in enumerate((u, v)):
        if span != surface.domain[axis]:
            surface = strip(surface, axis, *span)
    return surface


def _made(face: Face, surface: NurbsSurface, *loops: object) -> Face:
    # Loops are an outer one and a list of holes, or none: mypy cannot know which of the arguments each is.
    return Face(surface, *loops, name=face.name, reversed=face.reversed, color=face.color)  # type: ignore[arg-type]
