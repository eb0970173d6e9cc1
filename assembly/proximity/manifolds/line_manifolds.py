"""Manifolds of what is round and full on plane faces: a line of a cylinder or a cone, a point of a ball.

What is round comes nearest to a plane with the normal n along the line that is on the side of -n. Its gap is affine
along it, so that it is least at an end of what of it the plane's region has.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cone, Cylinder, Sphere
from assembly.proximity.manifolds.elementary_faces import elementary_faces
from assembly.proximity.manifolds.line_span import line_span
from assembly.proximity.manifolds.manifold import Manifold
from assembly.proximity.manifolds.records import BALL, CUT, END, FRAME, SEGMENT
from assembly.proximity.manifolds.regions import PlaneRegion, plane_of, plane_region
from assembly.proximity.manifolds.second_rates import skew

__all__ = ["line_manifold", "line_manifolds"]

Array = NDArray[np.float64]
# What is as near to a border is on it, in parts of the larger face's size.
ON_BORDER = 1e-12
# Lines that lean more than this sine do not lie on a plane.
LYING = 0.5


def line_manifold(region: PlaneRegion, form: Cylinder | Cone | Sphere, turn: Array, shift: Array) -> Manifold | None:
    """The manifold of a plane face and what is round and full, at x -> turn x + shift seen from the face's body.

    None where the line that is nearest to the plane leans by more than 30 degrees, is not on the face's side of it, or
    is nowhere over the region. Gaps are along the plane's normal, the bound is of those along the line.
    """
    frame = rows_of(FRAME, region.frame[None])[0]
    n = frame.normal
    line = _nearest_line(form, turn.T @ n)
    if line is None:
        return None
    ends = line @ turn.T + shift
    off = ends - frame.origin
    flat = np.column_stack([off @ frame.right, off @ frame.up])
    size = max(region.size, float(np.linalg.norm(ends[1] - ends[0])))
    borders = np.full(2, -1)
    if isinstance(form, Sphere):
        # A short line in its place.
        flat = flat + ON_BORDER * size * np.array([[-1.0, 0.0], [1.0, 0.0]])
    low, high = line_span(region.segments, flat.ravel(), ON_BORDER * size, borders)
    if low > high or (high - low < 1e-9 and not isinstance(form, Sphere)):
        return None
    if isinstance(form, Sphere):
        places, normals, kinds = ends[:1], n[None], np.array([[BALL, 0.0, 0.0]])
    else:
        way = ends[1] - ends[0]
        places = ends[0] + np.array([[low], [high]]) * way
        cuts = zip(borders.tolist(), places, strict=True)
        normals = np.array([_normal(frame, way, _tangent(region, k, at)) for k, at in cuts])
        kinds = np.array([[END if k < 0 else CUT, float(k), float(end)] for end, k in enumerate(borders.tolist())])
    gaps = (places - frame.origin) @ n
    lean = float(np.abs(n @ (ends[1] - ends[0]))) / size
    bound = float(gaps.min()) - form.deviation - region.deviation - 4.0 * lean * ON_BORDER * size
    return Manifold(np.array(normals), places.copy(), gaps, bound, kinds)


def _nearest_line(form: Cylinder | Cone | Sphere, n: Array) -> Array | None:
    """The ends (2, 3) of the line of a surface that is on the side of -n; of a ball the point twice."""
    if isinstance(form, Sphere):
        return np.tile(form.center - form.radius * n, (2, 1))
    side = n - (n @ form.axis) * form.axis
    length = float(np.linalg.norm(side))
    if length < LYING:
        return None
    side /= length
    start, angle = form.turn.start, form.turn.angle
    turned = np.arctan2(-(skew(start) @ side) @ form.axis, start @ -side) % (2.0 * np.pi)
    # Where a face ends at the line it has it.
    if turned > angle + 1e-9 and turned < 2.0 * np.pi - 1e-9:
        return None
    heights = np.array(form.heights)
    if isinstance(form, Cone):
        radii, origin = heights * np.tan(form.half_angle), form.apex
    else:
        radii, origin = np.full(2, form.radius), form.point
    line = origin + heights[:, None] * form.axis - radii[:, None] * side
    way = line[1] - line[0]
    return line if abs(float(way @ n)) <= LYING * float(np.linalg.norm(way)) else None


def _tangent(region: PlaneRegion, segment: int, place: Array) -> Array:
    """The direction (2,) of a border at a place, zero where there is no border (-1)."""
    if segment < 0:
        return np.zeros(2)
    frame, s = rows_of(FRAME, region.frame[None])[0], rows_of(SEGMENT, region.segments)[segment]
    if s.radius == 0.0:
        return np.asarray(s.end - s.begin)
    off = place - frame.origin
    return np.array([s.center[1] - off @ frame.up, off @ frame.right - s.center[0]])


def _normal(frame: np.record, way: Array, border: Array) -> Array:
    """How the gap changes where a line ends: across it and the border that it ends at, so that m.n = 1."""
    across = skew(border[0] * frame.right + border[1] * frame.up) @ way
    along = float(across @ frame.normal)
    if abs(along) <= 1e-6 * float(np.linalg.norm(border) * np.linalg.norm(way)):
        return np.array(frame.normal)
    return np.asarray(across / along)


class _Plane(NamedTuple):
    """A plane face of a body: its number, the face, a point and the outward normal."""

    number: int
    face: Face
    point: Array
    normal: Array


@lru_cache(maxsize=256)
def _faces(faces: tuple[Face, ...]) -> tuple[list[_Plane], list[tuple[int, Cylinder | Cone | Sphere]]]:
    """The plane faces of a body, and those that are round and full, with their numbers."""
    planes = [_Plane(k, face, *plane) for k, face in enumerate(faces) if (plane := plane_of(face)) is not None]
    rounds = [
        (k, one.form)
        for k, face in enumerate(faces)
        for one in elementary_faces((face,))
        if one.is_outward and isinstance(one.form, Cylinder | Cone | Sphere)
    ]
    return planes, rounds


def _near_manifold(
    plane: _Plane, form: Cylinder | Cone | Sphere, turn: Array, shift: Array, within: tuple[float, float]
) -> Manifold | None:
    """The manifold of a plane face and what is round if its gaps are between two lengths.

    Gaps are heights along the nearest line: where none of them is between the lengths, no region is made of the face.
    """
    low, high = within
    line = _nearest_line(form, turn.T @ plane.normal)
    if line is None:
        return None
    ends = line @ turn.T + shift
    heights = (ends - plane.point) @ plane.normal
    rounding = ON_BORDER * (plane.face.surface.size + float(np.abs(ends).max()) + float(np.abs(heights).max()))
    if heights.min() > high + rounding or heights.max() < low - rounding:
        return None
    region = plane_region(plane.face)
    manifold = None if region is None else line_manifold(region, form, turn, shift)
    if manifold is None or manifold.gaps.min() < low or manifold.gaps.max() > high:
        return None
    return manifold


def line_manifolds(
    shapes: tuple[tuple[Face, ...], tuple[Face, ...]], turn: Array, shift: Array, within: tuple[float, float]
) -> list[tuple[tuple[int, int], Manifold]]:
    """Manifolds of all pairs of a plane face and what is round, of either body, whose gaps are between two lengths.

    Parameters
    ----------
    shapes : (tuple of Face, tuple of Face)
        Of both bodies.
    turn, shift : (3, 3), (3,)
        The second body is at x -> turn x + shift, seen from the first.
    within : (float, float)

    Returns
    -------
    list of ((int, int), Manifold)
        With the numbers of the faces.
    """
    (planes_a, rounds_a), (planes_b, rounds_b) = map(_faces, shapes)
    found = [
        ((plane.number, j), manifold)
        for plane in planes_a
        for j, form in rounds_b
        if (manifold := _near_manifold(plane, form, turn, shift, within)) is not None
    ]
    return found + [
        ((i, plane.number), manifold.turned(turn, shift))
        for plane in planes_b
        for i, form in rounds_a
        if (manifold := _near_manifold(plane, form, turn.T, -turn.T @ shift, within)) is not None
    ]
