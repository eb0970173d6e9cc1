"""A global start for an extremal pair: the nearest cells of two surfaces, then Newton.

Every surface carries cells: small pieces with a sample point and a bounding sphere. For every cell of f the nearest
sample of g is found, which leads to the closest points where the surfaces are apart; where they are not, the best by

    |d|^2 + w (1 + n_f.n_g),

which prefers normals that oppose each other and leads to the deepest points where the surfaces overlap. From the best
such pairs, far enough from one another to belong to different extrema, Newton runs. Of what it finds, extrema with
opposed outward normals (solids face each other) come first, then the smallest |gap|.

Newton's method goes to any extremum, also to one on the far side of a ball. A pair is rejected if it is farther apart
than the samples it came from or, where cells are coarse, if direct search leads nearer from it. Direct search uses no
derivatives and passes poles and edges; Newton then runs from where it ends.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import (
    CELL_SIZE,
    cell_at,
    surface_at,
    surface_point,
)
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, scale, sub
from assembly.kinematics.motion import IDENTITY, relative_pose, rotation
from assembly.proximity.extrema.face_face import CONVERGED, LEFT_PATCH, NOT_CONVERGED, SINGULAR, solve_pair
from assembly.proximity.extrema.face_frames import own_frame

# How many of the nearest and of the best aligned samples are tried.
NEAREST = 16
ALIGNED = 8
# Direct search: at most so many rounds, from steps of 1/32 of the domain down to 1e-5 of that.
LEVELS = 200
# Cells are coarse where their spheres are larger than this part of the smaller surface's extent.
COARSE = 0.25
# Surfaces nearer than this part of the samples' distance cross there.
CROSSING = 1e-3
# w as a part of the square of the smaller extent.
ALIGNMENT = 0.1

# A pair that was found, with what it is judged by.
RankedPair = namedtuple(
    "RankedPair",
    [
        "rank",  # 0: solids face each other; 1: they do not; 2: no extremum, at the end of a patch; 3: none yet
        "gap",  # signed
        "status",
        "parameters",  # (u_f, v_f, u_g, v_g)
    ],
)


@kernel(inner=True)
def cell_samples(store, r, pose, samples):
    """Points and outward normals of the cells' samples, moved by a pose, (count, 6). Returns their extent."""
    patch = surface_at(store.table, r)
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    for i in range(patch.cell_count):
        cell = cell_at(store.pool, patch.cells + CELL_SIZE * i)
        p, su, sv, _uu, _uv, _vv = surface_point(store.table, store.pool, r, cell.parameters[0], cell.parameters[1])
        normal = cross(su, sv)
        length = math.sqrt(dot(normal, normal))
        n = matvec(pose.rotation, scale(float(patch.sign) / length if length > 0.0 else 0.0, normal))
        p = add(matvec(pose.rotation, p), pose.shift)
        samples[i, 0], samples[i, 1], samples[i, 2] = p
        samples[i, 3], samples[i, 4], samples[i, 5] = n
        lo = (min(lo[0], p[0]), min(lo[1], p[1]), min(lo[2], p[2]))
        hi = (max(hi[0], p[0]), max(hi[1], p[1]), max(hi[2], p[2]))
    d = (hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2])
    return math.sqrt(dot(d, d))


@kernel(inner=True)
def best_samples(a, b, weight, nearest, score):
    """For every sample of f the best sample of g: the nearest one, or with a weight the best by alignment too."""
    for i in range(a.shape[0]):
        x = a[i, 0]
        y = a[i, 1]
        z = a[i, 2]
        u = weight * a[i, 3]
        v = weight * a[i, 4]
        w = weight * a[i, 5]
        best = math.inf
        where = 0
        for j in range(b.shape[0]):
            dx = b[j, 0] - x
            dy = b[j, 1] - y
            dz = b[j, 2] - z
            d = dx * dx + dy * dy + dz * dz
            if weight > 0.0:
                d += u * b[j, 3] + v * b[j, 4] + w * b[j, 5]
            if d < best:
                best = d
                where = j
        nearest[i] = where
        score[i] = math.sqrt(max(best + weight, 0.0))


