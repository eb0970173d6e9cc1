"""Ways in which two shells may come apart from where they meet: the normals of the faces there.

At a point of a face that is its normal, of an edge, or on the border of a face, those of its two faces, of a vertex
those of all faces around it; of g they are turned back. Where one direction leads into all of these faces at once, the
solids overlap there.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_at
from assembly.geometry.vec import add, cross, dot, matvec, scale, sub
from assembly.kinematics.motion import RelativePose
from assembly.proximity.brep.apexes import unit
from assembly.proximity.brep.borders import edge_end, feature_kind, nearest_edge, on_surface, other_parameter
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
from assembly.proximity.extrema.crossing import tangents
from assembly.proximity.extrema.feature_jets import edge_jet

# Room for ways; cosine of the angle below which two are one.
WAYS, ALIKE = 32, 1.0 - 1e-9
# A point of a face this near to its border, in parts of the size, is on it.
BORDER = 1e-9
# A direction leads into a face that leans from its normal by a cosine below minus this.
INTO = 0.05


@kernel(inner=True)
def add_way(n, ways, count):
    """Add a direction, if it is one and not among the ways yet; how many there are then."""
    n = unit(n)
    if count == ways.shape[0] or not dot(n, n) > 0.5:
        return count
    for k in range(count):
        if dot(n, (ways[k, 0], ways[k, 1], ways[k, 2])) > ALIKE:
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
def add_ways(store, shell, code, u, v, turn, side, size, ways, count):
    """The normals of the faces at a point (u, v) of a feature; turned, times `side`. How many ways there are then."""
    solid = shell_at(store.table, shell)
    kind = feature_kind(store.table, shell, code)
    faces, edges = solid.faces, solid.edges
    if kind == FACE:
        record = solid.face_table + FACE_RECORD * code
        face = face_at(store.table, record)
        p, su, sv = tangents(store, FACE, record, RelativePose(turn, (0.0, 0.0, 0.0)), u, v)
        sign = float(surface_at(store.table, face.surface).sign)
        count = add_way(scale(side * sign, cross(su, sv)), ways, count)
        if face.trim >= 0:
            code, at = nearest_edge(store, shell, code, u, v)
            edge = solid.edge_table + EDGE_RECORD * (code - faces)
            d = sub(matvec(turn, edge_jet(store, edge, at[0])[0]), p)
            if dot(d, d) <= BORDER * BORDER * size * size:
                count = add_edge_ways(store, edge, at[0], turn, side, ways, count)
        return count
    if kind == EDGE:
        edge = solid.edge_table + EDGE_RECORD * (code - faces)
        return add_edge_ways(store, edge, u, turn, side, ways, count)
    vertex = vertex_at(store.table, solid.vertex_table + VERTEX_RECORD * (code - faces - edges))
    for k in range(vertex.edges):
        at = vertex.edge_list + 2 * k
        edge = solid.edge_table + EDGE_RECORD * store.table[at]
        t = edge_end(store, edge, store.table[at + 1])
        count = add_edge_ways(store, edge, t, turn, side, ways, count)
    return count


@kernel(inner=True)
def add_end_ways(store, shell, code, u, v, turn, side, size, ways, count):
    """The normals of the faces at both ends of an edge, or of the edge of a face that is nearest to (u, v)."""
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
                count = add_ways(store, shell, faces + edges + end, 0.0, 0.0, turn, side, size, ways, count)
    return count


@kernel(inner=True)
def is_open(table, shell):
    """Whether a shell has edges of one face: it has no inside."""
    solid = shell_at(table, shell)
    for k in range(solid.edges):
        if edge_at(table, solid.edge_table + EDGE_RECORD * k).face_b < 0:
            return True
    return False


@kernel(inner=True)
def overlap_at(store, shell_f, shell_g, turn, f, g, x, size, ways):
    """Whether solids that meet at x of features f and g have insides in common there, as where faces are flush.

    One direction is tried, against the sum of all normals. False is not certain, nor of what overlaps elsewhere.
    """
    if is_open(store.table, shell_f) or is_open(store.table, shell_g):
        return False
    same = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    if add_ways(store, shell_g, g, x[2], x[3], turn, 1.0, size, ways, 0) == 0:
        # A tip has no normal.
        return False
    count = add_ways(store, shell_f, f, x[0], x[1], same, 1.0, size, ways, 0)
    if count == 0:
        return False
    count = add_ways(store, shell_g, g, x[2], x[3], turn, 1.0, size, ways, count)
    if count == ways.shape[0]:
        return False
    total = (0.0, 0.0, 0.0)
    for k in range(count):
        total = add(total, (ways[k, 0], ways[k, 1], ways[k, 2]))
    total = unit(total)
    for k in range(count):
        if not dot(total, (ways[k, 0], ways[k, 1], ways[k, 2])) > INTO:
            return False
    return True
