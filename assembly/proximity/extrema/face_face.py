"""The extremal pair of two surfaces: where they are closest, or deepest in each other.

With n the outward unit normal of f, d = g - f and m the normal of g scaled so that m.n = 1, the pair solves

    P^T d = 0   (d is normal to f)      and      r2 = P^T (m - n) = 0   (the normals are parallel),

P = [x y] an orthonormal tangent frame of f. Unlike "d orthogonal to all four tangents" this stays
regular through touching and interpenetration. Newton's step is taken in tangent lengths
a = E u_f', b = T u_g' with E = P^T [f_u f_v], T = P^T [g_u g_v]; A and C are the shape operators of f and g
with respect to n (dn = P A a), and

    H a = C r1 - r2,   b = (I + beta A) a - r1,   H = C (I + beta A) - A,   beta = n.d

(the two 2x2 solves of paper 001, appendix A, in one common frame, so that no angle between the
parameterizations and no sign of the second normal appears).
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import (
    surface_at,
)
from assembly.geometry.splines.pole import CHART, limits, nearest_pole, polar_step
from assembly.geometry.vec import add, blend, dot, matvec_t, scale, sub
from assembly.proximity.extrema.face_frames import PairFrame, pair_frame
from assembly.proximity.extrema.pair_matrix import (
    FLAT,
    VANISHING,
    PairMatrix,
    across_first,
    curvature_bound,
    null_ways,
    pair_matrix,
    right_side,
)

# A step that turns about a pole by more than this part of the domain is taken in the pole's plane.
POLE_TURN = 0.08
# What became of a pair.
CONVERGED, SINGULAR, LEFT_PATCH, NOT_CONVERGED = 0, 1, 2, 3
# The most steps of Newton's method. Near a solution four or five do, more while steps are shortened; around a ring,
# where the curvature of its wire shortens every step, some 60 lead halfway: the second limit.
LIMIT, AROUND = 40, 120
# A singular pair whose residual vanishes is accepted after so many steps; in a search, once its normals are parallel to
# the second [rad] and its points are above each other to the second times the size.
PATIENCE, SETTLED = 12, 1e-12
# The most, in radians, that a step may turn a normal.
BEND = 0.5
# Steps that no longer shrink are rounding where they turn normals by less than the first [rad]; where the end of a
# patch held the last one, by less than the second plus the third times the points' coordinates over the size.
STAGNANT, HELD_STILL, HELD_ROUNDING = 1e-7, 1e-12, 4e-15
# A step that turns the normals by less leaves an error below rounding when a solve carries the frame along it.
LAST_TURN = 2e-7

# What Newton's method from some parameters came to.
PairSolution = namedtuple(
    "PairSolution",
    [
        "status",
        "parameters",  # (u_f, v_f, u_g, v_g)
        "steps",
        "frame",  # a `PairFrame`
        "matrix",  # a `PairMatrix`
    ],
)


@kernel(inline=True)
def advance(store, r, u, v, du, dv, step):
    """Parameters moved by (du, dv), or over a pole by the tangential step (body axes); whether an end held them."""
    if surface_at(store.table, r).poles != 0:
        edge, distance = nearest_pole(store, r, u, v)
        ulo, uhi, _ = limits(store, r, 0)
        vlo, vhi, _ = limits(store, r, 1)
        turn = abs(dv) / (vhi - vlo) if edge <= 2 else abs(du) / (uhi - ulo)
        if edge <= 2:
            beyond = u + du < ulo if edge == 1 else u + du > uhi
        else:
            beyond = v + dv < vlo if edge == 4 else v + dv > vhi
        if distance < CHART or turn > POLE_TURN or beyond:
            u, v = polar_step(store, r, edge, u, v, step)
            return u, v, False
    return into_domain(store, r, u + du, v + dv)


@kernel(inline=True)
def pair_step(a, c, r, k, inverse, size):
    """Newton's step along the tangents of f and of g, and by how much either turns its surface's normal."""
    s0, s1 = right_side(c, r)
    ax = inverse[0] * s0 + inverse[1] * s1
    ay = inverse[2] * s0 + inverse[3] * s1
    bx = k[0] * ax + k[1] * ay - r[0]
    by = k[1] * ax + k[2] * ay - r[1]
    bend_f = (abs(ax) + abs(ay)) * max(curvature_bound(a), 2.0 / size)
    bend_g = (abs(bx) + abs(by)) * max(curvature_bound(c), 2.0 / size)
    return (ax, ay), (bx, by), bend_f, bend_g


@kernel(inline=True)
def step_of_other(a, c, k, h, step_f, step_g, size):
    """The step of a pair of a continuum, with its part along the continuum made by f, backwards, instead of by g.

    Where an end of g stops the pair, it may still move along the continuum to where both surfaces are. Along it H = 0:
    moves of f by s and of g by K s, K = I + beta A, leave the step's equations solved. Returns what `pair_step` does.
    """
    ax, ay = step_f
    bx, by = step_g
    if abs(h[0]) + abs(h[1]) + abs(h[2]) + abs(h[3]) <= FLAT / size:
        # Two planes: every direction is along the continuum.
        ax, ay, bx, by = ax - bx, ay - by, 0.0, 0.0
    else:
        _v, w = null_ways(h)
        kx = k[0] * w[0] + k[1] * w[1]
        ky = k[1] * w[0] + k[2] * w[1]
        stretch = w[0] * kx + w[1] * ky
        s = -(bx * w[0] + by * w[1]) / stretch if abs(stretch) > 1e-9 else 0.0
        ax, ay, bx, by = ax + s * w[0], ay + s * w[1], bx + s * kx, by + s * ky
    bend_f = (abs(ax) + abs(ay)) * max(curvature_bound(a), 2.0 / size)
    bend_g = (abs(bx) + abs(by)) * max(curvature_bound(c), 2.0 / size)
    return (ax, ay), (bx, by), bend_f, bend_g


@kernel(inline=True)
def bent_at_most(bend):
    """The part of a step that turns a normal by `BEND` at most."""
    return 1.0 if bend <= BEND else BEND / bend


@kernel(inline=True)
def move_pair(store, f, g, rotation, x, frame, step_f, step_g):
    """Parameters after steps along the tangents of either surface; whether either was clamped; how far they were to go.

    The steps are in the tangent frame of f for both; `frame` is the `PairFrame` at x.
    """
    e, t = frame.rates_f, frame.rates_g
    tx, ty = frame.tangent_x, frame.tangent_y
    ax, ay = step_f
    bx, by = step_g
    du = e[0] * ax + e[1] * ay
    dv = e[2] * ay
    ds = t[0] * bx + t[1] * by
    dt = t[2] * bx + t[3] * by
    uf, vf, clamped_f = advance(store, f, x[0], x[1], du, dv, blend(ax, tx, ay, ty))
    move = matvec_t(rotation, blend(bx, tx, by, ty))
    ug, vg, clamped_g = advance(store, g, x[2], x[3], ds, dt, move)
    return (uf, vf, ug, vg), clamped_f or clamped_g, abs(du) + abs(dv) + abs(ds) + abs(dt)


@kernel(inline=True)
def vanishes(r, size):
    """Whether a residual is as good as zero."""
    return abs(r[2]) + abs(r[3]) < VANISHING and abs(r[0]) + abs(r[1]) < VANISHING * size


@kernel(inline=True)
def settled(c, r, size):
    """Whether a pair is extremal to within rounding."""
    s0, s1 = right_side(c, r)
    return abs(s0) + abs(s1) <= SETTLED and abs(r[0]) + abs(r[1]) <= SETTLED * size


@kernel(inline=True)
def stagnates(step, bend, previous, status, p, q, size):
    """Whether a step that no longer shrinks is rounding; the limit is smaller where an end held the last step."""
    least = STAGNANT
    if status == LEFT_PATCH:
        least = min(HELD_STILL + HELD_ROUNDING * math.sqrt(dot(p, p) + dot(q, q)) / size, least)
    return bend < least and step > 0.25 * previous


@kernel(inline=True)
def carried_along(frame, ax, ay, bx, by):
    """The frame after a last, small step: its gap, points, normal and tangents; what depends on curvature stays."""
    n, tx, ty = frame.normal, frame.tangent_x, frame.tangent_y
    a, r = frame.shape_f, frame.residual
    wx = a[0] * ax + a[1] * ay
    wy = a[1] * ax + a[2] * ay
    return PairFrame(
        normal=add(n, blend(wx, tx, wy, ty)),
        tangent_x=sub(tx, scale(wx, n)),
        tangent_y=sub(ty, scale(wy, n)),
        point_f=add(frame.point_f, blend(ax, tx, ay, ty)),
        point_g=add(frame.point_g, blend(bx, tx, by, ty)),
        rates_f=frame.rates_f,
        rates_g=frame.rates_g,
        shape_f=a,
        shape_g=frame.shape_g,
        residual=r,
        gap=frame.gap + 0.5 * (r[0] * wx + r[1] * wy - r[2] * bx - r[3] * by),
        regular=frame.regular,
    )


@kernel(inner=True)
def solve_pair(store, surfaces, pose, x, size, turn, close, downhill):
    """Newton from x to the extremal pair of two surfaces: a `PairSolution`.

    `size` is the length against which steps are measured. A step that would turn a normal by more than `BEND` is
    shortened, so that the iteration follows the surface; one that would turn it by more than `turn` ends the iteration:
    x was not near a pair. After a step that turns it by less than `close` the frame is updated, not evaluated again;
    the error is of the order of close^2, and of close^3 in the gap. With `downhill`, as in a search, a start in a level
    valley is led to the valley's least gap; without, as in tracking, a pair of a continuum stays where it is.
    """
    f, g = surfaces
    flat = FLAT / size
    previous = 1e300
    status = NOT_CONVERGED
    level = False
    # Whether f moves along a continuum, because an end of g is in the way; and how many steps in a row the ends undid.
    by_other = False
    stills = 0
    iteration = 0
    while True:
        frame = pair_frame(store, f, g, pose, x)
        a, c, r = frame.shape_f, frame.shape_g, frame.residual
        matrix = pair_matrix(a, c, frame.gap, flat)
        isolated = matrix.isolated
        if not frame.regular:
            # An apex or a crease: there is no tangent plane to go on.
            break
        if downhill:
            inverse, levels = across_first(a, c, r, matrix.k, matrix.h, matrix.inverse, flat)
            matrix = PairMatrix(matrix.k, matrix.h, inverse, isolated)
            level = level or levels
        step_f, step_g, bend_f, bend_g = pair_step(a, c, r, matrix.k, matrix.inverse, size)
        if by_other and not isolated:
            step_f, step_g, bend_f, bend_g = step_of_other(a, c, matrix.k, matrix.h, step_f, step_g, size)
        ax, ay = step_f
        bx, by = step_g
        step = max(abs(ax) + abs(ay), abs(bx) + abs(by))
        bend = max(bend_f, bend_g)
        small = bend < close and isolated
        # Small against the scene and against the bodies' own curvature; or as small as rounding lets it become.
        if (step <= 4e-14 * size and bend < 1e-9) or stagnates(
            step, bend, previous, status, frame.point_f, frame.point_g, size
        ):
            # In a singular system a vanishing step is a solution only if the residual vanishes too.
            status = CONVERGED if isolated else (SINGULAR if vanishes(r, size) else NOT_CONVERGED)
            break
        ends = iteration >= (AROUND if level and status != LEFT_PATCH else LIMIT) or not step < 1e300 or bend > turn
        if not isolated and vanishes(r, size):
            # Along a level valley no point is better than another, so that steps need not shrink.
            if (ends or settled(c, r, size)) if downhill else iteration >= PATIENCE:
                status = SINGULAR
                break
        if ends:
            break
        previous = step
        # Each surface limits its own step: a sharply curved one does not shorten the step on a nearly flat one.
        factor_f = bent_at_most(bend_f)
        factor_g = bent_at_most(bend_g)
        step_f = (factor_f * ax, factor_f * ay)
        step_g = (factor_g * bx, factor_g * by)
        y, clamped, way = move_pair(store, f, g, pose.rotation, x, frame, step_f, step_g)
        status = NOT_CONVERGED
        if clamped:
            status = LEFT_PATCH
            still = abs(y[0] - x[0]) + abs(y[1] - x[1]) + abs(y[2] - x[2]) + abs(y[3] - x[3]) <= 1e-12 * way
            stills = stills + 1 if still else 0
            # An end holds the step and no parameter of either surface moves: the pair has left the patch.
            if stills == 2 or (still and isolated):
                break
            if not isolated:
                by_other = not by_other
                previous = 1e300
        elif small:
            frame = carried_along(frame, ax, ay, bx, by)
            x = y
            status = CONVERGED
            iteration += 1
            break
        x = y
        iteration += 1
    return PairSolution(status, x, iteration, frame, matrix)
