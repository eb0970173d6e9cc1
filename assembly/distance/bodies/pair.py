"""Lower bounds of the distance of two nodes of posed bodies.

D(z) = a - b with z = (u_a, v_a, u_b, v_b), each in [-1/2, 1/2] on the pair. For a unit vector n let P be the projection
along n. Every bound here follows from one statement, for any n and any tension t >= 0 [1/length]:

    if  Phi(z) = n.D + t |P D|^2 >= m  on the pair,  then  |D| >= min(m, 1 / (2 t)).

Proof: let p = |P D|^2 and 0 <= m <= 1 / (2 t). Either n.D >= m - t p >= 0, so that
|D|^2 >= (m - t p)^2 + p >= m^2 + p (1 - 2 m t) >= m^2; or t p > m, so that |D|^2 >= p > m / t >= 2 m^2.

With t = 0, m is the width of the slab between two planes; with t = 1 / (2 |D|), Phi curves like the distance itself.
Unlike that of the squared distance, its curvature in the surfaces' common tangent directions does not vanish with the
gap.

All vectors are in a frame whose third axis is n. With the models of both nodes,
D = d + sum J_i z_i + sum K_ij z_i z_j / 2 + e with |e| <= E0, and Phi is at least its quadratic part in z minus

    E0 + t (sum_ijk |PJ_i.PK_jk| / 8 + 2 E0 max |P (D - e)|).

Each bound is lowered by at least twice an upper bound of its rounding errors.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.distance.bodies.nodes import links_of, net_size, node_of, patch_of
from assembly.distance.bodies.records import NONE
from assembly.distance.bodies.spines import least_of_spine
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import dot, matvec, matvec_t

# Pose of b relative to a, each about its own center: a point x of b lies at turn x + shift. rounding: error of the
# shift [length].
BodyPose = namedtuple("BodyPose", "turn shift rounding")
# The models of two nodes in the frame of a direction, and the quadratic below Phi. One of degree 0 has no J and K.
PAIR_WORK = record_dtype(
    "f8",
    frame=9,  # rows t1, t2, n
    turned=9,  # -frame turn
    d=3,  # D at the middles [length]
    j=12,  # J_i
    k=18,  # K: uu, uv, vv of a, then of b
    gradient=4,
    hessian=16,
    factor=16,  # of the Hessian
    z=4,  # where the quadratic is least on the pair
    row=4,  # half the sum of a row of |PK|
    change=16,  # how much the Hessian may change on the pair
    held=4,  # -1 or 1: Phi is least at the low or the high end of this parameter, whatever the others are
    alone=2,  # 1: the node of a, of b is a curve, and has no second parameter
    margin=1,  # the part of the diagonal of the Hessian that a proof of one minimum leaves
)
# A tension, the value of its quadratic at the middles, and whether that quadratic is convex.
Tense = namedtuple("Tense", "tension value convex")
# The tension is at most these multiples of the largest curvature of the surfaces; the second where the first does not
# make the quadratic convex.
STIFFNESS, STIFFER = 4.0, 64.0
pair_work_at = record_view(PAIR_WORK)
PAIR_DOUBLES = size_of(PAIR_WORK)
_SWEEPS = 6


@kernel(inline=True)
def ball_bound(a, i, b, j, pose, slack):
    """Distance of the balls of two nodes."""
    node_a, node_b = node_of(a, i), node_of(b, j)
    turned = matvec(pose.turn, node_b.middle)
    square = 0.0
    for c in range(3):
        square += ((node_a.middle[c] - pose.shift[c]) - turned[c]) ** 2
    return math.sqrt(square) - (node_a.radius + node_b.radius + node_a.away + node_b.away + slack)


@kernel(inline=True)
def least_along(tree, k, n):
    """Least n.P of the control points of a node."""
    links = links_of(tree, k)
    count = net_size(patch_of(tree, links.patch)) // 7
    x = links.net + 4 * count
    y, z = x + count, x + 2 * count
    nets = tree.nets
    low = math.inf
    for i in range(count):
        low = min(low, n[0] * nets[x + i] + n[1] * nets[y + i] + n[2] * nets[z + i])
    return low


@kernel(inline=True)
def least_of(tree, k, n):
    """A lower bound of n.P of a part of a patch: by its control points, or the elementary surface that it is on."""
    low, spine = least_along(tree, k, n), links_of(tree, k).spine
    return low if spine == NONE else max(low, least_of_spine(tree.pool, spine, n))


@kernel(inline=True)
def hull_bound(pair, a, i, b, j, pose, slack):
    """Distance of two nodes along the direction of the frame, by control points and elementary surfaces."""
    f, m = pair.frame, pair.turned
    n = (f[6], f[7], f[8])
    low = least_of(a, i, n) + least_of(b, j, (m[6], m[7], m[8]))
    return (low - dot(n, pose.shift)) * (1.0 - 16.0 * UNIT) - slack - node_of(a, i).away - node_of(b, j).away


@kernel(inline=True)
def load_frame(pair, turn, n):
    """Load a frame whose third axis is the unit vector n (Duff et al. 2017), and -frame turn for the vectors of b."""
    sign = math.copysign(1.0, n[2])
    x = -1.0 / (sign + n[2])
    y = n[0] * n[1] * x
    f = pair.frame
    f[0], f[1], f[2] = 1.0 + sign * n[0] * n[0] * x, sign * y, -sign * n[0]
    f[3], f[4], f[5] = y, sign + n[1] * n[1] * x, -n[1]
    f[6], f[7], f[8] = n
    for r in range(3):
        row = matvec_t(turn, (f[3 * r], f[3 * r + 1], f[3 * r + 2]))
        for c in range(3):
            pair.turned[3 * r + c] = -row[c]


@kernel(inline=True)
def load_rows(matrix, source, target, count, at):
    """Write a node's vectors, multiplied by a matrix, to the rows of `target` from `at`."""
    for i in range(count):
        x, y, z = source[3 * i], source[3 * i + 1], source[3 * i + 2]
        for r in range(3):
            target[3 * (at + i) + r] = matrix[3 * r] * x + matrix[3 * r + 1] * y + matrix[3 * r + 2] * z


