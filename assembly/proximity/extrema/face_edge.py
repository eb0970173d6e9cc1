"""A face and an edge or a vertex beside it, above it or within: Newton's method and the pair's frame.

A face S with normal n and a curve C, d = C - S, solve

    d.S_u = d.S_v = 0,   n.C_t = 0,

which stays regular through touching and penetration; a face and a vertex solve the first two. Newton's step is
taken in tangent lengths, as for two faces: H s = Y^T r1 - X^T r2 with the residual in place of the velocities of
`proximity/extrema/feature_jets.py`.

A parameter of the edge that a step would move beyond its end is held there: the pair is then that of the end point.
A straight edge inclined to a plane has no extremal point: the end with the smaller gap is held.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import add, blend, cross, dot, matvec, scale, sub
from assembly.proximity.brep.records import EDGE
from assembly.proximity.extrema.face_face import (
    CONVERGED,
    LEFT_PATCH,
    NOT_CONVERGED,
    SINGULAR,
    advance,
    bent_at_most,
    stagnates,
)
from assembly.proximity.extrema.face_frames import own_frame
from assembly.proximity.extrema.feature_jets import (
    BEYOND,
    FINE,
    RESIDUAL_ROUNDING,
    SLACK,
    FeatureFrame,
    edge_advance,
    edge_held,
    edge_side,
    edge_stride,
    face_side,
    inverse,
    other_jet,
    pair_response,
    vertex_side,
)
from assembly.proximity.extrema.pair_matrix import RANK, VANISHING, curvature_bound, fold_of, is_no_saddle

# A curve is steep where its tangent's part along the face, squared, is below this part of the tangent squared.
STEEP = 1e-12

# The result of Newton's method for a face and an edge, a vertex or a point, in the axes of the face.
FaceEdgePair = namedtuple(
    "FaceEdgePair",
    [
        "status",
        "parameters",  # (u, v) on the face, (t, s) of the other feature
        "face",  # a `SurfaceFrame`
        "point",  # of the other feature
        "gap",  # beta = normal.(point - face.point)
        "along",  # unit tangent of the edge along the face (two numbers)
        "bend",  # k = -n.C_tt / |P C_t|^2, the edge's curvature along the normal
        "speed",  # |P C_t|, how fast the edge goes along the face
        "unit",  # the curvature that makes Y of a point one over a length
        "residual",  # (r1x, r1y, tilt)
        "regular",  # whether there is a tangent plane, and a tangent of the edge along it
        "is_point",  # whether the other feature counts as a point
        "isolated",
        "proper",  # whether the edge is nearest here; true of a point
        "fold",  # det H / |H|^2
    ],
)


# A point beside a face, and its projection along the normal there.
PointOverFace = namedtuple(
    "PointOverFace",
    [
        "face",  # a `SurfaceFrame`
        "point",
        "gap",  # beta
        "residual",  # of the point along the tangents (two numbers)
        "offset",  # I + beta A (11, 12, 22)
        "bound",  # of the face's curvatures, at least one over the size
    ],
)
# An edge at a point of it, seen from a face.
EdgeOverFace = namedtuple(
    "EdgeOverFace",
    [
        "along",  # as those of `FaceEdgePair`
        "bend",
        "speed",
        "tilt",  # -n.C_t / |P C_t|
        "slope",  # n.C_t
        "curved",  # its own curvature
        "steep",  # whether it goes along the normal
    ],
)
# Of a point.
NO_EDGE = EdgeOverFace((1.0, 0.0), 0.0, 1.0, 0.0, 0.0, 0.0, False)
# A step of Newton's method for a face and an edge or a point, and the equations it is from.
FaceEdgeStep = namedtuple(
    "FaceEdgeStep",
    [
        "h",  # matrix (11, 12, 21, 22) of the equations
        "unit",  # as that of `FaceEdgePair`
        "move",  # of the point of the face, along its tangents
        "length",  # how far the other point goes
        "dt",  # and by how much its parameter changes
        "fine",  # whether the matrix is regular
        "slides",  # whether the edge is inclined to what is straight along it
        "is_point",  # whether the other feature counts as a point
    ],
)


@kernel(inline=True)
def scope_of(step, gap):
    """A bound of the entries of the equations' matrix."""
    return step.unit * (1.0 + abs(gap) * step.unit)


