"""Two patches in four parameters: their difference with its derivatives, and bounds of the distance.

With z = (u_a, v_a, u_b, v_b), D(z) = a - b, J_i = D_i and K_ij = D_ij, F = |D|^2 / 2 has the gradient D.J_i and the
Hessian H_ij = J_i.J_j + D.K_ij. About the middles of both patches, z_i in [-1/2, 1/2],

    |D(z)| >= sqrt(min (|D|^2 + 2 g.z + z'Hz) - sum_ijk |J_i.K_jk| / 8) - E0_a - E0_b.

The minimum is bounded below by a tangent plane of the quadratic at a point near its minimum, where H is positive
definite; where it is not, s = max_i sum_j |D.K_ij| is added to its diagonal, which makes it so, and s |z|^2 is
subtracted again. A parameter of degree 0 is left out.

H(z) differs from H by at most

    V_ij = sum_l |J_i.K_jl + J_j.K_il + J_l.K_ij| / 2 + k_i k_j + |K_ij| sum_lm |K_lm| / 8 + remainders,

k_i = sum_l |K_il| / 2. Where H - diag(H) (rho + MARGIN) is positive definite with
rho = max_i sum_j V_ij / sqrt(H_ii H_jj), the Hessian is at least MARGIN diag(H) on the whole box.

Rounding is treated as in `distance/curves/bounds.py`.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.distance.patches.nodes import (
    JU,
    KUU,
    bezier_surface_at,
    patch_node_at,
    patch_positions,
)
from assembly.geometry.splines.bezier_pieces import UNIT

# Doubles for work; basis functions stand behind them.
PATCH_WORK = record_dtype(
    "f8",
    d=3,  # D, the difference of two points [length]
    j=12,  # J_i, its derivatives by the four parameters
    k=48,  # K_ij, its second derivatives, rows of four
    h=16,  # Hessian
    g=4,  # gradient
    z=4,  # a place in the models
    place=4,  # a place in the unit cube
    step=4,  # Newton's step
    factor=16,  # Cholesky's factor of the matrix of that step
    patch_j=6,  # first derivatives of one patch
    patch_k=9,  # second derivatives of one patch
    off=4,  # errors of a formula and the range of its parameter (`distance/patches/formula_nodes.py`)
)
patch_work_at = record_view(PATCH_WORK)
D = place_of(PATCH_WORK, "d")
J = place_of(PATCH_WORK, "j")
K = place_of(PATCH_WORK, "k")
H = place_of(PATCH_WORK, "h")
Z = place_of(PATCH_WORK, "z")
PLACE = place_of(PATCH_WORK, "place")
STEP = place_of(PATCH_WORK, "step")
PATCH_J = place_of(PATCH_WORK, "patch_j")
PATCH_K = place_of(PATCH_WORK, "patch_k")
OFF = place_of(PATCH_WORK, "off")
BASIS = size_of(PATCH_WORK)
MARGIN = 0.05
_SWEEPS = 12


@kernel(inline=True)
def node_of(patch):
    """The doubles of a patch."""
    return patch_node_at(patch.nodes, patch.at)


@kernel(inline=True)
def vector_dot(w, i, j):
    """The scalar product of two vectors in one array."""
    return w[i] * w[j] + w[i + 1] * w[j + 1] + w[i + 2] * w[j + 2]


@kernel(inline=True)
def size_at(w, i):
    return math.sqrt(vector_dot(w, i, i))


@kernel(inline=True)
def free_count(record):
    """Parameters of a shape: a curve is of degree 0 in v, a point in both."""
    patch = bezier_surface_at(record, 0)
    return int(patch.degree_u > 0) + int(patch.degree_v > 0)


@kernel(inner=True, exact=True)
def load_side(source, first, second, sign, n, at, w):
    """Copy J and K of one shape with n parameters, times `sign`, from `source` to the pair's parameters from `at`."""
    work = patch_work_at(w, 0)
    for i in range(n):
        for c in range(3):
            work.j[3 * (at + i) + c] = sign * source[first + 3 * i + c]
            for j in range(n):
                work.k[3 * (4 * (at + i) + at + j) + c] = sign * source[second + 3 * (i + j) + c]


