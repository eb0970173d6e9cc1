"""Feature locks: a pair keeps its features, or points of them, whatever is closer beside them.

So corners over faces, and points of edges and of near-singular minima, can be rows of a clearance where the closest
pair would jump.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import dot, matvec_t, neg
from assembly.proximity.brep.apexes import unit
from assembly.proximity.brep.borders import feature_of, on_surface
from assembly.proximity.brep.records import (
    EDGE,
    EDGE_POINT,
    FACE,
    FACE_POINT,
    FACE_RECORD,
    VERTEX,
    Feature,
    edge_at,
    shell_at,
)
from assembly.proximity.extrema.face_face import CONVERGED, LEFT_PATCH, SINGULAR
from assembly.proximity.extrema.face_frames import own_frame
from assembly.proximity.extrema.feature_pair import solve_features
from assembly.proximity.features.region_tests import is_feasible
from assembly.proximity.features.switching import between_edges, from_edge, from_vertex

# The most that a unit normal may lean, as a sine, over what is beside a locked feature.
TILT = 0.3
# What a pair keeps: nothing, its features, or also a point of its edge, of its face on f, of its face on g.
NOTHING, FEATURES, POINT, HELD_F, HELD_G = 0.0, 1.0, 2.0, 3.0, 4.0


@kernel(inner=True)
def lean_of(store, shell, feature, code, t, s, n):
    """The most that a normal leans over what is beside an edge, a vertex or a point; 0 for a face."""
    kind = feature.kind
    if kind == FACE_POINT:
        cosine = dot(n, own_frame(store, feature.record, t, s).normal)
        return math.sqrt(max(1.0 - cosine * cosine, 0.0)) if cosine > 0.0 else 1.0
    if kind == EDGE or kind == EDGE_POINT:
        lean = from_edge(store, shell, code, t, n)[0]
        if kind == EDGE:
            return lean
        edge = edge_at(store.table, feature.record)
        along = on_surface(store, edge.surface, edge.curve, t).tangent
        return max(lean, abs(dot(n, unit(along))))
    return from_vertex(store, shell, code, n)[2] if kind == VERTEX else 0.0


@kernel(inline=True)
def held_feature(store, shell, code, held, own):
    """The `Feature` of a code; an EDGE_POINT of an edge held at a POINT, a FACE_POINT of a face if `held` is `own`."""
    kind, record = feature_of(store, shell, code)
    if kind == EDGE and held == POINT:
        kind = EDGE_POINT
    elif kind == FACE and held == own:
        kind = FACE_POINT
    return Feature(kind, record)


@kernel(inner=True)
def hold_features(store, shells, pose, codes, x, n, turn, held):
    """Newton's method on two features that stay what they are: status, x, frame. Arguments as in `track_features`.

    Where `held` is POINT, HELD_F or HELD_G, a point of one feature also stays where it is on it. LEFT_PATCH where a
    point on a face is past its boundary, one of an edge past its end, or the normal leans by more than TILT.
    """
    (shell_f, shell_g), (code_f, code_g) = shells, codes
    f = held_feature(store, shell_f, code_f, held, HELD_F)
    g = held_feature(store, shell_g, code_g, held, HELD_G)
    if f.kind == EDGE and g.kind == EDGE and dot(n, n) < 0.25:
        n = between_edges(store, shells, pose.rotation, codes, x)
    status, x, frame = solve_features(store, f, g, pose, x, n, 1.0, turn)
    inside = True
    if f.kind == FACE:
        inside = is_feasible(store, FACE, shell_at(store.table, shell_f).face_table + FACE_RECORD * code_f, x[0], x[1])
    elif g.kind == FACE:
        inside = is_feasible(store, FACE, shell_at(store.table, shell_g).face_table + FACE_RECORD * code_g, x[2], x[3])
    if status == CONVERGED and not inside:
        status = LEFT_PATCH
    if status == CONVERGED or status == SINGULAR:
        n = frame.normal
        lean = lean_of(store, shell_f, f, code_f, x[0], x[1], n)
        lean = max(lean, lean_of(store, shell_g, g, code_g, x[2], x[3], neg(matvec_t(pose.rotation, n))))
        status = status if lean <= TILT else LEFT_PATCH
    return status, x, frame
