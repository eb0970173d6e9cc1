"""Which faces of a body meet where: edges and vertices found from the faces' boundary curves alone.

Boundary curves of two faces are one edge where they run through the same points in opposite directions. Where faces
divide a common border differently (one long curve against two short ones), the longer curve is cut at the vertices, so
that one boundary curve is one edge.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from assembly.errors import InputError, positive
from assembly.geometry.curve import NurbsCurve
from assembly.geometry.curve_parts import CORNER
from assembly.geometry.face import Face
from assembly.proximity.recut import with_cuts
from assembly.proximity.rims import Rim, corners, cross, turn

__all__ = ["Edge", "Topology", "Vertex", "topology_of"]

Array = NDArray[np.float64]
# Points closer than this part of the body's size are one; curves of files agree to some 1e-7.
_TOLERANCE = 1e-6
# Lengths of one curve on two faces differ by less.
_SAME_LENGTH = 1e-2
# Where two curves are compared, as parts of the domain.
_STATIONS = np.linspace(0.0, 1.0, 11)[1:-1]
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
class Vertex:
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
        As they were given, but for boundary curves that had to be cut where other faces' edges end.
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
        Points closer than this are one; by default 1e-6 of the diagonal of the box around the faces.

    Raises
    ------
    ValueError
        No faces, or a tolerance that is not positive.
    TypeError
        Something that is not a Face.
    """
    given = _checked(faces)
    if tolerance is None:
        boxes = [face.surface.bounding_box() for face in given]
        low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
        tolerance = max(_TOLERANCE * float(np.linalg.norm(high - low)), 1e-300)
    else:
        tolerance = positive("tolerance", tolerance)
    chains = [_chains(face, number, tolerance) for number, face in enumerate(given)]
    for number in _cut_at_vertices(chains, tolerance):
        parts: list[list[NurbsCurve]] = [[] for _ in given[number].boundary]
        for loop in chains[number]:
            for rim in loop:
                parts[rim.index].append(rim.curve)
        given[number] = with_cuts(given[number], parts)
    return _joined(tuple(given), chains, tolerance)


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
    return [[Rim(face, number, k, face.boundary[k], tolerance) for k in chain] for chain in face.chains]


def _live(rims: Iterable[Rim]) -> list[Rim]:
    """Those that are not points."""
    return [rim for rim in rims if rim.length > rim.tolerance]


def _all_live(chains: Sequence[list[list[Rim]]]) -> list[Rim]:
    return [rim for loops in chains for loop in loops for rim in _live(loop)]


def _replaced(loops: list[list[Rim]], cuts: dict[Rim, Array]) -> None:
    """Cut rims of the loops of a face, in place."""
    for k, loop in enumerate(loops):
        loops[k] = [part for rim in loop for part in (rim.parts(cuts[rim]) if rim in cuts else [rim])]


def _cut_at_vertices(chains: list[list[list[Rim]]], tolerance: float) -> set[int]:
    """Cut rims at corners and where other rims end, in place; the numbers of the faces that changed."""
    changed = set()
    for number, loops in enumerate(chains):
        cuts = {rim: at for loop in loops for rim in _live(loop) if (at := corners(rim)).size}
        if cuts:
            _replaced(loops, cuts)
            changed.add(number)
        for loop in loops:
            live = _live(loop)
            if len(live) == 1 and live[0].closed:
                live[0].anchored = live[0].corner
    while True:
        rims = _all_live(chains)
        points, ends = _merged(rims, tolerance)
        found = _crossings(rims, points, ends, tolerance)
        if not found:
            return changed
        for number in {rim.number for rim in found}:
            cuts = {rim: at for rim, at in found.items() if rim.number == number and at.size}
            if cuts:
                _replaced(chains[number], cuts)
                changed.add(number)


def _merged(rims: Sequence[Rim], tolerance: float) -> tuple[Array, dict[Rim, tuple[int, int]]]:
    """Vertices (n, 3) where anchored rims end, and the pair of them of every such rim."""
    anchored = [rim for rim in rims if rim.anchored]
    if not anchored:
        return np.empty((0, 3)), {}
    ends = np.concatenate([rim.ends for rim in anchored])
    pairs = cKDTree(ends).query_pairs(tolerance, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(ends), len(ends)))
    count, labels = connected_components(links, directed=False)
    points = np.zeros((count, 3))
    np.add.at(points, labels, ends)
    points /= np.bincount(labels, minlength=count)[:, None]
    numbers = labels.reshape(-1, 2).tolist()
    return points, {rim: (start, end) for rim, (start, end) in zip(anchored, numbers, strict=True)}


