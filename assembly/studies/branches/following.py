"""`asm.follow`: one branch of solutions, as a number of the scene changes, through its turning points.

Pseudo-arclength continuation (H. B. Keller 1977): from a point a step along the branch's tangent, and Newton's method
in the plane across it leads back onto the branch. The parameter is an unknown as poses are, so that nothing is singular
where it turns back. Where a branch crosses another one, the determinant of the equations' matrix, bordered by the
tangent, changes its sign; steps go over that along their own branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import acos
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.derivatives.implicit import check_is_of, several, the_scene
from assembly.derivatives.measure import Measure
from assembly.derivatives.numbers import ControlPoint, ControlWeight, LeastGap, ShapeNumber
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError, bounded
from assembly.proximity.clearance.proof import LEAST_SIZE
from assembly.solve.clearance_proof import can_prove
from assembly.solve.solution import Solution
from assembly.studies.branches.curve import Curve, LostError, Place, Point
from assembly.studies.branches.events import Found, NotFoundError, Step, closing
from assembly.studies.branches.options import FollowOptions
from assembly.studies.branches.result import Branch, branch_of
from assembly.studies.branches.slots import rows_of_slots
from assembly.studies.branches.surroundings import AT_BOUND, CrowdedError, Surroundings

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["follow"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# Singular values of the equations, over the largest, that are none where a branch begins.
FLAT = 1e-10
EXPECTED = "expected rows that determine the poses, or an objective that has one best pose"
# Forces that push, over the objective's unit; rates of gaps along a branch that are none.
PUSHING, STILL = 1e-9, 1e-9
# By how much a step may be longer than the last one; and how far the corrector may lead, in parts of the step.
LONGER, ASTRAY = 2.0, 0.25
# A step is cut in halves at most so many times to prove its way.
DEEPEST = 12
# Where bodies come to touch so that no proof tells it, all along a circle say, rows alone tell of a last step as short.
LAST_STEP = 1e-3
# Where a contact that holds ends is found to this, in parts of the size; others that take over are looked for so far
# beyond.
ENDED, BEYOND = 1e-12, 1e-6
# Numbers with which faces, or the gaps that are proven, change.
OF_FACES = (ControlPoint, ControlWeight, LeastGap, ShapeNumber)


@dataclass(eq=False)
class Way:
    """What was found in one direction: places along it, how far they are, and events by the place's number."""

    places: list[Place] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    events: list[tuple[int, Found]] = field(default_factory=list)
    proved: list[bool] = field(default_factory=list)
    closure: float | None = None

    def add(self, place: Place, length: float, around: Surroundings | None) -> None:
        """Add a place, and whether bodies are proven to be clear there."""
        self.proved.append(around is None or around.proved)
        self.places.append(place)
        self.lengths.append(length)


def follow(
    scene: Assembly,
    parameter: Parameter,
    low: float,
    high: float,
    *,
    of: Measure | Sequence[Measure] = (),
    start: Solution | None = None,
    **options: Any,
) -> Branch:
    """Follow the branch of a solution while a parameter goes from one end of a range to the other.

    The branch is followed both ways from the start, through turning points of the parameter, until it leaves the range,
    closes, or ends; docs/branches.md lists the events. The scene's own number is restored afterwards.

    Parameters
    ----------
    scene : Assembly
        Rows must determine the poses, or an objective must.
    parameter : Parameter
        One that is set in place, or makes faces.
    low, high : float
        The range, which has the parameter's value in it.
    of : Measure or several, optional
        Measures that the table has.
    start : Solution, optional
        Of the scene as it is now; solved by default.
    **options
        See `FollowOptions`.

    Raises
    ------
    InputError, TypeError
        A range without the parameter's value, a start that failed or at which bodies are not known to be clear, a scene
        with free motions and no objective; `swept` without a clearance, or of a number that makes faces.
    """
    the_scene(scene)
    if not isinstance(parameter, Parameter):
        raise TypeError(f"parameter is {parameter!r}; expected a Parameter")
    settings = FollowOptions.of(options)
    low, high = bounded("low", low), bounded("high", high)
    check_is_of("parameter", scene, parameter)
    value = parameter.value
    if not low <= value <= high or not low < high:
        raise InputError(
            f"low and high are {low:g} and {high:g}; expected low below high, and {parameter.name} = {value:g}, from "
            "where the branch is followed, in between"
        )
    measures = () if isinstance(of, (tuple, list)) and not of else several("of", of, Measure)
    _check_clearances(scene, parameter, settings)
    solution = scene.solve() if start is None else start
    if not isinstance(solution, Solution):
        raise TypeError(f"start is {start!r}; expected a Solution")
    if not solution.success:
        raise InputError(
            f"start is {solution.status.name} at {parameter.name} = {value:g}; expected a solution that succeeded: "
            f"{solution.message}"
        )
    try:
        while True:
            try:
                follower = _Follower(scene, parameter, (low, high), settings, solution)
                ways = follower.ways()
                return branch_of(follower.first, ways, measures, follower.depth)
            except CrowdedError:
                # With more slots it begins anew: rows are others.
                parameter._number.put(value)
                scene._pack_with_more_places()
    finally:
        parameter._number.put(value)
        scene.packed().refresh()


def _check_clearances(scene: Assembly, parameter: Parameter, settings: FollowOptions) -> None:
    """Raise where what is asked of clearances cannot be told."""
    packed = scene.packed()
    if settings.swept and not packed.keeps_apart:
        raise InputError("swept is True where no clearance keeps bodies apart; expected one, asm.Clearance()")
    if packed.keeps_apart and not can_prove(packed):
        low, high = LEAST_SIZE, 1.0 / LEAST_SIZE
        raise InputError(f"scene has clearances and a size of {packed.scale:g}; expected {low:g} to {high:g}")
    if settings.swept and isinstance(parameter._number, OF_FACES):
        raise InputError(
            f"swept is True for {parameter.name}, with which faces or least gaps change; expected a number with which "
            "bodies move"
        )


class _Follower:
    """What goes along a branch."""

    def __init__(
        self,
        scene: Assembly,
        parameter: Parameter,
        ends: tuple[float, float],
        settings: FollowOptions,
        solution: Solution,
    ) -> None:
        packed = scene.packed()
        self.ends, self.settings = ends, settings
        self.is_angle = parameter._number.unit == "rad"
        length = packed.scale if parameter._number.unit == "length" else ends[1] - ends[0]
        state = scene._state_of("start", packed, solution).copy()
        place = Place(packed, state, parameter.value, np.zeros(packed.rows))
        curve = Curve(scene, parameter, 1.0 if self.is_angle else length, settings.tolerance)
        self.around: Surroundings | None = None
        # Bodies that were found to meet where no proof tells that they only touch.
        self._untold: set[tuple[str, ...]] = set()
        if packed.keeps_apart:
            self.around = Surroundings(scene, solution._touching, settings.swept)
            place = _beside(self.around, curve, place)
        try:
            self.first, self.start = _begun(curve, place)
        except LostError:
            raise InputError("start is at a fold of a contact; expected a pose near it") from None

    @property
    def depth(self) -> float:
        """The largest overlap that bodies may have had on the way; NaN where that was not asked for."""
        return self.around.depth if self.around is not None and self.around.swept else float("nan")

    def ways(self) -> list[Way]:
        """What is found as the parameter grows at first, and, if that is no loop, as it shrinks."""
        grows = 1.0 if self.start.tangent[-1] >= 0.0 else -1.0
        ways = [self._way(grows)]
        if ways[0].closure is None:
            ways.append(self._way(-grows))
        return ways

    def _way(self, sign: float) -> Way:
        """What is found in one direction from the start."""
        curve, settings = self.first, self.settings
        here = start = curve.point(self.start.place, sign * curve.bordering(self.start.tangent), self.start.basis)
        way, length, along, around = Way(), settings.first_step, 0.0, self.around
        if around is not None:
            around.begin(here.place)
        way.add(here.place, 0.0, around)
        for _ in range(settings.max_steps):
            found = self._stepped(curve, here, length, start if len(way.places) > 2 and curve is self.first else None)
            handed = None if found is not None else self._handed_on(curve, here)
            if handed is not None:
                end, gone, row, (curve, here) = handed
                way.add(end.place, along + gone, around)
                way.events.append((len(way.places) - 1, Found("contact over an edge", row, gone, end.place, end)))
                along += gone + BEYOND
                way.add(here.place, along, around)
                length = settings.first_step
                continue
            if found is None:
                meets = None if around is None else around.in_the_way
                way.events.append((len(way.places) - 1, Found("lost", -1, 0.0, here.place, here, True, meets)))
                return way
            step, events, off = found
            for event in events:
                if event.along > 0.0:
                    way.add(event.place, along + event.along, around)
                way.events.append((len(way.places) - 1, event))
            last = events[-1] if events and events[-1].ends else None
            if last is None:
                along += step.length
                way.add(step.there.place, along, around)
                turn = _turn(curve, here, step.there)
                length = min(settings.largest_step, step.length * min(LONGER, settings.turn / max(turn, 1e-9)))
                here = step.there
                continue
            way.closure = off
            along += last.along
            after = None if last.kind in ("end of range", "closed loop") else self._after(curve, last)
            if after is not None and around is not None and around.untold:
                # Nor is anything known of what is beyond.
                way.events.append((len(way.places) - 1, Found("lost", -1, 0.0, last.place, here, True, last.meets)))
                return way
            # A row that comes and goes at one place ends the branch: there is no way on that pushes or opens.
            if after is None or (curve is not self.first and last.along == 0.0):
                return way
            curve, here = after
            length = settings.first_step
        way.events.append((len(way.places) - 1, Found("step limit", -1, 0.0, here.place, here, True)))
        return way

    def _stepped(
        self, curve: Curve, here: Point, length: float, start: Point | None
    ) -> tuple[Step, list[Found], float | None] | None:
        """A step, its events, and how far from the start it closes; None where none of any length is found."""
        while length >= self.settings.least_step:
            there = curve.corrected(here, length * here.tangent)
            if there is not None and self._is_near(curve, here, there, length):
                step = Step(curve, here, there, length, self.ends, self.around)
                try:
                    closed = None if start is None else closing(step, start, self.is_angle)
                    events = step.events()
                except NotFoundError:
                    length *= 0.5
                    continue
                off = None
                if closed is not None:
                    events = [event for event in events if event.along < closed[0].along]
                    if not (events and events[-1].ends):
                        events, off = [*events, closed[0]], closed[1]
                if self._is_clear(step, events):
                    return step, events, off
            length *= 0.5
        return None

    def _is_clear(self, step: Step, events: list[Found]) -> bool:
        """Whether bodies are proven clear all along a step, at its events and at its end; then the next goes on there.

        With `swept` it is cut in halves until the branch is as good as straight between their ends.
        """
        around, curve = self.around, step.curve
        if around is None:
            return True
        stops = [(event.along, event.place) for event in events if event.along > 0.0]
        if not (events and events[-1].ends):
            stops.append((step.length, step.there.place))
        meets = events[-1].meets if events and events[-1].ends else None
        if meets is not None and meets.bodies in self._untold:
            return events[-1].along <= LAST_STEP and around.goes_untold(stops[-1][1])
        places, begin = list[Place](), (0.0, step.here.place)
        try:
            for stop in stops:
                places += self._halved(step, begin, stop, DEEPEST) if around.swept else [stop[1]]
                begin = stop
            if all(around.keeps(curve.held, place) for place in places) and around.goes_to(places):
                return True
        except (NotFoundError, LostError):
            return False
        if meets is not None and around.is_undecided and around.in_the_way.bodies == meets.bodies:
            self._untold.add(meets.bodies)
        return False

    def _halved(self, step: Step, begin: tuple[float, Place], end: tuple[float, Place], times: int) -> list[Place]:
        """Places along a step, the last one at its end, between which it is as good as straight."""
        around = self.around
        assert around is not None
        middle = 0.5 * (begin[0] + end[0])
        place = step.at(middle).place
        if around.is_straight(begin[1], place, end[1]):
            return [end[1]]
        if times == 0:
            raise NotFoundError
        halves = (begin, (middle, place)), ((middle, place), end)
        return [found for one, other in halves for found in self._halved(step, one, other, times - 1)]

    def _handed_on(self, curve: Curve, here: Point) -> tuple[Point, float, int, tuple[Curve, Point]] | None:
        """Where a contact that holds ends a little beyond a point, and others take over there.

        A corner that leaves its face, say, which edges carry from then on. The last point, how far it is, the row that
        ends there, and the equations with a point beyond; None where there is nothing like that.
        """
        around = self.around
        if around is None or not (curve.held & _own(here.place)).any():
            return None
        low, high, end = 0.0, 2.0 * self.settings.least_step, here
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

    def _after(self, curve: Curve, event: Found) -> tuple[Curve, Point] | None:
        """The equations after an event at which rows come or go, and the point; None where the branch ends there."""
        around, place = self.around, event.place
        if around is None:
            return _switched(curve, event)
        own = _own(place)
        if not own[event.row]:
            return _switched(curve, event)
        if curve.held[event.row]:
            return _without_contacts(around, curve, place, curve.held & own & (place.forces > -PUSHING))
        closed = ~curve.held & own & (around.gaps(place) <= AT_BOUND)
        return _with_contacts(around, curve, place, closed)

    def _is_near(self, curve: Curve, here: Point, there: Point, length: float) -> bool:
        """Whether a step found a point of its own branch: it turned little, and went about where it was to go."""
        if _turn(curve, here, there) > 2.0 * self.settings.turn:
            return False
        gone = np.append(
            curve.between(here.place, there.place), (there.place.value - here.place.value) / self.first.unit
        )
        meant = length * np.append(here.tangent[: curve.columns.size], here.tangent[-1])
        return bool(np.linalg.norm(gone - meant) <= ASTRAY * length)


def _turn(curve: Curve, here: Point, there: Point) -> float:
    """The angle between the directions of two points."""
    return acos(min(1.0, max(-1.0, float(curve.bordering(here.tangent) @ there.tangent))))


def _beside(around: Surroundings, curve: Curve, place: Place) -> Place:
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
        rates = np.array([other.rate(point, row) for row in np.flatnonzero(opened).tolist()])
        sign = -1.0 if rates.sum() < 0.0 else 1.0
        closing = sign * rates < -STILL
        if not closing.any():
            alone = around.holding(point.place, held)
            return other, other.point(alone, sign * other.bordering(point.tangent), point.basis)
        opened[np.flatnonzero(opened)[closing]] = False
    return None


def _begun(curve: Curve, place: Place) -> tuple[Curve, Point]:
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
        rate = other.rate(point, row)
        sign = -1.0 if rate < 0.0 else 1.0
    if len(point.equations) != len(point.tangent) - 1 or point.basis.shape[1] > n:
        return None
    return other, other.point(point.place, sign * other.bordering(point.tangent), point.basis)
