"""Newton's method for the nearest points of two patches, with the parameters kept in the unit cube; what these prove.

A curve given by a formula may take the place of the second patch (`distance/patches/formula_nodes.py`): it is evaluated
at its own parameter by interval arithmetic, and the widths of the intervals enter the proof. Otherwise `curve` is None,
and no kernel of formulas is compiled.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import damped_newton
from assembly.distance.curves.bounds import least_change
from assembly.distance.patches.formula_nodes import formula_derivatives
from assembly.distance.patches.nodes import ROWS, bezier_surface_at, plus
from assembly.distance.patches.pair import (
    BASIS,
    MARGIN,
    PATCH_J,
    PATCH_K,
    D,
    J,
    factorize,
    load_hessian,
    load_side,
    node_of,
    patch_work_at,
    size_at,
    vector_dot,
)
from assembly.geometry.splines.bezier_pieces import UNIT

# What a place in the unit cube proves: bounds of the distance, and its two points, whose distance is the upper one.
PatchPoints = namedtuple("PatchPoints", "lower upper on_a on_b")
PatchQuery = namedtuple("PatchQuery", "a b curve shift w")
PatchMerit = namedtuple("PatchMerit", "merit")
_STEPS = 30


@kernel(inner=True)
def fill_basis(w, at, n, x):
    """B_i^n and its first two derivatives at x, rows of n + 1 from `at`, by recurrence on the degree."""
    m = n + 1
    for i in range(3 * m):
        w[at + i] = 0.0
    w[at] = 1.0
    for k in range(1, n + 1):
        if k == n - 1:
            # B^(n - 2) is there: second differences.
            for i in range(m):
                c = w[at + i]
                l = w[at + i - 1] if i >= 1 else 0.0
                ll = w[at + i - 2] if i >= 2 else 0.0
                w[at + 2 * m + i] = n * (n - 1.0) * (ll - 2.0 * l + c)
        if k == n:
            for i in range(m):
                l = w[at + i - 1] if i >= 1 else 0.0
                w[at + m + i] = n * (l - w[at + i])
        for i in range(k, -1, -1):
            l = w[at + i - 1] if i >= 1 else 0.0
            w[at + i] = x * l + (1.0 - x) * w[at + i]


@kernel(inner=True)
def patch_derivatives(patch, x, y, w):
    """Point of a patch; its first and second derivatives at PATCH_J and PATCH_K."""
    work = patch_work_at(w, 0)
    surface = bezier_surface_at(patch.record, 0)
    nodes = patch.nodes
    p = surface.degree_u
    q = surface.degree_v
    bu = BASIS
    bv = BASIS + 3 * (p + 1)
    fill_basis(w, bu, p, x)
    fill_basis(w, bv, q, y)
    s = (0.0, 0.0, 0.0, 0.0)
    su = s
    sv = s
    suu = s
    suv = s
    svv = s
    r = patch.at + ROWS
    for i in range(p + 1):
        t = (0.0, 0.0, 0.0, 0.0)
        tv = t
        tvv = t
        for l in range(q + 1):
            row = (nodes[r], nodes[r + 1], nodes[r + 2], nodes[r + 3])
            r += 4
            t = plus(t, w[bv + l], row)
            tv = plus(tv, w[bv + q + 1 + l], row)
            tvv = plus(tvv, w[bv + 2 * q + 2 + l], row)
        b0 = w[bu + i]
        b1 = w[bu + p + 1 + i]
        b2 = w[bu + 2 * p + 2 + i]
        s = plus(s, b0, t)
        su = plus(su, b1, t)
        sv = plus(sv, b0, tv)
        suu = plus(suu, b2, t)
        suv = plus(suv, b1, tv)
        svv = plus(svv, b0, tvv)
    d = 1.0 / s[3]
    for c in range(3):
        v = d * s[c]
        vu = d * (su[c] - su[3] * v)
        vv = d * (sv[c] - sv[3] * v)
        work.patch_j[c] = vu
        work.patch_j[3 + c] = vv
        work.patch_k[c] = d * (suu[c] - 2.0 * su[3] * vu - suu[3] * v)
        work.patch_k[3 + c] = d * (suv[c] - su[3] * vv - sv[3] * vu - suv[3] * v)
        work.patch_k[6 + c] = d * (svv[c] - 2.0 * sv[3] * vv - svv[3] * v)
    return (d * s[0], d * s[1], d * s[2])


@kernel(inner=True)
def load_points(a, b, curve, shift, w):
    """D, J and K at PLACE in the unit cube; the two points."""
    work = patch_work_at(w, 0)
    na, nb = a.free, b.free
    u = patch_derivatives(a, work.place[0], work.place[1] if na > 1 else 0.0, w)
    load_side(w, PATCH_J, PATCH_K, 1.0, na, 0, w)
    x = work.place[na] if nb > 0 else 0.0
    if curve is None:
        v = patch_derivatives(b, x, work.place[na + 1] if nb > 1 else 0.0, w)
    else:
        v = formula_derivatives(curve, b.nodes, b.at, x, w)
    load_side(w, PATCH_J, PATCH_K, -1.0, nb, na, w)
    for j in range(3):
        work.d[j] = (u[j] - v[j]) - shift[j]
    return u, v


@kernel(inner=True)
def newton_direction(w, n):
    """Write Newton's step to STEP; a variable at an end that the slope would push it past stays there."""
    work = patch_work_at(w, 0)
    size = 0.0
    for i in range(n):
        size = max(size, abs(work.h[5 * i]))
    for i in range(n):
        z = work.place[i]
        if (z <= 0.0 and work.g[i] >= 0.0) or (z >= 1.0 and work.g[i] <= 0.0):
            work.g[i] = 0.0
            for j in range(n):
                work.h[4 * i + j] = 0.0
                work.h[4 * j + i] = 0.0
            work.h[5 * i] = size
        work.step[i] = 0.0
    raised = -1e-14 * size
    for _ in range(40):
        if factorize(w, n, False, raised):
            for i in range(n):
                value = -work.g[i]
                for j in range(i):
                    value -= work.factor[4 * i + j] * work.step[j]
                work.step[i] = value / work.factor[5 * i]
            for i in range(n - 1, -1, -1):
                value = work.step[i]
                for j in range(i + 1, n):
                    value -= work.factor[4 * j + i] * work.step[j]
                work.step[i] = value / work.factor[5 * i]
            return
        raised = min(10.0 * raised, -1e-6 * size)


