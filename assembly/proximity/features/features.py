"""Which faces, edges or vertices of two bodies are closest, from Python: found globally, and tracked as bodies move.

A body is its faces with the edges and vertices they share. Everything returned is in world axes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._copies import OwnState
from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, check_coordinates, number
from assembly.geometry.faces.face import Face, whole_face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import Body, BodyFace
from assembly.kinematics.pose import IDENTITY_ROW, PoseLike, pose_row
from assembly.proximity.brep.packing import pack_shell
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.features.nearest_query import (
    GAP,
    LOWER,
    NORMAL,
    PAIR,
    PARAMETERS,
    POINT_F,
    SWITCHES,
    TRACKED,
    find_deepest,
    find_nearest,
    follow_nearest,
)
from assembly.proximity.features.touching import flush_ways

__all__ = [
    "Feature",
    "FeaturePair",
    "FeatureStatus",
    "FeatureTracker",
    "closest_features",
    "faces_of",
    "features_of",
    "pose_of",
]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
Shape = Body | BodyFace | Face | NurbsSurface | Iterable[Face | NurbsSurface]
Faces = tuple[Face, ...]


class FeatureStatus(Enum):
    """What a pair of features is; the value says it in a sentence."""

    APART = "nearest points of all features: every other pair is excluded"
    CROSSING = "the bodies cross at this point; no pair of a penetration was found, move them apart to see one"
    UNPROVEN = "the nearest pair found; the search ran out of room before every other pair was excluded"
    PENETRATING = "the bodies cross; where they are deepest in each other on their way apart"
    TRACKED = "followed from the pair before; no feature beside it is closer"


_STATUSES = tuple(FeatureStatus)


@dataclass(frozen=True)
class Feature:
    """A face, an edge or a vertex of a body.

    Attributes
    ----------
    kind : "face", "edge" or "vertex"
    index : int
        Among those of its kind.
    name : str
        To be read: the face's name, or the faces an edge is between.
    """

    kind: Literal["face", "edge", "vertex"]
    index: int
    name: str

    def __repr__(self) -> str:
        return self.name


@dataclass(frozen=True, eq=False)
class FeaturePair(ReadOnlyArrays):
    """The closest features of two bodies a and b, and their points.

    Attributes
    ----------
    features : (Feature, Feature)
    parameters : (2, 2)
        (u, v) on a face, (t, 0) on an edge, in the parameter of its curve on its first face, (0, 0) at a vertex.
    points : (2, 3)
        The point of a and the point of b, world coordinates.
    normal : (3,)
        Unit vector from a towards b; the outward normal of a, of b reversed, where one of the features is a face.
    gap : float
        normal . (b - a): positive apart, negative interpenetrating; of a body inside the other one, whose surfaces are
        apart, the side of a's face on which b is.
    lower : float
        No points of the two are nearer than this; 0 where the bodies cross. Where they are APART it is less than the
        gap by 1e-9 of the larger one's size at most. Of a tracked pair, NaN.
    status : FeatureStatus
    """

    features: tuple[Feature, Feature]
    parameters: Array = field(repr=False)
    points: Array
    normal: Array
    gap: float
    lower: float = field(repr=False)
    status: FeatureStatus


def faces_of(name: str, shape: Shape) -> Faces:
    """The faces of a shape that is an argument of this name."""
    if isinstance(shape, Body):
        if not shape.faces:
            raise InputError(f"{name} is {shape!r}, a body without a shape; expected one with faces")
        return tuple(face.face for face in shape.faces)
    if isinstance(shape, BodyFace):
        return (shape.face,)
    if isinstance(shape, NurbsSurface):
        return (whole_face(shape),)
    if isinstance(shape, Face):
        return (shape,)
    if not isinstance(shape, Iterable):
        raise TypeError(f"{name} is {shape!r}; expected a Body, a Face, a NurbsSurface, or several faces")
    faces: list[Face] = []
    for k, part in enumerate(shape):
        if not isinstance(part, (Face, NurbsSurface)):
            raise TypeError(f"{name}[{k}] is {part!r}; expected a Face or a NurbsSurface")
        faces.append(part if isinstance(part, Face) else whole_face(part))
    if not faces:
        raise InputError(f"{name} is empty; expected at least one face")
    return tuple(faces)


def pose_of(name: str, shape: Shape, q: PoseLike | None) -> Array:
    """The pose of a shape (7,), an argument of this name: the body's own, or none, where it is not given."""
    if q is None:
        if isinstance(shape, BodyFace):
            shape = shape.body
        return np.asarray(shape.q) if isinstance(shape, Body) else np.array(IDENTITY_ROW)
    row = pose_row(name, q)
    check_coordinates(name, row[:3].tolist())
    return row


