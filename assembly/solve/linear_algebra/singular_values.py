"""Measures of a Jacobian by its singular values, with their derivatives.

    manipulability      product of s_i: sqrt(det J J^T), or sqrt(det J^T J) of a narrow J (paper 001, eq. 1)
    inverse condition   s_min / s_max
    isotropy            (product of s_i^2)^(1/r) / (mean of s_i^2)
    smallest            s_min
    force               1 / |J^T u|: the force along u that inputs of unit norm hold

With J = U diag(s) V^T, a measure w changes by the sum over i of (dw / ds_i) u_i^T dJ v_i. Where the smallest singular
values are equal, s_min has no derivative, and that of one of them is returned.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel

MANIPULABILITY, INVERSE_CONDITION, ISOTROPY, SMALLEST, FORCE = 0, 1, 2, 3, 4
SWEEPS = 30


@kernel(inner=True)
def singular_values(u, v, s):
    """One-sided Jacobi: u (a, b) becomes left vectors, v (b, b) right ones, s (b,) their values, in no order."""
    a, b = u.shape
    for i in range(b):
        for j in range(b):
            v[i, j] = 1.0 if i == j else 0.0
    for _sweep in range(SWEEPS):
        turned = False
        for i in range(b):
            for j in range(i + 1, b):
                p = 0.0
                q = 0.0
                r = 0.0
                for k in range(a):
                    p += u[k, i] * u[k, i]
                    q += u[k, j] * u[k, j]
                    r += u[k, i] * u[k, j]
                if abs(r) <= 1e-15 * math.sqrt(p * q) or r == 0.0:
                    continue
                turned = True
                zeta = (q - p) / (2.0 * r)
                t = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + math.hypot(1.0, zeta))
                c = 1.0 / math.sqrt(1.0 + t * t)
                for k in range(a):
                    x = u[k, i]
                    u[k, i] = c * (x - t * u[k, j])
                    u[k, j] = c * (t * x + u[k, j])
                for k in range(b):
                    x = v[k, i]
                    v[k, i] = c * (x - t * v[k, j])
                    v[k, j] = c * (t * x + v[k, j])
        if not turned:
            break
    for i in range(b):
        norm = 0.0
        for k in range(a):
            norm += u[k, i] * u[k, i]
        s[i] = math.sqrt(norm)
        for k in range(a):
            u[k, i] = u[k, i] / s[i] if s[i] > 0.0 else 0.0


@kernel(inner=True)
def measure_values(measure, s, slope):
    """A measure of singular values s, and its derivatives by them."""
    b = s.size
    low = 0
    high = 0
    for i in range(b):
        slope[i] = 0.0
        low = i if s[i] < s[low] else low
        high = i if s[i] > s[high] else high
    if measure == SMALLEST:
        slope[low] = 1.0
        return s[low]
    if measure == INVERSE_CONDITION:
        if not s[high] > 0.0:
            return 0.0
        value = s[low] / s[high]
        slope[low] += 1.0 / s[high]
        slope[high] -= value / s[high]
        return value
    product = 1.0
    mean = 0.0
    for i in range(b):
        product *= s[i]
        mean += s[i] * s[i] / b
        slope[i] = 1.0
        for j in range(b):
            if j != i:
                slope[i] *= s[j]
    if measure == MANIPULABILITY:
        return product
    value = product ** (2.0 / b) / mean if mean > 0.0 else 0.0
    for i in range(b):
        slope[i] = 2.0 / b * value * ((1.0 / s[i] if s[i] > 0.0 else 0.0) - s[i] / mean) if mean > 0.0 else 0.0
    return value


@kernel(inner=True, allocates=True)
def measure_jacobian(measure, pool, direction, jacobian, slopes):
    """A measure of a Jacobian, its derivatives by the entries into `slopes`; a force's direction is in the pool."""
    m, k = jacobian.shape
    if measure == FORCE:
        square = 0.0
        for i in range(k):
            t = 0.0
            for r in range(m):
                t += pool[direction + r] * jacobian[r, i]
            for r in range(m):
                slopes[r, i] = pool[direction + r] * t
            square += t * t
        value = 1.0 / math.sqrt(square) if square > 0.0 else math.inf
        for r in range(m):
            for i in range(k):
                slopes[r, i] *= -value / square if square > 0.0 else 0.0
        return value
    wide = k > m
    a = k if wide else m
    b = m if wide else k
    u = np.empty((a, b))
    v = np.empty((b, b))
    for i in range(a):
        for j in range(b):
            u[i, j] = jacobian[j, i] if wide else jacobian[i, j]
    s = np.empty(b)
    slope = np.empty(b)
    singular_values(u, v, s)
    value = measure_values(measure, s, slope)
    for r in range(m):
        for i in range(k):
            slopes[r, i] = 0.0
            for l in range(b):
                slopes[r, i] += slope[l] * (v[r, l] * u[i, l] if wide else u[r, l] * v[i, l])
    return value
