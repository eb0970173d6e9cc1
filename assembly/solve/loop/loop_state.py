"""What changes from step to step of the loop: one record, which each of its phases reads and writes.

What does not change is in a `Task`: the program, the settings, and which policies a solve has.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.solve.loop.parameters import BACK_STEPS

# Numbers of the loop; lengths are over the scene's size.
NUMBERS = record_dtype(
    "f8",
    violation=1,  # how far rows are off at the current iterate
    value=1,  # the objective there
    dual=1,  # the dual residual there
    last_violation=1,  # the violation a step ago
    last_dual=1,  # the dual residual a step ago
    mu=1,  # the penalty: the weight of a row that counts is 1 / mu
    floor=1,  # the penalty falls to this
    shift=1,  # of the Hessian, in the last step
    used_shift=1,  # of the last step's factor, which may be another one where it was shortened
    radius=1,  # how long a step may be
    leash=1,  # a second bound of its length, after a step by which bodies sank into each other; else infinite
    cut_length=1,  # a third one, while the motion bounds cut steps; else infinite
    longest=1,  # the largest component of the step, as far as it is tried
    slope=1,  # of the augmented Lagrangian along it
    cut=1,  # part of the step that is tried
    alpha=1,  # part of that which was taken
    check_violation=1,  # violation at the last check of whether it decreases
    entered=1,  # violation where restoring began
    restored=1,  # violation at the last step that restored rows; infinite after any other
    feasible=1,  # largest violation that counts as none
    farthest=1,  # bodies farther out than this may be moving away without bound
    updates=1,  # updates of the manager before this tick; infinitely many where they take their time (`deadline.py`)
)
# Counts and flags of the loop (1 or 0).
COUNTS = record_dtype(
    "i8",
    status=1,  # an outcome, or RUNNING
    over=1,  # 1: the solve ends with this status, and does not begin again
    iteration=1,
    limit=1,  # iterations at most
    longest_tick=1,  # iterations at most of a tick that does not hold
    done=1,  # iterations of the tick that this one goes on with
    begin=1,  # when this call began [ns]
    asked=1,  # when the caller was last asked whether to go on [ns]
    late=1,  # 1: time is over before every pair that is near was updated
    changed=1,  # 1: contacts of clearances are others than rows are placed for
    measured=1,  # 1: it is known which parts of their motion bounds bodies have used here
    rows=1,  # constraint residuals, with those of lifted pairs
    lifted=1,  # pairs whose coordinates are unknowns
    lifts=1,  # how often pairs were to be lifted
    lost=1,  # the contact that was lost, or -1
    folded=1,  # 1: it was lost before anything is known of its row
    first=1,  # 1: the first iterate holds, and which rows push there is not known
    may_go=1,  # 1: motion bounds cover the whole step
    cuts=1,  # steps in a row that motion bounds have cut
    stood=1,  # whole steps in a row that did not reduce the dual residual
    restoring=1,  # 1: steps are for the rows alone
    restorations=1,  # how often that began
    kicks=1,  # how often a saddle of the violation was left
    check_at=1,  # iteration of the next check of whether the violation decreases
    holds=1,  # 1: there is a last feasible iterate
    sunk=1,  # 1: bodies overlap deeply here, or without a row that shows it
    back_at=1,  # iteration that began at the last feasible iterate again
    begun=1,  # how often a solve without progress began again
    lingers=1,  # iterations since the violation was first at most 1e-9, without a user's objective
    ended=1,  # outcome of a solve whose further steps only lead back onto the rows, or RUNNING
    led_back_by=1,  # the last iteration of these steps back
    asked_at=1,  # iteration at which a tick updated the manager because of its step
    final_update_at=1,  # iteration after a final update that found other contacts
)
LOOP_STATE = np.dtype(NUMBERS.descr + COUNTS.descr)
loop_at = record_view(LOOP_STATE)
LOOP = size_of(LOOP_STATE)

# What does not change: the program, arrays and records of settings and results, workspace for poses in the user's
# coordinates, the state of the way back (`way_back.py`), the record of the loop, room for the system of a step (in
# `Workspace`); whether it is a tick, has a contact manager, accepts any pose at which rows hold, and leads failed
# solves back onto their rows.
Task = namedtuple("Task", "program settings limits results result told way loop room tick watched any_pose leads_back")


@kernel(inline=True)
def lead_back(loop, status):
    """The solve ends with this status; further steps only lead back onto the rows."""
    loop.ended = status
    loop.led_back_by = loop.iteration + BACK_STEPS
