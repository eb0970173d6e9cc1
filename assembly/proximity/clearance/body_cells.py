"""The tree of cells of a body, made once for its faces: boxes or exact round hulls above cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.errors import InputError
from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.evaluate import spline_curve_at, surface_at
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.brep.topology import Topology
from assembly.proximity.clearance.bores import Bores, bores_of
from assembly.proximity.clearance.boxes import ROUNDED_UP, Groups, boxes_around
from assembly.proximity.clearance.cells import CellTable, cells_of
from assembly.proximity.clearance.halve import place_cells
from assembly.proximity.clearance.halved_groups import GROUP, GROUP_SIZE, halve_groups
from assembly.proximity.clearance.records import (
    CELL_FACE,
    CELL_FACE_SIZE,
    LINKS,
    LINKS_SIZE,
    NODE,
    NODE_SIZE,
    NONE,
    WIRE,
    node_at,
)
from assembly.proximity.clearance.round_faces import Round, round_holes, round_of, round_parts
from assembly.proximity.clearance.wire_cells import WireCells, wire_cells

__all__ = ["BodyCells", "cells_of_body", "has_cells"]

Array = NDArray[np.float64]
Cells = list[CellTable | WireCells]
Table = NDArray[np.int64]
# How near first cells are to faces, in parts of the body's size, and how much a boundary turns along a chord [rad].
TOLERANCE, ANGLE = 8e-3, 0.5
# An axis is near the middle of a box around all of a body that is off it by no more than this part of the radius of the
# ball around it, by which the ball grows: bodies then seem to go so much farther.
NEAR_AXIS = 0.05


@dataclass(frozen=True, eq=False)
class BodyCells:
    """Trees and surfaces of a body, in its coordinates. Places and numbers count from the beginnings of the arrays.

    Attributes
    ----------
    table, pool : arrays
        Records of surfaces and boundary curves, and what they point to.
    curves : (c,) of int
        The places of boundary curves in the table; those of surfaces are in `faces`.
    faces : (f, CELL_FACE_SIZE) of int
    links, nodes : (n, LINKS_SIZE) of int, (n, NODE_SIZE)
        The root is the first row.
    first : (m,) of int
        The rows of the first cells.
    component : (m,) of int
        The connected part of the boundary that each of these belongs to.
    is_closed : bool
        Whether there is an inside.
    size, far : float
        The diagonal of a box around the body, and its largest coordinate.
    radius : float
        The least radius of what is round of the body, wires, cylinders, balls, tubes; else a quarter of its size.
    walls : tuple of Round
        Faces that are walls of cylindrical bores, or of hollow balls.
    """

    table: Table
    pool: Array
    curves: Table
    faces: Table
    links: Table
    nodes: Array
    first: Table
    component: Table
    is_closed: bool
    size: float
    far: float
    radius: float
    walls: tuple[Round, ...]

    @cached_property
    def is_of_wires(self) -> bool:
        """Whether all faces are round wires."""
        return bool((rows_of(LINKS, self.links).form[self.first] == WIRE).all())

    @cached_property
    def middle(self) -> Array:
        """The middle (3,) of a ball around the body."""
        return np.array(node_at(self.nodes, 0).center)

    @cached_property
    def extent(self) -> float:
        """The radius of that ball."""
        return float(node_at(self.nodes, 0).radius)


def cells_of_body(faces: tuple[Face, ...]) -> BodyCells:
    """The tree of a body's faces; equal shapes share one."""
    return _made_of(first_equal(faces))


@lru_cache(maxsize=128)
def _made_of(faces: tuple[Face, ...]) -> BodyCells:
    topology = solid_of(faces)
    boxes = np.array([face.surface.bounding_box() for face in topology.faces])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    size = float(np.linalg.norm(high - low))
    tables = [wire_cells(face, size) or cells_of(face, TOLERANCE * size, ANGLE) for face in topology.faces]
    packed = _packed_surfaces(topology.faces)
    links, nodes = _first_cells(tables, packed.curves)
    place_cells(packed.table, packed.pool, packed.faces, links, nodes)
    part, rounds, holes = _parts(topology.faces, tables)
    bores = bores_of(rounds, holes, part, rows_of(NODE, nodes), size)
    builder = _Builder(links, nodes, part, rounds, bores)
    # A cone has any radius down to none.
    radii = [found.radius for found in rounds if found is not None and not found.is_conical]
    radii += [float(table.first[0, 1]) for table in tables if isinstance(table, WireCells)]
    builder.build()
    _center_on_axis(rows_of(NODE, builder.nodes)[0], rounds)
    label = _components(topology)
    return BodyCells(
        packed.table,
        packed.pool,
        np.concatenate(packed.curves),
        packed.faces,
        builder.links,
        builder.nodes,
        builder.first,
        label[rows_of(LINKS, links).face],
        topology.is_closed,
        size,
        float(max(np.abs(low).max(), np.abs(high).max())),
        min([0.25 * size, *radii]),
        tuple(found for found in rounds if found is not None and not (found.outward or found.is_conical)),
    )


