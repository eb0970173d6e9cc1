"""The faces, edges and vertices of a body turned into the records that kernels read (`proximity/shell.py`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.errors import positive
from assembly.geometry.face import Face
from assembly.geometry.spline import CELL_COUNT, CELLS, CURVE_RECORD
from assembly.geometry.surface import NurbsSurface
from assembly.geometry.trim import TRIM_FIRST
from assembly.proximity import shell
from assembly.proximity.edge_cells import edge_cells, outside_cells
from assembly.proximity.pairs import OFFSETS
from assembly.proximity.start import CELL_SIZE
from assembly.proximity.topology import Topology

__all__ = ["pack_shell"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]


class _Writer:
    """Arrays that grow at the end of a table and of a pool which are there already."""

    def __init__(self, table_at: int, pool_at: int) -> None:
        self.table_at, self.pool_at = table_at, pool_at
        self._table: list[Table] = []
        self._pool: list[Array] = []

    def add(self, table: Sequence[int] | Table = (), pool: Sequence[float] | Array = ()) -> tuple[int, int]:
        """Append; returns where the parts begin."""
        at = self.table_at, self.pool_at
        self._table.append(np.asarray(table, dtype=np.int64).ravel())
        self._pool.append(np.asarray(pool, dtype=np.float64).ravel())
        self.table_at += self._table[-1].size
        self.pool_at += self._pool[-1].size
        return at

    def arrays(self) -> tuple[Table, Array]:
        return np.concatenate(self._table), np.concatenate(self._pool)


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
    writer = _Writer(table_at, pool_at)
    header = np.zeros(shell.SHELL, dtype=np.int64)
    offset, _ = writer.add(header)
    faces, surfaces, places = [], [], []
    for face, edges in zip(topology.faces, topology.face_edges, strict=True):
        record, surface, curves = _face(writer, face, edges, scale)
        faces.append(record)
        surfaces.append(surface)
        places.append(curves)
    cells = _cells(topology, surfaces, scale)
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
    table, pool = writer.arrays()
    table[: shell.SHELL] = header
    return table, pool, offset


def _face(
    writer: _Writer, face: Face, edges: Sequence[int | None], scale: float
) -> tuple[list[int], NurbsSurface, int]:
    """Pack a face: its record, its scaled surface, and where the records of its boundary curves begin."""
    surface = face.surface.transformed(scale=1.0 / scale)
    record, pool = Face(surface, reversed=face.reversed).packed()
    cells = pool[record[CELLS] :][: CELL_SIZE * record[CELL_COUNT]].reshape(-1, CELL_SIZE)
    record = record.copy()
    record[list(OFFSETS)] += writer.pool_at
    surface_at, _ = writer.add(record, pool)
    trim_at = curves = -1
    if face.boundary:
        table, pool = face.packed_trim(writer.table_at, writer.pool_at)
        curves = int(table[TRIM_FIRST])
        trim_at, _ = writer.add(table, pool)
    listed, _ = writer.add([-1 if edge is None else edge for edge in edges])
    flags = np.where(outside_cells(face, surface, cells), 0.0, 1.0)
    _, flags_at = writer.add(pool=flags)
    return [surface_at, trim_at, listed, flags_at], surface, curves


def _cells(topology: Topology, surfaces: Sequence[NurbsSurface], scale: float) -> list[Array]:
    """The cells of every edge, face by face."""
    result: list[Array] = [np.empty((0, shell.EDGE_CELL_SIZE))] * len(topology.edges)
    groups: list[list[int]] = [[] for _ in topology.faces]
    for k, edge in enumerate(topology.edges):
        groups[edge.face_a].append(k)
    for number, group in enumerate(groups):
        if group:
            curves = [topology.faces[number].boundary[topology.edges[k].curve_a] for k in group]
            lengths = [topology.edges[k].length / scale for k in group]
            for k, rows in zip(group, edge_cells(surfaces[number], curves, lengths), strict=True):
                result[k] = rows
    return result
