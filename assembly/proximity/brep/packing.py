"""The faces, edges and vertices of a body turned into the records that kernels read (`proximity/brep/records.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from assembly.errors import positive
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.trim_pieces import TRIM_FIRST
from assembly.geometry.splines.evaluate import CELL_SIZE, CELLS, COEFFICIENTS, CURVE_RECORD, OFFSETS
from assembly.proximity.brep import records as shell
from assembly.proximity.brep.edge_cells import edge_cells, outside_cells
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
    faces, places = [], []
    for face, flags, edges in zip(topology.faces, parts.flags, topology.face_edges, strict=True):
        record, curves = _face(writer, face, flags, edges, 1.0 / scale)
        faces.append(record)
        places.append(curves)
    cells = [rows * [1.0, 1.0, *[1.0 / scale] * 4] for rows in parts.cells]
    edge_rows = []
    for edge, rows in zip(topology.edges, cells, strict=True):
        _, map_at = writer.add(pool=edge.map_b)
        _, cells_at = writer.add(pool=rows)
        other = edge.face_b
        second = -1 if other is None else faces[other][shell.FACE_SURFACE]
        second_curve = -1 if other is None or edge.curve_b is None else places[other] + CURVE_RECORD * edge.curve_b
        edge_rows.append(
            [
                faces[edge.face_a][shell.FACE_SURFACE],
                places[edge.face_a] + CURVE_RECORD * edge.curve_a,
                edge.face_a,
                -1 if other is None else other,
                second,
                second_curve,
                map_at,
                -1 if edge.start is None else edge.start,
                -1 if edge.end is None else edge.end,
                cells_at,
                len(rows),
            ]
        )
    vertex_rows = []
    for vertex in topology.vertices:
        ends, point = writer.add(np.array(vertex.edges, dtype=np.int64), vertex.point / scale)
        around, _ = writer.add(vertex.faces)
        vertex_rows.append([point, len(vertex.edges), ends, len(vertex.faces), around])
    header[shell.FACES], header[shell.EDGES], header[shell.VERTICES] = len(faces), len(edge_rows), len(vertex_rows)
    header[shell.FACE_TABLE], _ = writer.add([field for row in faces for field in row])
    header[shell.EDGE_TABLE], _ = writer.add([field for row in edge_rows for field in row])
    header[shell.VERTEX_TABLE], _ = writer.add([field for row in vertex_rows for field in row])
    return *writer.arrays(), offset


def _face(
    writer: Writer, face: Face, flags: Array, edges: Sequence[int | None], factor: float
) -> tuple[list[int], int]:
    """Pack a face: its record, and where the records of its boundary curves begin."""
    record, pool = face.packed()
    record, pool = record.copy(), pool.copy()
    coefficients, cells = record[COEFFICIENTS], record[CELLS]
    pool[coefficients:cells].reshape(-1, 4)[:, :3] *= factor
    pool[cells:].reshape(-1, CELL_SIZE)[:, 2:9] *= factor
    record[list(OFFSETS)] += writer.pool_at
    surface_place, _ = writer.add(record, pool)
    trim_place = curves = -1
    if face.boundary:
        table, pool = face.packed_trim(writer.table_at, writer.pool_at)
        curves = int(table[TRIM_FIRST])
        trim_place, _ = writer.add(table, pool)
    listed, _ = writer.add([-1 if edge is None else edge for edge in edges])
    _, flags_at = writer.add(pool=flags)
    return [surface_place, trim_place, listed, flags_at], curves


@dataclass(frozen=True, eq=False)
class _Parts:
    """What takes long and is the same in every scene: flags of the faces' cells, cells of the edges."""

    flags: list[Array]
    cells: list[Array]


_KNOWN: WeakKeyDictionary[Topology, _Parts] = WeakKeyDictionary()


def _parts(topology: Topology) -> _Parts:
    known = _KNOWN.get(topology)
    if known is None:
        known = _KNOWN[topology] = _Parts([_flags(face) for face in topology.faces], _cells(topology))
    return known


def _flags(face: Face) -> Array:
    """1 for every cell that may hold material of the face."""
    record, pool = face.packed()
    rows = pool[record[CELLS] :].reshape(-1, CELL_SIZE)
    return np.where(outside_cells(face, rows), 0.0, 1.0)


def _cells(topology: Topology) -> list[Array]:
    """The cells of every edge, face by face."""
    result: list[Array] = [np.empty((0, shell.EDGE_CELL_SIZE))] * len(topology.edges)
    groups: list[list[int]] = [[] for _ in topology.faces]
    for k, edge in enumerate(topology.edges):
        groups[edge.face_a].append(k)
    for face, group in zip(topology.faces, groups, strict=True):
        if group:
            edges = [topology.edges[k] for k in group]
            curves = [face.boundary[edge.curve_a] for edge in edges]
            lengths = [edge.length for edge in edges]
            for k, rows in zip(group, edge_cells(face.surface, curves, lengths), strict=True):
                result[k] = rows
    return result
