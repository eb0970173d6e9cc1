"""Runs of the switching closest-point controllers (`laws.py`): along poses of the target, and from many starts."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import (
    surface_point,
)
from assembly.geometry.vec import add, dot, matvec, matvec_t, scale, sub
from assembly.kinematics.motion import IDENTITY, RelativePose, relative_pose, rotation
from assembly.proximity.controllers.laws import (
    UNIT_FORM,
    ControlLaw,
    F,
    Target,
    control_rates,
    ends,
    free_error,
    second_form,
    step_row_at,
)

# Statuses of a run.
CLOSEST, ON_ITS_WAY, MEETING, IRREGULAR = 0, 1, 2, 3


# When a run ends.
ControlEnd = namedtuple(
    "ControlEnd",
    [
        "steps",  # at most
        "tolerance",  # once the target is at rest, at an error of at most so much [length]
        "meet",  # at a distance of at most so much the points meet [length]
    ],
)


# A step without a given gain is halved at most so often.
HALVINGS = 30


# How region-of-attraction runs move.
NEWTON, NEWTON_SATURATED, SWITCHING = 0, 1, 2


@kernel(inline=True)
def moved(store, g, x, rates, dt):
    """Parameters after an Euler step, wrapped and clamped."""
    uf, vf, _end = into_domain(store, F, x[0] + dt * rates[0], x[1] + dt * rates[1])
    ug, vg = x[2], x[3]
    if g >= 0:
        ug, vg, _end = into_domain(store, g, x[2] + dt * rates[2], x[3] + dt * rates[3])
    return (uf, vf, ug, vg)


@kernel(inner=True)
def lowering(store, g, pose, x, step, dt):
    """Parameters after a step that does not increase the distance: the whole step, or its first such halving."""
    y = x
    for _ in range(HALVINGS):
        y = moved(store, g, x, step.rates, dt)
        target = pose.shift
        if g >= 0:
            target = add(matvec(pose.rotation, surface_point(store.table, store.pool, g, y[2], y[3]).point), pose.shift)
        p = surface_point(store.table, store.pool, F, y[0], y[1]).point
        d = sub(p, target)
        # At rest distances differ by the rounding of the points.
        rounding = 1e-14 * (math.sqrt(dot(p, p)) + math.sqrt(dot(target, target)))
        if dot(d, d) <= step.distance * (step.distance + rounding):
            return y
        dt *= 0.5
    return y


@kernel(inline=True)
def target_pose(poses, k, g, point):
    """The pose of the target seen from f at the poses of step k; for a point, the shift is its position."""
    k = min(k, poses.shape[0] - 1)
    pose = relative_pose(poses[k], 0, rotation(poses[k], 0), 1, rotation(poses[k], 1))
    if g < 0:
        return RelativePose(pose.rotation, add(matvec(pose.rotation, point), pose.shift))
    return pose


@kernel(inline=True)
def posed_target(store, g, pose, after, x, dt):
    """The `Target` at a pose, moving to another one in a time dt."""
    i = 1.0 / dt
    drift_g = (0.0, 0.0, 0.0)
    was, comes = pose.shift, after.shift
    if g >= 0:
        here = surface_point(store.table, store.pool, F, x[0], x[1]).point
        there = surface_point(store.table, store.pool, g, x[2], x[3]).point
        before = matvec_t(pose.rotation, sub(here, pose.shift))
        drift_g = scale(i, sub(matvec_t(after.rotation, sub(here, after.shift)), before))
        was = add(matvec(pose.rotation, there), pose.shift)
        comes = add(matvec(after.rotation, there), after.shift)
    return Target(pose.rotation, pose.shift, scale(i, sub(comes, was)), drift_g)


@kernel(inline=True)
def write_row(out, row, x, step):
    """Row `row` of `out`: the parameters x where a step begins, and the step."""
    written = step_row_at(out, row)
    for k in range(4):
        written.parameters[k] = x[k]
    written.distance = step.distance
    written.error = step.error
    written.mode_f = step.mode_f
    written.mode_g = step.mode_g
    written.gain = step.gain


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), Tuple((i8, UniTuple(f8, 3))), f8[:, :, ::1], UniTuple(f8, 4), f8, "
        "Tuple((i8, f8, f8, f8, f8)), Tuple((i8, f8, f8)), f8[:, ::1])"
    ),
)
def run_control(store, target, poses, x, dt, law, end, out):
    """Euler steps of the controller from x, along poses (n, 2, 7), the last of which stays: status and steps.

    `target` is the record of its surface, or -1, and the point that it is then; `law` and `end` are the numbers of a
    `ControlLaw` and a `ControlEnd`. Row k of `out` is the state after k steps; a single row gets the last state.
    """
    table, pool = store
    scene = Store(table, pool)
    g, point = target
    law = ControlLaw(law[0], law[1], law[2], law[3], law[4])
    steps, tolerance, meet = end
    pose = target_pose(poses, 0, g, point)
    last = out.shape[0] - 1
    zero = (0.0, 0.0, 0.0)
    for k in range(steps + 1):
        still = k >= poses.shape[0] - 1
        after = pose
        placed = Target(pose.rotation, pose.shift, zero, zero)
        if not still:
            after = target_pose(poses, k + 1, g, point)
            placed = posed_target(scene, g, pose, after, x, dt)
        step = control_rates(scene, g, placed, x, law, dt)
        if not step.distance < 1e300:
            return IRREGULAR, max(k - 1, 0)
        write_row(out, min(k, last), x, step)
        if step.distance <= meet:
            return MEETING, k
        if still and step.error <= tolerance:
            # Where patches cross the error is of the distance itself.
            return CLOSEST if step.distance > 10.0 * tolerance else MEETING, k
        if k == steps:
            break
        if still and law.gain == 0.0:
            x = lowering(scene, g, pose, x, step, dt)
        else:
            x = moved(scene, g, x, step.rates, dt)
        pose = after
    return ON_ITS_WAY, steps


@kernel(inner=True)
def newton_change(s, d, form):
    """Newton's step to zeros of psi: of D.f_i (covariant), or of D.f_i / |f_i| (unit); zero where that is singular."""
    psi = (dot(d, s[1]), dot(d, s[2]))
    h = second_form(s, d)
    m11, m12, m21, m22 = h[0], h[1], h[1], h[2]
    if form == UNIT_FORM:
        # Rows of the derivative of psi_i / |f_i|, times |f_i|.
        e = psi[0] / dot(s[1], s[1])
        g = psi[1] / dot(s[2], s[2])
        m11 -= e * dot(s[1], s[3])
        m12 -= e * dot(s[1], s[4])
        m21 -= g * dot(s[2], s[4])
        m22 -= g * dot(s[2], s[5])
    det = m11 * m22 - m12 * m21
    du = -(m22 * psi[0] - m12 * psi[1]) / det
    dv = -(m11 * psi[1] - m21 * psi[0]) / det
    if not (abs(du) < 1e300 and abs(dv) < 1e300):
        return 0.0, 0.0
    return du, dv


