"""Rates of all unknowns for given rates of inputs: least squares under equations, in the envelope of the rows.

Rows A are the constraints, rows B those of the inputs. Among all rates v with B v = h, those that change rows A least
solve, with g = 0,

    A^T A v + B^T z = g,   B v = h.

Where the rows hold and the inputs do not contradict them, A v = 0. At other poses redundant rows contradict each other
a little, and v is a compromise, as smooth as they are. With M = A^T A + B^T B + REST I, S = M^-1 B^T and G = B S,

    x = M^-1 (g + B^T h),   z = G^-1 (B x - h),   v = x - S z.

Errors from REST and from the squared condition number are removed by solving again for the residuals of g and h:
corrected seminormal equations (Bjorck, Linear Algebra and its Applications 88, 1987). Motions that nothing determines
stay at rest.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.program.row_terms import width
from assembly.solve.linear_algebra.factorize import factorize, substitute
from assembly.solve.loop.parameters import PASSES, RATES_ENOUGH, REST
from assembly.solve.loop.residuals import add_row, clear_row, times

# Rows A (those in the list `used`) and B, and what solves them: the factors of M and G with how far their rows reach,
# and rows M^-1 B^T.
RateSystem = namedtuple("RateSystem", "bases jacobian used inputs matrix last solved gram ends")


@kernel(inner=True)
def reach(bases, r):
    """The first and the last unknown of row r; none if the last is negative."""
    low = math.inf
    high = -1
    for b in range(bases.shape[1]):
        at = bases[r, b]
        if at >= 0:
            low = min(low, at)
            high = max(high, at + width(b) - 1)
    return int(low) if high >= 0 else 0, high


@kernel(inner=True)
def add_row_square(x, low, high, matrix, last):
    """Upper triangle of matrix += x^T x, for a row x that is zero outside low .. high."""
    last[low] = max(last[low], high)
    for i in range(low, high + 1):
        s = x[i]
        if s != 0.0:
            for j in range(i, high + 1):
                matrix[i, j] += s * x[j]


@kernel(inner=True, allocates=True)
def rate_system(bases, jacobian, used, b):
    """The system of the rows of A in the list `used` and B (k, n).

    Returns whether the system exists, and the system. It does not exist if an input has no rates at all.
    """
    k, n = b.shape
    matrix = np.zeros((n, n))
    last = np.arange(n)
    x = np.zeros(n)
    for l in range(used.size):
        low, high = reach(bases, used[l])
        if high >= 0:
            add_row(bases, jacobian, used[l], 1.0, x)
            add_row_square(x, low, high, matrix, last)
            clear_row(bases, used[l], x)
    for j in range(k):
        low = n
        high = -1
        for i in range(n):
            if b[j, i] != 0.0:
                low = min(low, i)
                high = i
        if high >= 0:
            add_row_square(b[j], low, high, matrix, last)
    for i in range(n):
        matrix[i, i] += REST
        if i > 0:
            last[i] = max(last[i], last[i - 1])
    s = b.copy()
    gram = np.empty((k, k))
    ends = np.full(k, k - 1)
    exists = factorize(matrix, n, last)
    for j in range(k):
        substitute(matrix, n, last, s[j])
    for i in range(k):
        for j in range(i, k):
            gram[i, j] = 0.0
            for l in range(n):
                gram[i, j] += b[i, l] * s[j, l]
    exists = factorize(gram, k, ends) and exists
    return exists, RateSystem(bases, jacobian, used, b, matrix, last, s, gram, ends)


@kernel(inner=True, allocates=True)
def solve_rates(system, g, h, v, z):
    """Solve for v (n,) and z (k,). Returns the largest component of the residuals of g and h.

    The part of g that no pass removes acts on motions that nothing determines; v is left without these motions.
    """
    bases, jacobian, used, b, matrix, last, s, gram, ends = system
    k, n = b.shape
    rest = g.copy()
    missing = h.copy()
    x = np.empty(n)
    dz = np.empty(k)
    size = 0.0
    for i in range(n):
        v[i] = 0.0
        size = max(size, abs(g[i]))
    idle = size == 0.0
    for j in range(k):
        z[j] = 0.0
        size = max(size, abs(h[j]))
    start = size
    passes = 0
    while True:
        for i in range(n):
            x[i] = rest[i]
        if not idle:
            substitute(matrix, n, last, x)
        idle = False
        for j in range(k):
            if missing[j] != 0.0:
                for i in range(n):
                    x[i] += missing[j] * s[j, i]
        for j in range(k):
            dz[j] = -missing[j]
            for i in range(n):
                dz[j] += b[j, i] * x[i]
        substitute(gram, k, ends, dz)
        longest = 0.0
        change = 0.0
        for j in range(k):
            z[j] += dz[j]
            for i in range(n):
                x[i] -= s[j, i] * dz[j]
        for i in range(n):
            v[i] += x[i]
            longest = max(longest, abs(v[i]))
            change = max(change, abs(x[i]))
        passes += 1
        before = size
        if change <= RATES_ENOUGH * longest:
            # What the next pass would change is its square.
            return size * RATES_ENOUGH
        for i in range(n):
            rest[i] = g[i]
        for j in range(k):
            missing[j] = h[j]
            for i in range(n):
                missing[j] -= b[j, i] * v[i]
                rest[i] -= z[j] * b[j, i]
        for l in range(used.size):
            add_row(bases, jacobian, used[l], -times(bases, jacobian, used[l], v), rest)
        size = 0.0
        for i in range(n):
            size = max(size, abs(rest[i]))
        for j in range(k):
            size = max(size, abs(missing[j]))
        if not size < 0.1 * before or passes == PASSES:
            break
    if size > RATES_ENOUGH * start:
        substitute(matrix, n, last, rest)
        for i in range(n):
            v[i] -= passes * rest[i]
    return size
