"""A scene turned into the table and the pool that the compiled loop works on (`constraints/layout.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import prod, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.constraints import addresses, layout, terms
from assembly.constraints.clearance import Clearance
from assembly.constraints.constraint import Constraint, Coordinate, Equation, FramePair, structure_changes
from assembly.constraints.contact import Contact
from assembly.constraints.couplings import Coupling
from assembly.constraints.dexterity import MEASURES, TASKS, Dexterity
from assembly.constraints.elimination import FEW, block_record
from assembly.constraints.expression import Expression
from assembly.constraints.joint import Joint
from assembly.constraints.numbering import gathering_order, number_bodies
from assembly.constraints.objectives import FrameDistance, Objective, PointDistance, Posture
from assembly.constraints.primitives import AZIMUTH, TURN, place_frames
from assembly.constraints.primitives import RECORD as JOINT_FRAMES
from assembly.constraints.primitives import coordinate as coordinate_value
from assembly.constraints.trim_contact import FORMS, TrimContact
from assembly.constraints.turns import Turns
from assembly.errors import InputError
from assembly.geometry import tape
from assembly.geometry.face import Face
from assembly.geometry.pieces import TRIM_FIRST
from assembly.geometry.spline import CURVE_RECORD, SURFACE_RECORD
from assembly.geometry.surface import NurbsSurface
from assembly.kinematics.body import Body, BodyFace
from assembly.proximity import watch_memory
from assembly.proximity.events import fresh_memory
from assembly.proximity.facet_tree import FacetTree
from assembly.proximity.pairs import OFFSETS
from assembly.proximity.patch_list import LIST_INTS
from assembly.proximity.shell import EDGE_CURVE, EDGE_END, EDGE_RECORD, EDGE_START, EDGE_SURFACE
from assembly.proximity.shell_packing import pack_shell
from assembly.proximity.solid import is_one_smooth, solid_of
from assembly.proximity.solid_contact import TRACK
from assembly.proximity.tree_packing import pack_tree

__all__ = ["Packed", "pack", "structure_of"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Of a watch, in parts of the scene's size: how far its looks reach at least, and at most.
FIRST_REACH, LAST_REACH = 0.005, 0.05
# How far bodies may go between looks where contacts may be born, in parts of the smallest radius of curvature of the
# two; in parts of the scene's size, it is no less than this.
FLANK, LEAST_FLANK = 0.5, 1e-4
# Lists of facing patches are kept for so many pairs of bodies at a time.
MOST_LISTS = 64


class Packed:
    """A packed scene: arrays for the loop, and what is needed to refresh them between solves.

    Attributes
    ----------
    table, pool : arrays
        See `constraints/layout.py`. Lengths in the pool are divided by `scale`.
    scale : float
        The scene's size: the largest diagonal of a body's box.
    unit : float
        What one of the loop's objective counts in the user's units.
    sides : list of (Body or BodyFace, Body or BodyFace)
        The sides of every contact; faces where it is one of whole surfaces.
    whole : list of bool
        Whether a contact is one of two whole surfaces, without edges.
    clearances : list of Clearance
    guarded : list of list of (Body, Body)
        The pairs of bodies of every clearance.
    guards : int
        Rows of clearances, behind those of contacts.
    spans : list of slice
        The rows of every constraint.
    owners : (m,) int
        The constraint of every row.
    drives : (m,) bool
        Whether a driven value or a limit asks for the row.
    trims : int
        Rows of trims.
    pairs : (m,) int
        The contact whose pair a row is of, or -1.
    one_sided, lengths : (m,) bool
        Whether a row is >= 0; whether it is a length.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        constraints: Sequence[Constraint],
        objectives: Sequence[tuple[float, Objective]],
        places: int = 1,
    ) -> None:
        self.count = len(bodies)
        self.stamp = structure_changes()
        self.structure = structure_of(constraints)
        self._places = {id(body): k for k, body in enumerate(bodies)}
        self.scale = _scene_size(bodies, constraints, objectives)
        self.reference = bodies[0].pose.position.copy()
        self.contacts = [constraint for constraint in constraints if isinstance(constraint, Contact)]
        # Of a contact with trims the surfaces take part without their own boundaries.
        trimmed = {item.contact.name for item in constraints if isinstance(item, TrimContact)}
        self.whole = [contact.name in trimmed or not contact.edges for contact in self.contacts]
        self.sides = [
            (_face(contact.a), _face(contact.b)) if whole else (contact.a, contact.b)
            for contact, whole in zip(self.contacts, self.whole, strict=True)
        ]
        self.clearances = [constraint for constraint in constraints if isinstance(constraint, Clearance)]
        self.guarded = guarded_pairs(self.clearances, bodies)
        self.places = [
            places * _places(clearance, pairs) for clearance, pairs in zip(self.clearances, self.guarded, strict=True)
        ]
        self.guards = sum(self.places)
        self._targets: list[tuple[PointDistance | FrameDistance, int]] = []
        self._turns: list[tuple[FrameDistance, int]] = []
        self._values: list[tuple[Equation, int, float]] = []
        self._angles: list[Coordinate] = []
        self._angle_places: dict[int, int] = {}
        self._room = [0, 0, 0]
        self._frames: dict[int, tuple[int, FramePair]] = {}
        self._table: list[Table] = []
        self._pool: list[Array] = []
        self._table_size = self._pool_size = 0
        self._header = np.zeros(layout.HEADER, dtype=np.int64)
        implicit = not objectives
        self._build(bodies, constraints, objectives or [(1.0, Posture())])
        self._header[layout.IMPLICIT] = int(implicit)
        # What the loop is compiled for: None without a dexterity.
        self.tips = 1 if self._header[layout.DEXTERITIES] else None
        self.table = np.concatenate(self._table)
        if self.guards:
            self.table[self.table[layout.WATCH] + watch_memory.TRACK_SOLIDS] = self.table[layout.TRACK_AT]
        self.pool = np.concatenate(self._pool)
        self._sources = [item for item in self._values if item[0].source is not None]
        self._turned = Turns(self._angles, [(equation, at) for equation, at, _ in self._values])
        self.rows = int(self._header[layout.ROWS])
        self.tracked = self.pair_rows + len(self._angles)
        # Where the parts of a state begin: tracked values, multipliers, residuals, results.
        self.contacts_at = 7 * self.count
        self.angles_at = self.contacts_at + TRACK * self.pair_rows
        self.multipliers_at = self.contacts_at + TRACK * self.tracked
        self.residuals_at = self.multipliers_at + self.rows
        self.results_at = self.residuals_at + self.rows
        self.memory_at = self.results_at + layout.RESULTS
        self._memory = np.empty(0)
        if self.guards:
            # The first look sees what crosses at the start as well, if it is no deeper than this.
            self._memory = fresh_memory(sum(map(len, self.guarded)), self.guards, LAST_REACH)

    @property
    def pair_rows(self) -> int:
        """Rows of contacts, given ones and those of clearances."""
        return len(self.contacts) + self.guards

    def is_crowded(self, state: Array) -> bool:
        """Whether contacts of clearances were near that found no place."""
        return self.guards > 0 and state[self.memory_at + watch_memory.CROWDED] == 1.0

    def new_state(self) -> Array:
        """The state of a solve that knows nothing yet."""
        state = np.zeros(self.memory_at + self._memory.size)
        state[self.memory_at :] = self._memory
        return state

    def pair_name(self, k: int) -> str:
        """The name of the contact, or the clearance, that row k is of."""
        names = [contact.name for contact in self.contacts]
        for clearance, count in zip(self.clearances, self.places, strict=True):
            names += [clearance.name] * count
        return names[k]

    def table_at(self, state: Array) -> Table:
        """The table with the rows of clearances as a state has them; in the packed one they have no contacts."""
        table = self.table
        if self.guards and state.size > self.memory_at:
            table = table.copy()
            record = table[layout.WATCH]
            rows = table[table[layout.ROW_TABLE] + layout.ROW * table[layout.FIRST_GUARD] :][: layout.ROW * self.guards]
            pairs = table[table[record + watch_memory.PAIR_TABLE] :][
                : watch_memory.PAIR_RECORD * table[record + watch_memory.PAIRS]
            ]
            pairs = pairs.reshape(-1, watch_memory.PAIR_RECORD)
            for row, (place, number) in zip(rows.reshape(-1, layout.ROW), self.listed(state), strict=True):
                if place >= 0:
                    pair = pairs[place]
                    row[[layout.BODY_F, layout.BODY_G]] = pair[[watch_memory.PAIR_F, watch_memory.PAIR_G]]
                    row[layout.SURFACE_F : layout.SHELL_G + 1] = pair[
                        watch_memory.PAIR_SURFACE_F : watch_memory.PAIR_SHELL_G + 1
                    ]
                    row[layout.MINIMUM], row[layout.GUARD_NUMBER] = pair[watch_memory.PAIR_MINIMUM], number
        return table

    def listed(self, state: Array) -> list[tuple[int, int]]:
        """Of every place of a watch in a state: its pair of bodies, or -1, and the number of its contact."""
        pairs = sum(map(len, self.guarded))
        at = self.memory_at + watch_memory.MEMORY_HEADER + watch_memory.PAIR_MEMORY * pairs
        places = state[at : at + watch_memory.PLACE_MEMORY * self.guards].reshape(-1, watch_memory.PLACE_MEMORY)
        return [(int(pair), int(number)) for pair, number in places.tolist()]

    def _add(self, table: Sequence[int] | Table = (), pool: Sequence[float] | Array = ()) -> tuple[int, int]:
        """Append; returns where the parts begin."""
        at = self._table_size, self._pool_size
        self._table.append(np.asarray(table, dtype=np.int64))
        self._pool.append(np.asarray(pool, dtype=np.float64))
        self._table_size += len(self._table[-1])
        self._pool_size += len(self._pool[-1])
        return at

    def _build(
        self,
        bodies: Sequence[Body],
        constraints: Sequence[Constraint],
        objectives: Sequence[tuple[float, Objective]],
    ) -> None:
        header = self._header
        self.unit = max((term.weight * self._natural_unit(term) for _, term in objectives), default=1.0)
        pool = np.zeros(layout.POOL_HEADER)
        pool[layout.SCALE] = self.scale
        pool[layout.REFERENCE : layout.REFERENCE + 3] = self.reference
        pool[layout.UNIT] = self.unit
        self._add(header, pool)
        groups = [[self._places[id(body)] for body in item.bodies] for item in constraints]
        slots = number_bodies([body.fixed for body in bodies], groups)
        header[layout.SLOTS], _ = self._add(slots)
        rows: list[list[int]] = []
        owners: list[int] = []
        numbers = {id(constraint): k for k, constraint in enumerate(constraints)}
        records: dict[tuple[int, bool], int] = {}
        self.shells: dict[tuple[Face, ...], int] = {}
        for contact, sides, whole in zip(self.contacts, self.sides, self.whole, strict=True):
            places = [self._places[id(body)] for body in contact.bodies]
            fields = [layout.CONTACT_ROW, *places, int(contact.unilateral), 0, 1]
            if whole:
                fields += [self._surface(records, _side_faces(side)[0]) for side in sides] + [-1, -1, layout.ZERO]
            else:
                fields += [-1, -1] + [self._shell(_side_faces(side)) for side in sides] + [layout.ZERO]
            rows.append(fields)
            owners.append(numbers[id(contact)])
        for clearance, count in zip(self.clearances, self.places, strict=True):
            rows += [[layout.CONTACT_ROW, -1, -1, 1, 0, 1, -1, -1, -1, -1, layout.ZERO, 0] for _ in range(count)]
            owners += [numbers[id(clearance)]] * count
        header[layout.FIRST_GUARD], header[layout.GUARDS] = len(self.contacts), self.guards
        header[layout.WATCH] = self._watch() if self.guards else -1
        for trim in constraints:
            if isinstance(trim, TrimContact):
                new = self._trim(trim, rows)
                rows += new
                owners += [numbers[id(trim)]] * len(new)
        header[layout.TRIMS] = self.trims = len(rows) - self.pair_rows
        # Rows in the order of their bodies: then the envelope of J J^T is narrow, too.
        others = [item for item in constraints if isinstance(item, (Joint, Coupling))]
        others.sort(key=lambda item: max(slots[self._places[id(body)]] for body in item.bodies))
        extra = 0
        for joint in others:
            for equation in joint.equations:
                rows.append(self._equation(equation))
                owners.append(numbers[id(joint)])
                extra = max(extra, 2 * (len(equation.terms) - 1))
        tapes: list[list[int]] = []
        for item in constraints:
            if isinstance(item, Expression):
                side = int(item.unilateral)
                places = [self._places[id(body)] for body in item.bodies]
                tapes.append(self._tape(item, len(rows)))
                rows += [
                    [layout.TAPE_ROW, *[*places, -1][:2], side, 0, 0, len(tapes) - 1, value]
                    for value in range(item.count)
                ]
                owners += [numbers[id(item)]] * item.count
                extra = max(extra, len(places) - 2)
        header[layout.TAPE_TABLE], _ = self._add([field for tape in tapes for field in tape])
        header[layout.TAPES] = len(tapes)
        header[layout.ROW_TABLE], _ = self._add(
            [field for row in rows for field in row + [0] * (layout.ROW - len(row))]
        )
        header[layout.GATHER_TABLE] = self._gathering(bodies, rows)
        terms_: list[list[int]] = []
        for sign, objective in objectives:
            terms_.extend(self._terms(sign * objective.weight, objective, bodies))
        header[layout.TERM_TABLE], _ = self._add(
            [field for term in terms_ for field in term + [0] * (terms.TERM - len(term))]
        )
        # Terms have joints with frames, too.
        header[layout.JOINT_TABLE] = self._joints()
        header[layout.TAPE_ROOM], _ = self._add(self._room)
        header[layout.BODIES] = len(bodies)
        header[layout.MOVING] = int(slots.max()) + 1
        header[layout.CONTACTS] = self.pair_rows
        header[layout.TRACKED] = self.pair_rows + len(self._angles)
        header[layout.JOINTS] = len(self._frames)
        header[layout.ROWS] = len(rows)
        header[layout.EXTRA] = extra
        header[layout.TERMS] = len(terms_)
        header[layout.DEXTERITIES] = sum(term[0] == terms.DEXTERITY for term in terms_)
        if header[layout.MOVING] > FEW and not (self.guards or self.trims or header[layout.DEXTERITIES]):
            # Rows of clearances are of any bodies, those of trims and dexterities are not by blocks.
            shared = [term for _, term in objectives if isinstance(term, Expression)]
            groups += [[self._places[id(body)] for body in term.bodies] for term in shared]
            record = block_record(int(header[layout.MOVING]), [slots[group].tolist() for group in groups])
            header[layout.BLOCK_RECORD], header[layout.BLOCK_LENGTH] = self._add(record)[0], record.size
        self._take_addresses(header)
        self._table[0] = header
        table = np.array([row[:6] for row in rows], dtype=np.int64).reshape(-1, 6)
        self.owners = np.array(owners, dtype=np.int64)
        self.one_sided = table[:, layout.ONE_SIDED] == 1
        self.drives = table[:, layout.DRIVE] == 1
        self.lengths = table[:, layout.IS_LENGTH] == 1
        kinds = table[:, layout.KIND]
        self.pairs = np.where(kinds == layout.CONTACT_ROW, np.arange(len(rows)), -1)
        trims = np.flatnonzero(kinds == layout.TRIM_ROW)
        self.pairs[trims] = [rows[r][layout.TRIM_PAIR] for r in trims]
        by_owner = np.argsort(self.owners, kind="stable")
        ends = np.searchsorted(self.owners[by_owner], np.arange(len(constraints) + 1))
        self.spans = [by_owner[first:last] for first, last in pairwise(ends)]

    def _take_addresses(self, header: Table) -> None:
        """Where the kernels are that only contacts of solids, or trims, ask for."""
        if self.shells:
            header[[layout.TRACK_AT, layout.SEARCH_AT, layout.NEAREST_AT]] = addresses.solids()
        if header[layout.TRIMS]:
            header[[layout.TRIM_ROWS_AT, layout.TRIM_TERMS_AT]] = addresses.trims()
        if self.guards:
            header[layout.LOOK_AT] = addresses.watch()

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Addresses are those of one process; a copy, or what another process wrote, takes its own.
        self.__dict__.update(state)
        self.table = self.table.copy()
        self.table[layout.DEEPEST_AT] = 0
        self._take_addresses(self.table)
        if self.guards:
            self.table[self.table[layout.WATCH] + watch_memory.TRACK_SOLIDS] = self.table[layout.TRACK_AT]

    def seek_penetration(self) -> bool:
        """From now on contacts of solids that cross at the start are looked for; whether that is new.

        The kernel for it is large, and few scenes need it.
        """
        if not self.shells or self.table[layout.DEEPEST_AT]:
            return False
        self.table[layout.DEEPEST_AT] = addresses.deepest()
        return True

    def _gathering(self, bodies: Sequence[Body], rows: list[list[int]]) -> int:
        """Pack the order in which scattered bodies are put together; where it begins."""
        groups = []
        table = np.concatenate(self._table)
        for row in rows:
            places = row[1:3] if row[0] == layout.JOINT_ROW else []
            if places and row[layout.SECOND] >= 0:
                second = row[layout.SECOND]
                bodies_at = slice(second + layout.SECOND_BODY_F, second + layout.SECOND_RECORD)
                places = [*places, *table[bodies_at].tolist()]
            groups.append(list(dict.fromkeys(places)))
        order = gathering_order([body.fixed for body in bodies], groups)
        fields = [field for body, held in order for field in (body, len(held), *held)]
        return self._add([len(order), *fields])[0]

    def _natural_unit(self, objective: Objective) -> float:
        """What an objective of order one in scaled lengths counts in the user's units."""
        if isinstance(objective, Expression):
            return 1.0
        if not isinstance(objective, Dexterity):
            return self.scale**2
        task = objective.tip_task
        linear, angular = self.scale, task.length if task.task == "pose" else 1.0
        columns = [1.0 if freedom.coordinate.is_angle else 1.0 / self.scale for freedom in task.inputs]
        entry = {"position": linear, "rotation": angular, "pose": sqrt(linear * angular)}[task.task]
        entry *= prod(columns) ** (1.0 / len(columns))
        powers = {
            "manipulability": min(task.rows, len(columns)),
            "smallest_singular_value": 1,
            "force_transmission": -1,
        }
        return float(entry ** powers.get(objective.measure, 0))

    def _coordinate(self, coordinate: Coordinate) -> tuple[list[int], list[int]]:
        """The fields of a coordinate in a row, and its bodies."""
        frames = coordinate.frames
        number, _ = self._frames.setdefault(id(frames), (len(self._frames), frames))
        angle = -1
        if coordinate.kind in (TURN, AZIMUTH):
            place = self._angle_places.setdefault(id(coordinate), len(self._angles))
            if place == len(self._angles):
                self._angles.append(coordinate)
            angle = self.pair_rows + place
        bodies = [self._places[id(frame.body)] for frame in (frames.frame_a, frames.frame_b)]
        return [coordinate.kind, coordinate.component, number, angle], bodies

    def _equation(self, equation: Equation) -> list[int]:
        """The record of a row; its factors are such that it has the unit of its first term, lengths scaled."""
        (factor, first), *others = equation.terms
        unit = 1.0 if first.is_angle else self.scale
        pool = [factor, 0.0, 0.0]
        fields, bodies = self._coordinate(first)
        second = -1
        for other_factor, other in others:
            other_fields, other_bodies = self._coordinate(other)
            pool[1] = other_factor * (1.0 if other.is_angle else self.scale) / unit
            second, _ = self._add([*other_fields, *other_bodies])
        _, at = self._add(pool=pool)
        self._values.append((equation, at + 2, unit))
        flags = [int(equation.one_sided), int(equation.is_drive), int(not first.is_angle)]
        return [layout.JOINT_ROW, *bodies, *flags, *fields, at, second]

    def _tape(self, expression: Expression, row: int) -> list[int]:
        """Pack the instructions of an expression; its record."""
        places = []
        for instructions in expression.tapes:
            table = instructions.table.copy()
            table[tape.CONSTANTS] += self._pool_size
            places.append(self._add(table, instructions.constants)[0])
            self._room[2] = max(self._room[2], int(table[tape.WORK]))
        bodies, count = len(expression.bodies), expression.count
        self._room[0] = max(self._room[0], 7 * bodies + count)
        self._room[1] = max(self._room[1], count + 6 * bodies * count, 36 * bodies**2)
        listed, at = self._add([self._places[id(body)] for body in expression.bodies], [expression.scale])
        return [*places, count, bodies, listed, row, at, 0]

    def _joints(self) -> int:
        """Pack the frames; where their records begin."""
        fields: list[int] = []
        for _, pair in self._frames.values():
            pool = [
                np.concatenate([frame.origin / self.scale, frame.axes.T.ravel()])
                for frame in (pair.frame_a, pair.frame_b)
            ]
            _, at = self._add(pool=np.concatenate(pool))
            fields += [self._places[id(pair.frame_a.body)], self._places[id(pair.frame_b.body)], at]
        return self._add(fields)[0]

    def _surface(self, records: dict[tuple[int, bool], int], face: Face) -> int:
        """Offset of the record of a face; a surface that several bodies share is packed once."""
        key = (id(face.surface), face.reversed)
        if key not in records:
            record, pool = Face(face.surface.transformed(scale=1.0 / self.scale), reversed=face.reversed).packed()
            record = record.copy()
            record[list(OFFSETS)] += self._pool_size
            assert record.size == SURFACE_RECORD
            records[key], _ = self._add(record, pool)
        return records[key]

    def _shell(self, faces: tuple[Face, ...]) -> int:
        """Offset of the shell of a solid; faces that several bodies share are packed once."""
        if faces not in self.shells:
            table, pool, shell = pack_shell(solid_of(faces), self.scale, self._table_size, self._pool_size)
            self._add(table, pool)
            self.shells[faces] = shell
        return self.shells[faces]

    def _watch(self) -> int:
        """Pack what clearances watch; where its record begins."""
        trees = {}
        thin: dict[tuple[Face, ...], float] = {}
        for body in {id(body): body for pairs in self.guarded for pair in pairs for body in pair}.values():
            faces = _side_faces(body)
            tree = FacetTree.of(faces)
            if faces not in trees:
                table, pool, trees[faces] = pack_tree(tree, self.scale, self._table_size, self._pool_size)
                self._add(table, pool)
                thin[faces] = tree.least_radius / self.scale
        surfaces: dict[tuple[int, bool], int] = {}
        records: list[int] = []
        listed: list[int] = []
        first = 0
        for clearance, pairs, count in zip(self.clearances, self.guarded, self.places, strict=True):
            for pair in pairs:
                f, g = (_side_faces(body) for body in pair)
                flank = max(FLANK * min(thin[f], thin[g]), LEAST_FLANK)
                offsets = [FacetTree.of(faces).offset / self.scale for faces in (f, g)]
                _, minimum = self._add(pool=[clearance.minimum / self.scale, flank, *offsets])
                if is_one_smooth(f) and is_one_smooth(g):
                    shape = [self._surface(surfaces, f[0]), self._surface(surfaces, g[0]), -1, -1]
                else:
                    shape = [-1, -1, self._shell(f), self._shell(g)]
                given = [
                    field
                    for k, contact in enumerate(self.contacts)
                    if {id(contact.body_a), id(contact.body_b)} == {id(body) for body in pair} and shape[0] >= 0
                    for field in (k, int(contact.body_a is pair[1]))
                ]
                places = [self._places[id(body)] for body in pair]
                room = [first, first + count, len(listed), len(given) // 2]
                records += [*places, trees[f], trees[g], *shape, minimum, *room]
                listed += given
            first += count
        given_at, _ = self._add(listed)
        table = np.array(records, dtype=np.int64).reshape(-1, watch_memory.PAIR_RECORD)
        table[:, watch_memory.GIVEN] += given_at
        pair_table, _ = self._add(table.ravel())
        lengths = np.zeros(watch_memory.LENGTH_COUNT)
        lengths[watch_memory.NEGLECT] = min(clearance.neglect for clearance in self.clearances)
        lengths[watch_memory.FIRST_REACH], lengths[watch_memory.LAST_REACH] = FIRST_REACH, LAST_REACH
        _, lengths_at = self._add(pool=lengths)
        lists = min(len(table), MOST_LISTS)
        list_table, _ = self._add([-1] * (LIST_INTS * lists))
        counts = [len(table), self.guards, pair_table, len(self.contacts), 0, lengths_at]
        corners = int(any(clearance.corners for clearance in self.clearances))
        return self._add([*counts, lists, list_table, corners])[0]

    def _trim(self, trim: TrimContact, rows: list[list[int]]) -> list[list[int]]:
        """The records of a trim's rows."""
        table, pool = trim.region.packed_trim(self._table_size, self._pool_size)
        loop, _ = self._add(table, pool)
        factor = trim.stretch / self.scale
        _, at = self._add(pool=[-factor if trim.keep == "outside" else factor])
        pair = next(k for k, contact in enumerate(self.contacts) if contact.name == trim.contact.name)
        places = [self._places[id(body)] for body in trim.bodies]
        form = FORMS.index(trim.form)
        count = (1, 2, 3, 3)[form]
        side = int(trim.unilateral)
        edges = -1 if form == 0 else self._loop_edges(trim, loop, rows[pair][layout.SURFACE_F + trim.side])
        self._header[layout.VECTOR_TRIMS] |= int(form > 0)
        fields = [layout.TRIM_ROW, *places, side, 0, 1, pair, trim.side, loop, at, form]
        return [[*fields, count, edges, int(trim.form in ("parametric", "cartesian"))] for _ in range(count)]

    def _loop_edges(self, trim: TrimContact, loop: int, surface: int) -> int:
        """Records of the curves of a trim's loop as edges on its surface; where they begin."""
        fields: list[int] = []
        first = int(np.concatenate(self._table)[loop + TRIM_FIRST])
        for k, curve in enumerate(trim.region.boundary):
            record = np.full(EDGE_RECORD, -1, dtype=np.int64)
            record[EDGE_SURFACE], record[EDGE_CURVE] = surface, first + CURVE_RECORD * k
            if not curve.closed:
                record[EDGE_START], record[EDGE_END] = 0, 0
            fields += record.tolist()
        return self._add(fields)[0]

    def _terms(self, weight: float, objective: Objective, bodies: Sequence[Body]) -> list[list[int]]:
        if isinstance(objective, (Dexterity, Expression)):
            weight /= self.unit  # their values are in the user's units
        else:
            weight *= self._natural_unit(objective) / self.unit
        if isinstance(objective, PointDistance):
            point = objective.point.coordinates / self.scale
            _, at = self._add(pool=[weight, *point, 0.0, 0.0, 0.0])
            self._targets.append((objective, at + 4))
            return [[terms.POINT_DISTANCE, self._places[id(objective.point.body)], at]]
        if isinstance(objective, FrameDistance):
            return self._frame_terms(weight, objective)
        if isinstance(objective, Dexterity):
            return [[terms.DEXTERITY, *self._dexterity(weight, objective)]]
        if isinstance(objective, Expression):
            _, at = self._add(pool=[weight])
            listed, _ = self._add(self._tape(objective, -1))
            return [[terms.TAPE_TERM, -1, at, listed]]
        assert isinstance(objective, Posture)
        if objective.reference is not None and len(objective.reference) != len(bodies):
            raise InputError(f"reference has {len(objective.reference)} rows; expected one per body, {len(bodies)}")
        records = []
        for k, body in enumerate(bodies):
            if not body.fixed:
                lever = 0.5 * (body.size or self.scale) / self.scale
                row = body.q if objective.reference is None else objective.reference[k]
                place = (row[:3] - self.reference) / self.scale
                _, at = self._add(pool=[weight, *place, *row[3:], weight * lever**2])
                records.append([terms.POSTURE, k, at, 0, int(objective.reference is None)])
        return records

    def _dexterity(self, weight: float, objective: Dexterity) -> list[int]:
        """Body, parameters and record of a term (`solve/dexterity.py`)."""
        task = objective.tip_task
        fields = [MEASURES.index(objective.measure), TASKS.index(task.task), len(task.inputs)]
        factors = []
        for freedom in task.inputs:
            coordinate, bodies = self._coordinate(freedom.coordinate)
            fields += [*coordinate, *bodies]
            factors.append(1.0 if freedom.coordinate.is_angle else 1.0 / self.scale)
        direction = np.zeros(6) if objective.direction is None else np.resize(objective.direction, 6)
        turn = task.length if task.task == "pose" else 1.0
        _, at = self._add(pool=[weight, *(task.origin / self.scale), self.scale, turn, *direction, *factors])
        return [self._places[id(task.tip.body)], at, self._add(fields)[0]]

    def _frame_terms(self, weight: float, objective: FrameDistance) -> list[list[int]]:
        """A frame's origin drawn to a point, and its body turned to a quaternion."""
        frame = objective.frame
        place = self._places[id(frame.body)]
        _, at = self._add(pool=[weight, *(frame.origin / self.scale), 0.0, 0.0, 0.0])
        self._targets.append((objective, at + 4))
        lever = objective.length / self.scale
        _, turn = self._add(pool=[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, weight * lever**2])
        self._turns.append((objective, turn + terms.POSTURE_QUATERNION))
        return [[terms.POINT_DISTANCE, place, at], [terms.POSTURE, place, turn]]

    def start_angles(self, q: Array, state: Array, warm: bool) -> None:
        """Write the turns that angles start on into a state."""
        if not self._angles:
            return
        near = state[self.angles_at : self.multipliers_at : TRACK]
        if warm and not self._turned.coupled:
            self._turned.follow_drives(self.pool, near)
            return
        scaled = q.copy()
        scaled[:, :3] = (q[:, :3] - self.reference) / self.scale
        records = np.empty((1, JOINT_FRAMES))

        def evaluate(coordinate: Coordinate, near: float) -> float:
            number = self._frames[id(coordinate.frames)][0]
            i, j, at = self.table[self._header[layout.JOINT_TABLE] + layout.JOINT_RECORD * number :][:3]
            place_frames(self.pool, at, scaled, i, j, records, 0)
            value = float(coordinate_value(coordinate.kind, coordinate.component, records, 0, near)[0])
            return value if coordinate.is_angle else value * self.scale

        self._turned.start(self.pool, near, warm, evaluate)

    def refresh(self) -> None:
        """Write what may have changed since the last solve: values and targets."""
        pool, scale = self.pool, self.scale
        x, y, z = self.reference.tolist()
        for equation, at, unit in self._sources:
            pool[at] = equation.current() / unit
        for distance, at in self._targets:
            target = distance._target
            pool[at] = (target[0] - x) / scale
            pool[at + 1] = (target[1] - y) / scale
            pool[at + 2] = (target[2] - z) / scale
        for frame_distance, at in self._turns:
            pool[at : at + 4] = frame_distance.body_quaternion


def guarded_pairs(clearances: Sequence[Clearance], bodies: Sequence[Body]) -> list[list[tuple[Body, Body]]]:
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


def _places(clearance: Clearance, pairs: Sequence[tuple[Body, Body]]) -> int:
    """How many contacts may be near at a time."""
    if not pairs:
        return 0
    bodies = len({id(body) for pair in pairs for body in pair})
    return clearance.places or min(4 + 2 * len(pairs), 8 + 4 * bodies)


def structure_of(constraints: Sequence[Constraint]) -> tuple[tuple[object, ...], ...]:
    """Which rows constraints have, whatever their values."""
    return tuple(
        (id(item), id(equation.terms[0][1]), equation.terms[0][0], equation.source and equation.source[1])
        for item in constraints
        if isinstance(item, (Joint, Coupling))
        for equation in item.equations
    )


def _scene_size(
    bodies: Sequence[Body], constraints: Sequence[Constraint], objectives: Sequence[tuple[float, Objective]]
) -> float:
    """The largest body, by its shape or by the frames and points on it; of points alone, their spread."""
    marks: dict[int, list[Array]] = {id(body): [] for body in bodies}
    for item in constraints:
        for equation in getattr(item, "equations", ()):
            for _, coordinate in equation.terms:
                for frame in (coordinate.frames.frame_a, coordinate.frames.frame_b):
                    marks[id(frame.body)].append(frame.origin)
    for _, term in objectives:
        if isinstance(term, PointDistance):
            marks[id(term.point.body)].append(term.point.coordinates)
        elif isinstance(term, FrameDistance):
            marks[id(term.frame.body)].append(term.frame.origin)
        elif isinstance(term, Dexterity):
            marks[id(term.tip_task.tip.body)].append(term.tip_task.origin)
    sizes = [max(body.size, _spread(marks[id(body)])) for body in bodies]
    size = max(sizes)
    if not size > 0.0:
        size = _spread([body.pose.apply(mark) for body in bodies for mark in (np.zeros(3), *marks[id(body)])])
    return size if size > 0.0 else 1.0


def _spread(points: Sequence[Array]) -> float:
    """Diagonal of the box around points."""
    return float(np.linalg.norm(np.ptp(points, axis=0))) if points else 0.0


def _side_faces(side: Body | BodyFace) -> tuple[Face, ...]:
    """The faces that take part on a side of a contact."""
    return (side.face,) if isinstance(side, BodyFace) else tuple(part.face for part in side.faces)


def lone_surfaces(sides: tuple[Body | BodyFace, Body | BodyFace]) -> tuple[NurbsSurface, NurbsSurface] | None:
    """The two surfaces of a contact, if each of its sides has one face."""
    f, g = (_side_faces(side) for side in sides)
    return (f[0].surface, g[0].surface) if len(f) == len(g) == 1 else None


def _face(side: Body | BodyFace) -> BodyFace:
    """The only face of a side."""
    return side if isinstance(side, BodyFace) else side.faces[0]


def pack(
    bodies: Sequence[Body],
    constraints: Sequence[Constraint],
    objectives: Sequence[tuple[float, Objective]],
    places: int = 1,
) -> Packed:
    """Pack a scene. `objectives` are (sign, term): 1 to minimize, -1 to maximize; a posture where there is none.

    Clearances have so many times the places they ask for.
    """
    return Packed(bodies, constraints, objectives, places)
