"""A global start for an extremal pair: the nearest cells of two surfaces, then Newton.

Every surface carries cells: small pieces with a sample point and a bounding sphere. The nearest sample of g
is found for every cell of f; from the nearest such pairs, far enough from one another to
belong to different minima, Newton runs, and the pair with the smallest |gap| wins. A pair of cells whose spheres are
farther apart than the best pair found is never tried.

Newton's method goes to any extremum, the far side of a ball as well. A pair whose |gap| is larger than the distance
of the samples it came from is not theirs: then the distance is first made smaller by direct search, which
knows no curvature and passes poles and edges, and Newton runs from there.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.spline import BREAKS_U, BREAKS_V, CELL_COUNT, CELLS, SPANS_U, SPANS_V, surface_point
from assembly.geometry.vec import add, cross, dot, matvec, scale, sub
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.extremal import (
    CONVERGED,
    LEFT_PATCH,
    NOT_CONVERGED,
    SINGULAR,
    into_domain,
    pair_frame,
    solve_pair,
)

CELL = 9  # doubles a cell: u, v, point, sphere's center, radius
CANDIDATES = 16
# Direct search: at most so many rounds, from steps of 1/32 of the domain down to 1e-5 of that.
LEVELS = 200
# Surfaces nearer than this part of the samples' distance cross there.
CROSSING = 1e-3


@kernel(inline=True)
def direction(su, sv):
    """The unit normal, or zero at a pole."""
    n = cross(su, sv)
    square = dot(n, n)
    return scale(1.0 / math.sqrt(square) if square > 0.0 else 0.0, n)


@kernel(inner=True)
def approach(table, pool, f, g, rotation, shift, x, lever):
    """Parameters with a smaller distance, and it, by direct search: nine points of each surface around the best.

    A lever adds lever^2 (1 - (n_f.n_g)^2) to the square of the distance. Where surfaces cross, that leads away from
    their intersection, where every distance vanishes, to where they are parallel.
    """
    fu = 0.03125 * (pool[table[f + BREAKS_U] + table[f + SPANS_U]] - pool[table[f + BREAKS_U]])
    fv = 0.03125 * (pool[table[f + BREAKS_V] + table[f + SPANS_V]] - pool[table[f + BREAKS_V]])
    gu = 0.03125 * (pool[table[g + BREAKS_U] + table[g + SPANS_U]] - pool[table[g + BREAKS_U]])
    gv = 0.03125 * (pool[table[g + BREAKS_V] + table[g + SPANS_V]] - pool[table[g + BREAKS_V]])
    finest = 1e-5 * fu
    points = np.empty((9, 3))
    normals = np.empty((9, 3))
    at = np.empty((9, 2))
    best = 1e300
    for _ in range(LEVELS):
        cu, cv, cs, ct = x
        for k in range(9):
            u, v, _clamped = into_domain(table, pool, g, cs + (k % 3 - 1) * gu, ct + (k // 3 - 1) * gv)
            at[k, 0] = u
            at[k, 1] = v
            point, su, sv, _uu, _uv, _vv = surface_point(table, pool, g, u, v)
            points[k, 0], points[k, 1], points[k, 2] = add(matvec(rotation, point), shift)
            normals[k, 0], normals[k, 1], normals[k, 2] = matvec(rotation, direction(su, sv))
        before = best
        for k in range(9):
            u, v, _clamped = into_domain(table, pool, f, cu + (k % 3 - 1) * fu, cv + (k // 3 - 1) * fv)
            p, su, sv, _uu, _uv, _vv = surface_point(table, pool, f, u, v)
            n = direction(su, sv)
            for j in range(9):
                d = (points[j, 0] - p[0]) ** 2 + (points[j, 1] - p[1]) ** 2 + (points[j, 2] - p[2]) ** 2
                cosine = normals[j, 0] * n[0] + normals[j, 1] * n[1] + normals[j, 2] * n[2]
                d += lever * lever * (1.0 - cosine * cosine)
                if d < best:
                    best = d
                    x = (u, v, at[j, 0], at[j, 1])
        # Closer by a little only: the valley is as wide as the steps.
        if best > 0.998 * before:
            fu *= 0.5
            fv *= 0.5
            gu *= 0.5
            gv *= 0.5
        if fu <= finest:
            break
    return x, math.sqrt(best)


@kernel(inner=True)
def own_pair(status, frame, size, distance):
    """Whether Newton's result is extremal indeed (or the end of a patch), and no farther apart than the distance."""
    if status == NOT_CONVERGED:
        return False
    if status == LEFT_PATCH:
        d = sub(frame[4], frame[3])
        return dot(d, d) <= distance * distance
    r = frame[9]
    return abs(r[0]) + abs(r[1]) < 1e-9 * size and abs(r[2]) + abs(r[3]) < 1e-9 and abs(frame[10]) <= distance


