"""The rows of a scene (`constraints/program/records.py`): of contacts, of clearances, of trims, of joints, of
expressions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint, Equation, RowConstraint
from assembly.constraints.model.contact import Contact, side_faces
from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.trim_contact import FORMS, TrimContact
from assembly.constraints.packing.numbering import gathering_order
from assembly.constraints.packing.places import place_numbers
from assembly.constraints.packing.scene_writer import SceneWriter
from assembly.constraints.program import records as layout
from assembly.geometry.faces.loop_sides import loop_sides
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.faces.trim_table import build
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.evaluate import CURVE_RECORD
from assembly.kinematics.body import Body, BodyFace
from assembly.proximity.brep.writer import edge_over

__all__ = ["RowPacking"]

Table = NDArray[np.int64]


class RowPacking:
    """The rows of a scene while they are packed, in this order: contacts, clearances, trims, joints, expressions.

    Parameters
    ----------
    writer : SceneWriter
    constraints : sequence of Constraint
        All of the scene.

    Attributes
    ----------
    owners : list of int
        The constraint of every row.
    gaps : list of int
        Where the pool has the least gap of every contact.
    values : list of (Equation, int, float)
        Equations of joints, where the value of each is in the pool, and what one of it counts in the user's units.
    places : list of (ContactPlace, int)
        Constraints that are places of contacts, and where the numbers of each are in the pool.
    """

    def __init__(self, writer: SceneWriter, constraints: Sequence[Constraint]) -> None:
        self.owners: list[int] = []
        self.values: list[tuple[Equation, int, float]] = []
        self.gaps: list[int] = []
        self.places: list[tuple[ContactPlace, int]] = []
        self._writer = writer
        self._constraints = constraints
        self._numbers = {id(constraint): k for k, constraint in enumerate(constraints)}
        self._rows: list[list[int]] = []
        # The bodies of every row that scattered bodies can be put together by.
        self._joined: list[list[int]] = []
        self._extra = 0

    def _add(self, owner: Constraint, row: list[int], joined: Sequence[int] = ()) -> None:
        self._rows.append(row)
        self.owners.append(self._numbers[id(owner)])
        self._joined.append(list(dict.fromkeys(joined)))

    def add_contacts(
        self,
        contacts: Sequence[Contact],
        sides: Sequence[tuple[Body | BodyFace, Body | BodyFace]],
        whole: Sequence[bool],
    ) -> None:
        """Rows of contacts of two surfaces, where they are whole, or of two shells."""
        writer = self._writer
        known: dict[tuple[int, bool], int] = {}
        for contact, pair, is_whole in zip(contacts, sides, whole, strict=True):
            row = [layout.CONTACT_ROW, *writer.places_of(contact.bodies), int(contact.unilateral), 0, 1]
            _, gap = writer.add(pool=[contact.minimum / writer.scale, 0.0])
            self.gaps.append(gap)
            if is_whole:
                row += [*(writer.surface(known, side_faces(side)[0]) for side in pair), -1, -1, gap]
            else:
                row += [-1, -1, *(writer.shell(side_faces(side)) for side in pair), gap]
            self._add(contact, row)

    def add_clearance_rows(self, owners: Sequence[Constraint], places: Sequence[int]) -> None:
        """Idle rows, as many of each clearance, or contact with corners, as it has places."""
        header = self._writer.header
        header[layout.FIRST_CLEARANCE_ROW], header[layout.CLEARANCE_ROWS] = len(self._rows), sum(places)
        for owner, count in zip(owners, places, strict=True):
            for _ in range(count):
                self._add(owner, [layout.CONTACT_ROW, -1, -1, 1, 0, 1, -1, -1, -1, -1, layout.ZERO, 0])

    def add_trims(self, contacts: Sequence[Contact]) -> None:
        """Rows of trims and places, of contacts in the order of their rows."""
        pairs = {contact.name: k for k, contact in enumerate(contacts)}
        before = len(self._rows)
        for item in self._constraints:
            if isinstance(item, TrimContact):
                self._add_trim(item, pairs[item.contact.name])
            elif isinstance(item, ContactPlace):
                self._add_place(item, pairs[item.contact.name])
        self._writer.header[layout.TRIMS] = len(self._rows) - before

    def _add_place(self, place: ContactPlace, pair: int) -> None:
        _, at = self._writer.add(pool=place_numbers(place, 0.0, self._writer.scale))
        self.places.append((place, at))
        row = [layout.TRIM_ROW, *self._writer.places_of(place.bodies), 0, 0, 1, pair, place.side, -1, at]
        for k in range(place.rows):
            self._add(place, [*row, layout.AT_PLACE, 1, -1, 0, -1, k])

    def _add_trim(self, trim: TrimContact, pair: int) -> None:
        writer = self._writer
        table, pool = trim.region.packed_trim(writer.table_at, writer.pool_at)
        loop, _ = writer.add(table, pool)
        factor = trim.stretch / writer.scale
        _, at = writer.add(pool=[-factor if trim.keep == "outside" else factor])
        form = FORMS.index(trim.form)
        count = (1, 2, 3, 3)[form]
        surface, edges = -1, -1
        if form > 0:
            writer.header[layout.VECTOR_TRIMS] = 1
            surface = self._rows[pair][layout.SURFACE_F + trim.side]
            edges = self._edges(table, trim.region.boundary, surface)
        sides = self._sides(trim, count, surface)
        row = [layout.TRIM_ROW, *writer.places_of(trim.bodies), int(trim.unilateral), 0, 1, pair, trim.side, loop, at]
        for _ in range(count):
            self._add(trim, [*row, form, count, edges, int(trim.form in ("parametric", "cartesian")), sides, 0])
        if sides >= 0:
            row[layout.ONE_SIDED] = 1
            self._add(trim, [*row, FORMS.index("signed"), 1, -1, 0, sides, 1])

    def _edges(self, loop: Table, curves: Sequence[NurbsCurve], surface: int) -> int:
        """Records of the curves of a packed loop as edges on a surface; where they begin."""
        first = int(trim_at(loop, 0).first)
        edges = [edge_over(surface, first + CURVE_RECORD * k, curve.closed) for k, curve in enumerate(curves)]
        return self._writer.add(np.concatenate(edges))[0]

    def _sides(self, trim: TrimContact, neighbor: int, surface: int) -> int:
        """The sides of a trim's loop, whose second slot is `neighbor` rows behind the first; -1 if it has no corners.

        `surface` is where the surface's record is, for forms that need edges, or -1.
        """
        writer, region = self._writer, trim.region
        periods = region.surface._periods
        sides, stretches = loop_sides(region.boundary, region.chains, periods)
        if not sides:
            return -1
        fields: list[int] = []
        for side in sides:
            made = build((side.curve,), (range(1),), (False,), (), region.surface.domain, periods)
            table, pool = made.at(writer.table_at, writer.pool_at)
            loop, _ = writer.add(table, pool)
            edges = self._edges(table, (side.curve,), surface) if surface >= 0 else -1
            _, at = writer.add(pool=[side.start, side.end])
            fields += [loop, edges, side.before, side.after, side.turn_before, side.turn_after, at]
        first, _ = writer.add(fields)
        ranges = [writer.add(pool=[stretch.start, stretch.end])[1] for stretch in stretches]
        parts = [(stretch.curve, stretch.side, at) for stretch, at in zip(stretches, ranges, strict=True)]
        stretch_table, _ = writer.add(np.array(parts, dtype=np.int64))
        writer.sides += 2
        return writer.add([len(sides), first, len(parts), stretch_table, writer.sides - 2, neighbor])[0]

    def add_joints(self, unknown_blocks: Table) -> None:
        """Rows of joints and couplings, whose bodies have these blocks of unknowns."""
        # In the order of their bodies: then the envelope of J J^T is narrow, too.
        joints = [item for item in self._constraints if isinstance(item, RowConstraint)]
        joints.sort(key=lambda item: max(unknown_blocks[self._writer.places_of(item.bodies)]))
        for joint in joints:
            for equation in joint.equations:
                self._add_equation(joint, equation)
                self._extra = max(self._extra, 2 * (len(equation.terms) - 1))

    def _add_equation(self, joint: Constraint, equation: Equation) -> None:
        """Factors are such that the row has the unit of its first term, lengths scaled."""
        writer = self._writer
        (factor, first), *others = equation.terms
        unit = 1.0 if first.is_angle else writer.scale
        pool = [factor, 0.0, 0.0]
        fields, bodies = writer.coordinate(first)
        joined = bodies
        second = -1
        for other_factor, other in others:
            other_fields, other_bodies = writer.coordinate(other)
            pool[1] = other_factor * (1.0 if other.is_angle else writer.scale) / unit
            second, _ = writer.add([*other_fields, *other_bodies])
            joined = [*joined, *other_bodies]
        _, at = writer.add(pool=pool)
        self.values.append((equation, at + 2, unit))
        flags = [int(equation.one_sided), int(equation.is_drive), int(not first.is_angle)]
        self._add(joint, [layout.JOINT_ROW, *bodies, *flags, *fields, at, second], joined)

    def add_expressions(self) -> None:
        """Rows of expressions, and the table of their tapes."""
        writer = self._writer
        tapes: list[list[int]] = []
        for item in self._constraints:
            if isinstance(item, Expression):
                bodies = writer.places_of(item.bodies)
                flags = [int(item.unilateral), 0, 0]
                tapes.append(writer.tape(item, len(self._rows)))
                for _ in range(item.count):
                    self._add(item, [layout.TAPE_ROW, *[*bodies, -1][:2], *flags])
                self._extra = max(self._extra, len(bodies) - 2)
        writer.header[layout.TAPE_TABLE], _ = writer.add([field for record in tapes for field in record])
        writer.header[layout.TAPES] = len(tapes)

    def write(self, bodies: Sequence[Body]) -> Table:
        """Write the records of all rows (m, ROW), which are returned, and how scattered bodies are put together."""
        header = self._writer.header
        rows = [[*row, *[0] * (layout.ROW - len(row))] for row in self._rows]
        table = np.array(rows, dtype=np.int64).reshape(-1, layout.ROW)
        header[layout.ROW_TABLE], _ = self._writer.add(table)
        order = gathering_order([body.fixed for body in bodies], self._joined)
        fields = [field for body, held in order for field in (body, len(held), *held)]
        header[layout.GATHER_TABLE], _ = self._writer.add([len(order), *fields])
        header[layout.ROWS], header[layout.EXTRA] = len(table), self._extra
        return table