def has_cells(faces: tuple[Face, ...]) -> bool:
    """Whether a proof may be made of faces: files have some whose boundaries have gaps, or touch themselves."""
    try:
        cells_of_body(faces)
    except InputError:
        return False
    return True


def _parts(faces: tuple[Face, ...], tables: Cells) -> tuple[Table, list[Round | None], list[list[Round]]]:
    """Of every cell the number of the part of a face that it is of; what each part lies on, and its round holes."""
    labels: list[Table] = []
    rounds: list[Round | None] = []
    holes: list[list[Round]] = []
    for face, table in zip(faces, tables, strict=True):
        if isinstance(table, WireCells):
            labels.append(np.full(len(table.corner), len(rounds)))
            # A ring is a torus, whose hull is exact.
            rounds.append(round_of(face))
            holes.append([])
            continue
        direction, parts = round_parts(face)
        ends = face.surface.breaks()[direction][1 : len(parts)]
        labels.append(len(rounds) + np.searchsorted(ends, table.uv[..., direction].mean(axis=1)))
        rounds += parts
        # Only a face without a boundary has several parts.
        holes += [round_holes(face) if len(parts) == 1 else [] for _ in parts]
    return np.concatenate(labels), rounds, holes


def _components(topology: Topology) -> Table:
    """Of every face the number of the connected part of the boundary that it belongs to."""
    label = np.arange(len(topology.faces))
    for edge in topology.edges:
        if edge.face_b is not None:
            a, b = label[edge.face_a], label[edge.face_b]
            label[label == max(a, b)] = min(a, b)
    return label


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """Records of surfaces and boundary curves; `curves`: of every face the places of its boundary curves' records."""

    table: Table
    pool: Array
    faces: Table
    curves: list[Table]


def _packed_surfaces(faces: tuple[Face, ...]) -> _Surfaces:
    table: list[Table] = []
    pool: list[Array] = []
    curves, surfaces = [], []
    at = used = 0

    def append(record: Table, numbers: Array) -> int:
        nonlocal at, used
        table.append(record)
        pool.append(numbers)
        place, at, used = at, at + len(record), used + len(numbers)
        return place

    for face in faces:
        record, numbers = face.surface.packed()
        record = record.copy()
        patch = surface_at(record, 0)
        for field in ("breaks_u", "breaks_v", "coefficients", "cells"):
            patch[field] += used
        surfaces.append(append(record, numbers))
        places = []
        for curve in face.boundary:
            record, numbers = curve.packed()
            record = record.copy()
            spline_curve_at(record, 0).breaks += used
            spline_curve_at(record, 0).coefficients += used
            places.append(append(record, numbers))
        curves.append(np.array(places, dtype=np.int64))
    rows = np.zeros((len(faces), CELL_FACE_SIZE), dtype=np.int64)
    records = rows_of(CELL_FACE, rows)
    records.surface, records.sign = surfaces, [face.sign for face in faces]
    return _Surfaces(np.concatenate(table), np.concatenate(pool), rows, curves)


def _first_cells(tables: Cells, curves: list[Table]) -> tuple[Table, Array]:
    """Rows of all cells; corners and radii are not written yet."""
    count = sum(map(len, tables))
    links, nodes = np.zeros((count, LINKS_SIZE), dtype=np.int64), np.zeros((count, NODE_SIZE))
    at = 0
    for number, (table, places) in enumerate(zip(tables, curves, strict=True)):
        rows = slice(at, at + len(table))
        at = rows.stop
        link, node = rows_of(LINKS, links[rows]), rows_of(NODE, nodes[rows])
        link.child, link.face, link.form = NONE, number, table.form
        if isinstance(table, WireCells):
            link.rim = NONE
            node.corner, node.spine, node.first, node.pad = table.corner, table.center, table.first, table.pad
            continue
        rims = table.rims
        link.rim = np.where(rims.curve == NONE, NONE, np.append(places, NONE)[rims.curve])
        node.uv, node.second, node.first, node.pad = table.uv, table.second, table.first, table.pad
        link.hollow = rims.hollow
        node.rim_t, node.rim_second, node.ruling = rims.t, rims.second, table.ruling
    return links, nodes


