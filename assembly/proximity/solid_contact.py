"""A contact of two solids as a solve tracks it: the pair of features that is closest, its coordinates, its normal.

Of every contact a solve keeps `TRACK` numbers: the coordinates of the pair (4), the two features, and the normal in the
axes of body f, which tells on which side of each other two edges are where they touch.

The kernels here are large, and few scenes need them: loops call them by address (`_kernel.call_address`).
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, matvec
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.extremal import CONVERGED, SINGULAR
from assembly.proximity.feature_pair import feature_record
from assembly.proximity.nearest import APART, nearest_features
from assembly.proximity.switching import track_features
from assembly.proximity.velocity import RECORD

FEATURE_F, FEATURE_G, PAIR_NORMAL, TRACK = 4, 5, 6, 9
# Behind a record: whether surfaces do not cross at the pair, and how far it is from a fold.
PROPER, FOLD, CONTACT_RECORD = RECORD, RECORD + 1, RECORD + 2


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


@kernel
def search_solids(table, pool, shell_f, shell_g, i, j, q, tracked, r):
    """The closest features wherever they are, into tracked[r]. Returns whether there are any."""
    relative, shift = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
    status, feature_f, feature_g, x, _gap = nearest_features(table, pool, shell_f, shell_g, relative, shift, 1.0)
    # The normal is not known before the pair is tracked.
    write_tracked(x, feature_f, feature_g, (0.0, 0.0, 0.0), tracked, r)
    return 1 if status == APART else 0


@kernel
def solid_pair(table, pool, shell_f, shell_g, q, tracked, out):
    """The pair tracked in row 0, for Python.

    q : (2, 7), poses of f and g. out: point of f (3), point of g (3), normal (3), all in world axes, gap. Returns the
    status.
    """
    turn = rotation(q, 0)
    relative, shift = relative_pose(q, 0, turn, 1, rotation(q, 1))
    status, feature_f, feature_g, x, frame, _switches = track_row(
        table, pool, shell_f, shell_g, relative, shift, tracked, 0, math.inf
    )
    write_tracked(x, feature_f, feature_g, frame[0], tracked, 0)
    origin = position(q, 0)
    out[0], out[1], out[2] = add(matvec(turn, frame[3]), origin)
    out[3], out[4], out[5] = add(matvec(turn, frame[4]), origin)
    out[6], out[7], out[8] = matvec(turn, frame[0])
    out[9] = frame[5]
    return status
