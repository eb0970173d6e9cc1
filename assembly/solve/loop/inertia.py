"""Second-order information from factorizations: whether no curvature is negative along motions that keep the rows.

With H the Hessian of the Lagrangian, J the rows that push and Z a basis of the motions that keep them, Z^T H Z has no
eigenvalue below -d if H + J^T J / mu + d I has a Cholesky factor, whatever mu is (Debreu, Finsler). The last step of a
solve has computed such a factor. One-sided rows at their bound with a zero multiplier must not be in J: they allow
motions to one side, and J^T J / mu would add curvature to these.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.records import header_at
from assembly.constraints.program.row_terms import add_row_terms
from assembly.solve.linear_algebra.factorize import factorize_shifted
from assembly.solve.loop.line_search import goal
from assembly.solve.loop.multipliers import strongest
from assembly.solve.loop.parameters import CLEAR_SHIFT, IDLE, LEAST_SHIFT, NEAR, NEAR_END, SMALL_SHIFT, WEAK
from assembly.solve.loop.settings import SOLVED, UNSURE, results_at, settings_at
from assembly.solve.loop.workspace import penalized

# What a factorization shows: negative curvature near an end (DOWNWARD), or nothing (UNKNOWN).
DOWNWARD, UNKNOWN = -2.0, -1.0
# 2^31 - 1: squares of what is below it are integers of 64 bits.
PRIME = 2147483647


@kernel(inner=True)
def checksum_of_rows(count, one_sided, weights, least):
    """A checksum of the one-sided rows whose weight is above the least.

    The sum of a polynomial of degree 16 in their numbers, modulo a prime. With low powers many sets have the same sum
    (3^2 + 4^2 = 5^2); with this polynomial the probability that two sets do is about one in 2^31.
    """
    total = 0.0
    for r in range(count):
        if one_sided[r] == 1 and weights[r] > least:
            number = r + 1
            for _ in range(4):
                number = (number * number + 12345) % PRIME
            total += number
    return total


@kernel(inner=True)
def note_factor(results, rows, one_sided, shift, dual, restoring):
    """Record what the new factorization of a step of a solve shows: whether it is convex.

    `curved` becomes 1 plus the checksum of its one-sided rows if it is, DOWNWARD if it needed a shift of CLEAR_SHIFT
    although the dual residual, which bounds the shift tried first, was less, and UNKNOWN otherwise.
    """
    result = results_at(results, 0)
    force = strongest(rows.y, rows.count)
    # Weak multipliers are left out of the matrix (`multipliers.curvature_multipliers`).
    bends = force >= WEAK or force <= IDLE
    if shift <= SMALL_SHIFT and dual <= NEAR_END and bends and not restoring:
        result.curved = 1.0 + checksum_of_rows(rows.count, one_sided, rows.active, 0.0)
    else:
        result.curved = DOWNWARD if shift >= CLEAR_SHIFT > dual and not restoring else UNKNOWN


@kernel(inner=True)
def told_convex(results, rows, one_sided, residual):
    """Whether the last factorization was convex, with the rows that push at the end, and no row only touches there."""
    result = results_at(results, 0)
    if not result.curved > 0.0:
        return False
    for r in range(rows.count):
        rows.forces[r] = -rows.y[r]
        if one_sided[r] == 1 and abs(residual[r]) <= NEAR and rows.y[r] >= -IDLE:
            return False
    return result.curved == 1.0 + checksum_of_rows(rows.count, one_sided, rows.forces, IDLE)


@kernel(inner=True)
def test_convexity(program, current, rows, system, shift):
    """Whether the matrix of the rows that push, shifted by so much, has a factor at this point."""
    shape, lagrangian = program.structure, system.hessian
    goal(program, rows.count, current, 1, system.gradient, lagrangian)
    for r in range(rows.count):
        rows.active[r] = 0.0 if shape.one_sided[r] == 1 and rows.y[r] >= -IDLE else 1.0 / rows.mu
    add_row_terms(program, current, rows.y, rows.active, lagrangian)
    return factorize_shifted(lagrangian, system.gradient.size, shape.sparsity, shift, system.factor) == shift


@kernel(inline=True)
def test_end(program, settings, results, status, current, rows, system):
    """The status of a solve that is SOLVED: UNSURE if no factorization shows that no curvature is negative.

    A tick keeps its status; its result says whether its end is a minimum. A first solve that ends where it began is
    UNSURE: higher orders may decide whether its end is a minimum. Scenes without an objective keep their status.
    """
    result = results_at(results, 0)
    limits = settings_at(settings, 0)
    store, shape = program.store, program.structure
    tick = limits.tick == 1.0
    if not tick and (status != SOLVED or header_at(store.table, 0).implicit == 1):
        return status
    mu = limits.penalty_floor
    if not tick:
        if result.curved == DOWNWARD or (result.curved == 0.0 and limits.penalty > mu):
            return UNSURE
        if told_convex(results, rows, shape.one_sided, current.residual):
            return status
    shift = 0.0 if tick else LEAST_SHIFT
    convex = test_convexity(program, current, penalized(rows, mu), system, shift)
    result.curved = 1.0 if convex else -1.0
    return status if tick or convex else UNSURE
