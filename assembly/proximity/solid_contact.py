"""A contact of two solids as a solve tracks it: the pair of features that is closest, its coordinates, its normal.

Of every contact a solve keeps `TRACK` numbers: the coordinates of the pair (4), the two features, and the normal in the
axes of body f, which tells on which side of each other two edges are where they touch.

The kernels here are large, and few scenes need them: loops call them by address (`_kernel.call_address`).
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, scale, sub
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.extremal import CONVERGED, SINGULAR, own_frame
from assembly.proximity.feature_pair import feature_record
from assembly.proximity.nearest import CROSSING, search
from assembly.proximity.shell import EDGE, EDGE_CURVE, EDGE_SURFACE, FACE
from assembly.proximity.switching import feature_at, feature_kind, on_surface, track_features
from assembly.proximity.velocity import RECORD

FEATURE_F, FEATURE_G, PAIR_NORMAL, TRACK = 4, 5, 6, 9
# Behind a record: whether surfaces do not cross at the pair, and how far it is from a fold.
PROPER, FOLD, CONTACT_RECORD = RECORD, RECORD + 1, RECORD + 2
# How far crossing solids are drawn apart at first, and at most; the shortest step back.
FIRST, FARTHEST, SHORTEST = 0.03125, 64.0, 1e-4


@kernel(inline=True)
def write_tracked(x, feature_f, feature_g, n, tracked, r):
    """Parameters, features and normal of a pair."""
    tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3] = x
    tracked[r, FEATURE_F] = float(feature_f)
    tracked[r, FEATURE_G] = float(feature_g)
    for i in range(3):
        tracked[r, PAIR_NORMAL + i] = n[i]


@kernel(inner=True)
def track_row(table, pool, shell_f, shell_g, relative, shift, start, r, patience):
    """`track_features` from the tracked values start[r]."""
    return track_features(
        table,
        pool,
        shell_f,
        shell_g,
        relative,
        shift,
        np.int64(start[r, FEATURE_F]),
        np.int64(start[r, FEATURE_G]),
        (start[r, 0], start[r, 1], start[r, 2], start[r, 3]),
        (start[r, PAIR_NORMAL], start[r, PAIR_NORMAL + 1], start[r, PAIR_NORMAL + 2]),
        1.0,
        patience,
    )


@kernel
def track_solids(table, pool, shell_f, shell_g, i, j, q, start, patience, records, tracked, r):
    """Newton and switching from the tracked values start[r]; fills record r and tracked[r]. Returns the status.

    Bodies i and j stand as q says; no step turns a normal by more than `patience`.
    """
    turn = rotation(q, i)
    relative, shift = relative_pose(q, i, turn, j, rotation(q, j))
    status, feature_f, feature_g, x, frame, _switches = track_row(
        table, pool, shell_f, shell_g, relative, shift, start, r, patience
    )
    if status == CONVERGED or status == SINGULAR:
        feature_record(turn, shift, frame, records, r)
        records[r, PROPER] = 1.0 if frame[14] else 0.0
        records[r, FOLD] = frame[15]
        write_tracked(x, feature_f, feature_g, frame[0], tracked, r)
    return status


@kernel(inner=True)
def outward(table, pool, shell, code, u, v):
    """The outward normal at a point of a face; of an edge, that of its first face."""
    if feature_kind(table, shell, code) == FACE:
        return own_frame(table, pool, feature_at(table, shell, code), u, v)[1]
    if feature_kind(table, shell, code) == EDGE:
        edge = feature_at(table, shell, code)
        surface = table[edge + EDGE_SURFACE]
        u, v, _p, _along, _normal = on_surface(table, pool, surface, table[edge + EDGE_CURVE], u)
        return own_frame(table, pool, surface, u, v)[1]
    return (0.0, 0.0, 0.0)


@kernel(inner=True)
def draw_apart(table, pool, shell_f, shell_g, relative, shift, code_f, code_g, x, tracked, r):
    """The pair of solids that cross at a point: g is drawn out along the normals there, and led back.

    Led back in steps that may be halved, the closest pair passes through touching and says how deep the solids are in
    each other. Returns whether it could be followed all the way.
    """
    n = sub(
        outward(table, pool, shell_f, code_f, x[0], x[1]),
        matvec(relative, outward(table, pool, shell_g, code_g, x[2], x[3])),
    )
    length = math.sqrt(dot(n, n))
    if not length > 1e-6:
        return False
    n = scale(1.0 / length, n)
    away = FIRST
    while away <= FARTHEST:
        status, f, g, y, gap, _lower, _effort = search(
            table, pool, shell_f, shell_g, relative, add(shift, scale(away, n)), 1.0, math.inf
        )
        if status != CROSSING:
            break
        away *= 2.0
    if away > FARTHEST or f < 0:
        return False
    write_tracked(y, f, g, (0.0, 0.0, 0.0), tracked, r)
    step = 0.125 * away
    while away > 0.0:
        there = max(away - step, 0.0)
        status, f, g, y, frame, _switches = track_row(
            table, pool, shell_f, shell_g, relative, add(shift, scale(there, n)), tracked, r, math.inf
        )
        # The gap changes by no more than the step: a pair that jumps is another one.
        if (status == CONVERGED or status == SINGULAR) and abs(frame[5] - gap) <= 1.001 * (away - there) + 1e-12:
            away = there
            gap = frame[5]
            write_tracked(y, f, g, frame[0], tracked, r)
        else:
            step *= 0.5
            if step < SHORTEST:
                return False
    return True


@kernel
def search_solids(table, pool, shell_f, shell_g, i, j, q, tracked, r):
    """The closest features wherever they are, into tracked[r]. Returns whether there are any."""
    relative, shift = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
    status, code_f, code_g, x, _gap, _lower, _effort = search(
        table, pool, shell_f, shell_g, relative, shift, 1.0, math.inf
    )
    if code_f < 0:
        return 0
    # The normal is not known before the pair is tracked.
    write_tracked(x, code_f, code_g, (0.0, 0.0, 0.0), tracked, r)
    if status == CROSSING:
        found = draw_apart(table, pool, shell_f, shell_g, relative, shift, code_f, code_g, x, tracked, r)
        return 1 if found else 0
    return 1
