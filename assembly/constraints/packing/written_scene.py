"""The table and the pool of a scene as they are written: rows, terms, blocks, and where kernels are.

The layout is that of `constraints/program/records.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from assembly._address import clock_address
from assembly.constraints.model.constraint import Constraint, Equation
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.objectives import Objective, Posture
from assembly.constraints.packing import addresses
from assembly.constraints.packing import manager as manager_packing
from assembly.constraints.packing.elimination_order import FEW, block_record
from assembly.constraints.packing.manager import WatchedPairs
from assembly.constraints.packing.manager_last import ManagerLast
from assembly.constraints.packing.numbering import number_bodies
from assembly.constraints.packing.revolutions import Turns
from assembly.constraints.packing.rows import RowPacking
from assembly.constraints.packing.scene_contents import SceneContents
from assembly.constraints.packing.scene_writer import SceneWriter
from assembly.constraints.packing.terms import RowNumbers, TermPacking, natural_unit
from assembly.constraints.program import records as layout
from assembly.constraints.program.hessian_blocks import FACTORIZE_AT, SOLVE_AT
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.proximity.manager import records as manager_records

__all__ = ["WrittenScene"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Smaller numbers have fewer digits; those whose reciprocals are, too, may overflow.
LEAST_UNIT = 1e-305


class WrittenScene(ManagerLast, SceneContents):
    """A table and a pool with all rows and terms of a scene, and what tells of them.

    Attributes
    ----------
    scale : float
        The scene's size (`scene_size`), 1 where it has none.
    terms_at, frames_at : int
        Where the pool has the numbers of terms, and of frames.
    body_places : dict
        The number of a body.
    unit : float
        What one of the loop's objective counts in the user's units.
    gaps : list of int
        Where the pool has the least gap of every contact.
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

    count: int

    def _measure_by(self, scale: float, bodies: Sequence[Body], goals: Sequence[tuple[float, Objective]]) -> None:
        """Keep what lengths, positions and the objective are counted in."""
        self.scale = scale
        self.reference = bodies[0].pose.position.copy()
        self._reference = self.reference.tolist()
        self.unit = max(term.weight * natural_unit(term, scale) for _, term in goals)
        if not self.is_unit(self.unit):
            raise InputError(
                f"the objective counts in units of {self.unit:g}, by its weights and the scene's size {scale:g}; "
                f"expected from {LEAST_UNIT:g} to {1.0 / LEAST_UNIT:g}"
            )

    @staticmethod
    def is_unit(unit: float) -> bool:
        """Whether an objective may count in this unit."""
        return LEAST_UNIT <= unit <= 1.0 / LEAST_UNIT

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
        self._targets, self._turns, self._coordinates = terms.targets, terms.turns, terms.coordinates
        self._turned = Turns(self._angles, [(equation, at) for equation, at, _ in self._values])
        self.chooses_turns = self._turned.chosen and not self.clearance_rows
        told = self._turned.told
        self._standing = np.array(
            [(self._frames[item.frames], item.kind, item.component) for item in told], dtype=np.int64
        ).reshape(-1, 3)
        self._standing_lengths = np.array([not item.is_angle for item in told], dtype=bool)
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
        """Keep the equations of rows that have a value, and where it is in the pool."""
        self._valued = [(equation, at) for equation, at, _ in values]
        sourced = [(equation, at) for equation, at in self._valued if equation.source is not None]
        # What every solve reads of them: where a value is kept, where it goes, whether it is a length.
        self._reads = [(*equation.place(), at, not equation.terms[0][1].is_angle) for equation, at in sourced]

    @property
    def _values(self) -> list[tuple[Equation, int, float]]:
        """The equations of rows that have a value, where it is in the pool, and its unit: of a length the scene's size.

        Made where it is asked for: a study solves scenes of many sizes, and looks at few of their values.
        """
        scale = self.scale
        return [(equation, at, 1.0 if equation.terms[0][1].is_angle else scale) for equation, at in self._valued]

    @property
    def _sources(self) -> list[tuple[Equation, int, float]]:
        """Those of them that may be set between solves."""
        return [value for value in self._values if value[0].source is not None]

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