@kernel(inline=True)
def point_over(face, point, size):
    """The `PointOverFace` of a point and a `SurfaceFrame`."""
    a = face.shape
    d = sub(point, face.point)
    beta = dot(face.normal, d)
    residual = (dot(face.tangent_x, d), dot(face.tangent_y, d))
    offset = (1.0 + beta * a[0], beta * a[1], 1.0 + beta * a[2])
    return PointOverFace(face, point, beta, residual, offset, max(curvature_bound(a), 1.0 / size))


@kernel(inline=True)
def edge_over(face, ct, ctt):
    """The `EdgeOverFace` of an edge with these derivatives."""
    q0 = dot(face.tangent_x, ct)
    q1 = dot(face.tangent_y, ct)
    flat = q0 * q0 + q1 * q1
    square = dot(ct, ct)
    slope = dot(face.normal, ct)
    if flat <= STEEP * square:
        return EdgeOverFace((1.0, 0.0), 0.0, 1.0, 0.0, slope, 0.0, True)
    speed = math.sqrt(flat)
    side = cross(ct, ctt)
    curved = math.sqrt(dot(side, side)) / (square * math.sqrt(square))
    bend = -dot(face.normal, ctt) / flat
    return EdgeOverFace((q0 / speed, q1 / speed), bend, speed, -slope / speed, slope, curved, False)


@kernel(inline=True)
def point_step(over, slides, is_point):
    """The `FaceEdgeStep` of a point over a face."""
    r, k, unit = over.residual, over.offset, over.bound
    h = (unit * k[0], unit * k[1], unit * k[1], unit * k[2])
    i, fine = inverse(h, unit * (1.0 + abs(over.gap) * unit), FINE)
    move = (unit * (i[0] * r[0] + i[1] * r[1]), unit * (i[2] * r[0] + i[3] * r[1]))
    return FaceEdgeStep(h, unit, move, 0.0, 0.0, fine, slides, is_point)


@kernel(inline=True)
def edge_step(store, other, over, edge, limits):
    """The `FaceEdgeStep` of an edge over a face, as if it had no ends."""
    a, r, k = over.face.shape, over.residual, over.offset
    (c0, c1), bend = edge.along, edge.bend
    unit = max(over.bound, abs(bend))
    # The first row times the tangent, the second across it.
    w0 = c0 * k[0] + c1 * k[1]
    w1 = c0 * k[1] + c1 * k[2]
    h = (
        bend * w0 - c0 * a[0] - c1 * a[1],
        bend * w1 - c0 * a[1] - c1 * a[2],
        unit * (c0 * k[1] - c1 * k[0]),
        unit * (c0 * k[2] - c1 * k[1]),
    )
    i, fine = inverse(h, unit * (1.0 + abs(over.gap) * unit), FINE)
    s0 = bend * (c0 * r[0] + c1 * r[1]) - edge.tilt
    s1 = unit * (c0 * r[1] - c1 * r[0])
    ax = i[0] * s0 + i[1] * s1
    ay = i[2] * s0 + i[3] * s1
    bx = k[0] * ax + k[1] * ay - r[0]
    by = k[1] * ax + k[2] * ay - r[1]
    length = abs(bx) + abs(by)
    dt = (c0 * bx + c1 * by) / edge.speed
    slides = limits.steps > 0 and (edge.steep or (not fine and abs(edge.tilt) >= VANISHING))
    if slides:
        # The gap falls along all of this: on to where the edge bends or ends.
        length = limits.size
        dt = edge_stride(store, other.record)
        dt = -dt if edge.slope > 0.0 else dt
    return FaceEdgeStep(h, unit, (ax, ay), length, dt, fine, slides, False)


