"""The nearest points of two shells over all their faces, edges and vertices, by branch and bound.

Nearest points are an extremum of some pair of features inside both. Two trees of balls
(`proximity/features/ball_tree.py`) are descended
together, the pair of nodes with the least bound of its distance first. A pair of cells is given up when

- its bound (`proximity/features/quadratic_model.py`) is not below the least distance known,
- no normal of one is parallel to one of the other, or the distance changes monotonically over one of them: then
  no extremum of these two features is in it,
- it is small, and an extremum found is its own: relative curvature cannot change its sign as far as from there,

else Newton's method looks for an extremum from its middle, and the larger cell is cut. What is known to be feasible,
an extremum or a sample inside the trims, lowers the least distance. Shells that cross are at distance zero; their
crossing points are found by Newton's method for d = 0, and the search ends.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import dot, sub
from assembly.kinematics.motion import RelativePose
from assembly.proximity.brep.records import FACE, VERTEX, face_at
from assembly.proximity.extrema.crossing import crossing_point
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR, solve_pair
from assembly.proximity.extrema.feature_pair import solve_features
from assembly.proximity.features.ball_tree import (
    CELL,
    INFO,
    OUTSIDE,
    cell_node_at,
    give_model,
    grow,
    plant,
    room,
)
from assembly.proximity.features.quadratic_model import (
    CENTER,
    NODE,
    POINT,
    get,
    model_at,
    pair_bound,
)
from assembly.proximity.features.region_tests import (
    FAR,
    KNOWN,
    excluded,
    is_feasible,
    is_known,
    known_extremum_at,
    relative_curvature,
    side_of,
)

# What became of a search: apart, all other pairs excluded; shells cross; out of room, the best pair known.
APART, CROSSING, UNPROVEN = 0, 1, 2
# Pairs of nodes that may wait at a time, and pairs that may be cut.
WAITING = 65536
# Extrema kept.
EXTREMA = 256
# Pairs of cells that are smaller, in parts of the size, are not cut: what they bound is the proof's end.
TINY = 2.5e-10
# Newton's method is tried where normals turn by less.
SMOOTH = 1.2


@kernel(inner=True)
def push(keys, slots, count, key, slot):
    """Put into the heap."""
    i = count
    while i > 0:
        parent = (i - 1) >> 1
        if keys[parent] <= key:
            break
        keys[i] = keys[parent]
        slots[i] = slots[parent]
        i = parent
    keys[i] = key
    slots[i] = slot


@kernel(inner=True)
def drop_first(keys, slots, count):
    """Take the least out of the heap of `count`, which has one less then."""
    last = count - 1
    key = keys[last]
    slot = slots[last]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[i] = keys[child]
        slots[i] = slots[child]
        i = child
    keys[i] = key
    slots[i] = slot


# Where Newton's method leads. curvature: the least of g relative to f; stretch: 1 over the least of f's metric K.
NearExtremum = namedtuple("NearExtremum", "status x gap curvature stretch")


@kernel(inner=True)
def extremum_near(store, kind_f, f, kind_g, g, pose, x, n, size):
    """Newton's method from x; its status says whether it led to an extremum."""
    face = face_at(store.table, f)
    face_record = face_at(store.table, g)
    if kind_f == FACE and kind_g == FACE:
        found = solve_pair(store, face.surface, face_record.surface, pose, x, size, 1.5, 0.0, False)
        gap = found.frame.gap
        least, stretch = relative_curvature(found.matrix.k, found.matrix.h, gap)
        return NearExtremum(found.status, found.parameters, gap, least, stretch)
    af = face.surface if kind_f == FACE else f
    ag = face_record.surface if kind_g == FACE else g
    status, y, frame = solve_features(store, kind_f, af, kind_g, ag, pose, x, n, size, 1.5)
    return NearExtremum(status, y, frame.gap, 0.0, 1.0)


@kernel(inner=True)
def larger_first(a, ai, i, b, bi, j):
    """Whether to go down on the side of f: what is not a cell first, then what is larger."""
    model = model_at(a, i)
    model_record = model_at(b, j)
    cell = cell_node_at(ai, i)
    cell_node = cell_node_at(bi, j)
    if cell.level == CELL and cell_node.level != CELL:
        return False
    if cell_node.level == CELL and cell.level != CELL:
        return True
    if cell.kind == VERTEX or cell_node.kind == VERTEX:
        return cell_node.kind == VERTEX
    if cell.level == CELL:
        # What keeps the bound from the distance, or else the extent.
        return model.rest + 0.02 * model.radius >= model_record.rest + 0.02 * model_record.radius
    return model.radius >= model_record.radius


@kernel(inner=True)
def ball_bound(a, i, b, j):
    d = sub(get(b, j, CENTER), get(a, i, CENTER))
    return math.sqrt(dot(d, d)) - model_at(a, i).radius - model_at(b, j).radius


