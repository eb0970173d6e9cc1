"""All derivatives of a solution in one call: its equations, the active rows, the steps, and how measures change."""

from __future__ import annotations

import numpy as np

from assembly._carve import carve
from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.derivatives.least_steps import least_steps
from assembly.derivatives.linearized import linearize, plan_at

# The limits, among the figures of a plan, that decide which rows are active.
LIMITS = record_dtype(
    "f8",
    touching=1,  # a one-sided row whose residual is at most this in size is at its bound
    pushing=1,  # a larger force (multiplier) pushes
    unbalanced=1,  # where a slope of the Lagrangian is larger, the point is not stationary
    free=1,  # a measure that free motions change by more (over its largest slope, at least 1) is undetermined
)
limits_at = record_view(LIMITS)
LIMITS_SIZE = size_of(LIMITS)


@kernel(inner=True)
def list_held(plan, table, limits, seen, held):
    """List the active rows, by residuals and forces. Returns how many, or -1: one is at its bound without a force."""
    residual, forces = seen
    count = 0
    for r in range(plan.rows):
        if table[plan.one_sided + r] == 1:
            if not abs(residual[r]) <= limits.touching:
                continue
            if not forces[r] < -limits.pushing:
                return -1
        held[count] = r
        count += 1
    return count


@kernel(inner=True)
def write_rates(slopes, own, steps, rates):
    """Write how measures (k,) change with parameters: through the steps, and directly (`own`)."""
    for i in range(rates.shape[0]):
        for r in range(rates.shape[1]):
            rates[i, r] = own[i, r]
        for j in range(slopes.shape[1]):
            factor = slopes[i, j]
            if factor != 0.0:
                for r in range(rates.shape[1]):
                    rates[i, r] += factor * steps[j, r]
        # No negative zeros.
        for r in range(rates.shape[1]):
            rates[i, r] += 0.0


@kernel(inner=True)
def write_loose(slopes, free, motions, limit, loose):
    """Write 1 for measures that one of the free motions changes, the first `motions` columns of `free` (n, n)."""
    for i in range(slopes.shape[0]):
        most, largest = 0.0, 1.0
        for j in range(slopes.shape[1]):
            largest = max(largest, abs(slopes[i, j]))
        for a in range(motions):
            change = 0.0
            for j in range(slopes.shape[1]):
                change += slopes[i, j] * free[j, a]
            most = max(most, abs(change))
        loose[i] = 1.0 if most > limit * largest else 0.0


@kernel(
    signatures="(i8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1])",
    allocates=True,
)
def derive(table, pool, state, figures, forces, evaluated, out):
    """Write all derivatives of a solution. Returns the rank of the active rows, or -1: the general method is needed.

    Parameters
    ----------
    table, pool, state, figures, forces, evaluated
        As `linearize` takes them.
    out
        Written: the equations, as `linearize` does; the rates of measures (k, p), those of gaps and slides over the
        scene's size; steps (n, p); forces (m, p), zeros where the least move is asked for; of every measure whether a
        free motion changes it (k,); of every parameter the objective's slope (p,).
    """
    plan = plan_at(table, 0)
    m, e, n, p, k = plan.rows, plan.coordinates, plan.unknowns, plan.parameters, plan.measured
    limits = limits_at(figures, plan.limits)
    out[:] = 0.0
    if not linearize(table, pool, state, figures, forces, evaluated, out):
        return -1
    hessian_at = (m + e) * n
    rows_by_at = hessian_at + n * n
    slopes_by_at = rows_by_at + (m + e) * p
    slopes_at = slopes_by_at + n * p + p
    own_at = slopes_at + k * n
    end = own_at + k * p + n + 1
    if out[end - 1] > limits.unbalanced:
        return -1
    held = np.empty(m, np.int64)
    r = list_held(plan, table, limits, (carve(evaluated, 1, (m,)), forces), held)
    if r < 0:
        return -1
    rows, rows_by = carve(out, 0, (m, n)), carve(out, rows_by_at, (m, p))
    jacobian, asked, pulls = np.empty((r, n)), np.empty((r, p)), np.empty((0 if plan.implicit == 1 else r, p))
    for i in range(r):
        for j in range(n):
            jacobian[i, j] = rows[held[i], j]
        for j in range(p):
            asked[i, j] = rows_by[held[i], j]
    slopes, free = carve(out, slopes_at, (k, n)), np.empty((n, n))
    rates, steps = carve(out, end, (k, p)), carve(out, end + k * p, (n, p))
    rank, contradicting = least_steps(
        jacobian,
        carve(out, hessian_at, (n, n)),
        asked,
        carve(out, slopes_by_at, (n, p)),
        steps,
        pulls,
        free,
    )
    if rank < 0 or contradicting > 0:
        return -1
    write_rates(slopes, carve(out, own_at, (k, p)), steps, rates)
    every, at = carve(out, end + (k + n) * p, (m, p)), end + (k + n + m) * p
    for i in range(pulls.shape[0]):
        for j in range(p):
            every[held[i], j] = pulls[i, j]
    write_loose(slopes, free, n - rank if plan.implicit == 1 else 0, limits.free, carve(out, at, (k,)))
    values = carve(out, slopes_by_at + n * p, (p,))
    for j in range(p):
        total = values[j]
        for i in range(m):
            total += forces[i] * rows_by[i, j]
        out[at + k + j] = total + 0.0
    return rank
