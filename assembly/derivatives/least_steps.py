"""The step that rows and an objective ask for, a unit of each parameter: `kkt.solve_system` where all is clear.

Rows of length one, J = P^T L Q^T with rows chosen by their lengths (LQ with pivots, by reflections): what rows ask for
is forward substitution, what they leave free the last columns of Q, and forces are back substitution. Rows that repeat
each other share a force by a second factorization. The rank, and the curvature along what is left, are clear where no
pivot is near its threshold; else nothing is said, and singular values decide.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel

# Pivots of rows of length one: below the first they count as none, above the second they count; between nobody knows.
NONE, SOME = 1e-9, 1e-5
# Pivots of the curvature along free motions, over the largest entry of the Hessian: those above are no doubt.
CURVED = 1e-6
# What rows that repeat each other may ask for differently, over what is asked, and still agree.
AGREE = 1e-7


@kernel(inner=True)
def reflect(v, beta, rows, first, along):
    """Apply I - beta v v^T, whose v begins at `first`, to the columns of an array (n, p) from that row on."""
    count = rows.shape[1]
    for k in range(count):
        along[k] = 0.0
    for i in range(first, rows.shape[0]):
        factor = beta * v[i]
        for k in range(count):
            along[k] += factor * rows[i, k]
    for i in range(first, rows.shape[0]):
        factor = v[i]
        for k in range(count):
            rows[i, k] -= factor * along[k]


@kernel(inner=True)
def factorize_rows(lower, reflections, order, choose):
    """L Q^T of rows (r, n) in place; reflections (r, n) and their factors in the last column. Returns the rank, or -1.

    With `choose` the row that has most left comes next, and what has next to nothing left ends it.
    """
    r, n = lower.shape
    rank = min(r, n)
    for k in range(r):
        order[k] = k
    for k in range(min(r, n)):
        best, most = k, -1.0
        for i in range(k, r if choose else k + 1):
            square = 0.0
            for j in range(k, n):
                square += lower[i, j] * lower[i, j]
            if square > most:
                best, most = i, square
        length = math.sqrt(most)
        if length <= NONE:
            rank = k
            break
        if choose and length < SOME:
            return -1
        if best != k:
            for j in range(n):
                lower[k, j], lower[best, j] = lower[best, j], lower[k, j]
            order[k], order[best] = order[best], order[k]
        pivot = -length if lower[k, k] > 0.0 else length
        v = reflections[k]
        square = 0.0
        for j in range(k, n):
            v[j] = lower[k, j]
        v[k] -= pivot
        for j in range(k, n):
            square += v[j] * v[j]
        beta = 2.0 / square
        v[n] = beta
        for i in range(k + 1, r):
            w = 0.0
            for j in range(k, n):
                w += v[j] * lower[i, j]
            w *= beta
            for j in range(k, n):
                lower[i, j] -= w * v[j]
        lower[k, k] = pivot
        for j in range(k + 1, n):
            lower[k, j] = 0.0
    return rank


@kernel(inner=True)
def reflect_back(reflections, rank, rows, along):
    """Q times rows (n, p); `along` is room for one of them."""
    n = rows.shape[0]
    for k in range(rank - 1, -1, -1):
        reflect(reflections[k], reflections[k, n], rows, k, along)


@kernel(inner=True)
def forward_rows(lower, rank, rows):
    """L^-1 of the first rows, in place."""
    for i in range(rank):
        for j in range(i):
            factor = lower[i, j]
            for k in range(rows.shape[1]):
                rows[i, k] -= factor * rows[j, k]
        for k in range(rows.shape[1]):
            rows[i, k] /= lower[i, i]


@kernel(inner=True)
def backward_rows(lower, rank, rows):
    """L^-T of the first rows, in place."""
    for i in range(rank - 1, -1, -1):
        for j in range(i + 1, rank):
            factor = lower[j, i]
            for k in range(rows.shape[1]):
                rows[i, k] -= factor * rows[j, k]
        for k in range(rows.shape[1]):
            rows[i, k] /= lower[i, i]


@kernel(inner=True)
def lacking_slopes(hessian, slopes_by, steps, out):
    """-(slopes + H steps), (n, p)."""
    n, count = steps.shape
    for i in range(n):
        for k in range(count):
            out[i, k] = -slopes_by[i, k]
        for j in range(n):
            factor = hessian[i, j]
            if factor != 0.0:
                for k in range(count):
                    out[i, k] -= factor * steps[j, k]


@kernel(inner=True, allocates=True)
def add_free_steps(hessian, free, lacking, steps):
    """Add the steps along free motions (n, d) that balance what is lacking; whether the curvature is no doubt."""
    n, d = free.shape
    count = steps.shape[1]
    form, across, amounts = np.zeros((d, d)), np.zeros((n, d)), np.zeros((d, count))
    largest = 1.0
    for i in range(n):
        for j in range(n):
            factor = hessian[i, j]
            largest = max(largest, abs(factor))
            for a in range(d):
                across[i, a] += factor * free[j, a]
    for i in range(n):
        for a in range(d):
            for b in range(d):
                form[a, b] += free[i, a] * across[i, b]
            for k in range(count):
                amounts[a, k] += free[i, a] * lacking[i, k]
    for a in range(d):
        for b in range(a + 1):
            total = 0.5 * (form[a, b] + form[b, a])
            for c in range(b):
                total -= form[a, c] * form[b, c]
            if a > b:
                form[a, b] = total / form[b, b]
            elif total > CURVED * largest:
                form[a, a] = math.sqrt(total)
            else:
                return False
        # What is above the diagonal is read no more in this row.
    forward_rows(form, d, amounts)
    backward_rows(form, d, amounts)
    for i in range(n):
        for a in range(d):
            factor = free[i, a]
            for k in range(count):
                steps[i, k] += factor * amounts[a, k]
    return True


@kernel(inner=True, allocates=True)
def least_forces(lower, rank, pulls, forces, shared, along):
    """The least forces (r, p) of rows of length one that pull as much, and those in balance with each other (r, r).

    `pulls` are in the basis of the rows, (rank, p) first.
    """
    r, count = forces.shape
    if rank == r:
        for i in range(r):
            for k in range(count):
                forces[i, k] = pulls[i, k]
        backward_rows(lower, rank, forces)
        return
    across, reflections, order = np.zeros((rank, r)), np.zeros((rank, r + 1)), np.empty(rank, np.int64)
    for i in range(rank):
        for j in range(r):
            across[i, j] = lower[j, i]
    factorize_rows(across, reflections, order, False)
    for i in range(r):
        for k in range(count):
            forces[i, k] = pulls[i, k] if i < rank else 0.0
        for k in range(r - rank):
            shared[i, k] = 1.0 if i == rank + k else 0.0
    forward_rows(across, rank, forces)
    reflect_back(reflections, rank, forces, along)
    reflect_back(reflections, rank, shared, along)


@kernel(
    signatures="(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])",
    allocates=True,
)
def least_steps(jacobian, hessian, rows_by, slopes_by, steps, forces, free, shared):
    """Write what `kkt.Moves` has; returns the rank and how many parameters contradict, or (-1, 0): it is not clear.

    Parameters
    ----------
    jacobian, hessian, rows_by, slopes_by : (r, n), (n, n), (r, p), (n, p)
        Rows that hold, and what a unit of each parameter adds.
    steps, forces : (n, p), (r, p)
        Written; a step is no number where rows contradict each other.
    free, shared : (n, n), (r, r)
        Written; the first n - rank and r - rank columns count.
    """
    r, n = jacobian.shape
    count = rows_by.shape[1]
    lower, reflections, order = np.empty((r, n)), np.zeros((r, n + 1)), np.empty(r, np.int64)
    scales, along = np.zeros(r), np.empty(max(count, n, r))
    for i in range(r):
        square = 0.0
        for j in range(n):
            square += jacobian[i, j] * jacobian[i, j]
        length = math.sqrt(square)
        if NONE < length < SOME:
            return -1, 0
        scales[i] = 1.0 / length if length > NONE else 0.0
        for j in range(n):
            lower[i, j] = jacobian[i, j] * scales[i]
    rank = factorize_rows(lower, reflections, order, True)
    if rank < 0:
        return -1, 0
    asked = np.empty((r, count))
    for i in range(r):
        row = order[i]
        scale = scales[row] if scales[row] > 0.0 else 1.0
        for k in range(count):
            asked[i, k] = -scale * rows_by[row, k]
    sizes = np.zeros(count)
    for i in range(r):
        for k in range(count):
            sizes[k] = max(sizes[k], abs(asked[i, k]))
    forward_rows(lower, rank, asked)
    contradicting = 0
    for k in range(count):
        off = 0.0
        for i in range(rank, r):
            left = asked[i, k]
            for j in range(rank):
                left -= lower[i, j] * asked[j, k]
            off = max(off, abs(left))
        contradicting += off > AGREE * max(sizes[k], AGREE)
        for i in range(n):
            steps[i, k] = asked[i, k] if i < rank else 0.0
        if off > AGREE * max(sizes[k], AGREE):
            steps[0, k] = math.nan
    reflect_back(reflections, rank, steps, along)
    lacking = np.empty((n, count))
    if rank < n:
        d = n - rank
        basis = np.zeros((n, d))
        for a in range(d):
            basis[rank + a, a] = 1.0
        reflect_back(reflections, rank, basis, along)
        lacking_slopes(hessian, slopes_by, steps, lacking)
        if not add_free_steps(hessian, basis, lacking, steps):
            return -1, 0
        for i in range(n):
            for a in range(d):
                free[i, a] = basis[i, a]
    lacking_slopes(hessian, slopes_by, steps, lacking)
    for k in range(rank):
        reflect(reflections[k], reflections[k, n], lacking, k, along)
    scaled, ways = np.zeros((r, count)), np.zeros((r, max(r - rank, 0)))
    least_forces(lower, rank, lacking, scaled, ways, along)
    for i in range(r):
        row = order[i]
        for k in range(count):
            forces[row, k] = scales[row] * scaled[i, k]
        for k in range(r - rank):
            shared[row, k] = scales[row] * ways[i, k]
    return rank, contradicting
