"""Hulls that contain a face, made of discs and points, and hollows: convex sets that contain no point of it.

A face on a cylinder, a cone or a sphere is on the border of a convex set, so that what is wholly within that set is
clear of it: a shaft of its bore, a plug of its seat, a ball of its socket. A flat face with a hole is beside the
largest disc in the hole, and so beside all of the line across it.
"""

from __future__ import annotations

from math import cos, pi, tan

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cone, Cylinder, Form, Freeform, Plane, Sphere, Torus
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.flat_hulls import hole_of_ring, hulls_of_flat
from assembly.proximity.clearance.hulls.hollows import FaceHulls, Hollow, Ring, Tube, parts_of_one
from assembly.proximity.clearance.hulls.looped_part import looped_part
from assembly.proximity.clearance.hulls.prism import Prism
from assembly.proximity.clearance.hulls.turned import Turned, turned_surface
from assembly.proximity.manifolds.elementary_faces import nearly_elementary
from assembly.proximity.manifolds.flat_map import FlatMap, flat_map

__all__ = ["hulls_of_face"]

Array = NDArray[np.float64]
# Spans of a curved face that have hulls of their own, at most.
SPANS = 16
# All around, but for rounding; of less a hull of control points may be the smaller one.
AROUND = 2.0 * pi - 1e-9
# Of what goes around an axis less than half, others are beside it by planes.
HALF = pi - 1e-9


def hulls_of_face(face: Face) -> list[FaceHulls]:
    """The hulls of a face, and what it is beside; of what is not convex in parts, each as if it were a face."""
    surface = face.surface
    flat = flat_map(surface)
    points = _points_of(face, flat)
    if flat is not None:
        normal = np.cross(flat.along, flat.across)
        length = float(np.linalg.norm(normal))
        if length > 0.0:
            return hulls_of_flat(face, flat, normal / length, points)
    form = nearly_elementary(surface)
    if isinstance(form, Plane):
        net = surface.control_points.reshape(-1, 3)
        return [FaceHulls([(Discs.of_points(net), 0.0)], hole_of_ring(surface, form.normal), points, form.normal, None)]
    part = looped_part(face)
    around, line = _of_form(form, part), _line_of(form)
    turned = turned_surface(part) if _may_be_turned(form, face, part) else None
    hollows = [*_hollow(form, face), *_rings(form, face, around), *_through(form, face, around, turned)]
    known = hollows, points, _axis_of(form), line
    if around is not None and _is_all_around(form):
        return [FaceHulls([around], hollows, points, _axis_of(form), line)]
    spans = part.bezier_pieces()
    parts = spans.reshape(-1, spans.shape[2] * spans.shape[3], 4)
    if len(parts) > SPANS:
        parts = parts.reshape(1, -1, 4)
    others = [] if around is None else [around]
    if turned is not None:
        others.append((turned.discs, turned.off))
    nets = [net[:, :3] / net[:, 3:] for net in parts]
    return parts_of_one([FaceHulls([*others, (Discs.of_points(net), 0.0)], *known) for net in nets])


def _may_be_turned(form: Form, face: Face, part: NurbsSurface) -> bool:
    """Whether it may be worth asking which part of what goes around an axis a face is; of a cone its ends tell."""
    if isinstance(form, Torus):
        return form.turn.angle >= HALF and not all(part.closed)
    return any(part.closed) and (isinstance(form, Freeform) or (isinstance(form, Sphere) and face.outer is not None))


def _is_all_around(form: Form) -> bool:
    return isinstance(form, (Cylinder, Cone)) and form.turn.angle >= AROUND


def _of_form(form: Form, part: NurbsSurface) -> tuple[Discs, float] | None:
    """The hull of all of a sphere or a torus, or of a cylinder or a cone between the heights of a part of it."""
    if isinstance(form, Sphere):
        return Discs.of_points(form.center[None]), form.radius + form.deviation
    if isinstance(form, Torus):
        return Discs(form.center[None], form.axis[None], np.array([form.major])), form.minor + form.deviation
    if isinstance(form, (Cylinder, Cone)):
        foot = form.point if isinstance(form, Cylinder) else form.apex
        along = (part.control_points - foot) @ form.axis
        heights = np.array([max(form.heights[0], along.min()), min(form.heights[1], along.max())])
        radii = np.full(2, form.radius) if isinstance(form, Cylinder) else heights * tan(form.half_angle)
        return Discs(foot + heights[:, None] * form.axis, np.tile(form.axis, (2, 1)), radii), form.deviation
    return None


