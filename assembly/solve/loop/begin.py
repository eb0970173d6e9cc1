"""How a solve begins: its state read, its contacts found, scattered bodies gathered."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.program.contact import is_clearance_row
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.objective_terms import recenter
from assembly.constraints.program.records import (
    header_at,
    pool_header_at,
)
from assembly.proximity.features.solid_contact import TRACK, contact_record_at, tracked_at
from assembly.proximity.manager.state import memory_header_at
from assembly.proximity.manager.update import AS_NEEDED, SPARING
from assembly.solve.loop.clearances import forget_clearance_rows, place_clearance_rows, update_around
from assembly.solve.loop.contacts import free_folds, is_of_surfaces, start_contacts
from assembly.solve.loop.initial_guess import assemble, scattered
from assembly.solve.loop.residuals import arrange
from assembly.solve.loop.settings import (
    ASSEMBLES,
    CONTACT_LOST,
    GATHERED,
    RUNNING,
    results_at,
    settings_at,
)
from assembly.solve.loop.warm_start import warm_start
from assembly.solve.loop.workspace import results_of, unknowns


@kernel(inline=True)
def read_state(store, state, current, trial, y, better_y):
    """Poses, tracked values and multipliers of a state, scaled."""
    units = pool_header_at(store.pool, 0)
    header = header_at(store.table, 0)
    size = units.scale
    tracks = header.tracked
    o_tracked = 7 * header.bodies
    o_y = o_tracked + TRACK * tracks
    for b in range(header.bodies):
        for k in range(7):
            value = state[7 * b + k]
            if k < 3:
                value = (value - units.reference[k]) / size
            current.q[b, k] = value
            trial.q[b, k] = value
    recenter(store, current.q)
    for k in range(tracks):
        for i in range(TRACK):
            current.tracked[k, i] = state[o_tracked + TRACK * k + i]
    for k in range(header.contacts):
        # Before anything is evaluated no pair is near a fold.
        contact_record_at(current.records, k).fold = 1.0
    for r in range(header.rows):
        current.residual[r] = math.inf
        y[r] = state[o_y + r]
        better_y[r] = y[r]


@kernel(inner=True)
def let_touch(table, current, touching):
    """Let contacts of bodies that are in each other by no more than `touching` stay so: their rows hold."""
    for k in range(header_at(table, 0).contacts):
        pair = tracked_at(current.tracked, k)
        if is_clearance_row(table, k) or not current.residual[k] < 0.0:
            continue
        allowed = pair.allowed - current.residual[k]
        if allowed <= touching:
            pair.allowed = allowed
            current.residual[k] = 0.0


@kernel(inline=True)
def overlap_allowed(settings):
    """How far bodies of contacts may be in each other at the start of this solve and stay so.

    A solve or a tick that goes on from the last one has its allowance with its pairs, and gets none on top.
    """
    limits = settings_at(settings, 0)
    begins = limits.tick == 0.0 and limits.penalty > limits.penalty_floor
    return limits.touching if begins else 0.0


@kernel(inline=True)
def find_contacts(program, settings, state, current, by_row, n):
    """Find the contacts of the start and evaluate its rows, unless the last tick left them in its state.

    Bodies of a contact or a clearance that are in each other by no more than touching there may stay so.
    Returns the contact that has no pair, or -1, and whether that was told by evaluating the rows: which are not
    evaluated yet where a contact has no pair to begin with, or is at a fold.
    """
    limits = settings_at(settings, 0)
    store, shape, lifted, workspace = (
        program.store,
        program.structure,
        program.lifted,
        program.tapes,
    )
    header = header_at(store.table, 0)
    free, lengths, memory = lifted.free, lifted.lengths, lifted.memory
    memory_header = memory_header_at(memory, 0)
    y, better_y, active = by_row.y, by_row.better_y, by_row.active
    recalled, tick = int(limits.recall), limits.tick == 1.0
    watched = header.watch >= 0
    came = False
    if watched:
        place_clearance_rows(store.table, memory, current, y, better_y, free, True)
    lost = start_contacts(store, current.q, current.tracked, free, lengths)
    if watched and lost < 0:
        memory_header.overlap = limits.touching
        came = update_around(store, memory, current, SPARING if tick else AS_NEEDED)
        memory_header.overlap = 0.0
        place_clearance_rows(store.table, memory, current, y, better_y, free, False)
    count = free_folds(
        store, current.records, current.tracked, active, free, lengths, -1.0, -1, limits.free_trims == 1.0
    )
    if lost >= 0 or count > 0:
        return lost, False
    if watched:
        arrange(store.table, free, shape, header.rows, n)
    if recalled == 0 or came or not warm_start(store.table, state, recalled, current):
        lost = evaluate(store, current.tracked, math.inf, lifted, workspace, current)
        if lost < 0:
            let_touch(store.table, current, overlap_allowed(settings))
    return lost, True


@kernel(inner=True)
def put_together(program, current, by_row):
    """Gather scattered bodies, and begin again from there; returns the contact that has no pair, or -1."""
    store, shape, lifted, workspace = (
        program.store,
        program.structure,
        program.lifted,
        program.tapes,
    )
    header = header_at(store.table, 0)
    free, lengths, memory = lifted.free, lifted.lengths, lifted.memory
    y, better_y = by_row.y, by_row.better_y
    watched = header.watch >= 0
    assemble(store, shape.bases, header.slots, current)
    for k in range(header.contacts):
        current.tracked[k, 0] = math.nan
    if watched:
        forget_clearance_rows(store.table, memory)
        place_clearance_rows(store.table, memory, current, y, better_y, free, False)
    start_contacts(store, current.q, current.tracked, free, lengths)
    if watched:
        update_around(store, memory, current, AS_NEEDED)
        place_clearance_rows(store.table, memory, current, y, better_y, free, False)
    if header.implicit == 1:
        recenter(store, current.q)
    for r in range(header.rows):
        y[r] = 0.0
        better_y[r] = 0.0
    return evaluate(store, current.tracked, math.inf, lifted, workspace, current)


@kernel(inline=True, allocates=True)
def set_out(program, settings, state, current, by_row, n):
    """Find contacts, evaluate rows, gather what is scattered where the settings ask for it.

    Returns CONTACT_LOST, GATHERED or RUNNING, the contact that is lost or -1, and whether that one is at a fold, to be
    freed.
    """
    limits = settings_at(settings, 0)
    store, shape = program.store, program.structure
    results = results_of(store.table, state)
    result = results_at(results, 0)
    result.culprit = -1.0
    result.held = 0.0
    result.curved = 0.0
    tick = limits.tick == 1.0
    lost, evaluated = find_contacts(program, settings, state, current, by_row, n)
    # A tick begins where the last one ended: there a pair that Newton's method loses is at a fold.
    folded = lost >= 0 and evaluated and tick and is_of_surfaces(store.table, lost)
    status = CONTACT_LOST if lost >= 0 and not folded else RUNNING
    result.scatter = 1.0 if status == RUNNING and scattered(store.table, current.residual, shape.one_sided) else 0.0
    if limits.gather > 0.0 and result.scatter == 1.0:
        lost = put_together(program, current, by_row)
        folded = False
        status = GATHERED if limits.gather == ASSEMBLES else RUNNING
        status = CONTACT_LOST if lost >= 0 else status
    if status == CONTACT_LOST:
        result.culprit = float(lost)
    return status, np.int64(lost if folded else -1), folded


@kernel(inner=True, allocates=True)
def rearrange(program, count, before, current, y, better_y, active):
    """Rows and unknowns for other contacts or `count` free pairs, where there were `before` rows.

    Returns how many rows and unknowns there are, room for these, and which contact is lost at this point, or -1.
    """
    store, shape, lifted, workspace = (
        program.store,
        program.structure,
        program.lifted,
        program.tapes,
    )
    header = header_at(store.table, 0)
    for r in range(before, y.size):
        # New rows of tangency say nothing yet: least squares leave them out.
        y[r] = 0.0
        better_y[r] = 0.0
        active[r] = 0.0
    rows = header.rows + 4 * count
    n = 6 * header.moving + 4 * count
    arrange(store.table, lifted.free, shape, rows, n)
    system = unknowns(n, shape.sparsity)
    return rows, n, system, evaluate(store, current.tracked, math.inf, lifted, workspace, current)
