"""The terms of a scene's objective as they are packed (`constraints/program/objective_terms.py`)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import inf, prod, sqrt

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.coordinate_distance import CoordinateDistance
from assembly.constraints.model.dexterity import MEASURES, Dexterity, TipTask
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.objectives import FrameDistance, Objective, PointDistance, Posture, Weight
from assembly.constraints.packing.places import place_numbers
from assembly.constraints.packing.scene_size import check_reach
from assembly.constraints.packing.scene_writer import SceneWriter
from assembly.constraints.program import objective_terms as terms
from assembly.constraints.program import records as layout
from assembly.errors import InputError
from assembly.kinematics.body import Body

__all__ = ["RowNumbers", "TermPacking", "dexterity_numbers", "natural_unit"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RowNumbers:
    """The rows of a scene, by whose they are: what terms of the objective refer to.

    Attributes
    ----------
    contacts : mapping of str to int
        The row of every contact, by its name.
    owners : sequence of str
        The constraint of every row, by its name.
    one_sided, drives : (m,) bool
    """

    contacts: Mapping[str, int]
    owners: Sequence[str]
    one_sided: NDArray[np.bool_]
    drives: NDArray[np.bool_]

    def that_hold(self, task: TipTask, active: Collection[int] = ()) -> list[int]:
        """The rows that hold a mechanism while an end effector moves: see `TipTask`; and those that are `active`."""
        ignored, held = ({item.name for item in items} for items in (task.ignoring, task.holding))
        kept = []
        for r, owner in enumerate(self.owners):
            if self.one_sided[r]:
                holds = owner in held or (r in active and owner not in ignored)
            else:
                holds = not self.drives[r] and owner not in ignored
            if holds:
                kept.append(r)
        return kept


class TermPacking:
    """The terms of an objective while they are packed.

    Parameters
    ----------
    writer : SceneWriter
    rows : RowNumbers
    bodies : sequence of Body
    reference : (3,) array
        What positions in the world are relative to.
    unit : float
        What one of the loop's objective counts in the user's units.

    Attributes
    ----------
    targets : list of (PointDistance or FrameDistance, int)
        Terms with a target, and where its position is in the pool.
    turns : list of (FrameDistance, int)
        Terms with a pose as target, and where its quaternion is in the pool.
    drawn : list of ContactPlace
        Terms that are places of contacts.
    coordinates : list of (CoordinateDistance, list of int)
        Terms with a value as target; where the weight of each is in the pool, and its target, of values and Hessians.
    """

    def __init__(
        self, writer: SceneWriter, rows: RowNumbers, bodies: Sequence[Body], reference: Array, unit: float
    ) -> None:
        self.targets: list[tuple[PointDistance | FrameDistance, int]] = []
        self.turns: list[tuple[FrameDistance, int]] = []
        self.coordinates: list[tuple[CoordinateDistance, list[int]]] = []
        self._writer = writer
        self._rows = rows
        self._bodies = bodies
        self._reference = reference
        self._unit = unit
        self._records: list[list[int]] = []
        self.drawn: list[ContactPlace] = []

    def add(self, sign: float, term: Objective) -> None:
        """Pack a term: 1 to minimize it, -1 to maximize it."""
        weight = sign * term.weight
        if isinstance(term, (Dexterity, Expression)):
            weight /= self._unit  # their values are in the user's units
        else:
            weight *= natural_unit(term, self._writer.scale) / self._unit
        if isinstance(term, PointDistance):
            self._add_target(weight, term, term.point.body, term.point.coordinates)
        elif isinstance(term, FrameDistance):
            self._add_target(weight, term, term.frame.body, term.frame.origin)
            self._add_turn(weight, term)
        elif isinstance(term, Weight):
            self._add_weight(weight, term)
        elif isinstance(term, Dexterity):
            self._add_dexterity(weight, term)
        elif isinstance(term, ContactPlace):
            self._add_place(weight, term)
        elif isinstance(term, Expression):
            self._add_expression(weight, term)
        else:
            assert isinstance(term, Posture)
            self._add_posture(weight, term)

    def _add_target(self, weight: float, term: PointDistance | FrameDistance, body: Body, mark: Array) -> None:
        """A point of a body drawn to a place."""
        _, at = self._writer.add(pool=[weight, *(mark / self._writer.scale), 0.0, 0.0, 0.0])
        self.targets.append((term, at + 4))
        self._records.append([terms.POINT_DISTANCE, self._writer.places[body], at])

    def _add_turn(self, weight: float, term: FrameDistance) -> None:
        """A body turned to a quaternion: a posture whose place has no weight."""
        check_reach("length", term.length, self._writer.scale)
        lever = term.length / self._writer.scale
        _, at = self._writer.add(pool=[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, weight * lever**2])
        self.turns.append((term, at + terms.POSTURE_QUATERNION))
        self._records.append([terms.POSTURE, self._writer.places[term.frame.body], at])

    def _add_posture(self, weight: float, term: Posture) -> None:
        bodies, scale = self._bodies, self._writer.scale
        if term.reference is not None and len(term.reference) != len(bodies):
            raise InputError(f"reference has {len(term.reference)} rows; expected one per body, {len(bodies)}")
        for k, body in enumerate(bodies):
            if not body.fixed:
                lever = 0.5 * (body.size or scale) / scale
                row = body.q if term.reference is None else term.reference[k]
                check_reach("a coordinate of a reference", float(np.abs(row[:3]).max()), scale)
                place = (row[:3] - self._reference) / scale
                _, at = self._writer.add(pool=[weight, *place, *row[3:], weight * lever**2])
                self._records.append([terms.POSTURE, k, at, 0, int(term.reference is None)])

    def _add_weight(self, weight: float, term: Weight) -> None:
        """A force on every body; `weight` is that of all bodies together."""
        scale = self._writer.scale
        for body, (mass, center) in zip(term.bodies, term.points, strict=True):
            force = weight * (mass / term.mass) * term.direction
            offset = -float(force @ self._reference) / scale
            _, at = self._writer.add(pool=[*force, *(center / scale), offset])
            self._records.append([terms.POTENTIAL, self._writer.places[body], at])

    def _add_place(self, weight: float, term: ContactPlace) -> None:
        """Nothing where its contact is disabled."""
        contact = self._rows.contacts.get(term.contact.name)
        if contact is not None:
            _, at = self._writer.add(pool=place_numbers(term, weight, self._writer.scale))
            self._records.append([terms.PLACE, -1, at, 0, 0, contact, term.side, term.rows])
            self.drawn.append(term)

    def _add_expression(self, weight: float, term: Expression) -> None:
        writer = self._writer
        _, at = writer.add(pool=[weight])
        record = writer.tape(term, -1)
        if isinstance(term, CoordinateDistance):
            self.coordinates.append((term, [at, *(writer.constants_at(place) for place in record[:2])]))
        self._records.append([terms.TAPE_TERM, -1, at, writer.add(record)[0]])

    def _add_dexterity(self, weight: float, term: Dexterity) -> None:
        """The record is that of `solve/loop/dexterity.py`."""
        writer, task = self._writer, term.tip_task
        held = self._rows.that_hold(task)
        fields = [MEASURES.index(term.measure), task.bits, len(task.inputs), writer.add(held)[0], len(held)]
        factors = []
        for freedom in task.inputs:
            coordinate, bodies = writer.coordinate(freedom.coordinate)
            fields += [*coordinate, *bodies]
            factors.append(1.0 if freedom.coordinate.is_angle else 1.0 / writer.scale)
        _, at = writer.add(pool=dexterity_numbers(term, weight, writer.scale, factors))
        self._records.append([terms.DEXTERITY, writer.places[task.tip.body], at, writer.add(fields)[0]])
        writer.header[layout.DEXTERITIES] += 1

    def write(self) -> None:
        """Write the records of all terms."""
        header = self._writer.header
        fields = [field for record in self._records for field in record + [0] * (terms.TERM - len(record))]
        header[layout.TERM_TABLE], _ = self._writer.add(fields)
        header[layout.TERMS] = len(self._records)


def dexterity_numbers(term: Dexterity, weight: float, scale: float, factors: Sequence[float]) -> list[float]:
    """A `DEXTERITY_WEIGHTS` of `solve/loop/dexterity.py`, and the factor of every input's unit."""
    task = term.tip_task
    direction = np.zeros(6)
    if term.direction is not None:
        direction[: task.rows] = term.direction
    turn = task.length if task.task == "pose" else 1.0
    return [weight, *(task.origin / scale), scale, turn, *direction, *factors]


def natural_unit(term: Objective, scale: float) -> float:
    """What a term of order one in scaled lengths counts in the user's units."""
    if isinstance(term, Expression) and not isinstance(term, CoordinateDistance):
        return 1.0
    if isinstance(term, Weight):
        return scale * term.mass
    if not isinstance(term, Dexterity):
        return scale**2
    task = term.tip_task
    linear, angular = scale, task.length if task.task == "pose" else 1.0
    columns = [1.0 if freedom.coordinate.is_angle else 1.0 / scale for freedom in task.inputs]
    entry = {"position": linear, "rotation": angular, "pose": sqrt(linear * angular)}[task.task]
    entry *= prod(columns) ** (1.0 / len(columns))
    powers = {"manipulability": min(task.rows, len(columns)), "smallest_singular_value": 1, "force_transmission": -1}
    try:
        return float(entry ** powers.get(term.measure, 0))
    except OverflowError:
        return inf
