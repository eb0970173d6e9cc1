"""Rows of trims: how a contact lies on its face relative to a loop.

The form "signed" is s, the signed distance in (u, v) (`proximity/features/trim_distance.py`), with s_q = n.u_q. The
forms of paper 001, section 3.4, take the point c(t) of the loop's own extremum against the other surface; the rate t_q
is that of the extremum of a surface and a curve (appendix A, corrected):

    "parametric"  u - c            u_q - c' t_q
    "cartesian"   f(u) - f(c)      f_u u_q - f_u c' t_q
    "between"     g(u_g) - f(c)    g_q - f_u c' t_q,

in the axes of the face's body, where f(u) and f(c) have no rates of their own. At a solution the components depend on
one another (the loop's extremum is then the contact's): each is a multiple of s, and so its second derivative is taken
to be. Off the loop the vector u - c = s n has two independent rates, n s_q and s n_q. The second would forbid sliding
along the loop, which is allowed, with a multiplier that grows toward the loop. So the first two forms use their signed
length, one row that is zero where the vector is. The third contains the gap and has no such sign.
With a loop that has corners, a row belongs to one of the loop's sides (`trim_sides.py`).
The loop of a solve calls `trim_rows`, and `trim_terms` (`trim_hessian.py`), by their addresses.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.contact import contact_of, surface_of
from assembly.constraints.program.place import (
    OwnPlace,
    add_place_rates,
    place_error,
)
from assembly.constraints.program.records import (
    AT_PLACE,
    BETWEEN,
    CARTESIAN,
    FREE_COLUMN,
    PARAMETRIC,
    ROW,
    SIGNED,
    Iterate,
    LiftedPairs,
    header_at,
    jacobian_row_at,
    trim_row_at,
)
from assembly.constraints.program.trim_sides import OPEN, trim_place
from assembly.geometry.faces.trim_nearest import trim_nearest
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.splines.evaluate import curve_point, surface_point
from assembly.geometry.vec import add, cross, dot, matvec, matvec_t, scale, sub
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.brep.borders import on_surface
from assembly.proximity.brep.records import EDGE, EDGE_RECORD, FACE, Feature, edge_at
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.extrema.feature_jets import offset_side
from assembly.proximity.extrema.feature_pair import solve_features
from assembly.proximity.extrema.rates import derivatives_at, feature_record
from assembly.proximity.features.trim_distance import trim_distance

# A vector shorter than this has no direction of its own.
NO_LENGTH = 1e-9


@kernel(inline=True)
def trim_of(table, r):
    """The record of row r, a trim's."""
    return trim_row_at(table, header_at(table, 0).row_table + ROW * r)


@kernel(inner=True)
def clear(jacobian, r):
    """Clear row r, its columns of twists and of coordinates."""
    for j in range(FREE_COLUMN + 4):
        jacobian[r, j] = 0.0


@kernel(inner=True)
def add_coordinate_rate(lifted, records, k, i, factor, jacobian, r):
    """Row r += factor times the derivative of coordinate i of contact k: as an unknown, or by the contact velocity."""
    if lifted.free[k] >= 0:
        jacobian_row_at(jacobian, r).lifted[i] += factor / lifted.lengths[k, i]
    else:
        add_rate(records, k, i, factor, jacobian, r)


@kernel(inner=True)
def add_rate(records, k, i, factor, jacobian, r):
    """Row r += factor times the rate of coordinate i of record k over the twists."""
    derivatives = derivatives_at(records, k)
    for l in range(4):
        rate = factor * derivatives.rates[i, l]
        for j in range(12):
            jacobian[r, j] += rate * derivatives.zed[l, j]


@kernel(inner=True)
def signed_row(store, r, lifted, point):
    """Row r, of a trim in the signed form."""
    tracked, records, residual, jacobian = point.tracked, point.records, point.residual, point.jacobian
    row = trim_of(store.table, r)
    k = row.contact
    o = 2 * row.side
    clear(jacobian, r)
    place = trim_place(store, row, tracked)
    if place.loop < 0:
        residual[r] = OPEN
        return
    factor = place.factor
    s, n, _bend = trim_distance(store, place.loop, tracked[k, o], tracked[k, o + 1])
    residual[r] = factor * s
    add_coordinate_rate(lifted, records, k, o, factor * n[0], jacobian, r)
    add_coordinate_rate(lifted, records, k, o + 1, factor * n[1], jacobian, r)


@kernel(inner=True)
def place_row(store, r, lifted, point):
    """Row r, of a place."""
    row = trim_of(store.table, r)
    k, o = row.contact, 2 * row.side
    clear(point.jacobian, r)
    point.residual[r] = place_error(store, row.factor, row.slot, point.tracked[k, o], point.tracked[k, o + 1])
    add_place_rates(store, OwnPlace(row.factor, k, row.side), row.slot, lifted, point, point.jacobian, r)


