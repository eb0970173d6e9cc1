"""The length by which a scene is scaled, from the scene's own lengths, whatever their unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.constraint import Constraint, Equation
from assembly.constraints.model.dexterity import Dexterity
from assembly.constraints.model.objectives import FrameDistance, Objective, PointDistance, Posture, Weight
from assembly.errors import FARTHEST, InputError
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.kinematics.pose import length

__all__ = [
    "LEAST",
    "MOST",
    "ONE_PLACE",
    "Objectives",
    "check_reach",
    "equations_of",
    "marks_of",
    "reach_of",
    "scene_size",
    "size_and_extent",
]

Array = NDArray[np.float64]
Objectives = Sequence[tuple[float, Objective]]
# Squares of shorter lengths, and of parts of them, have no doubles. Farther than FARTHEST are two coordinates of it.
LEAST, MOST = 1.0 / FARTHEST, 10.0 * FARTHEST
# Places that are nearer to each other, as a part of their coordinates, are one: that is rounding.
ONE_PLACE = 4e-15


def scene_size(bodies: Sequence[Body], constraints: Sequence[Constraint], objectives: Objectives) -> float:
    """The size of a scene as it stands now; 0 where nothing in it is a length.

    The largest body, by its shape or by the frames and points on it, where these are apart by more than rounding. Where
    none has a shape, a length that a row asks for may be larger, and where no body has two marks, the distance of the
    farthest two in the world. Limits and targets may be far away just to say "as far as it goes", so they count where
    there is nothing else, the smaller.

    Raises
    ------
    InputError
        Too small or too large for squares of lengths to be doubles.
    """
    return size_and_extent(bodies, constraints, objectives)[0]


def size_and_extent(
    bodies: Sequence[Body], constraints: Sequence[Constraint], objectives: Objectives
) -> tuple[float, bool]:
    """The same, and whether no body has a shape or two marks: then it rests on values and places, which may change."""
    marks = _marks(bodies, constraints, objectives)
    on_bodies = max(_box(places) for places in marks.values())
    shapes = max(body.size for body in bodies)
    if shapes > 0.0:
        return _checked(max(shapes, on_bodies), marks), False
    if on_bodies <= ONE_PLACE * reach_of(bodies, marks.values()):
        on_bodies = 0.0
    rests_on_values = on_bodies < LEAST
    asked, limits = _lengths(constraints)
    known = max(on_bodies, asked)
    if on_bodies < LEAST:
        known = max(known, _farthest([p for body in bodies for p in body.pose.apply([np.zeros(3), *marks[body]])]))
    if known < LEAST:
        far_ends = [far for far in (limits, _farthest_target(bodies, objectives)) if far > 0.0]
        known = max(known, min(far_ends, default=0.0))
    return (_checked(known, marks) if known > 0.0 else 0.0), rests_on_values


def check_reach(what: str, far: float, size: float) -> None:
    """Raise where a length is so many times the scene's size that squares of scaled lengths overflow."""
    if not far <= FARTHEST * size:
        raise InputError(f"{what} is {far:g} with a scene's size of {size:g}; expected at most {FARTHEST:g} times it")


def _checked(size: float, marks: Mapping[Body, Sequence[Array]]) -> float:
    if not LEAST <= size <= MOST:
        raise InputError(f"the scene's size is {size:g}; expected one from {LEAST:g} to {MOST:g}, in another unit")
    for body, places in marks.items():
        if places:
            check_reach(f"a point of body {body.name!r}", float(np.abs(places).max()), size)
    return size


