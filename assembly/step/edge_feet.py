"""Projections of points of an edge onto its surface, and points moved to where two surfaces cross: for `projected`.

Each point is computed alone: its result does not depend on the other points of the same call.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import into_domain, surface_at, surface_lanes, xyz
from assembly.geometry.vec import add, blend, cross, dot, scale, sub

# Most steps of a projection, and the length of a step, relative to the domain or the size, that is only rounding.
_STEPS, _LAST = 30, 1e-13
# Distance from a pole, over the size, within which nothing has a direction from it.
AT_POLE = 1e-9
# A projection is lost if it takes a step longer than this part of the side of the domain.
_LOST = 0.25
# At this sine of the angle between two surfaces a point is moved two thirds of the way to their intersection; from 2.5
# times as much on, all of the way. No edge is moved by more than some 7 times what it is off.
_CROSSING = 0.1
# A part of the way as small as this counts as none.
_TANGENT = 1e-9
# Least eigenvalue, relative, with which an intersection is solved for; the surfaces of smaller ones count as tangent.
_DAMPED = 1e-6

# A surface: its table and pool as in `NurbsSurface`, and its size [length].
Ground = namedtuple("Ground", "table pool size")
# Gauss-Newton's step toward a point's projection, how far above the surface the point is, the unit normal there, and
# the lengths of Su and Sv.
_Approach = namedtuple("_Approach", "du dv height normal along_u along_v")


@kernel(inline=True)
def _ends(ground):
    """Ends of the domain: (u0, u1), (v0, v1)."""
    patch = surface_at(ground.table, 0)
    pool = ground.pool
    return (pool[patch.breaks_u], pool[patch.breaks_u + patch.spans_u]), (
        pool[patch.breaks_v],
        pool[patch.breaks_v + patch.spans_v],
    )


@kernel(inline=True)
def _inside(ground, u, v):
    """Parameters for evaluation; those beyond an open domain count as its end."""
    patch = surface_at(ground.table, 0)
    (u0, u1), (v0, v1) = _ends(ground)
    if patch.closed_u == 0:
        u = min(max(u, u0), u1)
    if patch.closed_v == 0:
        v = min(max(v, v0), v1)
    u, _fits = into_domain(ground.pool, patch.breaks_u, patch.spans_u, patch.closed_u, u)
    v, _fits = into_domain(ground.pool, patch.breaks_v, patch.spans_v, patch.closed_v, v)
    return u, v


@kernel(inner=True)
def _approach(ground, u, v, point):
    """The _Approach of a point from parameters, which count as the end where they are beyond an open one."""
    (u0, u1), (v0, v1) = _ends(ground)
    u, v = _inside(ground, u, v)
    jet = surface_lanes(Store(ground.table, ground.pool), 0, u, v)
    su, sv = xyz(jet.u), xyz(jet.v)
    off = sub(point, xyz(jet.point))
    a, b, c = dot(su, su), dot(su, sv), dot(sv, sv)
    f, g = dot(su, off), dot(sv, off)
    both, product = a * c - b * b, a * c
    du, dv = 0.0, 0.0
    if both > 1e-12 * product:
        du, dv = (c * f - b * g) / both, (a * g - b * f) / both
    else:
        # Where a parameter has no direction, at poles, it stays.
        if np.sqrt(a) * (u1 - u0) > AT_POLE * ground.size:
            du = f / a
        if np.sqrt(c) * (v1 - v0) > AT_POLE * ground.size:
            dv = g / c
    normal = cross(su, sv)
    normal = scale(1.0 / max(np.sqrt(dot(normal, normal)), 1e-300), normal)
    return _Approach(du, dv, dot(normal, off), normal, np.sqrt(a), np.sqrt(c))


@kernel(inline=True)
def _by_pole(gap, around, along, turn, rise, least):
    """A step beside a pole: how far around it and how far away from it, in parameters.

    The surface counts as flat there: the step is a straight line in polar coordinates about the pole, so that one that
    passes it goes round it. One that begins or ends at the pole does not turn.

    Parameters
    ----------
    gap
        How far away the pole is in its parameter.
    around, along
        Lengths of the derivatives by the parameter around it and by the one that leads away.
    turn, rise
        Gauss-Newton's step in these.
    least
        What is nearer is at the pole.
    """
    far = gap * along
    out, aside = far + rise * along, turn * around
    beyond = np.hypot(out, aside)
    if not (far > 0.0 and around > 0.0 and beyond > least):
        return 0.0, rise
    return np.arctan2(aside, out) * far / around, (beyond - far) / along


@kernel(inline=True)
def _moved(ground, u, v, step):
    """Parameters after a step, within an open domain."""
    patch = surface_at(ground.table, 0)
    (u0, u1), (v0, v1) = _ends(ground)
    du, dv = step.du, step.dv
    # The pole at the nearer end.
    if patch.poles & 12 != 0:
        is_low = patch.poles & 12 == 4 or (patch.poles & 4 != 0 and v - v0 < v1 - v)
        gap, sense = (v - v0, 1.0) if is_low else (v1 - v, -1.0)
        du, dv = _by_pole(gap, step.along_u, step.along_v, du, sense * dv, AT_POLE * ground.size)
        dv *= sense
    elif patch.poles & 3 != 0:
        is_low = patch.poles & 3 == 1 or (patch.poles & 1 != 0 and u - u0 < u1 - u)
        gap, sense = (u - u0, 1.0) if is_low else (u1 - u, -1.0)
        dv, du = _by_pole(gap, step.along_v, step.along_u, dv, sense * du, AT_POLE * ground.size)
        du *= sense
    u += du
    v += dv
    if patch.closed_u == 0:
        u = min(max(u, u0), u1)
    if patch.closed_v == 0:
        v = min(max(v, v0), v1)
    return u, v


@kernel(inner=True)
def _foot(ground, u, v, point):
    """Parameters of the nearest point on the surface, and whether the steps converged."""
    (u0, u1), (v0, v1) = _ends(ground)
    side_u, side_v = u1 - u0, v1 - v0
    far, before = np.inf, np.inf
    for _ in range(_STEPS):
        step = _approach(ground, u, v, point)
        new_u, new_v = _moved(ground, u, v, step)
        part_u, part_v = abs(new_u - u) / side_u, abs(new_v - v) / side_v
        if surface_at(ground.table, 0).poles != 0:
            # A turn around a pole is as short as it is in space.
            part_u *= min(1.0, step.along_u * side_u / ground.size)
            part_v *= min(1.0, step.along_v * side_v / ground.size)
        far = max(part_u, part_v)
        u, v = new_u, new_v
        # The last steps are rounding, whatever the coordinates are.
        if far <= _LAST or not far <= _LOST or (far <= 1e3 * _LAST and far >= 0.5 * before):
            break
        before = far
    return u, v, far <= 1e3 * _LAST


@kernel(inner=True)
def _between(own, there, point, places):
    """The point moved onto both surfaces, from parameters on each; all of the way only where they clearly cross."""
    u, v, s, t = places
    found = point
    share = 0.0
    last = _LAST * (own.size + max(abs(point[0]), abs(point[1]), abs(point[2])))
    for count in range(_STEPS):
        here, other = _approach(own, u, v, found), _approach(there, s, t, found)
        u, v = _moved(own, u, v, here)
        s, t = _moved(there, s, t, other)
        cosine = dot(here.normal, other.normal)
        if count < 2:
            # Projections of the edge itself, by one step.
            turn = cross(here.normal, other.normal)
            share = -np.expm1(-((dot(turn, turn) / _CROSSING**2) ** 2))
            if count == 0:
                continue
            if share <= _TANGENT:
                return point
        middle = (here.height + other.height) / (2.0 + 2.0 * cosine + _DAMPED)
        gap = (here.height - other.height) / (2.0 - 2.0 * cosine + _DAMPED)
        back = blend(middle, add(here.normal, other.normal), gap, sub(here.normal, other.normal))
        found = sub(found, back)
        if share * np.sqrt(dot(back, back)) <= last:
            break
    return blend(1.0 - share, point, share, found)


@kernel(signatures="(Tuple((i8[::1], f8[::1], f8)), f8[:, ::1], f8[:, ::1])")
def move_to_feet(surface, points, places):
    """Move parameters, one row per point, to the nearest points of a surface; False if steps do not converge."""
    ground = Ground(surface[0], surface[1], surface[2])
    for k in range(points.shape[0]):
        u, v, ends = _foot(ground, places[k, 0], places[k, 1], (points[k, 0], points[k, 1], points[k, 2]))
        if not ends:
            return False
        places[k, 0], places[k, 1] = u, v
    return True


@kernel(signatures="(Tuple((i8[::1], f8[::1], f8)), Tuple((i8[::1], f8[::1], f8)), f8[:, ::1], f8[:, ::1])")
def move_between(surface, beyond, points, places):
    """Move points to where two surfaces cross; points stay where the surfaces are tangent.

    Parameters
    ----------
    surface, beyond
        Each as table, pool and size.
    points : (n, 3)
        Changed in place.
    places : (n, 4)
        Parameters of both surfaces near each point.
    """
    own = Ground(surface[0], surface[1], surface[2])
    there = Ground(beyond[0], beyond[1], beyond[2])
    for k in range(points.shape[0]):
        at = (places[k, 0], places[k, 1], places[k, 2], places[k, 3])
        x, y, z = _between(own, there, (points[k, 0], points[k, 1], points[k, 2]), at)
        points[k, 0], points[k, 1], points[k, 2] = x, y, z


@kernel(signatures="(Tuple((i8[::1], f8[::1], f8)), f8[:, ::1], f8[:, ::1])")
def fill_surface_points(surface, places, out):
    """Points (n, 3) of a surface at parameters (n, 2), which count as the end where they are beyond it."""
    ground = Ground(surface[0], surface[1], surface[2])
    for k in range(places.shape[0]):
        u, v = _inside(ground, places[k, 0], places[k, 1])
        x, y, z = xyz(surface_lanes(Store(ground.table, ground.pool), 0, u, v).point)
        out[k, 0], out[k, 1], out[k, 2] = x, y, z


@kernel(signatures="(Tuple((i8[::1], f8[::1], f8)), f8[::1], f8[:, ::1], f8[:, ::1])")
def distance_across(surface, t, given, there):
    """How far points of a surface are from those of a curve on it, across the curve, at most.

    Parameters
    ----------
    surface
        Table, pool and size.
    t : (n,)
        Parameters of the curve, rising.
    given, there : (n, 2)
        Parameters of the surface on the curve, and of the other points.
    """
    ground = Ground(surface[0], surface[1], surface[2])
    n = t.size
    worst = 0.0
    for k in range(n):
        # Derivatives of the curve from differences, of second order inside.
        a, b = max(k - 1, 0), min(k + 1, n - 1)
        left, right = t[k] - t[a], t[b] - t[k]
        slope_u, slope_v = 0.0, 0.0
        if left > 0.0:
            weight = right / (left + right) if right > 0.0 else 1.0
            slope_u += weight * (given[k, 0] - given[a, 0]) / left
            slope_v += weight * (given[k, 1] - given[a, 1]) / left
        if right > 0.0:
            weight = left / (left + right) if left > 0.0 else 1.0
            slope_u += weight * (given[b, 0] - given[k, 0]) / right
            slope_v += weight * (given[b, 1] - given[k, 1]) / right
        u, v = _inside(ground, given[k, 0], given[k, 1])
        jet = surface_lanes(Store(ground.table, ground.pool), 0, u, v)
        su, sv = xyz(jet.u), xyz(jet.v)
        off = blend(there[k, 0] - given[k, 0], su, there[k, 1] - given[k, 1], sv)
        along = blend(slope_u, su, slope_v, sv)
        along = scale(1.0 / max(np.sqrt(dot(along, along)), 1e-300), along)
        off = sub(off, scale(dot(off, along), along))
        worst = max(worst, np.sqrt(dot(off, off)))
    return worst
