"""A packed scene with other numbers in the same places: after a frame was placed or a value set.

What is in the pool is written by what packs it, into a pool of its own; the table stays. So the bits are those of the
scene packed anew, and solutions of before keep theirs. Where numbers make trees or surfaces, a shape or a least gap or
the size of a scene with contacts, the scene is packed anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.dexterity import Dexterity
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.objectives import Objective, Posture
from assembly.constraints.packing.number_places import NumberPlaces
from assembly.constraints.packing.places import place_numbers
from assembly.constraints.packing.scene_size import size_and_extent
from assembly.constraints.packing.scene_writer import SceneWriter
from assembly.constraints.packing.terms import TermPacking
from assembly.constraints.program import records as layout
from assembly.kinematics.body import Body
from assembly.kinematics.changes import numbers_set, set_since

if TYPE_CHECKING:
    from assembly.constraints.packing.scene import Packed

__all__ = ["have_same_numbers", "numbers_told", "renumbered"]

Array = NDArray[np.float64]


class _PoolWriter:
    """Takes what terms add to a pool, of scenes whose table is written."""

    def __init__(self, packed: Packed, scale: float) -> None:
        self.scale, self.places, self.header = scale, packed.body_places, np.zeros(layout.HEADER, dtype=np.int64)
        self.pool: list[float] = []

    def add(self, table: Sequence[int] = (), pool: Sequence[float] = ()) -> tuple[int, int]:
        """Keep what goes to the pool."""
        at = len(self.pool)
        self.pool += pool
        return 0, at


def renumbered(
    packed: Packed,
    bodies: Sequence[Body],
    constraints: Callable[[], Sequence[Constraint]],
    objectives: Sequence[tuple[float, Objective]],
) -> Packed | None:
    """The scene with its numbers of now, itself where these are no others; None where it has to be packed anew.

    `constraints` gives those that are packed, for who needs them.
    """
    things = set_since(packed.numbers)
    if things is not None and packed.number_places is None and not any(body in things for body in bodies):
        # Places are of no use where a body has other faces.
        packed.number_places = NumberPlaces(packed, bodies, constraints(), objectives)
    if things is not None and packed.number_places is not None:
        other = packed.number_places.renumbered(packed, things, bodies[0].pose.position)
        if other is not None:
            return other
    size = None if things is None or packed.number_places is None else packed.number_places.size
    return _compared(packed, bodies, constraints, objectives, size)


def _compared(
    packed: Packed,
    bodies: Sequence[Body],
    constraints: Callable[[], Sequence[Constraint]],
    objectives: Sequence[tuple[float, Objective]],
    size: float | None,
) -> Packed | None:
    """The same, where all numbers are written anew and compared: the size is another one, or shapes are.

    The size is measured in full where it is None.
    """
    goals = objectives or [(1.0, Posture())]
    faces = [side.face for body in bodies for side in body.faces]
    if packed.clearance_rows or any(isinstance(term, (Dexterity, Expression)) for _, term in goals):
        return None
    if len(faces) != len(packed.faces) or any(a is not b for a, b in zip(faces, packed.faces, strict=True)):
        return None
    has_no_extent = False
    if size is None:
        size, has_no_extent = size_and_extent(bodies, constraints(), objectives)
    scale = size if size > 0.0 else 1.0
    if scale != packed.scale and packed.pair_rows:
        return None
    other = packed.twin()
    other.numbers = numbers_set()
    other.has_size, other._has_no_extent = size > 0.0, has_no_extent
    other._measure_by(scale, bodies, goals)
    pool = other.rows_pool
    pool[: layout.POOL_HEADER - 2] = other._pool_header()[: layout.POOL_HEADER - 2]
    frames = [frame for pair in packed._frames for frame in (pair.frame_a, pair.frame_b)]
    if frames:
        block = pool[packed.frames_at :][: 12 * len(frames)].reshape(-1, 4, 3)
        block[:, 0] = np.array([frame.origin for frame in frames]) / scale
        block[:, 1:] = np.array([frame.axes for frame in frames]).transpose(0, 2, 1)
    if scale != packed.scale:
        # `other` has the scale of now.
        for equation, place, unit in other._values:
            for factor, second in equation.terms[1:]:
                pool[place - 1] = factor * (1.0 if second.is_angle else scale) / unit
            pool[place] = 0.0
    writer = _PoolWriter(packed, scale)
    terms = TermPacking(cast(SceneWriter, writer), packed.row_numbers, bodies, other.reference, other.unit)
    for sign, term in goals:
        terms.add(sign, term)
    pool[packed.terms_at : packed.terms_at + len(writer.pool)] = writer.pool
    for contact, at in zip(packed.contacts, packed.gaps, strict=True):
        pool[at] = contact.minimum / scale
    for spot, start in packed.placed:
        numbers = place_numbers(spot, 0.0, scale)
        pool[start : start + len(numbers)] = numbers
    other.measure_from(packed.begun_at())
    if have_same_numbers(packed, other):
        packed.numbers = numbers_set()
        return packed
    return other


def have_same_numbers(one: Packed, other: Packed) -> bool:
    """Whether a scene that was packed twice has the same numbers now, wherever its last solves began."""
    if one is other:
        return True
    if one.lineage is not other.lineage or one.scale != other.scale or one.pool.size != other.pool.size:
        return False
    for each in (one, other):
        each.refresh()
    apart = one.pool != other.pool
    apart[layout.VERSION] = False
    apart[one.following] = False
    return not apart.any()


def numbers_told(packed: Packed, bodies: Sequence[Body], constraints: Sequence[Constraint]) -> list[object]:
    """What was set anew where two lists differ: fixed bodies, what is asked for, frames, least gaps, faces, places.

    Driven values, limits, offsets and targets are not among it: they are read in every solve.
    """
    pairs = [*packed._frames, *(term for term, _ in packed._turns)]
    sides = (side for pair in pairs for side in (getattr(pair, name, None) for name in ("frame_a", "frame_b", "frame")))
    frames = [(side.origin.tobytes(), side.axes.tobytes()) for side in sides if side is not None]
    asked = [body.fixed for body in bodies], [item._is_asked for item in constraints]
    faces = [side.face for body in bodies for side in body.faces]
    gaps = [item.minimum for item in packed.clearances] + [item.minimum for item in packed.contacts]
    places = [place.target for place, _ in packed.placed]
    drawn = [(place.target, place.weight) for place in packed.drawn]
    return [asked, frames, gaps, faces, places, drawn]
