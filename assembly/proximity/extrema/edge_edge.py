"""Edges and vertices among themselves: Newton's method and the pair's frame.

Two curves solve d.C_1' = d.C_2' = 0, d = C_2 - C_1, which is regular while their tangents are not parallel, even where
the curves cross. The normal is then across both tangents, on the side of the given normal; where only the distance
determines it, n = d / |d| and the gap is |d|. A parameter that a step would move beyond the end of its edge is held
there, and the end counts as a point.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import cross, dot, neg, scale, sub
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.brep.records import EDGE, VERTEX
from assembly.proximity.extrema.face_face import (
    CONVERGED,
    LEFT_PATCH,
    NOT_CONVERGED,
    SINGULAR,
    STAGNANT,
    bent_at_most,
)
from assembly.proximity.extrema.feature_jets import (
    BEYOND,
    FINE,
    RESIDUAL_ROUNDING,
    SLACK,
    FeatureFrame,
    across,
    edge_advance,
    edge_held,
    edge_side,
    inverse,
    other_jet,
    pair_response,
    vertex_side,
)
from assembly.proximity.extrema.pair_matrix import RANK, VANISHING, fold_of

# Points closer than this part of the size coincide: their difference has no direction.
COINCIDENT = 1e-13
# Above this sine of the angle between lines the normal is across both, even where their points are uncertain.
NEARLY = 3e-8

# A curve where a pair has a point of it, or a vertex, in the axes of body f.
CurveSide = namedtuple(
    "CurveSide",
    [
        "point",
        "tangent",  # of length one; zero of a vertex
        "bent",  # curvature vector C_tt / |C_t|^2
        "bend",  # curvature
        "speed",  # |C_t|; one of a vertex
    ],
)
# A step of Newton's method for two curves, and the equations it is from.
CurveStep = namedtuple(
    "CurveStep",
    [
        "h",  # matrix (11, 12, 21, 22) of the equations
        "scope",  # bound of its entries
        "residual",  # (d.t_f, d.t_g) [length]
        "lengths",  # how far the points go along their curves
        "fine",  # whether the matrix is regular
        "point_f",  # whether f counts as a point: a vertex, or an edge that is held at an end
        "point_g",
    ],
)


@kernel(inline=True)
def curve_side(store, feature, pose, t):
    """The `CurveSide` of an edge at t, or of a vertex."""
    p, ct, ctt = other_jet(store, feature, pose, t, 0.0)
    square = dot(ct, ct)
    if not square > 1e-290:
        return CurveSide(p, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 1.0)
    speed = math.sqrt(square)
    side = cross(ct, ctt)
    bend = math.sqrt(dot(side, side)) / (square * speed)
    return CurveSide(p, scale(1.0 / speed, ct), scale(1.0 / square, ctt), bend, speed)


@kernel(inner=True)
def normal_between(d, t1, t2, curves, n, size, isolated):
    """Unit normal from the first feature to the second, and whether it is certain."""
    distance = math.sqrt(dot(d, d))
    known = dot(n, n) > 0.25
    if curves:
        w = cross(t1, t2)
        sine = math.sqrt(dot(w, w))
        # Take the direction with the smaller error: along nearly parallel lines the points are uncertain, and so is d.
        if (sine * size > distance and sine > 1e-12) or (sine > NEARLY and not isolated):
            w = scale(1.0 / sine, w)
            toward = dot(w, n) if known else dot(w, d)
            return (neg(w) if toward < 0.0 else w), True
    if distance > COINCIDENT * size:
        w = scale(1.0 / distance, d)
        if curves and known and dot(w, n) < 0.0:
            w = neg(w)
        return w, True
    # The tangent of a vertex is zero: t1 + t2 is that of the edge, if there is one.
    return across(t1 if dot(t1, t1) > 0.5 else t2, n), False


@kernel(inner=True)
def straight_side(tx, ty, n, side, is_point, unit):
    """(X, Y) of an edge or a point, and its parameter's rate."""
    if is_point:
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
def straight_frame(curve_f, curve_g, step, normal, size, regular):
    """The `FeatureFrame` of a pair without faces, from the `CurveSide` of either and the `CurveStep` there."""
    _i, isolated = inverse(step.h, step.scope, RANK)
    t1, t2 = curve_f.tangent, curve_g.tangent
    d = sub(curve_g.point, curve_f.point)
    n, sure = normal_between(d, t1, t2, not (step.point_f or step.point_g), normal, size, isolated)
    tx = across(n, t1 if dot(t1, t1) > 0.5 else t2)
    ty = cross(n, tx)
    beta = dot(n, d)
    unit = max(max(abs(dot(n, curve_f.bent)), abs(dot(n, curve_g.bent))), 1.0 / size)
    f, rate_f = straight_side(tx, ty, n, curve_f, step.point_f, unit)
    g, rate_g = straight_side(tx, ty, n, curve_g, step.point_g, unit)
    # Where points coincide, the normal is the given one, or any.
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
        residual=(step.residual[0], step.residual[1], 0.0, 0.0),
        regular=regular,
        isolated=isolated,
        proper=True,
        fold=fold_of(step.h, step.scope),
    )


