"""The nearest features of two B-rep bodies for Python, and tracking of them, one call each."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store, place_of, record_dtype, record_view, size_of
from assembly.geometry.vec import dot, matvec_t, scale, sub
from assembly.kinematics.motion import IDENTITY, rotation
from assembly.proximity.brep.borders import feature_of
from assembly.proximity.extrema.crossing import tangents
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.extrema.feature_pair import solve_features
from assembly.proximity.extrema.feature_query import pose_of_second, write_pair
from assembly.proximity.features.conforming import NEARLY, conforming_pair
from assembly.proximity.features.global_search import APART, CROSSING, UNPROVEN, FoundPair, nearest_of_shells
from assembly.proximity.features.penetration import PENETRATING, SEEMING_OVERLAP, deepest
from assembly.proximity.features.separating_normals import WAYS, overlap_at
from assembly.proximity.features.switching import track_features

# What is written of a pair, in world axes.
FEATURE_ANSWER = record_dtype(
    "f8",
    parameters=4,  # coordinates on the features of f, then of g
    point_f=3,
    point_g=3,
    normal=3,  # from f to g
    gap=1,
    lower=1,  # lower bound of the distance
    effort=1,  # pairs of cells looked at
    switches=1,  # of features
)
answer_at = record_view(FEATURE_ANSWER)
PARAMETERS = place_of(FEATURE_ANSWER, "parameters")
POINT_F = place_of(FEATURE_ANSWER, "point_f")
NORMAL = place_of(FEATURE_ANSWER, "normal")
GAP = place_of(FEATURE_ANSWER, "gap")
LOWER = place_of(FEATURE_ANSWER, "lower")
SWITCHES = place_of(FEATURE_ANSWER, "switches")
PAIR = size_of(FEATURE_ANSWER)
# Where no pair is nearer than the one found by more than this part of the size, it counts as the nearest one: in a
# continuum, or beside an apex, a search runs out of memory before it proves more.
PROVEN = 1e-9
# Statuses of a tracked pair, beside those of a search.
TRACKED, LOST = 4, 5


@kernel(inline=True)
def answer_parameters(out):
    """The coordinates of the pair in an answer."""
    answer = answer_at(out, 0)
    return (answer.parameters[0], answer.parameters[1], answer.parameters[2], answer.parameters[3])


@kernel(inner=True)
def write_features(store, shells, q, pair, size, codes, out):
    """A `FoundPair`, whose normal may be zero, into codes (2,) and out (PAIR,)."""
    x = pair.x
    pose = pose_of_second(q)
    f = feature_of(store, shells[0], pair.codes[0])
    g = feature_of(store, shells[1], pair.codes[1])
    status, y, frame = solve_features(store, f, g, pose, x, pair.normal, size, math.inf)
    codes[0], codes[1] = pair.codes
    if (status == CONVERGED or status == SINGULAR) and abs(abs(frame.gap) - abs(pair.gap)) <= 1e-12 * size:
        write_pair(q, y, frame.point_f, frame.point_g, frame.normal, frame.gap, out)
        return
    # A crossing, or an apex where Newton's method has no tangent to go on: the points themselves.
    pf = tangents(store, f, IDENTITY, x[0], x[1])[0]
    pg = tangents(store, g, pose, x[2], x[3])[0]
    d = sub(pg, pf)
    length = math.sqrt(dot(d, d))
    write_pair(q, x, pf, pg, scale(1.0 / length, d) if length > 1e-9 * size else frame.normal, length, out)


@kernel(signatures="(i8[::1], f8[::1], UniTuple(i8, 2), f8[:, ::1], f8, i8[::1], f8[::1])", allocates=True)
def find_nearest(table, pool, shells, q, size, codes, out):
    """The nearest pair at the poses q (2, 7); its features into codes (2,), the pair into out. Returns the status."""
    store = Store(table, pool)
    answer = answer_at(out, 0)
    pose = pose_of_second(q)
    nearest = nearest_of_shells(store, shells, pose, size, 0.0)
    status = nearest.status
    none = (0.0, 0.0, 0.0)
    found = FoundPair(True, nearest.codes, nearest.x, none, nearest.gap)
    if status == UNPROVEN:
        # The search ended before it reached the nearest pair; beside the pair it found there may be a nearer one.
        beside = track_features(store, shells, pose, nearest.codes, nearest.x, none, size, math.inf)
        off = beside.frame.gap
        if (beside.status == CONVERGED or beside.status == SINGULAR) and nearest.lower <= abs(off) < abs(found.gap):
            found = FoundPair(True, beside.codes, beside.x, none, off)
        if abs(found.gap) - nearest.lower <= PROVEN * size:
            status = APART
    if status == APART and abs(found.gap) <= SEEMING_OVERLAP * size:
        # Where faces are flush, a search ends at common points of theirs before it reaches a point where solids cross.
        if overlap_at(store, shells, pose.rotation, found.codes, found.x, size, np.empty((WAYS, 3))):
            status = CROSSING
    write_features(store, shells, q, found, size, codes, out)
    answer.lower = nearest.lower
    answer.effort = nearest.effort
    return status


@kernel(signatures="(i8[::1], f8[::1], UniTuple(i8, 2), f8[:, ::1], f8, i8[::1], f8[::1])")
def find_deepest(table, pool, shells, q, size, codes, out):
    """The pair of two shells that cross at the features and coordinates in codes and out. Returns the status.

    Returns APART where they only touch and seemed to cross by rounding. Where the pair is deep, or none is found, it is
    tested whether only conforming faces have points in common.
    """
    store = Store(table, pool)
    pose = pose_of_second(q)
    pair = deepest(store, shells, pose, (codes[0], codes[1]), answer_parameters(out), size)
    if not pair.found or pair.gap < -NEARLY * size:
        touching = conforming_pair(store, shells, pose, size)
        if touching.found:
            pair = touching
    if not pair.found:
        return CROSSING
    write_features(store, shells, q, pair, size, codes, out)
    return PENETRATING if pair.gap < 0.0 else APART


@kernel(signatures="(i8[::1], f8[::1], UniTuple(i8, 2), f8[:, ::1], f8, i8[::1], f8[::1])")
def follow_nearest(table, pool, shells, q, size, codes, out):
    """The pair in codes and out carried to the poses q. Returns TRACKED, or LOST and leaves the pair."""
    answer = answer_at(out, 0)
    n = matvec_t(rotation(q, 0), (answer.normal[0], answer.normal[1], answer.normal[2]))
    x = answer_parameters(out)
    found = track_features(Store(table, pool), shells, pose_of_second(q), (codes[0], codes[1]), x, n, size, 1.0)
    status, frame = found.status, found.frame
    # An edge may have become the farthest of its neighborhood, and surfaces may cross beside their points. In a
    # continuum, as of flush faces, this cannot be decided.
    if not (status == SINGULAR or (status == CONVERGED and frame.proper)):
        return LOST
    codes[0], codes[1] = found.codes
    write_pair(q, found.x, frame.point_f, frame.point_g, frame.normal, frame.gap, out)
    answer.lower = math.nan
    answer.switches += found.switches
    return TRACKED