@kernel(inline=True)
def _look(query, place):
    work = patch_work_at(query.w, 0)
    work.place[0], work.place[1], work.place[2], work.place[3] = place
    load_points(query.a, query.b, query.curve, query.shift, query.w)
    return PatchMerit(vector_dot(query.w, D, D))


@kernel(inline=True)
def _step_from(query, place, at):
    work = patch_work_at(query.w, 0)
    n = query.a.free + query.b.free
    load_hessian(query.w, n)
    newton_direction(query.w, n)
    fall = 0.0
    way = 0.0
    for i in range(n):
        fall += work.g[i] * work.step[i]
        way += abs(work.step[i])
    step = work.step
    return (step[0], step[1], step[2], step[3]), fall > -1e-17 * at.merit or way < 1e-16


@kernel(inline=True)
def _moved(x, step):
    return min(max(x + step, 0.0), 1.0)


@kernel(inline=True)
def _move(query, x, part, step):
    return (
        _moved(x[0], part * step[0]),
        _moved(x[1], part * step[1]),
        _moved(x[2], part * step[2]),
        _moved(x[3], part * step[3]),
    )


_descend = kernel(inner=True)(damped_newton(_look, _step_from, _move, steps=_STEPS))


@kernel(inner=True)
def nearest_in_patches(a, b, curve, shift, w):
    """From PLACE to a local minimum in the unit cube."""
    work = patch_work_at(w, 0)
    for i in range(a.free + b.free, 4):
        work.place[i] = work.step[i] = 0.0
    start = (work.place[0], work.place[1], work.place[2], work.place[3])
    place, _at, _last = _descend(PatchQuery(a, b, curve, shift, w), start)
    work.place[0], work.place[1], work.place[2], work.place[3] = place


@kernel(inner=True, exact=True)
def proven_in_patches(a, b, curve, shift, errors, curved, w):
    """Lower bound of the distance on a box, the distance at PLACE, and the points there.

    `errors`: how far points and derivatives may be off. `curved`: the Hessian is proven to be at least MARGIN times the
    diagonal that Z holds.
    """
    work = patch_work_at(w, 0)
    u, v = load_points(a, b, curve, shift, w)
    error, rough = errors
    if curve is not None:
        error += work.off[0]
    far = size_at(w, D)
    size = 16.0 * UNIT * far
    change = 0.0
    if curved:
        for i in range(a.free + b.free):
            off = rough
            back = work.place[i]
            ahead = 1.0 - back
            if curve is not None and i == a.free:
                off += work.off[1]
                back = work.off[2]
                ahead = work.off[3]
            doubt = (error + size) * (size_at(w, J + 3 * i) + off) + far * off
            change += least_change(vector_dot(w, D, J + 3 * i), doubt, MARGIN * work.z[i], back, ahead)
    near = max(far - size - error, 0.0)
    square = near * near + 2.0 * change * (1.0 + 1e-12)
    lower = math.sqrt(square) * (1.0 - 8.0 * UNIT) if square > 0.0 else 0.0
    away = node_of(a).away + node_of(b).away
    return PatchPoints(lower - away, far + size + error + away, u, v)
