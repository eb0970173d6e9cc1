"""Rows of contacts: each pair is predicted for the poses, and its gap less the least gap is the residual.

`constraints/program/records.py` has the layout. A contact of two surfaces is a pair of points with a common normal; a
contact of two solids is the pair of their closest features (`proximity/features/solid_contact.py`). The rows of a
clearance are contacts as well: the active contacts of its contact manager.
"""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.records import FREE_COLUMN, ROW, Iterate, contact_row_at, header_at, jacobian_row_at
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import surface_at, surface_point
from assembly.geometry.splines.pole import limits, nearest_pole, polar_step
from assembly.geometry.vec import blend, dot, matvec, scale, sub
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.extrema.face_face import CONVERGED, LAST_TURN, LEFT_PATCH, SINGULAR, solve_pair
from assembly.proximity.extrema.face_frames import own_frame
from assembly.proximity.extrema.feature_pair import two_face_frame
from assembly.proximity.extrema.rates import RATES, RECORD, derivatives_at, gradient_row
from assembly.proximity.features.solid_contact import (
    CONTACT_RECORD,
    TRACK,
    contact_record_at,
    tracked_at,
    write_record,
)

# A clearance's contact of solids that penetrate by less than HARDLY may be given up where its pair ends: its field
# `stays`, k, is then stored as MAY_GO - k. Solids within TOUCHING of the least gap touch: a pair that ends there counts
# as open, because rounding decides whether it is.
MAY_GO, HARDLY, TOUCHING = -1.0, 1e-3, 1e-9
# The row of a clearance that is open by more than FAR needs its pair again after motions of UNSEEN times its gap, or of
# ASTRAY times the curvature-limited motion bound if less: from farther away Newton's method may find another pair.
UNSEEN, ASTRAY, FAR = 0.5, 0.15, 1e-5
# Beside the statuses of `solve_pair`: the pair that was found does not continue the one that was tracked.
OTHER_SIDE = 4


@kernel(inline=True)
def contact_of(table, r):
    """The record of row r, a contact's."""
    return contact_row_at(table, header_at(table, 0).row_table + ROW * r)


@kernel(inline=True)
def surface_of(contact, side):
    """The surface of a contact on side 0, of f, or 1, of g."""
    return contact.surface_f if side == 0 else contact.surface_g


@kernel(inline=True)
def facing_of(store, g, relative, frame, x):
    """1 where the outward normals of the surfaces of a pair oppose each other, -1 where they agree.

    Seen along the normal n of f, with S the surface g, n.(S_u x S_v) = det T, and the frame has T^-1; at a pole it has
    none.
    """
    t = frame.rates_g
    along = float(surface_at(store.table, g).sign) * (t[0] * t[3] - t[1] * t[2])
    if along == 0.0:
        along = dot(frame.normal, matvec(relative, own_frame(store, g, x[2], x[3]).normal))
    return -1.0 if along > 0.0 else 1.0


@kernel(inline=True)
def predict_point(store, surface, u, v, du, dv):
    """Parameters after rates (du, dv), inside the domain.

    Where a pole is nearer than the step is long, the step is made in the tangent plane: the parameters of a point that
    passes a pole change almost at once, and to extrapolate their rates leads elsewhere.
    """
    if surface_at(store.table, surface).poles != 0:
        _p, su, sv, _suu, _suv, _svv = surface_point(store.table, store.pool, surface, u, v)
        step = blend(du, su, dv, sv)
        edge, part = nearest_pole(store, surface, u, v)
        low, high, _closed = limits(store, surface, 0 if edge <= 2 else 1)
        spoke = scale(part * (high - low), su if edge <= 2 else sv)
        if dot(step, step) > dot(spoke, spoke):
            return polar_step(store, surface, edge, u, v, step)
    u, v, _clamped = into_domain(store, surface, u + du, v + dv)
    return u, v


@kernel(inner=True)
def predict_pair(store, r, tracked, guess):
    """Turn guess[r], parameters extrapolated from tracked[r] by their rates, into a start for Newton's method.

    A prediction beyond the end of a patch is moved inside. Contacts of solids are left to feature switching.
    """
    contact = contact_of(store.table, r)
    if contact.shell_f >= 0:
        return
    for side in range(2):
        i, surface = 2 * side, surface_of(contact, side)
        u, v = tracked[r, i], tracked[r, i + 1]
        guess[r, i], guess[r, i + 1] = predict_point(store, surface, u, v, guess[r, i] - u, guess[r, i + 1] - v)


