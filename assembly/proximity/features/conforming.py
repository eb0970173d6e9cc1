"""B-rep bodies with conforming faces that seem deep in each other and only touch: a peg in a bore of its own radius.

They have points in common all over a face, and the least move that parts them is as long as the peg. That they only
touch is shown by shrinking one of them: then it is free. With c the middle of g and R how far g reaches from c,

    g' = c + (1 - t) (g - c)

is no farther from g than t R, so that no point of g is deeper in f than t R if g' is free of f. Instead f may shrink,
which seen from f is the same as g growing about the middle of f. Shrinking parts flat faces, walls and balls in their
seats all at once, which no rigid move does.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_at
from assembly.geometry.vec import add, dot, matvec, scale, sub
from assembly.kinematics.motion import IDENTITY, RelativePose
from assembly.proximity.brep.apexes import unit
from assembly.proximity.brep.borders import feature_at, feature_kind, feature_of, on_surface, other_parameter
from assembly.proximity.brep.records import EDGE, edge_at, shell_at
from assembly.proximity.extrema.crossing import tangents
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.extrema.feature_pair import solve_features
from assembly.proximity.features.ball_tree import feature_cells, used_cell
from assembly.proximity.features.global_search import CROSSING, FoundPair, nearest_of_shells
from assembly.proximity.features.separating_normals import WAYS, FeaturePoint, add_ways, points_of, way_at

# Bodies deeper in each other than this part of the size cross; others may only touch along conforming faces.
NEARLY = 1e-6
# Relative accuracy of the search for the nearest features of the shrunk body: many are equally near.
ROUGH = 0.1


@kernel(inner=True)
def middle_of_faces(store, shell):
    """The middle of the cells of a shell's faces, and how far these reach from there."""
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    reach = 0.0
    center = (0.0, 0.0, 0.0)
    for step in range(2):
        for k in range(shell_at(store.table, shell).faces):
            own = feature_cells(store.table, shell, k)
            kind, record, count, cells, stride, ball = own.kind, own.record, own.count, own.pool, own.stride, own.ball
            for i in range(count):
                if not used_cell(store, record, kind, i):
                    continue
                o = cells + stride * i + ball
                c = (store.pool[o], store.pool[o + 1], store.pool[o + 2])
                r = store.pool[o + 3]
                if step == 0:
                    lo = (min(lo[0], c[0] - r), min(lo[1], c[1] - r), min(lo[2], c[2] - r))
                    hi = (max(hi[0], c[0] + r), max(hi[1], c[1] + r), max(hi[2], c[2] + r))
                else:
                    d = sub(c, center)
                    reach = max(reach, math.sqrt(dot(d, d)) + r)
        if step == 0:
            center = scale(0.5, add(lo, hi))
    return center, reach


@kernel(inner=True)
def grown(pose, about, factor):
    """A pose with which a shell grows by a factor about a point of the axes that it is seen from."""
    larger = (
        factor * pose.rotation[0],
        factor * pose.rotation[1],
        factor * pose.rotation[2],
        factor * pose.rotation[3],
        factor * pose.rotation[4],
        factor * pose.rotation[5],
        factor * pose.rotation[6],
        factor * pose.rotation[7],
        factor * pose.rotation[8],
    )
    return RelativePose(rotation=larger, shift=add(about, scale(factor, sub(pose.shift, about))))


@kernel(inner=True)
def leans(store, shell, at, turn, n, size, ways):
    """The sum of n.m over the normals m of a body's faces at a `FeaturePoint`."""
    s = 0.0
    for k in range(add_ways(store, shell, at, turn, 1.0, size, ways, 0)):
        s += dot(n, way_at(ways, k))
    return s


@kernel(inner=True)
def face_beside(store, shell, at, turn, n):
    """The point of an edge on the face that leans most along n; a `FeaturePoint` of what is no edge stays as it is."""
    if feature_kind(store.table, shell, at.code) != EDGE:
        return at
    edge = feature_at(store.table, shell, at.code)
    edge_record = edge_at(store.table, edge)
    surface = edge_record.surface
    one = on_surface(store, surface, edge_record.curve, at.u)
    if edge_record.face_b >= 0:
        surface_b = edge_record.surface_b
        s = other_parameter(store, edge, at.u, one.point)
        other = on_surface(store, surface_b, edge_record.curve_b, s)
        lean = float(surface_at(store.table, surface).sign) * dot(unit(matvec(turn, one.normal)), n)
        if float(surface_at(store.table, surface_b).sign) * dot(unit(matvec(turn, other.normal)), n) > lean:
            return FeaturePoint(edge_record.face_b, other.u, other.v)
    return FeaturePoint(edge_record.face_a, one.u, one.v)


@kernel(inner=True)
def pair_from(store, shells, pose, codes, x, n, size):
    """The `FoundPair` of two features from x: one at which shells touch with a normal near n, or none."""
    f = feature_of(store, shells[0], codes[0])
    g = feature_of(store, shells[1], codes[1])
    status, y, frame = solve_features(store, f, g, pose, x, n, size, math.inf)
    touches = abs(frame.gap) <= NEARLY * size and dot(frame.normal, n) > 0.5
    return FoundPair((status == CONVERGED or status == SINGULAR) and touches, codes, y, frame.normal, frame.gap)


@kernel(inner=True, allocates=True)
def conforming_pair(store, shells, pose, size):
    """The pair at which two shells that have points in common touch along conforming faces.

    A body inside the other one's material is free too when it shrinks: there normals do not oppose each other, and no
    pair is found. The bodies are no deeper in each other than `NEARLY` times the size.
    """
    shell_f, shell_g = shells
    same = IDENTITY.rotation
    ways = np.empty((WAYS, 3))
    for side in range(2):
        center, reach = middle_of_faces(store, shell_g if side == 0 else shell_f)
        if not reach > 0.0:
            continue
        about = add(matvec(pose.rotation, center), pose.shift) if side == 0 else center
        part = NEARLY * size / reach
        larger = grown(pose, about, 1.0 - part if side == 0 else 1.0 / (1.0 - part))
        nearest = nearest_of_shells(store, shells, larger, size, ROUGH)
        x = nearest.x
        if nearest.status == CROSSING or nearest.codes[0] < 0:
            continue
        f, g = points_of(nearest.codes, x)
        p = tangents(store, feature_of(store, shell_f, f.code), IDENTITY, f.u, f.v)[0]
        q = tangents(store, feature_of(store, shell_g, g.code), larger, g.u, g.v)[0]
        d = sub(q, p)
        length = math.sqrt(dot(d, d))
        if not length > 0.0:
            continue
        n = scale(1.0 / length, d)
        if not leans(store, shell_f, f, same, n, size, ways) > 0.0:
            continue
        if not leans(store, shell_g, g, pose.rotation, n, size, ways) < 0.0:
            continue
        found = pair_from(store, shells, pose, nearest.codes, x, n, size)
        if not found.found:
            # Edges that lie on each other have no normal: the faces beside them do.
            f = face_beside(store, shell_f, f, same, n)
            g = face_beside(store, shell_g, g, pose.rotation, scale(-1.0, n))
            found = pair_from(store, shells, pose, (f.code, g.code), (f.u, f.v, g.u, g.v), n, size)
        if found.found:
            return found
    return FoundPair(False, (-1, -1), (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
