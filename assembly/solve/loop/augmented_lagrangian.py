"""The loop: a primal-dual augmented Lagrangian with exact Hessians, steps in twists.

Minimize f subject to c = 0 (or c >= 0), multipliers y of L = f + y.c (y <= 0 for c >= 0). One step solves

    [ H + d I   J^T  ] [ dx ]     [ grad f + J^T y ]
    [    J    -mu I  ] [ dy ] = - [       c        ],

with H the Hessian of L, by eliminating dy: (H + d I + J^T J / mu) dx = -(grad f + J^T (y + c / mu)). The Cholesky
factorization of that matrix tells its inertia; d is raised until it exists. dx descends on the augmented Lagrangian,
along which a line search runs (`solve/loop/line_search.py`); multipliers follow every step. -mu I makes redundant rows
harmless.

A step has six phases: observe (`observe.py`: which contacts there are), evaluate (`observe.py`: violation, objective,
multipliers), terminate (`terminate.py`), direction (`advance.py`, `direction.py`: the system above), line search
(`line_search.py`, which evaluates the rows at the next iterate) and accept (`advance.py`). Special cases have files of
their own: lifted pairs at folds (`contacts.py`) and at ends of patches (`ends.py`), the contact manager
(`clearances.py`), ticks and budgets (`deadline.py`), a return to the last feasible iterate (`rollback.py`), rows that
are restored alone (`restore.py`), the way back onto the rows (`way_back.py`), scattered bodies (`initial_guess.py`),
second order (`inertia.py`).
"""

from __future__ import annotations

import math

from assembly._carve import uncounted
from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.objective_terms import objective
from assembly.constraints.program.records import header_at, pool_header_at
from assembly.solve.loop.advance import accept, find_step, take_step
from assembly.solve.loop.begin import begin_loop, read_state, set_out
from assembly.solve.loop.chord import go_on_by_chords
from assembly.solve.loop.direction import cut_step
from assembly.solve.loop.finish import End, finish
from assembly.solve.loop.loop_state import Task, loop_at
from assembly.solve.loop.observe import evaluate_iterate, observe, rearrange_rows
from assembly.solve.loop.restore import choose_restoration, judge_restoring_step
from assembly.solve.loop.rollback import restart
from assembly.solve.loop.settings import CONTACT_LOST, OUT_OF_TIME, RUNNING, results_at, settings_at
from assembly.solve.loop.terminate import terminate
from assembly.solve.loop.way_back import lead_to_rows
from assembly.solve.loop.workspace import Iterates, carve_all, memory_of, results_of, rows_in


@kernel(
    signatures=(
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1], i8[::1], i8)",
        "(i8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1], i8[::1], none)",
    ),
)
def solve_program(table, pool, settings, state, history, doubles, integers, end_effectors):
    """Solve in place. State: q (n, 7) | tracked (k, TRACK) | multipliers (m) | residuals (m) | results | memory | kept.

    `doubles` and `integers` are two blocks of memory to work in (`workspace_needed`). `end_effectors` is None where no
    term of the objective is a dexterity.
    """
    table, pool, settings, state = uncounted(table), uncounted(pool), uncounted(settings), uncounted(state)
    history, doubles, integers = uncounted(history), uncounted(doubles), uncounted(integers)
    store = Store(table, pool)
    workspace = carve_all(store, memory_of(table, state), end_effectors, doubles, integers)
    results, limits = results_of(table, state), settings_at(settings, 0)
    tick, any_pose, watched = limits.tick == 1.0, limits.any_pose == 1.0, header_at(table, 0).manager_record >= 0
    task = Task(
        program=workspace.program,
        settings=settings,
        limits=limits,
        results=results,
        result=results_at(results, 0),
        told=workspace.told,
        way=workspace.way,
        loop=loop_at(workspace.loop, 0),
        room=workspace.room,
        tick=tick,
        watched=watched,
        any_pose=any_pose,
        leads_back=not tick and (watched or any_pose),
    )
    return run(task, workspace, state, history)


@kernel(inner=True)
def run(task, workspace, state, history):
    """The steps of a solve."""
    program, loop = task.program, task.loop
    system = workspace.system
    current, trial, held = workspace.iterates
    rows = begin(task, workspace, state, current, trial)
    if go_on_by_chords(task, history, state, workspace.iterates, rows, system):
        current, trial = trial, current
    header = header_at(program.store.table, 0)
    while loop.status == RUNNING or restart(task, held, current, rows):
        # Observe.
        rows = rows_in(loop, rows)
        observe(task, current, rows)
        if header.rows + 4 * loop.lifted != rows.count or loop.changed:
            rows, system = rearrange_rows(task, current, rows)
            if loop.folded and loop.lifts <= header.contacts:
                continue
        # Evaluate, terminate.
        if not evaluate_iterate(task, history, current, rows, system):
            continue
        if terminate(task, held, current, rows, system):
            continue
        if loop.ended != RUNNING or (task.tick and loop.iteration >= loop.limit):
            if lead_to_rows(task, Iterates(current, trial, held), rows, system):
                current, trial = trial, current
            continue
        # Direction.
        if not choose_restoration(task, rows, system):
            continue
        rows = rows_in(loop, rows)
        if not find_step(task, current, trial, rows, system):
            continue
        loop.slope, steepest = cut_step(program.structure, current, rows, system, loop.cut)
        if loop.restoring:
            is_taken, is_next = judge_restoring_step(task, Iterates(current, trial, held), system, steepest)
            if is_next:
                current, trial = trial, current
            if not is_taken:
                continue
        # Line search, accept.
        if take_step(task, current, trial, rows, system):
            accept(task, current, trial, rows, system)
            current, trial = trial, current
    return tell(task, state, Iterates(current, trial, held), rows_in(loop, rows), system)


@kernel(inline=True)
def begin(task, workspace, state, current, trial):
    """The first iterate, with its contacts, and the rows there."""
    program, loop, limits = task.program, task.loop, task.limits
    store, system = program.store, workspace.system
    loop.rows, loop.mu = header_at(store.table, 0).rows, limits.penalty
    rows = rows_in(loop, workspace.rows)
    read_state(store, state, current, trial, rows)
    begin_loop(task, current)
    unknowns = 6 * header_at(store.table, 0).moving
    loop.status, loop.lost, loop.folded = set_out(program, task.settings, state, current, rows, unknowns)
    if loop.status == CONTACT_LOST:
        loop.value = objective(
            store, current.q, 0, program.tapes, program.structure.sparsity, system.gradient, system.hessian
        )
    loop.changed = task.watched and limits.gather > 0.0 and task.result.scatter == 1.0
    return rows


@kernel(inline=True)
def tell(task, state, iterates, rows, system):
    """Write the last iterate into the state and the results. Returns the status."""
    loop, result = task.loop, task.result
    if loop.folded and loop.status == CONTACT_LOST:
        loop.violation = math.inf
    if task.limits.carries == 1.0 and loop.status == OUT_OF_TIME and not loop.violation <= loop.feasible:
        result.carried = float(1 + loop.done + loop.iteration)
    at_end = End(loop.status, loop.value, loop.violation, loop.dual, loop.feasible, loop.holds == 1)
    status, value, violation, dual = finish(task.program, task.settings, state, iterates, rows, system, at_end)
    result.status = float(status)
    result.count = float(min(loop.iteration, loop.limit) if loop.ended != RUNNING else loop.iteration)
    result.objective = value
    result.violation = violation * pool_header_at(task.program.store.pool, 0).scale
    result.dual = dual
    return status
