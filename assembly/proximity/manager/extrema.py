"""Extremal pairs of two bodies, the extrema of an update (`proximity/manager/update.py`): from pairs of patches by
Newton's method.

An extremum counts where outward normals oppose each other and the distance has a local minimum, by which solids touch;
a saddle of the distance is known, but not listed. Two extrema are one where their points are near in space and along
the surfaces as well: the surface point halfway between their parameters is near them, too (paper 001, section 5).
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import surface_at, surface_point
from assembly.geometry.vec import add, dot, matvec, matvec_t, scale, sub
from assembly.kinematics.motion import rotation
from assembly.proximity.brep.borders import feature_at
from assembly.proximity.brep.records import shell_at
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR, solve_pair
from assembly.proximity.extrema.face_frames import pair_frame
from assembly.proximity.extrema.feature_pair import two_face_frame
from assembly.proximity.extrema.global_start import opposed
from assembly.proximity.extrema.pair_matrix import is_the_only_one
from assembly.proximity.extrema.rates import derivatives_at
from assembly.proximity.features.solid_contact import contact_record_at, pair_parameters, tracked_at

# An extremum of the distance of two bodies. Points and the normal are in the axes of f.
EXTREMUM = record_dtype(
    "f8",
    parameters=4,  # (u, v) of f, then of g
    code_f=1,  # features of shells
    code_g=1,
    normal=3,  # unit normal of f
    gap=1,  # signed distance [over the size of the scene]
    origin=1,  # where it is from: USELESS, NEW, a slot or a given contact
    point_f=3,
    point_g=3,
    fold=1,  # how far it is from a fold, det H / |H|^2
    corner=1,  # what a vertex contact is locked to (`vertex_contacts.py`); 0: it is none
    place=1,  # ELSEWHERE, BESIDE_CONTACT or OF_CONTACT (`contact_place.py`)
)
extremum_at = record_view(EXTREMUM)
ROOT = size_of(EXTREMUM)
# A list of extrema. rows: the EXTREMUM records; the row behind the last one is for the start that is being tried;
# count: how many there are, (1,); derivatives, tracked: a record of each, for the pair of features that is being tried.
Extrema = namedtuple("Extrema", "rows count derivatives tracked")
# Origins of an extremum: USELESS; NEW; LISTED + k if slot k has it; GIVEN_CONTACT - c if it is given contact c.
USELESS, NEW, LISTED, GIVEN_CONTACT = -2.0, -1.0, 0, -3.0
# A given contact of two bodies in the table.
GIVEN_DTYPE = record_dtype(
    "i8",
    row=1,  # its row of `tracked`
    swapped=1,  # 1: the bodies are the other way round there
    opens=1,  # 1: its gap may be open
    surface=2,  # the surfaces of its sides, or -1
    shell=2,  # their B-rep bodies, or -1
)
given_at = record_view(GIVEN_DTYPE)
GIVEN_RECORD = size_of(GIVEN_DTYPE)
# Places of an extremum: in no given contact's place; in one, beside the contact's own pair; that pair.
ELSEWHERE, BESIDE_CONTACT, OF_CONTACT = 0.0, 1.0, 2.0
# What became of a start: nothing there, an extremum that is known, a saddle, a minimum.
NOTHING, ALIKE, SADDLE, MINIMUM_FOUND = 0, 1, 2, 3
# Useless extrema are the same within this radius [over the size of the scene].
SAME = 1e-6


@kernel(inline=True)
def middle_parameters(store, r, u, v, s, t):
    """The middle of two pairs of parameters, the shorter way around."""
    patch = surface_at(store.table, r)
    a = 0.5 * (u + s)
    b = 0.5 * (v + t)
    if patch.closed_u == 1:
        period = store.pool[patch.breaks_u + patch.spans_u] - store.pool[patch.breaks_u]
        if abs(u - s) > 0.5 * period:
            a += 0.5 * period if a < store.pool[patch.breaks_u] + 0.5 * period else -0.5 * period
    if patch.closed_v == 1:
        period = store.pool[patch.breaks_v + patch.spans_v] - store.pool[patch.breaks_v]
        if abs(v - t) > 0.5 * period:
            b += 0.5 * period if b < store.pool[patch.breaks_v] + 0.5 * period else -0.5 * period
    return a, b


@kernel(inline=True)
def square_to(a, b):
    """The square of the distance of two points."""
    d = sub(a, b)
    return dot(d, d)


@kernel(inline=True)
def is_list_full(extrema):
    """Whether a list has no room for another extremum."""
    return extrema.count[0] == extrema.rows.shape[0]


@kernel(inner=True)
def are_one(posed, rows, i, k, merge_radius):
    """Whether extrema i and k are the same contact."""
    store = posed.store
    square = merge_radius * merge_radius
    one, other = extremum_at(rows, i), extremum_at(rows, k)
    codes, other_codes = (one.code_f, one.code_g), (other.code_f, other.code_g)
    points = (three_of(one.point_f), three_of(one.point_g))
    other_points = (three_of(other.point_f), three_of(other.point_g))
    x, y = pair_parameters(one), pair_parameters(other)
    for side in range(2):
        a, b = points[side], other_points[side]
        if codes[side] != other_codes[side] or square_to(a, b) > square:
            return False
        surface = posed.surfaces[side]
        if surface < 0:
            shell = posed.shells[side]
            if codes[side] >= shell_at(store.table, shell).faces:
                continue
            surface = feature_at(store.table, shell, np.int64(codes[side]))
        u, v = middle_parameters(store, surface, x[2 * side], x[2 * side + 1], y[2 * side], y[2 * side + 1])
        p = surface_point(store.table, store.pool, surface, u, v).point
        if side == 1:
            p = add(matvec(posed.pose.rotation, p), posed.pose.shift)
        if square_to(p, a) > square and square_to(p, b) > square:
            return False
    return True


@kernel(inner=True)
def is_known_one(posed, extrema, merge_radius):
    """Whether the extremum that is tried is one of the list.

    A useless one, of far sides or a saddle, hides no contact beside it: its merge radius is small.
    """
    for k in range(extrema.count[0]):
        radius = min(merge_radius, SAME) if extremum_at(extrema.rows, k).origin == USELESS else merge_radius
        if are_one(posed, extrema.rows, extrema.count[0], k, radius):
            return True
    return False


@kernel(inner=True)
def surfaces_extremum(posed, start, extremum):
    """Newton's method on two surfaces from `start`; fills an extremum.

    Returns NOTHING, SADDLE or MINIMUM_FOUND.
    """
    store, pose = posed.store, posed.pose
    found = solve_pair(store, posed.surfaces, pose, start, 1.0, math.inf, 0.0, True)
    if found.status != CONVERGED and found.status != SINGULAR:
        return NOTHING
    x, frame = found.parameters, found.frame
    if not opposed(frame, pose.rotation, store, posed.surfaces[1], x):
        return NOTHING
    pair = two_face_frame(frame, found.matrix)
    write_frame(extremum, x, frame, pair.fold)
    return MINIMUM_FOUND if pair.proper else SADDLE


@kernel(inner=True)
def solids_extremum(posed, codes, start, n, extrema, vertex_contact):
    """Newton's method with switching of features, without it for a vertex contact; fills the row behind the list."""
    store = posed.store
    i, j = posed.bodies
    q = posed.poses
    records, tracked = extrema.derivatives, extrema.tracked
    pair = tracked_at(tracked, 0)
    derivatives = derivatives_at(records, 0)
    contact = contact_record_at(records, 0)
    for l in range(4):
        pair.parameters[l] = start[l]
    pair.feature_f = float(codes[0])
    pair.feature_g = float(codes[1])
    pair.stays = vertex_contact
    for l in range(3):
        pair.normal[l] = n[l]
    status = call_address(
        posed.track_solids,
        (store, posed.shells, posed.bodies, q, math.inf, (tracked, records, tracked), 0),
    )
    if status != CONVERGED and (status != SINGULAR or vertex_contact > 0.0):
        # An edge along another one, or along a face, is no corner: its ends are.
        return NOTHING
    m = three_of(pair.normal)
    pg = matvec_t(rotation(q, i), three_of(derivatives.arm_f))
    gap = derivatives.gap
    extremum = extremum_at(extrema.rows, extrema.count[0])
    points = (sub(pg, scale(gap, m)), pg)
    write(extremum, pair_parameters(pair), (pair.feature_f, pair.feature_g), m, gap, points, contact.fold)
    extremum.corner = vertex_contact
    return MINIMUM_FOUND if contact.proper == 1.0 else SADDLE


