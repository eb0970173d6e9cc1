"""Whether the objective of a solve that did not end goes on falling without bound, along poses that hold.

A solve that runs away never ends SOLVED, and where it stops says nothing. Looked at are motions without an end, past
all that a scene's own lengths may be. It is unbounded if on one of them constraints hold all along, as parts of how far
bodies went, and the objective falls from each power of ten of the way to the next, by no less than half of what it fell
before. What nears a finite value falls by less and less; what comes to a limit, or to a target however far away, does
not hold, or rises. Such motions are

- the line on which the solve ran, from where it was after half its steps to where it stopped, both put back onto the
  constraints. Angles that went around go on around by whole turns, and bodies with them, as a wheel on a rack;
- the displacement between these places, body by body, done again and again: a helix, as of what is on a screw;
- from where all holds, near the start or the end, the way of the whole solve; of bodies that touch that of the one of
  them that went farthest. Contacts of two surfaces end somewhere, so that bodies of one must not move against each
  other; clearances and one-sided contacts hold where bodies are far apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import pi
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.objectives import Objective
from assembly.constraints.model.trim_contact import TrimContact
from assembly.constraints.packing.scene import Packed
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import multiply, rotation_matrix
from assembly.solve.attempts.attempts import attempt
from assembly.solve.dense.jacobian import rows_of
from assembly.solve.dense.row_table import gradient_at
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import ANY_POSE, COUNT, ITERATIONS, SOLVED, STRAYS
from assembly.solve.options import Options
from assembly.solve.scene import Status

__all__ = ["Asked", "has_strayed", "status_of"]

Array = NDArray[np.float64]
# Statuses from which a search for an unbounded motion begins: with others there is an answer, or no pose to begin at.
OPEN = (Status.ITERATION_LIMIT, Status.STALLED, Status.INFEASIBLE)
# Least length of a motion, in sizes of the scene.
LEAST_WAY = 1.0
# A motion goes on by ten to the powers up to this; where bodies turn, only as far as doubles count whole turns. On a
# helix what it does as long as going around matters more than going away is not looked at.
POWERS, TURNING_POWERS, FIRST_POWER = 40, 12, 4
# Violations that count as held, and moves of bodies of a contact against each other, in parts of the way.
HELD = 1e-6
# Over each power of ten the objective has to fall by at least this part of its fall over the power before.
STEADY = 0.5
# Radians below which a body counts as not turned; a helix with a smaller advance, in parts of the least length, is a
# circle.
LEAST_TURN, LEAST_ADVANCE = 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class Asked:
    """What a solve was asked for."""

    bodies: tuple[Body, ...]
    constraints: tuple[Constraint, ...]
    objectives: Sequence[tuple[float, Objective]]

    @property
    def touching(self) -> list[Contact]:
        """Contacts of bodies that are to stay together."""
        return [one for one in self.constraints if isinstance(one, Contact) and not one.unilateral]

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
        angles = state[packed.angles].tolist()
        return cls(q, dict(zip(map(id, packed._angles), angles, strict=True)))

    def state(self, packed: Packed) -> Array:
        """The state of a packed scene there."""
        state = packed.new_state()
        state[: packed.contacts_at] = self.q.ravel()
        state[packed.contacts_at : packed.angles_at] = np.nan
        # Angles that only inputs of a dexterity have belong to no row: any turn will do.
        state[packed.angles] = [self.angles.get(id(angle), 0.0) for angle in packed._angles]
        return state


class Motion(Protocol):
    """A motion without an end, from a place where all holds."""

    @property
    def way(self) -> float:
        """How far bodies go in one part of it, in the largest coordinate."""

    @property
    def powers(self) -> range:
        """The powers of ten up to which it is followed, those at which the objective is looked at."""

    def at(self, part: float) -> Place:
        """Where bodies are after so many parts."""


@dataclass(frozen=True, eq=False)
class Line:
    """From a place on by moves of positions (n, 3) and changes of angles."""

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
    def powers(self) -> range:
        """As of `Motion`."""
        return range((TURNING_POWERS if self.most_turned > 0.0 else POWERS) + 1)

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


@dataclass(frozen=True, eq=False)
class Helix:
    """From a place on by the displacement of every body from another one: a turn about an axis, and a move on it."""

    end: Place
    axes: Array
    angles: Array
    centers: Array
    advances: Array
    turns: dict[int, float]

    @classmethod
    def through(cls, before: Place, end: Place) -> Helix:
        """That from one place to another, and on."""
        axes, centers, advances = np.zeros((3, len(end.q), 3))
        angles = np.zeros(len(end.q))
        for k, (old, new) in enumerate(zip(before.q, end.q, strict=True)):
            e = multiply(new[3:], old[3:] * [1.0, -1.0, -1.0, -1.0])
            e = -e if e[0] < 0.0 else e
            sine = float(np.linalg.norm(e[1:]))
            angle = 2.0 * float(np.arctan2(sine, e[0]))
            if angle < LEAST_TURN:
                advances[k] = new[:3] - old[:3]
                continue
            axis = e[1:] / sine
            shift = new[:3] - rotation_matrix(e) @ old[:3]
            across = shift - (axis @ shift) * axis
            axes[k], angles[k], advances[k] = axis, angle, shift - across
            centers[k] = 0.5 * (across + np.cross(axis, across) / np.tan(0.5 * angle))
        return cls(end, axes, angles, centers, advances, Line.through(before, end).turns)

    @property
    def way(self) -> float:
        """How far bodies go along their axes."""
        return float(np.abs(self.advances).max())

    @property
    def powers(self) -> range:
        """As of `Motion`."""
        return range(FIRST_POWER, TURNING_POWERS + 1)

    def at(self, part: float) -> Place:
        """After so many displacements more, a whole number."""
        q = self.end.q + np.pad(part * self.advances, ((0, 0), (0, 4)))
        for row, axis, angle, center in zip(q, self.axes, self.angles, self.centers, strict=True):
            half = 0.5 * ((part * angle) % (2.0 * pi))
            turn = np.concatenate([[np.cos(half)], np.sin(half) * axis])
            if angle > 0.0:
                arm = row[:3] - center
                row[:3] = center + rotation_matrix(turn) @ arm
                row[3:] = multiply(turn, row[3:])
        return Place(q, {key: angle + part * self.turns[key] for key, angle in self.end.angles.items()})


def has_strayed(packed: Packed, settings: Array, state: Array) -> bool:
    """Whether a solve has steps left, and ended only because its bodies went away."""
    return bool(settings[STRAYS] == 1.0 and state[packed.results_at + COUNT] < settings[ITERATIONS])


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
    first, end = Place.of(packed, start()), Place.of(packed, state)
    went = Line.through(first, end)
    if not (went.way > LEAST_WAY * packed.scale or went.most_turned > 0.0):
        return status
    half = settings.copy()
    half[STRAYS] = 0.0
    half[ITERATIONS] = state[packed.results_at + COUNT] // 2
    middle = Place.of(packed, attempt(packed, half, start, interruption).state)
    motions = _motions(asked, (first, middle, end), interruption)
    return Status.UNBOUNDED if any(_goes_on(asked, motion, packed.scale) for motion in motions) else status


def _motions(asked: Asked, places: tuple[Place, Place, Place], interruption: Interruption) -> Iterator[Motion]:
    """Motions that may have no end, of a solve that was at three places one after the other."""
    first, middle, end = places
    last = _put_back(asked, asked.lasting, end, interruption)
    for place in (middle, first) if last is not None else ():
        before = _put_back(asked, asked.lasting, place, interruption)
        if before is not None and last is not None:
            line = Line.through(before, last)
            if not _slides(asked, line):
                yield line
            if not asked.touching:
                yield Helix.through(before, last)
    for place in (first, end) if asked.touching else ():
        base = _put_back(asked, asked.constraints, place, interruption)
        if base is not None:
            yield _towed(asked, base, (end.q - first.q)[:, :3])


def _goes_on(asked: Asked, motion: Motion, size: float) -> bool:
    """Whether a motion goes far enough, and the objective falls on it without end."""
    least = LEAST_WAY
    if isinstance(motion, Helix):
        # Most of its motion may have been around the axis.
        least *= LEAST_ADVANCE if motion.angles.any() else np.inf
    return motion.way > least * size and _falls(asked, motion)


def _put_back(
    asked: Asked, constraints: Sequence[Constraint], place: Place, interruption: Interruption
) -> Place | None:
    """The nearest place where constraints hold; None where none is found."""
    if not constraints:
        return place
    rows = Packed(asked.bodies, constraints, ())
    rows.refresh()
    for warm in (True, False):
        settings = Options().settings(warm)
        settings[ANY_POSE] = 1.0
        outcome = attempt(rows, settings, lambda: place.state(rows), interruption)
        if outcome.code == SOLVED:
            return Place.of(rows, outcome.state)
    return None


def _towed(asked: Asked, base: Place, move: Array) -> Line:
    """The line from a place by moves (n, 3); bodies that touch go with the one of them that goes farthest."""
    index = {id(body): k for k, body in enumerate(asked.bodies)}
    group = np.arange(len(asked.bodies))
    for one in asked.touching:
        a, b = (group[index[id(body)]] for body in (one.body_a, one.body_b))
        group[group == a] = b
    far = np.where([body.fixed for body in asked.bodies], np.inf, np.abs(move).max(axis=1))
    leaders = [int(np.argmax(np.where(group == label, far, -1.0))) for label in group]
    return Line(base, move[leaders], dict.fromkeys(base.angles, 0.0))


def _slides(asked: Asked, line: Line) -> bool:
    """Whether two bodies move against each other that are to touch."""
    index = {id(body): k for k, body in enumerate(asked.bodies)}
    moves = [line.move[index[id(one.body_a)]] - line.move[index[id(one.body_b)]] for one in asked.touching]
    return any(bool(np.abs(move).max() > HELD * line.way) for move in moves)


def _falls(asked: Asked, motion: Motion) -> bool:
    """Whether all holds along a motion, and the objective falls on it without end."""
    alone = Packed(asked.bodies, asked.lasting, asked.objectives)
    alone.refresh()
    gradient, free = np.empty(6 * alone.count), np.empty(0, dtype=np.int64)

    def value_at(part: float) -> float:
        """The objective after so many parts; NaN where what is asked does not hold."""
        state = motion.at(part).state(alone)
        try:
            rows = rows_of(alone, state)
        except InputError:
            return np.nan
        off = np.where(rows.one_sided, np.maximum(-rows.residual, 0.0), np.abs(rows.residual))
        if not off.max(initial=0.0) * alone.scale <= HELD * max(part, 1.0) * motion.way:
            return np.nan
        return float(gradient_at(alone.table, alone.pool, state, free, gradient, alone.end_effectors))

    last, fall = np.inf, 0.0
    for power in motion.powers:
        value = value_at(10.0**power)
        if value == np.inf and _is_past_doubles(asked, motion.at(10.0**power)):
            # It counts if it fell faster and faster before it overflowed.
            first, middle, end = (value_at(part) for part in (-1.0, -0.5, 0.0))
            return fall > 0.0 or 0.0 < first - middle < middle - end
        if not value < last:
            return False
        if fall > 0.0 and power > 1 and not last - value >= STEADY * fall:
            return False
        fall = last - value if last < np.inf else 0.0
        last = value
    return True


def _is_past_doubles(asked: Asked, place: Place) -> bool:
    """Whether the objective is minus infinity at a place; the loop has one infinity for all that is not finite."""
    index = {id(body): k for k, body in enumerate(asked.bodies)}
    total = 0.0
    for sign, term in asked.objectives:
        if isinstance(term, Expression):
            (value,) = term.values(place.q[[index[id(body)] for body in term.bodies]])
            total += sign * float(value)
    return total == -np.inf
