"""A face and an edge or a vertex beside it, above it or within: Newton's method and the pair's frame.

A face S with normal n and a curve C, d = C - S, solve

    d.S_u = d.S_v = 0,   n.C_t = 0,

which stays regular through touching and penetration; a face and a vertex the first two of these. Newton's step is
taken in tangent lengths, as for two faces: H s = Y^T r1 - X^T r2 with the residual in place of the velocities of
`proximity/extrema/feature_jets.py`.

A parameter of the edge that a step would move beyond its end is held there: the pair is then that of the end point.
Of a straight edge inclined to a plane no point is extremal: the end with the smaller gap is held.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import add, blend, cross, dot, matvec, neg, sub
from assembly.proximity.brep.records import EDGE
from assembly.proximity.extrema.face_face import (
    BEND,
    CONVERGED,
    LEFT_PATCH,
    NOT_CONVERGED,
    SINGULAR,
    advance,
    own_frame,
    stagnates,
)
from assembly.proximity.extrema.feature_jets import (
    BEYOND,
    FINE,
    ROUNDING,
    SLACK,
    FeatureFrame,
    edge_advance,
    edge_held,
    edge_side,
    edge_stride,
    face_side,
    fold_of,
    inverse,
    other_jet,
    pair_response,
    vertex_side,
)
from assembly.proximity.extrema.pair_matrix import RANK, curvature_bound

# A curve is steep where the part of its tangent along a face is below this (squared, of its length squared).
STEEP = 1e-12
# Where nothing is isolated, a residual below this (over the size, or a tilt) is none.
LEVEL = 1e-9

# What Newton's method came to for a face and an edge, a vertex or a point, in the axes of the face.
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


@kernel(inner=True)
def solve_on_face(store, face, kind, other, pose, x, size, turn, limit):
    """Newton from x = (u, v, t, s) for a face and an edge, a vertex or a point, in the axes of the face.

    A point of an edge stays at t, one of a face at (t, s). With limit 0 everything is evaluated at x. Returns a
    `FaceEdgePair`.
    """
    if limit > 0 and kind == EDGE:
        # A start carried along a step may be beyond an end, where the curve goes on and the edge does not.
        x = (x[0], x[1], edge_advance(store, other, x[2], 0.0), x[3])
    tolerance = 4e-14 * size
    previous = 1e300
    status = NOT_CONVERGED
    iteration = 0
    while True:
        own = own_frame(store, face, x[0], x[1])
        p, n, tx, ty = own.point, own.normal, own.tangent_x, own.tangent_y
        e, a, regular = own.rates, own.shape, own.regular
        q, ct, ctt = other_jet(store, kind, other, pose, x[2], x[3])
        d = sub(q, p)
        beta = dot(n, d)
        r0 = dot(tx, d)
        r1 = dot(ty, d)
        k11 = 1.0 + beta * a[0]
        k12 = beta * a[1]
        k22 = 1.0 + beta * a[2]
        bound = max(curvature_bound(a), 1.0 / size)
        point = kind != EDGE
        steep = False
        c0 = 1.0
        c1 = 0.0
        k = 0.0
        speed = 1.0
        tilt = 0.0
        bent = 0.0
        dt = 0.0
        unit = bound
        h = (unit * k11, unit * k12, unit * k12, unit * k22)
        if not point:
            q0 = dot(tx, ct)
            q1 = dot(ty, ct)
            flat = q0 * q0 + q1 * q1
            square = dot(ct, ct)
            slope = dot(n, ct)
            steep = flat <= STEEP * square
            regular = regular and square > 1e-290
            if not steep:
                speed = math.sqrt(flat)
                c0 = q0 / speed
                c1 = q1 / speed
                k = -dot(n, ctt) / flat
                tilt = -slope / speed
                side = cross(ct, ctt)
                bent = math.sqrt(dot(side, side)) / (square * math.sqrt(square))
        if not regular:
            # An apex, a crease or a cusp: there is no tangent to go on.
            break
        slide = False
        if not point and limit > 0 and (steep or abs(tilt) > BEYOND):
            # At the end of the edge, and the gap would be less beyond it.
            point = edge_held(store, other, x[2], -slope)
        if not point:
            unit = max(bound, abs(k))
            # The first row times the tangent, the second across it.
            w0 = c0 * k11 + c1 * k12
            w1 = c0 * k12 + c1 * k22
            h = (
                k * w0 - c0 * a[0] - c1 * a[1],
                k * w1 - c0 * a[1] - c1 * a[2],
                unit * (c0 * k12 - c1 * k11),
                unit * (c0 * k22 - c1 * k12),
            )
            i, fine = inverse(h, unit * (1.0 + abs(beta) * unit), FINE)
            s0 = k * (c0 * r0 + c1 * r1) - tilt
            s1 = unit * (c0 * r1 - c1 * r0)
            ax = i[0] * s0 + i[1] * s1
            ay = i[2] * s0 + i[3] * s1
            bx = k11 * ax + k12 * ay - r0
            by = k12 * ax + k22 * ay - r1
            dt = (c0 * bx + c1 * by) / speed
            slide = limit > 0 and (steep or (not fine and abs(tilt) >= LEVEL))
            if slide:
                # The gap falls along all of this: on to where the edge bends or ends.
                dt = edge_stride(store, other)
                dt = -dt if slope > 0.0 else dt
            # Held too where the step leads beyond the end: the slope may be that of a face not solved yet.
            point = limit > 0 and abs(dt) * speed > BEYOND * size and edge_held(store, other, x[2], dt)
        if point:
            unit = bound
            tilt = 0.0
            dt = 0.0
            h = (unit * k11, unit * k12, unit * k12, unit * k22)
            i, fine = inverse(h, unit * (1.0 + abs(beta) * unit), FINE)
            ax = unit * (i[0] * r0 + i[1] * r1)
            ay = unit * (i[2] * r0 + i[3] * r1)
            step_g = 0.0
        elif slide:
            step_g = size
        else:
            step_g = abs(bx) + abs(by)
        step_f = abs(ax) + abs(ay)
        step = max(step_f, step_g)
        bend_f = step_f * max(curvature_bound(a), 2.0 / size)
        bend_g = 0.0 if point or slide else step_g * max(bent, 2.0 / size)
        bend = max(bend_f, bend_g)
        off = max(abs(r0), abs(r1))
        level = ROUNDING if fine else SLACK
        small = off <= level * size and abs(tilt) <= level
        settled = (step <= tolerance and bend < 1e-9) or stagnates(step, bend, previous, status, p, q, size)
        if not slide and (small or settled):
            _i, isolated = inverse(h, unit * (1.0 + abs(beta) * unit), RANK)
            done = abs(tilt) < LEVEL and off < LEVEL * size
            if point and kind == EDGE:
                status = LEFT_PATCH
            elif isolated:
                status = CONVERGED
            else:
                status = SINGULAR if done else NOT_CONVERGED
            break
        if iteration >= limit or not step < 1e300 or bend > turn:
            break
        previous = step
        factor_f = 1.0 if bend_f <= BEND else BEND / bend_f
        factor_g = 1.0 if bend_g <= BEND else BEND / bend_g
        du = factor_f * (e[0] * ax + e[1] * ay)
        dv = factor_f * e[2] * ay
        u, v, clamped = advance(store, face, x[0], x[1], du, dv, blend(factor_f * ax, tx, factor_f * ay, ty))
        t = x[2] if point else edge_advance(store, other, x[2], factor_g * dt)
        status = NOT_CONVERGED
        if clamped:
            status = LEFT_PATCH
            # Held at the end of the patch and nothing else moves: the pair has left.
            if abs(u - x[0]) + abs(v - x[1]) + abs(t - x[2]) <= 1e-12 * (abs(du) + abs(dv) + abs(dt)):
                break
        x = (u, v, t, x[3])
        iteration += 1
    scope = unit * (1.0 + abs(beta) * unit)
    _i, isolated = inverse(h, scope, RANK)
    fold = fold_of(h, scope)
    # Past a center of curvature the foot is no nearest point of the face; nor is the edge's where it bends away.
    nearest = point or (fold < LEVEL and k11 + k22 > 0.0 and k11 * k22 > k12 * k12)
    return FaceEdgePair(
        status=status,
        parameters=x,
        face=own,
        point=q,
        gap=beta,
        along=(c0, c1),
        bend=k,
        speed=speed,
        unit=unit,
        residual=(r0, r1, tilt),
        regular=regular and not (steep and not point),
        is_point=point,
        isolated=isolated,
        proper=nearest,
        # Positive, as of two faces, where the pair is closest or deepest.
        fold=fold if point else -fold,
    )


@kernel(inner=True)
def face_frame(found):
    """The `FeatureFrame` of a pair whose face is f, from what `solve_on_face` returns."""
    face, c, speed, unit = found.face, found.along, found.speed, found.unit
    e, residual = face.rates, found.residual
    f = face_side(face.shape)
    if found.is_point:
        g = vertex_side(unit)
        rate = (0.0, 0.0, 0.0, 0.0)
    else:
        g = edge_side(c[0], c[1], found.bend, unit)
        rate = (c[0] / speed, c[1] / speed, 0.0, 0.0)
    return FeatureFrame(
        normal=face.normal,
        tangent_x=face.tangent_x,
        tangent_y=face.tangent_y,
        point_f=face.point,
        point_g=found.point,
        gap=found.gap,
        side_f=f,
        side_g=g,
        rates_f=(e[0], e[1], 0.0, e[2]),
        rates_g=rate,
        response=pair_response(f, g, found.gap, unit),
        residual=(residual[0], residual[1], residual[2], 0.0),
        regular=found.regular,
        isolated=found.isolated,
        proper=found.proper,
        fold=found.fold,
    )


@kernel(inner=True)
def turned_frame(pose, found):
    """The frame of a pair whose face is g, in the axes of f: n, y and with them the curvatures change their signs."""
    face, c, speed, unit = found.face, found.along, found.speed, found.unit
    e, a, residual = face.rates, face.shape, found.residual
    g = face_side((-a[0], a[1], -a[2]))
    if found.is_point:
        f = vertex_side(unit)
        rate = (0.0, 0.0, 0.0, 0.0)
    else:
        f = edge_side(c[0], -c[1], -found.bend, unit)
        rate = (c[0] / speed, -c[1] / speed, 0.0, 0.0)
    return FeatureFrame(
        normal=neg(matvec(pose.rotation, face.normal)),
        tangent_x=matvec(pose.rotation, face.tangent_x),
        tangent_y=neg(matvec(pose.rotation, face.tangent_y)),
        point_f=add(matvec(pose.rotation, found.point), pose.shift),
        point_g=add(matvec(pose.rotation, face.point), pose.shift),
        gap=found.gap,
        side_f=f,
        side_g=g,
        rates_f=rate,
        rates_g=(e[0], -e[1], 0.0, -e[2]),
        response=pair_response(f, g, found.gap, unit),
        residual=(residual[0], -residual[1], residual[2], 0.0),
        regular=found.regular,
        isolated=found.isolated,
        proper=found.proper,
        fold=found.fold,
    )
