"""A session of dragging: one thread runs the tracker's ticks and answers the browsers' requests.

Browsers, or whoever else drags, put calls into a queue and never wait; the thread takes them between ticks. What there
is to show is one frozen `Shown`, put in the place of the last.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from queue import Empty, SimpleQueue
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.errors import AssemblyError, InputError, number, positive
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Point
from assembly.kinematics.pose import Pose
from assembly.solve.solution import Solution
from assembly.tracking.tick import Step, TrackStatus
from assembly.tracking.trace import Trace
from assembly.tracking.tracker import Tracker
from assembly.view.dragging.grips import Coordinate, Grip, coordinate_of
from assembly.view.dragging.joint_values import freedoms_of, set_value
from assembly.view.dragging.pointer import Pointer
from assembly.view.dragging.shown import Held, Shown

__all__ = ["Session", "Shown"]

Array = NDArray[np.float64]
log = logging.getLogger("assembly.view")
# Number of poses that are kept for undo.
MOST_UNDONE = 100
# Seconds between two searches for the contacts to show, which take longer than a tick.
CONTACTS_EVERY = 0.05
# Seconds for which a refusal is shown, and after which a slider that sends nothing more lets go.
NOTICED, SLIDER_LEFT = 3.0, 0.6


class _Record(NamedTuple):
    """A tick that was recorded: when, toward where each drag drew, and at which poses."""

    time: float
    targets: Mapping[int, Array]
    q: Array


class Session(threading.Thread):
    """Runs a scene that is dragged.

    One tracker has a hand on every body, and those of bodies that nobody holds draw nothing: so to take hold is to
    write some numbers, and several people drag at once.

    Parameters
    ----------
    scene : Assembly
        Its bodies' poses are not changed.
    q0 : (n, 7) or Solution, optional
        Where to begin: constraints are solved from there.
    stiffness : float
        Of the springs that hands are.
    rate : float
        Ticks a second.

    Raises
    ------
    InputError
        The start leads to no pose at which the constraints hold.
    """

    def __init__(
        self, scene: Assembly, q0: ArrayLike | Solution | None = None, stiffness: float = 1.0, rate: float = 250.0
    ) -> None:
        super().__init__(name="assembly drag", daemon=True)
        self.scene = scene
        self._stiffness, self._period = positive("stiffness", stiffness), 1.0 / positive("rate", rate)
        first = scene.solve(q0)
        if not first.success:
            raise InputError(
                f"q0 leads to no pose at which the constraints hold; expected one that does: {first.message}"
            )
        self.shown = Shown(
            first.q, "SOLVED", contacts=_contacts(first), values=first.values, violation=first.feasibility
        )
        self._start = first.q
        self._calls: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._tracker: Tracker | None = None
        # Bodies that move, in the order of the tracker's hands.
        self._movable = [body for body in scene.bodies if not body.fixed]
        self._grips: list[Grip] = []
        self._drags = 0
        # Until when the last refusal is shown.
        self._noticed = 0.0
        self._undone: list[Array] = []
        self._records: list[_Record] | None = None
        self._recorded: list[_Record] = []
        # Poses that are being played, or None.
        self._frames: Iterator[Array] | None = None
        self._looked = 0.0

    def ask(self, call: Callable[[], None]) -> None:
        """Have the loop's thread make a call between two ticks."""
        self._calls.put(call)

    def stop(self) -> None:
        """End the thread."""
        self._calls.put(None)
        if self.is_alive():
            self.join()

    def run(self) -> None:
        """Take calls and ticks until `stop`; sleep while nothing is held or played and nothing is asked for."""
        if self._movable:
            # Made before anybody drags, so that the first drag need not wait for it.
            self._attempt(self._ready)
        due = perf_counter()
        while True:
            idle = not self._grips and self._frames is None
            wait = None if idle else max(0.0, due - perf_counter())
            try:
                call = self._calls.get(timeout=wait) if wait is None or wait > 0.0 else self._calls.get_nowait()
            except Empty:
                # Late ticks are not made up for: the hand is where it is now.
                due = max(due + self._period, perf_counter())
                if self._grips:
                    self._tick()
                else:
                    self._show_frame()
                continue
            if call is None:
                return
            self._attempt(call)

    def _attempt(self, call: Callable[[], object]) -> None:
        """Make a call; what it raises is said."""
        try:
            call()
        except AssemblyError as error:
            self._say(str(error))
        except Exception:
            # A fault of one call must not end the picture for everybody.
            log.exception("a call of the page failed")
            self._say("this failed; the log says how")

    def _say(self, text: str) -> None:
        """Have something read for a while, though ticks have their own words."""
        self._noticed = perf_counter() + NOTICED
        self.shown = replace(self.shown, status=text, notice=text)

    def _ready(self) -> Tracker:
        """The tracker, at the poses that are shown."""
        q = self.shown.q
        if self._tracker is None or self._tracker._has_other_contents():
            self._tracker = self.scene.tracker(self._movable, q0=q, stiffness=self._stiffness)
            for hand in range(len(self._movable)):
                self._tracker.hold(hand, None)
        elif not np.array_equal(self._tracker.q, q):
            self._tracker.restart(q)
        return self._tracker

    def grab(self, name: str, at: Array | None, client: int) -> None:
        """Begin to drag a body, at a point (3,) of the world or, without one, by its frame."""
        body, q = self.scene.body(name), self.shown.q
        row = q[self.scene.bodies.index(body)]
        pose = Pose(row[:3], row[3:])
        follow = body if at is None else body.point(*pose.inverse().apply(at))
        start = row.copy() if at is None else np.array(at, dtype=np.float64)
        self._hold(body, follow, start, client)

    def slide(self, name: str, value: float, client: int) -> None:
        """Drag a joint's coordinate ("hinge.angle") to a value; one that no hand can drag is driven for one solve."""
        wanted = np.array([number("value", value)])
        grip = next((each for each in self._grips if each.client == client), None)
        if grip is not None and grip.coordinate is not None and grip.coordinate.name == name:
            grip.pointer.move(wanted, perf_counter())
            return
        freedom = freedoms_of(self.scene).get(name)
        coordinate = None if freedom is None else coordinate_of(self.scene, name, freedom)
        if coordinate is None:
            self.set_value(name, value)
            return
        coordinate.begin_at(self.shown.values.get(name, 0.0))
        start = np.array([coordinate.value(self.shown.q)])
        held = self._hold(coordinate.body, coordinate.body, start, client, coordinate)
        if held is not None:
            held.pointer.move(wanted, perf_counter())

    def _hold(
        self, body: Body, follow: Point | Body, start: Array, client: int, coordinate: Coordinate | None = None
    ) -> Grip | None:
        """Begin a drag; None where it cannot be, and why is said."""
        if body.fixed:
            self._say(f"{body.name} is fixed")
            return None
        other = next((each for each in self._grips if each.body is body and each.client != client), None)
        if other is not None:
            self._say(f"{body.name} is held in another window, that of browser {other.client}")
            return None
        self.release(client)
        # Where this raises, nothing was taken hold of.
        tracker = self._ready()
        hand = self._movable.index(body)
        tracker.hold(hand, follow, self._stiffness)
        self._remember()
        self._frames = None
        self._drags += 1
        grip = Grip(client, hand, follow, Pointer(start, perf_counter()), self._drags, coordinate)
        self._grips.append(grip)
        place = grip.point(self.shown.q[self.scene.bodies.index(body)])
        held = Held(client, body.name, place, place, by="" if coordinate is None else coordinate.name)
        self.shown = replace(self.shown, hands=(*self.shown.hands, held))
        return grip

    def move(self, target: Array, client: int) -> None:
        """Where the mouse is: a point (3,), or a pose (7,) of a body that is held by its frame."""
        grip = next((each for each in self._grips if each.client == client and each.coordinate is None), None)
        if grip is not None and not grip.pointer.move(target, perf_counter()):
            self._say("the target is not of finite numbers; it was left out")

    def release(self, client: int) -> None:
        """Let go of what this browser holds; one that is gone lets go as well."""
        gone = [grip for grip in self._grips if grip.client == client]
        if not gone:
            return
        assert self._tracker is not None
        for grip in gone:
            self._tracker.hold(grip.hand, None)
        self._grips = [grip for grip in self._grips if grip.client != client]
        hands = tuple(hand for hand in self.shown.hands if hand.client != client)
        self.shown = replace(self.shown, hands=hands, status=self.shown.status if hands else "nothing is held")

    def _tick(self) -> None:
        assert self._tracker is not None
        now, q = perf_counter(), self.shown.q
        targets: list[Array | None] = [None] * len(self._movable)
        for grip in self._grips:
            targets[grip.hand] = grip.target(now, q)
        step = self._tracker.step(targets)
        if step.status is TrackStatus.CHANGED:
            # The next grab makes another one.
            for client in {grip.client for grip in self._grips}:
                self.release(client)
            self._tracker = None
            self._say(step.status.value)
            return
        drawn = {grip.drag: targets[grip.hand] for grip in self._grips}
        if self._records is not None:
            self._records.append(_Record(now, {k: row for k, row in drawn.items() if row is not None}, step.q))
        contacts, values = self.shown.contacts, self.shown.values
        if now - self._looked > CONTACTS_EVERY:
            self._looked, contacts, values = now, _contacts(step.solution), step.solution.values
        self.shown = replace(
            self.shown,
            q=step.q,
            status=_words(step),
            hands=tuple(self._held(grip, targets[grip.hand], step) for grip in self._grips),
            notice=self.shown.notice if now < self._noticed else "",
            violation=step.feasibility,
            seconds=step.seconds,
            contacts=contacts,
            values=values,
            ticks=self.shown.ticks + 1,
        )
        # Sliders do not say when they are let go.
        for grip in [each for each in self._grips if each.coordinate is not None]:
            if now - grip.pointer.since > SLIDER_LEFT:
                self.release(grip.client)

    def _held(self, grip: Grip, target: Array | None, step: Step) -> Held:
        assert target is not None
        place = grip.point(step.q[self.scene.bodies.index(grip.body)])
        by = "" if grip.coordinate is None else grip.coordinate.name
        return Held(grip.client, grip.body.name, place, target[:3], step.forces[grip.hand], by)

    def _remember(self) -> None:
        self._undone = [*self._undone, self.shown.q][-MOST_UNDONE:]

    def _stand(self, solution: Solution) -> None:
        """Go to a solution if it is one, else say why not."""
        if solution.success:
            self._remember()
            self.shown = replace(self.shown, q=solution.q, contacts=_contacts(solution), values=solution.values)
        self.shown = replace(
            self.shown, status=solution.message, violation=solution.feasibility, seconds=solution.seconds
        )

    def solve(self) -> None:
        """Solve the scene, its objectives among it, from where the bodies are."""
        if not self._grips:
            self._stand(self.scene.solve(self.shown.q))

    def set_value(self, name: str, value: float) -> None:
        """Have a joint's coordinate ("hinge.angle") at a value, from where the bodies are."""
        if not self._grips:
            self._stand(set_value(self.scene, name, value, self.shown.q))

    def say_mobility(self) -> None:
        """Say how many degrees of freedom there are."""
        self.shown = replace(self.shown, status=str(self.scene.mobility(self.shown.q)))

    def undo(self) -> None:
        """Go back to where the bodies were before the last drag, solve or value."""
        if not self._grips and self._undone:
            *self._undone, q = self._undone
            self._go_back(q, "gone back by one")

    def reset(self) -> None:
        """Go to where it all began."""
        if not self._grips:
            self._remember()
            self._go_back(self._start, "back at the start")

    def _go_back(self, q: Array, status: str) -> None:
        at = self.scene.solve(q, max_iterations=0)
        self.shown = replace(self.shown, q=q, contacts=_contacts(at), values=at.values, status=status)

    def record(self, on: bool) -> None:
        """Begin to record what the hand does, anew, or end it; what is asked for twice, by two browsers say, is one."""
        if on and self._records is None:
            self._records = []
        elif not on and self._records is not None:
            self._recorded, self._records = self._records, None

    def play(self, on: bool) -> None:
        """Show what was recorded, tick by tick, from its beginning; or stop there."""
        if not self._grips:
            _, poses = self.recorded
            self._frames = iter(poses) if on and len(poses) else None

    def _show_frame(self) -> None:
        assert self._frames is not None
        q = next(self._frames, None)
        if q is None:
            self._frames = None
        else:
            self.shown = replace(self.shown, q=q, contacts=(), status="what was recorded")

    @property
    def recorded(self) -> tuple[Array, Array]:
        """Times (k,) and poses (k, n, 7) of what was recorded; of ticks, not of pauses between drags."""
        rows = self._recorded if self._records is None else self._records
        if not rows:
            return np.empty(0), np.empty((0, len(self.scene.bodies), 7))
        times = np.array([row.time for row in rows])
        return times - times[0], np.array([row.q for row in rows])

    @property
    def trace(self) -> Trace:
        """The hand's motion in the drag that was recorded last; of several at once the one that began last.

        Raises
        ------
        InputError
            Fewer than two ticks were recorded.
        """
        rows = self._recorded if self._records is None else self._records
        if len(rows) < 2:
            raise InputError(f"{len(rows)} ticks were recorded; expected two at least")
        last = max(rows[-1].targets)
        kept = [row for row in rows if last in row.targets]
        if len(kept) < 2:
            raise InputError("1 tick of the last drag was recorded; expected two at least")
        times = np.array([row.time for row in kept])
        return Trace(times - times[0], np.array([row.targets[last] for row in kept]))


def _contacts(solution: Solution) -> tuple[tuple[Array, Array], ...]:
    return tuple((pair.points[0], pair.normal) for pair in solution.contacts.values() if np.isfinite(pair.gap))


def _words(step: Step) -> str:
    return step.status.value