@kernel(inline=True)
def load_models(pair, a, i, b, j, pose):
    """D, J and K of a pair in its frame."""
    f, m = pair.frame, pair.turned
    node_a, node_b = node_of(a, i), node_of(b, j)
    for r in range(3):
        x = 0.0
        for c in range(3):
            x += f[3 * r + c] * (node_a.middle[c] - pose.shift[c]) + m[3 * r + c] * node_b.middle[c]
        pair.d[r] = x
    load_rows(f, node_a.slopes, pair.j, 2, 0)
    load_rows(m, node_b.slopes, pair.j, 2, 2)
    load_rows(f, node_a.bends, pair.k, 3, 0)
    load_rows(m, node_b.bends, pair.k, 3, 3)
    pair.alone[0] = 1.0 if patch_of(a, links_of(a, i).patch).degree_v == 0 else 0.0
    pair.alone[1] = 1.0 if patch_of(b, links_of(b, j).patch).degree_v == 0 else 0.0


@kernel(inline=True)
def flat_dot(x, i, y, k):
    """Scalar product of two rows across the direction."""
    return x[3 * i] * y[3 * k] + x[3 * i + 1] * y[3 * k + 1]


@kernel(inline=True)
def flat_size(x, i):
    """Length of a row across the direction."""
    return math.sqrt(flat_dot(x, i, x, i))


@kernel(inline=True)
def bend_part(pair, o, tension):
    """What bend o adds to the Hessian."""
    k, d = pair.k, pair.d
    return k[3 * o + 2] + 2.0 * tension * (d[0] * k[3 * o] + d[1] * k[3 * o + 1])