@kernel(inner=True, exact=True)
def load_models(a, b, shift, w):
    """D, J and K at the middles of two patches."""
    for j in range(3):
        patch_work_at(w, 0).d[j] = (node_of(a).a0[j] - node_of(b).a0[j]) - shift[j]
    load_side(a.nodes, a.at + JU, a.at + KUU, 1.0, a.free, 0, w)
    load_side(b.nodes, b.at + JU, b.at + KUU, -1.0, b.free, a.free, w)


@kernel(inner=True, exact=True)
def load_hessian(w, n):
    """Gradient and Hessian of F from D, J and K."""
    work = patch_work_at(w, 0)
    for i in range(n):
        work.g[i] = vector_dot(w, D, J + 3 * i)
        for j in range(i + 1):
            value = vector_dot(w, J + 3 * i, J + 3 * j) + vector_dot(w, D, K + 3 * (4 * i + j))
            work.h[4 * i + j] = value
            work.h[4 * j + i] = value


@kernel(inner=True, exact=True)
def factorize(w, n, scaled, shift):
    """Cholesky's factor of H - shift or, scaled, H - shift diag(H); False where it is not positive definite by more
    than rounding.
    """
    work = patch_work_at(w, 0)
    for i in range(n):
        for j in range(i + 1):
            value = work.h[4 * i + j]
            if i == j:
                value -= shift * work.h[5 * i] if scaled else shift
            size = abs(value)
            for k in range(j):
                product = work.factor[4 * i + k] * work.factor[4 * j + k]
                value -= product
                size += abs(product)
            if i == j:
                if not value > 64.0 * UNIT * size:
                    return False
                work.factor[5 * i] = math.sqrt(value)
            else:
                work.factor[4 * i + j] = value / work.factor[5 * j]
    return True


@kernel(inner=True, exact=True)
def patch_box_bound(a, b, shift, slack):
    """Distance of two boxes, the second moved by the shift."""
    node_a, node_b = node_of(a), node_of(b)
    total = 0.0
    for j in range(3):
        gap = abs((node_a.box_center[j] - node_b.box_center[j]) - shift[j])
        gap -= node_a.box_half[j] + node_b.box_half[j] + 2.0 * slack
        if gap > 0.0:
            total += gap * gap
    return math.sqrt(total) * (1.0 - 8.0 * UNIT) - node_a.away - node_b.away


@kernel(inline=True)
def slope_at(w, n, i, raised):
    """Component i of the gradient of g.z + z'(H + raised) z / 2 at z."""
    work = patch_work_at(w, 0)
    slope = work.g[i] + raised * work.z[i]
    for j in range(n):
        slope += work.h[4 * i + j] * work.z[j]
    return slope


@kernel(inner=True, exact=True)
def patch_model_bound(a, b, slack, w):
    """The bound of the quadratic models, after `load_models` and `load_hessian`; Z is left near the minimizer."""
    work = patch_work_at(w, 0)
    node_a, node_b = node_of(a), node_of(b)
    n = a.free + b.free
    c = vector_dot(w, D, D)
    raised = 0.0
    size = c
    cubic = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            k = K + 3 * (4 * i + j)
            bend = abs(vector_dot(w, D, k))
            row += bend
            size += bend + abs(work.h[4 * i + j]) + vector_dot(w, k, k)
            for l in range(n):
                cubic += abs(vector_dot(w, J + 3 * l, k))
        raised = max(raised, row)
        work.z[i] = 0.0
    if factorize(w, n, False, 1e-12 * size):
        raised = 0.0
    for _ in range(_SWEEPS):
        change = 0.0
        for i in range(n):
            slope = slope_at(w, n, i, raised)
            curvature = work.h[5 * i] + raised
            z = math.copysign(0.5, -slope)
            if curvature > 0.0:
                z = min(max(work.z[i] - slope / curvature, -0.5), 0.5)
            change = max(change, abs(z - work.z[i]))
            work.z[i] = z
        if change < 1e-9:
            break
    least = c
    for i in range(n):
        slope = slope_at(w, n, i, raised)
        # The value at z, from there the fall of the tangent plane to its lowest corner, and the raise at a corner.
        least += (slope + work.g[i]) * work.z[i] - 2.0 * slope * work.z[i] - abs(slope) - 0.25 * raised
    least -= 0.125 * cubic * (1.0 + 1e-12) + 512.0 * UNIT * size
    root = math.sqrt(least) * (1.0 - 8.0 * UNIT) if least > 0.0 else 0.0
    away = node_a.away + node_b.away + node_a.e0 + node_b.e0 + slack
    return root - away * (1.0 + 16.0 * UNIT)


