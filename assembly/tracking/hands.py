"""Targets of a tracker: springs that draw points and frames from tick to tick."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.objectives import FrameDistance, PointDistance
from assembly.constraints.packing.scene import Packed
from assembly.errors import FARTHEST, InputError, positive
from assembly.kinematics.body import Body, Frame, Point
from assembly.kinematics.pose import Pose, axes_quaternion, rotation_matrix
from assembly.tracking.trace import Trace

__all__ = [
    "Followable",
    "Hand",
    "Hands",
    "SeveralHands",
    "Targets",
    "are_same",
    "new_hands",
    "springs",
    "with_hands",
]

Array = NDArray[np.float64]
Followable: TypeAlias = Point | Frame | Body
# Of one hand, or of each of several.
Targets: TypeAlias = Array | tuple[Array, ...]


def springs(follow: Followable | Sequence[Followable], stiffness: float | Sequence[float]) -> list[float]:
    """Weights of the terms of what hands hold: half their stiffness.

    Raises
    ------
    InputError, TypeError
        Nothing held, something that cannot be, or not one stiffness for all or for each.
    """
    if not isinstance(follow, (list, tuple)):
        if not isinstance(follow, (Point, Frame, Body)):
            raise TypeError(f"follow is {follow!r}; expected a Point, a Frame, a Body or a list of them")
        return [0.5 * positive("stiffness", stiffness)]
    if not follow:
        raise InputError("follow is empty; expected a Point, a Frame or a Body at least")
    for k, held in enumerate(follow):
        if not isinstance(held, (Point, Frame, Body)):
            raise TypeError(f"follow[{k}] is {held!r}; expected a Point, a Frame or a Body")
    if not isinstance(stiffness, (list, tuple, np.ndarray)) or np.ndim(stiffness) == 0:
        return [0.5 * positive("stiffness", stiffness)] * len(follow)
    if len(stiffness) != len(follow):
        raise InputError(
            f"stiffness has {len(stiffness)} numbers; expected one, or one for each of {len(follow)} hands"
        )
    return [0.5 * positive(f"stiffness[{k}]", value) for k, value in enumerate(stiffness)]


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

    def __init__(self, follow: Followable, place: int, row: Array, weight: float) -> None:
        pose = Pose(row[:3], row[3:])
        term: PointDistance | FrameDistance
        if isinstance(follow, Point):
            term = PointDistance(follow, pose.apply(follow.coordinates), weight)
        else:
            term = FrameDistance(follow, pose, weight=weight)
            term.target = pose @ Pose(term.frame.origin, axes_quaternion(term.frame.axes))
        self.follow: Followable | tuple[Followable, ...] = follow
        self.terms = (term,)
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
        return 2.0 * self._term.weight

    def where(self) -> Targets:
        """The target that the loop has."""
        term = self._term
        return term._target if isinstance(term, PointDistance) else term.target.q

    def aimed(self, target: Any) -> Targets | None:
        """The target as an array, after the loop was told; None for what is none."""
        try:
            row = _row_of(target, self._size, self._far)
            if row is None:
                return None
            if not self._writes:
                self._aim_term(row)
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

    def _aim_term(self, row: Array) -> None:
        term = self._term
        if isinstance(term, PointDistance):
            term._target = row
        else:
            term.target = Pose(row[:3], row[3:])

    def recorded(self, trace: Any) -> tuple[Array, Sequence[Any]]:
        """Times (k,) and targets of a recorded hand."""
        if not isinstance(trace, Trace):
            raise TypeError(f"trace is {trace!r}; expected a Trace")
        return trace.times, list(trace.targets)

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
        assert isinstance(term, FrameDistance)
        frame = held.frame() if isinstance(held, Body) else held
        force = stiffness * (pose.apply(frame.origin) - target[:3])
        turn = rotation_matrix(pose.quaternion) @ frame.axes @ rotation_matrix(target[3:]).T
        # Twice the skew part of a rotation is its sine along its axis.
        sine = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        return np.append(force, stiffness * term.length**2 * sine)


class SeveralHands:
    """Hands that hold a scene at once; parameters are those of `Hand`, one for each.

    Each may hold something else of its body later on, or nothing: `Tracker.hold`.

    Attributes
    ----------
    terms : tuple of PointDistance or FrameDistance
        The springs.
    """

    def __init__(
        self, follow: Sequence[Followable], places: Sequence[int], rows: Sequence[Array], weights: Sequence[float]
    ) -> None:
        self._hands = [Hand(*each) for each in zip(follow, places, rows, weights, strict=True)]
        self.terms = tuple(hand._term for hand in self._hands)
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
            self._springs = [SpringNumbers(packed, term) for term in self.terms]
        self._packed, self._far = packed, FARTHEST * packed.scale
        for hand, numbers in zip(self._hands, self._springs, strict=True):
            numbers.write(hand._held, hand._spring)

    def holding(self, k: int, held: Followable | None, stiffness: float, row: Array) -> SeveralHands:
        """The same hands, one of which holds something else from now on, at rest; its body is at (7,)."""
        hands, hand = copy(self), copy(self._hands[k])
        hands._springs = self._springs
        hands._hands = [*self._hands[:k], hand, *self._hands[k + 1 :]]
        hand._held, hand._spring, term = held, stiffness, hand._term
        hand._size = 3 if isinstance(held, Point) else 7
        pose = Pose(row[:3], row[3:])
        if isinstance(term, PointDistance):
            if isinstance(held, Point):
                term._target = pose.apply(held.coordinates)
        elif isinstance(held, Point):
            term.target = Pose(pose.apply(held.coordinates), term.target.quaternion)
        elif held is not None:
            term._frame = held.frame() if isinstance(held, Body) else held
            term.target = pose @ Pose(term.frame.origin, axes_quaternion(term.frame.axes))
        self._springs[k].write(held, stiffness)
        return hands

    def at_rest(self, q: Array) -> None:
        """Have every hand hold what its tracker was made with, at rest, bodies at q (n, 7); until `pack`."""
        for hand, numbers in zip(self._hands, self._springs, strict=True):
            term, pose = hand._term, Pose(q[hand._place, :3], q[hand._place, 3:])
            if isinstance(term, PointDistance):
                term._target = pose.apply(term.point.coordinates)
                numbers.write(term.point, 2.0 * term.weight)
            else:
                term.target = pose @ Pose(term.frame.origin, axes_quaternion(term.frame.axes))
                numbers.write(term.frame, 2.0 * term.weight)

    def take_targets(self, q: Array) -> None:
        """Have every hand at rest where it holds, bodies at q (n, 7)."""
        for hand in self._hands:
            term, held = hand._term, hand._held
            if isinstance(term, FrameDistance) and isinstance(held, Point):
                pose = Pose(q[hand._place, :3], q[hand._place, 3:])
                term.target = Pose(pose.apply(held.coordinates), term.target.quaternion)
            elif isinstance(held, Point):
                assert isinstance(term, PointDistance)
                term._target = Pose(q[hand._place, :3], q[hand._place, 3:]).apply(held.coordinates)

    @property
    def stiffness(self) -> float | list[float]:
        """Forces over distances."""
        return [hand._spring for hand in self._hands]

    def where(self) -> Targets:
        """The targets that the loop has."""
        return tuple(
            np.asarray(hand._term._target if isinstance(hand._held, Point) else hand.where()) for hand in self._hands
        )

    def aimed(self, targets: Any) -> Targets | None:
        """The targets as arrays, after the loop was told all of them; None, and none told, where one is none."""
        try:
            if len(targets) != len(self._hands):
                return None
            pairs = list(zip(targets, self._hands, strict=True))
            # Whatever is said to a hand that holds nothing, nothing is drawn there.
            rows = [None if hand._held is None else _row_of(target, hand._size, self._far) for target, hand in pairs]
            if any(row is None and hand._held is not None for row, hand in zip(rows, self._hands, strict=True)):
                return None
            poses = [None if row is None or len(row) != 7 else Pose(row[:3], row[3:]) for row in rows]
        except Exception:  # whatever targets of the user's own do when they are read
            return None
        for term, row, pose in zip(self.terms, rows, poses, strict=True):
            if row is None:
                continue
            if isinstance(term, PointDistance):
                term._target = row
            else:
                term.target = Pose(row, term.target.quaternion) if pose is None else pose
        assert self._packed is not None
        self._packed.refresh()
        return self.where()

    def recorded(self, trace: Any) -> tuple[Array, Sequence[Any]]:
        """Times (k,) and targets of recorded hands."""
        if not isinstance(trace, (list, tuple)) or not all(isinstance(each, Trace) for each in trace):
            raise TypeError(f"trace is {trace!r}; expected a Trace for each of {len(self.terms)} hands")
        if len(trace) != len(self.terms):
            raise InputError(f"trace has {len(trace)} traces; expected one for each of {len(self.terms)} hands")
        for k, each in enumerate(trace):
            if not np.array_equal(each.times, trace[0].times):
                raise InputError(f"trace[{k}] has other times than trace[0]; expected the same: resample them")
        return trace[0].times, list(zip(*(each.targets for each in trace), strict=True))

    def wrenches(self, q: Array, targets: Targets) -> Array:
        """Forces and torques of the springs on their hands, (k, 6), bodies at q (n, 7)."""
        return np.array([hand.wrench(q, target) for hand, target in zip(self._hands, targets, strict=True)])


class SpringNumbers:
    """Where the loop has the numbers of a spring: its weights, and the point of the body that it draws."""

    def __init__(self, packed: Packed, term: PointDistance | FrameDistance) -> None:
        self._pool, self._scale, self._weight = packed.pool, packed.scale, term.weight
        # Before the target are the weight and the point.
        self._at = next(at for target, at in packed._targets if target is term) - 4
        turns = [at for target, at in packed._turns if target is term]
        self._turn_at = turns[0] + 4 if turns else None
        # As they were packed, for the stiffness that the term has.
        self._drawn = float(self._pool[self._at])
        self._turned = 0.0 if self._turn_at is None else float(self._pool[self._turn_at])

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


def new_hands(
    bodies: Sequence[Body], follow: Followable | Sequence[Followable], poses: Array, weights: Sequence[float]
) -> Hands:
    """The hands that hold bodies at poses (n, 7).

    Raises
    ------
    InputError
        A body that is not one of these, or does not move.
    """
    several = not isinstance(follow, (Point, Frame, Body))
    held = [follow] if isinstance(follow, (Point, Frame, Body)) else list(follow)
    places = []
    for k, item in enumerate(held):
        body = item if isinstance(item, Body) else item.body
        if body not in bodies:
            name = f"follow[{k}]" if several else "follow"
            raise InputError(f"{name} is of body {body.name!r}; expected one of {[body.name for body in bodies]}")
        if body.fixed:
            name = f"follow[{k}]" if several else "follow"
            raise InputError(f"{name} is of body {body.name!r}, which is fixed; expected a body that moves")
        places.append(bodies.index(body))
    if not several:
        return Hand(held[0], places[0], poses[places[0]], weights[0])
    return SeveralHands(held, places, [poses[place] for place in places], weights)


def with_hands(scene: Assembly, hands: Hands) -> Assembly:
    """The same scene with the hands' springs among its objectives."""
    inner = Assembly(scene.bodies)
    inner._take_constraints(scene.constraints)
    for sign, objective in scene.objectives:
        (inner.minimize if sign > 0.0 else inner.maximize)(objective)
    inner.minimize(*hands.terms)
    # Solids that lie on each other go on doing so.
    inner._corners = scene._corners
    return inner
