"""Hands of a tracker: springs that draw points and frames from tick to tick, one or several."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.objectives import FrameDistance, Objective, PointDistance
from assembly.constraints.packing.scene import Packed
from assembly.errors import FARTHEST, InputError
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.kinematics.pose import Pose, axes_quaternion, rotation_matrix
from assembly.tracking.trace import Trace

__all__ = ["Followable", "Hand", "Hands", "SeveralHands", "SpringNumbers", "Targets", "are_same"]

Array = NDArray[np.float64]
Followable: TypeAlias = Point | Frame | Body | Freedom
# Of one hand, or of each of several.
Targets: TypeAlias = Array | tuple[Array, ...]


def are_same(targets: Targets, others: Targets) -> bool:
    """Whether targets are the same numbers."""
    if isinstance(targets, tuple):
        return all(map(np.array_equal, targets, others))
    return np.array_equal(targets, others)


def _row_of(target: ArrayLike | Pose, size: int, far: float) -> Array | None:
    """A target as an array of its own; None if it is invalid. Errors of a target object of the user's are passed on."""
    if type(target) is np.ndarray and target.dtype == np.float64:
        row = target.copy()
    else:
        row = np.array(target.q if isinstance(target, Pose) else target)
        if row.dtype.kind not in "iuf" or isinstance(target, np.ma.MaskedArray):
            return None
        row = np.asarray(row, dtype=np.float64)
    if row.shape != (size,):
        return None
    x, y, z = row.tolist()[:3]
    # Farther ones would overflow, and what is not a number is no nearer.
    if not (-far <= x <= far and -far <= y <= far and -far <= z <= far):
        return None
    return row