@kernel(inline=True, exact=True)
def farthest(patch, x, y, z):
    """The control point of a patch that is farthest along a direction: how far it is."""
    surface = bezier_surface_at(patch.record, 0)
    nodes = patch.nodes
    most = -math.inf
    i = patch_positions(patch.record, patch.at)
    for _ in range((surface.degree_u + 1) * (surface.degree_v + 1)):
        most = max(most, x * nodes[i] + y * nodes[i + 1] + z * nodes[i + 2])
        i += 4
    return most


@kernel(inner=True, exact=True)
def patch_hull_bound(a, b, shift, slack, w):
    """The bound of the control points along the difference of the linear models at z."""
    work = patch_work_at(w, 0)
    n0 = work.d[0]
    n1 = work.d[1]
    n2 = work.d[2]
    for i in range(a.free + b.free):
        n0 += work.z[i] * work.j[3 * i]
        n1 += work.z[i] * work.j[3 * i + 1]
        n2 += work.z[i] * work.j[3 * i + 2]
    size = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if not size > 0.0:
        return 0.0
    size = 1.0 / size
    n0 *= size
    n1 *= size
    n2 *= size
    low = -farthest(a, -n0, -n1, -n2)
    high = farthest(b, n0, n1, n2)
    gap = (low - high) - (n0 * shift[0] + n1 * shift[1] + n2 * shift[2])
    return gap * (1.0 - 16.0 * UNIT) - 4.0 * slack - node_of(a).away - node_of(b).away


@kernel(inner=True, exact=True)
def patch_convexity(a, b, w):
    """Whether F is proven convex on the box, its Hessian at least MARGIN diag(H) there; uses `load_hessian`'s H."""
    work = patch_work_at(w, 0)
    node_a, node_b = node_of(a), node_of(b)
    na, n = a.free, a.free + b.free
    far = size_at(w, D)
    total = 0.0
    for i in range(n):
        if not work.h[5 * i] > 0.0:
            return False
        far += 0.5 * size_at(w, J + 3 * i)
        # Half the sum of a row of |K|, kept in `step`, which is free here.
        row = 0.0
        for j in range(n):
            row += size_at(w, K + 3 * (4 * i + j))
        work.step[i] = 0.5 * row
        total += row
    e0 = node_a.e0 + node_b.e0 + node_a.away + node_b.away
    far += 0.125 * total + e0
    rho = 0.0
    for i in range(n):
        row = 0.0
        e1 = node_a.e1 if i < na else node_b.e1
        e2 = node_a.e2 if i < na else node_b.e2
        ji = size_at(w, J + 3 * i) + work.step[i]
        for j in range(n):
            f1 = node_a.e1 if j < na else node_b.e1
            v = 0.0
            for l in range(n):
                turn = vector_dot(w, J + 3 * i, K + 3 * (4 * j + l)) + vector_dot(w, J + 3 * j, K + 3 * (4 * i + l))
                v += 0.5 * abs(turn + vector_dot(w, J + 3 * l, K + 3 * (4 * i + j)))
            jj = size_at(w, J + 3 * j) + work.step[j]
            bend = size_at(w, K + 3 * (4 * i + j))
            v += work.step[i] * work.step[j] + 0.125 * bend * total + e1 * (jj + f1) + f1 * ji + e0 * bend
            if (i < na) == (j < na):
                v += far * e2
            v += 1e-13 * (ji * jj + far * bend)
            row += v / math.sqrt(work.h[5 * i] * work.h[5 * j])
        rho = max(rho, row)
    rho = rho * (1.0 + 1e-12) + MARGIN * (1.0 + 1e-6)
    return rho < 1.0 and factorize(w, n, True, rho)
