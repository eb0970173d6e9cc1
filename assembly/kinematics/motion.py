"""How poses move: rotation of a pose, relative poses, retraction of twists, quaternion rates.

A configuration is an (n, 7) array, a row per body: x y z, then the quaternion w x y z, body to
world. A twist is linear, then angular velocity, world axes, at the body's origin.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import matmul_t, matvec, matvec_t, neg, quaternion_matrix, quaternion_product

# The pose of a shape in the axes that a kernel works in, mostly those of another body: a rotation matrix by rows and
# the place of the shape's origin.
RelativePose = namedtuple("RelativePose", "rotation shift")
# The pose of a shape in its own axes.
IDENTITY = RelativePose((1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


@kernel(inline=True)
def rotation(q, i):
    """Rotation matrix of body i (of the normalized quaternion)."""
    return quaternion_matrix(q[i, 3], q[i, 4], q[i, 5], q[i, 6])


@kernel(inline=True)
def position(q, i):
    return (q[i, 0], q[i, 1], q[i, 2])


@kernel(inline=True)
def relative_pose(q, i, rotation_i, j, rotation_j):
    """Rotation and translation of body j seen from body i.

    The positions are subtracted before anything else, so a common offset cancels.
    """
    shift = matvec_t(rotation_i, (q[j, 0] - q[i, 0], q[j, 1] - q[i, 1], q[j, 2] - q[i, 2]))
    return RelativePose(rotation=matmul_t(rotation_i, rotation_j), shift=shift)


@kernel(inline=True)
def inverse_pose(pose):
    """The pose of the other body, seen from this one."""
    m = pose.rotation
    back = (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])
    return RelativePose(back, neg(matvec(back, pose.shift)))


@kernel(inline=True)
def exponential(w):
    """Unit quaternion of the rotation vector w."""
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    if square < 1e-8:
        # Next terms are below 1e-17 here, and sin(a)/a would be 0/0 at zero.
        c = 1.0 - square / 8.0 + square * square / 384.0
        s = 0.5 - square / 48.0
    else:
        angle = math.sqrt(square)
        c = math.cos(0.5 * angle)
        s = math.sin(0.5 * angle) / angle
    return (c, s * w[0], s * w[1], s * w[2])


@kernel(inline=True)
def retract(q, i, dx, dw, out):
    """out[i] = pose i moved by the twist (dx, dw): x + dx, exp(dw) e, normalized."""
    a, b, c, d = quaternion_product(exponential(dw), (q[i, 3], q[i, 4], q[i, 5], q[i, 6]))
    s = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    out[i, 0] = q[i, 0] + dx[0]
    out[i, 1] = q[i, 1] + dx[1]
    out[i, 2] = q[i, 2] + dx[2]
    out[i, 3] = s * a
    out[i, 4] = s * b
    out[i, 5] = s * c
    out[i, 6] = s * d


@kernel(inline=True)
def quaternion_columns(w, e0, e1, e2, e3):
    """w . omega as a row over the quaternion's rate: w^T (world G) / |e|^2, four numbers.

    omega = G_world(e) e' / |e|^2 with G_world = 2 [[-x, w, -z, y], [-y, z, w, -x], [-z, -y, x, w]]
    (paper 001, eq. 17 in world axes), the rate of the normalized rotation.
    """
    s = 2.0 / (e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    return (
        s * (-e1 * w[0] - e2 * w[1] - e3 * w[2]),
        s * (e0 * w[0] + e3 * w[1] - e2 * w[2]),
        s * (-e3 * w[0] + e0 * w[1] + e1 * w[2]),
        s * (e2 * w[0] - e1 * w[1] + e0 * w[2]),
    )