def _crossings(
    rims: Sequence[Rim], points: Array, ends: dict[Rim, tuple[int, int]], tolerance: float
) -> dict[Rim, Array]:
    """Where rims run through vertices that they do not end at: increasing parameters.

    A closed rim with a vertex at the point where it closes is anchored there; it comes with no parameters.
    """
    if not len(points):
        return {}
    balls = [rim.balls() for rim in rims]
    centers = np.concatenate([ball[0] for ball in balls])
    radii = np.concatenate([ball[1] for ball in balls]) + tolerance
    owners = np.repeat(np.arange(len(rims)), [len(ball[1]) for ball in balls])
    inside = cKDTree(points).query_ball_point(centers, radii)
    near: dict[int, set[int]] = defaultdict(set)
    for owner, found in zip(owners.tolist(), inside, strict=True):
        if found:
            near[owner].update(found)
    cuts = {}
    for owner, vertices in near.items():
        rim = rims[owner]
        others = sorted(vertices.difference(ends.get(rim, ())))
        if not others:
            continue
        t, distance = rim.nearest(points[others])
        reached = distance <= tolerance
        # Ends are merged already: a vertex as near to one as this is a vertex beside it.
        from_ends = np.linalg.norm(points[others][:, None] - rim.ends, axis=2).min(axis=1)
        at = np.sort(t[reached & (from_ends > 2.0 * tolerance)])
        if rim.anchored and not at.size:
            continue
        if not rim.anchored:
            if not reached.any():
                continue
            rim.anchored = True
        cuts[rim] = at
    return cuts


@dataclass(frozen=True, eq=False)
class _Match:
    """Two rims through the same points: how far apart they are, the map of parameters, and how they bend."""

    distance: float
    a: Rim
    b: Rim
    map_b: tuple[float, float]
    convex: bool | None


def _compared(a: Rim, b: Rim) -> _Match | None:
    """The match of two rims, if they run through the same points in opposite directions."""
    if abs(a.length - b.length) > _SAME_LENGTH * max(a.length, b.length) + 4.0 * a.tolerance:
        return None
    low, high = a.curve.domain
    t = low + (high - low) * _STATIONS
    points, normals_a, along_a = a.frames(t)
    start, end = b.curve.domain
    at_b, distance = b.nearest(points, end - (end - start) * _STATIONS)
    if distance.max() > a.tolerance:
        return None
    _, normals_b, along_b = b.frames(at_b)
    if (along_a * along_b).sum() >= 0.0:
        return None
    if b.closed:
        at_b = np.unwrap(at_b, period=end - start)
    centered = t - t.mean()
    slope = float(centered @ at_b / (centered @ centered))
    shift = float(at_b.mean() - slope * t.mean())
    return _Match(float(distance.max()), a, b, (shift, slope), _bend(normals_a, along_a, normals_b))


def _bend(normals_a: Array, along_a: Array, normals_b: Array) -> bool | None:
    """Whether two faces make a convex edge: from their normals and the first one's tangent at some points."""
    inward = cross(normals_a, along_a)
    size_a, size_b = np.linalg.norm(normals_a, axis=1), np.linalg.norm(normals_b, axis=1)
    size = np.linalg.norm(inward, axis=1) * size_b
    regular = (size > 0.0) & (size_a > 0.0)
    if not regular.any():
        return None
    sine = -(inward * normals_b).sum(axis=1)[regular] / size[regular]
    cosine = (normals_a * normals_b).sum(axis=1)[regular] / (size_a * size_b)[regular]
    angle = np.arctan2(sine, cosine)
    # Folded back on itself, an edge is a blade whichever way rounding turns it.
    if angle.max() > CORNER or (cosine < -1.0 + CORNER**2).any():
        return True
    return False if angle.min() < -CORNER else None


