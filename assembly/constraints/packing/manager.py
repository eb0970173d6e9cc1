"""Pairs of bodies that clearances keep apart (`proximity/manager/update.py`), and their slots for contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._columns import Columns
from assembly._record import rows_of
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import Contact, side_faces
from assembly.constraints.packing.corners import Kept, SidePair, body_of
from assembly.constraints.packing.scene_writer import SceneWriter
from assembly.constraints.program import records as layout
from assembly.errors import InputError
from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.centerline import spine_of
from assembly.kinematics.body import Body
from assembly.proximity.brep.solid import is_one_smooth
from assembly.proximity.bvh.facet_tree import FacetTree
from assembly.proximity.bvh.neighbor_list import LIST_INTS
from assembly.proximity.bvh.packing import pack_tree
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager.centerlines.packing import pack_centerline
from assembly.proximity.manager.extrema import GIVEN_RECORD
from assembly.proximity.manager.parameters import LARGEST_MARGIN, LEAST_MARGIN

__all__ = [
    "WatchedPairs",
    "clearance_pairs",
    "is_of_surfaces",
    "slot_count",
    "table_with_clearances",
    "with_manager",
]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
Pair = tuple[Body, Body]
# A contact of the scene, its sides, and whether it is one of their whole surfaces, without edges.
GivenContact = tuple[Contact, SidePair, bool]

# How far bodies may go between updates where contacts may be born, in parts of the smallest radius of curvature of the
# two; in parts of the scene's size, it is no less than this.
FLANK, LEAST_FLANK = 0.5, 1e-4
# Faces leave edges that they share, and Newton's method leaves roots beside their surfaces, by less than so many times
# what tells points of a body apart: by so much more facets of a body with edges are taken to be off, flat ones too.
SEAMS = 3.0
# Lists of facing patches are kept for so many pairs of bodies at a time.
MOST_LISTS = 64


def clearance_pairs(clearances: Sequence[Clearance], bodies: Sequence[Body]) -> list[list[Pair]]:
    """The pairs that each clearance keeps apart; no pair may be that of two."""
    owner: dict[frozenset[int], str] = {}
    result = []
    for clearance in clearances:
        pairs = clearance.pairs(bodies)
        for a, b in pairs:
            other = owner.setdefault(frozenset((id(a), id(b))), clearance.name)
            if other != clearance.name:
                raise InputError(
                    f"clearance {clearance.name!r} is of bodies {a.name!r} and {b.name!r}, of which clearance "
                    f"{other!r} is, too; expected each pair once, say exclude=..."
                )
        result.append(pairs)
    return result


def slot_count(kept: Kept, pairs: Sequence[SidePair]) -> int:
    """How many contacts may be near at a time."""
    if not pairs:
        return 0
    bodies = len({id(body) for pair in pairs for body in pair})
    return kept.slots or min(4 + 2 * len(pairs), 8 + 4 * bodies)


def is_of_surfaces(pair: SidePair) -> bool:
    """Whether contacts of two bodies are of two surfaces; else they are of solids.

    A round wire and a body that is none may touch along all of a circle, as a ring and a ball that it lies on: points
    of such a continuum are held in place only where features are (`proximity/manager/continua.py`).
    """
    both = [side_faces(side) for side in pair]
    if not all(map(is_one_smooth, both)):
        return False
    first, second = (spine_of(faces[0]) is None for faces in both)
    return first == second


class WatchedPairs(NamedTuple):
    """What is kept apart, the pairs and the places of each, and the given contacts in the order of their rows."""

    kept: Sequence[Kept]
    pairs: Sequence[Sequence[SidePair]]
    places: Sequence[int]
    contacts: Sequence[GivenContact]


def with_manager(arrays: tuple[Table, Array], writer: SceneWriter, watched: WatchedPairs) -> tuple[Table, Array]:
    """Table and pool that a writer wrote, with a contact manager behind all else."""
    begin = writer.table_at, writer.pool_at
    manager = _pack_manager(writer, watched)
    table, pool = writer.arrays()
    table = np.concatenate([arrays[0], table[begin[0] :]])
    table[layout.MANAGER_RECORD] = manager
    return table, np.concatenate([arrays[1], pool[begin[1] :]])


def _pack_manager(writer: SceneWriter, watched: WatchedPairs) -> int:
    """Pack the contact manager of what is kept apart, of which each has pairs and places; where its record begins.

    The first place is behind the given contacts.
    """
    kept, contacts = watched.kept, watched.contacts
    pairs = _PairPacking(writer, [pair for own in watched.pairs for pair in own], contacts)
    first = 0
    for item, own, count in zip(kept, watched.pairs, watched.places, strict=True):
        for pair in own:
            pairs.add(pair, item.minimum, [first, first + count])
        first += count
    count, pair_table = pairs.write()
    block = np.zeros(manager_records.LENGTH_COUNT)
    lengths = manager_records.lengths_at(block, 0)
    lengths.merge_radius = min(item.merge_radius for item in kept)
    lengths.least_margin, lengths.largest_margin = LEAST_MARGIN, LARGEST_MARGIN
    row = np.zeros(manager_records.MANAGER_SIZE, dtype=np.int64)
    record = manager_records.manager_at(row, 0)
    record.pairs, record.places, record.pair_table, record.first = count, first, pair_table, len(contacts)
    _, record.lengths = writer.add(pool=block)
    record.lists = min(count, MOST_LISTS)
    record.list_table, _ = writer.add([-1] * (LIST_INTS * int(record.lists)))
    record.corners = any(item.corners for item in kept)
    # Where one is asked for, its address is written when the scene is ready.
    record.mark_address = pairs.any_in_place
    return writer.add(row)[0]


def table_with_clearances(table: Table, placed: Sequence[Sequence[int]]) -> Table:
    """A table whose rows of clearances have contacts.

    `placed` has for every row its pair or -1, the number of its contact, and 1 where that is in the place of a given
    one.
    """
    table = table.copy()
    header = layout.header_at(table, 0)
    first = header.row_table + layout.ROW * header.first_clearance_row
    listed = np.array(placed, dtype=np.int64).reshape(-1, 3)
    which = np.flatnonzero(listed[:, 0] >= 0)
    place, number, given = listed[which].T
    manager = manager_records.manager_at(table, header.manager_record)
    pairs = table[manager.pair_table :][: manager_records.PAIR_RECORD * manager.pairs]
    pair = Columns(manager_records.PAIR_DTYPE, pairs.reshape(-1, manager_records.PAIR_RECORD))
    row = Columns(layout.CONTACT_ROW_RECORD, table[first:][: layout.ROW * len(listed)].reshape(-1, layout.ROW))
    row.body_f[which], row.body_g[which] = pair.body_f[place], pair.body_g[place]
    row.surface_f[which], row.surface_g[which] = pair.surface_f[place], pair.surface_g[place]
    row.shell_f[which], row.shell_g[which] = pair.shell_f[place], pair.shell_g[place]
    row.minimum[which] = pair.minimum[place] + manager_records.IN_PLACE * given
    row.clearance_number[which] = number
    return table


class _PairPacking:
    """The pairs of a contact manager while they are packed; the trees of all their bodies come first."""

    def __init__(self, writer: SceneWriter, pairs: Sequence[SidePair], contacts: Sequence[GivenContact]) -> None:
        self._writer = writer
        self._contacts = contacts
        self._records: list[list[int]] = []
        self.any_in_place = False
        self._given: list[int] = []
        self._surfaces: dict[tuple[int, bool], int] = {}
        self._spines: dict[Face, int] = {}
        # Where the tree of faces is, the radius of a ball around it, how far from the body's origin it reaches, its
        # smallest radius of curvature and how far its facets are off; bodies of a shape share it.
        self._trees: dict[tuple[Face, ...], tuple[int, float, float, float, float]] = {}
        for faces in dict.fromkeys(side_faces(side) for pair in pairs for side in pair):
            tree = FacetTree.of(first_equal(faces))
            table, pool, at = pack_tree(tree, writer.scale, writer.table_at, writer.pool_at)
            writer.add(table, pool)
            seams = SEAMS * tree.topology.tolerance if tree.topology.edges else 0.0
            ball = float(tree.nodes.radius[0])
            far = float(np.linalg.norm(0.5 * (tree.nodes.low[0] + tree.nodes.high[0]))) + ball
            offset = (tree.offset + seams) / writer.scale
            self._trees[faces] = at, ball, far, tree.least_radius / writer.scale, offset

    def add(self, pair: SidePair, least: float, places: Sequence[int]) -> None:
        """Pack a pair with its least gap and where its places begin and end."""
        writer = self._writer
        f, g = (side_faces(side) for side in pair)
        bodies = tuple(body_of(side) for side in pair)
        tree_f, ball_f, far_f, radius_f, offset_f = self._trees[f]
        tree_g, ball_g, far_g, radius_g, offset_g = self._trees[g]
        flank = max(FLANK * min(radius_f, radius_g), LEAST_FLANK)
        far = [far_f / writer.scale, far_g / writer.scale]
        lengths = [least / writer.scale, flank, offset_f, offset_g, *far]
        spines = [-1, -1]
        if is_of_surfaces(pair):
            shape = [writer.surface(self._surfaces, f[0]), writer.surface(self._surfaces, g[0]), -1, -1]
            spines = self._spines_of(f[0], g[0])
        else:
            shape = [-1, -1, writer.shell(f), writer.shell(g)]
        # Of bodies with edges a contact and a least gap of zero are both asked for.
        given = self._contacts_of(bodies) if is_of_surfaces(pair) or least > 0.0 else []
        if given and least > 0.0:
            self.any_in_place = True
            lengths += [0.0, *lengths[1:]]
        _, minimum = writer.add(pool=lengths)
        fields = [*writer.places_of(bodies), tree_f, tree_g, *shape, minimum, *places]
        many = len(given) // GIVEN_RECORD
        self._records.append([*fields, len(self._given), many, int(ball_g <= ball_f), *spines])
        self._given += given

    def _spines_of(self, f: Face, g: Face) -> list[int]:
        """Where the spines of two faces are, if both are round wires."""
        for face in (f, g):
            spine = spine_of(face)
            if spine is None:
                return [-1, -1]
            if face not in self._spines:
                writer = self._writer
                table, pool, at = pack_centerline(spine, writer.scale, writer.table_at, writer.pool_at)
                writer.add(table, pool)
                self._spines[face] = at
        return [self._spines[f], self._spines[g]]

    def _contacts_of(self, pair: tuple[Body, ...]) -> list[int]:
        """The records of given contacts between two bodies."""
        writer = self._writer
        fields: list[int] = []
        for k, (contact, sides, is_whole) in enumerate(self._contacts):
            if {id(body) for body in contact.bodies} == {id(body) for body in pair}:
                faces = [side_faces(side) for side in sides]
                fields += [k, int(contact.body_a is pair[1]), int(contact.unilateral)]
                if is_whole:
                    fields += [*(writer.surface(self._surfaces, own[0]) for own in faces), -1, -1]
                else:
                    fields += [-1, -1, *(writer.shell(own) for own in faces)]
        return fields

    def write(self) -> tuple[int, int]:
        """How many pairs there are, and where their records begin."""
        given_place, _ = self._writer.add(self._given)
        table = np.array(self._records, dtype=np.int64).reshape(-1, manager_records.PAIR_RECORD)
        rows_of(manager_records.PAIR_DTYPE, table).given += given_place
        return len(table), self._writer.add(table)[0]
