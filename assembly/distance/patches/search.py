"""Certified distance of a surface and a point, a curve or a surface: the search of `distance/curves/search.py` over
patches.

The curve may be given by a formula: its pieces are `distance/patches/formula_nodes.py`'s.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.distance.curves.nodes import length
from assembly.distance.curves.search import CONVERGED, bound_to_beat, ended, in_span, longer, pop, push
from assembly.distance.patches.formula_nodes import (
    describe_formula,
    formula_parameter,
    is_dot,
    split_formula,
    start_formula,
)
from assembly.distance.patches.newton import load_points, nearest_in_patches, proven_in_patches
from assembly.distance.patches.nodes import (
    DEEPEST,
    NODE_INTS,
    bezier_surface_at,
    describe_patch,
    fill_patch,
    patch_node_at,
    patch_node_links_at,
    patch_stride,
    split_patch,
)
from assembly.distance.patches.pair import (
    BASIS,
    D,
    clear_bends,
    free_count,
    load_hessian,
    load_models,
    patch_box_bound,
    patch_convexity,
    patch_hull_bound,
    patch_model_bound,
    patch_work_at,
    size_at,
)
from assembly.geometry.splines.bezier_pieces import UNIT, bezier_head_at

# What a search writes.
PATCH_ANSWER_RECORD = record_dtype(
    "f8",
    lower=1,  # proven bounds of the distance [length]
    upper=1,
    parameters=4,  # (u, v) of a, then of b
    points=6,  # of a, then of b [length]
    count=1,  # pairs bounded
)
patch_answer_at = record_view(PATCH_ANSWER_RECORD)
PATCH_ANSWER = size_of(PATCH_ANSWER_RECORD)
_ROOM = 512


@kernel(inline=True)
def patch_size(nodes, o):
    """The longer side of a patch."""
    node = patch_node_at(nodes, o)
    return max(node.speed_u, node.speed_v)


@kernel(inline=True)
def point_error(record, pool):
    """How far an evaluated point may be from the packed patch: sums of positive terms in triangles of 3 n roundings."""
    patch = bezier_surface_at(record, 0)
    n = patch.degree_u + patch.degree_v
    return (1.0 + patch.rational) * (8.0 * n + 24.0) * UNIT * bezier_head_at(pool, 0).reach


@kernel(inline=True)
def derivative_error(record, pool):
    """The same of a derivative: n differences of such sums, in a quotient also of the weights."""
    head = bezier_head_at(pool, 0)
    patch = bezier_surface_at(record, 0)
    n = patch.degree_u + patch.degree_v + 1.0
    return 8.0 * n * (4.0 * n + 16.0) * UNIT * head.reach * head.weight_ratio ** (2 * patch.rational)


@kernel(inner=True)
def keep_patch_points(ra, qa, ia, a, ka, rb, qb, ib, b, kb, na, nb, curve, w, u, v, upper, out):
    """Write nearest points that are known: u and v at PLACE of two nodes."""
    work = patch_work_at(w, 0)
    patch_record = bezier_surface_at(ra, 0)
    patch_0 = bezier_surface_at(rb, 0)
    answer = patch_answer_at(out, 0)
    o = patch_node_at(a, patch_stride(ra) * ka)
    p = patch_stride(rb) * kb
    node = patch_node_at(b, p)
    patch = patch_node_links_at(ia, NODE_INTS * ka).patch
    answer.parameters[0] = between(
        qa, patch_record.breaks_u + patch // patch_record.patches_v, o.low_u, o.high_u, work.place[0]
    )
    answer.parameters[1] = between(
        qa, patch_record.breaks_v + patch % patch_record.patches_v, o.low_v, o.high_v, work.place[1] if na > 1 else 0.0
    )
    patch = patch_node_links_at(ib, NODE_INTS * kb).patch
    x = work.place[na] if nb > 0 else 0.0
    y = work.place[na + 1] if nb > 1 else 0.0
    if curve is None:
        answer.parameters[2] = between(qb, patch_0.breaks_u + patch // patch_0.patches_v, node.low_u, node.high_u, x)
        answer.parameters[3] = between(qb, patch_0.breaks_v + patch % patch_0.patches_v, node.low_v, node.high_v, y)
    else:
        answer.parameters[2] = formula_parameter(b, p, x)
    answer.upper = upper
    for j in range(3):
        answer.points[j] = u[j] + bezier_head_at(qa, 0).center[j]
        answer.points[3 + j] = v[j] + bezier_head_at(qb, 0).center[j]


@kernel(inline=True)
def between(pool, at, low, high, x):
    """The parameter of a place on a node of one direction."""
    return in_span(pool, at, low + x * (high - low))


@kernel(
    signatures=(
        "(i8[::1], f8[::1], i8[::1], f8[::1], Tuple((i8[::1], f8[::1], f8[::1])), f8, f8, i8, b1, f8[::1])",
        "(i8[::1], f8[::1], i8[::1], f8[::1], none, f8, f8, i8, b1, f8[::1])",
    ),
    allocates=True,
)
def patch_distance(ra, qa, rb, qb, curve, tolerance, clearance, budget, polish, out):
    """Bounds of the distance of two packed shapes, the first no point; a clearance below zero asks for the distance.

    The second may stand for a curve given by a formula, which is None else.
    """
    head = bezier_head_at(qb, 0)
    pool_head = bezier_head_at(qa, 0)
    patch = bezier_surface_at(ra, 0)
    patch_record = bezier_surface_at(rb, 0)
    answer = patch_answer_at(out, 0)
    shift = (
        head.center[0] - pool_head.center[0],
        head.center[1] - pool_head.center[1],
        head.center[2] - pool_head.center[2],
    )
    slack = 8.0 * UNIT * (pool_head.reach + head.reach + length(shift)) + 1e-150
    error = slack + point_error(ra, qa) + point_error(rb, qb)
    rough = max(derivative_error(ra, qa), derivative_error(rb, qb))
    step = max(0.999 * tolerance, 8.0 * (error + pool_head.error + head.error))
    na = free_count(ra)
    nb = free_count(rb)
    n = na + nb
    sa = patch_stride(ra)
    sb = patch_stride(rb)
    used_a = patch.patches_u * patch.patches_v
    used_b = patch_record.patches_u * patch_record.patches_v
    room_a = used_a + _ROOM
    room_b = used_b + _ROOM
    room = used_a * used_b + _ROOM
    a = np.empty(room_a * sa)
    b = np.empty(room_b * sb)
    ia = np.empty(room_a * NODE_INTS, np.int64)
    ib = np.empty(room_b * NODE_INTS, np.int64)
    keys = np.empty(room)
    first = np.empty(room, np.int64)
    second = np.empty(room, np.int64)
    degree = max(max(patch.degree_u, patch.degree_v), max(patch_record.degree_u, patch_record.degree_v))
    w = np.empty(BASIS + 6 * (degree + 1))
    work = patch_work_at(w, 0)
    m = np.empty(42)
    clear_bends(w)
    for k in range(used_a):
        fill_patch(ra, qa, ia, a, k)
    if curve is None:
        for k in range(used_b):
            fill_patch(rb, qb, ib, b, k)
    else:
        start_formula(curve, rb, ib, b)
    count = 0
    # The first corners, which are on both shapes.
    for i in range(4):
        work.place[i] = 0.0
    _low, upper, u, v = proven_in_patches(ra, a, 0, na, rb, b, 0, nb, curve, shift, error, rough, False, w)
    keep_patch_points(ra, qa, ia, a, 0, rb, qb, ib, b, 0, na, nb, curve, w, u, v, upper, out)
    at_start = True
    let_go = math.inf
    bounded = 0
    status = CONVERGED
    key = 0.0
    # Nodes from new_a and new_b on are to be described; then pairs first_a..last_a with first_b..last_b bounded.
    new_a = 0
    new_b = 0
    first_a = 0
    last_a = used_a
    first_b = 0
    last_b = used_b
    while True:
        for k in range(new_a, used_a):
            describe_patch(ra, qa, a, sa * k, m)
        for k in range(new_b, used_b):
            if curve is None:
                describe_patch(rb, qb, b, sb * k, m)
            else:
                describe_formula(curve, 0.125 * step, b, sb * k, m)
        new_a = used_a
        new_b = used_b
        limit = bound_to_beat(upper, step, clearance)
        for ja in range(first_a, last_a):
            for jb in range(first_b, last_b):
                bounded += 1
                oa = sa * ja
                ob = sb * jb
                if curve is not None:
                    nb = 0 if is_dot(b, ob) else 1
                    n = na + nb
                bound = max(key, patch_box_bound(a, oa, b, ob, shift, slack))
                # At the start, where there are many, boxes must do.
                if bound < limit and not at_start:
                    load_models(a, oa, na, b, ob, nb, shift, w)
                    load_hessian(w, n)
                    bound = max(bound, patch_model_bound(a, oa, b, ob, slack, n, w))
                    if bound < limit:
                        # The rows of a formula are its model's, which is not the curve.
                        rest = 0.0 if curve is None else patch_node_at(b, ob).e0
                        bound = max(bound, patch_hull_bound(ra, a, oa, rb, b, ob, shift, slack, n, w) - rest)
                if bound < limit:
                    push(keys, first, second, count, bound, ja, jb)
                    count += 1
                else:
                    let_go = min(let_go, bound)
        first_a = last_a
        at_start = False
        top = min(keys[0], let_go) if count > 0 else let_go
        status = ended(top, upper, step, clearance, count, bounded, budget)
        if status >= 0:
            break
        key = keys[0]
        ka = first[0]
        kb = second[0]
        pop(keys, first, second, count)
        count -= 1
        oa = sa * ka
        ob = sb * kb
        if curve is not None:
            nb = 0 if is_dot(b, ob) else 1
            n = na + nb
        away = patch_node_at(a, oa).away + patch_node_at(b, ob).away
        load_models(a, oa, na, b, ob, nb, shift, w)
        load_hessian(w, n)
        key = max(key, patch_model_bound(a, oa, b, ob, slack, n, w))
        for i in range(n):
            work.place[i] = work.z[i] + 0.5
        proven = polish and patch_convexity(a, oa, na, b, ob, n, w)
        for i in range(n):
            work.z[i] = work.h[5 * i]
        descend = proven
        if polish and not proven:
            load_points(ra, a, oa, na, rb, b, ob, nb, curve, shift, w)
            descend = size_at(w, D) + error + away < upper
        if descend:
            nearest_in_patches(ra, a, oa, na, rb, b, ob, nb, curve, shift, w)
        low, far, u, v = proven_in_patches(ra, a, oa, na, rb, b, ob, nb, curve, shift, error, rough, proven, w)
        if far < upper:
            upper = far
            keep_patch_points(ra, qa, ia, a, ka, rb, qb, ib, b, kb, na, nb, curve, w, u, v, upper, out)
        if proven:
            # A dot's point stands for others: no patch, however small, comes nearer to the truth than that.
            doubt = 2.0 * patch_node_at(b, ob).e0 if curve is not None and nb == 0 else 0.0
            key = max(key, low - doubt)
            if far - low <= max(step, 16.0 * (error + away)) + doubt:
                let_go = min(let_go, key)
                continue
        if key >= upper - step or (key > clearance >= 0.0):
            let_go = min(let_go, key)
            continue
        # Halve the longer one.
        long_a = patch_size(a, oa)
        long_b = patch_size(b, ob)
        ends_a = patch_node_links_at(ia, NODE_INTS * ka).depth >= DEEPEST
        ends_b = patch_node_links_at(ib, NODE_INTS * kb).depth >= DEEPEST
        if max(long_a, long_b) <= step or (ends_a and ends_b):
            let_go = min(let_go, key)
            continue
        first_a = ka
        last_a = ka + 1
        first_b = kb
        last_b = kb + 1
        if ends_b or (long_a >= long_b and not ends_a):
            if patch_node_links_at(ia, NODE_INTS * ka).halves < 0:
                if used_a + 2 > room_a:
                    room_a *= 4
                    a = longer(a, room_a * sa)
                    ia = longer(ia, room_a * NODE_INTS)
                split_patch(ra, qa, ia, a, ka, used_a)
                used_a += 2
            first_a = patch_node_links_at(ia, NODE_INTS * ka).halves
            last_a = first_a + 2
        else:
            if patch_node_links_at(ib, NODE_INTS * kb).halves < 0:
                if used_b + 2 > room_b:
                    room_b *= 4
                    b = longer(b, room_b * sb)
                    ib = longer(ib, room_b * NODE_INTS)
                if curve is None:
                    split_patch(rb, qb, ib, b, kb, used_b)
                else:
                    split_formula(rb, ib, b, kb, used_b)
                used_b += 2
            first_b = patch_node_links_at(ib, NODE_INTS * kb).halves
            last_b = first_b + 2
        if count + 2 > room:
            room *= 4
            keys = longer(keys, room)
            first = longer(first, room)
            second = longer(second, room)
    answer.lower = max(min(top, upper), 0.0)
    answer.count = bounded
    return status
