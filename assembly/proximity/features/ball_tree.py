"""A shell as a tree of balls that grows where a search looks: shell, features, groups of cells, cells, their parts.

A node is a row of doubles (`proximity/features/quadratic_model.py`) and a row of integers. The tree of the second shell
is grown in the axes of the first one.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import (
    CELL_SIZE,
    spline_curve_at,
    surface_at,
)
from assembly.geometry.vec import add, dot, matvec, scale, sub
from assembly.proximity.brep.records import (
    EDGE,
    EDGE_CELL_SIZE,
    EDGE_RECORD,
    FACE,
    FACE_RECORD,
    VERTEX,
    VERTEX_RECORD,
    edge_at,
    face_at,
    shell_at,
    vertex_at,
)
from assembly.proximity.features.edge_model import edge_model
from assembly.proximity.features.quadratic_model import (
    CENTER,
    LINEAR_U,
    LINEAR_V,
    face_model,
    get,
    model_at,
    put,
    vertex_model,
)

# The integers of a node.
CELL_NODE = record_dtype(
    "i8",
    level=1,  # WHOLE, PART, GROUP or CELL
    kind=1,  # its feature: FACE, EDGE or VERTEX,
    feature=1,  # its number
    record=1,  # and where its record is in the table
    child=1,  # its first child; -1: none yet
    children=1,  # how many
    side=1,  # of a face's cell, where it is from the trim: UNKNOWN, INSIDE, OUTSIDE or MIXED_SIDE
    has_model=1,  # 1: its quadratic model is made
)
cell_node_at = record_view(CELL_NODE)
LEVEL = place_of(CELL_NODE, "level")
KIND = place_of(CELL_NODE, "kind")
RECORD = place_of(CELL_NODE, "record")
HAS_MODEL = place_of(CELL_NODE, "has_model")
INFO = size_of(CELL_NODE)
# Levels.
WHOLE, PART, GROUP, CELL = 0, 1, 2, 3
# Where a cell is: not asked, all of it inside, all of it outside, neither.
UNKNOWN, INSIDE, OUTSIDE, MIXED_SIDE = 0, 1, 2, 3
# Cells a group.
TOGETHER = 8
# A box longer than this times its width is halved, not quartered.
SLENDER = 1.5
# Faces and edges of so many spans are looked at span by span; of more, by their cells.
SPANS = 4
# Room for parts of cells.
PARTS = 8192


# The cells of a feature. kind: FACE, EDGE or VERTEX; record: where its record is in the table; count: how many cells;
# pool: where they begin in the pool; stride: numbers of a cell; ball: where its ball is among them.
FeatureCells = namedtuple("FeatureCells", "kind record count pool stride ball")


@kernel(inner=True)
def feature_cells(table, shell, k):
    """The FeatureCells of feature k."""
    solid = shell_at(table, shell)
    faces = solid.faces
    edges = solid.edges
    if k < faces:
        record = solid.face_table + FACE_RECORD * k
        surface = surface_at(table, face_at(table, record).surface)
        return FeatureCells(FACE, record, surface.cell_count, surface.cells, CELL_SIZE, ball=5)
    if k < faces + edges:
        record = solid.edge_table + EDGE_RECORD * (k - faces)
        edge = edge_at(table, record)
        return FeatureCells(EDGE, record, edge.cell_count, edge.cells, EDGE_CELL_SIZE, ball=2)
    record = solid.vertex_table + VERTEX_RECORD * (k - faces - edges)
    return FeatureCells(VERTEX, record, 1, vertex_at(table, record).point, 3, ball=0)


@kernel(inner=True)
def room(store, shell):
    """How many nodes a shell's tree may need."""
    solid = shell_at(store.table, shell)
    features = solid.faces + solid.edges + solid.vertices
    count = 1 + features + PARTS
    for k in range(features):
        cells = feature_cells(store.table, shell, k).count
        count += cells + cells // TOGETHER + 1
    return count


