"""A shell as a tree of balls that grows where a search looks: shell, features, groups of cells, cells, their parts.

A node is a row of doubles (`proximity/features/quadratic_model.py`) and a row of integers. The tree of the second shell
is grown in the axes of the first one.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import (
    BREAKS_U,
    BREAKS_V,
    CELL_COUNT,
    CELL_SIZE,
    CELLS,
    CURVE_BREAKS,
    CURVE_SPANS,
    SPANS_U,
    SPANS_V,
)
from assembly.geometry.vec import add, dot, matvec, scale, sub
from assembly.proximity.brep.records import (
    EDGE,
    EDGE_CELL_COUNT,
    EDGE_CELL_SIZE,
    EDGE_CELLS,
    EDGE_CURVE,
    EDGE_RECORD,
    EDGE_TABLE,
    EDGES,
    FACE,
    FACE_CELL_FLAGS,
    FACE_RECORD,
    FACE_SURFACE,
    FACE_TABLE,
    FACE_TRIM,
    FACES,
    VERTEX,
    VERTEX_POINT,
    VERTEX_RECORD,
    VERTEX_TABLE,
    VERTICES,
)
from assembly.proximity.features.edge_model import edge_model
from assembly.proximity.features.quadratic_model import (
    CENTER,
    HALF_U,
    HALF_V,
    LINEAR_U,
    LINEAR_V,
    RADIUS,
    U0,
    V0,
    face_model,
    get,
    put,
    vertex_model,
)

# Integers of a node: what it is, its feature's kind, number and record, its children (-1: none yet), how many; of a
# face's cell where it is from the trim; whether it has its model.
LEVEL, KIND, FEATURE, RECORD, CHILD, CHILDREN, SIDE, HAS_MODEL, INFO = 0, 1, 2, 3, 4, 5, 6, 7, 8
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


@kernel(inner=True)
def feature_cells(table, shell, k):
    """Kind and record of feature k, how many cells it has, where in the pool, how long a row, and where its ball is."""
    faces = table[shell + FACES]
    edges = table[shell + EDGES]
    if k < faces:
        record = table[shell + FACE_TABLE] + FACE_RECORD * k
        surface = table[record + FACE_SURFACE]
        return FACE, record, table[surface + CELL_COUNT], table[surface + CELLS], CELL_SIZE, 5
    if k < faces + edges:
        record = table[shell + EDGE_TABLE] + EDGE_RECORD * (k - faces)
        return EDGE, record, table[record + EDGE_CELL_COUNT], table[record + EDGE_CELLS], EDGE_CELL_SIZE, 2
    record = table[shell + VERTEX_TABLE] + VERTEX_RECORD * (k - faces - edges)
    return VERTEX, record, 1, table[record + VERTEX_POINT], 3, 0


@kernel(inner=True)
def room(table, pool, shell):
    """How many nodes a shell's tree may need."""
    features = table[shell + FACES] + table[shell + EDGES] + table[shell + VERTICES]
    count = 1 + features + PARTS
    for k in range(features):
        cells = feature_cells(table, shell, k)[2]
        count += cells + cells // TOGETHER + 1
    return count


@kernel(inline=True)
def new_node(info, i, level, kind, feature, record):
    info[i, LEVEL] = level
    info[i, KIND] = kind
    info[i, FEATURE] = feature
    info[i, RECORD] = record
    info[i, CHILD] = -1
    info[i, CHILDREN] = 0
    info[i, SIDE] = UNKNOWN
    info[i, HAS_MODEL] = 0


@kernel(inner=True)
def ball_around(nodes, i, first, last):
    """The ball of node i around those of the nodes first to last - 1."""
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    for k in range(first, last):
        c = get(nodes, k, CENTER)
        r = nodes[k, RADIUS]
        lo = (min(lo[0], c[0] - r), min(lo[1], c[1] - r), min(lo[2], c[2] - r))
        hi = (max(hi[0], c[0] + r), max(hi[1], c[1] + r), max(hi[2], c[2] + r))
    center = scale(0.5, add(lo, hi))
    reach = 0.0
    for k in range(first, last):
        d = sub(get(nodes, k, CENTER), center)
        reach = max(reach, math.sqrt(dot(d, d)) + nodes[k, RADIUS])
    put(nodes, i, CENTER, center)
    nodes[i, RADIUS] = reach + 4e-16 * (reach + abs(center[0]) + abs(center[1]) + abs(center[2]))


@kernel(inner=True)
def used_cell(table, pool, record, kind, c):
    """Whether a cell is worth a look: not a face's outside of its trim."""
    if kind != FACE or table[record + FACE_TRIM] < 0:
        return True
    return pool[table[record + FACE_CELL_FLAGS] + c] != 0.0