class Hand:
    """The only hand of a tracker.

    Parameters
    ----------
    follow : Point, Frame or Body
    place : int
        Of its body, among those of the scene.
    row : (7,)
        Where that body is: the hand is at rest there.
    weight : float
        Half the stiffness.

    Attributes
    ----------
    terms : tuple of PointDistance or FrameDistance
        The spring.
    """

    def __init__(self, follow: Point | Frame | Body, place: int, row: Array, weight: float) -> None:
        pose = Pose(row[:3], row[3:])
        term: PointDistance | FrameDistance
        if isinstance(follow, Point):
            term = PointDistance(follow, pose.apply(follow.coordinates), weight)
        else:
            term = FrameDistance(follow, pose, weight=weight)
            term.target = pose @ Pose(term.frame.origin, axes_quaternion(term.frame.axes))
        self.follow: Followable | tuple[Followable, ...] = follow
        self.terms: tuple[Objective, ...] = (term,)
        self._term, self._place = term, place
        # What is held now, or None, and by which spring; only one of several hands changes these.
        self._held: Followable | None = follow
        self._spring = 2.0 * weight
        self._size = 3 if isinstance(term, PointDistance) else 7

    def pack(self, packed: Packed) -> None:
        """Find where the loop reads the target."""
        self._packed = packed
        self._pool: Any = packed.pool.data
        self._reference = packed.reference.tolist()
        self._at = next(at for target, at in packed._targets if target is self._term)
        # Whatever else may change between ticks is written by the scene itself.
        others = bool(packed._sources) or len(packed._targets) + len(packed._turns) > 1
        self._writes = isinstance(self._term, PointDistance) and not others
        self._scale, self._far = packed.scale, FARTHEST * packed.scale

    def __getstate__(self) -> dict[str, Any]:
        # Steps are copied and pickled with the hands, for their forces; only trackers, which are not, write targets.
        return {name: value for name, value in self.__dict__.items() if name != "_pool"}

    @property
    def stiffness(self) -> float | list[float]:
        """Force over distance."""
        return 2.0 * self.terms[0].weight

    def where(self) -> Targets:
        """The target that the loop has."""
        term = self._term
        return term._target if isinstance(term, PointDistance) else term.target.q[: self._size]

    def aimed(self, target: Any) -> Targets | None:
        """The target as an array, after the loop was told; None for what is none."""
        try:
            row = self.checked(target)
            if row is None:
                return None
            if not self._writes:
                self.aim(self.read(row))
        except Exception:  # whatever a target of the user's own does when it is read
            return None
        if self._writes:
            self._term._target = row
            pool, at, size = self._pool, self._at, self._scale
            x, y, z = row.tolist()
            left, front, low = self._reference
            pool[at], pool[at + 1], pool[at + 2] = (x - left) / size, (y - front) / size, (z - low) / size
        else:
            self._packed.refresh()
        return row

    def recorded(self, trace: Any) -> tuple[Array, Sequence[Any]]:
        """Times (k,) and targets of a recorded hand."""
        if not isinstance(trace, Trace):
            raise TypeError(f"trace is {trace!r}; expected a Trace")
        self.check_recorded("trace", trace)
        return trace.times, list(trace.targets)

    def checked(self, target: Any) -> Array | None:
        """The target as an array; None for what is none."""
        return _row_of(target, self._size, self._far)

    def read(self, row: Array) -> Any:
        """A target that was checked as the term takes it; raises where it is no pose."""
        term = self._term
        if isinstance(term, PointDistance):
            return row
        return Pose(row, term.target.quaternion) if len(row) == 3 else Pose(row[:3], row[3:])

    def aim(self, target: Any) -> None:
        """Draw to a target that was read, from the next time on that the scene is read."""
        term = self._term
        if isinstance(term, PointDistance):
            term._target = target
        else:
            term.target = target

    def numbers_in(self, packed: Packed) -> SpringNumbers:
        """Where the loop has the numbers of the spring."""
        return SpringNumbers(packed, self._term)

    def can_hold(self, k: int, follow: Followable) -> Followable:
        """What hand k, this one, may hold instead.

        Raises
        ------
        InputError
            Something of another body, or what its spring cannot draw.
        """
        body = self._term.bodies[0]
        if isinstance(follow, Freedom) or (follow if isinstance(follow, Body) else follow.body) is not body:
            raise InputError(f"follow is {follow!r}; expected something of body {body.name!r}, which hand {k} holds")
        if isinstance(self._term, PointDistance) and not isinstance(follow, Point):
            raise InputError(f"follow is {follow!r}; expected a Point, which is what hand {k} was made with")
        return follow

    def take(self, held: Followable | None, stiffness: float, q: Array) -> None:
        """Hold something else from now on, at rest, bodies at q (n, 7)."""
        self._held, self._spring, term = held, stiffness, self._term
        self._size = 3 if isinstance(held, Point) else 7
        if isinstance(held, Point) or held is None:
            self.rest(q)
        elif isinstance(term, FrameDistance):
            assert not isinstance(held, Freedom)
            term._frame = held.frame() if isinstance(held, Body) else held
            self.begin_anew(q)

    def begin_anew(self, q: Array) -> None:
        """Have the term at rest as it is, whatever is held, bodies at q (n, 7)."""
        term, pose = self._term, Pose(q[self._place, :3], q[self._place, 3:])
        if isinstance(term, PointDistance):
            term._target = pose.apply(term.point.coordinates)
        else:
            term.target = pose @ Pose(term.frame.origin, axes_quaternion(term.frame.axes))

    def rest(self, q: Array) -> None:
        """Have the target of a point that is held where that is, bodies at q (n, 7)."""
        held = self._held
        if isinstance(held, Point):
            self.aim(self.read(Pose(q[self._place, :3], q[self._place, 3:]).apply(held.coordinates)))

    def check_recorded(self, name: str, trace: Trace) -> None:
        """Raise an InputError where a trace has targets of another kind than this hand takes."""
        expected = {1: "numbers", 3: "points", 7: "poses"}[self._size]
        if self._held is not None and trace.kind != expected:
            raise InputError(f"{name} has {trace.kind}; expected {expected} for {self._held!r}")

    def wrenches(self, q: Array, targets: Targets) -> Array:
        """Force and torque of the spring on the hand, (1, 6), bodies at q (n, 7)."""
        assert isinstance(targets, np.ndarray)
        return self.wrench(q, targets)[None]

    def wrench(self, q: Array, target: Array) -> Array:
        """Force and torque of the spring on the hand, (6,), bodies at q (n, 7), the hand at a target."""
        term, held, stiffness = self._term, self._held, self._spring
        if held is None:
            return np.zeros(6)
        pose = Pose(q[self._place, :3], q[self._place, 3:])
        if isinstance(held, Point):
            return np.append(stiffness * (pose.apply(held.coordinates) - target), np.zeros(3))
        assert isinstance(term, FrameDistance) and not isinstance(held, Freedom)
        frame = held.frame() if isinstance(held, Body) else held
        force = stiffness * (pose.apply(frame.origin) - target[:3])
        turn = rotation_matrix(pose.quaternion) @ frame.axes @ rotation_matrix(target[3:]).T
        # Twice the skew part of a rotation is its sine along its axis.
        sine = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        return np.append(force, stiffness * term.length**2 * sine)


