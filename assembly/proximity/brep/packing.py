"""The faces, edges and vertices of a body turned into the records that kernels read (`proximity/brep/records.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.errors import positive
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.splines.evaluate import CELL_SIZE, CELLS, COEFFICIENTS, CURVE_RECORD, OFFSETS
from assembly.proximity.brep import records as shell
from assembly.proximity.brep.body_nets import BodyNets, nets_of
from assembly.proximity.brep.edge_cells import edge_cells
from assembly.proximity.brep.topology import Topology
from assembly.proximity.brep.writer import Writer

__all__ = ["pack_shell"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]


def pack_shell(topology: Topology, scale: float, table_at: int = 0, pool_at: int = 0) -> tuple[Table, Array, int]:
    """The records of a body's features.

    Parameters
    ----------
    topology : Topology
    scale : float
        Lengths are divided by it; parameters are not.
    table_at, pool_at : int
        Where the arrays will stand in a larger table and pool: offsets in the records are absolute.

    Returns
    -------
    table, pool : arrays
        To be appended there.
    offset : int
        Of the shell's header in the table.
    """
    scale = positive("scale", scale)
    parts = _parts(topology)
    writer = Writer(table_at, pool_at)
    header = np.zeros(shell.SHELL, dtype=np.int64)
    offset, _ = writer.add(header)
    faces = np.zeros((len(topology.faces), shell.FACE_RECORD), dtype=np.int64)
    places = [
        _face(writer, face, flags, edges, 1.0 / scale, shell.face_at(faces, k))
        for k, (face, flags, edges) in enumerate(zip(topology.faces, parts.flags, topology.face_edges, strict=True))
    ]
    edges = _edges(writer, parts, 1.0 / scale, rows_of(shell.FACE_DTYPE, faces).surface, np.array(places))
    vertices = _vertices(writer, parts, scale)
    record = shell.shell_at(header, 0)
    record.faces, record.edges, record.vertices = len(faces), len(edges), len(vertices)
    record.face_table, _ = writer.add(faces)
    record.edge_table, _ = writer.add(edges)
    record.vertex_table, _ = writer.add(vertices)
    return *writer.arrays(), offset


def _face(writer: Writer, face: Face, flags: Array, edges: Sequence[int | None], factor: float, packed: Any) -> int:
    """Pack a face into its record; where the records of its boundary curves begin."""
    record, pool = face.packed()
    record, pool = record.copy(), pool.copy()
    coefficients, cells = record[COEFFICIENTS], record[CELLS]
    pool[coefficients:cells].reshape(-1, 4)[:, :3] *= factor
    pool[cells:].reshape(-1, CELL_SIZE)[:, 2:9] *= factor
    record[list(OFFSETS)] += writer.pool_at
    packed.surface, _ = writer.add(record, pool)
    packed.trim = curves = -1
    if face.boundary:
        table, pool = face.packed_trim(writer.table_at, writer.pool_at)
        curves = int(trim_at(table, 0).first)
        packed.trim, _ = writer.add(table, pool)
    packed.edges, _ = writer.add([-1 if edge is None else edge for edge in edges])
    _, packed.cell_flags = writer.add(pool=flags)
    return curves


def _edges(writer: Writer, parts: _Parts, factor: float, surfaces: Table, curves: Table) -> Table:
    """The records of edges, given those of the faces' surfaces and where the records of their curves begin."""
    edges = np.zeros((len(parts.edges), shell.EDGE_RECORD), dtype=np.int64)
    face_a, curve_a, face_b, curve_b, start, end = parts.edges.T
    counts = parts.cell_counts
    _, maps = writer.add(pool=parts.maps)
    _, cells = writer.add(pool=parts.cells * [1.0, 1.0, *[factor] * 4])
    rows = rows_of(shell.EDGE_DTYPE, edges)
    rows.map = maps + 2 * np.arange(len(edges))
    rows.cells, rows.cell_count = cells + shell.EDGE_CELL_SIZE * (np.cumsum(counts) - counts), counts
    rows.face_a, rows.face_b, rows.start, rows.end = face_a, face_b, start, end
    rows.surface, rows.curve = surfaces[face_a], curves[face_a] + CURVE_RECORD * curve_a
    rows.surface_b = np.where(face_b < 0, -1, surfaces[face_b])
    rows.curve_b = np.where(curve_b < 0, -1, curves[face_b] + CURVE_RECORD * curve_b)
    return edges


