"""A scene turned into the table and the pool that the compiled loop works on (`constraints/program.py`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.constraints import program
from assembly.constraints.contact import Contact
from assembly.constraints.objectives import Objective, PointDistance, Posture
from assembly.errors import InputError
from assembly.geometry.face import Face
from assembly.geometry.spline import SURFACE_RECORD
from assembly.kinematics.body import Body, BodyFace
from assembly.proximity.pairs import OFFSETS, PairStatus, extremal_pair

__all__ = ["Packed", "pack"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]


class Packed:
    """A packed scene: arrays for the loop, and what is needed to refresh them between solves.

    Attributes
    ----------
    table, pool : arrays
        See `constraints/program.py`. Lengths in the pool are divided by `scale`.
    scale : float
        The scene's size: the largest diagonal of a body's box.
    faces : list of (BodyFace, BodyFace)
        The faces of every contact.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        contacts: Sequence[Contact],
        objectives: Sequence[tuple[float, Objective]],
    ) -> None:
        self.count = len(bodies)
        self.rows = len(contacts)
        self._places = {id(body): k for k, body in enumerate(bodies)}
        self.scale = _scene_size(bodies, objectives)
        self.reference = bodies[0].pose.position.copy()
        self.faces = [_choose_faces(contact) for contact in contacts]
        self._targets: list[tuple[PointDistance, int]] = []
        self._postures: list[tuple[Posture, int, int]] = []
        self._table: list[Table] = []
        self._pool: list[Array] = []
        self._table_size = self._pool_size = 0
        self._build(bodies, contacts, objectives)
        self.table = np.concatenate(self._table)
        self.pool = np.concatenate(self._pool)
        # Where the parts of a state begin: contacts, multipliers, residuals, results.
        self.contacts_at = 7 * self.count
        self.multipliers_at = self.contacts_at + 4 * self.rows
        self.residuals_at = self.multipliers_at + self.rows
        self.results_at = self.residuals_at + self.rows

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
        contacts: Sequence[Contact],
        objectives: Sequence[tuple[float, Objective]],
    ) -> None:
        header = np.zeros(program.HEADER, dtype=np.int64)
        weight = max((term.weight for _, term in objectives), default=1.0)
        self.weight = weight
        pool = np.zeros(program.POOL_HEADER)
        pool[program.SCALE] = self.scale
        pool[program.REFERENCE : program.REFERENCE + 3] = self.reference
        pool[program.WEIGHT] = weight
        self._add(header, pool)
        moving = np.cumsum([not body.fixed for body in bodies]) - 1
        slots = np.where([body.fixed for body in bodies], -1, moving)
        header[program.SLOTS], _ = self._add(slots)
        records: dict[tuple[int, bool], int] = {}
        rows: list[list[int]] = []
        for k, (contact, (face_f, face_g)) in enumerate(zip(contacts, self.faces, strict=True)):
            surfaces = [self._surface(records, side.face) for side in (face_f, face_g)]
            places = [self._places[id(body)] for body in contact.bodies]
            rows.append([program.CONTACT_ROW, *places, *surfaces, k, int(contact.unilateral), 0])
        header[program.ROW_TABLE], _ = self._add([field for row in rows for field in row])
        terms: list[list[int]] = []
        for sign, objective in objectives:
            terms.extend(self._terms(sign * objective.weight / weight, objective, bodies))
        header[program.TERM_TABLE], _ = self._add([field for term in terms for field in term])
        header[program.BODIES] = len(bodies)
        header[program.MOVING] = int(moving[-1]) + 1
        header[program.CONTACTS] = header[program.ROWS] = len(rows)
        header[program.TERMS] = len(terms)
        self._table[0] = header

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

    def _terms(self, weight: float, objective: Objective, bodies: Sequence[Body]) -> list[list[int]]:
        if isinstance(objective, PointDistance):
            point = objective.point.coordinates / self.scale
            _, at = self._add(pool=[weight, *point, 0.0, 0.0, 0.0])
            self._targets.append((objective, at + 4))
            return [[program.POINT_DISTANCE, self._places[id(objective.point.body)], at, 0]]
        assert isinstance(objective, Posture)
        if objective.reference is not None and len(objective.reference) != len(bodies):
            raise InputError(f"reference has {len(objective.reference)} rows; expected one per body, {len(bodies)}")
        terms = []
        for k, body in enumerate(bodies):
            if not body.fixed:
                lever = 0.5 * (body.size or self.scale) / self.scale
                _, at = self._add(pool=[weight, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, lever])
                self._postures.append((objective, k, at + 1))
                terms.append([program.POSTURE, k, at, 0])
        return terms

    def refresh(self, q: Array) -> None:
        """Write what may have changed since the last solve: targets, and postures that follow the start q."""
        pool, scale = self.pool, self.scale
        x, y, z = self.reference.tolist()
        for distance, at in self._targets:
            target = distance._target
            pool[at] = (target[0] - x) / scale
            pool[at + 1] = (target[1] - y) / scale
            pool[at + 2] = (target[2] - z) / scale
        for posture, body, at in self._postures:
            row = q[body] if posture.reference is None else posture.reference[body]
            pool[at : at + 3] = (row[:3] - self.reference) / scale
            pool[at + 3 : at + 7] = row[3:]


def _scene_size(bodies: Sequence[Body], objectives: Sequence[tuple[float, Objective]]) -> float:
    """The largest body; without shapes, the spread of positions and of points on bodies."""
    size = max(body.size for body in bodies)
    if size > 0.0:
        return size
    points = [body.pose.position for body in bodies]
    points += [
        term.point.body.pose.apply(term.point.coordinates) for _, term in objectives if isinstance(term, PointDistance)
    ]
    spread = float(np.linalg.norm(np.ptp(points, axis=0)))
    return spread if spread > 0.0 else 1.0


def _choose_faces(contact: Contact) -> tuple[BodyFace, BodyFace]:
    """The faces of a contact: as said, else the nearest extremal pair of faces at the bodies' poses."""
    sides = [[side] if isinstance(side, BodyFace) else list(side.faces) for side in (contact.a, contact.b)]
    if len(sides[0]) == len(sides[1]) == 1:
        return sides[0][0], sides[1][0]
    best: tuple[float, float, BodyFace, BodyFace] | None = None
    for f in sides[0]:
        for g in sides[1]:
            pair = extremal_pair(f, contact.body_a.q, g, contact.body_b.q)
            # An extremum inside both faces comes before one held at an edge.
            inside = 0.0 if pair.status in (PairStatus.CONVERGED, PairStatus.SINGULAR) else 1.0
            rank = (inside, abs(pair.gap))
            if best is None or rank < best[:2]:
                best = (*rank, f, g)
    assert best is not None
    return best[2], best[3]


def pack(bodies: Sequence[Body], contacts: Sequence[Contact], objectives: Sequence[tuple[float, Objective]]) -> Packed:
    """Pack a scene. `objectives` are (sign, term): 1 to minimize, -1 to maximize."""
    return Packed(bodies, contacts, objectives)
