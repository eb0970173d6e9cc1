"""What corrected the tangent step of one solve, foreseen for the next one that goes its way or back.

Solutions are smooth functions of what is asked for. With the tangent t, the steps that follow come to
c = C(x) |t|^2 + O(|t|^3), and multipliers to r = R(x) |t|^2 + O(|t|^3), with C and R smooth along the way. Where the
next tangent is k t, k^2 (c + d) is added to it, d being how c changed from the solve before to this one: an error of
fourth order is left, of third order without d. To and fro, k = -1, the sum is what c was before. ("The step of a solve"
in the derivations.) A scene that is solved once, or in steps that lead elsewhere, has no correction.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.solve.linear_algebra.factorize import solve_step
from assembly.solve.loop.keep import add_kept_transposed, kept_times
from assembly.solve.loop.parameters import ASIDE, CHORD_SHIFT, FARTHER


@kernel(inner=True)
def ratio_of(course, step):
    """How many times the first step of the last solve a first step is; 0 if it leads elsewhere."""
    along = before = now = 0.0
    for i in range(step.size):
        along += step[i] * course.tangent[i]
        before += course.tangent[i] * course.tangent[i]
        now += step[i] * step[i]
    is_along = now * before - along * along <= ASIDE * ASIDE * along * along
    return along / before if is_along and before > 0.0 and abs(along) <= FARTHER * before else 0.0


@kernel(inner=True)
def leave_out_undetermined(kept, shape, rows, system):
    """Replace what corrected a tangent step by what equations determine of it; the system's step is worked in.

    With D and R what came to the tangent step and to the multipliers, it is the solution of the step's system for

        [ H   A^T ] [ D ]
        [ A    0  ] [ R ]

    that is foreseen. Directions that no row and no objective determines, and multipliers of rows that repeat each
    other, drop out: they would be foreseen, never undone, and grow from solve to solve.
    """
    course, off = kept.course, system.directions.step
    for i in range(off.size):
        off[i] = CHORD_SHIFT * course.correction[i]
    for r in range(rows.count):
        rows.forces[r] = -course.forces[r]
    add_kept_transposed(shape.bases, kept.factor_jacobian, rows.count, rows.forces, off)
    solve_step(system.factor, off.size, shape.sparsity, off)
    for r in range(rows.count):
        course.forces[r] = -kept.weights[r] * kept_times(shape.bases, kept.factor_jacobian, r, off)
    for i in range(off.size):
        course.correction[i] -= off[i]


@kernel(inner=True)
def foresee(sums, before, ratios):
    """Foresee the next sum from the last one, in `sums`, and the one before, to scale; write it and the last one there.

    The ratios are those of the last step to the one before, and of the next one to the last. The first one is 0 where
    nothing is known of a solve before.
    """
    last, next_ = ratios
    for i in range(sums.size):
        change = last * (sums[i] - before[i]) if last != 0.0 else 0.0
        before[i] = next_ * next_ * sums[i]
        sums[i] = before[i] + next_ * next_ * change


@kernel(inner=True)
def add_correction(kept, shape, left, rows, system):
    """Add to a tangent step what is foreseen to correct it. Returns the ratio of the step to the last solve's, or 0.

    Solutions are smooth functions of what is asked for. What their terms of higher order add to the tangent step goes
    with the square of its length, and changes from pose to pose as it did before.
    """
    course, step = kept.course, system.directions.step
    ratio = ratio_of(course, step) if left.corrected == 1.0 else 0.0
    for i in range(step.size):
        course.tangent[i] = step[i]
    if ratio == 0.0:
        course.correction[:], course.forces[:] = 0.0, 0.0
        return 0.0
    leave_out_undetermined(kept, shape, rows, system)
    foresee(course.correction, course.before, (left.ratio, ratio))
    foresee(course.forces, course.forces_before, (left.ratio, ratio))
    for i in range(step.size):
        step[i] = course.tangent[i] + course.correction[i]
    return ratio


@kernel(inline=True)
def follow_course(course, rows, step, is_first):
    """Add what corrects multipliers to those of a first step, or a later step to what came to the first one.

    In `forces` of the rows is what multipliers changed by with the step.
    """
    for r in range(rows.count):
        if is_first:
            rows.y[r] += course.forces[r]
        else:
            course.forces[r] += rows.forces[r]
    if not is_first:
        for i in range(step.size):
            course.correction[i] += step[i]