@kernel(inline=True)
def new_node(info, i, level, kind, feature, record):
    cell = cell_node_at(info, i)
    cell.level = level
    cell.kind = kind
    cell.feature = feature
    cell.record = record
    cell.child = -1
    cell.children = 0
    cell.side = UNKNOWN
    cell.has_model = 0


@kernel(inner=True)
def ball_around(nodes, i, first, last):
    """The ball of node i around those of the nodes first to last - 1."""
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    for k in range(first, last):
        c = get(nodes, k, CENTER)
        r = model_at(nodes, k).radius
        lo = (min(lo[0], c[0] - r), min(lo[1], c[1] - r), min(lo[2], c[2] - r))
        hi = (max(hi[0], c[0] + r), max(hi[1], c[1] + r), max(hi[2], c[2] + r))
    center = scale(0.5, add(lo, hi))
    reach = 0.0
    for k in range(first, last):
        d = sub(get(nodes, k, CENTER), center)
        reach = max(reach, math.sqrt(dot(d, d)) + model_at(nodes, k).radius)
    put(nodes, i, CENTER, center)
    model_at(nodes, i).radius = reach + 4e-16 * (reach + abs(center[0]) + abs(center[1]) + abs(center[2]))


@kernel(inner=True)
def used_cell(store, record, kind, c):
    """Whether a cell is worth a look: not a face's outside of its trim."""
    face = face_at(store.table, record)
    if kind != FACE or face.trim < 0:
        return True
    return store.pool[face.cell_flags + c] != 0.0


@kernel(inner=True)
def plant(store, shell, pose, nodes, info):
    """The nodes of the shell and of its features. Returns the number of nodes."""
    cell = cell_node_at(info, 0)
    solid = shell_at(store.table, shell)
    features = solid.faces + solid.edges + solid.vertices
    new_node(info, 0, WHOLE, -1, -1, shell)
    cell.child = 1
    cell.children = features
    for k in range(features):
        own = feature_cells(store.table, shell, k)
        kind, record, cells, at, size, ball = own.kind, own.record, own.count, own.pool, own.stride, own.ball
        i = 1 + k
        model = model_at(nodes, i)
        new_node(info, i, PART, kind, k, record)
        if kind == VERTEX:
            cell_node_at(info, i).level = CELL
            point = add(matvec(pose.rotation, (store.pool[at], store.pool[at + 1], store.pool[at + 2])), pose.shift)
            put(nodes, i, CENTER, point)
            model.radius = 0.0
            continue
        lo = (math.inf, math.inf, math.inf)
        hi = (-math.inf, -math.inf, -math.inf)
        low_u = math.inf
        low_v = math.inf
        high_u = -math.inf
        high_v = -math.inf
        for c in range(cells):
            if used_cell(store, record, kind, c):
                o = at + size * c
                if kind == FACE:
                    low_u = min(low_u, store.pool[o] - store.pool[o + 9])
                    high_u = max(high_u, store.pool[o] + store.pool[o + 9])
                    low_v = min(low_v, store.pool[o + 1] - store.pool[o + 10])
                    high_v = max(high_v, store.pool[o + 1] + store.pool[o + 10])
                else:
                    low_u = min(low_u, store.pool[o])
                    high_u = max(high_u, store.pool[o + 1])
                    low_v = 0.0
                    high_v = 0.0
                o += ball
                r = store.pool[o + 3]
                lo = (
                    min(lo[0], store.pool[o] - r),
                    min(lo[1], store.pool[o + 1] - r),
                    min(lo[2], store.pool[o + 2] - r),
                )
                hi = (
                    max(hi[0], store.pool[o] + r),
                    max(hi[1], store.pool[o + 1] + r),
                    max(hi[2], store.pool[o + 2] + r),
                )
        model.u0 = 0.5 * (low_u + high_u)
        model.v0 = 0.5 * (low_v + high_v)
        model.half_u = 0.5 * (high_u - low_u)
        model.half_v = 0.5 * (high_v - low_v)
        x, y, z = scale(0.5, add(lo, hi))
        reach = 0.0
        for c in range(cells):
            if used_cell(store, record, kind, c):
                o = at + size * c + ball
                d = (store.pool[o] - x) ** 2 + (store.pool[o + 1] - y) ** 2 + (store.pool[o + 2] - z) ** 2
                reach = max(reach, math.sqrt(d) + store.pool[o + 3])
        center = add(matvec(pose.rotation, (x, y, z)), pose.shift)
        put(nodes, i, CENTER, center)
        model.radius = reach + 4e-16 * (reach + abs(center[0]) + abs(center[1]) + abs(center[2]))
    ball_around(nodes, 0, 1, 1 + features)
    return 1 + features