def _matches(rims: Sequence[Rim], ends: dict[Rim, tuple[int, int]]) -> dict[Rim, _Match]:
    """The match of every rim that has one."""
    groups: dict[tuple[int, int], list[Rim]] = defaultdict(list)
    for rim, (start, end) in ends.items():
        groups[min(start, end), max(start, end)].append(rim)
    candidates = [pair for group in groups.values() for pair in combinations(group, 2)]
    rings = [rim for rim in rims if not rim.anchored]
    if rings:
        middles = np.array([rim.middle() for rim in rings])
        near = cKDTree(middles).query_ball_point(middles, [0.05 * rim.length for rim in rings])
        candidates += [(rings[i], rings[j]) for i, found in enumerate(near) for j in found if i < j]
    found = [match for a, b in candidates if (match := _compared(a, b)) is not None]
    found.sort(key=lambda match: match.distance)
    taken: dict[Rim, _Match] = {}
    for match in found:
        if match.a not in taken and match.b not in taken:
            taken[match.a] = taken[match.b] = match
    return taken


def _joined(faces: tuple[Face, ...], chains: list[list[list[Rim]]], tolerance: float) -> Topology:
    """The topology of rims that match one to one."""
    rims = _all_live(chains)
    points, ends = _merged(rims, tolerance)
    matches = _matches(rims, ends)
    places = {rim: k for loops in chains for k, rim in enumerate(rim for loop in loops for rim in loop)}
    numbers: dict[Rim, int] = {}
    edges: list[Edge] = []
    for rim in rims:
        if rim in numbers:
            continue
        match = matches.get(rim)
        other = None if match is None else match.b
        start, end = ends.get(rim, (None, None))
        numbers[rim] = len(edges)
        if other is not None:
            numbers[other] = len(edges)
        edges.append(
            Edge(
                rim.number,
                places[rim],
                None if other is None else other.number,
                None if other is None else places[other],
                (0.0, 0.0) if match is None else match.map_b,
                start,
                end,
                rim.length,
                None if match is None else match.convex,
            )
        )
    incident: list[list[tuple[int, int]]] = [[] for _ in points]
    for k, edge in enumerate(edges):
        for side, vertex in enumerate((edge.start, edge.end)):
            if vertex is not None:
                incident[vertex].append((k, side))
    around: list[set[int]] = [set() for _ in points]
    for rim, pair in ends.items():
        for vertex in pair:
            around[vertex].add(rim.number)
    tips = [(tip, number) for number, face in enumerate(faces) for tip in _tips(face, points, tolerance)]
    points = np.concatenate([points, *(tip[None] for tip, _ in tips)])
    incident += [[] for _ in tips]
    around += [{number} for _, number in tips]
    points.flags.writeable = False
    vertices = tuple(
        Vertex(point, tuple(at), tuple(sorted(near))) for point, at, near in zip(points, incident, around, strict=True)
    )
    face_edges = tuple(tuple(numbers.get(rim) for loop in loops for rim in loop) for loops in chains)
    chi = len(vertices) - len(tips) - sum(edge.start is not None for edge in edges)
    chi += sum(_characteristic(face, loops, ends) for face, loops in zip(faces, chains, strict=True))
    return Topology(faces, tuple(edges), vertices, face_edges, tolerance, chi)


def _characteristic(face: Face, loops: list[list[Rim]], ends: dict[Rim, tuple[int, int]]) -> int:
    """Euler's characteristic of the inside of a face: two for the sphere, less one for every loop."""
    count = 0
    # At poles of the surface chains end, and others go on: groups of vertices that such chains join.
    groups: list[set[int]] = []
    for live in map(_live, loops):
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


def _tips(face: Face, points: Array, tolerance: float) -> list[Array]:
    """Poles inside a face where it has no tangent plane, as the tip of a cone, but for those among given points."""
    surface = face.surface
    found = []
    for k in range(4):
        if not surface._pole_bits >> k & 1:
            continue
        axis, side = divmod(k, 2)
        low, high = surface.domain[axis]
        start, stop = surface.domain[1 - axis]
        uv = np.empty((2, _STATIONS.size))
        uv[1 - axis] = start + (stop - start) * _STATIONS
        # The trim is asked beside the pole: there the pole's own side is one of its curves.
        uv[axis] = high - _BESIDE * (high - low) if side else low + _BESIDE * (high - low)
        if face.boundary and (face.locate(*uv) < 0).any():
            continue
        uv[axis] = (low, high)[side]
        tip = surface.evaluate(uv[0, 0], uv[1, 0])
        if len(points) and np.linalg.norm(points - tip, axis=1).min() <= tolerance:
            continue
        try:
            normals = surface.normal(*uv)
        except InputError:
            found.append(tip)
            continue
        if turn(normals, normals[0]).max() > CORNER:
            found.append(tip)
    return found