def _hollow(form: Form, face: Face) -> list[Hollow | Prism | Tube]:
    """What is within a face's cylinder, cone or sphere, without what the face may be off it; what is beside a torus.

    Of the many parts of tori that round edges off only those that go all around and are hollow have some, as races of
    balls.
    """
    sign = face.sign
    if isinstance(form, Sphere):
        return [Hollow(form.center, np.zeros(3), form.radius - form.deviation, 0.0, form.outward != (sign > 0))]
    if isinstance(form, Cylinder):
        return [Hollow(form.point, form.axis, form.radius - form.deviation, 0.0, form.outward != (sign > 0))]
    if isinstance(form, Cone):
        off = form.deviation / cos(form.half_angle)
        return [Hollow(form.apex, form.axis, -off, form.half_angle, form.outward != (sign > 0))]
    if isinstance(form, Torus):
        outer, inner = form.minor + form.deviation, form.minor - form.deviation
        if form.outward != (sign > 0):
            race = Tube(form.center, form.axis, form.major, inner, False, True)
            return [race] if any(face.surface.closed) else []
        if all(face.surface.closed) and face.outer is None:
            return [Tube(form.center, form.axis, form.major, outer, True, True)]
    return []


def _rings(form: Form, face: Face, around: tuple[Discs, float] | None) -> list[Ring]:
    """The part of a cylinder or cone between its ends, for balls that lie on these or on it, or beside it."""
    if around is None or not isinstance(form, (Cylinder, Cone)):
        return []
    (first, last), radii = around[0].centers, around[0].radii
    ends = np.array([[0.0, radii[0]], [float((last - first) @ form.axis), radii[1]]])
    return [Ring(first, form.axis, ends, around[1], is_wall=form.outward != (face.sign > 0))]


def _through(form: Form, face: Face, around: tuple[Discs, float] | None, turned: Turned | None) -> list[Hollow]:
    """The cylinder through what goes around an axis, as far from that as its narrowest place."""
    line, least = _line_of(form), 0.0
    if isinstance(form, Cone) and around is not None:
        least = float(around[0].radii.min()) - form.deviation
    elif isinstance(form, Torus) and form.turn.angle >= HALF:
        least = form.major - form.minor - form.deviation
    if turned is not None and turned.least > least:
        line, least = (turned.center, turned.axis), turned.least
    if line is None or not least > 0.0:
        return []
    is_within = isinstance(form, Sphere | Cone | Torus) and form.outward == (face.sign > 0)
    if isinstance(form, Torus):
        # On the side of the tube that is next to the axis a body in the tube is around the hole.
        return [Hollow(*line, least, 0.0, is_within == (least < form.major))]
    return [Hollow(*line, least, 0.0, isinstance(form, Sphere | Cone) and not is_within)]


def _axis_of(form: Form) -> Array | None:
    return form.axis if isinstance(form, (Cylinder, Cone, Torus)) else None


def _line_of(form: Form) -> tuple[Array, Array] | None:
    if isinstance(form, Sphere):
        return form.center, np.zeros(3)
    if isinstance(form, Cylinder):
        return form.point, form.axis
    if isinstance(form, Cone):
        return form.apex, form.axis
    return (form.center, form.axis) if isinstance(form, Torus) else None


def _points_of(face: Face, flat: FlatMap | None) -> Array:
    """Ends of pieces of a face's boundary, or of its surface where that is all of it."""
    surface = face.surface
    if face.outer is None and not face.holes:
        pieces = surface.bezier_pieces()
        corners = np.concatenate([pieces[:, :, i, j].reshape(-1, 4) for i in (0, -1) for j in (0, -1)])
        return np.asarray(corners[:, :3] / corners[:, 3:])
    # Where a piece ends the next one begins, and so do curves.
    ends = np.concatenate([curve.bezier_pieces()[:, 0] for curve in face.boundary])
    uv = ends[:, :2] / ends[:, 2:]
    if flat is not None:
        return np.asarray(flat.origin + uv[:, :1] * flat.along + uv[:, 1:] * flat.across)
    low, high = (np.array([side[k] for side in surface.domain]) for k in (0, 1))
    # Rounding may leave an end a little beyond that of the domain; directions that are closed wrap.
    uv = np.where(surface.closed, uv, np.clip(uv, low, high))
    return np.asarray(surface.evaluate(uv[:, 0], uv[:, 1]))
