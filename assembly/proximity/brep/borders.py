"""Borders of features: the curves, parameters and ends of edges, and which edge of a face is nearest."""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.geometry.faces.trim_nearest import trim_nearest
from assembly.geometry.faces.trim_pieces import TRIM_CURVES, TRIM_FIRST
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import (
    CURVE_BREAKS,
    CURVE_CLOSED,
    CURVE_RECORD,
    CURVE_SPANS,
    curve_lanes,
    surface_point,
    xyz,
)
from assembly.geometry.vec import blend, cross, dot, sub
from assembly.proximity.brep.records import (
    EDGE,
    EDGE_CURVE,
    EDGE_CURVE_B,
    EDGE_MAP,
    EDGE_RECORD,
    EDGE_SURFACE,
    EDGE_SURFACE_B,
    EDGE_TABLE,
    EDGES,
    FACE,
    FACE_EDGES,
    FACE_RECORD,
    FACE_SURFACE,
    FACE_TABLE,
    FACE_TRIM,
    FACES,
    VERTEX,
    VERTEX_RECORD,
    VERTEX_TABLE,
)


@kernel(inline=True)
def feature_kind(table, shell, code):
    """FACE, EDGE or VERTEX."""
    if code < table[shell + FACES]:
        return FACE
    return EDGE if code < table[shell + FACES] + table[shell + EDGES] else VERTEX


@kernel(inline=True)
def feature_at(table, shell, code):
    """What `solve_features` takes: the surface record of a face, the record of an edge or a vertex."""
    faces = table[shell + FACES]
    edges = table[shell + EDGES]
    if code < faces:
        return table[table[shell + FACE_TABLE] + FACE_RECORD * code + FACE_SURFACE]
    if code < faces + edges:
        return table[shell + EDGE_TABLE] + EDGE_RECORD * (code - faces)
    return table[shell + VERTEX_TABLE] + VERTEX_RECORD * (code - faces - edges)


@kernel(inline=True)
def on_surface(table, pool, surface, curve, t):
    """The plane curve's point in the domain, the surface point there, the tangent, and Su x Sv."""
    c, ct, _ctt = curve_lanes(table, pool, curve, t)
    at = xyz(c)
    along = xyz(ct)
    u, v, _held = into_domain(table, pool, surface, at[0], at[1])
    p, su, sv, _uu, _uv, _vv = surface_point(table, pool, surface, u, v)
    return u, v, p, blend(along[0], su, along[1], sv), cross(su, sv)


@kernel(inline=True)
def clamp_to_curve(table, pool, curve, t):
    """A parameter within a curve's domain, or wrapped round it where the curve is closed."""
    at = table[curve + CURVE_BREAKS]
    low = pool[at]
    high = pool[at + table[curve + CURVE_SPANS]]
    if low <= t <= high:
        return t
    if table[curve + CURVE_CLOSED] == 1:
        return min(max(low + (t - low) % (high - low), low), high)
    return low if t < low else high


@kernel(inner=True)
def other_parameter(table, pool, edge, t, p):
    """The parameter of an edge on its second face, at its point p with parameter t on the first."""
    curve = table[edge + EDGE_CURVE_B]
    surface = table[edge + EDGE_SURFACE_B]
    at = table[edge + EDGE_MAP]
    s = clamp_to_curve(table, pool, curve, pool[at] + pool[at + 1] * t)
    # The map is of first order; its error is smaller than the steps below can take away.
    for _ in range(3):
        _u, _v, b, along, _normal = on_surface(table, pool, surface, curve, s)
        square = dot(along, along)
        if not square > 0.0:
            break
        s = clamp_to_curve(table, pool, curve, s + dot(sub(p, b), along) / square)
    return s


@kernel(inner=True)
def first_parameter(table, pool, edge, t, p):
    """The parameter of an edge near t whose point is nearest to p."""
    curve = table[edge + EDGE_CURVE]
    t = clamp_to_curve(table, pool, curve, t)
    for _ in range(3):
        _u, _v, a, along, _normal = on_surface(table, pool, table[edge + EDGE_SURFACE], curve, t)
        square = dot(along, along)
        if not square > 0.0:
            break
        t = clamp_to_curve(table, pool, curve, t + dot(sub(p, a), along) / square)
    return t


@kernel(inline=True)
def edge_end(table, pool, edge, end):
    """The parameter of an edge at its start (0) or its end (1)."""
    at = table[table[edge + EDGE_CURVE] + CURVE_BREAKS]
    return pool[at] if end == 0 else pool[at + table[table[edge + EDGE_CURVE] + CURVE_SPANS]]


@kernel(inner=True)
def nearest_edge(table, pool, shell, code, u, v):
    """The edge of a face nearest to parameters beyond its boundary: code and (t, 0)."""
    face = table[shell + FACE_TABLE] + FACE_RECORD * code
    trim = table[face + FACE_TRIM]
    _s, k, t, _cu, _cv, _nu, _nv = trim_nearest(table, pool, trim, 0, table[trim + TRIM_CURVES], u, v)
    number = table[table[face + FACE_EDGES] + k]
    if number < 0:
        # A boundary curve that is one point: the curve beside it begins or ends there.
        k = k + 1 if k + 1 < table[trim + TRIM_CURVES] else k - 1
        number = table[table[face + FACE_EDGES] + k]
    edge = table[shell + EDGE_TABLE] + EDGE_RECORD * number
    if table[edge + EDGE_CURVE] != table[trim + TRIM_FIRST] + CURVE_RECORD * k:
        # The edge is measured on its other face.
        _u, _v, p, _along, _normal = on_surface(
            table, pool, table[face + FACE_SURFACE], table[trim + TRIM_FIRST] + CURVE_RECORD * k, t
        )
        at = table[edge + EDGE_MAP]
        t = first_parameter(table, pool, edge, (t - pool[at]) / pool[at + 1], p)
    return table[shell + FACES] + number, (t, 0.0)
