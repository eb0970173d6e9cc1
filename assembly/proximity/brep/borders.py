"""Borders of features: the curves, parameters and ends of edges, and which edge of a face is nearest."""

from __future__ import annotations

from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import damped_newton
from assembly.geometry.faces.trim_nearest import trim_nearest
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.nearest_place import Interval, held_in, move_along, sight_of, step_along
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import (
    CURVE_RECORD,
    curve_lanes,
    spline_curve_at,
    surface_point,
    xyz,
)
from assembly.geometry.vec import blend, cross, sub
from assembly.proximity.brep.records import (
    EDGE,
    EDGE_RECORD,
    FACE,
    FACE_RECORD,
    VERTEX,
    VERTEX_RECORD,
    Feature,
    edge_at,
    face_at,
    shell_at,
)


@kernel(inline=True)
def feature_kind(table, shell, code):
    """FACE, EDGE or VERTEX."""
    solid = shell_at(table, shell)
    if code < solid.faces:
        return FACE
    return EDGE if code < solid.faces + solid.edges else VERTEX


@kernel(inline=True)
def feature_at(table, shell, code):
    """The surface record of a face, the record of an edge or a vertex."""
    solid = shell_at(table, shell)
    faces = solid.faces
    edges = solid.edges
    if code < faces:
        return face_at(table, solid.face_table + FACE_RECORD * code).surface
    if code < faces + edges:
        return solid.edge_table + EDGE_RECORD * (code - faces)
    return solid.vertex_table + VERTEX_RECORD * (code - faces - edges)


@kernel(inline=True)
def feature_of(store, shell, code):
    """The `Feature` of a number."""
    return Feature(feature_kind(store.table, shell, code), feature_at(store.table, shell, code))


# A point of an edge on one of its faces. u, v: in the domain; point: of the surface; tangent: of the edge, by the
# curve's parameter; normal: Su x Sv.
EdgePoint = namedtuple("EdgePoint", "u v point tangent normal")


@kernel(inline=True)
def on_surface(store, surface, curve, t):
    """The EdgePoint of a plane curve at t."""
    c, ct, _ctt = curve_lanes(store, curve, t)
    at = xyz(c)
    along = xyz(ct)
    u, v, _held = into_domain(store, surface, at[0], at[1])
    p, su, sv, _uu, _uv, _vv = surface_point(store.table, store.pool, surface, u, v)
    return EdgePoint(u=u, v=v, point=p, tangent=blend(along[0], su, along[1], sv), normal=cross(su, sv))


# A plane curve on a surface and a point in space.
BorderQuery = namedtuple("BorderQuery", "store surface curve p interval")


@kernel(inline=True)
def _seen(query, t):
    """The query's point as seen from the curve at t; curvature is omitted, as the point is close to the curve."""
    at = on_surface(query.store, query.surface, query.curve, t)
    return sight_of(sub(at.point, query.p), at.tangent, (0.0, 0.0, 0.0))


_nearest_from = kernel(inner=True)(damped_newton(_seen, step_along, move_along, steps=3))


@kernel(inner=True)
def nearest_on_border(store, surface, curve, t, p):
    """The parameter near t of a curve on a surface whose point is nearest to p."""
    arc = spline_curve_at(store.table, curve)
    interval = Interval(store.pool[arc.breaks], store.pool[arc.breaks + arc.spans], arc.closed == 1)
    return _nearest_from(BorderQuery(store, surface, curve, p, interval), held_in(interval, t))[2]


@kernel(inner=True)
def other_parameter(store, edge, t, p):
    """The parameter of an edge on its second face, at its point p with parameter t on the first."""
    edge_record = edge_at(store.table, edge)
    at = edge_record.map
    # The map is of first order; its error is small enough for three Gauss-Newton steps.
    s = store.pool[at] + store.pool[at + 1] * t
    return nearest_on_border(store, edge_record.surface_b, edge_record.curve_b, s, p)


@kernel(inner=True)
def first_parameter(store, edge, t, p):
    """The parameter of an edge near t whose point is nearest to p."""
    edge_record = edge_at(store.table, edge)
    return nearest_on_border(store, edge_record.surface, edge_record.curve, t, p)


@kernel(inline=True)
def edge_end(store, edge, end):
    """The parameter of an edge at its start (0) or its end (1)."""
    edge_record = edge_at(store.table, edge)
    arc = spline_curve_at(store.table, edge_record.curve)
    at = arc.breaks
    return store.pool[at] if end == 0 else store.pool[at + arc.spans]


@kernel(inner=True)
def nearest_edge(store, shell, code, u, v):
    """The edge of a face nearest to parameters beyond its boundary: code and (t, 0)."""
    solid = shell_at(store.table, shell)
    face = face_at(store.table, solid.face_table + FACE_RECORD * code)
    trim = face.trim
    trim_record = trim_at(store.table, trim)
    _s, k, t, _cu, _cv, _nu, _nv = trim_nearest(store, trim, 0, trim_record.curves, u, v)
    number = store.table[face.edges + k]
    if number < 0:
        # A boundary curve that is one point: the curve beside it begins or ends there.
        k = k + 1 if k + 1 < trim_record.curves else k - 1
        number = store.table[face.edges + k]
    edge = solid.edge_table + EDGE_RECORD * number
    edge_record = edge_at(store.table, edge)
    if edge_record.curve != trim_record.first + CURVE_RECORD * k:
        # The edge has the parameter of its curve on the other face.
        on_edge = on_surface(store, face.surface, trim_record.first + CURVE_RECORD * k, t)
        p = on_edge.point
        at = edge_record.map
        t = first_parameter(store, edge, (t - store.pool[at]) / store.pool[at + 1], p)
    return solid.faces + number, (t, 0.0)