class SeveralHands:
    """Hands that hold a scene at once.

    Each may hold something else of its body later on, or nothing: `Tracker.hold`.

    Parameters
    ----------
    hands : list of Hand

    Attributes
    ----------
    terms : tuple of PointDistance, FrameDistance or CoordinateDistance
        The springs.
    """

    def __init__(self, hands: list[Hand]) -> None:
        self._hands = hands
        self.terms = tuple(hand.terms[0] for hand in self._hands)
        self._packed: Packed | None = None
        self._springs: list[SpringNumbers] = []

    def __getstate__(self) -> dict[str, Any]:
        # Steps are copied and pickled with the hands, for their forces; only trackers, which are not, write springs.
        return {name: value for name, value in self.__dict__.items() if name != "_springs"}

    @property
    def follow(self) -> Followable | tuple[Followable | None, ...]:
        """What each holds; None for one that holds nothing."""
        return tuple(hand._held for hand in self._hands)

    def pack(self, packed: Packed) -> None:
        """Take how far targets may be, which the scene itself writes, and where the numbers of the springs are."""
        if packed is not self._packed:
            self._springs = [hand.numbers_in(packed) for hand in self._hands]
        self._packed = packed
        for hand, numbers in zip(self._hands, self._springs, strict=True):
            hand._far = FARTHEST * packed.scale
            numbers.write(hand._held, hand._spring)

    def can_hold(self, k: int, follow: Followable) -> Followable:
        """What hand k may hold; raises as `Hand.can_hold` does."""
        return self._hands[k].can_hold(k, follow)

    def holding(self, k: int, held: Followable | None, stiffness: float, q: Array) -> SeveralHands:
        """The same hands, one of which holds something else from now on, at rest; bodies are at q (n, 7)."""
        hands, hand = copy(self), copy(self._hands[k])
        hands._springs = self._springs
        hands._hands = [*self._hands[:k], hand, *self._hands[k + 1 :]]
        hand.take(held, stiffness, q)
        self._springs[k].write(held, stiffness)
        return hands

    def at_rest(self, q: Array) -> None:
        """Have every hand hold what its tracker was made with, at rest, bodies at q (n, 7); until `pack`."""
        for hand, numbers in zip(self._hands, self._springs, strict=True):
            hand.begin_anew(q)
            numbers.restore()

    def take_targets(self, q: Array) -> None:
        """Have every hand at rest where it holds, bodies at q (n, 7)."""
        for hand in self._hands:
            hand.rest(q)

    @property
    def stiffness(self) -> float | list[float]:
        """Forces over distances."""
        return [hand._spring for hand in self._hands]

    def where(self) -> Targets:
        """The targets that the loop has."""
        return tuple(np.asarray(hand.where()) for hand in self._hands)

    def aimed(self, targets: Any) -> Targets | None:
        """The targets as arrays, after the loop was told all of them; None, and none told, where one is none."""
        try:
            if len(targets) != len(self._hands):
                return None
            pairs = list(zip(targets, self._hands, strict=True))
            # Whatever is said to a hand that holds nothing, nothing is drawn there.
            held = [(hand, hand.checked(target)) for target, hand in pairs if hand._held is not None]
            told = [(hand, hand.read(row)) for hand, row in held if row is not None]
        except Exception:  # whatever targets of the user's own do when they are read
            return None
        if len(told) < len(held):
            return None
        for hand, read in told:
            hand.aim(read)
        assert self._packed is not None
        self._packed.refresh()
        return self.where()

    def recorded(self, trace: Any) -> tuple[Array, Sequence[Any]]:
        """Times (k,) and targets of recorded hands."""
        if not isinstance(trace, (list, tuple)) or not all(isinstance(each, Trace) for each in trace):
            raise TypeError(f"trace is {trace!r}; expected a Trace for each of {len(self.terms)} hands")
        if len(trace) != len(self.terms):
            raise InputError(f"trace has {len(trace)} traces; expected one for each of {len(self.terms)} hands")
        for k, (each, hand) in enumerate(zip(trace, self._hands, strict=True)):
            hand.check_recorded(f"trace[{k}]", each)
            if not np.array_equal(each.times, trace[0].times):
                raise InputError(f"trace[{k}] has other times than trace[0]; expected the same: resample them")
        return trace[0].times, list(zip(*(each.targets for each in trace), strict=True))

    def wrenches(self, q: Array, targets: Targets) -> Array:
        """Forces and torques of the springs on their hands, (k, 6), bodies at q (n, 7)."""
        return np.array([hand.wrench(q, target) for hand, target in zip(self._hands, targets, strict=True)])


class SpringNumbers:
    """Where the loop has the numbers of a spring: its weights, and the point of the body that it draws."""

    def __init__(self, packed: Packed, term: PointDistance | FrameDistance) -> None:
        self._pool, self._scale, self._weight, self._term = packed.pool, packed.scale, term.weight, term
        # Before the target are the weight and the point.
        self._at = next(at for target, at in packed._targets if target is term) - 4
        turns = [at for target, at in packed._turns if target is term]
        self._turn_at = turns[0] + 4 if turns else None
        # As they were packed, for the stiffness that the term has.
        self._drawn = float(self._pool[self._at])
        self._turned = 0.0 if self._turn_at is None else float(self._pool[self._turn_at])

    def restore(self) -> None:
        """Have the spring draw what its term says."""
        term = self._term
        self.write(term.point if isinstance(term, PointDistance) else term.frame, 2.0 * self._weight)

    def write(self, held: Followable | None, stiffness: float) -> None:
        """Have the spring draw what is held; nothing for None."""
        factor = 0.0 if held is None else 0.5 * stiffness / self._weight
        self._pool[self._at] = factor * self._drawn
        if isinstance(held, (Point, Frame)):
            place = held.coordinates if isinstance(held, Point) else held.origin
            self._pool[self._at + 1 : self._at + 4] = place / self._scale
        elif held is not None:
            self._pool[self._at + 1 : self._at + 4] = 0.0
        if self._turn_at is not None:
            self._pool[self._turn_at] = 0.0 if isinstance(held, Point) else factor * self._turned


Hands: TypeAlias = Hand | SeveralHands
