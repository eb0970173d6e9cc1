"""The nearest points of two shells over all their faces, edges and vertices, by branch and bound.

Nearest points are an extremum of some pair of features inside both. Two trees of balls (`cell_tree.py`) are descended
together, the pair of nodes with the least bound of its distance first. A pair of cells is given up when

- its bound (`box_model.py`) is not below the least distance known,
- no normal of one is parallel to one of the other, or the distance changes monotonically over one of them: then
  no extremum of these two features is in it,
- it is small, and an extremum found is its own: relative curvature cannot change its sign as far as from there,

else Newton's method looks for an extremum from its middle, and the larger cell is cut. What is known to be feasible,
an extremum or a sample inside the trims, lowers the least distance. Shells that cross are at distance zero; their
crossing points are found by Newton's method for d = 0, and the search ends.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.spline import (
    BREAKS_U,
    BREAKS_V,
    CLOSED_U,
    CLOSED_V,
    CURVE_BREAKS,
    CURVE_SPANS,
    SPANS_U,
    SPANS_V,
    surface_point,
)
from assembly.geometry.trim import TRIM_CURVES, trim_nearest, trim_side
from assembly.geometry.vec import add, blend, cross, dot, matvec, scale, sub
from assembly.proximity.box_model import (
    BEND,
    CENTER,
    CHANGE,
    HALF_U,
    HALF_V,
    LINEAR_U,
    LINEAR_V,
    MIXED,
    NODE,
    NORMAL,
    POINT,
    RADIUS,
    REST,
    SQUARE_U,
    SQUARE_V,
    U0,
    V0,
    get,
    pair_bound,
)
from assembly.proximity.cell_tree import (
    CELL,
    CHILD,
    CHILDREN,
    FEATURE,
    INFO,
    INSIDE,
    KIND,
    LEVEL,
    MIXED_SIDE,
    OUTSIDE,
    RECORD,
    SIDE,
    UNKNOWN,
    give_model,
    grow,
    plant,
    room,
)
from assembly.proximity.edge_frame import edge_jet, vertex_point
from assembly.proximity.extremal import CONVERGED, SINGULAR, into_domain, solve_pair
from assembly.proximity.feature_pair import solve_features
from assembly.proximity.shell import EDGE, EDGE_CURVE, EDGE_START, FACE, FACE_SURFACE, FACE_TRIM, VERTEX

# What became of a search: apart, all other pairs excluded; shells cross; out of room, the best pair known.
APART, CROSSING, UNPROVEN = 0, 1, 2
# Pairs of nodes that may wait at a time, and pairs that may be cut.
WAITING = 65536
# Extrema kept.
EXTREMA = 256
# Boxes whose normals turn by less hold at most one extremum.
TRUSTED = 0.05
# Boxes that hold an extremum this many half widths from their middles still take it for their own.
BESIDE = 1.5
FAR = 6.0
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


@kernel(inner=True)
def is_feasible(table, pool, kind, record, u, v):
    """Whether a point of a feature is one of the shell."""
    if kind != FACE or table[record + FACE_TRIM] < 0:
        return True
    return trim_side(table, pool, table[record + FACE_TRIM], u, v) >= 0


@kernel(inner=True)
def side_of(table, pool, nodes, info, i):
    """Where a cell is from the trim of its face."""
    if info[i, KIND] != FACE or info[i, SIDE] != UNKNOWN:
        return info[i, SIDE]
    trim = table[info[i, RECORD] + FACE_TRIM]
    s = trim_nearest(table, pool, trim, 0, table[trim + TRIM_CURVES], nodes[i, U0], nodes[i, V0])[0]
    reach = math.sqrt(nodes[i, HALF_U] ** 2 + nodes[i, HALF_V] ** 2)
    side = INSIDE if s >= reach else (OUTSIDE if s < -1.000001 * reach else MIXED_SIDE)
    info[i, SIDE] = side
    return side


@kernel(inner=True)
def monotone(a, i, kind, d, length, reach):
    """Whether d.S_u or d.S_v cannot vanish over a node, d known to within `reach`."""
    if kind == VERTEX:
        return False
    p = get(a, i, LINEAR_U)
    m = get(a, i, MIXED)
    mixed = math.sqrt(dot(m, m))
    l = get(a, i, SQUARE_U)
    rest = 6.0 * a[i, REST]
    turn = 2.0 * math.sqrt(dot(l, l)) + mixed + rest
    if abs(dot(d, p)) > reach * (math.sqrt(dot(p, p)) + turn) + length * turn:
        return True
    if kind == EDGE:
        return False
    q = get(a, i, LINEAR_V)
    k = get(a, i, SQUARE_V)
    turn = 2.0 * math.sqrt(dot(k, k)) + mixed + rest
    return abs(dot(d, q)) > reach * (math.sqrt(dot(q, q)) + turn) + length * turn


@kernel(inner=True)
def excluded(a, i, kind_f, b, j, kind_g):
    """Whether no extremum of two features is in a pair of their cells."""
    d = sub(get(b, j, POINT), get(a, i, POINT))
    length = math.sqrt(dot(d, d))
    reach = a[i, RADIUS] + b[j, RADIUS]
    if monotone(a, i, kind_f, d, length, reach) or monotone(b, j, kind_g, d, length, reach):
        return True
    bend = a[i, BEND] + b[j, BEND]
    if not bend < 1.5:
        return False
    if kind_f == FACE and kind_g == FACE:
        s = cross(get(a, i, NORMAL), get(b, j, NORMAL))
        return dot(s, s) > math.sin(bend) ** 2
    if kind_f == FACE and kind_g == EDGE:
        t = get(b, j, LINEAR_U)
        return abs(dot(t, get(a, i, NORMAL))) > math.sin(bend) * math.sqrt(dot(t, t))
    if kind_f == EDGE and kind_g == FACE:
        t = get(a, i, LINEAR_U)
        return abs(dot(t, get(b, j, NORMAL))) > math.sin(bend) * math.sqrt(dot(t, t))
    return False


@kernel(inner=True)
def relative_curvature(k, h, beta):
    """Least eigenvalue of the curvature of g relative to f moved to it, towards each other; and 1 / the least of K."""
    det = k[0] * k[2] - k[1] * k[1]
    if not (k[0] > 0.0 and det > 0.0):
        return -math.inf, 1.0
    s = -1.0 / det if beta >= 0.0 else 1.0 / det
    # -H K^-1, symmetric but for rounding.
    a = s * (h[0] * k[2] - h[1] * k[1])
    b = s * 0.5 * (h[1] * k[0] - h[0] * k[1] + h[2] * k[2] - h[3] * k[1])
    c = s * (h[3] * k[0] - h[2] * k[1])
    least = 0.5 * (a + c) - math.sqrt(0.25 * (a - c) ** 2 + b * b)
    low = 0.5 * (k[0] + k[2]) - math.sqrt(0.25 * (k[0] - k[2]) ** 2 + k[1] * k[1])
    return least, 1.0 / max(low, 1e-12)


@kernel(inline=True)
def off_middle(x, middle, half, period):
    """How many half widths x is from the middle of an interval."""
    d = abs(x - middle)
    if period > 0.0:
        d = min(d, abs(period - d))
    if half > 0.0:
        return d / half
    return 0.0


@kernel(inner=True)
def periods(table, pool, kind, record):
    """Periods of a feature's coordinates; 0 where there is none."""
    if kind == FACE:
        r = table[record + FACE_SURFACE]
        bu = table[r + BREAKS_U]
        bv = table[r + BREAKS_V]
        u = pool[bu + table[r + SPANS_U]] - pool[bu] if table[r + CLOSED_U] == 1 else 0.0
        v = pool[bv + table[r + SPANS_V]] - pool[bv] if table[r + CLOSED_V] == 1 else 0.0
        return u, v
    if kind == EDGE and table[record + EDGE_START] < 0:
        c = table[record + EDGE_CURVE]
        o = table[c + CURVE_BREAKS]
        return pool[o + table[c + CURVE_SPANS]] - pool[o], 0.0
    return 0.0, 0.0