class _Builder:
    """Makes the nodes above cells: first halves of a body's parts of faces, then halves of a part's cells."""

    def __init__(
        self, cell_links: Table, cell_nodes: Array, part: Table, rounds: list[Round | None], bores: Bores | None
    ) -> None:
        self.cell_links, self.cell_nodes = cell_links, cell_nodes
        self.bores = bores
        self.part = part
        self.cells = rows_of(NODE, cell_nodes)
        self.rounds = rounds
        count = len(cell_links)
        self.links = np.zeros((2 * count - 1, LINKS_SIZE), dtype=np.int64)
        self.nodes = np.zeros((2 * count - 1, NODE_SIZE))
        self.child = np.full(2 * count - 1, NONE)
        self.first = np.full(count, NONE)

    def build(self) -> None:
        """All nodes, the root first."""
        count = len(self.part)
        table, order = np.empty((2 * count - 1, GROUP_SIZE), dtype=np.int64), np.empty(count, dtype=np.int64)
        part = np.ascontiguousarray(self.part)
        halve_groups(np.ascontiguousarray(self.cells.center), part, len(self.rounds), order, table)
        halved = rows_of(GROUP, table)
        self.child, begin, end = np.array(halved.child), np.array(halved.begin), np.array(halved.end)
        single = np.flatnonzero(self.child == NONE)
        self.first[order[begin[single]]] = single
        is_round = np.zeros(len(table), dtype=bool)
        for k in np.flatnonzero((halved.whole >= 0) & (self.child != NONE)).tolist():
            found = self.rounds[halved.whole[k]]
            if found is not None and found.outward:
                # All that lies on a cylinder, a cone, a ball or a torus from inside of it.
                _write_round(rows_of(NODE, self.nodes[k : k + 1])[0], found)
                is_round[k] = True
        if self.bores is not None and is_round.any():
            # A disc with a round hole is outside of that as well.
            discs = np.flatnonzero(is_round)
            parts, nodes = Groups(halved.whole[discs], np.arange(len(discs))), rows_of(NODE, self.nodes)
            nearest = self.bores.nearest(parts, nodes.center[discs, None], nodes.ruling[discs])
            self._write_bores(discs, nearest, turned=False)
        boxed = np.flatnonzero((self.child != NONE) & ~is_round)
        many = (end - begin)[boxed]
        starts = np.cumsum(many) - many
        members = order[np.repeat(begin[boxed] - starts, many) + np.arange(many.sum())]
        self._write(boxed, Groups(members, starts))

    def _write(self, rows: Table, groups: Groups) -> None:
        """Links, cells, boxes around cells, and the bores that all these are outside of."""
        links, nodes = rows_of(LINKS, self.links), rows_of(NODE, self.nodes)
        links.face, links.child = NONE, self.child
        self.links[self.first], self.nodes[self.first] = self.cell_links, self.cell_nodes
        if len(rows):
            cells = self.cells
            boxes = boxes_around(cells.corner, cells.rho, cells.disc, cells.ruling, groups)
            nodes.center[rows], nodes.axes[rows], nodes.half[rows], nodes.radius[rows] = boxes
            if self.bores is not None:
                parts = groups._replace(members=self.part[groups.members])
                self._write_bores(rows, self.bores.nearest(parts, boxes.center[:, None]))
        if self.bores is not None:
            # A cell has the direction of its ruling already; of a wire it is none.
            cells = np.flatnonzero(rows_of(LINKS, self.cell_links).form != WIRE)
            parts = Groups(self.part[cells], np.arange(len(cells)))
            corners, rulings = self.cells.corner[cells, :3], self.cells.ruling[cells]
            self._write_bores(self.first[cells], self.bores.nearest(parts, corners, rulings), turned=False)

    def _write_bores(self, rows: Table, found: tuple[Table, Array], turned: bool = True) -> None:
        """Write bores into nodes, and their directions unless these have them and are not to be turned."""
        assert self.bores is not None
        bore, radius = found
        rows, bore, radius = rows[bore >= 0], bore[bore >= 0], radius[bore >= 0]
        nodes = rows_of(NODE, self.nodes)
        nodes.bore[rows], nodes.spine[rows], nodes.slant[rows] = radius, self.bores.center[bore], self.bores.slant[bore]
        # What has no ruling has no disc, either.
        axis = self.bores.axis[bore]
        free = np.full(len(rows), turned) | ~nodes.ruling[rows].any(axis=1)
        nodes.ruling[rows[free]] = axis[free]
        # A cone gets wider along its axis only. What a ruling says of a cell is the same both ways.
        nodes.ruling[rows[(nodes.ruling[rows] * axis).sum(axis=1) < 0.0]] *= -1.0


def _center_on_axis(root: np.record, rounds: list[Round | None]) -> None:
    """Have the middle of a body's root on the nearest axis of what is round of it, if one is near.

    A way is straight for that point (`way.py`): a shaft that turns in its bore turns about it.
    """
    found = []
    for each in rounds:
        if each is not None:
            off = each.center - root.center
            found.append(off - (off @ each.axis) * each.axis)
    move = min(found, key=np.linalg.norm, default=np.zeros(3))
    far = float(np.linalg.norm(move))
    if 0.0 < far <= NEAR_AXIS * root.radius:
        root.center += move
        root.half += np.abs(root.axes @ move)
        root.radius += far


def _write_round(node: np.record, found: Round) -> None:
    """The exact hull of a cylinder, a cone, a ball or a torus."""
    axis = found.axis if found.axis.any() else np.array([0.0, 0.0, 1.0])
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    node.center, node.ruling = found.center, axis
    node.axes = axis, across, np.cross(axis, across)
    if found.ring > 0.0:
        node.disc, node.rho, node.radius = found.ring, found.radius, found.ring + found.radius
    elif found.axis.any():
        node.half, node.less = (found.half, 0.0, 0.0), found.less
        node.disc, node.radius = found.radius, np.hypot(found.half, found.radius) * ROUNDED_UP
    else:
        node.rho = node.radius = found.radius
