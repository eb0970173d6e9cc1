"""A B-rep body as a tree of balls that grows where a search goes: body, features, groups of cells, cells, their parts.

A node is a row of doubles (`proximity/features/quadratic_model.py`) and a row of integers. The tree of the second body
is grown in the axes of the first one.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
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
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.features.edge_model import edge_model
from assembly.proximity.features.quadratic_model import NODE, Box, face_model, model_at, put, vertex_model

# The integers of a node.
CELL_NODE = record_dtype(
    "i8",
    level=1,  # WHOLE, PART, GROUP or CELL
    kind=1,  # of its feature: FACE, EDGE or VERTEX
    feature=1,  # number of the feature
    record=1,  # where the record of the feature is in the table
    child=1,  # its first child; -1: none yet
    children=1,  # how many
    side=1,  # of a face's cell, on which side of the trim it is: UNKNOWN, INSIDE, OUTSIDE or MIXED_SIDE
    has_model=1,  # 1: its quadratic model is made
)
cell_node_at = record_view(CELL_NODE)
INFO = size_of(CELL_NODE)
# Levels.
WHOLE, PART, GROUP, CELL = 0, 1, 2, 3
# On which side of the trim a cell is: not tested yet, all of it inside, all of it outside, on both.
UNKNOWN, INSIDE, OUTSIDE, MIXED_SIDE = 0, 1, 2, 3
# Cells per group.
TOGETHER = 8
# A box longer than this times its width is halved, not quartered.
SLENDER = 1.5
# Faces and edges of at most so many spans are split into spans, those of more into their cells.
SPANS = 4
# Memory for so many parts of cells.
PARTS = 8192


# A tree. shell: its record; pose: where it stands; nodes: a QUADRATIC_MODEL a row; info: a CELL_NODE a row; used: how
# many nodes there are, one number; work: memory for coefficients.
BallTree = namedtuple("BallTree", "shell pose nodes info used work")
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
def workspace(store, shell):
    """How many nodes a shell's tree may need."""
    solid = shell_at(store.table, shell)
    features = solid.faces + solid.edges + solid.vertices
    count = 1 + features + PARTS
    for k in range(features):
        cells = feature_cells(store.table, shell, k).count
        count += cells + cells // TOGETHER + 1
    return count


@kernel(inline=True)
def cell_in(tree, i):
    """The CELL_NODE of node i."""
    return cell_node_at(tree.info, i)


@kernel(inline=True)
def model_in(tree, i):
    """The QUADRATIC_MODEL of node i."""
    return model_at(tree.nodes, i)


@kernel(inline=True)
def new_node(tree, i, level, kind, feature, record):
    """Node i, without children."""
    cell = cell_in(tree, i)
    cell.level = level
    cell.kind = kind
    cell.feature = feature
    cell.record = record
    cell.child = -1
    cell.children = 0
    cell.side = UNKNOWN
    cell.has_model = 0
    return cell


@kernel(inline=True)
def set_box(model, u, v, half_u, half_v):
    model.u0 = u
    model.v0 = v
    model.half_u = half_u
    model.half_v = half_v


@kernel(inner=True)
def add_cell(tree, i, side, box):
    """A new node: a cell of the feature of node i, over a box, with the ball of node i."""
    cell, parent = cell_in(tree, i), model_in(tree, i)
    new_node(tree, tree.used[0], CELL, cell.kind, cell.feature, cell.record).side = side
    model = model_in(tree, tree.used[0])
    set_box(model, box.u, box.v, box.half_u, box.half_v)
    put(model.center, three_of(parent.center))
    model.radius = parent.radius
    cell.children += 1
    tree.used[0] += 1


@kernel(inline=True)
def set_ball(model, center, reach):
    """Write a ball, its radius enlarged by rounding errors."""
    put(model.center, center)
    model.radius = reach + 4e-16 * (reach + abs(center[0]) + abs(center[1]) + abs(center[2]))


@kernel(inner=True)
def ball_around(nodes, i, first, last):
    """The ball of node i around those of the nodes first to last - 1."""
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    for k in range(first, last):
        c = three_of(model_at(nodes, k).center)
        r = model_at(nodes, k).radius
        lo = (min(lo[0], c[0] - r), min(lo[1], c[1] - r), min(lo[2], c[2] - r))
        hi = (max(hi[0], c[0] + r), max(hi[1], c[1] + r), max(hi[2], c[2] + r))
    center = scale(0.5, add(lo, hi))
    reach = 0.0
    for k in range(first, last):
        d = sub(model_at(nodes, k).center, center)
        reach = max(reach, math.sqrt(dot(d, d)) + model_at(nodes, k).radius)
    set_ball(model_at(nodes, i), center, reach)