@kernel(inner=True)
def global_start(table, pool, f, g, rotation, shift, size):
    """Status, parameters and gap of the extremal pair with the smallest |gap| among those found."""
    of = table[f + CELLS]
    og = table[g + CELLS]
    nf = table[f + CELL_COUNT]
    ng = table[g + CELL_COUNT]
    px = np.empty(ng)
    py = np.empty(ng)
    pz = np.empty(ng)
    for j in range(ng):
        o = og + CELL * j
        px[j], py[j], pz[j] = add(matvec(rotation, (pool[o + 2], pool[o + 3], pool[o + 4])), shift)
    nearest = np.empty(nf, np.int64)
    distance = np.empty(nf)
    for i in range(nf):
        o = of + CELL * i
        x = pool[o + 2]
        y = pool[o + 3]
        z = pool[o + 4]
        best = 1e300
        where = 0
        for j in range(ng):
            d = (px[j] - x) * (px[j] - x) + (py[j] - y) * (py[j] - y) + (pz[j] - z) * (pz[j] - z)
            if d < best:
                best = d
                where = j
        nearest[i] = where
        distance[i] = math.sqrt(best)
    best_status = NOT_CONVERGED
    best_gap = 1e300
    nearest_start = 1e300
    upper = 1e300
    best_x = (0.0, 0.0, 0.0, 0.0)
    for _ in range(CANDIDATES):
        i = 0
        for k in range(nf):
            if distance[k] < distance[i]:
                i = k
        if distance[i] >= 1e300:
            break
        a = of + CELL * i
        b = og + CELL * nearest[i]
        reach = pool[a + 8] + pool[b + 8]
        if best_status != NOT_CONVERGED and distance[i] - 2.0 * reach > abs(best_gap):
            break
        start = (pool[a], pool[a + 1], pool[b], pool[b + 1])
        status, x, _count, frame, _h = solve_pair(table, pool, f, g, rotation, shift, start, size, math.inf, 0.0)
        limit = distance[i]
        likely = best_gap >= 1e300 or distance[i] - reach <= abs(best_gap)
        if likely and not own_pair(status, frame, size, min(limit, upper)):
            start, reached = approach(table, pool, f, g, rotation, shift, start, 0.0)
            crossing = reached <= CROSSING * limit
            if not crossing:
                # Apart here: the minimum is no farther than the points found.
                upper = min(upper, reached + 1e-12 * size)
                limit = upper
            else:
                # Crossing here: how deep is not known from a distance, but samples are as dense as this.
                limit += reach
                start, _merit = approach(table, pool, f, g, rotation, shift, start, reach)
            if crossing or not own_pair(status, frame, size, limit):
                status, x, _count, frame, _h = solve_pair(
                    table, pool, f, g, rotation, shift, start, size, math.inf, 0.0
                )
        if own_pair(status, frame, size, limit):
            gap = frame[10]
            # A true extremum beats a point held at the end of a patch.
            better = abs(gap) < abs(best_gap)
            if best_status == LEFT_PATCH and status != LEFT_PATCH:
                better = True
            if status == LEFT_PATCH and (best_status == CONVERGED or best_status == SINGULAR):
                better = False
            if better:
                best_status = status
                best_gap = gap
                best_x = x
        elif best_gap >= 1e300 and distance[i] < nearest_start:
            # Nothing found yet: at least the nearest points known.
            nearest_start = distance[i]
            best_x = start
        # Neighbors of this cell would lead to the same minimum.
        for k in range(nf):
            o = of + CELL * k
            d = (pool[o + 2] - pool[a + 2]) ** 2 + (pool[o + 3] - pool[a + 3]) ** 2 + (pool[o + 4] - pool[a + 4]) ** 2
            if d <= (pool[a + 8] + pool[o + 8]) ** 2:
                distance[k] = 1e300
    return best_status, best_x, best_gap


@kernel
def find_pair(table, pool, f, g, q, x, size, out):
    """One pair for Python: from x, or a global start where x is NaN.

    out: parameters (4), point of f (3), point of g (3), normal (3), gap; all in world axes. Returns the status.
    """
    turn_f = rotation(q, 0)
    turn, shift = relative_pose(q, 0, turn_f, 1, rotation(q, 1))
    if math.isnan(x[0]):
        status, x, _gap = global_start(table, pool, f, g, turn, shift, size)
        frame = pair_frame(table, pool, f, g, turn, shift, x)
    else:
        status, x, _count, frame, _h = solve_pair(table, pool, f, g, turn, shift, x, size, math.inf, 0.0)
    origin = position(q, 0)
    out[0], out[1], out[2], out[3] = x
    out[4], out[5], out[6] = add(matvec(turn_f, frame[3]), origin)
    out[7], out[8], out[9] = add(matvec(turn_f, frame[4]), origin)
    out[10], out[11], out[12] = matvec(turn_f, frame[0])
    out[13] = frame[10]
    return status
