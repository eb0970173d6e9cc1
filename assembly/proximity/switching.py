"""Which features of two solids are closest now: switching from faces to edges to vertices, and back, as a pair moves.

A pair of features is the closest one where nothing beside it is closer (paper 000, sections II.C and II.D): with n the
contact normal from f towards g,

    a point of a face lies within its boundary,
    a point of an edge lies between its ends, and n.m <= 0 for the directions m that lead from it into its two faces,
    a vertex has n.t <= 0 for the directions t of its edges,

and the same for g with -n. Where a condition fails, the feature it names takes over, and Newton's method goes on from
the same point. The normal decides, not the distance, so that the conditions hold through touching and penetration too.
Leaving an edge or a vertex asks for more than rounding, entering one does not: a pair on the border stays where it is.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.pieces import TRIM_CURVES, TRIM_FIRST
from assembly.geometry.spline import (
    CURVE_BREAKS,
    CURVE_CLOSED,
    CURVE_RECORD,
    CURVE_SPANS,
    curve_lanes,
    surface_point,
    xyz,
)
from assembly.geometry.trim import trim_side
from assembly.geometry.trim_nearest import trim_nearest
from assembly.geometry.vec import blend, cross, dot, matvec, matvec_t, neg, sub
from assembly.proximity.extremal import LEFT_PATCH, NOT_CONVERGED, into_domain, own_frame
from assembly.proximity.feature_pair import solve_features
from assembly.proximity.shell import (
    EDGE,
    EDGE_CURVE,
    EDGE_CURVE_B,
    EDGE_END,
    EDGE_FACE_A,
    EDGE_FACE_B,
    EDGE_MAP,
    EDGE_RECORD,
    EDGE_START,
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
    VERTEX_EDGE_LIST,
    VERTEX_EDGES,
    VERTEX_RECORD,
    VERTEX_TABLE,
)
from assembly.proximity.tips import LEAN, from_tip, tip_near, unit

# Switches in a row that no motion of a pair needs.
ROUNDS = 64
# Cosine between the normals before and after below which the pair is another one.
ACROSS = 0.3


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
def lean_into(table, pool, surface, curve, t, n):
    """n.m, m the unit direction from a boundary curve into its face: material is on the left in (u, v)."""
    _u, _v, _p, along, normal = on_surface(table, pool, surface, curve, t)
    return dot(n, unit(cross(normal, along)))


@kernel(inner=True)
def from_edge(table, pool, shell, code, t, n):
    """The face over which the normal leans most at a point of an edge: how much, code and (u, v) of the point on it."""
    edge = table[shell + EDGE_TABLE] + EDGE_RECORD * (code - table[shell + FACES])
    face = table[edge + EDGE_FACE_A]
    surface = table[edge + EDGE_SURFACE]
    curve = table[edge + EDGE_CURVE]
    lean = lean_into(table, pool, surface, curve, t, n)
    if table[edge + EDGE_FACE_B] >= 0:
        _u, _v, p, _along, _normal = on_surface(table, pool, surface, curve, t)
        s = other_parameter(table, pool, edge, t, p)
        other = lean_into(table, pool, table[edge + EDGE_SURFACE_B], table[edge + EDGE_CURVE_B], s, n)
        if other > lean:
            lean = other
            face = table[edge + EDGE_FACE_B]
            surface = table[edge + EDGE_SURFACE_B]
            curve = table[edge + EDGE_CURVE_B]
            t = s
    u, v, _p, _along, _normal = on_surface(table, pool, surface, curve, t)
    return lean, face, (u, v)


@kernel(inner=True)
def between_edges(table, pool, shell_f, shell_g, rotation, code_f, code_g, t_f, t_g):
    """The normal of two edges that leans least over their faces: it tells the outside where edges touch."""
    edge_f = table[shell_f + EDGE_TABLE] + EDGE_RECORD * (code_f - table[shell_f + FACES])
    edge_g = table[shell_g + EDGE_TABLE] + EDGE_RECORD * (code_g - table[shell_g + FACES])
    along_f = on_surface(table, pool, table[edge_f + EDGE_SURFACE], table[edge_f + EDGE_CURVE], t_f)[3]
    along_g = on_surface(table, pool, table[edge_g + EDGE_SURFACE], table[edge_g + EDGE_CURVE], t_g)[3]
    n = unit(cross(along_f, matvec(rotation, along_g)))
    m = matvec_t(rotation, n)
    there = max(
        from_edge(table, pool, shell_f, code_f, t_f, n)[0], from_edge(table, pool, shell_g, code_g, t_g, neg(m))[0]
    )
    back = max(
        from_edge(table, pool, shell_f, code_f, t_f, neg(n))[0], from_edge(table, pool, shell_g, code_g, t_g, m)[0]
    )
    return n if there <= back else neg(n)


@kernel(inline=True)
def edge_end(table, pool, edge, end):
    """The parameter of an edge at its start (0) or its end (1)."""
    at = table[table[edge + EDGE_CURVE] + CURVE_BREAKS]
    return pool[at] if end == 0 else pool[at + table[table[edge + EDGE_CURVE] + CURVE_SPANS]]


@kernel(inner=True)
def from_vertex(table, pool, shell, code, n):
    """The edge along which the normal leans most at a vertex: code, (t, 0) and how much; or the vertex itself."""
    faces = table[shell + FACES]
    vertex = table[shell + VERTEX_TABLE] + VERTEX_RECORD * (code - faces - table[shell + EDGES])
    best = LEAN
    found = (0.0, 0.0)
    for k in range(table[vertex + VERTEX_EDGES]):
        at = table[vertex + VERTEX_EDGE_LIST] + 2 * k
        edge = table[shell + EDGE_TABLE] + EDGE_RECORD * table[at]
        t = edge_end(table, pool, edge, table[at + 1])
        _u, _v, _p, along, _normal = on_surface(table, pool, table[edge + EDGE_SURFACE], table[edge + EDGE_CURVE], t)
        lean = dot(n, unit(along))
        if table[at + 1] == 1:
            lean = -lean
        if lean > best:
            best = lean
            code = faces + table[at]
            found = (t, 0.0)
    if table[vertex + VERTEX_EDGES] == 0:
        code, found = from_tip(table, pool, shell, vertex, code, n)
    return code, found, best


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


@kernel(inner=True)
def checked(table, pool, shell, code, a, b, held, n):
    """The feature that takes over from one with coordinates (a, b) where n is the normal out of its body.

    `held` says that Newton's method was stopped at an end. Returns the code, the coordinates, and whether it changed.
    """
    kind = feature_kind(table, shell, code)
    if kind == FACE:
        trim = table[table[shell + FACE_TABLE] + FACE_RECORD * code + FACE_TRIM]
        if trim < 0:
            return code, (a, b), False
        side = trim_side(table, pool, trim, a, b)
        if side > 0 or (side == 0 and not held):
            return code, (a, b), False
        code, found = nearest_edge(table, pool, shell, code, a, b)
        return code, found, True
    if kind == EDGE:
        edge = table[shell + EDGE_TABLE] + EDGE_RECORD * (code - table[shell + FACES])
        if table[edge + EDGE_START] >= 0 and held:
            vertices = table[shell + FACES] + table[shell + EDGES]
            if a <= edge_end(table, pool, edge, 0):
                return vertices + table[edge + EDGE_START], (0.0, 0.0), True
            if a >= edge_end(table, pool, edge, 1):
                return vertices + table[edge + EDGE_END], (0.0, 0.0), True
        if held:
            return code, (a, b), False
        lean, face, found = from_edge(table, pool, shell, code, a, n)
        return (face, found, True) if lean > LEAN else (code, (a, b), False)
    other, found, _lean = from_vertex(table, pool, shell, code, n)
    return other, found, other != code


@kernel(inner=True)
def track_features(table, pool, shell_f, shell_g, rotation, shift, code_f, code_g, x, n, size, turn):
    """Newton's method on a pair of features, and switching until no other feature beside them is closer.

    Poses, `size` and `turn` as in `solve_pair`: g relative to f, everything in the axes of f. `n` is a normal near the
    pair's, from f towards g, zero where unknown. Where features switch, `turn` bounds the way from feature to feature
    no more; the normal at the end must not be across the one at the start, which would be the far side's.

    Returns
    -------
    status, the two features, x (4), the frame of `solve_features`, how often it switched. CONVERGED or SINGULAR where
    the pair is the closest one of its neighborhood, and neither solid is inside the other there.
    """
    switches = 0
    before = n
    while True:
        kind_f = feature_kind(table, shell_f, code_f)
        kind_g = feature_kind(table, shell_g, code_g)
        if kind_f == EDGE and kind_g == EDGE and dot(n, n) < 0.25:
            n = between_edges(table, pool, shell_f, shell_g, rotation, code_f, code_g, x[0], x[2])
        status, x, frame = solve_features(
            table,
            pool,
            kind_f,
            feature_at(table, shell_f, code_f),
            kind_g,
            feature_at(table, shell_g, code_g),
            rotation,
            shift,
            x,
            n,
            size,
            turn if switches == 0 else math.inf,
        )
        if switches >= ROUNDS:
            status = NOT_CONVERGED
            break
        if status == NOT_CONVERGED:
            tip_f = tip_near(table, pool, shell_f, code_f, x[0], x[1])
            tip_g = tip_near(table, pool, shell_g, code_g, x[2], x[3]) if tip_f == code_f else code_g
            if tip_f == code_f and tip_g == code_g:
                break
            code_f = tip_f
            code_g = tip_g
            switches += 1
            continue
        n = frame[0]
        held = status == LEFT_PATCH
        code_f, at_f, switched = checked(table, pool, shell_f, code_f, x[0], x[1], held, n)
        at_g = (x[2], x[3])
        if not switched:
            code_g, at_g, switched = checked(table, pool, shell_g, code_g, x[2], x[3], held, neg(matvec_t(rotation, n)))
        if not switched:
            break
        x = (at_f[0], at_f[1], at_g[0], at_g[1])
        switches += 1
    if turn < math.inf and dot(before, before) > 0.25 and dot(before, n) < ACROSS:
        status = NOT_CONVERGED
    if kind_f == FACE and kind_g == FACE and status != NOT_CONVERGED:
        # Of solids that touch, outward normals oppose each other; else one is inside the other.
        normal = own_frame(table, pool, feature_at(table, shell_g, code_g), x[2], x[3])[1]
        if dot(normal, matvec_t(rotation, n)) > 0.0:
            status = NOT_CONVERGED
    return status, code_f, code_g, x, frame, switches