@kernel(inner=True)
def from_middles(table, pool, a, ai, i, b, bi, j, x):
    """The most half widths that coordinates x are from the middles of two cells."""
    pu, pv = periods(table, pool, ai[i, KIND], ai[i, RECORD])
    s = off_middle(x[0], a[i, U0], a[i, HALF_U], pu)
    s = max(s, off_middle(x[1], a[i, V0], a[i, HALF_V], pv))
    pu, pv = periods(table, pool, bi[j, KIND], bi[j, RECORD])
    s = max(s, off_middle(x[2], b[j, U0], b[j, HALF_U], pu))
    return max(s, off_middle(x[3], b[j, V0], b[j, HALF_V], pv))


@kernel(inner=True)
def is_known(table, pool, a, ai, i, b, bi, j, extrema, owners, count):
    """Whether the only extremum that two cells may hold is one that is known; half widths from the nearest one."""
    bend = max(a[i, BEND], b[j, BEND])
    nearest = math.inf
    for k in range(count):
        if owners[k, 0] != ai[i, FEATURE] or owners[k, 1] != bi[j, FEATURE]:
            continue
        s = from_middles(table, pool, a, ai, i, b, bi, j, (extrema[k, 0], extrema[k, 1], extrema[k, 2], extrema[k, 3]))
        nearest = min(nearest, s)
        if s <= BESIDE and bend <= TRUSTED:
            return True, s
        if s <= FAR:
            change = a[i, CHANGE] * extrema[k, 5] * extrema[k, 5] + b[j, CHANGE]
            if extrema[k, 4] > 1.5 * max(s, 1.0) * change:
                return True, s
    return False, nearest


