"""A round wire as pieces of its spine: it is all that is within its radius of these.

A piece is within s = R (1 - cos(angle / 2)) of its chord, R the radius of its arc, so that the wire around it is within
its radius and s of that. Halving a piece is exact, and a quarter of the s; a straight piece is exact as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.centerline import SAME, spine_of
from assembly.proximity.clearance.records import WIRE

__all__ = ["WireCells", "is_of_wires", "wire_cells"]

Array = NDArray[np.float64]
# The largest angle of a first piece [rad].
ANGLE = 0.5
# What rounding may do to a point of a spine, in parts of the largest coordinate.
ROUNDING = 4e-15


@dataclass(frozen=True, eq=False)
class WireCells:
    """Pieces of a wire's spine, n rows.

    Attributes
    ----------
    corner : (n, 4, 3)
        Where a piece starts, twice where it ends, where it starts.
    center : (n, 3)
        Of its arc; of a line zero.
    first : (n, 2)
        Its curvature, and the radius of the wire.
    pad : (n,)
        What its radius is more in any case.
    form : int
        WIRE.
    """

    corner: Array
    center: Array
    first: Array
    pad: Array
    form: int = WIRE

    def __len__(self) -> int:
        return len(self.corner)


def wire_cells(face: Face, size: float) -> WireCells | None:
    """The first pieces of a face that is a whole round wire of lines and arcs, or None."""
    spine = spine_of(face)
    if spine is None:
        return None
    corners, centers, bends = [], [], []
    for k, (length, bend) in enumerate(zip(spine.length.tolist(), spine.curvature.tolist(), strict=True)):
        count = max(1, int(np.ceil(length * bend / ANGLE)))
        points = spine.frames(k, np.linspace(0.0, length, count + 1))[0]
        corners.append(np.stack([points[:-1], points[1:], points[1:], points[:-1]], axis=1))
        center = spine.start[k] + spine.normal[k] / bend if bend > 0.0 else np.zeros(3)
        centers.append(np.tile(center, (count, 1)))
        bends.append(np.full(count, bend))
    corner, bend = np.concatenate(corners), np.concatenate(bends)
    pad = 2.0 * SAME * size + ROUNDING * float(np.abs(corner).max())
    return WireCells(
        corner,
        np.concatenate(centers),
        np.column_stack([bend, np.full(len(bend), spine.radius)]),
        np.full(len(corner), pad),
    )


@lru_cache(maxsize=256)
def is_of_wires(faces: tuple[Face, ...]) -> bool:
    """Whether all faces of a body are whole round wires of lines and arcs."""
    return all(spine_of(face) is not None for face in faces)
