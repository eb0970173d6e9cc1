"""The table and the pool of a scene (`constraints/program/records.py`) while they are written, and what several parts
of it share.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Coordinate, FramePair
from assembly.constraints.model.expression import Expression
from assembly.constraints.program import records as layout
from assembly.constraints.program.primitives import AZIMUTH, TURN
from assembly.geometry.expression import tape
from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.evaluate import OFFSETS, SURFACE_RECORD
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.proximity.brep.packing import pack_shell
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.brep.writer import Writer

__all__ = ["SceneWriter", "frame_numbers"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]


def frame_numbers(frame_a: Frame, frame_b: Frame, scale: float) -> Array:
    """Two frames as the pool has them, (24,)."""
    numbers = np.empty((2, 4, 3))
    for part, frame in zip(numbers, (frame_a, frame_b), strict=True):
        part[0] = frame.origin / scale
        part[1:] = frame.axes.T
    return numbers.ravel()


class SceneWriter(Writer):
    """Parts of a scene, one behind the other; shells, frames and angles are there once, whoever asks for them.

    Parameters
    ----------
    bodies : sequence of Body
    scale : float
        Lengths are divided by it.
    pair_rows : int
        Rows of contacts, behind whose tracked values those of angles are.

    Attributes
    ----------
    header : array
        Of the table; filled until the end.
    places : dict
        The number of a body.
    shells : dict
        Where the shell of a solid is, by its faces.
    frames : dict
        The number of a pair of frames.
    angles : list of Coordinate
        In the order of their tracked values.
    """

    def __init__(self, bodies: Sequence[Body], scale: float, pair_rows: int) -> None:
        super().__init__()
        self.scale = scale
        self.header = np.zeros(layout.HEADER, dtype=np.int64)
        self.places = {body: k for k, body in enumerate(bodies)}
        self.shells: dict[tuple[Face, ...], int] = {}
        self.frames: dict[FramePair, int] = {}
        self.angles: list[Coordinate] = []
        self.sides = 0
        self._pair_rows = pair_rows
        self._angle_places: dict[Coordinate, int] = {}
        self._tape_room = [0, 0, 0]
        self._constants: dict[int, int] = {}

    def places_of(self, bodies: Iterable[Body]) -> list[int]:
        """The numbers of bodies."""
        return [self.places[body] for body in bodies]

    def surface(self, known: dict[tuple[int, bool], int], face: Face) -> int:
        """Offset of the record of a face; one that is known is written no more."""
        key = (id(face.surface), face.reversed)
        if key not in known:
            record, pool = Face(face.surface.scaled(1.0 / self.scale), reversed=face.reversed).packed()
            record = record.copy()
            record[list(OFFSETS)] += self.pool_at
            assert record.size == SURFACE_RECORD
            known[key], _ = self.add(record, pool)
        return known[key]

    def shell(self, faces: tuple[Face, ...]) -> int:
        """Offset of the shell of a solid."""
        faces = first_equal(faces)
        if faces not in self.shells:
            table, pool, shell = pack_shell(solid_of(faces), self.scale, self.table_at, self.pool_at)
            self.add(table, pool)
            self.shells[faces] = shell
        return self.shells[faces]

    def coordinate(self, coordinate: Coordinate) -> tuple[list[int], list[int]]:
        """The fields of a coordinate in a row, and its bodies."""
        frames = coordinate.frames
        number = self.frames.setdefault(frames, len(self.frames))
        angle = -1
        if coordinate.kind in (TURN, AZIMUTH):
            place = self._angle_places.setdefault(coordinate, len(self.angles))
            if place == len(self.angles):
                self.angles.append(coordinate)
            angle = self._pair_rows + place
        bodies = self.places_of(frame.body for frame in (frames.frame_a, frames.frame_b))
        return [coordinate.kind, coordinate.component, number, angle], bodies

    def tape(self, expression: Expression, row: int) -> list[int]:
        """The record of an expression whose instructions are written now; `row` is its first one, -1 of a term."""
        offsets = []
        workspace = self._tape_room
        for instructions in expression.tapes:
            table = instructions.table.copy()
            table[tape.CONSTANTS] += self.pool_at
            listed, at = self.add(table, instructions.constants)
            offsets.append(listed)
            self._constants[listed] = at
            workspace[2] = max(workspace[2], int(table[tape.WORK]))
        bodies, count = len(expression.bodies), expression.count
        workspace[0] = max(workspace[0], 7 * bodies + count)
        workspace[1] = max(workspace[1], count + 6 * bodies * count, 36 * bodies**2)
        listed, at = self.add(self.places_of(expression.bodies), [expression.scale])
        return [*offsets, count, bodies, listed, row, at, 0]

    def constants_at(self, listed: int) -> int:
        """Where the constants of a list of instructions are in the pool; the list is there in the table."""
        return self._constants[listed]

    def add_shared(self) -> None:
        """Write what rows and terms asked for: frames, and the room that tapes take."""
        fields: list[int] = []
        for pair in self.frames:
            _, at = self.add(pool=frame_numbers(pair.frame_a, pair.frame_b, self.scale))
            fields += [*self.places_of((pair.frame_a.body, pair.frame_b.body)), at]
        header = self.header
        header[layout.JOINT_TABLE], _ = self.add(fields)
        header[layout.JOINTS] = len(self.frames)
        header[layout.FIRST_SIDE] = self._pair_rows + len(self.angles)
        header[layout.TRACKED] = header[layout.FIRST_SIDE] + self.sides
        header[layout.TAPE_WORKSPACE], _ = self.add(self._tape_room)
