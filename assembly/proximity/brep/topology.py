"""Which faces of a body meet where: edges and vertices found from the faces' boundary curves alone.

Boundary curves of two faces are one edge where they run through the same points in opposite directions. Where faces
divide a common border differently (one long curve against two short ones), the longer curve is cut at the vertices, so
that one boundary curve is one edge.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, positive
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.smooth_faces import smooth_faces
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import CORNER
from assembly.proximity.brep.boundary_curves import Rim, Survey, survey_of, turn
from assembly.proximity.brep.boundary_cutting import all_live, cut_at_vertices, live_boundaries
from assembly.proximity.brep.coedge_matching import STATIONS, matches_of
from assembly.proximity.brep.recut import with_cuts

__all__ = ["Edge", "Topology", "Vertex", "topology_of"]

Array = NDArray[np.float64]
# Points closer than this part of the body's size are one; curves of files agree to some 1e-7.
_TOLERANCE = 1e-6
# How far from a pole the trim is asked, as a part of the domain.
_BESIDE = 1e-6


@dataclass(frozen=True, eq=False)
class Edge:
    """Where two faces meet, or where one ends: the curve S_a(c_a(t)), c_a = faces[face_a].boundary[curve_a].

    Attributes
    ----------
    face_a, curve_a : int
        The first face and its boundary curve.
    face_b, curve_b : int or None
        The second face and its boundary curve; None for a free edge.
    map_b : (float, float)
        m0, m1: the second face's curve is at the same point at t_b = m0 + m1 t, to first order (on a closed edge: up
        to its period). (0, 0) for a free edge.
    start, end : int or None
        Vertices; None for an edge that is closed smoothly.
    length : float
        In space, to some five digits.
    convex : bool or None
        Whether material bends away at it somewhere (True), or toward the outside (False); None where the faces go
        smoothly into each other, and for a free edge.
    """

    face_a: int
    curve_a: int
    face_b: int | None
    curve_b: int | None
    map_b: tuple[float, float]
    start: int | None
    end: int | None
    length: float
    convex: bool | None


@dataclass(frozen=True, eq=False)
class Vertex(ReadOnlyArrays):
    """Where edges end.

    Attributes
    ----------
    point : (3,)
    edges : tuple of (int, int)
        Edges, and whether they start (0) or end (1) here.
    faces : tuple of int
    """

    point: Array
    edges: tuple[tuple[int, int], ...]
    faces: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Topology:
    """Faces, edges and vertices of a body.

    Attributes
    ----------
    faces : tuple of Face
        As they were given, but for boundary curves that had to be cut where other faces' edges end, and for faces with
        creases, which are cut along these and count as several.
    edges : tuple of Edge
    vertices : tuple of Vertex
    face_edges : tuple of tuple of (int or None)
        The edge of every boundary curve of every face; None for a curve that is a point.
    tolerance : float
        Points closer than this are one.
    chi : int
        Euler's characteristic: 2 for a ball, 0 for a ring, summed over the parts of a body.
    """

    faces: tuple[Face, ...]
    edges: tuple[Edge, ...]
    vertices: tuple[Vertex, ...]
    face_edges: tuple[tuple[int | None, ...], ...]
    tolerance: float
    chi: int

    @property
    def is_closed(self) -> bool:
        """Whether every edge has two faces."""
        return all(edge.face_b is not None for edge in self.edges)

    def __repr__(self) -> str:
        counts = f"{len(self.faces)} faces, {len(self.edges)} edges, {len(self.vertices)} vertices"
        return f"Topology({counts}, {'closed' if self.is_closed else 'open'})"


def topology_of(faces: Iterable[Face], tolerance: float | None = None) -> Topology:
    """Edges and vertices of a body's faces.

    Parameters
    ----------
    faces
        Of one body, in its coordinates.
    tolerance : float, optional
        Points closer than this are one; by default 1e-6 of the diagonal of the box around the faces. Curves with
        common ends may be ten times as far apart, as files have them where curved faces meet.

    Raises
    ------
    ValueError
        No faces, or a tolerance that is not positive.
    TypeError
        Something that is not a Face.
    """
    given = [part for face in _checked(faces) for part in smooth_faces(face)]
    if tolerance is None:
        boxes = [face.surface.bounding_box() for face in given]
        low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
        tolerance = max(_TOLERANCE * float(np.linalg.norm(high - low)), 1e-300)
    else:
        tolerance = positive("tolerance", tolerance)
    chains = [_chains(face, number, tolerance) for number, face in enumerate(given)]
    survey = survey_of(tuple(given), tolerance)
    survey.measure(boundary for loops in chains for loop in loops for boundary in loop)
    changed, points, ends = cut_at_vertices(chains, survey)
    for number in changed:
        parts: list[list[NurbsCurve]] = [[] for _ in given[number].boundary]
        for loop in chains[number]:
            for boundary in loop:
                parts[boundary.index].append(boundary.curve)
        given[number] = with_cuts(given[number], parts)
        assert len(given[number].boundary) == sum(map(len, parts))
    return _joined(tuple(given), chains, survey, (points, ends))


def _checked(faces: Iterable[Face]) -> list[Face]:
    if isinstance(faces, Face) or not isinstance(faces, Iterable):
        raise TypeError(f"faces is {faces!r}; expected several of Face")
    given: list[Any] = list(faces)
    for k, face in enumerate(given):
        if not isinstance(face, Face):
            raise TypeError(f"faces[{k}] is {face!r}; expected a Face")
    if not given:
        raise InputError("faces is empty; expected at least one Face")
    return given


def _chains(face: Face, number: int, tolerance: float) -> list[list[Rim]]:
    """The loops of a face, each a list of rims."""
    return [[Rim(number, k, face.boundary[k], tolerance) for k in chain] for chain in face.chains]


def _joined(
    faces: tuple[Face, ...],
    chains: list[list[list[Rim]]],
    survey: Survey,
    vertices_and_ends: tuple[Array, dict[Rim, tuple[int, int]]],
) -> Topology:
    """The topology of rims that match one to one, given vertices and between which of them rims run."""
    tolerance = survey.tolerance
    boundaries = all_live(chains)
    points, ends = vertices_and_ends
    matches = matches_of(boundaries, ends, np.array([face.sign for face in faces], dtype=float), survey)
    places = {
        boundary: k for loops in chains for k, boundary in enumerate(boundary for loop in loops for boundary in loop)
    }
    numbers: dict[Rim, int] = {}
    edges: list[Edge] = []
    for boundary in boundaries:
        if boundary in numbers:
            continue
        match = matches.get(boundary)
        other = None if match is None else match.b
        start, end = ends.get(boundary, (None, None))
        numbers[boundary] = len(edges)
        if other is not None:
            numbers[other] = len(edges)
        edges.append(
            Edge(
                boundary.number,
                places[boundary],
                None if other is None else other.number,
                None if other is None else places[other],
                (0.0, 0.0) if match is None else match.map_b,
                start,
                end,
                boundary.length,
                None if match is None else match.convex,
            )
        )
    incident: list[list[tuple[int, int]]] = [[] for _ in points]
    for k, edge in enumerate(edges):
        for side, vertex in enumerate((edge.start, edge.end)):
            if vertex is not None:
                incident[vertex].append((k, side))
    around: list[set[int]] = [set() for _ in points]
    for boundary, pair in ends.items():
        for vertex in pair:
            around[vertex].add(boundary.number)
    apexes = [(apex, number) for number, face in enumerate(faces) for apex in _apexes(face, points, tolerance)]
    points = np.concatenate([points, *(apex[None] for apex, _ in apexes)])
    incident += [[] for _ in apexes]
    around += [{number} for _, number in apexes]
    points.flags.writeable = False
    vertices = tuple(
        Vertex(point, tuple(at), tuple(sorted(near))) for point, at, near in zip(points, incident, around, strict=True)
    )
    face_edges = tuple(tuple(numbers.get(boundary) for loop in loops for boundary in loop) for loops in chains)
    chi = len(vertices) - len(apexes) - sum(edge.start is not None for edge in edges)
    chi += sum(_characteristic(face, loops, ends) for face, loops in zip(faces, chains, strict=True))
    return Topology(faces, tuple(edges), vertices, face_edges, tolerance, chi)


def _characteristic(face: Face, loops: list[list[Rim]], ends: dict[Rim, tuple[int, int]]) -> int:
    """Euler's characteristic of the inside of a face: two for the sphere, less one for every loop."""
    count = 0
    # At poles of the surface chains end, and others go on: groups of vertices that such chains join.
    groups: list[set[int]] = []
    for live in map(live_boundaries, loops):
        if not live:
            continue
        start, end = (-1, -1) if not live[0].anchored else (ends[live[0]][0], ends[live[-1]][1])
        if start == end:
            count += 1
            continue
        joined = [group for group in groups if start in group or end in group]
        groups = [group for group in groups if group not in joined] + [{start, end}.union(*joined)]
    whole_torus = all(face.surface.closed) and face.outer is None
    return (0 if whole_torus else 2) - count - len(groups)


def _apexes(face: Face, points: Array, tolerance: float) -> list[Array]:
    """Poles inside a face where it has no tangent plane, as the apex of a cone, but for those among given points."""
    surface = face.surface
    found = []
    for k in range(4):
        if not surface._pole_bits >> k & 1:
            continue
        axis, side = divmod(k, 2)
        low, high = surface.domain[axis]
        start, stop = surface.domain[1 - axis]
        uv = np.empty((2, STATIONS.size))
        uv[1 - axis] = start + (stop - start) * STATIONS
        # The trim is asked beside the pole: there the pole's own side is one of its curves.
        uv[axis] = high - _BESIDE * (high - low) if side else low + _BESIDE * (high - low)
        if face.boundary and (face.locate(*uv) < 0).any():
            continue
        uv[axis] = (low, high)[side]
        apex = surface.evaluate(uv[0, 0], uv[1, 0])
        if len(points) and np.linalg.norm(points - apex, axis=1).min() <= tolerance:
            continue
        try:
            normals = surface.normal(*uv)
        except InputError:
            found.append(apex)
            continue
        if turn(normals, normals[0]).max() > CORNER:
            found.append(apex)
    return found