@kernel(inner=True)
def step_on_face(store, other, t, over, edge, limits):
    """The `FaceEdgeStep` of a face and another feature at t; an edge is held at its end."""
    moves = limits.steps > 0
    if other.kind != EDGE:
        return point_step(over, False, True)
    # Hold the edge at its end if the gap would be less beyond it.
    leads_out = moves and (edge.steep or abs(edge.tilt) > BEYOND)
    if leads_out and edge_held(store, other.record, t, -edge.slope):
        return point_step(over, False, True)
    step = edge_step(store, other, over, edge, limits)
    # Hold it also if the step leads beyond the end: the slope may be that at a point of the face not yet solved.
    leads_out = moves and abs(step.dt) * edge.speed > BEYOND * limits.size
    if leads_out and edge_held(store, other.record, t, step.dt):
        return point_step(over, step.slides, True)
    return step


@kernel(inline=True)
def face_edge_pair(status, x, over, edge, step, regular):
    """The `FaceEdgePair` that Newton's method ends with."""
    k = over.offset
    scope = scope_of(step, over.gap)
    _i, isolated = inverse(step.h, scope, RANK)
    fold = fold_of(step.h, scope)
    is_point = step.is_point
    tilt = 0.0 if is_point else edge.tilt
    is_regular = regular and not (edge.steep and not is_point)
    # Past a center of curvature the projection is no nearest point of the face; nor is the edge's if it bends away.
    nearest = is_point or (is_no_saddle(-fold) and k[0] + k[2] > 0.0 and k[0] * k[2] > k[1] * k[1])
    # Positive, as of two faces, where the pair is closest or deepest.
    fold = fold if is_point else -fold
    return FaceEdgePair(
        status=status,
        parameters=x,
        face=over.face,
        point=over.point,
        gap=over.gap,
        along=edge.along,
        bend=edge.bend,
        speed=edge.speed,
        unit=step.unit,
        residual=(over.residual[0], over.residual[1], tilt),
        regular=is_regular,
        is_point=is_point,
        isolated=isolated,
        proper=nearest,
        fold=fold,
    )


@kernel(inner=True)
def solve_on_face(store, face, other, pose, x, limits):
    """Newton from x = (u, v, t, s) for a face and an edge, a vertex or a point, in the axes of the face.

    A point of an edge stays at t, one of a face at (t, s). Returns a `FaceEdgePair`.
    """
    size = limits.size
    is_edge = other.kind == EDGE
    if limits.steps > 0 and is_edge:
        # A predicted start may be beyond an end, where the curve goes on and the edge does not.
        x = (x[0], x[1], edge_advance(store, other.record, x[2], 0.0), x[3])
    previous = 1e300
    status = NOT_CONVERGED
    iteration = 0
    while True:
        own = own_frame(store, face, x[0], x[1])
        q, ct, ctt = other_jet(store, other, pose, x[2], x[3])
        over = point_over(own, q, size)
        edge = edge_over(own, ct, ctt) if is_edge else NO_EDGE
        regular = own.regular and (not is_edge or dot(ct, ct) > 1e-290)
        if not regular:
            # An apex, a crease or a cusp: there is no tangent to step along.
            step = point_step(over, False, not is_edge)
            break
        step = step_on_face(store, other, x[2], over, edge, limits)
        tilt = 0.0 if step.is_point else edge.tilt
        ax, ay = step.move
        length_f = abs(ax) + abs(ay)
        length = max(length_f, step.length)
        bend_f = length_f * max(curvature_bound(own.shape), 2.0 / size)
        bend_g = 0.0 if step.is_point or step.slides else step.length * max(edge.curved, 2.0 / size)
        bend = max(bend_f, bend_g)
        off = max(abs(over.residual[0]), abs(over.residual[1]))
        level = RESIDUAL_ROUNDING if step.fine else SLACK
        small = off <= level * size and abs(tilt) <= level
        settled = (length <= 4e-14 * size and bend < 1e-9) or stagnates(
            length, bend, previous, status, own.point, q, size
        )
        if not step.slides and (small or settled):
            if step.is_point and is_edge:
                status = LEFT_PATCH
            elif inverse(step.h, scope_of(step, over.gap), RANK)[1]:
                status = CONVERGED
            else:
                status = SINGULAR if abs(tilt) < VANISHING and off < VANISHING * size else NOT_CONVERGED
            break
        if iteration >= limits.steps or not length < 1e300 or bend > limits.turn:
            break
        previous = length
        factor = bent_at_most(bend_f)
        e = own.rates
        du = factor * (e[0] * ax + e[1] * ay)
        dv = factor * e[2] * ay
        way = blend(factor * ax, own.tangent_x, factor * ay, own.tangent_y)
        u, v, clamped = advance(store, face, x[0], x[1], du, dv, way)
        t = x[2] if step.is_point else edge_advance(store, other.record, x[2], bent_at_most(bend_g) * step.dt)
        status = NOT_CONVERGED
        if clamped:
            status = LEFT_PATCH
            # Held at the end of the patch and nothing else moves: the pair has left.
            if abs(u - x[0]) + abs(v - x[1]) + abs(t - x[2]) <= 1e-12 * (abs(du) + abs(dv) + abs(step.dt)):
                break
        x = (u, v, t, x[3])
        iteration += 1
    return face_edge_pair(status, x, over, edge, step, regular)


