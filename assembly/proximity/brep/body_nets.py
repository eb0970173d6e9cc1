"""The faces of a body packed as Bezier pieces (`proximity/brep/bezier_nets.py`), once for all uses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.brep import bezier_nets as layout
from assembly.proximity.brep.box_sides import OUTSIDE, write_sides
from assembly.proximity.brep.net_normals import complete_nets

__all__ = ["BodyNets", "SurfaceParts", "nets_of", "pack_nets"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# Every boundary curve is in so many parts at least where boxes are asked whether it enters them.
BOUNDARY_PARTS = 16
# Rounding of points of plane curves, relative to their coordinates.
_ROUNDING = 1e-14


class SurfaceParts(NamedTuple):
    """A surface with plane curves in its parameters; `trim` is the face whose trim counts, if one does."""

    surface: NurbsSurface
    curves: Sequence[NurbsCurve]
    reversed: bool = False
    trim: Face | None = None


class BodyNets(NamedTuple):
    """Faces as kernels restrict them.

    Attributes
    ----------
    table, pool : arrays
        Records of faces first, then those of all their boundary curves. Not to be written to: all share them.
    first_curve : (faces + 1,) of int
        The number of the first boundary curve of each face, those of all faces in a row.
    breaks : list of arrays
        The distinct knots of every boundary curve.
    size : int
        Of a workspace that any kernel needs for them.
    """

    table: Indices
    pool: Array
    first_curve: Indices
    breaks: list[Array]
    size: int

    @property
    def faces(self) -> int:
        """How many faces there are."""
        return len(self.first_curve) - 1

    @property
    def records(self) -> Indices:
        """The records of faces, a row each."""
        return self.table[: layout.FACE_NETS * self.faces].reshape(-1, layout.FACE_NETS)

    def curve_records(self, numbers: Indices) -> Indices:
        """Where the records of boundary curves are in the table."""
        return layout.FACE_NETS * self.faces + layout.CURVE_NET * numbers

    def workspace(self) -> Array:
        """Memory for a kernel."""
        return np.empty(self.size)

    def sides(self, faces: Indices, boxes: Array) -> Indices:
        """Of boxes (n, 4), u from and to and v from and to, of faces: CLEAR, OUTSIDE or ENTERED."""
        out = np.empty(len(faces), dtype=np.int64)
        write_sides(self.table, self.pool, faces, np.ascontiguousarray(boxes), out)
        return out

    def outside(self, face: int, boxes: Array) -> NDArray[np.bool_]:
        """Which boxes (n, 4) of a face are surely outside its trim."""
        return np.asarray(self.sides(np.full(len(boxes), face), boxes) == OUTSIDE)


class _Pool:
    """Doubles, one behind the other."""

    def __init__(self) -> None:
        self.parts: list[Array] = []
        self.at = 0

    def add(self, values: Array) -> int:
        """Where they begin."""
        begin = self.at
        self.parts.append(values.ravel())
        self.at += values.size
        return begin


def pack_nets(faces: Sequence[SurfaceParts]) -> BodyNets:
    """The nets of surfaces with curves on them."""
    pool = _Pool()
    curves = [curve for face in faces for curve in face.curves]
    first_curve = np.cumsum([0, *(len(face.curves) for face in faces)])
    count = layout.FACE_NETS * len(faces)
    tables = [np.zeros(count + layout.CURVE_NET * len(curves), dtype=np.int64)]
    records = rows_of(layout.FACE_NETS_DTYPE, tables[0][:count].reshape(-1, layout.FACE_NETS))
    rows = [_curve_row(curve, pool) for curve in curves]
    tables[0][count:] = np.array(rows, dtype=np.int64).ravel()
    spans = np.array([row[1] for row in rows], dtype=np.int64)
    boxes = -(-BOUNDARY_PARTS // np.maximum(spans, 1)) * spans
    columns = []
    for k, face in enumerate(faces):
        row = _face_row(face, pool)
        if face.trim is None:
            row += [-1, 0, 0]
        else:
            mine = int(boxes[first_curve[k] : first_curve[k + 1]].sum())
            boundary = pool.add(np.zeros(4 * mine))
            trim = sum(map(len, tables))
            table, doubles = face.trim.packed_trim(trim, pool.at)
            tables.append(table)
            pool.add(doubles)
            row += [trim, boundary, mine]
        columns.append(row)
    tables[0][:count] = np.array(columns, dtype=np.int64).ravel()
    points = int((records.rows * records.columns).max(initial=1))
    normals = int((records.normal_rows * records.normal_columns).max(initial=1))
    sides = int(max(records.normal_rows.max(initial=1), records.normal_columns.max(initial=1)))
    parts = int((records.spans_u + records.spans_v).max(initial=1)) + int(spans.max(initial=1)) + 8
    degrees = max((row[0] for row in rows), default=0)
    size = 40 * points + 9 * normals + sides + layout.CUT * parts + degrees + 1
    table, doubles = np.concatenate(tables), np.concatenate([*pool.parts, np.empty(0)])
    own = np.column_stack([first_curve[:-1], first_curve[1:]])
    complete_nets(table, doubles, own, count, BOUNDARY_PARTS, np.empty(size))
    return BodyNets(table, doubles, first_curve, [curve.breaks() for curve in curves], size)


def _curve_row(curve: NurbsCurve, pool: _Pool) -> list[int]:
    """The record of a plane curve."""
    pieces = curve.bezier_pieces()
    slack = _ROUNDING * np.abs(curve.control_points).max(axis=0)
    return [curve.degree, len(pieces), pool.add(pieces), pool.add(curve.breaks()), pool.add(slack)]


def _face_row(face: SurfaceParts, pool: _Pool) -> list[int]:
    """The record of a face but for its trim."""
    surface = face.surface
    points = surface.bezier_pieces()
    weights = points[..., 3]
    is_rational = bool(weights.min() != weights.max())
    spans_u, spans_v, rows, columns = points.shape[:4]
    times = 3 if is_rational else 2
    normal_rows, normal_columns = times * (rows - 1), times * (columns - 1)
    pieces = spans_u * spans_v
    places = [
        pool.add(points),
        pool.add(np.zeros(3 * pieces * normal_rows * normal_columns)),
        pool.add(np.zeros(pieces)),
        pool.add(np.zeros(pieces)),
        *(pool.add(at) for at in surface.breaks()),
        pool.add(np.zeros(1)),
    ]
    closed = (int(flag) for flag in surface.closed)
    shape = [rows, columns, normal_rows, normal_columns, spans_u, spans_v, *closed]
    return [*shape, *places, int(face.reversed), int(is_rational), surface._pole_bits]


@lru_cache(maxsize=128)
def nets_of(faces: tuple[Face, ...]) -> BodyNets:
    """The nets of the faces of a body, `Topology.faces`."""
    parts = []
    for face in faces:
        is_trimmed = face.outer is not None or bool(face.holes)
        parts.append(SurfaceParts(face.surface, face.boundary, face.reversed, face if is_trimmed else None))
    return pack_nets(parts)
