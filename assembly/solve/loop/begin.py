"""The beginning of a solve: its state is read, its contacts are found, scattered bodies are assembled."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.program.contact import is_clearance_row, is_of_solids
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.kept import forget_factor, has_place, kept_in, take_rows
from assembly.constraints.program.objective_terms import recenter
from assembly.constraints.program.records import header_at, pool_header_at
from assembly.proximity.features.solid_contact import TRACK, contact_record_at, tracked_at
from assembly.proximity.manager.records import memory_header_at
from assembly.proximity.manager.update import AS_NEEDED, SPARING
from assembly.solve.loop.arrival import reach_of, rounding_at
from assembly.solve.loop.clearances import forget_clearance_rows, place_clearance_rows, update_around
from assembly.solve.loop.contacts import lift_folds, start_contacts
from assembly.solve.loop.deadline import begin_tick
from assembly.solve.loop.initial_guess import assemble, scattered
from assembly.solve.loop.parameters import EXTRA_TIME, FAR, PATIENCE
from assembly.solve.loop.report import read_tracked
from assembly.solve.loop.residuals import arrange
from assembly.solve.loop.settings import ASSEMBLES, CONTACT_LOST, GATHERED, RUNNING, results_at, settings_at
from assembly.solve.loop.way_back import begin_way, way_at
from assembly.solve.loop.workspace import carve_unknowns, resized, results_of


@kernel(inner=True)
def read_state(store, state, current, trial, rows):
    """Poses, tracked values and multipliers of a state, scaled."""
    units = pool_header_at(store.pool, 0)
    header = header_at(store.table, 0)
    size = units.scale
    o_y = 7 * header.bodies + TRACK * header.tracked
    for b in range(header.bodies):
        for k in range(7):
            value = state[7 * b + k]
            if k < 3:
                value = (value - units.reference[k]) / size
            current.q[b, k] = value
            trial.q[b, k] = value
    recenter(store, current.q)
    read_tracked(store.table, state, current.tracked)
    for k in range(header.contacts):
        # Before the first evaluation no pair counts as near a fold.
        contact_record_at(current.records, k).fold = 1.0
    for r in range(header.rows):
        current.residual[r] = math.inf
        rows.y[r] = state[o_y + r]
        rows.better_y[r] = rows.y[r]


@kernel(inner=True)
def let_touch(table, current, touching):
    """Let bodies in contact that overlap by no more than `touching` keep their overlap: their residuals become 0."""
    for k in range(header_at(table, 0).contacts):
        pair = tracked_at(current.tracked, k)
        if is_clearance_row(table, k) or not current.residual[k] < 0.0:
            continue
        allowed = pair.allowed - current.residual[k]
        if allowed <= touching:
            pair.allowed = allowed
            current.residual[k] = 0.0


@kernel(inline=True)
def goes_on_from_last(settings):
    """Whether this is a tick, or a solve from a solution: these begin at the end of the last one, with its pairs."""
    limits = settings_at(settings, 0)
    return limits.tick == 1.0 or limits.penalty <= limits.penalty_floor


@kernel(inline=True)
def overlap_allowed(settings):
    """The largest overlap at the start of this solve that bodies in contact may keep.

    A solve or a tick that continues the last one keeps the overlap its pairs were allowed, and gets no more.
    """
    return 0.0 if goes_on_from_last(settings) else settings_at(settings, 0).touching


@kernel(inline=True)
def find_contacts(program, settings, state, current, rows, n):
    """Find the contacts at the start and evaluate the rows there, unless the last solve or tick left rows in the state.

    Bodies of a contact or a clearance that overlap there by no more than `touching` may keep the overlap. Returns the
    contact that has no pair, or -1, and whether the rows were evaluated. They are not if a contact has no pair to start
    from, or if pairs are lifted: then rows have to be rearranged first.
    """
    limits = settings_at(settings, 0)
    store, lifted = program.store, program.lifted
    header = header_at(store.table, 0)
    free, lengths, memory = lifted.free, lifted.lengths, lifted.memory
    memory_header = memory_header_at(memory, 0)
    tick = limits.tick == 1.0
    kept = kept_in(store.table, state)
    watched = header.manager_record >= 0
    came = False
    if watched:
        place_clearance_rows(store.table, lifted, current, rows, True)
    lost = start_contacts(store, current.q, current.tracked, free, lengths)
    if watched and lost < 0:
        memory_header.overlap = limits.touching
        came = update_around(store, memory, current, SPARING if tick else AS_NEEDED)
        memory_header.overlap = 0.0
        place_clearance_rows(store.table, lifted, current, rows, False)
    count = lift_folds(store, lifted, current, rows.active, -1.0, -1, limits.lift_trims == 1.0)
    if lost >= 0 or count > 0:
        return lost, False
    if watched:
        arrange(store.table, free, program.structure, header.rows, n)
    knows = has_place(store.table, state)
    if came or not (knows and take_rows(store, state, kept, current)):
        if knows:
            forget_factor(store.table, state)
        lost = evaluate(program, current.tracked, math.inf, current)
        if lost < 0:
            let_touch(store.table, current, overlap_allowed(settings))
    return lost, True


@kernel(inner=True)
def put_together(program, current, rows):
    """Assemble scattered bodies, and begin again from there; returns the contact that has no pair, or -1."""
    store, lifted = program.store, program.lifted
    header = header_at(store.table, 0)
    free, lengths, memory = lifted.free, lifted.lengths, lifted.memory
    watched = header.manager_record >= 0
    assemble(store, program.structure.bases, header.unknown_blocks, current)
    for k in range(header.contacts):
        current.tracked[k, 0] = math.nan
    if watched:
        forget_clearance_rows(store.table, memory)
        place_clearance_rows(store.table, lifted, current, rows, False)
    start_contacts(store, current.q, current.tracked, free, lengths)
    if watched:
        update_around(store, memory, current, AS_NEEDED)
        place_clearance_rows(store.table, lifted, current, rows, False)
    if header.implicit == 1:
        recenter(store, current.q)
    for r in range(header.rows):
        rows.y[r] = 0.0
        rows.better_y[r] = 0.0
    return evaluate(program, current.tracked, math.inf, current)


@kernel(inline=True)
def set_out(program, settings, state, current, rows, n):
    """Find contacts, evaluate rows, assemble scattered bodies where the settings ask for it.

    Returns CONTACT_LOST, GATHERED or RUNNING; the contact that is lost at a fold and is to be lifted, or -1; and
    whether there is one.
    """
    limits = settings_at(settings, 0)
    store, shape = program.store, program.structure
    results = results_of(store.table, state)
    result = results_at(results, 0)
    result.culprit = -1.0
    result.last_feasible = 0.0
    result.curved = 0.0
    lost, evaluated = find_contacts(program, settings, state, current, rows, n)
    # A solve from a solution begins where the last one ended: a pair that Newton's method loses there is at a fold or
    # at the end of a patch, where its coordinates were unknowns.
    folded = lost >= 0 and evaluated and goes_on_from_last(settings) and not is_of_solids(store.table, lost)
    status = CONTACT_LOST if lost >= 0 and not folded else RUNNING
    result.scatter = 1.0 if status == RUNNING and scattered(store.table, current.residual, shape.one_sided) else 0.0
    if limits.gather > 0.0 and result.scatter == 1.0:
        lost = put_together(program, current, rows)
        if has_place(store.table, state):
            # The factor belongs to the end of the last solve, but the bodies have been moved since.
            forget_factor(store.table, state)
        folded = False
        status = GATHERED if limits.gather == ASSEMBLES else RUNNING
        status = CONTACT_LOST if lost >= 0 else status
    if status == CONTACT_LOST:
        result.culprit = float(lost)
    return status, np.int64(lost if folded else -1), folded


@kernel(inner=True)
def rearrange(program, count, rows, current, room):
    """Arrange rows and unknowns for changed contacts or `count` lifted pairs; carve the system of a step from `room`.

    Returns the rows, the system, and the contact that is lost at this point, or -1.
    """
    store, shape = program.store, program.structure
    header = header_at(store.table, 0)
    for r in range(rows.count, rows.y.size):
        # New rows of tangency have no multipliers yet: least squares leave them out.
        rows.y[r] = 0.0
        rows.better_y[r] = 0.0
        rows.active[r] = 0.0
    rows = resized(rows, header.rows + 4 * count)
    n = 6 * header.moving + 4 * count
    arrange(store.table, program.lifted.free, shape, rows.count, n)
    system = carve_unknowns(n, count, shape.sparsity, room)
    return rows, system, evaluate(program, current.tracked, math.inf, current)


@kernel(inline=True)
def begin_loop(task, current):
    """The record of the loop before its first step."""
    store, limits, loop = task.program.store, task.limits, task.loop
    memory = task.program.lifted.memory
    loop.begin, loop.done, loop.updates = begin_tick(store.table, task.settings, task.results, memory)
    loop.feasible = rounding_at(store, task.settings, current)
    loop.farthest = FAR * (1.0 + reach_of(store, current.q)) if limits.strays == 1.0 else math.inf
    loop.limit = int(limits.iterations) - loop.done
    loop.longest_tick = EXTRA_TIME * int(limits.iterations) - loop.done
    loop.status = loop.ended = RUNNING
    loop.violation = loop.value = loop.dual = math.inf
    loop.last_violation = loop.last_dual = math.inf
    loop.mu, loop.floor = limits.penalty, limits.penalty_floor
    # The first step of a tick needs about the shift of the last tick; half of it is tried first.
    loop.shift = 2.0 * task.result.first_shift if task.tick else 0.0
    loop.used_shift, loop.radius, loop.leash, loop.cut_length = 0.0, limits.radius, math.inf, math.inf
    loop.longest, loop.slope, loop.cut, loop.alpha = 0.0, 0.0, 1.0, 0.0
    loop.check_violation = loop.entered = loop.restored = math.inf
    loop.rows = header_at(store.table, 0).rows
    loop.over = loop.iteration = loop.asked = loop.late = loop.changed = 0
    loop.lifted = loop.lifts = loop.folded = loop.first = loop.cuts = loop.stood = 0
    loop.measured = loop.may_go = 1
    loop.restoring = loop.restorations = loop.kicks = loop.holds = loop.sunk = loop.begun = 0
    loop.lingers = loop.led_back_by = 0
    loop.lost = loop.back_at = loop.asked_at = loop.final_update_at = -1
    loop.check_at = PATIENCE
    way_at(task.way, 0).softness = 1e-2
    begin_way(task.way)
