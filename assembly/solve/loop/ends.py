"""Coordinates of lifted pairs that are at an end of their patch: unknowns with bounds.

Where a pair is one of a continuum (a cylinder along a plane, two parallel shafts), its points may slide along it
together, and one of them may come to the end of its patch. Newton's method does not know the end: half of every step
would lead beyond it and be cut off, and the rows would close by half a step. A coordinate at an end beyond which the
merit decreases is therefore left out of the step, as in projected Newton methods (Bertsekas, "Projected Newton Methods
for Optimization Problems with Simple Constraints", 1982); then the other point makes the whole move.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.contact import contact_of, surface_of
from assembly.constraints.program.records import header_at
from assembly.geometry.splines.pole import limits
from assembly.solve.linear_algebra.factorize import solve_step


@kernel(inner=True)
def find_ends(program, current, directions):
    """Mark the coordinates of lifted pairs that are at an end beyond which the merit decreases."""
    store, bases = program.store, program.structure.bases
    ends, descent = directions.ends, directions.descent
    if ends.size == 0:
        return
    first = descent.size - ends.size
    for k in range(header_at(store.table, 0).contacts):
        for i in range(4 if bases[k, 2] >= 0 else 0):
            low, high, closed = limits(store, surface_of(contact_of(store.table, k), i // 2), i % 2)
            at, unknown = current.tracked[k, i], bases[k, 2] + i
            over = (at <= low and descent[unknown] < 0.0) or (at >= high and descent[unknown] > 0.0)
            ends[unknown - first] = 1.0 if over and closed == 0 else 0.0


@kernel(inner=True)
def hold_ends(system):
    """Make the rows and columns of the marked coordinates in the Hessian those of the identity."""
    ends, hessian = system.directions.ends, system.hessian
    first = system.gradient.size - ends.size
    for j in range(ends.size):
        if ends[j] == 1.0:
            k = first + j
            for i in range(first + ends.size):
                hessian[min(i, k), max(i, k)] = 0.0
            hessian[k, k] = 1.0


@kernel(inline=True)
def solve_within(system, order, right):
    """Solve the system in place for a right side; the marked coordinates stay where they are."""
    ends = system.directions.ends
    first = right.size - ends.size
    for j in range(ends.size):
        if ends[j] == 1.0:
            right[first + j] = 0.0
    solve_step(system.factor, right.size, order, right)
