"""Edges and vertices among themselves: Newton's method and the pair's frame.

Two curves solve d.C_1' = d.C_2' = 0, d = C_2 - C_1: regular while their tangents are not parallel, even where they
cross. The normal is across both tangents then, on the side of the one given; where only the distance tells, n = d / |d|
and the gap is |d|. A parameter that a step would move beyond the end of its edge is held there, and the end is a point.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import cross, dot, neg, scale, sub
from assembly.kinematics.motion import RelativePose
from assembly.proximity.brep.records import EDGE, VERTEX
from assembly.proximity.extrema.face_face import BEND, CONVERGED, LEFT_PATCH, NOT_CONVERGED, SINGULAR, STAGNANT
from assembly.proximity.extrema.feature_jets import (
    BEYOND,
    FINE,
    ROUNDING,
    SLACK,
    FeatureFrame,
    across,
    edge_advance,
    edge_held,
    edge_side,
    fold_of,
    inverse,
    other_jet,
    pair_response,
    vertex_side,
)
from assembly.proximity.extrema.pair_matrix import RANK

# Points closer than this part of the size coincide: their difference has no direction.
COINCIDENT = 1e-13
# Of lines at a larger angle the normal is across both, even where their points are hardly determined.
NEARLY = 3e-8

# A curve where a pair has a point of it, or a vertex, in the axes of body f.
CurveSide = namedtuple(
    "CurveSide",
    [
        "point",
        "tangent",  # of length one; zero of a vertex
        "bent",  # curvature vector C_tt / |C_t|^2
        "speed",  # |C_t|; one of a vertex
        "is_point",  # whether it counts as a vertex here
    ],
)


@kernel(inline=True)
def unit_tangent(ct, ctt):
    """Unit tangent, curvature vector C_tt / |C_t|^2, its bend and |C_t|; zeros and one for a vertex."""
    square = dot(ct, ct)
    if not square > 1e-290:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 1.0
    speed = math.sqrt(square)
    side = cross(ct, ctt)
    return scale(1.0 / speed, ct), scale(1.0 / square, ctt), math.sqrt(dot(side, side)) / (square * speed), speed


@kernel(inner=True)
def normal_between(d, t1, t2, curves, n, size, isolated):
    """Unit normal from the first feature to the second, and whether it is certain."""
    distance = math.sqrt(dot(d, d))
    known = dot(n, n) > 0.25
    if curves:
        w = cross(t1, t2)
        sine = math.sqrt(dot(w, w))
        # What has the smaller error. Along nearly parallel lines the points are uncertain, and with them d.
        if (sine * size > distance and sine > 1e-12) or (sine > NEARLY and not isolated):
            w = scale(1.0 / sine, w)
            toward = dot(w, n) if known else dot(w, d)
            return (neg(w) if toward < 0.0 else w), True
    if distance > COINCIDENT * size:
        w = scale(1.0 / distance, d)
        if curves and known and dot(w, n) < 0.0:
            w = neg(w)
        return w, True
    # Of a vertex there is no tangent: t1 + t2 is that of the edge, if there is one.
    return across(t1 if dot(t1, t1) > 0.5 else t2, n), False


@kernel(inner=True)
def straight_side(tx, ty, n, side, unit):
    """(X, Y) of an edge or a point, and its parameter's rate."""
    if side.is_point:
        return vertex_side(unit), (0.0, 0.0, 0.0, 0.0)
    c0 = dot(tx, side.tangent)
    c1 = dot(ty, side.tangent)
    length = math.sqrt(c0 * c0 + c1 * c1)
    if not length > 1e-9:
        return vertex_side(unit), (0.0, 0.0, 0.0, 0.0)
    c0 /= length
    c1 /= length
    return edge_side(c0, c1, -dot(n, side.bent), unit), (c0 / side.speed, c1 / side.speed, 0.0, 0.0)


@kernel(inner=True)
def straight_frame(curve_f, curve_g, residual, normal, size, regular, isolated, fold):
    """The `FeatureFrame` of a pair without faces, from the `CurveSide` of either."""
    t1, t2 = curve_f.tangent, curve_g.tangent
    d = sub(curve_g.point, curve_f.point)
    n, sure = normal_between(d, t1, t2, not (curve_f.is_point or curve_g.is_point), normal, size, isolated)
    tx = across(n, t1 if dot(t1, t1) > 0.5 else t2)
    ty = cross(n, tx)
    beta = dot(n, d)
    unit = max(max(abs(dot(n, curve_f.bent)), abs(dot(n, curve_g.bent))), 1.0 / size)
    f, rate_f = straight_side(tx, ty, n, curve_f, unit)
    g, rate_g = straight_side(tx, ty, n, curve_g, unit)
    # Where points coincide their direction is the one given, or any.
    isolated = isolated and (sure or dot(normal, normal) > 0.25)
    return FeatureFrame(
        normal=n,
        tangent_x=tx,
        tangent_y=ty,
        point_f=curve_f.point,
        point_g=curve_g.point,
        gap=beta,
        side_f=f,
        side_g=g,
        rates_f=rate_f,
        rates_g=rate_g,
        response=pair_response(f, g, beta, unit),
        residual=(residual[0], residual[1], 0.0, 0.0),
        regular=regular,
        isolated=isolated,
        proper=True,
        fold=fold,
    )


