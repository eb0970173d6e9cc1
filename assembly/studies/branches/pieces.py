"""Pieces of a branch: the rows that hold on each, and how the branch goes on from one to the next.

On a piece the equations are smooth. Where a one-sided row or a contact of a clearance comes to hold, or holds no more,
another one begins: with the rows that push, in the sense in which what has let go opens.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.studies.branches.curve import Curve, LostError, Place, Point
from assembly.studies.branches.events import Found
from assembly.studies.branches.slots import rows_of_slots
from assembly.studies.branches.surroundings import AT_BOUND, Surroundings

__all__ = ["ASTRAY", "BEYOND", "after_event", "begun", "beside", "handed_on"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# Singular values of the equations, over the largest, that are none where a branch begins.
FLAT = 1e-10
EXPECTED = "expected rows that determine the poses, or an objective that has one best pose"
# Forces that push, over the objective's unit; rates of gaps along a branch that are none.
PUSHING, STILL = 1e-9, 1e-9
# How far the corrector may lead, in parts of the step.
ASTRAY = 0.25
# Where a contact that holds ends is found to this, in parts of the size; others that take over are looked for so far
# beyond.
ENDED, BEYOND = 1e-12, 1e-6


def after_event(around: Surroundings | None, curve: Curve, event: Found) -> tuple[Curve, Point] | None:
    """The equations after an event at which rows come or go, and the point; None where the branch ends there."""
    place = event.place
    if around is None:
        return _switched(curve, event)
    own = _own(place)
    if not own[event.row]:
        return _switched(curve, event)
    if curve.held[event.row]:
        return _without_contacts(around, curve, place, curve.held & own & (place.forces > -PUSHING))
    closed = ~curve.held & own & (around.gaps(place) <= AT_BOUND)
    return _with_contacts(around, curve, place, closed)


def handed_on(
    around: Surroundings | None, curve: Curve, here: Point, least_step: float
) -> tuple[Point, float, int, tuple[Curve, Point]] | None:
    """Where a contact that holds ends a little beyond a point, and others take over there.

    A corner that leaves its face, say, which edges carry from then on. The last point, how far it is, the row that
    ends there, and the equations with a point beyond; None where there is nothing like that.
    """
    if around is None or not (curve.held & _own(here.place)).any():
        return None
    low, high, end = 0.0, 2.0 * least_step, here
    while high - low > ENDED:
        middle = 0.5 * (low + high)
        point = curve.corrected(here, middle * here.tangent)
        if point is not None and not around.ended(point.place, curve.held).any():
            low, end = middle, point
        else:
            high = middle
    beyond = curve.moved(end.place, BEYOND * end.tangent, end.basis)
    try:
        ended = around.ended(beyond, curve.held)
        if not (ended.any() and around.goes_to([end.place, beyond])):
            return None
        after = _pushing(around, curve, beyond, end)
    except LostError:
        return None
    return None if after is None else (end, low, int(np.flatnonzero(ended)[0]), after)


def beside(around: Surroundings, curve: Curve, place: Place) -> Place:
    """A start with those contacts of clearances as rows that touch, where an objective may push bodies together.

    Where rows alone determine poses, none is a row: bodies that come to touch block the branch.
    """
    if not around.begin(place):
        meets = " and ".join(around.in_the_way.bodies)
        raise InputError(f"start is a solution at which {meets} are not clear; expected a clear one")
    rows = np.zeros(place.packed.rows, dtype=np.bool_)
    if not place.packed.is_implicit:
        rows = np.abs(around.gaps(place)) <= AT_BOUND
    return around.holding(place, rows)


def _own(place: Place) -> Flags:
    """The rows (m,) of slots."""
    rows = np.zeros(place.packed.rows, dtype=np.bool_)
    rows[rows_of_slots(place.packed)] = True
    return rows


def _pushing(around: Surroundings, curve: Curve, place: Place, before: Point) -> tuple[Curve, Point] | None:
    """The equations at a place with those contacts that touch and push there, and the point, on from one before."""
    n = curve.columns.size
    held = (curve.held & ~_own(place)) | (around.gaps(place) <= AT_BOUND)
    while True:
        other = curve.with_rows(held, True)
        balanced = other.balanced(around.holding(place, held))
        pulling = held & place.packed.one_sided & (balanced.forces > -PUSHING)
        if not pulling.any():
            break
        held = held & ~pulling
    point = other.point(balanced)
    if len(point.equations) != len(point.tangent) - 1 or point.basis.shape[1] > n:
        return None
    along = point.tangent[:n] @ before.tangent[:n] + point.tangent[-1] * before.tangent[-1]
    border = (-1.0 if along < 0.0 else 1.0) * other.bordering(point.tangent)
    found = other.corrected(other.point(point.place, border, point.basis), np.zeros(len(point.tangent)))
    if found is None or np.abs(other.between(place, found.place)).max() > ASTRAY * BEYOND:
        return None
    return other, found


def _with_contacts(around: Surroundings, curve: Curve, place: Place, closed: Flags) -> tuple[Curve, Point] | None:
    """The equations with contacts that have closed (m,), of which those hold that push; None where they block all.

    Several may close at a place, those of an edge on a face say: all of them are rows at first, and those go that would
    pull along the branch then.
    """
    if place.packed.is_implicit:
        return None
    n = curve.columns.size
    while closed.any():
        held = curve.held | closed
        other = curve.with_rows(held, True)
        try:
            here = around.holding(place, held)
            balanced = here if curve.balances else other.balanced(here)
            point = other.point(replace(balanced, forces=np.where(held, balanced.forces, 0.0)))
        except LostError:
            return None
        if len(point.equations) != len(point.tangent) - 1 or point.basis.shape[1] > n:
            return None
        changes = np.zeros(len(held))
        changes[held] = point.basis @ point.tangent[n:-1]
        sign = -1.0 if changes[closed].sum() > 0.0 else 1.0
        pulling = closed & (sign * changes > STILL)
        if not pulling.any():
            return other, other.point(point.place, sign * other.bordering(point.tangent), point.basis)
        closed = closed & ~pulling
    return None


def _without_contacts(around: Surroundings, curve: Curve, place: Place, opened: Flags) -> tuple[Curve, Point] | None:
    """The equations without contacts (m,) that push no more; None where none of them would open.

    Several may open at a place, those of a face on another one say: none is a row at first, and those are again that
    would close along the branch then.
    """
    n = curve.columns.size
    while opened.any():
        held = curve.held & ~opened
        other = curve.with_rows(held, True)
        try:
            point = other.point(replace(place, forces=np.where(held, place.forces, 0.0)))
        except LostError:
            return None
        if len(point.equations) != len(point.tangent) - 1 or point.basis.shape[1] > n:
            return None
        rates = point.rates[opened]
        sign = -1.0 if rates.sum() < 0.0 else 1.0
        closing = sign * rates < -STILL
        if not closing.any():
            alone = around.holding(point.place, held)
            return other, other.point(alone, sign * other.bordering(point.tangent), point.basis)
        opened[np.flatnonzero(opened)[closing]] = False
    return None


def begun(curve: Curve, place: Place) -> tuple[Curve, Point]:
    """The equations that determine a branch at its start, and the start's point.

    Rows alone, where they do; else the objective, with the one-sided rows that push.
    """
    packed, n = place.packed, curve.columns.size
    point = curve.point(place)
    rank = point.basis.shape[1]
    if rank > n:
        raise InputError(f"{curve.parameter.name} cannot change: rows have no solution near the start")
    has_objective = not packed.is_implicit
    if rank == n and not has_objective:
        return curve, _settled(curve, point)
    if not has_objective:
        raise InputError(f"scene leaves {n - rank} motions free with {curve.parameter.name} given; {EXPECTED}")
    at_bound = packed.one_sided & (np.abs(point.residual) <= AT_BOUND)
    if rank == n and not at_bound.any():
        return curve, _settled(curve, point)
    held = ~packed.one_sided | at_bound
    for _ in range(int(at_bound.sum()) + 1):
        pushing = curve.with_rows(held, True)
        balanced = pushing.balanced(place)
        open_rows = held & packed.one_sided & (balanced.forces > -PUSHING)
        if not open_rows.any():
            break
        held = held & ~open_rows
    if not (held & packed.one_sided).any() and rank == n:
        return curve, _settled(curve, point)
    point = pushing.point(balanced)
    values = np.linalg.svd(point.matrix, compute_uv=False)
    flat = int(np.count_nonzero(values <= FLAT * values[0]))
    if flat:
        raise InputError(f"objective does not determine {flat} of the motions that rows leave free; {EXPECTED}")
    return pushing, _settled(pushing, point)


def _settled(curve: Curve, point: Point) -> Point:
    """The start itself, to the last digit."""
    found = curve.corrected(point, np.zeros(len(point.tangent)))
    if found is None:
        raise InputError("start is where branches cross, or a contact is at a fold; expected a pose near it")
    return found


def _switched(curve: Curve, event: Found) -> tuple[Curve, Point] | None:
    """The equations with a row more that pushes, or one less, and the point; None where the branch ends there."""
    row, place = event.row, event.place
    comes = not curve.held[row]
    if comes and not curve.balances and place.packed.is_implicit:
        return None
    held = curve.held.copy()
    held[row] = comes
    other = curve.with_rows(held, True)
    try:
        balanced = place if curve.balances else other.balanced(place)
        point = other.point(replace(balanced, forces=np.where(held, balanced.forces, 0.0)))
    except LostError:
        return None
    n = curve.columns.size
    # A row that comes is to push, one that goes is to open; the other direction is back where it came from.
    if comes:
        change = (point.basis @ point.tangent[n:-1])[int(held[:row].sum())]
        sign = -1.0 if change > 0.0 else 1.0
    else:
        sign = -1.0 if point.rates[row] < 0.0 else 1.0
    if len(point.equations) != len(point.tangent) - 1 or point.basis.shape[1] > n:
        return None
    return other, other.point(point.place, sign * other.bordering(point.tangent), point.basis)
