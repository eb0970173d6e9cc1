"""The step that rows and an objective ask for per unit of each parameter: a fast `kkt.solve_system` for clear cases.

The rows are scaled to length one and factorized as J = P^T L Q^T, with pivoting by row length and Householder
reflections. The step that rows ask for follows by forward substitution, the last columns of Q are the free motions, and
forces follow by back substitution. Dependent rows share a force by a second factorization. The rank, and the curvature
along free motions, are clear where no pivot is near its threshold; else no answer is given and singular values decide.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel

# Pivots of rows of length one: at most NONE they count as zero, from SOME on as nonzero; between, the rank is unclear.
NONE, SOME = 1e-9, 1e-5
# Pivots of the curvature along free motions, over the largest entry of the Hessian: those above are surely positive.
CURVED = 1e-6
# Relative difference up to which the demands of dependent rows agree.
AGREE = 1e-7


@kernel(inner=True)
def reflect(v, beta, rows, first, along):
    """Apply I - beta v v^T, whose v begins at `first`, to the columns of an array (n, p)."""
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
def reflect_on(v, beta, columns, k, along, squares):
    """Reflect the columns behind the k-th, and write the squared lengths of their parts below entry k.

    These are summed anew every time: what is left of a dependent row is only the rounding of its length.
    """
    count = columns.shape[1]
    for i in range(k + 1, count):
        along[i] = squares[i] = 0.0
    for j in range(k, columns.shape[0]):
        factor = beta * v[j]
        for i in range(k + 1, count):
            along[i] += factor * columns[j, i]
    for i in range(k + 1, count):
        columns[k, i] -= v[k] * along[i]
    for j in range(k + 1, columns.shape[0]):
        factor = v[j]
        for i in range(k + 1, count):
            left = columns[j, i] - factor * along[i]
            columns[j, i] = left
            squares[i] += left * left


@kernel(inner=True)
def write_squares(columns, squares):
    """Squared lengths of rows, the columns of an array (n, r)."""
    for i in range(columns.shape[1]):
        squares[i] = 0.0
    for j in range(columns.shape[0]):
        for i in range(columns.shape[1]):
            squares[i] += columns[j, i] * columns[j, i]


@kernel(inner=True)
def factorize_rows(upper, reflections, order, choose, room):
    """Factorize rows, the columns of `upper` (n, r), as L Q^T in place: `upper` becomes L^T. Returns the rank, or -1.

    The last column of `reflections` has their factors. With `choose` the row with the longest remainder comes next, and
    the factorization ends where that is negligible. Rows are stored as columns so that sums run over all side by side.
    """
    n, r = upper.shape
    along, squares = room
    rank = min(r, n)
    for k in range(r):
        order[k] = k
    write_squares(upper, squares)
    for k in range(min(r, n)):
        best = k
        for i in range(k + 1, r if choose else k + 1):
            if squares[i] > squares[best]:
                best = i
        length = math.sqrt(squares[best])
        if length <= NONE:
            rank = k
            break
        if choose and length < SOME:
            return -1
        if best != k:
            for j in range(n):
                upper[j, k], upper[j, best] = upper[j, best], upper[j, k]
            order[k], order[best] = order[best], order[k]
        pivot = -length if upper[k, k] > 0.0 else length
        v = reflections[k]
        for j in range(k, n):
            v[j] = upper[j, k]
        # |v|^2 of v = x - pivot e with |x| = |pivot|.
        beta = 1.0 / (length * (length + abs(v[k])))
        v[k] -= pivot
        v[n] = beta
        reflect_on(v, beta, upper, k, along, squares)
        upper[k, k] = pivot
        for j in range(k + 1, n):
            upper[j, k] = 0.0
    return rank


@kernel(inner=True)
def reflect_back(reflections, rank, rows, along):
    """Q times `rows` (n, p), in place; `along` is scratch for one row."""
    n = rows.shape[0]
    for k in range(rank - 1, -1, -1):
        reflect(reflections[k], reflections[k, n], rows, k, along)


@kernel(inner=True)
def forward_rows(upper, rank, rows):
    """Multiply the first `rank` rows by L^-1 in place; `upper` is L^T."""
    for i in range(rank):
        for j in range(i):
            factor = upper[j, i]
            for k in range(rows.shape[1]):
                rows[i, k] -= factor * rows[j, k]
        over = 1.0 / upper[i, i]
        for k in range(rows.shape[1]):
            rows[i, k] *= over


@kernel(inner=True)
def backward_rows(upper, rank, rows):
    """Multiply the first `rank` rows by L^-T in place; `upper` is L^T."""
    for i in range(rank - 1, -1, -1):
        for j in range(i + 1, rank):
            factor = upper[i, j]
            for k in range(rows.shape[1]):
                rows[i, k] -= factor * rows[j, k]
        over = 1.0 / upper[i, i]
        for k in range(rows.shape[1]):
            rows[i, k] *= over


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
    """Add the steps along free motions (n, d) that balance `lacking`. Returns whether curvature is surely positive."""
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
                total -= form[c, a] * form[c, b]
            if a > b:
                form[b, a] = total / form[b, b]
            elif total > CURVED * largest:
                form[a, a] = math.sqrt(total)
            else:
                return False
        # The factor is above the diagonal; what is below it in this column is not read again.
    forward_rows(form, d, amounts)
    backward_rows(form, d, amounts)
    for i in range(n):
        for a in range(d):
            factor = free[i, a]
            for k in range(count):
                steps[i, k] += factor * amounts[a, k]
    return True


@kernel(inner=True, allocates=True)
def least_forces(upper, rank, pulls, forces, along):
    """The least forces (r, p) of rows of length one that balance `pulls`, whose first rows are in the rows' basis."""
    r, count = forces.shape
    for i in range(r):
        for k in range(count):
            forces[i, k] = pulls[i, k] if i < rank else 0.0
    if rank == r:
        backward_rows(upper, rank, forces)
        return
    # Dependent rows share a force: the transpose of L has `rank` rows, which are independent.
    across, reflections, order = np.zeros((r, rank)), np.zeros((rank, r + 1)), np.empty(rank, np.int64)
    for j in range(r):
        for i in range(rank):
            across[j, i] = upper[i, j]
    factorize_rows(across, reflections, order, False, (along, np.empty(rank)))
    forward_rows(across, rank, forces)
    reflect_back(reflections, rank, forces, along)