@kernel(inner=True)
def solve_off_face(store, kind_f, f, kind_g, g, pose, x, normal, size, turn, limit):
    """Newton from x = (t_f, t_g) for edges and vertices. Returns status, (t_f, t_g) and the frame."""
    same = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    origin = (0.0, 0.0, 0.0)
    if limit > 0:
        # A start carried along a step may be beyond an end, where a curve goes on and its edge does not.
        x = (
            edge_advance(store, f, x[0], 0.0) if kind_f == EDGE else x[0],
            edge_advance(store, g, x[1], 0.0) if kind_g == EDGE else x[1],
        )
    tolerance = 4e-14 * size
    previous = 1e300
    status = NOT_CONVERGED
    iteration = 0
    while True:
        p, ct, ctt = other_jet(store, kind_f, f, RelativePose(same, origin), x[0], 0.0)
        q, cs, css = other_jet(store, kind_g, g, pose, x[1], 0.0)
        d = sub(q, p)
        t1, bent1, bend1, speed1 = unit_tangent(ct, ctt)
        t2, bent2, bend2, speed2 = unit_tangent(cs, css)
        regular = (kind_f == VERTEX or dot(t1, t1) > 0.5) and (kind_g == VERTEX or dot(t2, t2) > 0.5)
        point_f = kind_f == VERTEX
        point_g = kind_g == VERTEX
        scope = 1.0
        h = (1.0, 0.0, 0.0, 1.0)
        r1 = 0.0
        r2 = 0.0
        if not regular:
            break
        scope = 1.0 + math.sqrt(dot(d, d)) * (bend1 + bend2)
        r1 = dot(d, t1)
        r2 = dot(d, t2)
        if limit > 0:
            # At the end of an edge, and the distance would be less beyond it.
            point_f = point_f or (abs(r1) > BEYOND * size and edge_held(store, f, x[0], r1))
            point_g = point_g or (abs(r2) > BEYOND * size and edge_held(store, g, x[1], -r2))
        while True:
            r1 = 0.0 if point_f else r1
            r2 = 0.0 if point_g else r2
            cosine = 0.0 if point_f or point_g else dot(t1, t2)
            h = (
                1.0 if point_f else 1.0 - dot(d, bent1),
                -cosine,
                -cosine,
                1.0 if point_g else 1.0 + dot(d, bent2),
            )
            i, fine = inverse(h, scope, FINE)
            s1 = i[0] * r1 - i[1] * r2
            s2 = i[2] * r1 - i[3] * r2
            # Or a step leads beyond it.
            out_f = limit > 0 and not point_f and abs(s1) > BEYOND * size and edge_held(store, f, x[0], s1)
            out_g = limit > 0 and not point_g and abs(s2) > BEYOND * size and edge_held(store, g, x[1], s2)
            if not (out_f or out_g):
                break
            point_f = point_f or out_f
            point_g = point_g or out_g
        step = max(abs(s1), abs(s2))
        reach_f = abs(s1) * max(bend1, 2.0 / size)
        reach_g = abs(s2) * max(bend2, 2.0 / size)
        bend = max(reach_f, reach_g)
        off = max(abs(r1), abs(r2))
        small = off <= (ROUNDING if fine else SLACK) * size
        if small or (step <= tolerance and bend < 1e-9) or (bend < STAGNANT and step > 0.25 * previous):
            _i, isolated = inverse(h, scope, RANK)
            if point_f != (kind_f == VERTEX) or point_g != (kind_g == VERTEX):
                status = LEFT_PATCH
            elif isolated:
                status = CONVERGED
            else:
                status = SINGULAR if off < 1e-9 * size else NOT_CONVERGED
            break
        if iteration >= limit or not step < 1e300 or bend > turn:
            break
        previous = step
        factor_f = 1.0 if reach_f <= BEND else BEND / reach_f
        factor_g = 1.0 if reach_g <= BEND else BEND / reach_g
        x = (
            x[0] if point_f else edge_advance(store, f, x[0], factor_f * s1 / speed1),
            x[1] if point_g else edge_advance(store, g, x[1], factor_g * s2 / speed2),
        )
        iteration += 1
    _i, isolated = inverse(h, scope, RANK)
    frame = straight_frame(
        CurveSide(p, t1, bent1, speed1, point_f),
        CurveSide(q, t2, bent2, speed2, point_g),
        (r1, r2),
        normal,
        size,
        regular,
        isolated,
        fold_of(h, scope),
    )
    if status == CONVERGED and not frame.isolated:
        status = SINGULAR
    return status, x, frame