@kernel(inner=True)
def loop_extremum(store, trim, place, x, turn, pose, records, scratch):
    """The loop's point that is extremal against the other surface: found near the contact x, its record in `scratch`.

    Returns the curve, its parameter, whether it moves (it does not at a corner), and the signed distance of x.
    """
    loop, o = place.loop, 2 * trim.side
    s, number, t, _cu, _cv, _nu, _nv = trim_nearest(store, loop, 0, trim_at(store.table, loop).curves, x[o], x[o + 1])
    edge = place.edges + EDGE_RECORD * number
    on_loop = Feature(EDGE, edge)
    on_face = Feature(FACE, trimmed_surface(store.table, trim, 1 - trim.side))
    none = (0.0, 0.0, 0.0)
    if o == 0:
        start = (t, 0.0, x[2], x[3])
        status, y, frame = solve_features(store, on_loop, on_face, pose, start, none, 1.0, math.inf)
        found = y[0]
    else:
        start = (x[0], x[1], t, 0.0)
        status, y, frame = solve_features(store, on_face, on_loop, pose, start, none, 1.0, math.inf)
        found = y[2]
    moves = status == CONVERGED or status == SINGULAR
    if moves:
        t = found
        feature_record(turn, pose.shift, frame, offset_side(frame.side_f, frame.gap), records, scratch)
    return edge_at(store.table, edge).curve, t, moves, s


@kernel(inline=True)
def trimmed_surface(table, trim, side):
    """The surface of a trim's contact on a side."""
    return surface_of(contact_of(table, trim.contact), side)


@kernel(inner=True)
def material_rates(axis, arm_f, arm_g, sign, jacobian, r):
    """Row r += sign times axis . (velocity of body g less that of body f) at a point with these arms."""
    turn_f = cross(arm_f, axis)
    turn_g = cross(arm_g, axis)
    for l in range(3):
        jacobian[r, l] -= sign * axis[l]
        jacobian[r, 3 + l] -= sign * turn_f[l]
        jacobian[r, 6 + l] += sign * axis[l]
        jacobian[r, 9 + l] += sign * turn_g[l]


@kernel(inner=True)
def offset_tangents(pu, pv, puu, puv, pvv, n, beta):
    """Derivatives of p + beta n, n the unit normal on one side of the surface."""
    normal = cross(pu, pv)
    length = math.sqrt(dot(normal, normal))
    if not length > 0.0:
        return pu, pv
    factor = (beta if dot(normal, n) > 0.0 else -beta) / length
    u = add(cross(puu, pv), cross(pu, puv))
    v = add(cross(puv, pv), cross(pu, pvv))
    u = sub(u, scale(dot(u, n), n))
    v = sub(v, scale(dot(v, n), n))
    return add(pu, scale(factor, u)), add(pv, scale(factor, v))


@kernel(inner=True)
def vector_rows(store, first, lifted, point):
    """The rows of a trim from `first` on, in one of the paper's forms."""
    header = header_at(store.table, 0)
    q, tracked, records, residual, jacobian = point.q, point.tracked, point.records, point.residual, point.jacobian
    trim = trim_of(store.table, first)
    k = trim.contact
    derivatives = derivatives_at(records, k)
    side = trim.side
    form = trim.form
    o = 2 * side
    i, j = trim.body_f, trim.body_g
    x = (tracked[k, 0], tracked[k, 1], tracked[k, 2], tracked[k, 3])
    turn_f = rotation(q, i)
    turn_g = rotation(q, j)
    pose = relative_pose(q, i, turn_f, j, turn_g)
    scratch = header.contacts + header.joints
    place = trim_place(store, trim, tracked)
    curve, t, moves, s = loop_extremum(store, trim, place, x, turn_f, pose, records, scratch)
    factor = place.factor
    kept = 1.0 if factor >= 0.0 else -1.0
    factor = abs(factor)
    turn = turn_f if side == 0 else turn_g
    surface = trimmed_surface(store.table, trim, side)
    at, rate, _bend = curve_point(store.table, store.pool, curve, t)
    on_edge = on_surface(store, surface, curve, t)
    c, along = on_edge.point, on_edge.tangent
    p, pu, pv, puu, puv, pvv = surface_point(store.table, store.pool, surface, x[o], x[o + 1])
    away_surface = trimmed_surface(store.table, trim, 1 - side)
    there, du, dv, _uu, _uv, _vv = surface_point(store.table, store.pool, away_surface, x[2 - o], x[3 - o])
    away = turn_g if side == 0 else turn_f
    origin = position(q, j if side == 0 else i)
    point_w = add(matvec(away, there), origin)
    arm_f = sub(point_w, position(q, i))
    arm_g = sub(point_w, position(q, j))
    du = matvec(away, du)
    dv = matvec(away, dv)
    free = lifted.free[k] >= 0
    # In the axes of the body with the loop, the other point is p + beta n.
    toward = (0.0, 0.0, 0.0)
    if form == BETWEEN and not free:
        n = (derivatives.normal[0], derivatives.normal[1], derivatives.normal[2])
        toward = scale(1.0 - 2.0 * side, matvec_t(turn, n))
        pu, pv = offset_tangents(pu, pv, puu, puv, pvv, toward, derivatives.gap)
    for l in range(trim.count):
        r = first + l
        clear(jacobian, r)
        if form == PARAMETRIC:
            residual[r] = factor * (x[o + l] - at[l])
            slope = factor * rate[l]
            add_coordinate_rate(lifted, records, k, o + l, factor, jacobian, r)
        elif form == CARTESIAN:
            residual[r] = p[l] - c[l]
            slope = along[l]
            add_coordinate_rate(lifted, records, k, o, pu[l], jacobian, r)
            add_coordinate_rate(lifted, records, k, o + 1, pv[l], jacobian, r)
        else:
            axis = (turn[l], turn[3 + l], turn[6 + l])
            arm = arm_f if side == 0 else arm_g
            residual[r] = dot(axis, arm) - c[l]
            slope = along[l]
            if not free:
                # Not by the coordinates of the other surface: they have no rates at its poles.
                add_coordinate_rate(lifted, records, k, o, pu[l], jacobian, r)
                add_coordinate_rate(lifted, records, k, o + 1, pv[l], jacobian, r)
                for j in range(FREE_COLUMN):
                    jacobian[r, j] += toward[l] * jacobian[k, j]
                if moves:
                    add_rate(records, scratch, o, -slope, jacobian, r)
                continue
            material_rates(axis, arm_f, arm_g, 1.0 - 2.0 * side, jacobian, r)
            add_coordinate_rate(lifted, records, k, 2 - o, dot(axis, du), jacobian, r)
            add_coordinate_rate(lifted, records, k, 3 - o, dot(axis, dv), jacobian, r)
        if moves:
            add_rate(records, scratch, o, -slope, jacobian, r)
    if trim.by_length == 1:
        signed_length(store, first, trim.count, 1.0 if kept * s >= 0.0 else -1.0, lifted, point)