@kernel(inline=True)
def load_quadratic(pair, tension):
    """Value, gradient and Hessian of the quadratic of Phi at the middles; the value.

    Nothing depends on the second parameter of a curve: a one on the Hessian's diagonal keeps that parameter in place.
    """
    d, j, h = pair.d, pair.j, pair.hessian
    twice = 2.0 * tension
    for i in range(4):
        pair.gradient[i] = j[3 * i + 2] + twice * (d[0] * j[3 * i] + d[1] * j[3 * i + 1])
        for m in range(i + 1):
            value = twice * flat_dot(j, i, j, m)
            h[4 * i + m] = value
            h[4 * m + i] = value
    for side in range(2):
        o, s = 3 * side, 10 * side
        mixed = bend_part(pair, o + 1, tension)
        h[s] += bend_part(pair, o, tension)
        h[s + 1] += mixed
        h[s + 4] += mixed
        h[s + 5] += bend_part(pair, o + 2, tension)
        if pair.alone[side] > 0.0:
            h[s + 5] = 1.0
    return d[2] + tension * (d[0] * d[0] + d[1] * d[1])


@kernel(inline=True)
def is_definite(pair):
    """Whether the Hessian is positive definite by more than rounding: Cholesky's method."""
    h, f = pair.hessian, pair.factor
    for i in range(4):
        for m in range(i + 1):
            value = h[4 * i + m]
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
def tension_at_most(pair, upper, stiffness):
    """The smaller of 1 / (2 U), with which Phi curves like the distance, and a multiple of the surfaces' curvature."""
    most = 0.0
    k = pair.k
    for side in range(2):
        u, v = flat_size(pair.j, 2 * side), flat_size(pair.j, 2 * side + 1)
        o = 9 * side
        most = max(most, abs(k[o + 2]) / (u * u + 1e-300))
        most = max(most, abs(k[o + 5]) / (u * v + 1e-300))
        most = max(most, abs(k[o + 8]) / (v * v + 1e-300))
    return min(0.5 / max(upper * (1.0 + 1e-9), 1e-300), stiffness * most)


@kernel(inline=True)
def load_tense(pair, upper):
    """Load the quadratic with a tension that outweighs the curvatures; more of it where that makes it convex.

    Where a surface lies in another one of nearly the same curvature k, and their curvatures differ by dk, the tension
    has to be about k / dk times k.
    """
    tension = tension_at_most(pair, upper, STIFFNESS)
    value = load_quadratic(pair, tension)
    convex = is_definite(pair)
    if not convex:
        more = tension_at_most(pair, upper, STIFFER)
        if more > tension:
            raised = load_quadratic(pair, more)
            convex = is_definite(pair)
            if convex:
                return Tense(more, raised, convex)
            value = load_quadratic(pair, tension)
    return Tense(tension, value, convex)


@kernel(inline=True)
def sweep(pair, raised):
    """Coordinate descent from z on g.z + z'(H + raised) z / 2 over the box."""
    h, g, z = pair.hessian, pair.gradient, pair.z
    i0 = 1.0 / max(h[0] + raised, 1e-300)
    i1 = 1.0 / max(h[5] + raised, 1e-300)
    i2 = 1.0 / max(h[10] + raised, 1e-300)
    i3 = 1.0 / max(h[15] + raised, 1e-300)
    z0, z1, z2, z3 = z[0], z[1], z[2], z[3]
    for _ in range(_SWEEPS):
        old = abs(z0) + abs(z1) + abs(z2) + abs(z3)
        z0 = min(max(-(g[0] + h[1] * z1 + h[2] * z2 + h[3] * z3) * i0, -0.5), 0.5)
        z1 = min(max(-(g[1] + h[4] * z0 + h[6] * z2 + h[7] * z3) * i1, -0.5), 0.5)
        z2 = min(max(-(g[2] + h[8] * z0 + h[9] * z1 + h[11] * z3) * i2, -0.5), 0.5)
        z3 = min(max(-(g[3] + h[12] * z0 + h[13] * z1 + h[14] * z2) * i3, -0.5), 0.5)
        if abs(abs(z0) + abs(z1) + abs(z2) + abs(z3) - old) < 1e-6:
            break
    z[0], z[1], z[2], z[3] = z0, z1, z2, z3