@kernel(inner=True)
def used_cell(store, record, kind, c):
    """Whether a cell is used: a face's cell outside the trim is not."""
    face = face_at(store.table, record)
    if kind != FACE or face.trim < 0:
        return True
    return store.pool[face.cell_flags + c] != 0.0


@kernel(inner=True, allocates=True)
def plant(store, shell, pose):
    """A new `BallTree` with the node of a B-rep body and those of its features."""
    most = workspace(store, shell)
    tree = BallTree(
        shell=shell,
        pose=pose,
        nodes=np.empty((most, NODE)),
        info=np.empty((most, INFO), np.int64),
        used=np.empty(1, np.int64),
        work=np.empty((4, 16, 16)),
    )
    solid = shell_at(store.table, shell)
    features = solid.faces + solid.edges + solid.vertices
    root = new_node(tree, 0, WHOLE, -1, -1, shell)
    root.child = 1
    root.children = features
    for k in range(features):
        plant_feature(store, tree, k)
    ball_around(tree.nodes, 0, 1, 1 + features)
    tree.used[0] = 1 + features
    return tree


@kernel(inner=True)
def plant_feature(store, tree, k):
    """The node of feature k, with the ball around its cells and, for a face or an edge, the box of their parameters."""
    pose = tree.pose
    kind, record, cells, at, size, ball = feature_cells(store.table, tree.shell, k)
    model = model_in(tree, 1 + k)
    new_node(tree, 1 + k, CELL if kind == VERTEX else PART, kind, k, record)
    if kind == VERTEX:
        point = (store.pool[at], store.pool[at + 1], store.pool[at + 2])
        put(model.center, add(matvec(pose.rotation, point), pose.shift))
        model.radius = 0.0
        return
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
    set_box(model, 0.5 * (low_u + high_u), 0.5 * (low_v + high_v), 0.5 * (high_u - low_u), 0.5 * (high_v - low_v))
    x, y, z = scale(0.5, add(lo, hi))
    reach = 0.0
    for c in range(cells):
        if used_cell(store, record, kind, c):
            o = at + size * c + ball
            d = (store.pool[o] - x) ** 2 + (store.pool[o + 1] - y) ** 2 + (store.pool[o + 2] - z) ** 2
            reach = max(reach, math.sqrt(d) + store.pool[o + 3])
    set_ball(model, add(matvec(pose.rotation, (x, y, z)), pose.shift), reach)


@kernel(inner=True)
def open_spans(store, tree, i):
    """Make the cells of a feature that has few spans: one per span."""
    cell, model = cell_in(tree, i), model_in(tree, i)
    is_edge = cell.kind == EDGE
    face = face_at(store.table, cell.record)
    cell.child = tree.used[0]
    low_u = model.u0 - model.half_u
    high_u = model.u0 + model.half_u
    low_v = model.v0 - model.half_v
    high_v = model.v0 + model.half_v
    curve = spline_curve_at(store.table, edge_at(store.table, cell.record).curve if is_edge else -1)
    r = surface_at(store.table, -1 if is_edge else face.surface)
    breaks_u = curve.breaks if is_edge else r.breaks_u
    spans_u = curve.spans if is_edge else r.spans_u
    spans_v = 1 if is_edge else r.spans_v
    side = UNKNOWN if not is_edge and face.trim >= 0 else INSIDE
    for iu in range(spans_u):
        u0 = max(store.pool[breaks_u + iu], low_u)
        u1 = min(store.pool[breaks_u + iu + 1], high_u)
        if not u0 < u1:
            continue
        for iv in range(spans_v):
            v0 = 0.0
            v1 = 0.0
            if not is_edge:
                at = r.breaks_v + iv
                v0 = max(store.pool[at], low_v)
                v1 = min(store.pool[at + 1], high_v)
                if not v0 < v1:
                    continue
            add_cell(tree, i, side, Box(0.5 * (u0 + u1), 0.5 * (v0 + v1), 0.5 * (u1 - u0), 0.5 * (v1 - v0)))


