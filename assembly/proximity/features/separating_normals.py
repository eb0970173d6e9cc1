"""Directions in which two B-rep bodies may come apart where they meet: the normals of the faces there.

At a point of a face that is the face's normal; at a point of an edge, or of a face on its boundary, those of both
faces there; at a vertex those of all faces around it. Normals of g are reversed. Where one direction leads into all of
these faces at once, the solids overlap there.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_at
from assembly.geometry.vec import add, cross, dot, matvec, scale, sub
from assembly.kinematics.motion import IDENTITY, RelativePose
from assembly.proximity.brep.apexes import unit
from assembly.proximity.brep.borders import edge_end, feature_kind, nearest_edge, on_surface, other_parameter
from assembly.proximity.brep.records import (
    EDGE,
    EDGE_RECORD,
    FACE,
    FACE_RECORD,
    VERTEX_RECORD,
    Feature,
    edge_at,
    face_at,
    shell_at,
    vertex_at,
)
from assembly.proximity.extrema.crossing import tangents
from assembly.proximity.extrema.feature_jets import edge_jet

# The most directions kept; the cosine above which two of them count as one.
WAYS, ALIKE = 32, 1.0 - 1e-9
# A point of a face nearer to its boundary than this part of the size is on it.
BORDER = 1e-9
# A direction leads into a face if its cosine with the face's outward normal is below minus this.
INTO = 0.05


# A point of a feature, by the feature's number and its coordinates.
FeaturePoint = namedtuple("FeaturePoint", "code u v")


@kernel(inline=True)
def points_of(codes, x):
    """The `FeaturePoint` of either feature of a pair."""
    return FeaturePoint(codes[0], x[0], x[1]), FeaturePoint(codes[1], x[2], x[3])


@kernel(inline=True)
def way_at(ways, k):
    """Way k."""
    return (ways[k, 0], ways[k, 1], ways[k, 2])


@kernel(inline=True)
def sum_of(ways, count):
    """The sum of so many ways."""
    total = (0.0, 0.0, 0.0)
    for k in range(count):
        total = add(total, way_at(ways, k))
    return total


@kernel(inner=True)
def add_way(n, ways, count):
    """Add a direction, unless it is zero or known, or memory is full. Returns how many there are then."""
    n = unit(n)
    if count == ways.shape[0] or not dot(n, n) > 0.5:
        return count
    for k in range(count):
        if dot(n, way_at(ways, k)) > ALIKE:
            return count
    ways[count, 0], ways[count, 1], ways[count, 2] = n
    return count + 1


@kernel(inner=True)
def add_edge_ways(store, edge, t, turn, side, ways, count):
    """The normals of the faces that meet in an edge, at t; turned, times `side`."""
    edge_record = edge_at(store.table, edge)
    surface = edge_record.surface
    if surface < 0:
        return count
    on_edge = on_surface(store, surface, edge_record.curve, t)
    p, n = on_edge.point, on_edge.normal
    count = add_way(scale(side * float(surface_at(store.table, surface).sign), matvec(turn, n)), ways, count)
    if edge_record.face_b >= 0:
        surface = edge_record.surface_b
        s = other_parameter(store, edge, t, p)
        on_edge = on_surface(store, surface, edge_record.curve_b, s)
        n = on_edge.normal
        count = add_way(scale(side * float(surface_at(store.table, surface).sign), matvec(turn, n)), ways, count)
    return count


@kernel(inner=True)
def add_ways(store, shell, at, turn, side, size, ways, count):
    """The normals of the faces at a `FeaturePoint`; turned, times `side`. How many ways there are then."""
    code, u, v = at
    solid = shell_at(store.table, shell)
    kind = feature_kind(store.table, shell, code)
    faces, edges = solid.faces, solid.edges
    if kind == FACE:
        face = face_at(store.table, solid.face_table + FACE_RECORD * code)
        p, su, sv = tangents(store, Feature(FACE, face.surface), RelativePose(turn, (0.0, 0.0, 0.0)), u, v)
        sign = float(surface_at(store.table, face.surface).sign)
        count = add_way(scale(side * sign, cross(su, sv)), ways, count)
        if face.trim >= 0:
            code, found = nearest_edge(store, shell, code, u, v)
            edge = solid.edge_table + EDGE_RECORD * (code - faces)
            d = sub(matvec(turn, edge_jet(store, edge, found[0])[0]), p)
            if dot(d, d) <= BORDER * BORDER * size * size:
                count = add_edge_ways(store, edge, found[0], turn, side, ways, count)
        return count
    if kind == EDGE:
        edge = solid.edge_table + EDGE_RECORD * (code - faces)
        return add_edge_ways(store, edge, u, turn, side, ways, count)
    vertex = vertex_at(store.table, solid.vertex_table + VERTEX_RECORD * (code - faces - edges))
    for k in range(vertex.edges):
        entry = vertex.edge_list + 2 * k
        edge = solid.edge_table + EDGE_RECORD * store.table[entry]
        t = edge_end(store, edge, store.table[entry + 1])
        count = add_edge_ways(store, edge, t, turn, side, ways, count)
    return count


@kernel(inner=True)
def add_end_ways(store, shell, at, turn, side, size, ways, count):
    """The normals of the faces at both ends of an edge, or of the edge of a face that is nearest to a point of it."""
    code, u, v = at
    solid = shell_at(store.table, shell)
    kind = feature_kind(store.table, shell, code)
    faces, edges = solid.faces, solid.edges
    if kind == FACE and face_at(store.table, solid.face_table + FACE_RECORD * code).trim >= 0:
        code = nearest_edge(store, shell, code, u, v)[0]
        kind = EDGE
    if kind == EDGE:
        edge = edge_at(store.table, solid.edge_table + EDGE_RECORD * (code - faces))
        for end in (edge.start, edge.end):
            if end >= 0:
                vertex = FeaturePoint(faces + edges + end, 0.0, 0.0)
                count = add_ways(store, shell, vertex, turn, side, size, ways, count)
    return count


@kernel(inner=True)
def is_open(table, shell):
    """Whether a body has edges with one face only, so that it has no inside."""
    solid = shell_at(table, shell)
    for k in range(solid.edges):
        if edge_at(table, solid.edge_table + EDGE_RECORD * k).face_b < 0:
            return True
    return False


@kernel(inner=True)
def overlap_at(store, shells, turn, codes, x, size, ways):
    """Whether solids that meet at x of features f and g have insides in common there, as where faces are flush.

    Only the direction against the sum of all normals is tried: False proves nothing, nor does it tell of other places.
    """
    if is_open(store.table, shells[0]) or is_open(store.table, shells[1]):
        return False
    f, g = points_of(codes, x)
    if add_ways(store, shells[1], g, turn, 1.0, size, ways, 0) == 0:
        # An apex has no normal.
        return False
    count = add_ways(store, shells[0], f, IDENTITY.rotation, 1.0, size, ways, 0)
    if count == 0:
        return False
    count = add_ways(store, shells[1], g, turn, 1.0, size, ways, count)
    if count == ways.shape[0]:
        return False
    total = unit(sum_of(ways, count))
    for k in range(count):
        if not dot(total, way_at(ways, k)) > INTO:
            return False
    return True
