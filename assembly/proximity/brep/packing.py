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
    cells = [rows * [1.0, 1.0, *[1.0 / scale] * 4] for rows in parts.cells]
    edges = np.zeros((len(topology.edges), shell.EDGE_RECORD), dtype=np.int64)
    surfaces = rows_of(shell.FACE_DTYPE, faces).surface
    for k, (edge, rows) in enumerate(zip(topology.edges, cells, strict=True)):
        record, other = shell.edge_at(edges, k), edge.face_b
        _, record.map = writer.add(pool=edge.map_b)
        _, record.cells = writer.add(pool=rows)
        record.cell_count = len(rows)
        record.surface, record.curve = surfaces[edge.face_a], places[edge.face_a] + CURVE_RECORD * edge.curve_a
        record.face_a, record.face_b = edge.face_a, -1 if other is None else other
        record.surface_b = -1 if other is None else surfaces[other]
        record.curve_b = -1 if other is None or edge.curve_b is None else places[other] + CURVE_RECORD * edge.curve_b
        record.start = -1 if edge.start is None else edge.start
        record.end = -1 if edge.end is None else edge.end
    vertices = np.zeros((len(topology.vertices), shell.VERTEX_RECORD), dtype=np.int64)
    for k, vertex in enumerate(topology.vertices):
        record = shell.vertex_at(vertices, k)
        record.edges, record.faces = len(vertex.edges), len(vertex.faces)
        record.edge_list, record.point = writer.add(np.array(vertex.edges, dtype=np.int64), vertex.point / scale)
        record.face_list, _ = writer.add(vertex.faces)
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


@dataclass(frozen=True, eq=False)
class _Parts:
    """What takes long and is the same in every scene: flags of the faces' cells, cells of the edges."""

    flags: list[Array]
    cells: list[Array]


_KNOWN: WeakKeyDictionary[Topology, _Parts] = WeakKeyDictionary()


def _parts(topology: Topology) -> _Parts:
    known = _KNOWN.get(topology)
    if known is None:
        nets = nets_of(topology.faces)
        flags = [_flags(nets, k, face) for k, face in enumerate(topology.faces)]
        known = _KNOWN[topology] = _Parts(flags, _cells(nets, topology))
    return known


def _flags(nets: BodyNets, number: int, face: Face) -> Array:
    """1 for every cell that may hold material of the face (`geometry/splines/cells.py`)."""
    record, pool = face.packed()
    rows = pool[record[CELLS] :].reshape(-1, CELL_SIZE)
    middle, half = rows[:, :2], rows[:, 9:11]
    boxes = np.stack([middle - half, middle + half], axis=2).reshape(-1, 4)
    return np.where(nets.outside(number, boxes), 0.0, 1.0)


def _cells(nets: BodyNets, topology: Topology) -> list[Array]:
    """The cells of every edge."""
    faces = np.array([edge.face_a for edge in topology.edges], dtype=np.int64)
    curves = nets.first_curve[faces] + np.array([edge.curve_a for edge in topology.edges], dtype=np.int64)
    return edge_cells(nets, faces, curves, np.array([edge.length for edge in topology.edges]))
