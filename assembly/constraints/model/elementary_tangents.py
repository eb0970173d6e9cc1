"""Tangency of two elementary faces: rows between a plane, an axis or a center of each.

Surfaces count whole. With r and R radii, each with the sign that says whether outward normals go away from the axis or
the center, and + where they oppose each other (outside), - where they are one (inside):

    plane and sphere        the center is at height +-r
    plane and cylinder      the axis is parallel to the plane, at height +-r
    plane and cone          the axis leans out of the plane by the half angle, the apex is in the plane
    sphere and sphere       centers are r + R apart, or |r - R|; of one radius inside each other they coincide
    cylinder and sphere     the center is r + R from the axis, or |r - R|; or on it
    cone and sphere         the center is +-r from the lines of the cone, cos(angle) rho - sin(angle) z from the apex,
                            and beside these lines, sin(angle) rho + cos(angle) z >= 0
    cylinder and cylinder   axes are parallel, r + R apart, or |r - R|; or lie on each other
    cylinder and cone       along a line of the cone: the axis leans by the half angle, and goes through the apex of the
                            cone that is +-r outside of it, +-r / sin(angle) before its own
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np

from assembly.constraints.model.joint import ON_AXIS, SAME_AXIS, SAME_POINT, Axes
from assembly.constraints.model.joints import ALONG, Z_DOT_Z
from assembly.constraints.program.primitives import DISTANCE, RADIUS
from assembly.errors import InputError
from assembly.geometry.recognition.forms import Cone
from assembly.kinematics.body import BodyFace
from assembly.kinematics.frame import Frame
from assembly.selection.selection import EQUAL

__all__ = ["ELEMENTARY", "TangentRow", "TangentRows", "check_fit", "touching_rows"]

# In the order in which one of them has frame a.
ELEMENTARY = ("plane", "cylinder", "cone", "sphere")


class TangentRow(NamedTuple):
    """A row: factors of coordinates, each of a kind and a component, and what their sum equals, or is not below."""

    terms: tuple[tuple[float, tuple[int, int]], ...]
    value: float
    one_sided: bool = False


class TangentRows(NamedTuple):
    """Frames a and b, whether their z axes are to be parallel in the nearest sense, and the rows."""

    frame_a: Frame
    frame_b: Frame
    axes: Axes
    rows: tuple[TangentRow, ...]


def check_fit(a: BodyFace, b: BodyFace, outside: bool) -> None:
    """Raise where what touches a bore or a socket from within is wider: it would be through the wall elsewhere."""
    round_ones = {"cylinder", "sphere"}
    if not outside or a.kind not in round_ones or b.kind not in round_ones or a.is_hole == b.is_hole:
        return
    hollow, full = (a, b) if a.is_hole else (b, a)
    if full.radius > hollow.radius + EQUAL * max(full.body.size, hollow.body.size):
        raise InputError(
            f"{full!r} has the radius {full.radius:.9g}, and {hollow!r}, which is hollow, {hollow.radius:.9g}; "
            "expected one that fits, or side='inside'"
        )


def touching_rows(a: BodyFace, b: BodyFace, outside: bool) -> TangentRows | None:
    """The rows of two faces, or None where one is not elementary, or no formula of coordinates says that they touch."""
    if a.kind not in ELEMENTARY or b.kind not in ELEMENTARY:
        return None
    first, second = sorted((a, b), key=lambda face: ELEMENTARY.index(face.kind))
    kinds = first.kind, second.kind
    frame_a, frame_b = _frame(first), _frame(second)
    sense = 1.0 if outside else -1.0
    if kinds[0] == "plane":
        rows = _on_plane(second, sense)
        return None if rows is None else TangentRows(frame_a, frame_b, "aligned", rows)
    if kinds == ("cone", "sphere"):
        angle = first.half_angle
        height = sense * _sign(first) * _sign(second) * second.radius
        rows = (TangentRow(((cos(angle), (RADIUS, 0)), (-sin(angle), ALONG)), height),)
        if height > 0.0:
            # The projection on a line of the cone is not beyond the apex; from inside it never is.
            rows += (TangentRow(((sin(angle), (RADIUS, 0)), (cos(angle), ALONG)), 0.0, one_sided=True),)
        return TangentRows(frame_a, frame_b, "aligned", rows)
    if kinds == ("cylinder", "cone"):
        angle = second.half_angle
        apex = _frame(second, sense * _sign(first) * _sign(second) * first.radius / sin(angle))
        leans = TangentRow(((1.0, Z_DOT_Z),), cos(angle))
        return TangentRows(frame_a, apex, "nearest", (*(_zero(*which) for which in ON_AXIS), leans))
    if "cone" in kinds:
        return None
    # Radii add up where what is around axes or centers is on different sides.
    apart = sense * _sign(first) * _sign(second) > 0.0
    distance = first.radius + second.radius if apart else abs(first.radius - second.radius)
    coincide = distance <= EQUAL * max(first.body.size, second.body.size)
    spheres = kinds == ("sphere", "sphere")
    zero: tuple[tuple[int, int], ...] = SAME_POINT if spheres else ON_AXIS
    away = (DISTANCE if spheres else RADIUS, 0)
    own = [_zero(*which) for which in zero] if coincide else [TangentRow(((1.0, away),), distance)]
    if kinds == ("cylinder", "cylinder"):
        return TangentRows(frame_a, frame_b, "nearest", (*(_zero(*which) for which in SAME_AXIS), *own))
    return TangentRows(frame_a, frame_b, "aligned", tuple(own))


def _on_plane(face: BodyFace, sense: float) -> tuple[TangentRow, ...] | None:
    if face.kind == "plane":
        return None
    side = sense * _sign(face)
    if face.kind == "cone":
        return TangentRow(((1.0, Z_DOT_Z),), side * sin(face.half_angle)), _zero(*ALONG)
    height = TangentRow(((1.0, ALONG),), side * face.radius)
    return (height,) if face.kind == "sphere" else (_zero(*Z_DOT_Z), height)


def _zero(kind: int, component: int) -> TangentRow:
    return TangentRow(((1.0, (kind, component)),), 0.0)


def _sign(face: BodyFace) -> float:
    """1 where outward normals go away from the axis or the center."""
    return -1.0 if face.is_hole else 1.0


def _frame(face: BodyFace, before: float = 0.0) -> Frame:
    """The plane with z outward, the axis, or the center; of a cone at its apex, or so far before it."""
    form = face.form
    if isinstance(form, Cone):
        return face.body.frame(np.asarray(form.apex) - before * np.asarray(form.axis), form.axis)
    return face.frame()