@kernel(inner=True)
def tangents(table, pool, kind, record, turn, shift, u, v):
    """Point and tangents of a feature, moved by a pose."""
    zero = (0.0, 0.0, 0.0)
    if kind == FACE:
        p, su, sv, _uu, _uv, _vv = surface_point(table, pool, table[record + FACE_SURFACE], u, v)
    elif kind == EDGE:
        p, su, _tt = edge_jet(table, pool, record, u)
        sv = zero
    else:
        p = vertex_point(table, pool, record)
        su = zero
        sv = zero
    return add(matvec(turn, p), shift), matvec(turn, su), matvec(turn, sv)


@kernel(inner=True)
def within(table, pool, kind, record, u, v):
    """Coordinates wrapped, or held at the ends of the domain."""
    if kind == FACE:
        u, v, _clamped = into_domain(table, pool, table[record + FACE_SURFACE], u, v)
        return u, v
    if kind == EDGE:
        c = table[record + EDGE_CURVE]
        o = table[c + CURVE_BREAKS]
        low = pool[o]
        high = pool[o + table[c + CURVE_SPANS]]
        if table[record + EDGE_START] < 0 and not low <= u <= high:
            u -= (high - low) * math.floor((u - low) / (high - low))
        return min(max(u, low), high), v
    return u, v