def marks_of(
    bodies: Sequence[Body], constraints: Sequence[Constraint], objectives: Objectives
) -> dict[Body, list[Frame | Array]]:
    """The frames and points that constraints and objectives have on every body; points in its coordinates."""
    marks: dict[Body, list[Frame | Array]] = {body: [] for body in bodies}
    # Rows of a joint have their frames in common.
    for pair in dict.fromkeys(item.frames for equation in equations_of(constraints) for _, item in equation.terms):
        for frame in (pair.frame_a, pair.frame_b):
            marks[frame.body].append(frame)
    for _, term in objectives:
        if isinstance(term, PointDistance):
            marks[term.point.body].append(term.point.coordinates)
        elif isinstance(term, FrameDistance):
            marks[term.frame.body].append(term.frame)
        elif isinstance(term, Weight):
            for body, (_, center) in zip(term.bodies, term.points, strict=True):
                marks[body].append(center)
        elif isinstance(term, Dexterity):
            tip = term.tip_task.tip
            marks[tip.body].append(tip if isinstance(tip, Frame) else term.tip_task.origin)
    return marks


def _marks(
    bodies: Sequence[Body], constraints: Sequence[Constraint], objectives: Objectives
) -> dict[Body, list[Array]]:
    """The same, all as places (3,) in the bodies' coordinates."""
    return {
        body: [mark.origin if isinstance(mark, Frame) else mark for mark in marks]
        for body, marks in marks_of(bodies, constraints, objectives).items()
    }


def equations_of(constraints: Iterable[Constraint]) -> Iterable[Equation]:
    """The rows of joints and couplings."""
    return (equation for item in constraints for equation in getattr(item, "equations", ()))


def _lengths(constraints: Iterable[Constraint]) -> tuple[float, float]:
    """The largest length that a row asks for, and the smallest that is a limit; 0 without.

    Asked for are distances, driven slides, offsets, and what something slides a radian, as a nut or a rack does.
    """
    asked, limits = [0.0], []
    for equation in equations_of(constraints):
        (_, first), *others = equation.terms
        if first.is_angle:
            continue
        value = abs(equation.current())
        if equation.one_sided:
            limits.append(value)
        else:
            asked += [value, *(abs(factor) for factor, other in others if other.is_angle)]
    return max(asked), min((value for value in limits if value > 0.0), default=0.0)


def _farthest_target(bodies: Sequence[Body], objectives: Objectives) -> float:
    """How far what is drawn to a place is from there, at most."""
    ways = [np.zeros(3)]
    for _, term in objectives:
        if isinstance(term, PointDistance):
            ways.append(term.target - term.point.body.pose.apply(term.point.coordinates))
        elif isinstance(term, FrameDistance):
            ways.append(term.target.position - term.frame.body.pose.apply(term.frame.origin))
        elif isinstance(term, Posture) and term.reference is not None:
            # Another number of rows is refused when the term is packed.
            pairs = zip(bodies, term.reference, strict=False)
            ways += [row[:3] - body.pose.position for body, row in pairs if not body.fixed]
    return max(map(length, ways))


def _box(points: Sequence[Array]) -> float:
    """Diagonal of the box around points of a body, along its own axes."""
    return length(np.ptp(points, axis=0)) if points else 0.0


def reach_of(bodies: Sequence[Body], marks: Iterable[Sequence[ArrayLike]]) -> float:
    """The largest coordinate of a mark on its body, or of a body seen from the first one."""
    on_bodies = max((float(np.abs(np.asarray(places)).max()) for places in marks if len(places)), default=0.0)
    positions = np.array([body.pose.position for body in bodies])
    return max(on_bodies, float(np.abs(positions - positions[0]).max()))


def _farthest(points: Sequence[Array]) -> float:
    """The largest distance of two points in the world: a box would depend on how the scene is turned."""
    places = np.unique(points, axis=0)
    largest = float(np.abs(places).max())
    if not largest > 0.0:
        return 0.0
    # By a power of two, which changes no bit, so that squares neither vanish nor overflow.
    unit = 2.0 ** (np.frexp(largest)[1] - 1)
    scaled = places / unit
    square = max(float(((scaled[k:] - place) ** 2).sum(axis=1).max()) for k, place in enumerate(scaled))
    far = unit * float(np.sqrt(square))
    return far if far > ONE_PLACE * largest else 0.0
