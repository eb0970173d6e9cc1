# mypy: ignore-errors
"""Loops around the library's kernels, so that a time is of the kernel and not of the call from Python.

Every result is added up or stored: what nobody reads the compiler leaves out.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._lanes import lane, load_lanes
from assembly._record import Store
from assembly.geometry.splines.evaluate import surface_lanes, surface_point
from assembly.geometry.vec import add
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.brep.records import FACE
from assembly.proximity.bvh.tree import pairs_within
from assembly.proximity.clearance.pair_looks import ON_WAY
from assembly.proximity.extrema.face_face import solve_pair
from assembly.proximity.extrema.face_frames import pair_frame
from assembly.proximity.extrema.feature_pair import two_face_frame
from assembly.proximity.extrema.feature_query import feature_derivatives
from assembly.proximity.extrema.pair_matrix import pair_matrix
from assembly.proximity.extrema.rates import RATES, ZED, feature_record, into_quaternions
from assembly.proximity.manifolds.flat_pair import flat_rows
from assembly.proximity.manifolds.round_pair import round_rows


@kernel
def lanes_along(table, pool, u, v):
    """Point and all second derivatives along a path, as four-lane values."""
    total = 0.0 * load_lanes(pool, 0)
    for i in range(u.size):
        a, au, av, auu, auv, avv = surface_lanes(Store(table, pool), 0, u[i], v[i])
        total = total + a + au + av + auu + auv + avv
    return lane(total, 0) + lane(total, 1) + lane(total, 2)


@kernel
def points_along(table, pool, u, v):
    """The same, as 3-tuples."""
    total = (0.0, 0.0, 0.0)
    for i in range(u.size):
        a, au, av, auu, auv, avv = surface_point(table, pool, 0, u[i], v[i])
        total = add(total, add(add(a, add(au, av)), add(auu, add(auv, avv))))
    return total[0] + total[1] + total[2]


@kernel
def solve_pairs(table, pool, records, q, starts, sizes, close, times, parameters, gaps, statuses):
    """Newton from every start, each `times` over; returns all iterations.

    records (n, 2): the two surfaces; q (n, 2, 7); starts and parameters (n, 4); sizes (n,).
    `close` is that of `solve_pair`.
    """
    total = 0
    for i in range(records.shape[0]):
        start = (starts[i, 0], starts[i, 1], starts[i, 2], starts[i, 3])
        for _ in range(times):
            pose = relative_pose(q[i], 0, rotation(q[i], 0), 1, rotation(q[i], 1))
            surfaces = (records[i, 0], records[i, 1])
            found = solve_pair(Store(table, pool), surfaces, pose, start, sizes[i], math.inf, close, False)
            total += found.steps
            statuses[i] = found.status
            gaps[i] = found.frame.gap
            parameters[i, 0], parameters[i, 1], parameters[i, 2], parameters[i, 3] = found.parameters
    return total


@kernel
def evaluate_pairs(table, pool, records, parameters, times):
    """The two surface evaluations of every pair, each `times` over."""
    total = (0.0, 0.0, 0.0)
    for i in range(records.shape[0]):
        for _ in range(times):
            for side in range(2):
                a, au, av, auu, auv, avv = surface_point(
                    table, pool, records[i, side], parameters[i, 2 * side], parameters[i, 2 * side + 1]
                )
                total = add(total, add(add(a, add(au, av)), add(auu, add(auv, avv))))
    return total[0] + total[1] + total[2]


@kernel
def contact_jacobians(table, pool, records, q, parameters, size, times, record, row, out):
    """d(u_f, v_f, u_g, v_g) / d(q_f, q_g) of every pair, each `times` over: `feature_derivatives` without the gap's.

    record (1, RECORD), row (12,) and out (5, 14) are room to work in.
    """
    total = 0.0
    for i in range(records.shape[0]):
        x = (parameters[i, 0], parameters[i, 1], parameters[i, 2], parameters[i, 3])
        for _ in range(times):
            turn = rotation(q[i], 0)
            pose = relative_pose(q[i], 0, turn, 1, rotation(q[i], 1))
            frame = pair_frame(Store(table, pool), records[i, 0], records[i, 1], pose, x)
            curvature = pair_matrix(frame.shape_f, frame.shape_g, frame.gap, 1e-9 / size)
            k11, k12, k22 = curvature.k
            both = two_face_frame(frame, curvature)
            feature_record(turn, pose.shift, both, (k11, k12, k12, k22), record, 0)
            for k in range(4):
                for j in range(12):
                    row[j] = 0.0
                    for l in range(4):
                        row[j] += record[0, RATES + 4 * k + l] * record[0, ZED + 12 * l + j]
                into_quaternions(row, q[i], out, k)
            total += out[0, 0]
    return total


@kernel
def all_derivatives(table, pool, records, q, parameters, size, times, out, hessian):
    """Jacobian, gradient and Hessian of every pair, each `times` over."""
    total = 0.0
    for i in range(records.shape[0]):
        x = (parameters[i, 0], parameters[i, 1], parameters[i, 2], parameters[i, 3])
        for _ in range(times):
            # A constant has a type of its own, for which the entry would be compiled again.
            face = np.int64(FACE)
            features = (face, records[i, 0]), (face, records[i, 1])
            error, _regular = feature_derivatives((table, pool), features, q[i], x, (0.0, 0.0, 0.0), size, out, hessian)
            total += error + hessian[11, 0]
    return total


@kernel
def facing_bodies(table, pool, trees, q, reach, stack, out):
    """Pairs of elements of all pairs of bodies at poses q (n, 7) that may hold an extremal pair; -1 without room."""
    total = 0
    for j in range(trees.size):
        turn_j = rotation(q, j)
        for i in range(j):
            pose = relative_pose(q, i, rotation(q, i), j, turn_j)
            count = pairs_within(Store(table, pool), (trees[i], trees[j]), pose, reach, stack, out[total:])
            if count < 0 or count > out.shape[0] - total:
                return -1
            total += count
    return total


@kernel
def flat_manifolds_along(faces, turns, shifts, tolerance, rows):
    """Rows of two plane faces, (frame, segments) each, at many poses of the second: turns (n, 9), shifts (n, 3)."""
    (frame, segments), (other, others) = faces
    total = 0.0
    for i in range(len(turns)):
        count, bound = flat_rows(frame, segments, other, others, turns[i], shifts[i], tolerance, rows)
        total += count + bound
    return total


@kernel
def round_manifolds_along(hollow, full, turns, shifts, rows):
    """Rows of a shaft in its bore at many poses of the shaft: turns (n, 9), shifts (n, 3)."""
    total = 0.0
    for i in range(len(turns)):
        count, bound = round_rows(hollow, full, turns[i], shifts[i], rows)
        total += count + bound
    return total


@kernel
def looks_along(addresses, lent, poses, moves, touching, codes, seconds):
    """Looks at pairs of bodies on the way to poses (k, n, 7), one after the other, as ticks have them.

    addresses: of `stay_clear` and of a clock. Writes how each look ended and how long it took [ns].
    """
    proof, clock = addresses
    for k in range(len(poses)):
        begin = call_address(clock, ())
        codes[k] = call_address(proof, (lent, poses[k], moves, touching, (ON_WAY, 0), (0, 0)))
        seconds[k] = call_address(clock, ()) - begin
