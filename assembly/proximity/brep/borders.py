"""Borders of features: the curves, parameters and ends of edges, and which edge of a face is nearest."""

from __future__ import annotations

from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.faces.trim_nearest import trim_nearest
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import (
    CURVE_RECORD,
    curve_lanes,
    spline_curve_at,
    surface_point,
    xyz,
)
from assembly.geometry.vec import blend, cross, dot, sub
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


@kernel(inline=True)
def clamp_to_curve(store, curve, t):
    """A parameter within a curve's domain, or wrapped round it where the curve is closed."""
    arc = spline_curve_at(store.table, curve)
    at = arc.breaks
    low = store.pool[at]
    high = store.pool[at + arc.spans]
    if low <= t <= high:
        return t
    if arc.closed == 1:
        return min(max(low + (t - low) % (high - low), low), high)
    return low if t < low else high


@kernel(inner=True)
def other_parameter(store, edge, t, p):
    """The parameter of an edge on its second face, at its point p with parameter t on the first."""
    edge_record = edge_at(store.table, edge)
    curve = edge_record.curve_b
    surface = edge_record.surface_b
    at = edge_record.map
    s = clamp_to_curve(store, curve, store.pool[at] + store.pool[at + 1] * t)
    # The map is of first order; its error is smaller than the steps below can take away.
    for _ in range(3):
        on_edge = on_surface(store, surface, curve, s)
        b, along = on_edge.point, on_edge.tangent
        square = dot(along, along)
        if not square > 0.0:
            break
        s = clamp_to_curve(store, curve, s + dot(sub(p, b), along) / square)
    return s


@kernel(inner=True)
def first_parameter(store, edge, t, p):
    """The parameter of an edge near t whose point is nearest to p."""
    edge_record = edge_at(store.table, edge)
    curve = edge_record.curve
    t = clamp_to_curve(store, curve, t)
    for _ in range(3):
        on_edge = on_surface(store, edge_record.surface, curve, t)
        a, along = on_edge.point, on_edge.tangent
        square = dot(along, along)
        if not square > 0.0:
            break
        t = clamp_to_curve(store, curve, t + dot(sub(p, a), along) / square)
    return t


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
        # The edge is measured on its other face.
        on_edge = on_surface(store, face.surface, trim_record.first + CURVE_RECORD * k, t)
        p = on_edge.point
        at = edge_record.map
        t = first_parameter(store, edge, (t - store.pool[at]) / store.pool[at + 1], p)
    return solid.faces + number, (t, 0.0)