@kernel(inline=True)
def write(extremum, x, codes, n, gap, points, fold):
    """Fill an extremum, of no use yet: its parameters, features, normal, gap, the points of f and g, and fold."""
    for l in range(4):
        extremum.parameters[l] = x[l]
    extremum.code_f = float(codes[0])
    extremum.code_g = float(codes[1])
    extremum.normal[0], extremum.normal[1], extremum.normal[2] = n
    extremum.gap = gap
    extremum.origin = USELESS
    extremum.point_f[0], extremum.point_f[1], extremum.point_f[2] = points[0]
    extremum.point_g[0], extremum.point_g[1], extremum.point_g[2] = points[1]
    extremum.fold = fold
    extremum.corner = 0.0
    extremum.place = ELSEWHERE


@kernel(inline=True)
def write_frame(extremum, x, frame, fold):
    """Fill an extremum of two surfaces by its frame."""
    write(extremum, x, (0, 0), frame.normal, frame.gap, (frame.point_f, frame.point_g), fold)


@kernel(inner=True)
def add_extremum(posed, codes, start, n, merge_radius, extrema, vertex_contact):
    """Look for an extremum from a start and add it, as USELESS, if it is none of the known ones.

    It is a vertex contact where `vertex_contact` says what that is locked to, and not where this is 0.

    Returns NOTHING, ALIKE, SADDLE or MINIMUM_FOUND.
    """
    if posed.surfaces[0] >= 0:
        found = surfaces_extremum(posed, start, extremum_at(extrema.rows, extrema.count[0]))
    else:
        found = solids_extremum(posed, codes, start, n, extrema, vertex_contact)
    if found == NOTHING:
        return found
    if is_known_one(posed, extrema, merge_radius):
        return ALIKE
    extrema.count[0] += 1
    return found