@kernel(inner=True)
def track_contact(store, q, start, patience, records, k):
    """Newton on the pair of one row from start[k]; fills its record.

    A tracked pair keeps the sense of its outward normals, opposed or equal: no continuous motion leads from one to the
    other, as from the near side of a ball to the far side. But Newton's method may converge to either.
    Returns status, parameters, the sense of the normals (`FACING`), the signed distance of the points.
    """
    pair = tracked_at(start, k)
    contact = contact_of(store.table, k)
    i, j = contact.body_f, contact.body_g
    turn = rotation(q, i)
    pose = relative_pose(q, i, turn, j, rotation(q, j))
    surfaces = (contact.surface_f, contact.surface_g)
    x = (start[k, 0], start[k, 1], start[k, 2], start[k, 3])
    found = solve_pair(store, surfaces, pose, x, 1.0, patience, LAST_TURN, False)
    status, frame, x = found.status, found.frame, found.parameters
    apart = sub(frame.point_g, frame.point_f)
    distance = math.sqrt(dot(apart, apart))
    facing = pair.facing
    if status == CONVERGED or status == SINGULAR:
        facing = facing_of(store, surfaces[1], pose.rotation, frame, x)
        if facing * pair.facing < 0.0:
            return OTHER_SIDE, x, pair.facing, distance
        (k11, k12, k22), both = found.matrix.k, two_face_frame(frame, found.matrix)
        write_record(turn, pose.shift, both, (k11, k12, k12, k22), records, k)
    return status, x, facing, distance if frame.gap > 0.0 else -distance


@kernel(inner=True)
def start_row(store, q, tracked, r):
    """Find the pair of the surfaces of row r from a global start and write it to tracked[r]. Returns a status."""
    contact = contact_of(store.table, r)
    surfaces = (contact.surface_f, contact.surface_g)
    bodies = (contact.body_f, contact.body_g)
    return call_address(
        header_at(store.table, 0).start_address, (store.table, store.pool, surfaces, bodies, q, tracked, r)
    )


@kernel(inner=True)
def restart_contact(store, q, tracked, records, k):
    """As `track_contact`, from a global start, without the distance; tracked[k] is written meanwhile."""
    was = (tracked[k, 0], tracked[k, 1], tracked[k, 2], tracked[k, 3])
    status = start_row(store, q, tracked, k)
    x = (tracked[k, 0], tracked[k, 1], tracked[k, 2], tracked[k, 3])
    facing = tracked_at(tracked, k).facing
    if status == CONVERGED or status == SINGULAR:
        status, x, facing, _distance = track_contact(store, q, tracked, math.inf, records, k)
    tracked[k, 0], tracked[k, 1], tracked[k, 2], tracked[k, 3] = was
    return status, was if status == OTHER_SIDE else x, facing


@kernel(inner=True)
def search_row(store, q, tracked, r, crossing):
    """Search all features of the solids of row r for the closest ones, into tracked[r]. Returns whether there are any.

    Solids that penetrate have some only if `crossing`, which takes a thousand times as long.
    """
    header = header_at(store.table, 0)
    contact = contact_of(store.table, r)
    shells = (contact.shell_f, contact.shell_g)
    bodies = (contact.body_f, contact.body_g)
    searches = (header.nearest_address, header.deepest_address if crossing else 0)
    return call_address(header.search_address, (store, shells, bodies, q, searches, tracked, r)) == 1


@kernel(inner=True)
def track_row(store, q, start, patience, records, tracked, r):
    """Track the features of the solids of row r from start[r], into tracked[r] and record r. Returns a status."""
    contact = contact_of(store.table, r)
    shells = (contact.shell_f, contact.shell_g)
    bodies = (contact.body_f, contact.body_g)
    rows = (start, records, tracked)
    return call_address(header_at(store.table, 0).track_address, (store, shells, bodies, q, patience, rows, r))


@kernel(inline=True)
def is_clearance_row(table, r):
    """Whether row r is a clearance's."""
    header = header_at(table, 0)
    return header.first_clearance_row <= r < header.first_clearance_row + header.clearance_rows


