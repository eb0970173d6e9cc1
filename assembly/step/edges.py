"""Edges of a solid: their numbers, what each forgives, and the faces that meet at them.

What is asked of OCCT is asked once an edge, and of faces on other sides only for edges that are loose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from math import isclose, isfinite
from typing import Any, NamedTuple, TypeVar

import numpy as np

from assembly.errors import AssemblyError, InputError
from assembly.step.occt import occt, parts
from assembly.step.pole_wires import polar
from assembly.step.profiles import Unreadable, point
from assembly.step.projected import Side, Space, is_loose, space_of
from assembly.step.surfaces import Patch, patch
from assembly.step.wires import Box, Traced, Wire, bounds, wires_of

__all__ = ["Edges", "Known", "Laid"]

_Made = TypeVar("_Made")
# OCCT stands for "unbounded" with numbers beyond this one.
_FAR = 1e50
# Tolerances of files count up to this part of the part's size: one of a meter does not make all faces meet.
_FORGIVEN = 1e-2


class Known(NamedTuple):
    """What is known of an edge whichever face it is on.

    Attributes
    ----------
    name : str
        By its number.
    tolerance : float
        The largest of it and its vertices [mm].
    loose : bool
        Whether it has a tolerance of its own.
    """

    name: str
    tolerance: float
    loose: bool


class Laid(NamedTuple):
    """A face that is taken forward: its surface, its wires, and the patch that it lies in."""

    surface: Any
    wires: list[Wire]
    patch: Patch


class Edges:
    """The edges of a solid, by their numbers from 1, and the two faces that meet at each.

    `is_doubtful` is set if OCCT has another part of the surface for a face that was laid.
    """

    def __init__(self, shape: Any) -> None:
        o = occt()
        self.shape = shape
        self._map = o.ShapeMap()
        o.TopExp.MapShapes_s(shape, o.TopAbs_EDGE, self._map)
        self._find = self._map.FindIndex
        self._known: dict[int, Known] = {}
        self._face_map = o.ShapeMap()
        o.TopExp.MapShapes_s(shape, o.TopAbs_FACE, self._face_map)
        self._laid: dict[int, Laid | AssemblyError] = {}
        self._sides: dict[tuple[int, int], Side] = {}
        self._spaces: dict[int, Space | None] = {}
        self.is_doubtful = False

    def known(self, edge: Any) -> Known:
        """What is known of an edge."""
        number = self._find(edge)
        known = self._known.get(number)
        if known is None:
            o = occt()
            tolerance = max(o.BRep_Tool.Tolerance_s(edge), o.BRep_Tool.MaxTolerance_s(edge, o.TopAbs_VERTEX))
            known = Known(f"edge {number}", tolerance, is_loose(edge))
            # What is not of the solid has no number.
            if number:
                self._known[number] = known
        return known

    def known_of(self, wire: Wire) -> list[Known]:
        """What is known of the edges of a wire."""
        if not wire.known:
            wire.known = [self.known(traced.edge) for traced in wire.edges]
        return wire.known

    def forgiven(self, tolerance: float, size: float) -> float:
        """A tolerance on a face of a size: at most a share of that or of the part's, whichever is larger."""
        if tolerance <= _FORGIVEN * size:
            return tolerance
        return min(tolerance, _FORGIVEN * max(size, self._size))

    @cached_property
    def _size(self) -> float:
        """Diagonal of the box around the vertices; zero where there are none."""
        o = occt()
        points = [point(o.BRep_Tool.Pnt_s(o.as_vertex(one))) for one in parts(self.shape, o.TopAbs_VERTEX)]
        return float(np.linalg.norm(np.ptp(np.array(points), axis=0))) if points else 0.0

    def lay(self, faces: Sequence[Any]) -> None:
        """Find what faces of the solid, which are taken forward, lie in, all of them before `laid` is asked for one."""
        left = {self._face_map.FindIndex(face): face for face in faces}
        drawn = {number: _kept(_outlined, face) for number, face in left.items() if number}
        self.is_doubtful = any(isinstance(outline, _Outline) and outline.is_other for outline in drawn.values())
        for number, outline in drawn.items():
            self._laid[number] = outline if isinstance(outline, AssemblyError) else _kept(_laid, outline)

    def laid(self, face: Any) -> Laid:
        """What a face of the solid lies in; it is taken forward.

        Raises
        ------
        Unreadable, InputError
            Saying why not.
        """
        number = self._face_map.FindIndex(face)
        known = self._laid.get(number) if number else None
        if known is None:
            outline = _kept(_outlined, face)
            known = outline if isinstance(outline, AssemblyError) else _kept(_laid, outline)
            if number:
                self._laid[number] = known
        if isinstance(known, AssemblyError):
            raise known
        return known

    @cached_property
    def _faces(self) -> dict[int, list[Any]]:
        """The faces of each edge, made forward."""
        o = occt()
        found: dict[int, list[Any]] = {}
        for face in parts(self.shape, o.TopAbs_FACE):
            forward = o.as_face(face.Oriented(o.TopAbs_FORWARD))
            for edge in parts(forward, o.TopAbs_EDGE):
                found.setdefault(self._map.FindIndex(edge), []).append(forward)
        return found

    def space(self, edge: Any) -> Space | None:
        """The edge's curve in space; None where it has none for the parameters of those on surfaces."""
        number = self._map.FindIndex(edge)
        if number not in self._spaces:
            self._spaces[number] = space_of(edge)
        return self._spaces[number]

    def side(self, traced: Traced, face: Any, where: Patch) -> Side:
        """The surface of a face, with the curve on it of one of its edges that is no seam."""
        key = self._map.FindIndex(traced.edge), self._face_map.FindIndex(face)
        if key not in self._sides:
            self._sides[key] = Side(traced.curve, where, traced.low, traced.high)
        return self._sides[key]

    def beyond(self, traced: Traced, face: Any) -> Side | None:
        """The surface, with the edge's curve on it, of the face on the other side of an edge; None if not just one."""
        around = self._faces.get(self._map.FindIndex(traced.edge), [])
        others = [one for one in around if not one.IsSame(face)]
        if len(around) != 2 or len(others) != 1:
            return None
        try:
            there = self.laid(others[0])
        except (Unreadable, InputError):
            return None
        same = (one for wire in there.wires for one in wire.edges if one.edge.IsSame(traced.edge))
        other = next(same, None)
        if other is None or other.curve is None:
            return None
        if not (isclose(traced.low, other.low, rel_tol=1e-9) and isclose(traced.high, other.high, rel_tol=1e-9)):
            return None
        return self.side(other, others[0], there.patch)


class _Outline(NamedTuple):
    """A surface, the wires of a face on it, their extent, and whether OCCT has another part of the surface."""

    surface: Any
    wires: list[Wire]
    box: Box
    is_other: bool


def _outlined(face: Any) -> _Outline:
    """The outline of a face."""
    surface = occt().BRep_Tool.Surface_s(face)
    if surface is None:
        raise Unreadable("it has no surface")
    wires = wires_of(face, surface)
    drawn = polar(wires, surface, face)
    wires, box, is_other = drawn or (wires, bounds(wires, surface, face), False)
    if not all(isfinite(x) and abs(x) < _FAR for x in box):
        raise Unreadable("it has no boundary, and its surface is unbounded")
    return _Outline(surface, wires, box, is_other)


def _laid(outline: _Outline) -> Laid:
    """What a face of an outline lies in."""
    return Laid(outline.surface, outline.wires, patch(outline.surface, outline.box))


def _kept(step: Callable[[Any], _Made], given: Any) -> _Made | AssemblyError:
    """What a step makes, or why it does not."""
    try:
        return step(given)
    except (Unreadable, InputError) as reason:
        return reason
