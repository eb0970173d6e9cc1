"""What an edge is: a line, an arc of a circle, or another curve. Fitted to samples of the curve in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.kinematics.face_forms import settled

__all__ = ["EdgeForm", "form_of_points"]

Array = NDArray[np.float64]
# A circle is fitted again about the last center, so that its rounding is that of its radius.
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class EdgeForm(ReadOnlyArrays):
    """A line or a circle.

    Attributes
    ----------
    kind : "line" or "circle"
    center : (3,)
        Of a circle; the middle of a line.
    axis : (3,)
        The direction of a line, or across the plane of a circle; unit, its largest component positive.
    radius : float
        Of a circle; 0 of a line.
    """

    kind: str
    center: Array
    axis: Array
    radius: float


def form_of_points(points: Array, tolerance: float) -> EdgeForm | None:
    """The line or circle that is no farther from points (n, 3) along a curve than a tolerance; None without one."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    ways = np.linalg.svd(points - middle - (points - middle).mean(axis=0), full_matrices=False)[2]
    base = points.mean(axis=0)
    local = (points - base) @ ways.T
    if float(np.hypot(local[:, 1], local[:, 2]).max()) <= tolerance:
        along = local[:, 0]
        center = base + 0.5 * (along.min() + along.max()) * ways[0]
        return EdgeForm("line", center, settled(ways[0]), 0.0)
    if float(np.abs(local[:, 2]).max()) > tolerance:
        return None
    center, radius = np.zeros(2), 0.0
    for _ in range(_ROUNDS):
        flat = local[:, :2] - center
        # |x|^2 = 2 c.x + (r^2 - |c|^2).
        rows = np.column_stack([2.0 * flat, np.ones(len(flat))])
        a, b, rest = np.linalg.lstsq(rows, (flat**2).sum(axis=1), rcond=None)[0].tolist()
        center = center + [a, b]
        radius = float(np.sqrt(max(rest + a * a + b * b, 0.0)))
    off = np.abs(np.linalg.norm(local[:, :2] - center, axis=1) - radius)
    if not (radius > 0.0 and float(off.max()) <= tolerance):
        return None
    return EdgeForm("circle", base + center @ ways[:2], settled(np.cross(ways[0], ways[1])), radius)