# What a search for the nearest points of two shells finds. status: APART, CROSSING (at the point) or UNPROVEN; f, g:
# numbers of the features; x: their coordinates, (u, v) of f, then of g; gap: n.(g - f), n the outward normal of a face
# of f, else of g, else from f to g; lower: no points are nearer than this; effort: pairs looked at.
ShellSearch = namedtuple("ShellSearch", "status f g x gap lower effort")
# A pair of features, or none. normal: near that of the pair, or zero where it is not known.
FoundPair = namedtuple("FoundPair", "found f g x normal gap")


@kernel(inner=True, allocates=True)
def search(store, shell_f, shell_g, pose, size, rough):
    """The nearest points of two shells, g seen from f, or any that are farther by a part of that, `rough`, at most."""
    same = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    origin = (0.0, 0.0, 0.0)
    most_f = room(store, shell_f)
    most_g = room(store, shell_g)
    a = np.empty((most_f, NODE))
    ai = np.empty((most_f, INFO), np.int64)
    b = np.empty((most_g, NODE))
    bi = np.empty((most_g, INFO), np.int64)
    work = np.empty((4, 16, 16))
    count_f = plant(store, shell_f, RelativePose(same, origin), a, ai)
    count_g = plant(store, shell_g, pose, b, bi)
    keys = np.empty(WAITING)
    slots = np.empty(WAITING, np.int64)
    pairs = np.empty((WAITING, 3), np.int64)
    normals = np.empty((WAITING, 3))
    free = np.empty(WAITING, np.int64)
    released = 0
    used = 0
    waiting = 0
    extrema = np.empty((EXTREMA, KNOWN))
    owners = np.empty((EXTREMA, 2), np.int64)
    known = 0
    tolerance = 1e-13 * size
    # The least bound of a pair that was too small to be cut.
    uncut = math.inf
    status = APART
    upper = math.inf
    best = (-1, -1)
    at = (0.0, 0.0, 0.0, 0.0)
    gap = upper
    lower = upper
    effort = 0
    # A first guess, by going down where balls are nearest.
    i = 0
    j = 0
    while cell_node_at(ai, i).level != CELL or cell_node_at(bi, j).level != CELL:
        if larger_first(a, ai, i, b, bi, j):
            count_f = grow(store, shell_f, RelativePose(same, origin), a, ai, i, count_f)
            nearest = math.inf
            first = cell_node_at(ai, i).child
            for k in range(first, first + cell_node_at(ai, i).children):
                d = sub(get(b, j, CENTER), get(a, k, CENTER))
                if dot(d, d) < nearest:
                    nearest = dot(d, d)
                    i = k
        else:
            count_g = grow(store, shell_g, pose, b, bi, j, count_g)
            nearest = math.inf
            first = cell_node_at(bi, j).child
            for k in range(first, first + cell_node_at(bi, j).children):
                d = sub(get(b, k, CENTER), get(a, i, CENTER))
                if dot(d, d) < nearest:
                    nearest = dot(d, d)
                    j = k
    first_f = i
    model = model_at(a, first_f)
    first_g = j
    model_record = model_at(b, first_g)
    pairs[0, 0] = i
    pairs[0, 1] = j
    pairs[0, 2] = 2
    pairs[1, 0] = 0
    pairs[1, 1] = 0
    pairs[1, 2] = 0
    for k in range(2):
        normals[k, 0], normals[k, 1], normals[k, 2] = origin
    used = 2
    push(keys, slots, 0, -math.inf, 0)
    push(keys, slots, 1, ball_bound(a, 0, b, 0), 1)
    waiting = 2
    while waiting > 0:
        key = keys[0]
        slot = slots[0]
        if key >= (1.0 - rough) * upper - tolerance:
            break
        drop_first(keys, slots, waiting)
        waiting -= 1
        i = pairs[slot, 0]
        j = pairs[slot, 1]
        ready = pairs[slot, 2]
        n = (normals[slot, 0], normals[slot, 1], normals[slot, 2])
        free[released] = slot
        released += 1
        effort += 1
        lower = max(key, 0.0)
        if count_f + 160 > most_f or count_g + 160 > most_g or waiting + 160 > WAITING:
            status = UNPROVEN
            break
        are_cells = cell_node_at(ai, i).level == CELL and cell_node_at(bi, j).level == CELL
        if are_cells:
            give_model(store, RelativePose(same, origin), a, ai, i, work)
            give_model(store, pose, b, bi, j, work)
            kind_f = cell_node_at(ai, i).kind
            kind_g = cell_node_at(bi, j).kind
            f = cell_node_at(ai, i).record
            g = cell_node_at(bi, j).record
            if ready == 0:
                key, n = pair_bound(a, i, b, j, n, upper)
                if key >= (1.0 - rough) * upper - tolerance:
                    continue
                if waiting > 0 and key > keys[0]:
                    released -= 1
                    slot = free[released]
                    pairs[slot, 0] = i
                    pairs[slot, 1] = j
                    pairs[slot, 2] = 1
                    normals[slot, 0], normals[slot, 1], normals[slot, 2] = n
                    push(keys, slots, waiting, key, slot)
                    waiting += 1
                    continue
            d = sub(get(b, j, POINT), get(a, i, POINT))
            apart = math.sqrt(dot(d, d))
            start = (model_at(a, i).u0, model_at(a, i).v0, model_at(b, j).u0, model_at(b, j).v0)
            if (
                apart < upper
                and is_feasible(store, kind_f, f, start[0], start[1])
                and is_feasible(store, kind_g, g, start[2], start[3])
            ):
                upper = apart
                best = (cell_node_at(ai, i).feature, cell_node_at(bi, j).feature)
                at = start
                gap = apart
            if ready != 2 and excluded(a, i, kind_f, b, j, kind_g, key > 0.0):
                continue
            settled, beside = is_known(store, a, ai, i, b, bi, j, extrema, owners, known)
            if settled:
                continue
            # Beside an extremum Newton's method would find that one again.
            if ready == 2 or (max(model_at(a, i).bend, model_at(b, j).bend) < SMOOTH and beside > FAR):
                near = extremum_near(store, kind_f, f, kind_g, g, pose, start, n, size)
                if near.status == CONVERGED or near.status == SINGULAR:
                    x, beta = near.x, near.gap
                    if (
                        abs(beta) < upper
                        and is_feasible(store, kind_f, f, x[0], x[1])
                        and is_feasible(store, kind_g, g, x[2], x[3])
                    ):
                        upper = abs(beta)
                        best = (cell_node_at(ai, i).feature, cell_node_at(bi, j).feature)
                        at = x
                        gap = beta
                    if known < EXTREMA:
                        extremum = known_extremum_at(extrema, known)
                        for l in range(4):
                            extremum.parameters[l] = x[l]
                        extremum.curvature = near.curvature
                        extremum.stretch = near.stretch
                        owners[known, 0] = cell_node_at(ai, i).feature
                        owners[known, 1] = cell_node_at(bi, j).feature
                        known += 1
                        if is_known(store, a, ai, i, b, bi, j, extrema[known - 1 :], owners[known - 1 :], 1)[0]:
                            continue
            if key <= 0.0 and model_at(a, i).bend + model_at(b, j).bend < SMOOTH:
                x, crosses = crossing_point(store, kind_f, f, kind_g, g, pose, start, size)
                if crosses and is_feasible(store, kind_f, f, x[0], x[1]) and is_feasible(store, kind_g, g, x[2], x[3]):
                    status = CROSSING
                    best = (cell_node_at(ai, i).feature, cell_node_at(bi, j).feature)
                    at = x
                    gap = 0.0
                    lower = 0.0
                    upper = 0.0
                    break
            if ready == 2:
                continue
            if side_of(store, a, ai, i) == OUTSIDE or side_of(store, b, bi, j) == OUTSIDE:
                continue
            if max(model_at(a, i).radius, model_at(b, j).radius) < TINY * size:
                uncut = min(uncut, key)
                continue
        if larger_first(a, ai, i, b, bi, j):
            count_f = grow(store, shell_f, RelativePose(same, origin), a, ai, i, count_f)
            first = cell_node_at(ai, i).child
            last = first + cell_node_at(ai, i).children
            down_f = True
        else:
            count_g = grow(store, shell_g, pose, b, bi, j, count_g)
            first = cell_node_at(bi, j).child
            last = first + cell_node_at(bi, j).children
            down_f = False
        for k in range(first, last):
            p = k if down_f else i
            q = j if down_f else k
            if are_cells:
                if down_f:
                    give_model(store, RelativePose(same, origin), a, ai, p, work)
                else:
                    give_model(store, pose, b, bi, q, work)
                key, m = pair_bound(a, p, b, q, n, upper)
            else:
                key = ball_bound(a, p, b, q)
                m = n
            if key >= (1.0 - rough) * upper - tolerance:
                continue
            if released > 0:
                released -= 1
                slot = free[released]
            elif used < WAITING:
                slot = used
                used += 1
            else:
                continue
            pairs[slot, 0] = p
            pairs[slot, 1] = q
            pairs[slot, 2] = 1 if are_cells else 0
            normals[slot, 0], normals[slot, 1], normals[slot, 2] = m
            push(keys, slots, waiting, key, slot)
            waiting += 1
    if status == APART:
        lower = (1.0 - rough) * upper - tolerance
    elif best[0] < 0 and upper == math.inf:
        # Out of room before any point inside the trims: where the search began.
        best = (cell_node_at(ai, first_f).feature, cell_node_at(bi, first_g).feature)
        at = (model.u0, model.v0, model_record.u0, model_record.v0)
    return ShellSearch(status, best[0], best[1], at, gap, max(min(lower, uncut), 0.0), effort)