@kernel(inner=True)
def signed_length(store, first, count, side, lifted, point):
    """Replace the rows of a vector by one, its length, positive on the right side of the loop. The others become zero.

    The signed length is smooth through zero, but its gradient is 0 / 0 there. All columns of the rows are parallel
    there: the longest one gives the direction, and the signed distance says which way is positive.
    """
    residual = point.residual
    jacobian = point.jacobian
    square = 0.0
    for l in range(count):
        square += residual[first + l] * residual[first + l]
    length = math.sqrt(square)
    best = -1
    most = 0.0
    for j in range(FREE_COLUMN + 4):
        column = 0.0
        for l in range(count):
            column += jacobian[first + l, j] * jacobian[first + l, j]
        if column > most:
            most = column
            best = j
    sign = side
    if length < NO_LENGTH and best >= 0:
        sign = 1.0
        reach = math.sqrt(most)
        for l in range(count):
            residual[first + l] = jacobian[first + l, best] / reach
        column = reach
    else:
        column = 0.0
        for l in range(count):
            residual[first + l] /= max(length, 1e-300)
    for j in range(FREE_COLUMN + 4):
        slope = 0.0
        for l in range(count):
            slope += residual[first + l] * jacobian[first + l, j]
            if l > 0:
                jacobian[first + l, j] = 0.0
        jacobian[first, j] = sign * slope
    for l in range(1, count):
        residual[first + l] = 0.0
    residual[first] = side * length
    if column > 0.0 and growth(store, first, best, lifted, point) < 0.0:
        for j in range(FREE_COLUMN + 4):
            jacobian[first, j] = -jacobian[first, j]


@kernel(inner=True)
def growth(store, r, j, lifted, point):
    """The derivative along column j of the signed distance, positive on the right side of the loop."""
    tracked = point.tracked
    records = point.records
    row = trim_of(store.table, r)
    k = row.contact
    derivatives = derivatives_at(records, k)
    o = 2 * row.side
    place = trim_place(store, row, tracked)
    _s, n, _bend = trim_distance(store, place.loop, tracked[k, o], tracked[k, o + 1])
    value = 0.0
    for i in range(2):
        if lifted.free[k] >= 0:
            value += n[i] if j == FREE_COLUMN + o + i else 0.0
        elif j < FREE_COLUMN:
            for l in range(4):
                value += n[i] * derivatives.rates[o + i, l] * derivatives.zed[l, j]
    return place.factor * value


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), "
        "Tuple((i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[::1])), "
        "Tuple((f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])))"
    )
)
def trim_rows(scene, pairs, at):
    """All rows of trims, and their gradients; the arguments have the parts of `Store`, `LiftedPairs` and `Iterate`."""
    table, pool = scene
    free, lengths, vectors, variables, guess, memory = pairs
    q, tracked, records, residual, jacobian = at
    store, point = Store(table, pool), Iterate(q, tracked, records, residual, jacobian)
    lifted = LiftedPairs(free, lengths, vectors, variables, guess, memory)
    header = header_at(table, 0)
    r = header.contacts
    while r < header.contacts + header.trims:
        row = trim_of(table, r)
        if row.form == AT_PLACE:
            place_row(store, r, lifted, point)
        elif row.form == SIGNED:
            signed_row(store, r, lifted, point)
        else:
            vector_rows(store, r, lifted, point)
        r += row.count
    return 0
