"""The switching closest-point controllers of paper 000: witness points that run down to the closest ones.

With D = f - h, h a point or a point of another patch, the projections psi_i = D.f_i (and psi_r = -D.h_r there) drive

    u' = -K B psi,      d|D|/dt = -K psi.B psi / |D|,

    unit: B = diag(1/|f_u|, 1/|f_v|),    covariant: B = 1,    contravariant: B = I^-1,  I the first fundamental form.

A component that would leave the patch is set to zero, the other is then that of the curve at the end (psi_v B_vv, or
psi_v / G), and after a step parameters are clamped: `docs/controllers.md` says where the printed laws differ. With
feed-forward the motion's part of the closest point's rate, H^-1 f_i.q, is added, q the velocity of h seen from f and H
the second derivative of |D|^2 / 2.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import (
    surface_at,
    surface_point,
)
from assembly.geometry.vec import add, dot, matvec, matvec_t, sub
from assembly.proximity.extrema.feedback import descent_step, end_of

# The record of the surface that is controlled.
F = 0
# Forms of the projections.
UNIT_FORM, COVARIANT_FORM, CONTRAVARIANT_FORM = 0, 1, 2
# The record of a step.
STEP_ROW = record_dtype(
    "f8",
    parameters=4,  # (u_f, v_f, u_g, v_g) where it begins
    distance=1,  # of the witness points [length]
    error=1,  # norm of the projections on unit tangents, those that are held left out [length]
    mode_f=1,  # how many parameters of f are held at ends
    mode_g=1,
    gain=1,
)
step_row_at = record_view(STEP_ROW)
ROW = size_of(STEP_ROW)
DISTANCE = place_of(STEP_ROW, "distance")
ERROR = place_of(STEP_ROW, "error")
MODE_F = place_of(STEP_ROW, "mode_f")
MODE_G = place_of(STEP_ROW, "mode_g")
GAIN = place_of(STEP_ROW, "gain")
# How a controller moves.
ControlLaw = namedtuple(
    "ControlLaw",
    [
        "form",  # of the projections: UNIT_FORM, COVARIANT_FORM or CONTRAVARIANT_FORM
        "gain",  # 0: as large as the step allows
        "rate",  # exponential rate of the distance [1 / time]; 0: none
        "nearest",  # the distance that the rate leads to [length]
        "feed_forward",  # 1: the motion's part of the closest point's rate is added
    ],
)
# Where the target stands, seen from f, and how it moves.
Target = namedtuple(
    "Target",
    [
        "turn",  # rotation of the target's body
        "shift",  # its origin; of a point, the point
        "drift_f",  # velocity of the other witness point seen from f, in its axes
        "drift_g",  # the same seen from g
    ],
)
# What a law computes from a state.
ControlStep = namedtuple("ControlStep", ["rates", "distance", "error", "mode_f", "mode_g", "gain"])


@kernel(inline=True)
def law_weights(form, su, sv):
    """B (11, 12, 22) of a form; zero where a tangent vanishes, as at a pole."""
    e = dot(su, su)
    f = dot(su, sv)
    g = dot(sv, sv)
    if form == COVARIANT_FORM:
        return (1.0, 0.0, 1.0)
    det = e * g - f * f
    if form == UNIT_FORM or not det > 1e-18 * e * g:
        return (1.0 / math.sqrt(e) if e > 0.0 else 0.0, 0.0, 1.0 / math.sqrt(g) if g > 0.0 else 0.0)
    return (g / det, -f / det, e / det)


@kernel(inline=True)
def saturate(end_u, end_v, psi, b, su, sv, form):
    """-B psi with the components that leave the patch set to zero; whether u and v are held.

    `end_u` is -1 or 1 at the low or high end.
    """
    ru = -(b[0] * psi[0] + b[1] * psi[1])
    rv = -(b[1] * psi[0] + b[2] * psi[1])
    held_u = end_u * ru > 0.0
    held_v = end_v * rv > 0.0
    if held_u and held_v:
        # A skewed B may lead both parameters out where only one slope does: the slopes decide which one is held.
        held_u = end_u * psi[0] < 0.0
        held_v = end_v * psi[1] < 0.0
    if held_u and not held_v:
        rv = -psi[1] * (1.0 / dot(sv, sv) if form == CONTRAVARIANT_FORM else b[2])
        held_v = end_v * rv > 0.0
    elif held_v and not held_u:
        ru = -psi[0] * (1.0 / dot(su, su) if form == CONTRAVARIANT_FORM else b[0])
        held_u = end_u * ru > 0.0
    return 0.0 if held_u else ru, 0.0 if held_v else rv, held_u, held_v


@kernel(inline=True)
def second_form(s, d):
    """f_i.f_j + d.f_ij (11, 12, 22) of a surface point s as `surface_point` gives it."""
    return (
        dot(s[1], s[1]) + dot(d, s[3]),
        dot(s[1], s[2]) + dot(d, s[4]),
        dot(s[2], s[2]) + dot(d, s[5]),
    )


@kernel(inline=True)
def largest_eigenvalue(h, b, held_u, held_v):
    """The largest absolute eigenvalue of B H over the parameters that are not held."""
    if held_u and held_v:
        return 0.0
    if held_u:
        return abs(b[2] * h[2])
    if held_v:
        return abs(b[0] * h[0])
    trace = b[0] * h[0] + 2.0 * b[1] * h[1] + b[2] * h[2]
    det = (b[0] * b[2] - b[1] * b[1]) * (h[0] * h[2] - h[1] * h[1])
    return 0.5 * (abs(trace) + math.sqrt(max(trace * trace - 4.0 * det, 0.0)))


@kernel(inline=True)
def ends(store, r, u, v):
    patch = surface_at(store.table, r)
    return (
        end_of(store.pool, patch.breaks_u, patch.spans_u, patch.closed_u, 0, 0, u),
        end_of(store.pool, patch.breaks_v, patch.spans_v, patch.closed_v, 0, 0, v),
    )


@kernel(inline=True)
def free_error(psi, su, sv, held_u, held_v):
    """Sum of squares of the projections on unit tangents, those that are held left out."""
    a = dot(su, su)
    b = dot(sv, sv)
    square = 0.0
    if not held_u and a > 0.0:
        square += psi[0] * psi[0] / a
    if not held_v and b > 0.0:
        square += psi[1] * psi[1] / b
    return square


@kernel(inline=True)
def without_held(h, held_u, held_v):
    """A second form without the parameters that are held: one in their places."""
    return (
        1.0 if held_u else h[0],
        0.0 if held_u or held_v else h[1],
        1.0 if held_v else h[2],
    )


@kernel(inner=True)
def control_rates(store, g, placed, x, law, dt):
    """The `ControlStep` of a `ControlLaw` at x for a `Target`; with g < 0 the target is the point `placed.shift`."""
    turn, shift, form = placed.turn, placed.shift, law.form
    s = surface_point(store.table, store.pool, F, x[0], x[1])
    t = s
    target = shift
    if g >= 0:
        t = surface_point(store.table, store.pool, g, x[2], x[3])
        target = add(matvec(turn, t[0]), shift)
    d = sub(s[0], target)
    square = dot(d, d)
    distance = math.sqrt(square)
    psi = (dot(d, s[1]), dot(d, s[2]))
    b = law_weights(form, s[1], s[2])
    end_u, end_v = ends(store, F, x[0], x[1])
    ru, rv, held_u, held_v = saturate(end_u, end_v, psi, b, s[1], s[2], form)
    h = second_form(s, d)
    power = -(psi[0] * ru + psi[1] * rv)
    error = free_error(psi, s[1], s[2], held_u, held_v)
    zero = (0.0, 0.0, 0.0)
    # Where the curvature term of D cancels the metric in H, H does not limit larger steps: then B I bounds the gain.
    metric_f = largest_eigenvalue(second_form(s, zero), b, held_u, held_v)
    top = max(largest_eigenvalue(h, b, held_u, held_v), metric_f)
    rr = 0.0
    rs = 0.0
    held_r = False
    held_s = False
    p = (0.0, 0.0, 0.0, 0.0)
    k = (1.0, 0.0, 1.0)
    if g >= 0:
        dg = matvec_t(turn, d)
        chi = (-dot(dg, t[1]), -dot(dg, t[2]))
        c = law_weights(form, t[1], t[2])
        end_u, end_v = ends(store, g, x[2], x[3])
        rr, rs, held_r, held_s = saturate(end_u, end_v, chi, c, t[1], t[2], form)
        k = second_form(t, (-dg[0], -dg[1], -dg[2]))
        power -= chi[0] * rr + chi[1] * rs
        error += free_error(chi, t[1], t[2], held_r, held_s)
        # A bound for both together: the couplings -f_i.h_j add at most the mean of those of B I.
        metric_g = largest_eigenvalue(second_form(t, zero), c, held_r, held_s)
        top = max(top, largest_eigenvalue(k, c, held_r, held_s), metric_g) + math.sqrt(metric_f * metric_g)
    limit = 1.0 / (dt * top) if top > 0.0 else 0.0
    gain = law.gain if law.gain > 0.0 else limit
    if law.rate > 0.0:
        wanted = law.rate * max(distance - law.nearest, 0.0) * distance
        gain = wanted / power if wanted < limit * power else limit
    mode_f = int(held_u) + int(held_v)
    mode_g = int(held_r) + int(held_s)
    rates = (gain * ru, gain * rv, gain * rr, gain * rs)
    if law.feed_forward > 0.0:
        bf = (0.0 if held_u else -dot(s[1], placed.drift_f), 0.0 if held_v else -dot(s[2], placed.drift_f))
        bg = (0.0, 0.0)
        if g >= 0:
            bg = (0.0 if held_r else -dot(t[1], placed.drift_g), 0.0 if held_s else -dot(t[2], placed.drift_g))
            fu = matvec_t(turn, s[1])
            fv = matvec_t(turn, s[2])
            p = (
                0.0 if held_u or held_r else -dot(fu, t[1]),
                0.0 if held_u or held_s else -dot(fu, t[2]),
                0.0 if held_v or held_r else -dot(fv, t[1]),
                0.0 if held_v or held_s else -dot(fv, t[2]),
            )
        add_f, add_g, definite = descent_step(
            without_held(h, held_u, held_v), p, without_held(k, held_r, held_s), bf, bg, 0.0
        )
        if definite:
            rates = (rates[0] + add_f[0], rates[1] + add_f[1], rates[2] + add_g[0], rates[3] + add_g[1])
    return ControlStep(rates, distance, math.sqrt(error), mode_f, mode_g, gain)