@kernel(inner=True)
def open_spans(store, nodes, info, i, count):
    """Pieces of one span each as cells of a feature that has few spans. Returns the number of nodes."""
    cell = cell_node_at(info, i)
    model = model_at(nodes, i)
    kind = cell.kind
    record = cell.record
    face = face_at(store.table, record)
    cell.child = count
    low_u = model.u0 - model.half_u
    high_u = model.u0 + model.half_u
    low_v = model.v0 - model.half_v
    high_v = model.v0 + model.half_v
    curve = spline_curve_at(store.table, edge_at(store.table, record).curve if kind == EDGE else -1)
    r = surface_at(store.table, face.surface if kind == FACE else -1)
    breaks_u = curve.breaks if kind == EDGE else r.breaks_u
    spans_u = curve.spans if kind == EDGE else r.spans_u
    spans_v = 1 if kind == EDGE else r.spans_v
    for iu in range(spans_u):
        u0 = max(store.pool[breaks_u + iu], low_u)
        u1 = min(store.pool[breaks_u + iu + 1], high_u)
        if not u0 < u1:
            continue
        for iv in range(spans_v):
            v0 = 0.0
            v1 = 0.0
            if kind == FACE:
                at = r.breaks_v + iv
                v0 = max(store.pool[at], low_v)
                v1 = min(store.pool[at + 1], high_v)
                if not v0 < v1:
                    continue
            new_node(info, count, CELL, kind, cell.feature, record)
            cell_node_at(info, count).side = UNKNOWN if kind == FACE and face.trim >= 0 else INSIDE
            model_at(nodes, count).u0 = 0.5 * (u0 + u1)
            model_at(nodes, count).v0 = 0.5 * (v0 + v1)
            model_at(nodes, count).half_u = 0.5 * (u1 - u0)
            model_at(nodes, count).half_v = 0.5 * (v1 - v0)
            put(nodes, count, CENTER, get(nodes, i, CENTER))
            model_at(nodes, count).radius = model.radius
            count += 1
    cell.children = count - cell.child
    return count


@kernel(inner=True)
def span_count(table, kind, record):
    """How many spans a face or an edge has."""
    if kind == FACE:
        r = surface_at(table, face_at(table, record).surface)
        return r.spans_u * r.spans_v
    return spline_curve_at(table, edge_at(table, record).curve).spans