@kernel(inner=True)
def opposed(frame, rotation, store, g, x):
    """Whether the outward normal of g opposes that of f."""
    normal = own_frame(store, g, x[2], x[3]).normal
    return dot(normal, matvec_t(rotation, frame.normal)) < 0.0


@kernel(inner=True, allocates=True)
def approach(store, f, g, pose, x):
    """Parameters with a smaller distance, and that distance, by direct search over nine points of each surface."""
    patch = surface_at(store.table, f)
    other = surface_at(store.table, g)
    fu = 0.03125 * (store.pool[patch.breaks_u + patch.spans_u] - store.pool[patch.breaks_u])
    fv = 0.03125 * (store.pool[patch.breaks_v + patch.spans_v] - store.pool[patch.breaks_v])
    gu = 0.03125 * (store.pool[other.breaks_u + other.spans_u] - store.pool[other.breaks_u])
    gv = 0.03125 * (store.pool[other.breaks_v + other.spans_v] - store.pool[other.breaks_v])
    finest = 1e-5 * fu
    points = np.empty((9, 3))
    at = np.empty((9, 2))
    best = 1e300
    for _ in range(LEVELS):
        cu, cv, cs, ct = x
        for k in range(9):
            u, v, _clamped = into_domain(store, g, cs + (k % 3 - 1) * gu, ct + (k // 3 - 1) * gv)
            at[k, 0] = u
            at[k, 1] = v
            point = surface_point(store.table, store.pool, g, u, v).point
            points[k, 0], points[k, 1], points[k, 2] = add(matvec(pose.rotation, point), pose.shift)
        before = best
        for k in range(9):
            u, v, _clamped = into_domain(store, f, cu + (k % 3 - 1) * fu, cv + (k // 3 - 1) * fv)
            p = surface_point(store.table, store.pool, f, u, v).point
            for j in range(9):
                d = (points[j, 0] - p[0]) ** 2 + (points[j, 1] - p[1]) ** 2 + (points[j, 2] - p[2]) ** 2
                if d < best:
                    best = d
                    x = (u, v, at[j, 0], at[j, 1])
        # Little progress: the valley is no wider than the steps are long.
        if best > 0.998 * before:
            fu *= 0.5
            fv *= 0.5
            gu *= 0.5
            gv *= 0.5
        if fu <= finest:
            break
    return x, math.sqrt(best)


@kernel(inner=True)
def is_near(found, distance):
    """Whether Newton's result is no farther apart than points that are known; else it is another pair."""
    if found.status == NOT_CONVERGED:
        return False
    if found.status == LEFT_PATCH:
        d = sub(found.frame.point_g, found.frame.point_f)
        return dot(d, d) <= distance * distance
    return abs(found.frame.gap) <= distance


@kernel(inner=True)
def take(store, g, rotation, found, best):
    """The better one, as a `RankedPair`, of a pair that Newton's method found and the best one so far.

    A true extremum beats a point held at the end of a patch, and one where solids face each other beats all.
    """
    rank = 2.0
    if found.status == CONVERGED or found.status == SINGULAR:
        rank = 0.0 if opposed(found.frame, rotation, store, g, found.parameters) else 1.0
    gap = found.frame.gap
    if rank < best.rank or (rank == best.rank and abs(gap) < abs(best.gap)):
        return RankedPair(rank, gap, np.int64(found.status), found.parameters)
    return best


@kernel(inner=True)
def next_candidate(store, f, a, nearest, score, i):
    """The cell with the best score, after the neighbors of cell i, which lead to the same extremum, are struck out."""
    patch = surface_at(store.table, f)
    radius = cell_at(store.pool, patch.cells + CELL_SIZE * i).radius
    for k in range(a.shape[0]):
        dx = a[k, 0] - a[i, 0]
        dy = a[k, 1] - a[i, 1]
        dz = a[k, 2] - a[i, 2]
        reach = radius + cell_at(store.pool, patch.cells + CELL_SIZE * k).radius
        if dx * dx + dy * dy + dz * dz <= reach * reach:
            score[k] = math.inf
    return lowest(score)


@kernel(inline=True)
def start_in(cell_f, cell_g):
    """The parameters of two cells' points."""
    u, v = cell_f.parameters[0], cell_f.parameters[1]
    return u, v, cell_g.parameters[0], cell_g.parameters[1]


@kernel(inner=True)
def lowest(score):
    """Index of the least score."""
    i = 0
    for k in range(score.size):
        if score[k] < score[i]:
            i = k
    return i


@kernel(inner=True, allocates=True)
def global_start(store, f, g, pose, size):
    """Status, parameters and gap of the best extremal pair found; where there is none, the nearest points known."""
    patch = surface_at(store.table, f)
    other = surface_at(store.table, g)
    nf = patch.cell_count
    a = np.empty((nf, 6))
    b = np.empty((other.cell_count, 6))
    extent = cell_samples(store, f, IDENTITY, a)
    extent = min(extent, cell_samples(store, g, pose, b))
    nearest = np.empty(nf, np.int64)
    score = np.empty(nf)
    best_samples(a, b, 0.0, nearest, score)
    best = RankedPair(3.0, math.inf, np.int64(NOT_CONVERGED), (0.0, 0.0, 0.0, 0.0))
    crossing = False
    upper = math.inf
    i = lowest(score)
    for attempt in range(NEAREST):
        if score[i] == math.inf:
            break
        cell_f = cell_at(store.pool, patch.cells + CELL_SIZE * i)
        cell_g = cell_at(store.pool, other.cells + CELL_SIZE * nearest[i])
        # Cells whose spheres are farther apart than the best pair hold no nearer one.
        if score[i] - 1.5 * (cell_f.radius + cell_g.radius) > min(abs(best.gap), upper):
            break
        start = start_in(cell_f, cell_g)
        if attempt == 0:
            best = RankedPair(3.0, math.inf, np.int64(NOT_CONVERGED), start)
        found = solve_pair(store, (f, g), pose, start, size, math.inf, 0.0, False)
        limit = score[i]
        near = is_near(found, limit)
        coarse = cell_f.radius + cell_g.radius > COARSE * extent
        if near and coarse and found.status != LEFT_PATCH and found.frame.gap > 0.0:
            # Samples are far apart: an extremum nearer than they are need not be a minimum; others may be nearer still.
            start, limit = approach(store, f, g, pose, found.parameters)
            limit += 1e-12 * size
            near = found.frame.gap <= limit
        elif not near:
            start, limit = approach(store, f, g, pose, start)
            limit += 1e-12 * size
        if not near:
            if limit <= CROSSING * min(score[i], extent):
                # Every distance vanishes where the surfaces cross: nearness says nothing there.
                crossing = True
                break
            # The minimum is no farther than the points found.
            upper = min(upper, limit)
            found = solve_pair(store, (f, g), pose, start, size, math.inf, 0.0, False)
        if is_near(found, limit):
            best = take(store, g, pose.rotation, found, best)
        i = next_candidate(store, f, a, nearest, score, i)
    weight = ALIGNMENT * extent * extent
    for _ in range(3):
        # The surfaces overlap, or do not face each other: the deeper the overlap, the more weight the normals need.
        if not crossing and best.rank == 0.0 and best.gap >= 0.0:
            break
        best_samples(a, b, weight, nearest, score)
        i = lowest(score)
        for _ in range(ALIGNED):
            if score[i] == math.inf:
                break
            cell_f = cell_at(store.pool, patch.cells + CELL_SIZE * i)
            cell_g = cell_at(store.pool, other.cells + CELL_SIZE * nearest[i])
            start = start_in(cell_f, cell_g)
            found = solve_pair(store, (f, g), pose, start, size, math.inf, 0.0, False)
            if found.status != NOT_CONVERGED:
                best = take(store, g, pose.rotation, found, best)
            i = next_candidate(store, f, a, nearest, score, i)
        if best.rank == 0.0:
            break
        weight *= 5.0
    return best.status, best.parameters, best.gap


@kernel(signatures="(i8[::1], f8[::1], UniTuple(i8, 2), UniTuple(i8, 2), f8[:, ::1], f8[:, ::1], i8)")
def start_surfaces(table, pool, surfaces, bodies, q, tracked, r):
    """A global start for surfaces of two bodies of a scene, into tracked[r]. Returns the status."""
    i, j = bodies
    pose = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
    status, x, _gap = global_start(Store(table, pool), surfaces[0], surfaces[1], pose, 1.0)
    tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3] = x
    return status
