"""Numbers of a scene whose size is another one: a frame was placed, of the link that is the longest.

Lengths are divided by the size, so all of them are written. Of scenes without shapes in contact and without an
objective, mechanisms that is, these are origins of frames, units of values, and how far turns of bodies count; where
they are in the pool is found once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.objectives import Objective, Posture
from assembly.constraints.packing.scene_size import check_reach
from assembly.constraints.packing.terms import natural_unit
from assembly.constraints.program import records as layout
from assembly.constraints.program.objective_terms import POSTURE_PARAMETERS
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame

if TYPE_CHECKING:
    from assembly.constraints.packing.scene import Packed

__all__ = ["RescaledNumbers"]

Array = NDArray[np.float64]
# Numbers of a frame: its origin, and its axes.
FRAME = 12


class RescaledNumbers:
    """Where lengths are in the pool of a scene, and what they are in the user's units.

    Parameters
    ----------
    packed : Packed
    bodies, objectives
        What it was packed of.

    Attributes
    ----------
    is_possible : bool
        Whether these are all of its lengths.
    """

    def __init__(self, packed: Packed, bodies: Sequence[Body], objectives: Sequence[tuple[float, Objective]]) -> None:
        others = packed.pair_rows or packed.clearance_rows or packed.clearances or packed.contacts
        self.is_possible = not (objectives or others or packed.placed or packed.drawn or packed.corners)
        self._posture = Posture()
        self._bodies = [body for body in bodies if not body.fixed]
        # Weights of turns of bodies with a shape; of others half the scene's size is the lever, whatever it is.
        self._shaped = [
            (packed.terms_at + POSTURE_PARAMETERS * k + POSTURE_PARAMETERS - 1, body)
            for k, body in enumerate(self._bodies)
            if body.size
        ]
        self._frames = [frame for pair in packed._frames for frame in (pair.frame_a, pair.frame_b)]
        # Lengths are origins of frames, and values, which are none until they are read. Their places in the pool:
        count, values = 3 * len(self._frames), packed._valued
        starts = packed.frames_at + FRAME * np.arange(len(self._frames), dtype=np.int64)
        of_values = np.array([at for _, at in values], dtype=np.int64)
        self._places = np.concatenate([np.add.outer(starts, np.arange(3)).ravel(), of_values])
        self._lengths = np.zeros(len(self._places))
        self._origins = self._lengths[:count].reshape(-1, 3)
        self._origins[:] = np.array([frame.origin for frame in self._frames]).reshape(-1, 3)
        self._factors = [
            (at - 1, factor, other.is_angle, equation.terms[0][1].is_angle)
            for equation, at in values
            for factor, other in equation.terms[1:]
        ]

    def has_moved(self, which: Iterable[int], frame: Frame) -> None:
        """Take the origin of a frame that was placed anew, by its numbers among the frames."""
        for k in which:
            self._origins[k] = frame.origin

    def written(self, packed: Packed, size: float) -> Packed | None:
        """A twin of a packed scene with this size; None where it has to be packed anew, or has a size that it cannot.

        Raises
        ------
        InputError
            A body that is too far away for the size.
        """
        # A posture has the unit of the objective, so that its weight in the pool is one, and lasts.
        unit = self._posture.weight * natural_unit(self._posture, size)
        if not (self.is_possible and packed.is_unit(unit)):
            return None
        other = packed.twin()
        other.scale, other.unit = size, unit
        other.has_size, other._has_no_extent = True, False
        pool = other.rows_pool
        pool[layout.SCALE], pool[layout.OBJECTIVE_UNIT] = size, unit
        pool[self._places] = self._lengths / size
        for at, factor, is_angle, of_angle in self._factors:
            pool[at] = factor * (1.0 if is_angle else size) / (1.0 if of_angle else size)
        for at, body in self._shaped:
            pool[at] = (0.5 * body.size / size) ** 2
        if size < packed.scale:
            for body in self._bodies:
                check_reach("a coordinate of a reference", max(map(abs, body.pose.position.tolist())), size)
        return other
