"""Whether the objective of a solve that did not end goes on falling without bound, along poses that hold.

A solve that runs away never ends SOLVED, and where it stops says nothing. Looked at is the line on which it ran, from
where it was after half its steps to where it stopped, both put back onto the constraints, and on by powers of ten, past
all that a scene's own lengths may be. It is unbounded if constraints hold all along, as parts of how far bodies went,
and the objective falls from each power to the next, by no less than half of what it fell before. What nears a finite
value falls by less and less; what comes to a limit, or to a target however far away, does not hold, or rises.

Angles that went around go on around, by whole turns, as a screw does (one whose body has its origin on the axis: others
circle, and are no line). Contacts of two surfaces end somewhere, so that bodies of a contact may not move against each
other on the line; clearances and one-sided contacts hold where bodies are far apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.clearance import Clearance
from assembly.constraints.constraint import Constraint
from assembly.constraints.contact import Contact
from assembly.constraints.objectives import Objective
from assembly.constraints.packing import Packed
from assembly.constraints.trim_contact import TrimContact
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.proximity.solid_contact import TRACK
from assembly.solve.attempts import attempt
from assembly.solve.interruption import Interruption
from assembly.solve.jacobian import rows_of
from assembly.solve.options import Options
from assembly.solve.row_table import gradient_at
from assembly.solve.scene import Status
from assembly.solve.settings import ANY_POSE, COUNT, ITERATIONS, SOLVED

__all__ = ["Asked", "status_of"]

Array = NDArray[np.float64]
# A solve that ends otherwise has an answer, or nothing to go on from.
OPEN = (Status.ITERATION_LIMIT, Status.STALLED, Status.INFEASIBLE)
# Least way on the line, in sizes of the scene; nothing that is as near as this is looked at.
LEAST_WAY = 10.0
# The line goes on by ten to the powers up to this; where angles go around, only as far as doubles count whole turns.
POWERS, TURNING_POWERS = 40, 12
# Violations that count as held, and moves of bodies of a contact against each other, in parts of the way.
HELD = 1e-6
# The least part of the last fall, over a power of ten, that the next one must be.
STEADY = 0.5


@dataclass(frozen=True, eq=False)
class Asked:
    """What a solve was asked for."""

    bodies: tuple[Body, ...]
    constraints: tuple[Constraint, ...]
    objectives: Sequence[tuple[float, Objective]]

    @property
    def lasting(self) -> list[Constraint]:
        """Constraints that ask something of bodies that are far apart."""
        return [one for one in self.constraints if not isinstance(one, (Contact, TrimContact, Clearance))]


@dataclass(frozen=True, eq=False)
class Place:
    """Poses (n, 7), and angles by the ids of their coordinates."""

    q: Array
    angles: dict[int, float]

    @classmethod
    def of(cls, packed: Packed, state: Array) -> Place:
        """Where a state is."""
        q = state[: packed.contacts_at].reshape(-1, 7).copy()
        angles = state[packed.angles_at : packed.multipliers_at : TRACK].tolist()
        return cls(q, dict(zip(map(id, packed._angles), angles, strict=True)))

    def state(self, packed: Packed) -> Array:
        """The state of a packed scene there."""
        state = packed.new_state()
        state[: packed.contacts_at] = self.q.ravel()
        state[packed.angles_at : packed.multipliers_at : TRACK] = [self.angles[id(angle)] for angle in packed._angles]
        return state


@dataclass(frozen=True, eq=False)
class Line:
    """Where a solve ended, and by how much positions (n, 3) and angles changed on the way there."""

    end: Place
    move: Array
    turns: dict[int, float]

    @classmethod
    def through(cls, before: Place, end: Place) -> Line:
        """The line from one place to another, and on."""
        turns = {key: angle - before.angles[key] for key, angle in end.angles.items()}
        return cls(end, (end.q - before.q)[:, :3], turns)

    @property
    def way(self) -> float:
        """How far bodies went, in the largest coordinate."""
        return float(np.abs(self.move).max())

    @property
    def most_turned(self) -> float:
        """The largest change of an angle, where it is more than a whole turn; else zero."""
        most = max(map(abs, self.turns.values()), default=0.0)
        return most if most > 2.0 * pi else 0.0

    def at(self, part: float) -> Place:
        """So many times the way farther on, by whole turns of the angle that turned most."""
        most = self.most_turned
        if most > 0.0:
            part = max(round(part * most / (2.0 * pi)), 1) * 2.0 * pi / most
        q = self.end.q.copy()
        q[:, :3] += part * self.move
        return Place(q, {key: angle + part * self.turns[key] for key, angle in self.end.angles.items()})


def status_of(
    status: Status,
    asked: Asked,
    packed: Packed,
    settings: Array,
    start: Callable[[], Array],
    state: Array,
    interruption: Interruption,
) -> Status:
    """The status of a solve that ended so in a state: UNBOUNDED where it is, else as it came."""
    if status not in OPEN or not asked.objectives:
        return status
    least = LEAST_WAY * packed.scale
    end = Place.of(packed, state)
    if not Line.through(Place.of(packed, start()), end).way > least:
        return status
    half = settings.copy()
    half[ITERATIONS] = state[packed.results_at + COUNT] // 2
    before = Place.of(packed, attempt(packed, half, start, interruption).state)
    held = [_put_back(asked, place, interruption) for place in (before, end)]
    if held[0] is None or held[1] is None:
        return status
    line = Line.through(held[0], held[1])
    if line.way > least and not _slides(asked, line) and _falls(asked, line):
        return Status.UNBOUNDED
    return status


def _put_back(asked: Asked, place: Place, interruption: Interruption) -> Place | None:
    """The nearest place where constraints that last hold; None where none is found."""
    if not asked.lasting:
        return place
    rows = Packed(asked.bodies, asked.lasting, ())
    rows.refresh()
    settings = Options().settings(warm=True)
    settings[ANY_POSE] = 1.0
    outcome = attempt(rows, settings, lambda: place.state(rows), interruption)
    return Place.of(rows, outcome.state) if outcome.code == SOLVED else None


def _slides(asked: Asked, line: Line) -> bool:
    """Whether two bodies move against each other that are to touch."""
    index = {id(body): k for k, body in enumerate(asked.bodies)}
    touching = [one for one in asked.constraints if isinstance(one, Contact) and not one.unilateral]
    moves = [line.move[index[id(one.body_a)]] - line.move[index[id(one.body_b)]] for one in touching]
    return any(bool(np.abs(move).max() > HELD * line.way) for move in moves)


def _falls(asked: Asked, line: Line) -> bool:
    """Whether all holds on the line, and the objective falls on it without end."""
    alone = Packed(asked.bodies, asked.lasting, asked.objectives)
    alone.refresh()
    gradient, free = np.empty(6 * alone.count), np.empty(0, dtype=np.int64)
    last, fall = np.inf, 0.0
    for power in range((TURNING_POWERS if line.most_turned > 0.0 else POWERS) + 1):
        state = line.at(10.0**power).state(alone)
        try:
            rows = rows_of(alone, state)
        except InputError:
            return False
        off = np.where(rows.one_sided, np.maximum(-rows.residual, 0.0), np.abs(rows.residual))
        if not off.max(initial=0.0) * alone.scale <= HELD * 10.0**power * line.way:
            return False
        value = gradient_at(alone.table, alone.pool, state, free, gradient, alone.tips)
        if not value < last:
            return False
        if power > 1 and not last - value >= STEADY * fall:
            return False
        last, fall = value, last - value
    return True