@kernel(inner=True, allocates=True)
def scale_rows(jacobian, scales, upper):
    """Write rows (r, n), scaled to length one, as columns, and the scales. Returns whether zero rows are clear."""
    r, n = jacobian.shape
    for i in range(r):
        for j in range(n):
            upper[j, i] = jacobian[i, j]
    write_squares(upper, scales)
    for i in range(r):
        length = math.sqrt(scales[i])
        if NONE < length < SOME:
            return False
        scales[i] = 1.0 / length if length > NONE else 0.0
    for j in range(n):
        for i in range(r):
            upper[j, i] *= scales[i]
    return True


@kernel(inner=True, allocates=True)
def least_steps(jacobian, hessian, rows_by, slopes_by, steps, forces, free):
    """Write the parts of `kkt.Moves`. Returns the rank and the number of contradicting parameters; (-1, 0) if unclear.

    Parameters
    ----------
    jacobian, hessian, rows_by, slopes_by : (r, n), (n, n), (r, p), (n, p)
        Active rows, the Hessian, and what a unit of each parameter adds to rows and slopes.
    steps, forces : (n, p), (r, p)
        Written; a step has a NaN where rows contradict each other. Where forces are not needed, they are (0, p).
    free : (n, n)
        Written; the first n - rank columns count.
    """
    r, n = jacobian.shape
    count = rows_by.shape[1]
    upper, reflections, order = np.empty((n, r)), np.zeros((r, n + 1)), np.empty(r, np.int64)
    scales, along = np.zeros(r), np.empty(max(count, n, r))
    if not scale_rows(jacobian, scales, upper):
        return -1, 0
    rank = factorize_rows(upper, reflections, order, True, (along, np.empty(r)))
    if rank < 0:
        return -1, 0
    asked, sizes = np.empty((r, count)), np.zeros(count)
    for i in range(r):
        row = order[i]
        scale = scales[row] if scales[row] > 0.0 else 1.0
        for k in range(count):
            asked[i, k] = -scale * rows_by[row, k]
            sizes[k] = max(sizes[k], abs(asked[i, k]))
    forward_rows(upper, rank, asked)
    contradicting = 0
    for k in range(count):
        off = 0.0
        for i in range(rank, r):
            left = asked[i, k]
            for j in range(rank):
                left -= upper[j, i] * asked[j, k]
            off = max(off, abs(left))
        for i in range(n):
            steps[i, k] = asked[i, k] if i < rank else 0.0
        if off > AGREE * max(sizes[k], AGREE):
            contradicting += 1
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
    if forces.shape[0] == 0:
        return rank, contradicting
    lacking_slopes(hessian, slopes_by, steps, lacking)
    for k in range(rank):
        reflect(reflections[k], reflections[k, n], lacking, k, along)
    scaled = np.zeros((r, count))
    least_forces(upper, rank, lacking, scaled, along)
    for i in range(r):
        row = order[i]
        for k in range(count):
            forces[row, k] = scales[row] * scaled[i, k]
    return rank, contradicting
