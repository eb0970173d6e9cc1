"""A contact of two solids as a solve tracks it: the pair of features that is closest, its coordinates, its normal.

Of every contact a solve keeps `TRACK` numbers: the coordinates of the pair (4), the two features, the normal in the
axes of body f, which tells on which side of each other two edges are where they touch, the gap, what the pair
stays with: a corner over a face, which need not be the closest one (`proximity/manager/vertex_contacts.py`), has its
features for good; of the
end of a step, whether its row stays open there for certain (`solve/loop/predict.py`); and, of a clearance's contact, by
how much its gap may be less than the least one, because it was where the solve began.

The kernels here are large, and few scenes need them: loops call them by address (`_address.call_address`).
"""

from __future__ import annotations

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly.geometry.vec import matvec_t
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.extrema.feature_pair import conforms, feature_record
from assembly.proximity.extrema.rates import RECORD
from assembly.proximity.features.global_search import CROSSING
from assembly.proximity.features.holding import hold_features
from assembly.proximity.features.nearest_query import NORMAL, PAIR
from assembly.proximity.features.switching import track_features

FEATURE_F, FEATURE_G, PAIR_NORMAL, PAIR_GAP, STAYS, IDLE, ALLOWED, TRACK = 4, 5, 6, 9, 10, 11, 12, 13
# Behind a record: whether surfaces do not cross at the pair, how far it is from a fold, and how far the bodies may move
# until a row that is open needs its pair again.
PROPER, FOLD, SLACK, CONTACT_RECORD = RECORD, RECORD + 1, RECORD + 2, RECORD + 3
# What `PROPER` is, beside 1 and 0, where the surfaces are equally near all around: then no point is that of a minimum.
CONFORMING = 2.0


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
    """`track_features` from the tracked values start[r], or `hold_features`."""
    code_f = np.int64(start[r, FEATURE_F])
    code_g = np.int64(start[r, FEATURE_G])
    x = (start[r, 0], start[r, 1], start[r, 2], start[r, 3])
    n = (start[r, PAIR_NORMAL], start[r, PAIR_NORMAL + 1], start[r, PAIR_NORMAL + 2])
    if start[r, STAYS] > 0.0:
        status, x, frame = hold_features(
            table, pool, shell_f, shell_g, relative, shift, code_f, code_g, x, n, 1.0, patience, start[r, STAYS]
        )
        return status, code_f, code_g, x, frame, 0
    return track_features(table, pool, shell_f, shell_g, relative, shift, code_f, code_g, x, n, 1.0, patience)


@kernel(signatures="(i8[::1], f8[::1], i8, i8, i8, i8, f8[:, ::1], f8[:, ::1], f8, f8[:, ::1], f8[:, ::1], i8)")
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
        records[r, PROPER] = CONFORMING if conforms(frame) else (1.0 if frame[14] else 0.0)
        records[r, FOLD] = frame[15]
        write_tracked(x, feature_f, feature_g, frame[0], tracked, r)
        tracked[r, STAYS] = start[r, STAYS]
    return status


@kernel(signatures="(i8[::1], f8[::1], i8, i8, i8, i8, f8[:, ::1], i8, i8, f8[:, ::1], i8)")
def search_solids(table, pool, shell_f, shell_g, i, j, q, nearest_at, deepest_at, tracked, r):
    """The closest features wherever they are, into tracked[r]. Returns 1, or 0 where there are none.

    `nearest_at` and `deepest_at` are the addresses of `nearest_query.find_nearest` and `find_deepest`, the latter 0
    where it is not wanted: then solids that cross have no pair.
    """
    poses = np.empty((2, 7))
    for k in range(7):
        poses[0, k] = q[i, k]
        poses[1, k] = q[j, k]
    codes = np.zeros(2, np.int64)
    out = np.zeros(PAIR)
    status = call_address(nearest_at, (table, pool, shell_f, shell_g, poses, 1.0, codes, out))
    if codes[0] < 0:
        return 0
    n = (0.0, 0.0, 0.0)
    if status == CROSSING:
        if deepest_at == 0:
            return 0
        status = call_address(deepest_at, (table, pool, shell_f, shell_g, poses, 1.0, codes, out))
        # Solids that only touch have no depth: their crossing point is where the pair is.
        if status != CROSSING:
            n = matvec_t(rotation(q, i), (out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]))
    write_tracked((out[0], out[1], out[2], out[3]), codes[0], codes[1], n, tracked, r)
    tracked[r, STAYS] = 0.0
    return 1