@kernel(inner=True)
def curve_step(store, f, g, x, curve_f, curve_g, limits):
    """The `CurveStep` from x = (t_f, t_g); an edge is held at its end if the step would lead beyond it."""
    least = BEYOND * limits.size
    moves = limits.steps > 0
    d = sub(curve_g.point, curve_f.point)
    t1, t2 = curve_f.tangent, curve_g.tangent
    scope = 1.0 + math.sqrt(dot(d, d)) * (curve_f.bend + curve_g.bend)
    r1 = dot(d, t1)
    r2 = dot(d, t2)
    # Hold an edge at its end if the distance would be less beyond it.
    point_f = f.kind == VERTEX or (moves and abs(r1) > least and edge_held(store, f.record, x[0], r1))
    point_g = g.kind == VERTEX or (moves and abs(r2) > least and edge_held(store, g.record, x[1], -r2))
    while True:
        r1 = 0.0 if point_f else r1
        r2 = 0.0 if point_g else r2
        cosine = 0.0 if point_f or point_g else dot(t1, t2)
        h = (
            1.0 if point_f else 1.0 - dot(d, curve_f.bent),
            -cosine,
            -cosine,
            1.0 if point_g else 1.0 + dot(d, curve_g.bent),
        )
        i, fine = inverse(h, scope, FINE)
        s1 = i[0] * r1 - i[1] * r2
        s2 = i[2] * r1 - i[3] * r2
        # Hold it also if the step leads beyond its end.
        out_f = moves and not point_f and abs(s1) > least and edge_held(store, f.record, x[0], s1)
        out_g = moves and not point_g and abs(s2) > least and edge_held(store, g.record, x[1], s2)
        if not (out_f or out_g):
            return CurveStep(h, scope, (r1, r2), (s1, s2), fine, point_f, point_g)
        point_f = point_f or out_f
        point_g = point_g or out_g


@kernel(inner=True)
def solve_off_face(store, f, g, pose, x, normal, limits):
    """Newton from x = (t_f, t_g) for edges and vertices. Returns status, (t_f, t_g) and the frame."""
    size = limits.size
    at_f = f.kind == VERTEX
    at_g = g.kind == VERTEX
    if limits.steps > 0:
        # A predicted start may be beyond an end, where the curve goes on and the edge does not.
        x = (
            edge_advance(store, f.record, x[0], 0.0) if f.kind == EDGE else x[0],
            edge_advance(store, g.record, x[1], 0.0) if g.kind == EDGE else x[1],
        )
    previous = 1e300
    status = NOT_CONVERGED
    iteration = 0
    while True:
        curve_f = curve_side(store, f, IDENTITY, x[0])
        curve_g = curve_side(store, g, pose, x[1])
        t1, t2 = curve_f.tangent, curve_g.tangent
        regular = (at_f or dot(t1, t1) > 0.5) and (at_g or dot(t2, t2) > 0.5)
        if not regular:
            step = CurveStep((1.0, 0.0, 0.0, 1.0), 1.0, (0.0, 0.0), (0.0, 0.0), False, at_f, at_g)
            break
        step = curve_step(store, f, g, x, curve_f, curve_g, limits)
        s1, s2 = step.lengths
        length = max(abs(s1), abs(s2))
        bend_f = abs(s1) * max(curve_f.bend, 2.0 / size)
        bend_g = abs(s2) * max(curve_g.bend, 2.0 / size)
        bend = max(bend_f, bend_g)
        off = max(abs(step.residual[0]), abs(step.residual[1]))
        small = off <= (RESIDUAL_ROUNDING if step.fine else SLACK) * size
        if small or (length <= 4e-14 * size and bend < 1e-9) or (bend < STAGNANT and length > 0.25 * previous):
            if step.point_f != at_f or step.point_g != at_g:
                status = LEFT_PATCH
            elif inverse(step.h, step.scope, RANK)[1]:
                status = CONVERGED
            else:
                status = SINGULAR if off < VANISHING * size else NOT_CONVERGED
            break
        if iteration >= limits.steps or not length < 1e300 or bend > limits.turn:
            break
        previous = length
        factor_f = bent_at_most(bend_f)
        factor_g = bent_at_most(bend_g)
        x = (
            x[0] if step.point_f else edge_advance(store, f.record, x[0], factor_f * s1 / curve_f.speed),
            x[1] if step.point_g else edge_advance(store, g.record, x[1], factor_g * s2 / curve_g.speed),
        )
        iteration += 1
    frame = straight_frame(curve_f, curve_g, step, normal, size, regular)
    if status == CONVERGED and not frame.isolated:
        status = SINGULAR
    return status, x, frame
