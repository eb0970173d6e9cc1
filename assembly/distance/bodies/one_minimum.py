"""Pairs of nodes on which Phi (`pair.py`) is proven to have one minimum, and the bound that this gives.

V bounds how much the Hessian of Phi changes on the pair. Where the slope in a variable keeps its sign, Phi is least at
an end of that variable's range, whatever the others are: the variable is held there. The proof is that in the other
variables the Hessian, scaled to a unit diagonal, less the largest row sum of V and a margin m, is positive definite.
Then from any place x

    Phi >= Phi(x) + sum of the least g_i d + m H_ii d^2 / 2.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.distance.bodies.descent import body_search_at, load_places
from assembly.distance.bodies.nodes import links_of, node_of
from assembly.distance.bodies.pair import (
    STIFFER,
    doubt_of_points,
    flat_bend_sum,
    flat_dot,
    flat_size,
    load_quadratic,
    load_tense,
    pair_work_at,
    sweep,
    tension_at_most,
)
from assembly.distance.curves.bounds import least_change
from assembly.distance.patches.pair import patch_work_at
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import dot

# The margin. If it is smaller, more pairs are proven to have one minimum, but fewer of these are discarded by the bound
# that follows. After _HALVINGS of both nodes surfaces nearly conform, and only a small margin is possible.
_MARGIN, _LEAST_MARGIN, _HALVINGS = 0.05, 1e-4, 27
_STEPS = 3
_GROW = 1.0 + 1e-12


@kernel(inline=True)
def change_of_bends(pair, i, m):
    """sum_l |PJ_i.PK_ml + PJ_m.PK_il + PJ_l.PK_im| / 2, terms of two surfaces left out."""
    j, k = pair.j, pair.k
    same = i // 2 == m // 2
    of_i, of_m = 3 * (i // 2) + i % 2, 3 * (m // 2) + m % 2
    total = 0.0
    for l in range(4):
        turn = 0.0
        if l // 2 == m // 2:
            turn += flat_dot(j, i, k, of_m + l % 2)
        if l // 2 == i // 2:
            turn += flat_dot(j, m, k, of_i + l % 2)
        if same:
            turn += flat_dot(j, l, k, of_i + m % 2)
        total += 0.5 * abs(turn)
    return total


@kernel(inline=True)
def load_change(pair, a, i, b, j, tension):
    """How much the Hessian of Phi may change from the middle to anywhere on the pair; needs `load_quadratic`.

        V_im = [E2_im] + 2 t (sum_l |PJ_i.PK_ml + PJ_m.PK_il + PJ_l.PK_im| / 2 + k_i k_m + |PK_im| sum_lm |PK_lm| / 8
               + E1 (j_i + j_m + E1) + E0 |PK_im| + E2 max |PD|),    k_i = sum_l |PK_il| / 2,  j_i = |PJ_i| + k_i;

    terms in brackets only where i and m are of one surface.
    """
    k, d = pair.k, pair.d
    node_a, node_b = node_of(a, i), node_of(b, j)
    total = flat_bend_sum(pair, 0) + flat_bend_sum(pair, 1)
    e0 = doubt_of_points(a, i, b, j)
    far = math.sqrt(d[0] * d[0] + d[1] * d[1]) + 0.125 * total + e0
    for n in range(4):
        o = 3 * (n // 2) + n % 2
        pair.row[n] = 0.5 * (flat_size(k, o) + flat_size(k, o + 1))
        far += 0.5 * flat_size(pair.j, n)
    for n in range(4):
        e1 = node_a.slope_doubt if n < 2 else node_b.slope_doubt
        e2 = node_a.bend_doubt if n < 2 else node_b.bend_doubt
        jn = flat_size(pair.j, n) + pair.row[n]
        for m in range(n + 1):
            f1 = node_a.slope_doubt if m < 2 else node_b.slope_doubt
            jm = flat_size(pair.j, m) + pair.row[m]
            v = change_of_bends(pair, n, m)
            v += pair.row[n] * pair.row[m] + e1 * jm + f1 * jn + e1 * f1 + 1e-13 * jn * jm
            if n // 2 == m // 2:
                bend = flat_size(k, 3 * (n // 2) + n % 2 + m % 2)
                v += (0.125 * total + e0) * bend + far * e2 + 1e-13 * far * bend
                v = 2.0 * tension * v + e2
            else:
                v *= 2.0 * tension
            pair.change[4 * n + m] = pair.change[4 * m + n] = v * _GROW


@kernel(inline=True)
def hold_variables(pair, doubt):
    """Find the variables in which Phi is least at an end of their range, whatever the others are."""
    for i in range(4):
        turn = doubt
        for m in range(4):
            turn += 0.5 * (abs(pair.hessian[4 * i + m]) + pair.change[4 * i + m])
        slope = pair.gradient[i]
        pair.held[i] = -1.0 if slope > turn else (1.0 if slope < -turn else 0.0)


@kernel(inline=True)
def left_of_hessian(pair, rho):
    """Whether the Hessian less rho times its diagonal is positive definite in the variables that are not held."""
    h, f = pair.hessian, pair.factor
    for i in range(4):
        for m in range(i + 1):
            free = pair.held[i] == 0.0 and pair.held[m] == 0.0
            value = h[4 * i + m] if free else (1.0 if i == m else 0.0)
            if i == m and free:
                value -= rho * h[5 * i]
            size = abs(value)
            for l in range(m):
                product = f[4 * i + l] * f[4 * m + l]
                value -= product
                size += abs(product)
            if i == m:
                if not value > 64.0 * UNIT * size:
                    return False
                f[5 * i] = math.sqrt(value)
            else:
                f[4 * i + m] = value / f[5 * m]
    return True


@kernel(inline=True)
def has_one_minimum(pair):
    """Whether Phi is proven convex in the variables that are not held, with the margin left of its Hessian."""
    h = pair.hessian
    rho = 0.0
    for i in range(4):
        if pair.held[i] != 0.0:
            continue
        if not h[5 * i] > 0.0:
            return False
        row = 0.0
        for m in range(4):
            if pair.held[m] == 0.0:
                if not h[5 * m] > 0.0:
                    return False
                row += pair.change[4 * i + m] / math.sqrt(h[5 * i] * h[5 * m])
        rho = max(rho, row)
    rho = rho * _GROW + pair.margin * (1.0 + 1e-6)
    return rho < 1.0 and left_of_hessian(pair, rho)


@kernel(inline=True)
def has_one_with(pair, a, i, b, j, tension, doubt):
    """Whether a pair whose quadratic is loaded with a tension is proven to have one minimum. `doubt` of a slope."""
    load_change(pair, a, i, b, j, tension)
    hold_variables(pair, doubt)
    return has_one_minimum(pair)


@kernel(inline=True)
def is_any_held(pair):
    """Whether any variable is held at an end of its range."""
    return pair.held[0] != 0.0 or pair.held[1] != 0.0 or pair.held[2] != 0.0 or pair.held[3] != 0.0


@kernel(inline=True)
def may_have_one_minimum(pair, a, i, b, j, upper, doubt):
    """The tension with which a pair has one minimum, models loaded; -1 where none is known. `doubt` of a slope.

    A tension with which Phi is convex in all variables is best. Where there is none, as at the edge of a hole beside a
    pin, more tension may make Phi convex in the variables that are not held.
    """
    halvings = links_of(a, i).depth + links_of(b, j).depth
    pair.margin = _MARGIN if halvings < _HALVINGS else _LEAST_MARGIN
    tense = load_tense(pair, upper)
    if has_one_with(pair, a, i, b, j, tense.tension, doubt):
        return tense.tension
    more = tension_at_most(pair, upper, STIFFER)
    if tense.convex or not more > tense.tension or not is_any_held(pair):
        return -1.0
    load_quadratic(pair, more)
    return more if has_one_with(pair, a, i, b, j, more, doubt) else -1.0


@kernel(inner=True)
def bound_by_tangent(search, tension):
    """Lower bound of Phi on a pair that has one minimum, from the places in hand, which are on it.

    Phi is computed there; its slope and the margin bound how far it may still fall. The linear part of a quadratic
    whose minimum is nearer to that of Phi is left in the pair.
    """
    pair, work, errors = pair_work_at(search.pair, 0), patch_work_at(search.w, 0), search.errors
    f, d, j = pair.frame, work.d, work.j
    t1, t2, n = (f[0], f[1], f[2]), (f[3], f[4], f[5]), (f[6], f[7], f[8])
    d0, d1, d2 = dot(t1, d), dot(t2, d), dot(n, d)
    flat = math.sqrt(d0 * d0 + d1 * d1)
    off = errors.point + 32.0 * UNIT * (flat + abs(d2))
    twice = 2.0 * tension
    least = d2 + tension * flat * flat * (1.0 - 32.0 * UNIT) - off * (1.0 + twice * (flat + off))
    for i in range(4):
        row = (j[3 * i], j[3 * i + 1], j[3 * i + 2])
        slope = dot(n, row) + twice * (d0 * dot(t1, row) + d1 * dot(t2, row))
        size = math.sqrt(dot(row, row))
        unsure = errors.slope + 32.0 * UNIT * size
        doubt = unsure * (1.0 + twice * flat) + twice * off * (size + unsure)
        x = work.place[i]
        pair.gradient[i] = slope
        for m in range(4):
            pair.gradient[i] -= pair.hessian[4 * i + m] * (work.place[m] - 0.5)
        pair.z[i] = x - 0.5
        if pair.held[i] == 0.0:
            least += least_change(slope, doubt, pair.margin * pair.hessian[5 * i], x, 1.0 - x) * _GROW
        elif x != (0.0 if pair.held[i] < 0.0 else 1.0):
            # Phi is monotone in this variable, so the place must be at the end where Phi is least.
            return -math.inf
    return least


@kernel(inner=True)
def proven_bound(search, i, j):
    """Lower bound of a pair by its only minimum, in the frame in hand; -inf where it is not proven to have just one.

    Its models are loaded; `pair.z` is where the search for the minimum begins.
    """
    pair, work, errors = pair_work_at(search.pair, 0), patch_work_at(search.w, 0), search.errors
    upper = body_search_at(search.state, 0).upper
    tension = may_have_one_minimum(pair, search.a, i, search.b, j, upper, errors.slope)
    if tension < 0.0:
        return -math.inf
    bound = -math.inf
    away = node_of(search.a, i).away + node_of(search.b, j).away
    sweep(pair, 0.0)
    for _ in range(_STEPS):
        for m in range(4):
            held = pair.held[m]
            work.place[m] = pair.z[m] + 0.5 if held == 0.0 else (0.0 if held < 0.0 else 1.0)
        load_places(search, i, j)
        least = bound_by_tangent(search, tension)
        if tension > 0.0:
            least = min(least, 0.5 / tension)
        bound = max(bound, least * (1.0 - 32.0 * UNIT) - away)
        if bound >= body_search_at(search.state, 0).limit:
            break
        sweep(pair, 0.0)
    return bound