@kernel(inner=True)
def add_surface_extremum(posed, start, merge_radius, extrema):
    """`add_extremum`, for two surfaces."""
    return add_extremum(posed, (0, 0), start, (0.0, 0.0, 0.0), merge_radius, extrema, 0.0)


@kernel(inner=True)
def add_given(posed, tracked, listed, many, merge_radius, extrema):
    """Add the extrema at which given contacts of the two bodies are now.

    A contact whose coordinates are unknowns of the solve may be on its way to another extremum than the one that
    Newton's method finds from there: it does not stand for the latter.
    """
    store = posed.store
    for c in range(many):
        given = given_at(store.table, listed + GIVEN_RECORD * c)
        x = pair_parameters(tracked_at(tracked, given.row))
        if math.isnan(x[0]) or is_list_full(extrema):
            continue
        if given.swapped == 1:
            x = (x[2], x[3], x[0], x[1])
        before = extrema.count[0]
        found = add_surface_extremum(posed, x, 0.0, extrema)
        count = extrema.count[0]
        if posed.surfaces[0] >= 0 and (found == NOTHING or (count > before and not is_list_full(extrema))):
            frame = pair_frame(store, posed.surfaces[0], posed.surfaces[1], posed.pose, x)
            if frame.regular:
                write_frame(extremum_at(extrema.rows, count), x, frame, 0.0)
            if found != NOTHING:
                same = frame.regular and are_one(posed, extrema.rows, before, count, merge_radius)
                extrema.count[0] = count if same else before
            elif frame.regular and opposed(frame, posed.pose.rotation, store, posed.surfaces[1], x):
                # At a fold Newton's method may find nothing: the contact is still there.
                extrema.count[0] += 1
        if extrema.count[0] > before:
            extremum_at(extrema.rows, before).origin = GIVEN_CONTACT - c


@kernel(inline=True)
def is_alone(extremum):
    """Whether an extremum is far from a fold."""
    return is_the_only_one(extremum.fold)
