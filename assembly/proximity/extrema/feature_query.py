"""One pair of features for Python: where it is, and how it and its gap change with the two poses."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store, record_dtype, record_view, size_of
from assembly.geometry.vec import add, matvec, matvec_t
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.brep.records import FACE, Feature
from assembly.proximity.extrema.face_face import solve_pair
from assembly.proximity.extrema.face_frames import pair_frame
from assembly.proximity.extrema.feature_jets import offset_side
from assembly.proximity.extrema.feature_pair import features_at, solve_features
from assembly.proximity.extrema.feedback import descend_pair
from assembly.proximity.extrema.global_start import global_start
from assembly.proximity.extrema.rates import (
    RECORD,
    add_gap_terms,
    derivatives_at,
    feature_record,
    gradient_row,
    into_quaternions,
)

# What is written of a pair, in world axes.
_PLACED = {
    "parameters": 4,  # (u_f, v_f, u_g, v_g); of an edge (t, 0), of a vertex unchanged
    "point_f": 3,  # [length]
    "point_g": 3,  # [length]
    "normal": 3,  # unit normal from f towards g
    "gap": 1,  # normal.(point_g - point_f) [length]
}
PLACED_PAIR = record_dtype("f8", **_PLACED)
placed_pair_at = record_view(PLACED_PAIR)
PLACED = size_of(PLACED_PAIR)
# The same for any two features, and what kind of extremum their pair is.
FEATURE_PAIR = record_dtype(
    "f8",
    **_PLACED,
    isolated=1,  # 1: no part of a continuum
    proper=1,  # 1: two surfaces do not cross there
    fold=1,  # how far the pair is from a fold: determinant over squared norm of its equations' matrix
    residual=4,  # two lengths, two tilts
)
feature_pair_at = record_view(FEATURE_PAIR)
PAIR = size_of(FEATURE_PAIR)


@kernel(inner=True)
def write_pair(q, x, pf, pg, n, gap, out):
    """Write a pair, given in the axes of body f, at the poses q (2, 7) as a PLACED_PAIR at the start of `out`."""
    pair = placed_pair_at(out, 0)
    turn_f = rotation(q, 0)
    origin = position(q, 0)
    a = add(matvec(turn_f, pf), origin)
    b = add(matvec(turn_f, pg), origin)
    normal = matvec(turn_f, n)
    for k in range(4):
        pair.parameters[k] = x[k]
    for k in range(3):
        pair.point_f[k] = a[k]
        pair.point_g[k] = b[k]
        pair.normal[k] = normal[k]
    pair.gap = gap


@kernel(inline=True)
def pose_of_second(q):
    """The pose of the second of two bodies, seen from the first."""
    return relative_pose(q, 0, rotation(q, 0), 1, rotation(q, 1))


@kernel(signatures="(i8[::1], f8[::1], UniTuple(i8, 2), f8[:, ::1], UniTuple(f8, 4), f8, f8[::1])")
def find_pair(table, pool, surfaces, q, x, size, out):
    """Find a pair of two surfaces from x, by a global start where x is NaN; into a PLACED_PAIR. Returns the status."""
    store = Store(table, pool)
    pose = pose_of_second(q)
    if math.isnan(x[0]):
        status, x, _gap = global_start(store, surfaces[0], surfaces[1], pose, size)
        frame = pair_frame(store, surfaces[0], surfaces[1], pose, x)
    else:
        found = solve_pair(store, surfaces, pose, x, size, math.inf, 0.0, False)
        status, x, frame = found.status, found.parameters, found.frame
    write_pair(q, x, frame.point_f, frame.point_g, frame.normal, frame.gap, out)
    return status


@kernel(signatures="(i8[::1], f8[::1], UniTuple(i8, 2), f8[:, ::1], UniTuple(f8, 4), f8, i8, f8[::1])")
def find_descent(table, pool, surfaces, q, x, size, limit, out):
    """The pair that the descent from x leads to, into a PLACED_PAIR. Returns the status."""
    found = descend_pair(Store(table, pool), surfaces, pose_of_second(q), x, size, limit)
    frame = found.frame
    write_pair(q, found.parameters, frame.point_f, frame.point_g, frame.normal, frame.gap, out)
    return found.status


@kernel(inline=True)
def both_features(features):
    """Two `Feature` tuples, each from its kind and record."""
    (kind_f, f), (kind_g, g) = features
    return Feature(kind_f, f), Feature(kind_g, g)


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), UniTuple(UniTuple(i8, 2), 2), f8[:, ::1], UniTuple(f8, 4), UniTuple(f8, 3), "
        "f8, f8, f8[::1])"
    ),
)
def find_features(store, features, q, x, n, size, turn, out):
    """`solve_features` at the poses q (2, 7); n and what is written to `out` (PAIR,) are in world axes.

    `store` are a table and a pool, `features` kind and record of either. Returns the status.
    """
    table, pool = store
    turn_f = rotation(q, 0)
    pose = pose_of_second(q)
    known = matvec_t(turn_f, (n[0], n[1], n[2]))
    f, g = both_features(features)
    status, y, frame = solve_features(Store(table, pool), f, g, pose, x, known, size, turn)
    write_pair(q, y, frame.point_f, frame.point_g, frame.normal, frame.gap, out)
    pair = feature_pair_at(out, 0)
    for k in range(4):
        pair.residual[k] = frame.residual[k]
    pair.isolated = 1.0 if frame.isolated else 0.0
    pair.proper = 1.0 if frame.proper else 0.0
    pair.fold = frame.fold
    return status


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), UniTuple(UniTuple(i8, 2), 2), f8[:, ::1], UniTuple(f8, 4), UniTuple(f8, 3), "
        "f8, f8[:, ::1], f8[:, ::1])"
    ),
    allocates=True,
)
def feature_derivatives(store, features, q, x, n, size, first, hessian):
    """d(parameters)/dq and d(gap)/dq in `first` (5, 14), the gap's Hessian over the twists in `hessian` (12, 12).

    Rates of parameters that a feature lacks are zero, of polar coordinates at a pole NaN. Returns the pair's
    residual (lengths over `size`, and tilts), infinite where a feature has no tangent, and whether it is isolated.
    """
    turn_f = rotation(q, 0)
    pose = pose_of_second(q)
    known = matvec_t(turn_f, (n[0], n[1], n[2]))
    table, pool = store
    f, g = both_features(features)
    frame = features_at(Store(table, pool), f, g, pose, x, known, size)
    if not frame.regular:
        return math.inf, False
    r = frame.residual
    error = max(abs(r[0]), abs(r[1])) / size + max(abs(r[2]), abs(r[3]))
    records = np.empty((1, RECORD))
    derivatives = derivatives_at(records, 0)
    gradient = np.empty((1, 12))
    row = np.empty(12)
    feature_record(turn_f, pose.shift, frame, offset_side(frame.side_f, frame.gap), records, 0)
    gradient_row(records, 0, gradient, 0)
    for j in range(12):
        row[j] = gradient[0, j]
    into_quaternions(row, q, first, 4)
    for i in range(4):
        rates = frame.rates_f if i < 2 else frame.rates_g
        kind = f.kind if i < 2 else g.kind
        at_pole = kind == FACE and rates[0] == 0.0 and rates[1] == 0.0
        for j in range(12):
            row[j] = math.nan if at_pole else 0.0
            for l in range(4):
                row[j] += derivatives.rates[i, l] * derivatives.zed[l, j]
        into_quaternions(row, q, first, i)
    for i in range(12):
        for j in range(12):
            hessian[i, j] = 0.0
    add_gap_terms(records, gradient, 0, 1.0, 0.0, hessian, 0, 6)
    for i in range(12):
        for j in range(i):
            hessian[i, j] = hessian[j, i]
    return error, frame.isolated
