"""Descent from any start to the nearest pair of two patches, used where Newton's method fails.

The controller of theorem 2 of paper 000 moves the two witness points against the projection errors. With d = g - f and
orthonormal tangents P, the slopes of |d|^2 / 2 over lengths on the surfaces are -P_f^T d and P_g^T d, and any positive
definite gain lowers |d|. Here the gain is (H + mu I)^-1 with a mu that makes it positive definite,

    H = [[I + (d.n_f) A_f, -P_f^T P_g], [-P_g^T P_f, I - (d.n_g) A_g]],

the second derivative of |d|^2 / 2, A the shape operators: steepest descent far away, Newton's method near a minimum.
Components of a step that would leave a patch are set to zero before it, and the parameters are clamped after it
(`docs/controllers.md`). A step is taken only if the points come closer.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_at, surface_point
from assembly.geometry.vec import add, blend, dot, matvec, matvec_t, sub
from assembly.proximity.extrema.face_face import (
    CONVERGED,
    LEFT_PATCH,
    NOT_CONVERGED,
    SINGULAR,
    PairSolution,
    advance,
    bent_at_most,
    solve_pair,
)
from assembly.proximity.extrema.face_frames import own_frame, pair_frame
from assembly.proximity.extrema.pair_matrix import FLAT, curvature_bound, pair_matrix

# Beside the statuses of `solve_pair`: the surfaces cross where the descent led.
CROSSED = 4
# Newton's method takes over where a step turns the normals by less than this many radians.
NEAR = 0.1
# [rad] Newton's method ends where a step would turn a normal by more: from points that are apart, or that meet.
TURN_APART, TURN_MET = 0.5, 1.0
# An extremum found by Newton's method belongs to the descent if no normal turned by more than the angle with this
# cosine: from points that are apart, or that meet.
SAME_APART, SAME_MET = 0.8, 0.5
# Points nearer than this part of the size meet; steps shorter than it end the descent.
MEET = 1e-10
# Where the descent ends with points nearer than this part of the size, they would meet: surfaces that touch.
TOUCH = 1e-5
# Gradients below this part of the size are rounding.
GRADIENT_ROUNDING = 1e-13
# The first damping, added to second derivatives of |d|^2 / 2, which are one for points that move on planes.
DAMPING = 1e-2
# The least damping, so that points that can slide without coming closer stay; the damping at which the descent ends.
LEAST, STUCK = 1e-8, 1e9


@kernel(inline=True)
def end_of(pool, breaks, spans, closed, pole_low, pole_high, u):
    """-1 or 1 where u is at the low or high end of a patch, else 0; poles and seams are no ends."""
    if closed == 1:
        return 0
    low = pool[breaks]
    high = pool[breaks + spans]
    slack = 1e-14 * (high - low)
    if u <= low + slack and pole_low == 0:
        return -1
    if u >= high - slack and pole_high == 0:
        return 1
    return 0


# Directions in the tangent frame in which a point may descend, and how many there are: the others are zero.
FreeDirections = namedtuple("FreeDirections", "first second count")


@kernel(inline=True)
def free_directions(store, r, u, v, e, gradient, slack):
    """The `FreeDirections` of a point: an end of the patch may take one away or both.

    e is E^-1 of `own_frame`; `gradient` is over tangent lengths, and `slack` is the part of it that is rounding. Along
    an end the direction is that of the end: S_v at an end of u.
    """
    patch = surface_at(store.table, r)
    gx, gy = gradient
    none = (0.0, 0.0)
    both = FreeDirections((1.0, 0.0), (0.0, 1.0), 2)
    if e[0] == 0.0:
        # At a pole.
        return both
    poles = patch.poles
    end_u = end_of(store.pool, patch.breaks_u, patch.spans_u, patch.closed_u, poles & 1, poles & 2, u)
    end_v = end_of(store.pool, patch.breaks_v, patch.spans_v, patch.closed_v, poles & 4, poles & 8, v)
    # S_v = (e12, e22) in the tangent frame, up to a positive factor; S_u = (1, 0).
    scale_v = 1.0 if e[2] > 0.0 else -1.0
    vx = -scale_v * e[1]
    vy = scale_v * e[0]
    # An end holds a point where descent leads out of the patch: at the low end where the gradient is positive.
    length = math.sqrt(vx * vx + vy * vy)
    held_u = end_u * gx < -slack
    held_v = end_v * (vx * gx + vy * gy) < -slack * length
    if held_u and held_v:
        return FreeDirections(none, none, 0)
    if held_v:
        return FreeDirections((1.0, 0.0), none, 1)
    if held_u:
        return FreeDirections((vx / length, vy / length), none, 1)
    return both


@kernel(inner=True)
def end_curvature(store, r, u, v, along_v, d):
    """d.C'' of the curve C at the end of a patch that a point is held at, by arc length."""
    _p, su, sv, suu, _suv, svv = surface_point(store.table, store.pool, r, u, v)
    tangent = sv if along_v else su
    second = svv if along_v else suu
    i = 1.0 / dot(tangent, tangent)
    return i * (dot(d, second) - i * dot(second, tangent) * dot(d, tangent))


@kernel(inline=True)
def reduced(k, shape, t):
    """T^T (I + k A) T over the directions t; the diagonal entry of a direction that is taken away is one."""
    h11, h12, h22 = 1.0 + k * shape[0], k * shape[1], 1.0 + k * shape[2]
    x, y = t.first
    z, w = t.second
    a = x * (h11 * x + h12 * y) + y * (h12 * x + h22 * y)
    b = x * (h11 * z + h12 * w) + y * (h12 * z + h22 * w)
    c = z * (h11 * z + h12 * w) + w * (h12 * z + h22 * w)
    return (a if t.count > 0 else 1.0), b, (c if t.count > 1 else 1.0)


@kernel(inline=True)
def descent_step(p, c, q, gf, gg, mu):
    """-(H + mu I)^-1 (gf, gg) for H = [[p, c], [c^T, q]] of 2x2 blocks, and whether H + mu I is positive definite."""
    p11 = p[0] + mu
    p22 = p[2] + mu
    det = p11 * p22 - p[1] * p[1]
    if not (p11 > 0.0 and det > 1e-12 * p11 * p11 and p22 > 0.0):
        return (0.0, 0.0), (0.0, 0.0), False
    i = 1.0 / det
    i11 = i * p22
    i12 = -i * p[1]
    i22 = i * p11
    # w = p^-1 c, then the complement q - c^T w.
    w11 = i11 * c[0] + i12 * c[2]
    w12 = i11 * c[1] + i12 * c[3]
    w21 = i12 * c[0] + i22 * c[2]
    w22 = i12 * c[1] + i22 * c[3]
    q11 = q[0] + mu - (c[0] * w11 + c[2] * w21)
    q12 = q[1] - (c[0] * w12 + c[2] * w22)
    q22 = q[2] + mu - (c[1] * w12 + c[3] * w22)
    det = q11 * q22 - q12 * q12
    if not (q11 > 1e-13 * q[0] and q22 > 1e-13 * q[2] and det > 1e-13 * q11 * q22):
        return (0.0, 0.0), (0.0, 0.0), False
    i = 1.0 / det
    r1 = -gg[0] + w11 * gf[0] + w21 * gf[1]
    r2 = -gg[1] + w12 * gf[0] + w22 * gf[1]
    b1 = i * (q22 * r1 - q12 * r2)
    b2 = i * (q11 * r2 - q12 * r1)
    a1 = -(i11 * gf[0] + i12 * gf[1]) - w11 * b1 - w12 * b2
    a2 = -(i12 * gf[0] + i22 * gf[1]) - w21 * b1 - w22 * b2
    return (a1, a2), (b1, b2), True


# Two points of surfaces. f, g: the `SurfaceFrame` of either, in its own axes; d: the vector from f to g in the axes of
# f; d_g: in those of g; square: |d|^2.
WitnessPoints = namedtuple("WitnessPoints", "f g d d_g square")


@kernel(inline=True)
def witness_points(store, surfaces, pose, x):
    """The `WitnessPoints` at parameters x."""
    own_f = own_frame(store, surfaces[0], x[0], x[1])
    own_g = own_frame(store, surfaces[1], x[2], x[3])
    d = sub(add(matvec(pose.rotation, own_g.point), pose.shift), own_f.point)
    return WitnessPoints(own_f, own_g, d, matvec_t(pose.rotation, d), dot(d, d))


# |d|^2 / 2 to second order about two points, over the directions in which they may go.
DescentModel = namedtuple(
    "DescentModel",
    [
        "ways_f",  # `FreeDirections`
        "ways_g",
        "h_f",  # second derivative (11, 12, 22) over those of f
        "coupling",  # over one of f and one of g (11, 12, 21, 22)
        "h_g",
        "slope_f",  # gradient over those of f [length]
        "slope_g",
        "bend_f",  # bound of the turn of the normal of f, per length of a step
        "bend_g",
    ],
)


@kernel(inline=True)
def descent_model(store, surfaces, pose, x, at, size):
    """The `DescentModel` at parameters x with these `WitnessPoints`."""
    f, g = surfaces
    xf, yf, xg, yg = at.f.tangent_x, at.f.tangent_y, at.g.tangent_x, at.g.tangent_y
    gf = (-dot(xf, at.d), -dot(yf, at.d))
    gg = (dot(xg, at.d_g), dot(yg, at.d_g))
    tf = free_directions(store, f, x[0], x[1], at.f.rates, gf, GRADIENT_ROUNDING * size)
    tg = free_directions(store, g, x[2], x[3], at.g.rates, gg, GRADIENT_ROUNDING * size)
    h_f = reduced(dot(at.f.normal, at.d), at.f.shape, tf)
    h_g = reduced(-dot(at.g.normal, at.d_g), at.g.shape, tg)
    if tf.count == 1:
        h_f = (1.0 - end_curvature(store, f, x[0], x[1], tf.first[1] != 0.0, at.d), 0.0, 1.0)
    if tg.count == 1:
        h_g = (1.0 + end_curvature(store, g, x[2], x[3], tg.first[1] != 0.0, at.d_g), 0.0, 1.0)
    f1 = matvec_t(pose.rotation, blend(tf.first[0], xf, tf.first[1], yf))
    f2 = matvec_t(pose.rotation, blend(tf.second[0], xf, tf.second[1], yf))
    g1 = blend(tg.first[0], xg, tg.first[1], yg)
    g2 = blend(tg.second[0], xg, tg.second[1], yg)
    return DescentModel(
        ways_f=tf,
        ways_g=tg,
        h_f=h_f,
        coupling=(-dot(f1, g1), -dot(f1, g2), -dot(f2, g1), -dot(f2, g2)),
        h_g=h_g,
        slope_f=(tf.first[0] * gf[0] + tf.first[1] * gf[1], tf.second[0] * gf[0] + tf.second[1] * gf[1]),
        slope_g=(tg.first[0] * gg[0] + tg.first[1] * gg[1], tg.second[0] * gg[0] + tg.second[1] * gg[1]),
        bend_f=max(curvature_bound(at.f.shape), 2.0 / size),
        bend_g=max(curvature_bound(at.g.shape), 2.0 / size),
    )


@kernel(inline=True)
def step_along(store, r, u, v, own, ways, step, factor):
    """Parameters of a surface after part of a step along its free directions; whether an end held them."""
    ax = factor * (ways.first[0] * step[0] + ways.second[0] * step[1])
    ay = factor * (ways.first[1] * step[0] + ways.second[1] * step[1])
    e = own.rates
    return advance(store, r, u, v, e[0] * ax + e[1] * ay, e[2] * ay, blend(ax, own.tangent_x, ay, own.tangent_y))


@kernel(inner=True)
def finish_by_newton(store, surfaces, pose, x, size, reach):
    """Newton's method from x: whether it came to the extremum that the descent leads to, and the `PairSolution`.

    It is the descent's if its points are no farther apart than those at x, and within `reach` of them on either
    surface; with reach = 0, where the surfaces meet, if the surfaces touch there or solids are deepest in each other.
    """
    f, g = surfaces
    start = pair_frame(store, f, g, pose, x)
    most = TURN_APART if reach > 0.0 else TURN_MET
    cosine = SAME_APART if reach > 0.0 else SAME_MET
    found = solve_pair(store, surfaces, pose, x, size, most, 0.0, False)
    y, frame = found.parameters, found.frame
    same = (found.status == CONVERGED or found.status == SINGULAR) and dot(start.normal, frame.normal) > cosine
    if same:
        before = own_frame(store, g, x[2], x[3]).normal
        after = own_frame(store, g, y[2], y[3]).normal
        same = dot(before, after) > cosine
        if reach > 0.0:
            d = sub(start.point_g, start.point_f)
            moved_f = sub(frame.point_f, start.point_f)
            moved_g = sub(frame.point_g, start.point_g)
            limit = reach * reach
            same = same and abs(frame.gap) <= math.sqrt(dot(d, d)) + 1e-12 * size
            same = same and dot(moved_f, moved_f) <= limit and dot(moved_g, moved_g) <= limit
        else:
            opposed = dot(after, matvec_t(pose.rotation, frame.normal)) < 0.0
            same = same and (abs(frame.gap) <= 1e-9 * size or (opposed and frame.gap < 0.0))
    return same, found


@kernel(inline=True)
def with_steps(found, count):
    """A `PairSolution` with its steps counted from `count` on."""
    return PairSolution(found.status, found.parameters, count + found.steps, found.frame, found.matrix)


@kernel(inner=True)
def descend_pair(store, surfaces, pose, x, size, limit):
    """From any parameters x down to the nearest pair that the descent leads to, in at most `limit` steps.

    Returns a `PairSolution`, as `solve_pair` does. The points never move apart.

    CONVERGED, SINGULAR: Newton's method finished, at the extremum that the descent led to.
    LEFT_PATCH: the points are nearest at the end of a patch.
    CROSSED: the points met, and there is no pair of a shallow penetration beside them.
    NOT_CONVERGED: the steps were spent, there is no tangent plane to go on, or x is a maximum or a saddle.
    """
    status = NOT_CONVERGED
    mu = LEAST
    near = NEAR
    count = 0
    f, g = surfaces
    at = witness_points(store, surfaces, pose, x)
    while at.f.regular and at.g.regular:
        if at.square <= MEET * MEET * size * size:
            status = CROSSED
            break
        model = descent_model(store, surfaces, pose, x, at, size)
        held = model.ways_f.count < 2 or model.ways_g.count < 2
        rf, rg = model.slope_f, model.slope_g
        first = max(DAMPING, DAMPING * math.sqrt(at.square) * max(model.bend_f, model.bend_g))
        lower = False
        while mu < STUCK * (1.0 + first):
            sf, sg, definite = descent_step(model.h_f, model.coupling, model.h_g, rf, rg, mu)
            if not definite:
                mu = max(4.0 * mu, 1e-4 * first)
                continue
            step_f, step_g = abs(sf[0]) + abs(sf[1]), abs(sg[0]) + abs(sg[1])
            step = max(step_f, step_g)
            bend = max(step_f * model.bend_f, step_g * model.bend_g)
            if not held and bend < near and mu <= 1e-3 * first:
                # `solve_pair` takes the last steps; if it goes elsewhere, the descent goes on and tries it from nearer.
                same, found = finish_by_newton(store, surfaces, pose, x, size, 8.0 * step + 1e-9 * size)
                if same:
                    return with_steps(found, count)
                near *= 0.1
            if step <= MEET * size or count >= limit:
                break
            factor = bent_at_most(bend)
            uf, vf, end_f = step_along(store, f, x[0], x[1], at.f, model.ways_f, sf, factor)
            ug, vg, end_g = step_along(store, g, x[2], x[3], at.g, model.ways_g, sg, factor)
            y = (uf, vf, ug, vg)
            there = witness_points(store, surfaces, pose, y)
            count += 1
            # The first-order change of |d|^2 / 2 over this step.
            slope = factor * (rf[0] * sf[0] + rf[1] * sf[1] + rg[0] * sg[0] + rg[1] * sg[1])
            if there.square < at.square + 2e-4 * slope or (there.square < at.square and (held or end_f or end_g)):
                lower = True
                # Half of the slope is what Newton's method gives near a minimum.
                mu = 0.1 * mu if there.square < at.square + 0.5 * slope else mu
                mu = mu if mu > 1e-4 * first else LEAST
                break
            mu = max(4.0 * mu, first)
        if not lower:
            # Nothing lower: stationary, or the steps are spent.
            if held and count < limit:
                status = LEFT_PATCH
            break
        x = y
        at = there
    if status == NOT_CONVERGED and at.square <= TOUCH * TOUCH * size * size:
        status = CROSSED
    if status == CROSSED:
        same, found = finish_by_newton(store, surfaces, pose, x, size, 0.0)
        if same:
            return with_steps(found, count)
    frame = pair_frame(store, f, g, pose, x)
    return PairSolution(status, x, count, frame, pair_matrix(frame.shape_f, frame.shape_g, frame.gap, FLAT / size))