@kernel(
    signatures="(Tuple((i8[::1], f8[::1])), UniTuple(f8, 3), f8[:, ::1], i8, i8, i8, f8, f8[:, ::1])",
)
def attraction(store, point, starts, method, form, limit, tolerance, out):
    """Where a witness point ends from every start (n, 2): out (n, 3) of parameters and error; how many ended.

    Newton's method without saturation fails where it leaves the patch; with it, components that lead out are set to
    zero and the rest is clamped. The switching controller takes the gain that its eigenvalues allow.
    """
    table, pool = store
    scene = Store(table, pool)
    law = ControlLaw(form, 0.0, 0.0, 0.0, 0.0)
    zero = (0.0, 0.0, 0.0)
    placed = Target(IDENTITY.rotation, point, zero, zero)
    ended = 0
    for i in range(starts.shape[0]):
        x = (starts[i, 0], starts[i, 1], 0.0, 0.0)
        error = math.inf
        for _ in range(limit):
            if method == SWITCHING:
                step = control_rates(scene, -1, placed, x, law, 1.0)
                error = step.error
                y = lowering(scene, -1, RelativePose(IDENTITY.rotation, point), x, step, 1.0)
                clamped = False
            else:
                s = surface_point(table, pool, F, x[0], x[1])
                d = sub(s[0], point)
                du, dv = newton_change(s, d, form)
                held_u = False
                held_v = False
                if method == NEWTON_SATURATED:
                    end_u, end_v = ends(scene, F, x[0], x[1])
                    held_u = end_u * du > 0.0
                    held_v = end_v * dv > 0.0
                    du = 0.0 if held_u else du
                    dv = 0.0 if held_v else dv
                error = math.sqrt(free_error((dot(d, s[1]), dot(d, s[2])), s[1], s[2], held_u, held_v))
                u, v, clamped = into_domain(scene, F, x[0] + du, x[1] + dv)
                y = (u, v, 0.0, 0.0)
            if error <= tolerance:
                ended += 1
                break
            if clamped and method == NEWTON:
                error = math.inf
                break
            x = y
        out[i, 0], out[i, 1] = x[0], x[1]
        out[i, 2] = min(error, 1e300)
    return ended