@kernel(inline=True)
def least_gap(store, r, tracked):
    """The least gap of row r, reduced by how far the gap of touching bodies was below it where the solve began."""
    return store.pool[contact_of(store.table, r).minimum] - tracked_at(tracked, r).allowed


@kernel(inline=True)
def is_of_solids(table, r):
    """Whether row r is a contact of solids; the answer for an idle row means nothing."""
    return contact_of(table, r).shell_f >= 0


@kernel(inline=True)
def may_go(table, r, residual):
    """Whether row r is a clearance's, of solids that penetrate by less than HARDLY: its pair may then end."""
    return is_clearance_row(table, r) and is_of_solids(table, r) and residual[r] > -HARDLY


@kernel(inner=True)
def hold_all(table, tracked):
    """No contact may be given up any more."""
    header = header_at(table, 0)
    for r in range(header.first_clearance_row, header.first_clearance_row + header.clearance_rows):
        pair = tracked_at(tracked, r)
        if pair.stays <= MAY_GO:
            pair.stays = MAY_GO - pair.stays


@kernel(inline=True)
def copy_tracked(start, r, tracked):
    """Copy all tracked values of a row, also those that its kind does not use: nothing may depend on old memory."""
    for i in range(TRACK):
        tracked[r, i] = start[r, i]


@kernel(inline=True)
def idle_row(r, gap, point):
    """A row that is open by `gap`."""
    records = point.records
    contact = contact_record_at(records, r)
    derivatives_at(records, r).gap = gap
    contact.proper = 1.0
    contact.fold = 1.0
    point.residual[r] = gap


@kernel(inner=True)
def lost_clearance_row(store, r, start, point, past, goes):
    """Make row r of a clearance, whose pair was lost, idle where that is allowed. Returns whether it is.

    It is allowed where its last gap is open (for solids: down to -TOUCHING), where it is a corner `past` its face,
    where it was lost before, or where it `goes`: a pair that ends where bodies penetrate would block every step. The
    contact manager's next update finds the contacts that are there now.
    """
    least = least_gap(store, r, start)
    gap = tracked_at(start, r).gap - least
    if past:
        gap = max(gap, 0.0)
    elif (
        not gap > (-TOUCHING if contact_of(store.table, r).shell_f >= 0 else 0.0)
        and not goes
        and not math.isnan(start[r, 0])
    ):
        return False
    idle_row(r, gap, point)
    tracked_at(point.tracked, r).gap = gap + least
    # Its gradient is zero, because its pair is not known.
    for i in range(RATES, RECORD):
        point.records[r, i] = 0.0
    for i in range(FREE_COLUMN):
        point.jacobian[r, i] = 0.0
    point.tracked[r, 0] = math.nan
    return True


@kernel(inline=True)
def write_gap_row(store, r, point):
    """Row r, of contact r, from its record: the gap less the least gap, and its gradient over the twists."""
    tracked, records, residual, jacobian = point.tracked, point.records, point.residual, point.jacobian
    derivatives = derivatives_at(records, r)
    residual[r] = derivatives.gap - least_gap(store, r, tracked)
    gradient_row(records, r, jacobian, r)
    # A pair that follows the bodies has no unknowns of its own.
    row = jacobian_row_at(jacobian, r)
    for i in range(4):
        row.lifted[i] = 0.0
    tracked_at(tracked, r).gap = derivatives.gap


@kernel(inner=True)
def solids_row(store, r, start, patience, point):
    """Row r, of a contact of solids. Returns whether its pair was found.

    Where the tracked pair is lost, or its surfaces cross there, the closest pair of all takes over if the last gap is
    above HARDLY in size, the row is one-sided or `patience` is infinite; else the loop shortens the step. A clearance
    leaves this to its contact manager.
    """
    pair = tracked_at(start, r)
    q, tracked, records = point.q, point.tracked, point.records
    goes = pair.stays <= MAY_GO
    if goes:
        pair.stays = MAY_GO - pair.stays
        tracked_at(tracked, r).stays = pair.stays
    status = track_row(store, q, start, patience, records, tracked, r)
    found = (status == CONVERGED or status == SINGULAR) and (
        contact_record_at(records, r).proper != 0.0 or is_clearance_row(store.table, r)
    )
    if not found:
        if is_clearance_row(store.table, r):
            past = pair.stays > 0.0 and status == LEFT_PATCH
            return lost_clearance_row(store, r, start, point, past, goes)
        # Near touching a search takes long, and steps are short.
        far = abs(pair.gap) > HARDLY
        if not (far or contact_of(store.table, r).one_sided == 1 or patience == math.inf):
            return False
        # Where an edge is farthest, solids may be deep in each other: a step that leads there is too long.
        lost = status != CONVERGED and status != SINGULAR
        if not search_row(store, q, tracked, r, lost or patience == math.inf):
            return False
        status = track_row(store, q, tracked, math.inf, records, tracked, r)
        if status != CONVERGED and status != SINGULAR:
            return False
    write_gap_row(store, r, point)
    return True


