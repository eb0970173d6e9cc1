"""A contact of two solids as a solve tracks it: the pair of features that is closest, its coordinates, its normal.

A vertex contact, which need not be the closest one (`proximity/manager/vertex_contacts.py`), keeps its features.

The kernels here are large, and few scenes need them: loops call them by address (`_address.call_address`).
"""

from __future__ import annotations

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._record import Store, place_of, record_dtype, record_view, size_of
from assembly.geometry.vec import matvec_t
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.extrema.feature_jets import offset_side
from assembly.proximity.extrema.feature_pair import conforms
from assembly.proximity.extrema.rates import RECORD, feature_record
from assembly.proximity.features.global_search import CROSSING
from assembly.proximity.features.holding import hold_features
from assembly.proximity.features.nearest_query import PAIR, answer_at
from assembly.proximity.features.switching import FeatureTrack, track_features

# What a solve keeps of a contact.
TRACKED_PAIR = record_dtype(
    "f8",
    parameters=4,  # coordinates of the pair on the features of f, then of g; NaN: it is lost
    feature_f=1,
    feature_g=1,
    normal=3,  # in the axes of body f; it tells on which side of each other two edges are where they touch
    gap=1,  # signed distance [over the size of the scene]
    stays=1,  # what the pair stays with: a vertex contact need not be the closest one (`manager/vertex_contacts.py`)
    idle=1,  # of the end of a step: 1: its row stays open there for certain (`solve/loop/predict.py`)
    allowed=1,  # by how much its gap may be below the least one, as it was where the solve began
    facing=1,  # of a pair of surfaces: 1: their outward normals oppose each other, -1: they agree, 0: not known yet
)
tracked_at = record_view(TRACKED_PAIR)
FEATURE_F = place_of(TRACKED_PAIR, "feature_f")
FEATURE_G = place_of(TRACKED_PAIR, "feature_g")
PAIR_GAP = place_of(TRACKED_PAIR, "gap")
STAYS = place_of(TRACKED_PAIR, "stays")
IDLE = place_of(TRACKED_PAIR, "idle")
ALLOWED = place_of(TRACKED_PAIR, "allowed")
FACING = place_of(TRACKED_PAIR, "facing")
TRACK = size_of(TRACKED_PAIR)
CONTACT_RECORD = RECORD + 3
# The record of derivatives of a contact (`extrema/rates.py`), and what follows it.
CONTACT_DERIVATIVES = record_dtype(
    "f8",
    derivatives=RECORD,  # GAP_DERIVATIVES
    proper=1,  # 1: the surfaces do not cross at the pair, 0: they do, or CONFORMING
    fold=1,  # how far the pair is from a fold
    slack=1,  # how far the bodies may move until a row that is open needs its pair again
)
contact_record_at = record_view(CONTACT_DERIVATIVES)
SLACK = place_of(CONTACT_DERIVATIVES, "slack")
# The value of `proper` where the surfaces are equally near all around, so that no point is an isolated minimum.
CONFORMING = 2.0


@kernel(inline=True)
def pair_parameters(record):
    """The coordinates of a pair, of a tracked one or of an extremum: two on f, two on g."""
    return (record.parameters[0], record.parameters[1], record.parameters[2], record.parameters[3])


@kernel(inline=True)
def write_tracked_pair(x, codes, n, tracked, r):
    """Parameters, features and normal of a pair."""
    pair = tracked_at(tracked, r)
    for k in range(4):
        pair.parameters[k] = x[k]
    pair.feature_f = float(codes[0])
    pair.feature_g = float(codes[1])
    for i in range(3):
        pair.normal[i] = n[i]


@kernel(inner=True)
def write_record(turn, shift, frame, offset, records, r):
    """The record of a contact, but for its slack; as `feature_record`."""
    feature_record(turn, shift, frame, offset, records, r)
    contact = contact_record_at(records, r)
    contact.proper = CONFORMING if conforms(frame, offset) else (1.0 if frame.proper else 0.0)
    contact.fold = frame.fold


@kernel(inner=True)
def track_contact(store, shells, pose, start, r, patience):
    """`track_features` from the tracked values start[r], or `hold_features`."""
    pair = tracked_at(start, r)
    codes = (np.int64(pair.feature_f), np.int64(pair.feature_g))
    x = pair_parameters(pair)
    n = (pair.normal[0], pair.normal[1], pair.normal[2])
    if pair.stays > 0.0:
        status, x, frame = hold_features(store, shells, pose, codes, x, n, patience, pair.stays)
        return FeatureTrack(status, codes, x, frame, 0)
    return track_features(store, shells, pose, codes, x, n, 1.0, patience)


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), UniTuple(i8, 2), UniTuple(i8, 2), f8[:, ::1], f8, UniTuple(f8[:, ::1], 3), i8)"
    ),
)
def track_solids(store, shells, bodies, q, patience, rows, r):
    """Newton and switching from tracked values; fills record and tracked values. Returns the status.

    The poses of both bodies are in q; no step turns a normal by more than `patience` [rad]. `rows` are the tracked
    values to start from, the records and the tracked values to fill; row r of each is the pair's.
    """
    table, pool = store
    start, records, tracked = rows
    i, j = bodies
    turn = rotation(q, i)
    pose = relative_pose(q, i, turn, j, rotation(q, j))
    found = track_contact(Store(table, pool), shells, pose, start, r, patience)
    status, frame = found.status, found.frame
    if status == CONVERGED or status == SINGULAR:
        write_record(turn, pose.shift, frame, offset_side(frame.side_f, frame.gap), records, r)
        write_tracked_pair(found.x, found.codes, frame.normal, tracked, r)
        tracked_at(tracked, r).stays = tracked_at(start, r).stays
    return status


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), UniTuple(i8, 2), UniTuple(i8, 2), f8[:, ::1], UniTuple(i8, 2), f8[:, ::1], i8)"
    ),
    allocates=True,
)
def search_solids(store, shells, bodies, q, searches, tracked, r):
    """Search for the closest features globally, and write them into tracked[r]. Returns 1, or 0 where there are none.

    `searches` are the addresses of `nearest_query.find_nearest` and `find_deepest`, the latter 0 where it is not
    wanted: then solids that cross have no pair.
    """
    table, pool = store
    nearest_at, deepest_at = searches
    i, j = bodies
    poses = np.empty((2, 7))
    for k in range(7):
        poses[0, k] = q[i, k]
        poses[1, k] = q[j, k]
    codes = np.zeros(2, np.int64)
    out = np.zeros(PAIR)
    answer = answer_at(out, 0)
    status = call_address(nearest_at, (table, pool, shells, poses, 1.0, codes, out))
    if codes[0] < 0:
        return 0
    n = (0.0, 0.0, 0.0)
    if status == CROSSING:
        if deepest_at == 0:
            return 0
        status = call_address(deepest_at, (table, pool, shells, poses, 1.0, codes, out))
        # Solids that only touch have no depth: their crossing point is where the pair is.
        if status != CROSSING:
            n = matvec_t(rotation(q, i), (answer.normal[0], answer.normal[1], answer.normal[2]))
    write_tracked_pair((out[0], out[1], out[2], out[3]), codes, n, tracked, r)
    tracked_at(tracked, r).stays = 0.0
    return 1
