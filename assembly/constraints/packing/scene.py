"""A scene turned into the table and the pool that the compiled loop works on (`constraints/program/records.py`)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._address import clock_address
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint, Equation, RowConstraint, structure_changes
from assembly.constraints.model.contact import Contact, lone_surfaces, side_face
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.objectives import Objective, Posture
from assembly.constraints.packing import addresses
from assembly.constraints.packing import manager as manager_packing
from assembly.constraints.packing.asked import Asked
from assembly.constraints.packing.corners import ContactCorners, Kept, SidePair, check_gaps, corners_of
from assembly.constraints.packing.elimination_order import FEW, block_record
from assembly.constraints.packing.manager import WatchedPairs
from assembly.constraints.packing.manager_last import ManagerLast
from assembly.constraints.packing.numbering import number_bodies
from assembly.constraints.packing.places import names_of_whole
from assembly.constraints.packing.revolutions import Turns
from assembly.constraints.packing.rows import RowPacking
from assembly.constraints.packing.scene_size import check_reach, size_and_extent
from assembly.constraints.packing.scene_writer import SceneWriter
from assembly.constraints.packing.terms import RowNumbers, TermPacking, natural_unit
from assembly.constraints.program import records as layout
from assembly.constraints.program.coordinates_at import coordinates_at
from assembly.constraints.program.hessian_blocks import FACTORIZE_AT, SOLVE_AT
from assembly.constraints.program.kept import kept_size, kept_unknowns
from assembly.constraints.program.primitives import RECORD as JOINT_FRAMES
from assembly.errors import FARTHEST, InputError
from assembly.kinematics.body import Body
from assembly.kinematics.changes import numbers_set
from assembly.proximity.features.solid_contact import TRACK
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager.events import fresh_memory, listed_places
from assembly.proximity.manager.parameters import LARGEST_MARGIN

if TYPE_CHECKING:
    from assembly.constraints.packing.number_places import NumberPlaces
    from assembly.proximity.clearance.proof import ClearanceProof

__all__ = ["MORE_PLACES", "MOST_CROWDING", "Packed", "structure_of"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Smaller numbers have fewer digits; those whose reciprocals are, too, may overflow.
LEAST_UNIT = 1e-305
# A size that rests on values alone is another one where they have grown or shrunk by this factor.
OUTGROWN = 1e4

# Bytes of a state, what touching is, and what was proven there.
Stood = tuple[bytes, float, list[Any]]
# How many times as many places as they ask for a solve gives to clearances.
MORE_PLACES, MOST_CROWDING = 4, 16
# Numbers of pools that are not as they were packed (0).
_versions = itertools.count(1)


class Packed(ManagerLast):
    """A packed scene: arrays for the loop, and what is needed to refresh them between solves.

    Parameters
    ----------
    bodies, constraints
    objectives : sequence of (sign, term)
        1 to minimize, -1 to maximize; a posture where there is none.
    places : int
        Clearances have so many times the places they ask for.
    corners : bool
        Whether the corners of contacts of solids are listed (`packing/corners.py`).
    size : float, optional
        What lengths are divided by; the scene's size by default.

    Attributes
    ----------
    table, pool : arrays
        See `constraints/program/records.py`. Lengths in the pool are divided by `scale`.
    crowding : int
        How many times as many places as they ask for clearances have.
    origin : object
        The same of a scene that is packed again with more places, and of no other one.
    scale : float
        The scene's size (`scene_size`), 1 where it has none.
    kept_at, kept_size : int
        Where in a state, and how long, what a solve leaves for the next one is (`program/kept.py`).
    workspaces : list of three arrays
        What solves that are over worked in, for the next ones (`solve/attempts/attempts.py`).
    proofs : list of ClearanceProof
        Of the pairs that clearances keep apart, of solves that have ended.
    stood : (bytes, float, list) or None
        Poses, with pairs of contacts, that were proven to hold as they stand; what touching was; what was proven.
    asked : Asked
        What the last solve was asked for.
    number_places : NumberPlaces or None
        Where numbers are that were set anew; the same of twins, which have them in the same places.
    derivative_plans : dict
        How solutions are derived (`derivatives/plan.py`), of the scene and its twins.
    has_size : bool
        Whether the scene has a size.
    before : Packed or None
        The same scene as it was packed before it had this size, or these rows of clearances.
    lineage : object
        The same of a scene that is packed again because numbers were set anew (`numbers`), and of no other one.
    numbers : int
        The count of such numbers (`kinematics/changes.py`) when it was packed or compared last.
    faces : list of Face
        Of all bodies when it was packed.
    terms_at, frames_at : int
        Where the pool has the numbers of terms, and of frames.
    body_places : dict
        The number of a body.
    domains : list of (4, 2) array or None
        Of every contact of two surfaces the ranges of their parameters.
    unit : float
        What one of the loop's objective counts in the user's units.
    sides : list of (Body or BodyFace, Body or BodyFace)
        The sides of every contact; faces where it is one of whole surfaces.
    whole : list of bool
        Whether a contact is one of two whole surfaces, without edges.
    gaps : list of int
        Where the pool has the least gap of every contact.
    clearances : list of Clearance
    clearance_pairs : list of list of (Body, Body)
        The pairs of bodies of every clearance.
    keeps_apart : bool
        Whether a clearance keeps two bodies apart, so that ends of solves are to be proven.
    corners : list of ContactCorners
        Contacts whose corners are listed.
    kept : list of Kept
        Clearances, and then corners: what the contact manager lists contacts for.
    pairs_of_kept : list of list of (side, side)
        The pairs of each.
    kept_pairs : list of (side, side)
        All pairs that are kept apart, in the order of the contact manager.
    clearance_rows : int
        Rows of clearances and corners, behind those of contacts.
    spans : list of int arrays
        The rows of every constraint.
    owners : (m,) int
        The constraint of every row.
    drives : (m,) bool
        Whether a driven value or a limit asks for the row.
    trims : int
        Rows of trims, and of places that contacts are kept at.
    placed : list of (ContactPlace, int)
        Constraints that are places of contacts, and where the numbers of each are in the pool.
    drawn : list of ContactPlace
        Terms of the objective that are places of contacts.
    row_numbers : RowNumbers
        What terms of the objective know of rows.
    chooses_turns : bool
        Whether the turns of angles are told by where bodies stand once they are put together.
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
        corners: bool = False,
        size: float | None = None,
    ) -> None:
        self.count = len(bodies)
        self.numbers, self.lineage = numbers_set(), object()
        self.stamp = structure_changes()
        self.structure = structure_of(constraints)
        measured, self._has_no_extent = size_and_extent(bodies, constraints, objectives)
        size = measured if size is None else size
        self.has_size = size > 0.0
        self.before: Packed | None = None
        self.faces = [side.face for body in bodies for side in body.faces]
        self._measure_by(size if self.has_size else 1.0, bodies, objectives or [(1.0, Posture())])
        self.contacts = [constraint for constraint in constraints if isinstance(constraint, Contact)]
        # Of a contact with trims or places the surfaces take part without their own boundaries.
        trimmed = names_of_whole(constraints, objectives)
        self.whole = [contact.name in trimmed or not contact.edges for contact in self.contacts]
        self.sides = [
            (side_face(contact.a), side_face(contact.b)) if whole else (contact.a, contact.b)
            for contact, whole in zip(self.contacts, self.whole, strict=True)
        ]
        surfaces = [lone_surfaces(pair) for pair in self.sides]
        self.domains = [None if pair is None else np.array([d for s in pair for d in s.domain]) for pair in surfaces]
        self.clearances = [constraint for constraint in constraints if isinstance(constraint, Clearance)]
        self.clearance_pairs = manager_packing.clearance_pairs(self.clearances, bodies)
        self.keeps_apart = any(self.clearance_pairs)
        check_gaps(self.contacts, self.clearances, self.clearance_pairs)
        listed = corners_of(self.contacts, self.whole, self.clearances, self.clearance_pairs) if corners else []
        self.corners: list[ContactCorners] = listed
        self.kept: list[Kept] = [*self.clearances, *listed]
        self.pairs_of_kept: list[Sequence[SidePair]] = [*self.clearance_pairs, *([item.pair] for item in listed)]
        self.kept_pairs = [pair for own in self.pairs_of_kept for pair in own]
        self.places = [
            places * manager_packing.slot_count(item, pairs)
            for item, pairs in zip(self.kept, self.pairs_of_kept, strict=True)
        ]
        self.clearance_rows = sum(self.places)
        self.origin, self.crowding = object(), places
        self._write(bodies, constraints, objectives)
        self._take_addresses()
        # Where the parts of a state begin: tracked values (contacts, angles, sides), multipliers, residuals, results.
        self.contacts_at = 7 * self.count
        self.angles_at = self.contacts_at + TRACK * self.pair_rows
        self.angles = slice(self.angles_at, self.angles_at + TRACK * len(self._angles), TRACK)
        self._driven_angles = [(self.angles_at + TRACK * k, at) for k, at in self._turned.driven]
        self.multipliers_at = self.contacts_at + TRACK * self.tracked
        self.residuals_at = self.multipliers_at + self.rows
        self.results_at = self.residuals_at + self.rows
        self.memory_at = self.results_at + layout.RESULTS
        self._memory = np.empty(0)
        if self.clearance_rows:
            # The first update sees what crosses at the start as well, if it is no deeper than this.
            self._memory = fresh_memory(len(self.kept_pairs), self.clearance_rows, LARGEST_MARGIN)
        self.asked: Asked = []
        self.workspaces: list[tuple[Array, Array, Table]] = []
        self.proofs: list[ClearanceProof] = []
        self.stood: Stood | None = None
        self.number_places: NumberPlaces | None = None
        self.derivative_plans: dict[Any, Any] = {}
        self.kept_at = self.memory_at + self._memory.size
        self.rows_table[layout.KEPT] = self.kept_at
        self.kept_size = int(kept_size(self.rows_table))
        # Without a factor, to copy what a solution keeps takes longer than to evaluate it anew.
        self._state_size = self.kept_at + (self.kept_size if kept_unknowns(self.rows_table) > 0 else 0)

    def _measure_by(self, scale: float, bodies: Sequence[Body], goals: Sequence[tuple[float, Objective]]) -> None:
        """Keep what lengths, positions and the objective are counted in."""
        self.scale = scale
        self.reference = bodies[0].pose.position.copy()
        self._reference = self.reference.tolist()
        self.unit = max(term.weight * natural_unit(term, scale) for _, term in goals)
        if not LEAST_UNIT <= self.unit <= 1.0 / LEAST_UNIT:
            raise InputError(
                f"the objective counts in units of {self.unit:g}, by its weights and the scene's size {scale:g}; "
                f"expected from {LEAST_UNIT:g} to {1.0 / LEAST_UNIT:g}"
            )

    def _write(
        self, bodies: Sequence[Body], constraints: Sequence[Constraint], objectives: Sequence[tuple[float, Objective]]
    ) -> None:
        """Write table and pool, part by part, and keep what tells of them."""
        goals = objectives or [(1.0, Posture())]
        writer = SceneWriter(bodies, self.scale, self.pair_rows)
        header = writer.header
        writer.add(header, self._pool_header())
        groups = [writer.places_of(item.bodies) for item in constraints]
        unknown_blocks = number_bodies([body.fixed for body in bodies], groups)
        header[layout.UNKNOWN_BLOCKS], _ = writer.add(unknown_blocks)
        header[layout.BODIES], header[layout.MOVING] = self.count, unknown_blocks.max() + 1
        header[layout.CONTACTS] = self.pair_rows
        header[layout.IMPLICIT] = not objectives
        self._write_rows(writer, bodies, constraints, unknown_blocks)
        self.terms_at = writer.pool_at
        terms = TermPacking(writer, self.row_numbers, bodies, self.reference, self.unit)
        for sign, term in goals:
            terms.add(sign, term)
        terms.write()
        self.frames_at = writer.pool_at
        writer.add_shared()
        self.drawn = terms.drawn
        # Rows of clearances are of any bodies, those of trims, and dexterities and places, are not by blocks.
        others = self.clearance_rows or self.trims or header[layout.DEXTERITIES] or self.drawn
        if header[layout.MOVING] > FEW and not others:
            groups += [writer.places_of(term.bodies) for _, term in goals if isinstance(term, Expression)]
            record = block_record(int(header[layout.MOVING]), [unknown_blocks[group].tolist() for group in groups])
            header[layout.BLOCK_RECORD], header[layout.BLOCK_LENGTH] = writer.add(record)[0], record.size
        self.rows_table, self.rows_pool = writer.arrays()
        # What the loop is compiled for: None without a dexterity.
        self.end_effectors = 1 if header[layout.DEXTERITIES] else None
        self.tracked = int(header[layout.TRACKED])
        self.shells, self._angles = writer.shells, writer.angles
        self.body_places, self._frames = writer.places, writer.frames
        self._targets, self._turns = terms.targets, terms.turns
        self._turned = Turns(self._angles, [(equation, at) for equation, at, _ in self._values])
        self.chooses_turns = self._turned.chosen and not self.clearance_rows
        told = self._turned.told
        self._standing = np.array(
            [(self._frames[item.frames], item.kind, item.component) for item in told], dtype=np.int64
        ).reshape(-1, 3)
        self._standing_units = np.array([1.0 if item.is_angle else self.scale for item in told])
        if self.clearance_rows:
            given = list(zip(self.contacts, self.sides, self.whole, strict=True))
            watched = WatchedPairs(self.kept, self.pairs_of_kept, self.places, given)
            self._unwritten = writer, watched

    def _pool_header(self) -> Array:
        pool = np.zeros(layout.POOL_HEADER)
        pool[layout.SCALE] = self.scale
        pool[layout.REFERENCE : layout.REFERENCE + 3] = self.reference
        pool[layout.OBJECTIVE_UNIT] = self.unit
        return pool

    def _write_rows(
        self, writer: SceneWriter, bodies: Sequence[Body], constraints: Sequence[Constraint], unknown_blocks: Table
    ) -> None:
        """Write rows, and keep what tells of them."""
        rows = RowPacking(writer, constraints)
        rows.add_contacts(self.contacts, self.sides, self.whole)
        rows.add_clearance_rows([*self.clearances, *(item.contact for item in self.corners)], self.places)
        writer.header[layout.MANAGER_RECORD] = -1
        rows.add_trims(self.contacts)
        rows.add_joints(unknown_blocks)
        rows.add_expressions()
        table = rows.write(bodies)
        self._keep_values(rows.values)
        self.gaps = rows.gaps
        self.placed = rows.places
        self.rows = len(table)
        self.owners = np.array(rows.owners, dtype=np.int64)
        self.one_sided = table[:, layout.ONE_SIDED] == 1
        self.drives = table[:, layout.DRIVE] == 1
        self.lengths = table[:, layout.IS_LENGTH] == 1
        kinds = table[:, layout.KIND]
        self.pairs = np.where(kinds == layout.CONTACT_ROW, np.arange(len(table)), -1)
        trims = kinds == layout.TRIM_ROW
        self.pairs[trims] = table[trims, layout.TRIM_PAIR]
        self.trims = int(trims.sum())
        self.row_numbers = RowNumbers(
            {contact.name: k for k, contact in enumerate(self.contacts)},
            [constraints[k].name for k in rows.owners],
            self.one_sided,
            self.drives,
        )
        by_owner = np.argsort(self.owners, kind="stable")
        ends = np.searchsorted(self.owners[by_owner], np.arange(len(constraints) + 1))
        self.spans = [by_owner[first:last] for first, last in pairwise(ends)]

    def _keep_values(self, values: list[tuple[Equation, int, float]]) -> None:
        """Keep the equations of rows that have a value, where it is in the pool, and its unit."""
        self._values = values
        self._sources = [item for item in values if item[0].source is not None]
        # What every solve reads of them: where a value is kept, where it goes, its unit, whether it is a length.
        self._reads = [
            (*equation.place(), at, unit, not equation.terms[0][1].is_angle) for equation, at, unit in self._sources
        ]

    @property
    def is_loop_alone(self) -> bool:
        """Whether a solve that goes on from another one is a run of the loop and nothing else, if that arrives.

        What has no extent may have outgrown its size; corners are tried first; clearances are looked after.
        """
        return not (self._has_no_extent or self.keeps_apart or self.clearance_rows > 0 or bool(self.corners))

    @property
    def pair_rows(self) -> int:
        """Rows of contacts, given ones and those of clearances."""
        return len(self.contacts) + self.clearance_rows

    def is_crowded(self, state: Array) -> bool:
        """Whether contacts of clearances were near that found no place."""
        return self.clearance_rows > 0 and state[self.memory_at + manager_records.CROWDED] == 1.0

    def new_state(self) -> Array:
        """The state of a solve that knows nothing yet."""
        state = np.zeros(self._state_size)
        state[self.memory_at : self.kept_at] = self._memory
        return state

    def has_rows_of(self, other: Packed) -> bool:
        """Whether another scene has the same rows, but for those of clearances."""
        kinds = [
            np.column_stack([packed.owners, packed.one_sided, packed.lengths, packed.drives, packed.pairs >= 0])
            for packed in (self, other)
        ]
        one, two = (
            np.delete(kind, np.arange(packed.clearance_rows) + len(packed.contacts), axis=0)
            for kind, packed in zip(kinds, (self, other), strict=True)
        )
        return len(self.contacts) == len(other.contacts) and np.array_equal(one, two)

    def pair_name(self, k: int) -> str:
        """The name of the contact, or the clearance, that row k is of."""
        names = [contact.name for contact in self.contacts]
        for item, count in zip(self.kept, self.places, strict=True):
            names += [item.name] * count
        return names[k]

    def table_at(self, state: Array) -> Table:
        """The table with the rows of clearances as a state has them; in the packed one they have no contacts."""
        has_clearances = self.clearance_rows > 0 and state.size > self.memory_at
        return manager_packing.table_with_clearances(self.table, self._placed(state)) if has_clearances else self.table

    def may_have_outgrown(self) -> bool:
        """Whether the size rests on values and places alone and the values have become others by far."""
        if not self._has_no_extent or not self.has_size:
            return self._has_no_extent
        values = [abs(row.current()) for row, _, _ in self._sources if not row.terms[0][1].is_angle]
        return self.is_outgrown(max(values, default=0.0))

    def is_outgrown(self, length: float) -> bool:
        """Whether a length, not zero, is another one than the size by far, or there is none."""
        near = self.has_size and self.scale <= OUTGROWN * length <= OUTGROWN**2 * self.scale
        return length > 0.0 and not near

    def listed(self, state: Array) -> list[tuple[int, int]]:
        """Of every place of a contact manager in a state: its pair of bodies, or -1, and the number of its contact."""
        return [(pair, number) for pair, number, _given in self._placed(state)]

    def _placed(self, state: Array) -> list[list[int]]:
        """The same, and whether it is in the place of a given contact."""
        return listed_places(state[self.memory_at :], len(self.kept_pairs), self.clearance_rows)

    def _take_addresses(self) -> None:
        """Where the kernels are that only contacts, trims, clearances, expressions or many bodies ask for."""
        table = self.rows_table
        watched = table[layout.MANAGER_RECORD] >= 0
        table[layout.CLOCK_AT] = clock_address()
        if table[layout.BLOCK_RECORD]:
            record = table[table[layout.BLOCK_RECORD] :]
            record[[FACTORIZE_AT, SOLVE_AT]] = addresses.blocks()
        if self.pair_rows:
            table[layout.CONTACT_ROWS_AT] = addresses.contacts()
        if any(self.whole) or (watched and any(map(manager_packing.is_of_surfaces, self.kept_pairs))):
            table[layout.START_AT : layout.EXTREMAL_AT + 1] = addresses.surfaces()
        if self.shells:
            table[[layout.TRACK_AT, layout.SEARCH_AT, layout.NEAREST_AT]] = addresses.solids()
        if self.trims:
            table[[layout.TRIM_ROWS_AT, layout.TRIM_TERMS_AT]] = addresses.trims()
        if self.drawn:
            table[layout.PLACE_TERMS_AT] = addresses.place_objectives()
        if table[layout.FIRST_SIDE] < table[layout.TRACKED]:
            table[layout.TRIM_SIDES_AT] = addresses.sides()
        if watched:
            table[[layout.UPDATE_AT, layout.STAYED_AT, layout.PARTS_AT, layout.WENT_AT]] = addresses.manager()
            manager = manager_records.manager_at(table, table[layout.MANAGER_RECORD])
            manager.track_solids = table[layout.TRACK_AT]
            manager.mark_address = addresses.places() if manager.mark_address else 0
        if table[table[layout.TAPE_WORKSPACE]] > 0:
            table[layout.RUN_TAPE_AT] = addresses.tapes()

    def __getstate__(self) -> dict[str, Any]:
        # In copies it is in the same place.
        self._write_manager()
        return {
            **self.__dict__,
            "workspaces": [],
            "proofs": [],
            "stood": None,
            "number_places": None,
            "derivative_plans": {},
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Addresses are those of one process; a copy, or what another process wrote, takes its own.
        self.__dict__.update(state)
        # Counts of another process say nothing here.
        self.numbers = -1
        self.rows_table = self.rows_table.copy()
        self.rows_table[layout.DEEPEST_AT] = 0
        self._take_addresses()

    def seek_penetration(self) -> bool:
        """From now on contacts of solids that cross at the start are looked for; whether that is new.

        The kernel for it is large, and few scenes need it.
        """
        if not self.shells or self.rows_table[layout.DEEPEST_AT]:
            return False
        self.rows_table[layout.DEEPEST_AT] = addresses.deepest()
        return True

    @property
    def is_implicit(self) -> bool:
        """Whether nobody asked for the objective, which is the least move then."""
        return bool(self.rows_table[layout.IMPLICIT] == 1)

    def start_angles(self, state: Array, warm: bool) -> None:
        """Write the turns that angles start on at the poses of a state into it."""
        if not self._angles:
            return
        pool = self.rows_pool
        if warm and not self._turned.coupled:
            for place, at in self._driven_angles:
                state[place] = pool[at]
            return

        def measure() -> Array:
            values = np.empty(len(self._standing))
            if values.size:
                q = state[: self.contacts_at].reshape(-1, 7)
                scaled = q.copy()
                scaled[:, :3] = (q[:, :3] - self.reference) / self.scale
                coordinates_at(
                    self.rows_table, self.rows_pool, scaled, self._standing, np.empty((1, JOINT_FRAMES)), values
                )
            values *= self._standing_units
            return values

        self._turned.start(pool, state[self.angles], warm, measure)

    def twin(self) -> Packed:
        """The same with a pool of its own, of which anything may be changed."""
        self._write_manager()
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.rows_table, other.rows_pool = self.rows_table.copy(), self.rows_pool.copy()
        other.rows_table[layout.DEEPEST_AT] = 0
        other.rows_pool[layout.VERSION] = float(next(_versions))
        # Solves of the one and of the other work in the same memory, one after another.
        other.stood = None
        return other

    def as_asked(self, asked: Asked) -> Packed:
        """The same with a pool of its own, in which rows have the values that a solve was asked for."""
        other = self.twin()
        # Versions differ in more than values.
        other.pool[layout.VERSION] = self.pool[layout.VERSION]
        for (_, at, unit), value in zip(self._sources, asked, strict=False):
            other.pool[at] = value / unit
        return other

    @property
    def asked_units(self) -> list[float]:
        """What every number that may change between solves is measured in: the scene's size, or radians."""
        values = [1.0 if equation.terms[0][1].is_angle else self.scale for equation, _, _ in self._sources]
        return [*values, *(self.scale for _ in self._targets), *(1.0 for _ in self._turns)]

    @property
    def value_rows(self) -> NDArray[np.int64]:
        """The rows of joints and couplings, which have a value each."""
        first = int((self.pairs >= 0).sum())
        return np.arange(first, first + len(self._values))

    def move_values(self, change: Array) -> None:
        """Add a change (m,) to the values of joints' and couplings' rows, until the next `refresh`."""
        self.pool[[at for _, at, _ in self._values]] += change[self.value_rows]

    def refresh(self) -> None:
        """Write what may have changed since the last solve: values and targets."""
        pool, scale, far = self.rows_pool, self.scale, FARTHEST * self.scale
        x, y, z = self._reference
        asked: Asked = []
        self.asked = asked
        for owner, name, sign, at, unit, is_length in self._reads:
            current = sign * float(getattr(owner, name))
            value = current / unit
            if is_length and not -FARTHEST <= value <= FARTHEST:
                check_reach(f"a value of {owner!r}", abs(current), scale)
            asked.append(current)
            pool[at] = value
        for distance, at in self._targets:
            target = distance._target
            asked.append(target)
            a, b, c = target.tolist()
            if not (-far <= a <= far and -far <= b <= far and -far <= c <= far):
                check_reach(f"a target of body {distance.bodies[0].name!r}", max(abs(a), abs(b), abs(c)), scale)
            pool[at] = (a - x) / scale
            pool[at + 1] = (b - y) / scale
            pool[at + 2] = (c - z) / scale
        for frame_distance, at in self._turns:
            asked.append(frame_distance.target)
            pool[at : at + 4] = frame_distance.body_quaternion

    def ask_for(self, asked: Asked) -> None:
        """Set values and targets of the scene's constraints and objectives, and write them."""
        remaining = iter(asked)
        for equation, _, _ in self._sources:
            equation.ask_for(next(remaining))
        for distance, _ in self._targets:
            distance._target = next(remaining)
        for frame_distance, _ in self._turns:
            frame_distance.target = next(remaining)
        self.refresh()


def structure_of(constraints: Sequence[Constraint]) -> tuple[tuple[object, ...], ...]:
    """Which rows constraints have, whatever their values."""
    return tuple(
        (id(item), id(equation.terms[0][1]), equation.terms[0][0], equation.source and equation.source[1])
        for item in constraints
        if isinstance(item, RowConstraint)
        for equation in item.equations
    )