def _vertices(writer: Writer, parts: _Parts, scale: float) -> Table:
    """The records of vertices."""
    vertices = np.zeros((len(parts.points), shell.VERTEX_RECORD), dtype=np.int64)
    rows = rows_of(shell.VERTEX_DTYPE, vertices)
    rows.edges, rows.faces = parts.vertex_edges[0], parts.vertex_faces[0]
    edge_list, points = writer.add(parts.vertex_edges[1], parts.points / scale)
    face_list, _ = writer.add(parts.vertex_faces[1])
    rows.point = points + 3 * np.arange(len(vertices))
    rows.edge_list = edge_list + 2 * (np.cumsum(rows.edges) - rows.edges)
    rows.face_list = face_list + np.cumsum(rows.faces) - rows.faces
    return vertices


@dataclass(frozen=True, eq=False)
class _Parts:
    """What is the same in every scene.

    Attributes
    ----------
    flags : list of arrays
        Of the faces' cells.
    edges : (n, 6) of int
        face_a, curve_a, face_b, curve_b, start and end of every edge, -1 for what is not there.
    maps : (n, 2)
        `Edge.map_b`.
    cells, cell_counts : (m, 6), (n,)
        The cells of the edges, and how many each has.
    points : (k, 3)
        The vertices.
    vertex_edges, vertex_faces
        How many edges and faces there are at every vertex, and all of them.
    """

    flags: list[Array]
    edges: Table
    maps: Array
    cells: Array
    cell_counts: Table
    points: Array
    vertex_edges: tuple[Table, Table]
    vertex_faces: tuple[Table, Table]


_KNOWN: WeakKeyDictionary[Topology, _Parts] = WeakKeyDictionary()


def _parts(topology: Topology) -> _Parts:
    known = _KNOWN.get(topology)
    if known is None:
        known = _KNOWN[topology] = _made(topology)
    return known


def _made(topology: Topology) -> _Parts:
    nets = nets_of(topology.faces)
    edges = [(e.face_a, e.curve_a, e.face_b, e.curve_b, e.start, e.end) for e in topology.edges]
    numbers = [-1 if number is None else number for row in edges for number in row]
    table = np.array(numbers, dtype=np.int64).reshape(-1, 6)
    face_a, curve_a = table[:, 0], table[:, 1]
    lengths = np.array([edge.length for edge in topology.edges])
    cells = edge_cells(nets, face_a, nets.first_curve[face_a] + curve_a, lengths)
    vertices = topology.vertices
    return _Parts(
        [_flags(nets, k, face) for k, face in enumerate(topology.faces)],
        table,
        np.array([edge.map_b for edge in topology.edges]).reshape(-1, 2),
        np.concatenate([np.empty((0, shell.EDGE_CELL_SIZE)), *cells]),
        np.array([len(rows) for rows in cells], dtype=np.int64),
        np.array([vertex.point for vertex in vertices]).reshape(-1, 3),
        _joined([[number for end in vertex.edges for number in end] for vertex in vertices], 2),
        _joined([vertex.faces for vertex in vertices], 1),
    )


def _joined(lists: Sequence[Sequence[int]], size: int) -> tuple[Table, Table]:
    """How many items of this size lists have, and all of these."""
    counts = np.array([len(row) // size for row in lists], dtype=np.int64)
    return counts, np.array([number for row in lists for number in row], dtype=np.int64)


def _flags(nets: BodyNets, number: int, face: Face) -> Array:
    """1 for every cell that may hold material of the face (`geometry/splines/cells.py`)."""
    record, pool = face.packed()
    rows = pool[record[CELLS] :].reshape(-1, CELL_SIZE)
    middle, half = rows[:, :2], rows[:, 9:11]
    boxes = np.stack([middle - half, middle + half], axis=2).reshape(-1, 4)
    return np.where(nets.outside(number, boxes), 0.0, 1.0)