@kernel(inner=True)
def crossing_point(table, pool, kind_f, f, kind_g, g, turn, shift, x, size):
    """Coordinates where d = 0 near x, by least steps, and whether they were found."""
    same = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    origin = (0.0, 0.0, 0.0)
    previous = math.inf
    for _ in range(12):
        p, pu, pv = tangents(table, pool, kind_f, f, same, origin, x[0], x[1])
        q, qu, qv = tangents(table, pool, kind_g, g, turn, shift, x[2], x[3])
        d = sub(q, p)
        off = math.sqrt(dot(d, d))
        if off <= 1e-13 * size:
            return x, True
        if off > 0.9 * previous:
            return x, off <= 1e-9 * size
        previous = off
        # W = J J^T over tangents of unit length: steps in lengths, the least that remove d.
        su = 1.0 / max(math.sqrt(dot(pu, pu)), 1e-300)
        sv = 1.0 / max(math.sqrt(dot(pv, pv)), 1e-300)
        tu = 1.0 / max(math.sqrt(dot(qu, qu)), 1e-300)
        tv = 1.0 / max(math.sqrt(dot(qv, qv)), 1e-300)
        a = scale(su, pu)
        b = scale(sv, pv)
        c = scale(tu, qu)
        e = scale(tv, qv)
        xx = a[0] * a[0] + b[0] * b[0] + c[0] * c[0] + e[0] * e[0]
        xy = a[0] * a[1] + b[0] * b[1] + c[0] * c[1] + e[0] * e[1]
        xz = a[0] * a[2] + b[0] * b[2] + c[0] * c[2] + e[0] * e[2]
        yy = a[1] * a[1] + b[1] * b[1] + c[1] * c[1] + e[1] * e[1]
        yz = a[1] * a[2] + b[1] * b[2] + c[1] * c[2] + e[1] * e[2]
        zz = a[2] * a[2] + b[2] * b[2] + c[2] * c[2] + e[2] * e[2]
        row0 = (xx, xy, xz)
        row1 = (xy, yy, yz)
        row2 = (xz, yz, zz)
        det = dot(row0, cross(row1, row2))
        if not det > 1e-14:
            return x, False
        y = blend(d[0] / det, cross(row1, row2), d[1] / det, cross(row2, row0))
        y = add(y, scale(d[2] / det, cross(row0, row1)))
        uf, vf = within(table, pool, kind_f, f, x[0] + su * dot(a, y), x[1] + sv * dot(b, y))
        ug, vg = within(table, pool, kind_g, g, x[2] - tu * dot(c, y), x[3] - tv * dot(e, y))
        x = (uf, vf, ug, vg)
    return x, False


@kernel(inner=True)
def extremum_near(table, pool, kind_f, f, kind_g, g, turn, shift, x, n, size):
    """Newton from x: whether it led to an extremum, its coordinates, gap, least relative curvature, stretch of f's."""
    if kind_f == FACE and kind_g == FACE:
        status, y, _count, frame, curvature = solve_pair(
            table, pool, table[f + FACE_SURFACE], table[g + FACE_SURFACE], turn, shift, x, size, 1.5, 0.0
        )
        least, stretch = relative_curvature(curvature[0], curvature[1], frame[10])
        return status, y, frame[10], least, stretch
    af = table[f + FACE_SURFACE] if kind_f == FACE else f
    ag = table[g + FACE_SURFACE] if kind_g == FACE else g
    status, y, frame = solve_features(table, pool, kind_f, af, kind_g, ag, turn, shift, x, n, size, 1.5)
    return status, y, frame[5], 0.0, 1.0


@kernel(inner=True)
def larger_first(a, ai, i, b, bi, j):
    """Whether to go down on the side of f: what is not a cell first, then what is larger."""
    if ai[i, LEVEL] == CELL and bi[j, LEVEL] != CELL:
        return False
    if bi[j, LEVEL] == CELL and ai[i, LEVEL] != CELL:
        return True
    if ai[i, KIND] == VERTEX or bi[j, KIND] == VERTEX:
        return bi[j, KIND] == VERTEX
    if ai[i, LEVEL] == CELL:
        # What keeps the bound from the distance, or else the extent.
        return a[i, REST] + 0.02 * a[i, RADIUS] >= b[j, REST] + 0.02 * b[j, RADIUS]
    return a[i, RADIUS] >= b[j, RADIUS]


