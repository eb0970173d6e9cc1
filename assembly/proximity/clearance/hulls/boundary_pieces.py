"""Straight sides and arcs of the boundary of a flat face, in space."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.curves import Circle
from assembly.proximity.clearance.hulls.prism import NO_ARCS, Arcs
from assembly.proximity.manifolds.flat_map import FlatMap

__all__ = ["BoundaryPieces", "boundary_pieces"]

Array = NDArray[np.float64]


class BoundaryPieces(NamedTuple):
    """Straight sides (begins and ends (n, 3)) and arcs; which way each arc goes, 1 if clockwise; what they are off."""

    begins: Array
    ends: Array
    arcs: Arcs
    clockwise: Array
    off: float


def boundary_pieces(
    face: Face, flat: FlatMap, normal: Array, curves: range, circles: list[Circle | None]
) -> BoundaryPieces | None:
    """Curves of a flat face's boundary, or None where one is neither straight nor an arc."""
    straight, round_, senses, off = [], [], [], flat.off
    for k in curves:
        circle, net = circles[k], flat.points(face.boundary[k])
        if circle is not None:
            away = net - circle.center
            # Control points follow each other around an arc.
            steps = np.arctan2(np.cross(away[1:], away[:-1]) @ normal, (away[1:] * away[:-1]).sum(axis=1))
            angle = float(steps.sum())
            if (steps * angle < 0.0).any():
                return None
            first = away[0] / np.linalg.norm(away[0])
            middle = np.cos(0.5 * angle) * first + np.sin(0.5 * angle) * np.cross(first, normal)
            round_.append((circle.center, middle, circle.radius, 0.5 * abs(angle)))
            senses.append(np.sign(angle))
            off = max(off, circle.deviation + flat.off)
        elif face.boundary[k].degree == 1:
            straight += [(begin, end) for begin, end in zip(net[::2], net[1::2], strict=True) if (begin != end).any()]
        else:
            return None
    begins, ends = np.array(straight).reshape(-1, 2, 3).swapaxes(0, 1)
    arcs = Arcs(*(np.array(column) for column in zip(*round_, strict=True))) if round_ else NO_ARCS
    return BoundaryPieces(begins, ends, arcs, np.array(senses), off)