@kernel(inner=True)
def plant(table, pool, shell, turn, shift, nodes, info):
    """The nodes of the shell and of its features. Returns the number of nodes."""
    features = table[shell + FACES] + table[shell + EDGES] + table[shell + VERTICES]
    new_node(info, 0, WHOLE, -1, -1, shell)
    info[0, CHILD] = 1
    info[0, CHILDREN] = features
    for k in range(features):
        kind, record, cells, at, size, ball = feature_cells(table, shell, k)
        i = 1 + k
        new_node(info, i, PART, kind, k, record)
        if kind == VERTEX:
            info[i, LEVEL] = CELL
            point = add(matvec(turn, (pool[at], pool[at + 1], pool[at + 2])), shift)
            put(nodes, i, CENTER, point)
            nodes[i, RADIUS] = 0.0
            continue
        lo = (math.inf, math.inf, math.inf)
        hi = (-math.inf, -math.inf, -math.inf)
        low_u = math.inf
        low_v = math.inf
        high_u = -math.inf
        high_v = -math.inf
        for c in range(cells):
            if used_cell(table, pool, record, kind, c):
                o = at + size * c
                if kind == FACE:
                    low_u = min(low_u, pool[o] - pool[o + 9])
                    high_u = max(high_u, pool[o] + pool[o + 9])
                    low_v = min(low_v, pool[o + 1] - pool[o + 10])
                    high_v = max(high_v, pool[o + 1] + pool[o + 10])
                else:
                    low_u = min(low_u, pool[o])
                    high_u = max(high_u, pool[o + 1])
                    low_v = 0.0
                    high_v = 0.0
                o += ball
                r = pool[o + 3]
                lo = (min(lo[0], pool[o] - r), min(lo[1], pool[o + 1] - r), min(lo[2], pool[o + 2] - r))
                hi = (max(hi[0], pool[o] + r), max(hi[1], pool[o + 1] + r), max(hi[2], pool[o + 2] + r))
        nodes[i, U0] = 0.5 * (low_u + high_u)
        nodes[i, V0] = 0.5 * (low_v + high_v)
        nodes[i, HALF_U] = 0.5 * (high_u - low_u)
        nodes[i, HALF_V] = 0.5 * (high_v - low_v)
        x, y, z = scale(0.5, add(lo, hi))
        reach = 0.0
        for c in range(cells):
            if used_cell(table, pool, record, kind, c):
                o = at + size * c + ball
                d = (pool[o] - x) ** 2 + (pool[o + 1] - y) ** 2 + (pool[o + 2] - z) ** 2
                reach = max(reach, math.sqrt(d) + pool[o + 3])
        center = add(matvec(turn, (x, y, z)), shift)
        put(nodes, i, CENTER, center)
        nodes[i, RADIUS] = reach + 4e-16 * (reach + abs(center[0]) + abs(center[1]) + abs(center[2]))
    ball_around(nodes, 0, 1, 1 + features)
    return 1 + features


@kernel(inner=True)
def open_spans(table, pool, nodes, info, i, count):
    """Pieces of one span each as cells of a feature that has few spans. Returns the number of nodes."""
    kind = info[i, KIND]
    record = info[i, RECORD]
    info[i, CHILD] = count
    low_u = nodes[i, U0] - nodes[i, HALF_U]
    high_u = nodes[i, U0] + nodes[i, HALF_U]
    low_v = nodes[i, V0] - nodes[i, HALF_V]
    high_v = nodes[i, V0] + nodes[i, HALF_V]
    curve = table[record + EDGE_CURVE] if kind == EDGE else -1
    r = table[record + FACE_SURFACE] if kind == FACE else -1
    breaks_u = table[curve + CURVE_BREAKS] if kind == EDGE else table[r + BREAKS_U]
    spans_u = table[curve + CURVE_SPANS] if kind == EDGE else table[r + SPANS_U]
    spans_v = 1 if kind == EDGE else table[r + SPANS_V]
    for iu in range(spans_u):
        u0 = max(pool[breaks_u + iu], low_u)
        u1 = min(pool[breaks_u + iu + 1], high_u)
        if not u0 < u1:
            continue
        for iv in range(spans_v):
            v0 = 0.0
            v1 = 0.0
            if kind == FACE:
                at = table[r + BREAKS_V] + iv
                v0 = max(pool[at], low_v)
                v1 = min(pool[at + 1], high_v)
                if not v0 < v1:
                    continue
            new_node(info, count, CELL, kind, info[i, FEATURE], record)
            info[count, SIDE] = UNKNOWN if kind == FACE and table[record + FACE_TRIM] >= 0 else INSIDE
            nodes[count, U0] = 0.5 * (u0 + u1)
            nodes[count, V0] = 0.5 * (v0 + v1)
            nodes[count, HALF_U] = 0.5 * (u1 - u0)
            nodes[count, HALF_V] = 0.5 * (v1 - v0)
            put(nodes, count, CENTER, get(nodes, i, CENTER))
            nodes[count, RADIUS] = nodes[i, RADIUS]
            count += 1
    info[i, CHILDREN] = count - info[i, CHILD]
    return count


