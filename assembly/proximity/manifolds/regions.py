"""What a trimmed plane face covers: its loops as straight pieces and arcs of its plane.

A loop's curves lie in (u, v). Where (u, v) goes to space by an affine map, lines and circles are recognized of the
image; else of what has one u or one v, a Bezier curve of the surface. A face with any other border has no region.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import atan2, ceil, pi

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.curves import Circle, Line, curve_form
from assembly.geometry.recognition.forms import Plane
from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.manifolds.clip import write_boxes
from assembly.proximity.manifolds.elementary_faces import NEARLY, nearly_elementary
from assembly.proximity.manifolds.flat_map import flat_map
from assembly.proximity.manifolds.records import FRAME, FRAME_SIZE, SEGMENT, SEGMENT_SIZE

__all__ = ["PlaneRegion", "plane_of", "plane_region"]

Array = NDArray[np.float64]
# Of a segment: begin, end and center (2,), radius, sweep.
_Piece = tuple[list[float], list[float], list[float], float, float]
# Arcs are cut into pieces that turn by no more, so that each is on one side of its chord.
QUARTER = 0.5 * pi
THIRDS = np.linspace(0.0, 1.0, 4)


@dataclass(frozen=True, eq=False)
class PlaneRegion:
    """A trimmed plane face.

    Attributes
    ----------
    frame : (FRAME_SIZE,)
        Of the plane, in the axes of the body.
    segments : (n, SEGMENT_SIZE)
        Of all loops.
    deviation : float
        The face is no farther than that from the plane, its borders no farther than twice that from the segments.
    size : float
        Of the face.
    """

    frame: Array
    segments: Array
    deviation: float
    size: float


def plane_of(face: Face) -> tuple[Array, Array] | None:
    """A point of a plane face and its outward normal; None of a face in no plane. Its borders are not looked at."""
    form = nearly_elementary(face.surface)
    if not isinstance(form, Plane):
        return None
    return form.point, form.normal if face.sign > 0 else -form.normal


@lru_cache(maxsize=1024)
def plane_region(face: Face) -> PlaneRegion | None:
    """The region of a face; None where it is in no plane, or its borders are not of lines and arcs."""
    form = nearly_elementary(face.surface)
    plane = plane_of(face)
    if plane is None or not isinstance(form, Plane):
        return None
    normal = plane[1]
    right = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(normal, right)])
    size = face.surface.size
    parts: list[_Piece] = []
    off = form.deviation
    for curve in face.boundary:
        found = _forms(face.surface, curve)
        if found is None:
            return None
        for shape, ends in found:
            off = max(off, shape.deviation)
            parts += _pieces(shape, (ends - form.point) @ axes.T, form.point, axes)
    segments = np.zeros((len(parts), SEGMENT_SIZE))
    rows = rows_of(SEGMENT, segments)
    rows.begin, rows.end, rows.center, rows.radius, rows.sweep = zip(*parts, strict=True)
    write_boxes(segments)
    frame = np.zeros(FRAME_SIZE)
    record = rows_of(FRAME, frame[None])
    record.origin, record.right, record.up, record.normal = form.point, *axes, normal
    return PlaneRegion(frame, segments, off, size)


def _forms(surface: NurbsSurface, curve: NurbsCurve) -> list[tuple[Line | Circle, Array]] | None:
    """The lines and circles in space that a border goes along, each with four places on it; None if it does not.

    Of the places the first and the last are ends, the others tell which way an arc goes.
    """
    low, high = curve.domain
    ends = surface.evaluate(*curve.evaluate(low + (high - low) * THIRDS).T)
    flat = flat_map(surface)
    if flat is None:
        uv = curve.control_points
        for d in (0, 1):
            if np.ptp(uv[:, d]) == 0.0:
                shape = curve_form([_isoline(surface, d, float(uv[0, d]))], NEARLY * surface.size)
                return None if shape is None else [(shape, ends)]
        return None
    pieces = flat.image(curve)
    shape = curve_form([pieces], NEARLY * surface.size)
    if shape is not None:
        return [(shape, ends)]
    found = []
    places = bezier.bernstein(pieces.shape[1] - 1, THIRDS) @ pieces
    for piece, at in zip(pieces, places[..., :3] / places[..., 3:], strict=True):
        shape = curve_form([piece[None]], NEARLY * surface.size)
        if shape is None:
            return None
        found.append((shape, at))
    return found


def _isoline(surface: NurbsSurface, d: int, value: float) -> Array:
    """The curve of a surface at one u (d = 0) or v (d = 1), all of it."""
    breaks = surface.breaks()[d]
    k = min(max(int(np.searchsorted(breaks, value, side="right")) - 1, 0), len(breaks) - 2)
    part = (value - breaks[k]) / (breaks[k + 1] - breaks[k])
    pieces = surface.bezier_pieces()
    strip = pieces[k] if d == 0 else np.moveaxis(pieces[:, k], 1, 2)
    weights = bezier.bernstein(strip.shape[1] - 1, np.array([part]))[0]
    return np.asarray(np.einsum("k,pkjc->pjc", weights, strip))


def _pieces(found: Line | Circle, ends: Array, point: Array, axes: Array) -> list[_Piece]:
    """The segments of a curve with these places (4, 2) in the plane, but for their boxes."""
    begin, end = ends[0].tolist(), ends[-1].tolist()
    if isinstance(found, Line):
        return [(begin, end, [0.0, 0.0], 0.0, 0.0)]
    center = axes @ (found.center - point)
    angles = [atan2(y, x) for x, y in (ends - center).tolist()]
    # By thirds, each of less than half a turn.
    steps = [(b - a + pi) % (2.0 * pi) - pi for a, b in zip(angles, angles[1:], strict=False)]
    sweep = sum(steps)
    count = max(1, ceil(abs(sweep) / QUARTER - 1e-9))
    turns = angles[0] + sweep * np.arange(count + 1) / count
    places = center + found.radius * np.column_stack([np.cos(turns), np.sin(turns)])
    places[0], places[-1] = begin, end
    turn, corners, middle = sweep / count, places.tolist(), center.tolist()
    return [(corners[k], corners[k + 1], middle, found.radius, turn) for k in range(count)]
