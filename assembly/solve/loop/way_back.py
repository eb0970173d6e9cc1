"""The shortest way back onto the rows, where a solve or tick is out of time and they do not hold yet."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.records import header_at
from assembly.proximity.extrema.face_face import BEND
from assembly.solve.loop.clearances import is_too_far
from assembly.solve.loop.multipliers import toward_rows
from assembly.solve.loop.parameters import ASTRAY, LEAST_SHARE, SHORTENED
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.residuals import move
from assembly.solve.loop.settings import RUNNING, STALLED
from assembly.solve.loop.violation import off_rows

# State of the way back, and of a loop without progress (`standstill.py`).
WAY_RECORD = record_dtype(
    "f8",
    softness=1,  # of the last step back
    share=1,  # of the next step back that is taken
    lowest=1,  # least violation so far
    led_off=1,  # 1: the last step led farther off
    stills=1,  # whole steps in a row that changed nothing
    slow_steps=1,  # whole steps in a row that gained little
    drags=1,  # steps of any length in a row that left the violation as it was
    nearby=1,  # 1: steps that restore rows are no longer than a neighborhood
)
way_at = record_view(WAY_RECORD)
WAY = size_of(WAY_RECORD)


@kernel(inline=True)
def way_back(program, current, trial, rows, system, progress, enough, tick):
    """Take a share of the least step that leaves little of the violation, into the trial point.

    Returns the violation there: infinite if motion bounds do not allow it, or a pair is lost.
    """
    store, shape, lifted, step = program.store, program.structure, program.lifted, system.directions.step
    progress.softness = toward_rows(program, current, rows, system, progress.softness, enough)
    move(store.table, current.q, step, progress.share, trial.q)
    predict_pairs(store, shape.bases, lifted, current, trial, step, progress.share)
    if header_at(store.table, 0).manager_record >= 0 and is_too_far(store, lifted.memory, trial):
        return math.inf
    if evaluate(program, lifted.guess, BEND, trial) >= 0:
        return math.inf
    return off_rows(store.table, lifted, shape.one_sided, trial, tick)


@kernel(inner=True)
def begin_way(way):
    """Reset the counts of steps and the least violation, because rows have changed."""
    progress = way_at(way, 0)
    progress.share = 1.0
    progress.lowest = math.inf
    progress.led_off = 0.0
    progress.stills = 0.0
    progress.slow_steps = 0.0
    progress.drags = 0.0
    progress.nearby = 0.0


@kernel(inline=True)
def step_back(program, iterates, rows, system, way, violation, enough, tick):
    """A step on the way back, into the trial point; whether it is to be taken. If not, the next one is shorter."""
    progress = way_at(way, 0)
    if violation < progress.lowest:
        progress.lowest = violation
        progress.led_off = 0.0
    there = way_back(program, iterates.current, iterates.trial, rows, system, progress, enough, tick)
    nearer = there < progress.lowest
    if not nearer and not (tick and there < ASTRAY * progress.lowest and progress.led_off == 0.0):
        progress.share *= SHORTENED
        return False
    progress.led_off = 0.0 if nearer else 1.0
    progress.share = min(progress.share / SHORTENED, 1.0)
    return True


@kernel(inline=True)
def lead_to_rows(task, iterates, rows, system):
    """A step of the shortest way back onto the rows, out of time. Whether the trial iterate is the next one."""
    loop, way = task.loop, task.way
    enough = 0.1 * loop.feasible
    taken = step_back(task.program, iterates, rows, system, way, loop.violation, enough, task.tick)
    loop.measured = taken
    if taken:
        for r in range(rows.count):
            rows.better_y[r] = rows.y[r]
    elif way_at(way, 0).share < LEAST_SHARE:
        loop.status = STALLED if loop.ended == RUNNING else loop.ended
        return False
    loop.alpha = 1.0
    loop.iteration += 1
    return taken