@kernel(inline=True)
def sided_frame(found, side):
    """The `FeatureFrame` of a pair in the axes of the face, which is f; `side` -1: with n and y reversed."""
    face, speed, unit = found.face, found.speed, found.unit
    e, a, r = face.rates, face.shape, found.residual
    c = (found.along[0], side * found.along[1])
    other = vertex_side(unit)
    rate = (0.0, 0.0, 0.0, 0.0)
    if not found.is_point:
        other = edge_side(c[0], c[1], side * found.bend, unit)
        rate = (c[0] / speed, c[1] / speed, 0.0, 0.0)
    own = face_side((side * a[0], a[1], side * a[2]))
    response = pair_response(own, other, found.gap, unit) if side > 0.0 else pair_response(other, own, found.gap, unit)
    return FeatureFrame(
        normal=scale(side, face.normal),
        tangent_x=face.tangent_x,
        tangent_y=scale(side, face.tangent_y),
        point_f=face.point,
        point_g=found.point,
        gap=found.gap,
        side_f=own,
        side_g=other,
        rates_f=(e[0], side * e[1], 0.0, side * e[2]),
        rates_g=rate,
        response=response,
        residual=(r[0], side * r[1], r[2], 0.0),
        regular=found.regular,
        isolated=found.isolated,
        proper=found.proper,
        fold=found.fold,
    )


@kernel(inner=True)
def face_frame(found):
    """The `FeatureFrame` of a pair whose face is f, from what `solve_on_face` returns."""
    return sided_frame(found, 1.0)


@kernel(inner=True)
def turned_frame(pose, found):
    """The frame of a pair whose face is g, in the axes of f: n, y and so the curvatures change sign."""
    frame = sided_frame(found, -1.0)
    return FeatureFrame(
        normal=matvec(pose.rotation, frame.normal),
        tangent_x=matvec(pose.rotation, frame.tangent_x),
        tangent_y=matvec(pose.rotation, frame.tangent_y),
        point_f=add(matvec(pose.rotation, frame.point_g), pose.shift),
        point_g=add(matvec(pose.rotation, frame.point_f), pose.shift),
        gap=frame.gap,
        side_f=frame.side_g,
        side_g=frame.side_f,
        rates_f=frame.rates_g,
        rates_g=frame.rates_f,
        response=frame.response,
        residual=frame.residual,
        regular=frame.regular,
        isolated=frame.isolated,
        proper=frame.proper,
        fold=frame.fold,
    )