@kernel(inline=True)
def indefinite_part(pair, tension):
    """The largest absolute row sum of the Hessian without its positive semidefinite part 2 t PJ_i.PJ_j.

    Added to the diagonal it makes the Hessian positive semidefinite.
    """
    worst = 0.0
    for side in range(2):
        o = 3 * side
        uu, vv = abs(bend_part(pair, o, tension)), abs(bend_part(pair, o + 2, tension))
        worst = max(worst, abs(bend_part(pair, o + 1, tension)) + max(uu, vv))
    return worst


@kernel(inline=True)
def least_of_quadratic(pair, tense):
    """A lower bound of the quadratic on the box, near its least value; `pair.z` is left near the minimizer.

    Where H is not positive definite, a raise s that makes it so is added to its diagonal and s |z|^2 / 2 subtracted
    again. A convex function is nowhere below a tangent plane, so the tangent plane at any z gives a bound.
    """
    h, g, z = pair.hessian, pair.gradient, pair.z
    raised = 0.0 if tense.convex else indefinite_part(pair, tense.tension)
    for i in range(4):
        z[i] = 0.0
    sweep(pair, raised)
    least = tense.value
    for i in range(4):
        bent = raised * z[i]
        for m in range(4):
            bent += h[4 * i + m] * z[m]
        slope = g[i] + bent
        # The value at z, then the tangent plane's fall to the corner, then the raise at a corner.
        least += (g[i] + 0.5 * bent) * z[i] - slope * z[i] - 0.5 * abs(slope) - 0.125 * raised
    return least


@kernel(inline=True)
def flat_bend_sum(pair, side):
    """Sum over jk of |P K_jk| of one surface."""
    o = 3 * side
    return flat_size(pair.k, o) + 2.0 * flat_size(pair.k, o + 1) + flat_size(pair.k, o + 2)


@kernel(inline=True)
def doubt_of_points(a, i, b, j):
    """E0: how far the difference of two points may be from that of the models."""
    node_a, node_b = node_of(a, i), node_of(b, j)
    return node_a.point_doubt + node_b.point_doubt + node_a.away + node_b.away


@kernel(inline=True)
def model_bound(pair, a, i, b, j, upper, slack):
    """Lower bound of |D| on a pair by the quadratic below Phi; needs `load_models`."""
    tense = load_tense(pair, upper)
    least, tension = least_of_quadratic(pair, tense), tense.tension
    d, jacobian, k = pair.d, pair.j, pair.k
    e0 = doubt_of_points(a, i, b, j)
    rest = e0
    size = abs(d[0]) + abs(d[1]) + abs(d[2]) + node_of(a, i).extent + node_of(b, j).extent
    if tension > 0.0:
        cubic = 0.0
        flat = math.sqrt(d[0] * d[0] + d[1] * d[1]) + 0.125 * (flat_bend_sum(pair, 0) + flat_bend_sum(pair, 1))
        for m in range(4):
            flat += 0.5 * flat_size(jacobian, m)
            for o in range(0, 6, 3):
                cubic += abs(flat_dot(jacobian, m, k, o)) + abs(flat_dot(jacobian, m, k, o + 2))
                cubic += 2.0 * abs(flat_dot(jacobian, m, k, o + 1))
        rest += tension * (0.125 * cubic + 2.0 * e0 * flat)
        rest += 512.0 * UNIT * tension * size * size
    bound = least - rest * (1.0 + 1e-12) - 512.0 * UNIT * size - slack
    if tension > 0.0:
        bound = min(bound, 0.5 / tension)
    return bound * (1.0 - 32.0 * UNIT)
