"""One pair of features for Python: where it is, and how it and its gap move with the two poses."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store, place_of, record_dtype, record_view, size_of
from assembly.geometry.vec import add, matvec, matvec_t
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.brep.records import FACE
from assembly.proximity.extrema.feature_pair import feature_record, features_at, solve_features
from assembly.proximity.extrema.rates import (
    RECORD,
    add_gap_terms,
    derivatives_at,
    gradient_row,
    into_quaternions,
)

# What is written of a pair, in world axes.
FEATURE_PAIR = record_dtype(
    "f8",
    parameters=4,  # (u_f, v_f, u_g, v_g); of an edge (t, 0), of a vertex what it was
    point_f=3,  # [length]
    point_g=3,  # [length]
    normal=3,  # unit normal from f towards g
    gap=1,  # normal.(point_g - point_f) [length]
    isolated=1,  # 1: no part of a continuum
    proper=1,  # 1: two surfaces do not cross there
    fold=1,  # how far the pair is from a fold: determinant over squared norm of its equations' matrix
    residual=4,  # two lengths, two tilts
)
feature_pair_at = record_view(FEATURE_PAIR)
PAIR = size_of(FEATURE_PAIR)
POINT_F = place_of(FEATURE_PAIR, "point_f")
POINT_G = place_of(FEATURE_PAIR, "point_g")
NORMAL = place_of(FEATURE_PAIR, "normal")
GAP = place_of(FEATURE_PAIR, "gap")
ISOLATED = place_of(FEATURE_PAIR, "isolated")
PROPER = place_of(FEATURE_PAIR, "proper")
FOLD = place_of(FEATURE_PAIR, "fold")


@kernel(
    signatures="(i8[::1], f8[::1], i8, i8, i8, i8, f8[:, ::1], UniTuple(f8, 4), UniTuple(f8, 3), f8, f8, f8[::1])",
)
def find_features(table, pool, kind_f, f, kind_g, g, q, x, n, size, turn, out):
    """`solve_features` at the poses q (2, 7); n and what is written to `out` (PAIR,) are in world axes.

    Returns the status.
    """
    turn_f = rotation(q, 0)
    pose = relative_pose(q, 0, turn_f, 1, rotation(q, 1))
    known = matvec_t(turn_f, (n[0], n[1], n[2]))
    status, y, frame = solve_features(Store(table, pool), kind_f, f, kind_g, g, pose, x, known, size, turn)
    origin = position(q, 0)
    pf = add(matvec(turn_f, frame.point_f), origin)
    pg = add(matvec(turn_f, frame.point_g), origin)
    normal = matvec(turn_f, frame.normal)
    pair = feature_pair_at(out, 0)
    for k in range(3):
        pair.point_f[k] = pf[k]
        pair.point_g[k] = pg[k]
        pair.normal[k] = normal[k]
    for k in range(4):
        pair.parameters[k] = y[k]
        pair.residual[k] = frame.residual[k]
    pair.gap = frame.gap
    pair.isolated = 1.0 if frame.isolated else 0.0
    pair.proper = 1.0 if frame.proper else 0.0
    pair.fold = frame.fold
    return status


@kernel(
    signatures=(
        "(i8[::1], f8[::1], i8, i8, i8, i8, f8[:, ::1], UniTuple(f8, 4), UniTuple(f8, 3), f8, f8[:, ::1], f8[:, ::1])"
    ),
)
def feature_derivatives(table, pool, kind_f, f, kind_g, g, q, x, n, size, first, hessian):
    """d(parameters)/dq and d(gap)/dq in `first` (5, 14), the gap's Hessian over the twists in `hessian` (12, 12).

    Rates of what a feature has no parameter for are zero, of polar coordinates at a pole NaN. Returns the pair's
    residual (lengths over `size`, and tilts), infinite where a feature has no tangent, and whether it is isolated.
    """
    turn_f = rotation(q, 0)
    pose = relative_pose(q, 0, turn_f, 1, rotation(q, 1))
    known = matvec_t(turn_f, (n[0], n[1], n[2]))
    frame = features_at(Store(table, pool), kind_f, f, kind_g, g, pose, x, known, size)
    if not frame.regular:
        return math.inf, False
    r = frame.residual
    error = max(abs(r[0]), abs(r[1])) / size + max(abs(r[2]), abs(r[3]))
    records = np.empty((1, RECORD))
    derivatives = derivatives_at(records, 0)
    gradient = np.empty((1, 12))
    row = np.empty(12)
    feature_record(turn_f, pose.shift, frame, records, 0)
    gradient_row(records, 0, gradient, 0)
    for j in range(12):
        row[j] = gradient[0, j]
    into_quaternions(row, q, first, 4)
    for i in range(4):
        rates = frame.rates_f if i < 2 else frame.rates_g
        kind = kind_f if i < 2 else kind_g
        at_pole = kind == FACE and rates[0] == 0.0 and rates[1] == 0.0
        for j in range(12):
            row[j] = math.nan if at_pole else 0.0
            for l in range(4):
                row[j] += derivatives.rates[i, l] * derivatives.zed[l, j]
        into_quaternions(row, q, first, i)
    for i in range(12):
        for j in range(12):
            hessian[i, j] = 0.0
    add_gap_terms(records, 0, gradient, 0, 1.0, 0.0, hessian, 0, 6)
    for i in range(12):
        for j in range(i):
            hessian[i, j] = hessian[j, i]
    return error, frame.isolated