@kernel(inner=True)
def row_of_pair(store, r, start, patience, point):
    """Row r, of contact r, by its pair. Returns whether it was found.

    Newton's method leads from `start` to the extremal pair, by steps that turn no normal by more than `patience`. A
    one-sided row that loses its pair takes the nearest pair of all. So does any row if `patience` is infinite and the
    method ends on another side of a body.
    """
    q, tracked, records = point.q, point.tracked, point.records
    derivatives = derivatives_at(records, r)
    contact = contact_record_at(records, r)
    if is_of_solids(store.table, r):
        return solids_row(store, r, start, patience, point)
    status, x, facing, distance = track_contact(store, q, start, patience, records, r)
    if status != CONVERGED and status != SINGULAR:
        anywhere = status == OTHER_SIDE and patience == math.inf
        if contact_of(store.table, r).one_sided == 0 and not anywhere:
            return False
        if is_clearance_row(store.table, r):
            return lost_clearance_row(store, r, start, point, False, False)
        # A one-sided contact takes the nearest pair, whichever it is now.
        held = status == LEFT_PATCH and distance > 0.0
        status, x, facing = restart_contact(store, q, tracked, records, r)
        if status != CONVERGED and status != SINGULAR:
            if not held:
                return False
            for i in range(CONTACT_RECORD):
                records[r, i] = 0.0
            derivatives.gap = distance
            contact.proper = 1.0
            contact.fold = 1.0
        elif not (derivatives.gap > 0.0 or anywhere):
            return False
    write_gap_row(store, r, point)
    tracked[r, 0], tracked[r, 1], tracked[r, 2], tracked[r, 3] = x
    tracked_at(tracked, r).facing = facing
    return True


@kernel(inline=True)
def contact_row(store, r, start, patience, point):
    """Row r, of contact r, from `start` on. Returns whether its pair was found, or need not be.

    A row of a clearance that stays open is as `solve/loop/predict.py` left it.
    """
    pair = tracked_at(start, r)
    tracked, records, residual = point.tracked, point.records, point.residual
    contact_record = contact_record_at(records, r)
    contact = contact_of(store.table, r)
    copy_tracked(start, r, tracked)
    if contact.body_f < 0:
        idle_row(r, 1.0, point)
        return True
    if pair.idle == 1.0:
        tracked_at(tracked, r).idle = 0.0
        residual[r] = pair.gap - least_gap(store, r, start)
        return True
    if not row_of_pair(store, r, start, patience, point):
        return False
    tracks = not math.isnan(tracked[r, 0])
    # Features of solids switch as the solids move, so their rows get no slack.
    open_far = is_clearance_row(store.table, r) and contact.shell_f < 0 and residual[r] > FAR
    contact_record.slack = 0.0
    if tracks and open_far:
        # The curvature-limited motion bound stands behind the least gap in the pool.
        contact_record.slack = min(UNSEEN * residual[r], ASTRAY * store.pool[contact.minimum + 1])
    return True


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), f8[:, ::1], f8, i8[::1], "
        "Tuple((f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])))"
    )
)
def contact_rows(scene, start, patience, free, at):
    """All rows of contacts but those of lifted pairs, and their gradients. Returns a row whose pair was lost, or -1.

    `scene` and `at` have the parts of a `Store` and of an `Iterate`.
    """
    table, pool = scene
    q, tracked, records, residual, jacobian = at
    store, point = Store(table, pool), Iterate(q, tracked, records, residual, jacobian)
    for r in range(header_at(table, 0).contacts):
        if free[r] < 0 and not contact_row(store, r, start, patience, point):
            return r
    return -1