@kernel(inner=True)
def ball_bound(a, i, b, j):
    d = sub(get(b, j, CENTER), get(a, i, CENTER))
    return math.sqrt(dot(d, d)) - a[i, RADIUS] - b[j, RADIUS]


@kernel(inner=True, allocates=True)
def search(table, pool, shell_f, shell_g, turn, shift, size, upper):
    """The nearest points of two shells, g seen from f.

    Returns
    -------
    status
        APART: all else is excluded. CROSSING: the shells cross at the point returned. UNPROVEN: out of room.
    code_f, code_g
        Numbers of the features; -1 where nothing nearer than `upper` was found.
    x
        Their coordinates, (u_f, v_f, u_g, v_g).
    gap
        n.(g - f), n the outward normal of a face of f, else of g, else from f to g.
    lower
        No points are nearer than this.
    effort
        Pairs looked at.
    """
    same = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    origin = (0.0, 0.0, 0.0)
    most_f = room(table, pool, shell_f)
    most_g = room(table, pool, shell_g)
    a = np.empty((most_f, NODE))
    ai = np.empty((most_f, INFO), np.int64)
    b = np.empty((most_g, NODE))
    bi = np.empty((most_g, INFO), np.int64)
    work = np.empty((4, 16, 16))
    count_f = plant(table, pool, shell_f, same, origin, a, ai)
    count_g = plant(table, pool, shell_g, turn, shift, b, bi)
    keys = np.empty(WAITING)
    slots = np.empty(WAITING, np.int64)
    pairs = np.empty((WAITING, 3), np.int64)
    normals = np.empty((WAITING, 3))
    free = np.empty(WAITING, np.int64)
    released = 0
    used = 0
    waiting = 0
    extrema = np.empty((EXTREMA, 6))
    owners = np.empty((EXTREMA, 2), np.int64)
    known = 0
    tolerance = 1e-13 * size
    status = APART
    best = (-1, -1)
    at = (0.0, 0.0, 0.0, 0.0)
    gap = upper
    lower = upper
    effort = 0
    # A first guess, by going down where balls are nearest.
    i = 0
    j = 0
    while ai[i, LEVEL] != CELL or bi[j, LEVEL] != CELL:
        if larger_first(a, ai, i, b, bi, j):
            count_f = grow(table, pool, shell_f, same, origin, a, ai, i, count_f, work)
            nearest = math.inf
            first = ai[i, CHILD]
            for k in range(first, first + ai[i, CHILDREN]):
                d = sub(get(b, j, CENTER), get(a, k, CENTER))
                if dot(d, d) < nearest:
                    nearest = dot(d, d)
                    i = k
        else:
            count_g = grow(table, pool, shell_g, turn, shift, b, bi, j, count_g, work)
            nearest = math.inf
            first = bi[j, CHILD]
            for k in range(first, first + bi[j, CHILDREN]):
                d = sub(get(b, k, CENTER), get(a, i, CENTER))
                if dot(d, d) < nearest:
                    nearest = dot(d, d)
                    j = k
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
        if key >= upper - tolerance:
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
        are_cells = ai[i, LEVEL] == CELL and bi[j, LEVEL] == CELL
        if are_cells:
            give_model(table, pool, same, origin, a, ai, i, work)
            give_model(table, pool, turn, shift, b, bi, j, work)
            kind_f = ai[i, KIND]
            kind_g = bi[j, KIND]
            f = ai[i, RECORD]
            g = bi[j, RECORD]
            if ready == 0:
                key, n = pair_bound(a, i, b, j, n, upper)
                if key >= upper - tolerance:
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
            start = (a[i, U0], a[i, V0], b[j, U0], b[j, V0])
            if (
                apart < upper
                and is_feasible(table, pool, kind_f, f, start[0], start[1])
                and is_feasible(table, pool, kind_g, g, start[2], start[3])
            ):
                upper = apart
                best = (ai[i, FEATURE], bi[j, FEATURE])
                at = start
                gap = apart
            if excluded(a, i, kind_f, b, j, kind_g) and ready != 2:
                continue
            settled, beside = is_known(table, pool, a, ai, i, b, bi, j, extrema, owners, known)
            if settled:
                continue
            # Beside an extremum Newton's method would find that one again.
            if ready == 2 or (max(a[i, BEND], b[j, BEND]) < SMOOTH and beside > FAR):
                found, x, beta, least, stretch = extremum_near(
                    table, pool, kind_f, f, kind_g, g, turn, shift, start, n, size
                )
                if found == CONVERGED or found == SINGULAR:
                    if (
                        abs(beta) < upper
                        and is_feasible(table, pool, kind_f, f, x[0], x[1])
                        and is_feasible(table, pool, kind_g, g, x[2], x[3])
                    ):
                        upper = abs(beta)
                        best = (ai[i, FEATURE], bi[j, FEATURE])
                        at = x
                        gap = beta
                    if known < EXTREMA:
                        extrema[known, 0], extrema[known, 1], extrema[known, 2], extrema[known, 3] = x
                        extrema[known, 4] = least
                        extrema[known, 5] = stretch
                        owners[known, 0] = ai[i, FEATURE]
                        owners[known, 1] = bi[j, FEATURE]
                        known += 1
                        if is_known(table, pool, a, ai, i, b, bi, j, extrema[known - 1 :], owners[known - 1 :], 1)[0]:
                            continue
            if key <= 0.0 and a[i, BEND] + b[j, BEND] < SMOOTH:
                x, crosses = crossing_point(table, pool, kind_f, f, kind_g, g, turn, shift, start, size)
                if (
                    crosses
                    and is_feasible(table, pool, kind_f, f, x[0], x[1])
                    and is_feasible(table, pool, kind_g, g, x[2], x[3])
                ):
                    status = CROSSING
                    best = (ai[i, FEATURE], bi[j, FEATURE])
                    at = x
                    gap = 0.0
                    lower = 0.0
                    upper = 0.0
                    break
            if ready == 2:
                continue
            if side_of(table, pool, a, ai, i) == OUTSIDE or side_of(table, pool, b, bi, j) == OUTSIDE:
                continue
            if max(a[i, RADIUS], b[j, RADIUS]) < 1e-9 * size:
                continue
        if larger_first(a, ai, i, b, bi, j):
            count_f = grow(table, pool, shell_f, same, origin, a, ai, i, count_f, work)
            first = ai[i, CHILD]
            last = first + ai[i, CHILDREN]
            down_f = True
        else:
            count_g = grow(table, pool, shell_g, turn, shift, b, bi, j, count_g, work)
            first = bi[j, CHILD]
            last = first + bi[j, CHILDREN]
            down_f = False
        for k in range(first, last):
            p = k if down_f else i
            q = j if down_f else k
            if are_cells:
                key, m = pair_bound(a, p, b, q, n, upper)
            else:
                key = ball_bound(a, p, b, q)
                m = n
            if key >= upper - tolerance:
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
        lower = upper - tolerance
    return status, best[0], best[1], at, gap, max(lower, 0.0), effort


@kernel
def nearest_features(table, pool, shell_f, shell_g, rotation, shift, size):
    """`search` without anything known: status, features, coordinates and gap."""
    status, f, g, x, gap, _lower, _effort = search(table, pool, shell_f, shell_g, rotation, shift, size, math.inf)
    return status, f, g, x, gap


@kernel
def nearest_report(table, pool, shell_f, shell_g, rotation, shift, size, out):
    """For Python: coordinates (4), gap, lower bound, effort into out. Returns status and features."""
    status, f, g, x, gap, lower, effort = search(table, pool, shell_f, shell_g, rotation, shift, size, math.inf)
    out[0], out[1], out[2], out[3] = x
    out[4] = gap
    out[5] = lower
    out[6] = effort
    return status, f, g
