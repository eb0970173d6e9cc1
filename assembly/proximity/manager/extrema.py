"""Extremal pairs of two bodies, the roots of a look (`proximity/manager/update.py`): from pairs of patches by Newton's
method.

A root counts where outward normals oppose each other and the distance has a local minimum, by which solids touch; a
saddle of the distance is known, but not listed. Two roots are one where their points are near in space and along the
surfaces as well: the surface point halfway between their parameters is near them, too (paper 001, section 5).
"""

from __future__ import annotations

import math

import numpy as np

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import (
    surface_at,
    surface_point,
)
from assembly.geometry.vec import add, dot, matvec, matvec_t, scale, sub
from assembly.kinematics.motion import RelativePose, rotation
from assembly.proximity.brep.borders import feature_at
from assembly.proximity.brep.records import shell_at
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.extrema.face_face import CONVERGED, NOT_CONVERGED, SINGULAR, pair_frame, solve_pair
from assembly.proximity.extrema.feedback import descend_pair
from assembly.proximity.extrema.global_start import opposed
from assembly.proximity.extrema.rates import derivatives_at
from assembly.proximity.extrema.singular import ALONE, fold_of
from assembly.proximity.features.solid_contact import (
    contact_record_at,
    pair_parameters,
    tracked_at,
)

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
    beyond=1,  # the same, the least beyond the knot lines beside it; NaN: not looked at
    corner=1,  # what it holds on to if it is a vertex contact (`vertex_contacts.py`), else 0
    place=1,  # ELSEWHERE, or where it is to given contacts (`contact_place.py`)
)
extremum_at = record_view(EXTREMUM)
CODE_F = place_of(EXTREMUM, "code_f")
CODE_G = place_of(EXTREMUM, "code_g")
EXTREMUM_NORMAL = place_of(EXTREMUM, "normal")
GAP = place_of(EXTREMUM, "gap")
ORIGIN = place_of(EXTREMUM, "origin")
POINT_F = place_of(EXTREMUM, "point_f")
EXTREMUM_FOLD = place_of(EXTREMUM, "fold")
EXTREMUM_BEYOND = place_of(EXTREMUM, "beyond")
VERTEX_CONTACT = place_of(EXTREMUM, "corner")
ROOT = size_of(EXTREMUM)
# Where it is from: of no use, new, from LISTED on the place it has, down from GIVEN_CONTACT which given contact it is.
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
# Of a root: in no contact's place, in one beside the contact's own pair, that pair.
ELSEWHERE, BESIDE_CONTACT, OF_CONTACT = 0.0, 1.0, 2.0
# What became of a start: nothing there, a root that is known, a saddle, a minimum.
NOTHING, ALIKE, SADDLE, MINIMUM_FOUND = 0, 1, 2, 3
# Roots of no use are the same within this radius, in parts of the scene's size.
SAME = 1e-6
# Steps of the controller where Newton's method fails.
DESCENTS = 40


@kernel(inline=True)
def between(store, r, u, v, s, t):
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


@kernel(inner=True)
def are_one(store, posed, extrema, i, k, merge_radius):
    """Whether roots i and k are the same contact."""
    square = merge_radius * merge_radius
    one, other = extremum_at(extrema, i), extremum_at(extrema, k)
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
        u, v = between(store, surface, x[2 * side], x[2 * side + 1], y[2 * side], y[2 * side + 1])
        p = surface_point(store.table, store.pool, surface, u, v)[0]
        if side == 1:
            p = add(matvec(posed.pose.rotation, p), posed.pose.shift)
        if square_to(p, a) > square and square_to(p, b) > square:
            return False
    return True


@kernel(inner=True)
def surfaces_extremum(store, posed, start, extrema, k):
    """Newton on two surfaces from `start`, the controller where it fails; fills root k.

    Returns NOTHING, SADDLE or MINIMUM_FOUND.
    """
    turn, shift = posed.pose.rotation, posed.pose.shift
    f, g = posed.surfaces[0], posed.surfaces[1]
    found = solve_pair(store, f, g, RelativePose(turn, shift), start, 1.0, math.inf, 0.0, True)
    if found.status == NOT_CONVERGED:
        # The controller leads down from anywhere, to a minimum of the distance.
        found = descend_pair(store, f, g, RelativePose(turn, shift), start, 1.0, DESCENTS)
    if found.status != CONVERGED and found.status != SINGULAR:
        return NOTHING
    x, frame = found.parameters, found.frame
    if not opposed(frame, turn, store, g, x):
        return NOTHING
    h = found.matrix.h
    det = h[0] * h[3] - h[1] * h[2]
    norm2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3]
    write(extrema, k, x, 0, 0, frame.normal, frame.gap, frame.point_f, frame.point_g, fold_of(h))
    return MINIMUM_FOUND if det > -1e-9 * norm2 and h[0] + h[3] <= 0.0 else SADDLE