@lru_cache(maxsize=128)
def features_of(faces: Faces) -> tuple[Feature, ...]:
    """All features of a body by number."""
    topology = solid_of(faces)
    names = [face.name or f"face {k + 1}" for k, face in enumerate(topology.faces)]
    result = [Feature("face", k, f"face {name!r}") for k, name in enumerate(names)]
    for k, edge in enumerate(topology.edges):
        other = "free" if edge.face_b is None else repr(names[edge.face_b])
        result.append(Feature("edge", k, f"edge {k} ({names[edge.face_a]!r} | {other})"))
    return (*result, *(Feature("vertex", k, f"vertex {k}") for k in range(len(topology.vertices))))


def _extent(faces: Faces) -> float:
    boxes = [face.surface.bounding_box() for face in faces]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    return float(np.linalg.norm(high - low))


class _Packed(NamedTuple):
    """Two shells as one table and one pool, where they begin, and the larger size."""

    table: Table
    pool: Array
    shells: tuple[int, int]
    size: float


@lru_cache(maxsize=64)
def _packed(a: Faces, b: Faces) -> _Packed:
    table_a, pool_a, shell_a = pack_shell(solid_of(a), 1.0)
    table_b, pool_b, shell_b = pack_shell(solid_of(b), 1.0, table_a.size, pool_a.size)
    size = max(_extent(a), _extent(b))
    return _Packed(np.concatenate([table_a, table_b]), np.concatenate([pool_a, pool_b]), (shell_a, shell_b), size)


def _search(packed: _Packed, q: Array, codes: Table, out: Array) -> FeatureStatus:
    """The pair at poses (2, 7) into codes (2,) and out (PAIR,)."""
    table, pool, shells, size = packed
    status: FeatureStatus = _STATUSES[find_nearest(table, pool, shells, q, size, codes, out)]
    if status is FeatureStatus.CROSSING:
        status = _STATUSES[find_deepest(table, pool, shells, q, size, codes, out)]
    return status


def _pair(
    names: tuple[tuple[Feature, ...], tuple[Feature, ...]], codes: Table, out: Array, status: FeatureStatus
) -> FeaturePair:
    f, g = codes.tolist()
    return FeaturePair(
        (names[0][f], names[1][g]),
        out[PARAMETERS:POINT_F].reshape(2, 2),
        out[POINT_F:NORMAL].reshape(2, 3),
        out[NORMAL:GAP],
        float(out[GAP]),
        float(out[LOWER]),
        status,
    )


