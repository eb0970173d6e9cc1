"""A global start for an extremal pair: the nearest cells of two surfaces, then Newton.

Every surface carries cells: small pieces with a sample point and a bounding sphere. The nearest sample of g
is found for every cell of f; from the nearest such pairs, far enough from one another to
belong to different minima, Newton runs, and the pair with the smallest |gap| wins. A pair of cells whose spheres are
farther apart than the best pair found is never tried.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.spline import CELL_COUNT, CELLS
from assembly.geometry.vec import add, matvec
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.extremal import CONVERGED, LEFT_PATCH, NOT_CONVERGED, SINGULAR, pair_frame, solve_pair

CELL = 9  # doubles a cell: u, v, point, sphere's center, radius
CANDIDATES = 8


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
        if status != NOT_CONVERGED:
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
        # Neighbors of this cell would lead to the same minimum.
        for k in range(nf):
            o = of + CELL * k
            d = (pool[o + 2] - pool[a + 2]) ** 2 + (pool[o + 3] - pool[a + 3]) ** 2 + (pool[o + 4] - pool[a + 4]) ** 2
            if math.sqrt(d) <= 2.0 * (pool[a + 8] + pool[o + 8]):
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