@kernel(inner=True)
def solids_extremum(store, posed, codes, start, n, extrema, k, work, vertex_contact):
    """Switching and Newton on the features of two solids, or Newton alone for a corner; fills root k."""
    i, j = posed.bodies
    q = posed.poses
    records, tracked = work
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
        (store.table, store.pool, posed.shells[0], posed.shells[1], i, j, q, tracked, math.inf, records, tracked, 0),
    )
    if status != CONVERGED and (status != SINGULAR or vertex_contact > 0.0):
        # An edge along another one, or along a face, is no corner: its ends are.
        return NOTHING
    turn = rotation(q, i)
    m = three_of(pair.normal)
    pg = matvec_t(turn, three_of(derivatives.arm_f))
    gap = derivatives.gap
    x = pair_parameters(pair)
    write(extrema, k, x, pair.feature_f, pair.feature_g, m, gap, sub(pg, scale(gap, m)), pg, contact.fold)
    extremum_at(extrema, k).corner = vertex_contact
    return MINIMUM_FOUND if contact.proper == 1.0 else SADDLE


@kernel(inline=True)
def write(extrema, k, x, code_f, code_g, n, gap, pf, pg, fold):
    extremum = extremum_at(extrema, k)
    for l in range(4):
        extremum.parameters[l] = x[l]
    extremum.code_f = float(code_f)
    extremum.code_g = float(code_g)
    extremum.normal[0], extremum.normal[1], extremum.normal[2] = n
    extremum.gap = gap
    extremum.origin = USELESS
    extremum.point_f[0], extremum.point_f[1], extremum.point_f[2] = pf
    extremum.point_g[0], extremum.point_g[1], extremum.point_g[2] = pg
    extremum.fold = fold
    extremum.beyond = math.nan
    extremum.corner = 0.0
    extremum.place = ELSEWHERE


@kernel(inner=True)
def add_extremum(store, posed, codes, start, n, merge_radius, extrema, count, work, vertex_contact):
    """Look for a root from a start and add it, as USELESS, if it is none of the known ones; a corner where it holds on
    to something.

    Returns how many roots there are, and NOTHING, ALIKE, SADDLE or MINIMUM_FOUND.
    """
    if posed.surfaces[0] >= 0:
        found = surfaces_extremum(store, posed, start, extrema, count)
    else:
        found = solids_extremum(store, posed, codes, start, n, extrema, count, work, vertex_contact)
    if found == NOTHING:
        return count, found
    for k in range(count):
        # One of far sides, or a saddle, hides no contact beside it.
        radius = min(merge_radius, SAME) if extremum_at(extrema, k).origin == USELESS else merge_radius
        if are_one(store, posed, extrema, count, k, radius):
            return count, ALIKE
    return count + 1, found


@kernel(inner=True)
def add_given(store, posed, tracked, listed, many, merge_radius, extrema, work):
    """Add the roots at which given contacts of the two bodies are now. Returns how many.

    A contact whose coordinates are unknowns of a solve may be on its way to another root than Newton's method goes to
    from there: it does not stand for that one.
    """
    count = 0
    for c in range(many):
        given = given_at(store.table, listed + GIVEN_RECORD * c)
        x = pair_parameters(tracked_at(tracked, given.row))
        if math.isnan(x[0]) or count == extrema.shape[0]:
            continue
        if given.swapped == 1:
            x = (x[2], x[3], x[0], x[1])
        before = count
        count, found = add_extremum(store, posed, (0, 0), x, (0.0, 0.0, 0.0), 0.0, extrema, count, work, 0.0)
        if posed.surfaces[0] >= 0 and (found == NOTHING or (count > before and count < extrema.shape[0])):
            frame = pair_frame(store, posed.surfaces[0], posed.surfaces[1], posed.pose, x)
            if frame.regular:
                write(extrema, count, x, 0, 0, frame.normal, frame.gap, frame.point_f, frame.point_g, 0.0)
            if found != NOTHING:
                same = frame.regular and are_one(store, posed, extrema, before, count, merge_radius)
                count = count if same else before
            elif frame.regular and opposed(frame, posed.pose.rotation, store, posed.surfaces[1], x):
                # At a fold Newton's method may find nothing: there the contact still is.
                count += 1
        if count > before:
            extremum_at(extrema, before).origin = GIVEN_CONTACT - c
    return count


@kernel(inline=True)
def is_alone(extrema, k):
    """Whether root k is far from a fold, beyond knot lines too as far as it is known."""
    extremum = extremum_at(extrema, k)
    return extremum.fold > ALONE and not extremum.beyond <= ALONE