@kernel(inner=True)
def span_count(table, kind, record):
    """How many spans a face or an edge has."""
    if kind == FACE:
        r = surface_at(table, face_at(table, record).surface)
        return r.spans_u * r.spans_v
    return spline_curve_at(table, edge_at(table, record).curve).spans


@kernel(inner=True)
def open_feature(store, tree, i):
    """Make the groups and cells of a feature."""
    pose, cell = tree.pose, cell_in(tree, i)
    kind, record, cells, at, size, ball = feature_cells(store.table, tree.shell, cell.feature)
    used = 0
    for c in range(cells):
        if used_cell(store, record, kind, c):
            used += 1
    groups = (used + TOGETHER - 1) // TOGETHER
    cell.child = tree.used[0]
    cell.children = groups
    first = cell.child + groups
    j = first
    for c in range(cells):
        if not used_cell(store, record, kind, c):
            continue
        o = at + size * c
        p = o + ball
        part, model = new_node(tree, j, CELL, kind, cell.feature, record), model_in(tree, j)
        center = (store.pool[p], store.pool[p + 1], store.pool[p + 2])
        put(model.center, add(matvec(pose.rotation, center), pose.shift))
        model.radius = store.pool[p + 3]
        if kind == FACE:
            set_box(model, store.pool[o], store.pool[o + 1], store.pool[o + 9], store.pool[o + 10])
        else:
            middle, half = 0.5 * (store.pool[o] + store.pool[o + 1]), 0.5 * (store.pool[o + 1] - store.pool[o])
            set_box(model, middle, 0.0, half, 0.0)
        part.side = UNKNOWN if kind == FACE and face_at(store.table, record).trim >= 0 else INSIDE
        j += 1
    for k in range(groups):
        group = new_node(tree, cell.child + k, GROUP, kind, cell.feature, record)
        group.child = first + TOGETHER * k
        group.children = min(TOGETHER, used - TOGETHER * k)
        ball_around(tree.nodes, cell.child + k, group.child, group.child + group.children)
    tree.used[0] = first + used


@kernel(inline=True)
def is_tree_full(tree):
    """Whether there is no memory for the parts of another cell."""
    return tree.used[0] + 160 > tree.nodes.shape[0]


@kernel(inner=True)
def give_model(store, tree, i):
    """Make the model of a cell, unless it has one."""
    cell, model = cell_in(tree, i), model_in(tree, i)
    if cell.has_model == 1:
        return
    cell.has_model = 1
    record = cell.record
    if cell.kind == FACE:
        face_model(store, face_at(store.table, record).surface, tree.pose, model, tree.work)
    elif cell.kind == EDGE:
        edge_model(store, record, tree.pose, model, tree.work)
    else:
        vertex_model(store.pool, vertex_at(store.table, record).point, tree.pose, model)


@kernel(inner=True)
def split_cell(tree, i):
    """Make two or four parts of a cell that has its model."""
    cell, model = cell_in(tree, i), model_in(tree, i)
    uu = dot(model.linear_u, model.linear_u)
    vv = dot(model.linear_v, model.linear_v)
    is_edge = cell.kind == EDGE
    in_u = is_edge or SLENDER * SLENDER * uu >= vv
    in_v = not is_edge and SLENDER * SLENDER * vv >= uu
    cell.child = tree.used[0]
    parts_u = 2 if in_u else 1
    parts_v = 2 if in_v else 1
    half_u = model.half_u / parts_u
    half_v = model.half_v / parts_v
    side = UNKNOWN if cell.side == MIXED_SIDE else cell.side
    for a in range(parts_u):
        for b in range(parts_v):
            u = model.u0 + (2 * a + 1 - parts_u) * half_u
            v = model.v0 + (2 * b + 1 - parts_v) * half_v
            add_cell(tree, i, side, Box(u, v, half_u, half_v))


@kernel(inner=True)
def grow(store, tree, i):
    """Make the children of a node, unless it has some; new cells have no models yet. Returns its CELL_NODE."""
    cell = cell_in(tree, i)
    if cell.child < 0 and cell.kind != VERTEX:
        if cell.level != PART:
            split_cell(tree, i)
        elif span_count(store.table, cell.kind, cell.record) <= SPANS:
            open_spans(store, tree, i)
        else:
            open_feature(store, tree, i)
    return cell
