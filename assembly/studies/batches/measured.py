"""Measures of the rows of a batch, column by column."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.coordinates_at import coordinates_at
from assembly.constraints.program.primitives import AZIMUTH, TURN
from assembly.constraints.program.primitives import RECORD as JOINT_FRAMES
from assembly.derivatives.measure import Measure, place_of
from assembly.derivatives.numbers import FrameOrigin
from assembly.derivatives.parameter import Parameter
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.loop.settings import OBJECTIVE
from assembly.studies.batches.rows import Writes

__all__ = ["can_measure", "measured"]

Array = NDArray[np.float64]
# Angles that go on past a whole turn.
_IN_A_PLANE = (TURN, AZIMUTH)


def can_measure(packed: Packed, measure: Measure) -> bool:
    """Whether the ends of the loop tell a measure: forces take a solution, and so do joints that no row is of."""
    if measure.kind == "coordinate":
        return measure.thing.coordinate.frames in packed._frames
    if measure.kind == "gap":
        return any(contact is measure.thing for contact in packed.contacts)
    return measure.kind in ("place", "distance", "objective")


def measured(
    packed: Packed,
    measures: Sequence[Measure],
    ended: Array,
    writes: Writes,
    columns: tuple[Sequence[Parameter], Array],
) -> Array:
    """Measures (n, m) of rows that ended with these states."""
    out = np.empty((len(ended), len(measures)))
    q = ended[:, : packed.contacts_at].reshape(len(ended), -1, 7)
    for k, item in enumerate(measures):
        if item.kind == "objective":
            out[:, k] = ended[:, packed.results_at + OBJECTIVE] * packed.unit
        elif item.kind == "gap":
            row = next(r for r, contact in enumerate(packed.contacts) if contact is item.thing)
            # The row is the gap less the least one.
            out[:, k] = ended[:, packed.residuals_at + row] + item.thing.minimum
        elif item.kind == "coordinate":
            out[:, k] = _coordinates(packed, item, ended, q, writes)
        else:
            sides = item.thing if item.kind == "distance" else (item.thing,)
            places = [_in_world(packed, side, q, columns) for side in sides]
            if len(places) == 2:
                out[:, k] = np.linalg.norm(places[1] - places[0], axis=1)
            else:
                out[:, k] = places[0][:, item.axis]
    return out


def _in_world(
    packed: Packed, side: Point | Frame | Body, q: Array, columns: tuple[Sequence[Parameter], Array]
) -> Array:
    """Where a place of a body is in every row, (n, 3)."""
    body, place = place_of(side)
    rows = q[:, packed.body_places[body]]
    local = np.repeat(place[None], len(rows), axis=0)
    for k, item in enumerate(columns[0]):
        number = item._number
        if isinstance(number, FrameOrigin) and number.frame is getattr(side, "base", side):
            local[:, number.axis] = columns[1][:, k]
    w, v = rows[:, 3:4], rows[:, 4:]
    across = 2.0 * np.cross(v, local) / (rows[:, 3:] ** 2).sum(axis=1, keepdims=True)
    world: Array = rows[:, :3] + local + w * across + np.cross(v, across)
    return world


def _coordinates(packed: Packed, measure: Measure, ended: Array, q: Array, writes: Writes) -> Array:
    """A coordinate of a joint in every row, (n,): in the user's unit, angles on the turns where rows ended."""
    coordinate = measure.thing.coordinate
    asked = np.array([[packed._frames[coordinate.frames], coordinate.kind, coordinate.component]], dtype=np.int64)
    scaled = q.copy()
    scaled[..., :3] = (q[..., :3] - packed.reference) / packed.scale
    pool, room, value = packed.rows_pool.copy(), np.empty((1, JOINT_FRAMES)), np.empty(1)
    values = np.empty(len(q))
    for k, row in enumerate(scaled):
        pool[writes.places] = writes.numbers[k] if writes.places.size else 0.0
        coordinates_at(packed.rows_table, pool, row, asked, room, value)
        values[k] = value[0]
    if not coordinate.is_angle:
        return values * packed.scale
    place = next((k for k, angle in enumerate(packed._angles) if angle is coordinate), None)
    near = np.zeros(len(q)) if place is None else ended[:, packed.angles_at + TRACK * place]
    if coordinate.kind in _IN_A_PLANE:
        values += 2.0 * pi * np.round((near - values) / (2.0 * pi))
    return values
