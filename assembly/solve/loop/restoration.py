"""The shortest way back onto the rows, where the time of a solve or a tick is over and they do not hold yet."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.records import header_at
from assembly.proximity.extrema.face_face import BEND
from assembly.solve.loop.clearances import is_too_far
from assembly.solve.loop.multipliers import toward_rows
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.residuals import move
from assembly.solve.loop.violation import off_rows

# A step is shortened by this where it leads farther off; a tick's may lead off by this once, if the next one leads
# back.
SHORTENED, ASTRAY, LEAST_SHARE = 0.25, 10.0, 1e-4
# What is known of the way back, and of a loop that stands still (`standstill.py`).
RESTORATION = record_dtype(
    "f8",
    softness=1,  # of the last step back
    share=1,  # of the next step back that is taken
    lowest=1,  # least violation so far
    led_off=1,  # 1: the last step led farther off
    stills=1,  # whole steps in a row that changed nothing
    slow_steps=1,  # whole steps in a row that gained little
    drags=1,  # steps of any length in a row that left what rows are off
    nearby=1,  # 1: steps that restore rows are no longer than a neighborhood
)
restoration_at = record_view(RESTORATION)
WAY = size_of(RESTORATION)


@kernel(inline=True)
def way_back(program, current, trial, rows, weights, mu, softness, share, enough, system, tick):
    """A share of the least step that leaves little of the gaps, into the trial point.

    `weights` is room for which rows count, and for forces. Returns the softness that the step took, and how far off the
    rows it leads: infinitely where bodies may not go so far, or a pair is lost.
    """
    store, shape, lifted, workspace = (
        program.store,
        program.structure,
        program.lifted,
        program.tapes,
    )
    header = header_at(store.table, 0)
    active, forces, _foreseen = weights
    step, lagrangian, matrix = system.directions.step, system.hessian, system.factor
    bases, one_sided = shape.bases, shape.one_sided
    n = step.size
    softness = toward_rows(
        shape,
        header.rows,
        rows,
        current.residual,
        current.jacobian,
        mu,
        active,
        softness,
        enough,
        lagrangian,
        matrix,
        n,
        forces,
        step,
    )
    move(store.table, current.q, step, share, trial.q)
    predict_pairs(store, bases, lifted, current, trial, step, share)
    if header.watch >= 0 and is_too_far(store, lifted.memory, trial):
        return softness, math.inf
    if evaluate(store, lifted.guess, BEND, lifted, workspace, trial) >= 0:
        return softness, math.inf
    return softness, off_rows(store.table, lifted, one_sided, trial, tick)


@kernel(inner=True)
def begin_way(way):
    """Rows have changed: what was found of steps and violations counts no more."""
    progress = restoration_at(way, 0)
    progress.share = 1.0
    progress.lowest = math.inf
    progress.led_off = 0.0
    progress.stills = 0.0
    progress.slow_steps = 0.0
    progress.drags = 0.0
    progress.nearby = 0.0


@kernel(inline=True)
def step_back(program, current, trial, rows, weights, mu, violation, enough, system, tick, way):
    """A step on the way back, into the trial point; whether it is to be taken. If not, the next one is shorter."""
    progress = restoration_at(way, 0)
    if violation < progress.lowest:
        progress.lowest = violation
        progress.led_off = 0.0
    progress.softness, there = way_back(
        program, current, trial, rows, weights, mu, progress.softness, progress.share, enough, system, tick
    )
    nearer = there < progress.lowest
    if not nearer and not (tick and there < ASTRAY * progress.lowest and progress.led_off == 0.0):
        progress.share *= SHORTENED
        return False
    progress.led_off = 0.0 if nearer else 1.0
    progress.share = min(progress.share / SHORTENED, 1.0)
    return True