@kernel(inner=True)
def span_count(table, kind, record):
    """How many spans a face or an edge has."""
    if kind == FACE:
        r = table[record + FACE_SURFACE]
        return table[r + SPANS_U] * table[r + SPANS_V]
    return table[table[record + EDGE_CURVE] + CURVE_SPANS]


@kernel(inner=True)
def open_feature(table, pool, shell, turn, shift, nodes, info, i, count):
    """Groups and cells of a feature. Returns the number of nodes."""
    kind, record, cells, at, size, ball = feature_cells(table, shell, info[i, FEATURE])
    used = 0
    for c in range(cells):
        if used_cell(table, pool, record, kind, c):
            used += 1
    groups = (used + TOGETHER - 1) // TOGETHER
    first = count + groups
    j = first
    for c in range(cells):
        if not used_cell(table, pool, record, kind, c):
            continue
        o = at + size * c
        new_node(info, j, CELL, kind, info[i, FEATURE], record)
        put(nodes, j, CENTER, add(matvec(turn, (pool[o + ball], pool[o + ball + 1], pool[o + ball + 2])), shift))
        nodes[j, RADIUS] = pool[o + ball + 3]
        if kind == FACE:
            nodes[j, U0] = pool[o]
            nodes[j, V0] = pool[o + 1]
            nodes[j, HALF_U] = pool[o + 9]
            nodes[j, HALF_V] = pool[o + 10]
            if table[record + FACE_TRIM] < 0:
                info[j, SIDE] = INSIDE
        else:
            nodes[j, U0] = 0.5 * (pool[o] + pool[o + 1])
            nodes[j, V0] = 0.0
            nodes[j, HALF_U] = 0.5 * (pool[o + 1] - pool[o])
            nodes[j, HALF_V] = 0.0
            info[j, SIDE] = INSIDE
        j += 1
    for k in range(groups):
        g = count + k
        new_node(info, g, GROUP, kind, info[i, FEATURE], record)
        info[g, CHILD] = first + TOGETHER * k
        info[g, CHILDREN] = min(TOGETHER, used - TOGETHER * k)
        ball_around(nodes, g, info[g, CHILD], info[g, CHILD] + info[g, CHILDREN])
    info[i, CHILD] = count
    info[i, CHILDREN] = groups
    return first + used


@kernel(inner=True)
def give_model(table, pool, turn, shift, nodes, info, i, work):
    """See to it that a cell has its model."""
    if info[i, HAS_MODEL] == 1:
        return
    info[i, HAS_MODEL] = 1
    record = info[i, RECORD]
    if info[i, KIND] == FACE:
        face_model(table, pool, table[record + FACE_SURFACE], turn, shift, nodes, i, work)
    elif info[i, KIND] == EDGE:
        edge_model(table, pool, record, turn, shift, nodes, i, work)
    else:
        vertex_model(pool, table[record + VERTEX_POINT], turn, shift, nodes, i)


@kernel(inner=True)
def split_cell(nodes, info, i, count):
    """Two or four parts of a cell that has its model. Returns the number of nodes."""
    p = get(nodes, i, LINEAR_U)
    q = get(nodes, i, LINEAR_V)
    uu = dot(p, p)
    vv = dot(q, q)
    is_edge = info[i, KIND] == EDGE
    in_u = is_edge or SLENDER * SLENDER * uu >= vv
    in_v = not is_edge and SLENDER * SLENDER * vv >= uu
    info[i, CHILD] = count
    parts_u = 2 if in_u else 1
    parts_v = 2 if in_v else 1
    half_u = nodes[i, HALF_U] / parts_u
    half_v = nodes[i, HALF_V] / parts_v
    for a in range(parts_u):
        for b in range(parts_v):
            new_node(info, count, CELL, info[i, KIND], info[i, FEATURE], info[i, RECORD])
            info[count, SIDE] = UNKNOWN if info[i, SIDE] == MIXED_SIDE else info[i, SIDE]
            nodes[count, U0] = nodes[i, U0] + (2 * a + 1 - parts_u) * half_u
            nodes[count, V0] = nodes[i, V0] + (2 * b + 1 - parts_v) * half_v
            nodes[count, HALF_U] = half_u
            nodes[count, HALF_V] = half_v
            put(nodes, count, CENTER, get(nodes, i, CENTER))
            nodes[count, RADIUS] = nodes[i, RADIUS]
            count += 1
    info[i, CHILDREN] = parts_u * parts_v
    return count


@kernel(inner=True)
def grow(table, pool, shell, turn, shift, nodes, info, i, count):
    """See to it that a node has children, cells yet without their models. Returns the number of nodes."""
    if info[i, CHILD] >= 0 or info[i, KIND] == VERTEX:
        return count
    if info[i, LEVEL] == PART:
        if span_count(table, info[i, KIND], info[i, RECORD]) <= SPANS:
            return open_spans(table, pool, nodes, info, i, count)
        return open_feature(table, pool, shell, turn, shift, nodes, info, i, count)
    return split_cell(nodes, info, i, count)