def closest_features(
    a: Shape, b: Shape, q_a: PoseLike | None = None, q_b: PoseLike | None = None, *, touching: float = 1e-9
) -> FeaturePair:
    """The closest points of two bodies over all their faces, edges and vertices.

    Parameters
    ----------
    a, b : Body, Face, NurbsSurface, or several faces
        Faces given together share their edges and vertices.
    q_a, q_b : Pose or (7,), optional
        Poses; a body's own by default, else the identity.
    touching : float
        How much the bodies may overlap and still count as touching, in parts of the larger one's size. The same holds
        for flat faces that lie on each other if an equally small move off them parts the bodies, and for conforming
        faces, such as a peg in a bore of its own radius, that overlap by no more.

    Returns
    -------
    FeaturePair
        If the bodies are apart or touch, their nearest points. If they cross, a pair with opposed normals and a
        negative gap: one that closes as the bodies come apart along the normal of a face that crosses, the shortest
        such way out.

    Raises
    ------
    InputError, TypeError
        Shapes without faces, wrong poses, coordinates of 1e150 and more, `touching` that is not from 0 to 0.001.

    Notes
    -----
    Branch and bound over pairs of cells with bounds that are rounded outward but for the last digits
    (`proximity/features/quadratic_model.py`); a cell is given up, too, where an extremum that is known is the only one
    in reach,
    which is decided by how much curvatures change over it. The point of `FeatureStatus.APART` is that nothing else
    ends the search.
    """
    faces = faces_of("a", a), faces_of("b", b)
    q = np.stack([pose_of("q_a", a, q_a), pose_of("q_b", b, q_b)])
    if not 0.0 <= number("touching", touching) <= 1e-3:
        raise InputError(f"touching is {touching:g}; expected a number from 0 to 0.001")
    pair = _closest(faces, q)
    if pair.status not in (FeatureStatus.PENETRATING, FeatureStatus.CROSSING):
        return pair
    reach = touching * _packed(*faces).size
    if pair.status is FeatureStatus.PENETRATING and pair.gap >= -reach:
        return replace(pair, status=FeatureStatus.APART)
    return _parted(faces, q, reach) or pair


def _closest(faces: tuple[Faces, Faces], q: Array) -> FeaturePair:
    """The pair at poses (2, 7)."""
    codes, out = np.zeros(2, dtype=np.int64), np.empty(PAIR)
    status = _search(_packed(*faces), q, codes, out)
    return _pair((features_of(faces[0]), features_of(faces[1])), codes, out, status)


def _parted(faces: tuple[Faces, Faces], q: Array, reach: float) -> FeaturePair | None:
    """The nearest pair of bodies with flush faces that a move by twice the reach off these parts, moved back."""
    for way in flush_ways(faces[0], q[0], faces[1], q[1], reach):
        moved = q.copy()
        moved[1, :3] += 2.0 * reach * way
        pair = _closest(faces, moved)
        if pair.status not in (FeatureStatus.PENETRATING, FeatureStatus.CROSSING):
            points = pair.points - np.array([0.0 * way, 2.0 * reach * way])
            gap = pair.gap - 2.0 * reach * float(way @ pair.normal)
            return replace(pair, points=points, gap=gap, lower=0.0)
    return None


class FeatureTracker(OwnState):
    """The closest features of two bodies that move, each step from the last one.

    A step that is small against the bodies' own size switches from faces to edges to vertices and back as the closest
    point leaves one feature for another. Where that fails, the pair is searched anew.

    Parameters
    ----------
    a, b : Body, Face, NurbsSurface, or several faces

    Attributes
    ----------
    switches : int
        How often a feature took over from another one since the start.
    searches : int
        How often the pair was searched globally, the first step included.
    """

    def __init__(self, a: Shape, b: Shape) -> None:
        self._shapes = a, b
        faces = faces_of("a", a), faces_of("b", b)
        self._packed = _packed(*faces)
        self._names = features_of(faces[0]), features_of(faces[1])
        self._q = np.empty((2, 7))
        self._codes = np.zeros(2, dtype=np.int64)
        self._out = np.empty(PAIR)
        self._out[SWITCHES] = 0.0
        self.searches = 0

    def _shared(self) -> Iterable[object]:
        return self._shapes, self._packed, self._names

    @property
    def switches(self) -> int:
        """How often a feature took over from another one since the start."""
        return int(self._out[SWITCHES])

    def step(self, q_a: PoseLike | None = None, q_b: PoseLike | None = None) -> FeaturePair:
        """The pair at new poses, a `Pose` or a row (7,) each; a body's own by default, else the identity.

        Raises
        ------
        InputError
            Wrong poses.
        """
        self._q[0] = pose_of("q_a", self._shapes[0], q_a)
        self._q[1] = pose_of("q_b", self._shapes[1], q_b)
        status = None
        if self.searches:
            table, pool, shells, size = self._packed
            if follow_nearest(table, pool, shells, self._q, size, self._codes, self._out) == TRACKED:
                status = FeatureStatus.TRACKED
        if status is None:
            status = _search(self._packed, self._q, self._codes, self._out)
            self.searches += 1
        return _pair(self._names, self._codes, self._out.copy(), status)
