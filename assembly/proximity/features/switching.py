"""Which features of two solids are closest now: switching from faces to edges to vertices, and back, as a pair moves.

A pair of features is the closest one where nothing beside it is closer (paper 000, sections II.C and II.D): with n the
contact normal from f towards g,

    a point of a face lies within its boundary,
    a point of an edge lies between its ends, and n.m <= 0 for the directions m that lead from it into its two faces,
    a vertex has n.t <= 0 for the directions t of its edges,

and the same for g with -n. Where a condition fails, the feature it names takes over, and Newton's method goes on from
the same point. The normal decides, not the distance, so that the conditions hold through touching and penetration too.
An edge or a vertex is left only where a condition fails by more than rounding, but entered at once: a pair between two
features stays where it is.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.faces.trim import trim_side
from assembly.geometry.vec import cross, dot, matvec, matvec_t, neg
from assembly.proximity.brep.apexes import LEAN, apex_near, from_apex, unit
from assembly.proximity.brep.borders import (
    edge_end,
    feature_at,
    feature_kind,
    feature_of,
    nearest_edge,
    on_surface,
    other_parameter,
)
from assembly.proximity.brep.records import (
    EDGE,
    EDGE_RECORD,
    FACE,
    FACE_RECORD,
    VERTEX_RECORD,
    edge_at,
    face_at,
    shell_at,
    vertex_at,
)
from assembly.proximity.extrema.face_face import LEFT_PATCH, NOT_CONVERGED
from assembly.proximity.extrema.face_frames import own_frame
from assembly.proximity.extrema.feature_pair import solve_features
from assembly.proximity.features.sliding import slide_off

# The most switches in a row: no motion of a pair needs as many.
ROUNDS = 64
# Cosine between the normals before and after below which the pair is another one.
ACROSS = 0.3


@kernel(inner=True)
def lean_into(store, surface, curve, t, n):
    """n.m, m the unit direction from a boundary curve into its face: material is on the left in (u, v)."""
    on_edge = on_surface(store, surface, curve, t)
    along, normal = on_edge.tangent, on_edge.normal
    return dot(n, unit(cross(normal, along)))


@kernel(inner=True)
def from_edge(store, shell, code, t, n):
    """The face over which the normal leans most at a point of an edge: how much, code and (u, v) of the point on it."""
    solid = shell_at(store.table, shell)
    edge = solid.edge_table + EDGE_RECORD * (code - solid.faces)
    edge_record = edge_at(store.table, edge)
    face = edge_record.face_a
    surface = edge_record.surface
    curve = edge_record.curve
    lean = lean_into(store, surface, curve, t, n)
    if edge_record.face_b >= 0:
        on_edge = on_surface(store, surface, curve, t)
        p = on_edge.point
        s = other_parameter(store, edge, t, p)
        other = lean_into(store, edge_record.surface_b, edge_record.curve_b, s, n)
        if other > lean:
            lean = other
            face = edge_record.face_b
            surface = edge_record.surface_b
            curve = edge_record.curve_b
            t = s
    on_edge = on_surface(store, surface, curve, t)
    u, v = on_edge.u, on_edge.v
    return lean, face, (u, v)


@kernel(inner=True)
def between_edges(store, shells, rotation, codes, x):
    """The normal of two edges that leans least over their faces: it tells the outside where edges touch."""
    (shell_f, shell_g), (code_f, code_g) = shells, codes
    edge_f = edge_at(store.table, feature_at(store.table, shell_f, code_f))
    edge_g = edge_at(store.table, feature_at(store.table, shell_g, code_g))
    along_f = on_surface(store, edge_f.surface, edge_f.curve, x[0]).tangent
    along_g = on_surface(store, edge_g.surface, edge_g.curve, x[2]).tangent
    n = unit(cross(along_f, matvec(rotation, along_g)))
    m = matvec_t(rotation, n)
    there = max(from_edge(store, shell_f, code_f, x[0], n)[0], from_edge(store, shell_g, code_g, x[2], neg(m))[0])
    back = max(from_edge(store, shell_f, code_f, x[0], neg(n))[0], from_edge(store, shell_g, code_g, x[2], m)[0])
    return n if there <= back else neg(n)


@kernel(inner=True)
def from_vertex(store, shell, code, n):
    """The edge along which the normal leans most at a vertex: code, (t, 0) and how much; or the vertex itself."""
    solid = shell_at(store.table, shell)
    faces = solid.faces
    vertex = solid.vertex_table + VERTEX_RECORD * (code - faces - solid.edges)
    vertex_record = vertex_at(store.table, vertex)
    best = LEAN
    found = (0.0, 0.0)
    for k in range(vertex_record.edges):
        at = vertex_record.edge_list + 2 * k
        edge = solid.edge_table + EDGE_RECORD * store.table[at]
        edge_record = edge_at(store.table, edge)
        t = edge_end(store, edge, store.table[at + 1])
        on_edge = on_surface(store, edge_record.surface, edge_record.curve, t)
        along = on_edge.tangent
        lean = dot(n, unit(along))
        if store.table[at + 1] == 1:
            lean = -lean
        if lean > best:
            best = lean
            code = faces + store.table[at]
            found = (t, 0.0)
    if vertex_record.edges == 0:
        code, found = from_apex(store, shell, vertex, code, n)
    return code, found, best


@kernel(inner=True)
def checked(store, shell, code, a, b, held, n):
    """The feature that takes over from one with coordinates (a, b) where n is the normal out of its body.

    `held` says that Newton's method was stopped at an end. Returns the code, the coordinates, and whether it changed.
    """
    solid = shell_at(store.table, shell)
    kind = feature_kind(store.table, shell, code)
    if kind == FACE:
        trim = face_at(store.table, solid.face_table + FACE_RECORD * code).trim
        if trim < 0:
            return code, (a, b), False
        side = trim_side(store, trim, a, b)
        if side > 0 or (side == 0 and not held):
            return code, (a, b), False
        code, found = nearest_edge(store, shell, code, a, b)
        return code, found, True
    if kind == EDGE:
        edge = solid.edge_table + EDGE_RECORD * (code - solid.faces)
        edge_record = edge_at(store.table, edge)
        if edge_record.start >= 0 and held:
            vertices = solid.faces + solid.edges
            if a <= edge_end(store, edge, 0):
                return vertices + edge_record.start, (0.0, 0.0), True
            if a >= edge_end(store, edge, 1):
                return vertices + edge_record.end, (0.0, 0.0), True
        if held:
            return code, (a, b), False
        lean, face, found = from_edge(store, shell, code, a, n)
        return (face, found, True) if lean > LEAN else (code, (a, b), False)
    other, found, _lean = from_vertex(store, shell, code, n)
    return other, found, other != code


# A pair of features that was tracked. codes: their numbers; x: their coordinates; frame: its `FeatureFrame`; switches:
# how often it went on to another feature.
FeatureTrack = namedtuple("FeatureTrack", "status codes x frame switches")


@kernel(inner=True)
def track_features(store, shells, pose, codes, x, n, size, turn):
    """Newton's method on a pair of features, and switching until no other feature beside them is closer.

    Poses, `size` and `turn` as in `solve_pair`: g relative to f, everything in the axes of f. `n` is a normal near the
    pair's, from f towards g, zero where unknown. After a switch `turn` no longer bounds the steps;
    instead the last normal must not be across the first one, as it would be on the far side.

    Returns a `FeatureTrack`: CONVERGED or SINGULAR where the pair is the closest one of its neighborhood, and neither
    solid is inside the other there.
    """
    shell_f, shell_g = shells
    switches = 0
    before = n
    # Where it was after the last power of two of switches: what comes there again goes round until ROUNDS are over.
    codes_then, x_then, n_then, then = codes, x, n, 0
    while True:
        if then > 0 and codes == codes_then and x == x_then and n == n_then:
            switches += (ROUNDS - switches) // (switches - then) * (switches - then)
        if switches > 0 and switches >= 2 * then:
            codes_then, x_then, n_then, then = codes, x, n, switches
        code_f, code_g = codes
        f = feature_of(store, shell_f, code_f)
        g = feature_of(store, shell_g, code_g)
        are_faces = f.kind == FACE and g.kind == FACE
        if f.kind == EDGE and g.kind == EDGE and dot(n, n) < 0.25:
            n = between_edges(store, shells, pose.rotation, codes, x)
        begun = x
        status, x, frame = solve_features(store, f, g, pose, x, n, size, turn if switches == 0 else math.inf)
        if switches >= ROUNDS:
            status = NOT_CONVERGED
            break
        if status == NOT_CONVERGED:
            slides = False
            if are_faces:
                slides, codes, x = slide_off(store, shells, pose, codes, begun, size)
            if not slides:
                code_f = apex_near(store, shell_f, codes[0], x[0], x[1])
                code_g = apex_near(store, shell_g, codes[1], x[2], x[3]) if code_f == codes[0] else codes[1]
                if code_f == codes[0] and code_g == codes[1]:
                    break
                codes = (code_f, code_g)
            switches += 1
            continue
        n = frame.normal
        held = status == LEFT_PATCH
        code_f, at_f, switched = checked(store, shell_f, code_f, x[0], x[1], held, n)
        at_g = (x[2], x[3])
        if not switched:
            code_g, at_g, switched = checked(store, shell_g, code_g, x[2], x[3], held, neg(matvec_t(pose.rotation, n)))
        if not switched:
            break
        codes = (code_f, code_g)
        x = (at_f[0], at_f[1], at_g[0], at_g[1])
        switches += 1
    if turn < math.inf and dot(before, before) > 0.25 and dot(before, n) < ACROSS:
        status = NOT_CONVERGED
    if are_faces and status != NOT_CONVERGED:
        # Of solids that touch, outward normals oppose each other; else one is inside the other.
        normal = own_frame(store, g.record, x[2], x[3]).normal
        if dot(normal, matvec_t(pose.rotation, n)) > 0.0:
            status = NOT_CONVERGED
    return FeatureTrack(status, codes, x, frame, switches)