@kernel(inner=True)
def open_feature(store, shell, pose, nodes, info, i, count):
    """Groups and cells of a feature. Returns the number of nodes."""
    cell = cell_node_at(info, i)
    own = feature_cells(store.table, shell, cell.feature)
    kind, record, cells, at, size, ball = own.kind, own.record, own.count, own.pool, own.stride, own.ball
    used = 0
    for c in range(cells):
        if used_cell(store, record, kind, c):
            used += 1
    groups = (used + TOGETHER - 1) // TOGETHER
    first = count + groups
    j = first
    for c in range(cells):
        if not used_cell(store, record, kind, c):
            continue
        o = at + size * c
        new_node(info, j, CELL, kind, cell.feature, record)
        put(
            nodes,
            j,
            CENTER,
            add(
                matvec(pose.rotation, (store.pool[o + ball], store.pool[o + ball + 1], store.pool[o + ball + 2])),
                pose.shift,
            ),
        )
        model_at(nodes, j).radius = store.pool[o + ball + 3]
        if kind == FACE:
            model_at(nodes, j).u0 = store.pool[o]
            model_at(nodes, j).v0 = store.pool[o + 1]
            model_at(nodes, j).half_u = store.pool[o + 9]
            model_at(nodes, j).half_v = store.pool[o + 10]
            if face_at(store.table, record).trim < 0:
                cell_node_at(info, j).side = INSIDE
        else:
            model_at(nodes, j).u0 = 0.5 * (store.pool[o] + store.pool[o + 1])
            model_at(nodes, j).v0 = 0.0
            model_at(nodes, j).half_u = 0.5 * (store.pool[o + 1] - store.pool[o])
            model_at(nodes, j).half_v = 0.0
            cell_node_at(info, j).side = INSIDE
        j += 1
    for k in range(groups):
        g = count + k
        cell_node = cell_node_at(info, g)
        new_node(info, g, GROUP, kind, cell.feature, record)
        cell_node.child = first + TOGETHER * k
        cell_node.children = min(TOGETHER, used - TOGETHER * k)
        ball_around(nodes, g, cell_node.child, cell_node.child + cell_node.children)
    cell.child = count
    cell.children = groups
    return first + used


@kernel(inner=True)
def give_model(store, pose, nodes, info, i, work):
    """See to it that a cell has its model."""
    cell = cell_node_at(info, i)
    if cell.has_model == 1:
        return
    cell.has_model = 1
    record = cell.record
    if cell.kind == FACE:
        face_model(store, face_at(store.table, record).surface, pose, nodes, i, work)
    elif cell.kind == EDGE:
        edge_model(store, record, pose, nodes, i, work)
    else:
        vertex_model(store.pool, vertex_at(store.table, record).point, pose, nodes, i)


@kernel(inner=True)
def split_cell(nodes, info, i, count):
    """Two or four parts of a cell that has its model. Returns the number of nodes."""
    cell = cell_node_at(info, i)
    model = model_at(nodes, i)
    p = get(nodes, i, LINEAR_U)
    q = get(nodes, i, LINEAR_V)
    uu = dot(p, p)
    vv = dot(q, q)
    is_edge = cell.kind == EDGE
    in_u = is_edge or SLENDER * SLENDER * uu >= vv
    in_v = not is_edge and SLENDER * SLENDER * vv >= uu
    cell.child = count
    parts_u = 2 if in_u else 1
    parts_v = 2 if in_v else 1
    half_u = model.half_u / parts_u
    half_v = model.half_v / parts_v
    for a in range(parts_u):
        for b in range(parts_v):
            new_node(info, count, CELL, cell.kind, cell.feature, cell.record)
            cell_node_at(info, count).side = UNKNOWN if cell.side == MIXED_SIDE else cell.side
            model_at(nodes, count).u0 = model.u0 + (2 * a + 1 - parts_u) * half_u
            model_at(nodes, count).v0 = model.v0 + (2 * b + 1 - parts_v) * half_v
            model_at(nodes, count).half_u = half_u
            model_at(nodes, count).half_v = half_v
            put(nodes, count, CENTER, get(nodes, i, CENTER))
            model_at(nodes, count).radius = model.radius
            count += 1
    cell.children = parts_u * parts_v
    return count


@kernel(inner=True)
def grow(store, shell, pose, nodes, info, i, count):
    """See to it that a node has children, cells yet without their models. Returns the number of nodes."""
    cell = cell_node_at(info, i)
    if cell.child >= 0 or cell.kind == VERTEX:
        return count
    if cell.level == PART:
        if span_count(store.table, cell.kind, cell.record) <= SPANS:
            return open_spans(store, nodes, info, i, count)
        return open_feature(store, shell, pose, nodes, info, i, count)
    return split_cell(nodes, info, i, count)
