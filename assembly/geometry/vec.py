"""3-vectors, unit quaternions and 3x3 matrices as tuples: no allocation, inlined by LLVM.

A matrix is nine numbers, row by row. A quaternion is (w, x, y, z).
"""

from __future__ import annotations

from assembly._kernel import kernel


@kernel(inline=True)
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel(inline=True)
def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel(inline=True)
def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel(inline=True)
def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel(inline=True)
def scale(s, a):
    return (s * a[0], s * a[1], s * a[2])


@kernel(inline=True)
def neg(a):
    return (-a[0], -a[1], -a[2])


@kernel(inline=True)
def blend(s, a, t, b):
    """s a + t b."""
    return (s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2])


@kernel(inline=True)
def matvec(m, a):
    return (
        m[0] * a[0] + m[1] * a[1] + m[2] * a[2],
        m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
        m[6] * a[0] + m[7] * a[1] + m[8] * a[2],
    )


@kernel(inline=True)
def matvec_t(m, a):
    """The transpose of m times a."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[6] * a[2],
        m[1] * a[0] + m[4] * a[1] + m[7] * a[2],
        m[2] * a[0] + m[5] * a[1] + m[8] * a[2],
    )


@kernel(inline=True)
def matmul_t(m, n):
    """The transpose of m times n."""
    a = matvec_t(m, (n[0], n[3], n[6]))
    b = matvec_t(m, (n[1], n[4], n[7]))
    c = matvec_t(m, (n[2], n[5], n[8]))
    return (a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2])


@kernel(inline=True)
def quaternion_matrix(w, x, y, z):
    """Rotation matrix of the normalized quaternion."""
    s = 2.0 / (w * w + x * x + y * y + z * z)
    wx = s * w * x
    wy = s * w * y
    wz = s * w * z
    xx = s * x * x
    xy = s * x * y
    xz = s * x * z
    yy = s * y * y
    yz = s * y * z
    zz = s * z * z
    return (1.0 - yy - zz, xy - wz, xz + wy, xy + wz, 1.0 - xx - zz, yz - wx, xz - wy, yz + wx, 1.0 - xx - yy)


@kernel(inline=True)
def quaternion_product(a, b):
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )
