"""What goes along a branch, in either direction from its start."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import acos
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError
from assembly.solve.solution import Solution
from assembly.studies.branches.curve import Curve, LostError, Place, Point
from assembly.studies.branches.events import Found, NotFoundError, Step, closing
from assembly.studies.branches.options import FollowOptions
from assembly.studies.branches.pieces import ASTRAY, BEYOND, after_event, begun, beside, handed_on
from assembly.studies.branches.surroundings import Surroundings

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Follower", "Way"]

# By how much a step may be longer than the last one.
LONGER = 2.0
# A step is cut in halves at most so many times for its way.
DEEPEST = 12
# Where bodies come to touch so that no proof tells it, all along a circle say, rows alone tell of a last step as short.
LAST_STEP = 1e-3


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


class Follower:
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
        if packed.keeps_apart:
            self.around = Surroundings(scene, solution._touching, settings.swept)
            place = beside(self.around, curve, place)
        try:
            self.first, self.start = begun(curve, place)
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
            handed = None if found is not None else handed_on(around, curve, here, settings.least_step)
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
            after = None if last.kind in ("end of range", "closed loop") else after_event(around, curve, last)
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
            if there is None:
                there, length = self._at_end(curve, here, length)
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

    def _at_end(self, curve: Curve, here: Point, length: float) -> tuple[Point | None, float]:
        """The point at an end of the range that a step would pass, and how far it is; None where it would pass none.

        Beyond an end there may be no such number, as no gap below zero.
        """
        rate, value = float(here.tangent[-1]) * curve.unit, here.place.value
        end = self.ends[1 if rate > 0.0 else 0]
        if not abs(end - value) <= abs(rate) * length or rate == 0.0:
            return None, length
        step = (end - value) / rate * here.tangent
        while not self.ends[0] <= value + float(step[-1]) * curve.unit <= self.ends[1]:
            step[-1] = np.nextafter(step[-1], 0.0)
        border = np.zeros(len(step))
        border[-1] = np.sign(rate)
        there = curve.corrected(here, step, border)
        if there is None:
            return None, length
        there = replace(there, place=replace(there.place, value=end))
        n = curve.columns.size
        return there, float(_gone(curve, here, there) @ np.append(here.tangent[:n], here.tangent[-1]))

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
        places, begin = list[Place](), (0.0, step.here.place)
        try:
            for stop in stops:
                places += self._halved(step, begin, stop, DEEPEST) if around.swept else [stop[1]]
                begin = stop
            if all(around.keeps(curve.held, place) for place in places) and around.goes_to(places):
                return True
        except (NotFoundError, LostError):
            return False
        # Ways as short as this one go in by nothing: what is not known is whether bodies only touch at its end.
        if meets is None or events[-1].along > LAST_STEP or not around.is_undecided:
            return False
        return around.in_the_way.bodies == meets.bodies and around.goes_untold(stops[-1][1])

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

    def _is_near(self, curve: Curve, here: Point, there: Point, length: float) -> bool:
        """Whether a step found a point of its own branch: it turned little, and went about where it was to go."""
        if _turn(curve, here, there) > 2.0 * self.settings.turn:
            return False
        meant = length * np.append(here.tangent[: curve.columns.size], here.tangent[-1])
        return bool(np.linalg.norm(_gone(curve, here, there) - meant) <= ASTRAY * length)


def _gone(curve: Curve, here: Point, there: Point) -> NDArray[np.float64]:
    """The way (n + 1,) from a point to another one: twists, and the parameter over its unit."""
    return np.append(curve.between(here.place, there.place), (there.place.value - here.place.value) / curve.unit)


def _turn(curve: Curve, here: Point, there: Point) -> float:
    """The angle between the directions of two points."""
    return acos(min(1.0, max(-1.0, float(curve.bordering(here.tangent) @ there.tangent))))
