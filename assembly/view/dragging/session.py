"""A session of dragging: one thread runs the tracker's ticks and answers the browsers' requests.

Browsers, or whoever else drags, put calls into a queue and never wait; the thread takes them between ticks. What there
is to show is one frozen `Shown`, put in the place of the last.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from queue import Empty, SimpleQueue
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.assembly import Assembly
from assembly.errors import AssemblyError, InputError, positive
from assembly.kinematics.body import Frame, Point
from assembly.kinematics.pose import Pose
from assembly.solve.solution import Solution
from assembly.tracking.tick import Step
from assembly.tracking.trace import Trace
from assembly.tracking.tracker import Tracker
from assembly.view.dragging.joint_values import set_value
from assembly.view.dragging.pointer import Pointer

__all__ = ["Session", "Shown"]

Array = NDArray[np.float64]
log = logging.getLogger("assembly.view")
# Poses that can be gone back to.
MOST_UNDONE = 100
# Seconds between looks at contacts, which take longer than a tick.
CONTACTS_EVERY = 0.05


def _origin() -> Array:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class Shown(ReadOnlyArrays):
    """What there is to show.

    Attributes
    ----------
    q : (n, 7)
    status : str
        In words.
    holder : int or None
        The browser that drags; None while nobody does.
    held : str
        Name of the body that is dragged, or "".
    point, target : (3,)
        Of the hand: where it holds the body, and where the mouse is.
    force : (3,)
        On the hand, by the tracker's stiffness.
    violation : float
        In the scene's unit.
    seconds : float
        Of the last tick, or of the last solve.
    contacts : tuple of ((3,), (3,))
        Points and normals of contacts.
    values : dict of str -> float
        Coordinates of joints by their names, those of some tenths of a second ago at most.
    ticks : int
        Since the beginning.
    """

    q: Array
    status: str = "nothing is held"
    holder: int | None = None
    held: str = ""
    point: Array = field(default_factory=_origin)
    target: Array = field(default_factory=_origin)
    force: Array = field(default_factory=_origin)
    violation: float = 0.0
    seconds: float = 0.0
    contacts: tuple[tuple[Array, Array], ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    ticks: int = 0


class _Record(NamedTuple):
    """A tick that was recorded: when, toward where, at which poses, and in which drag."""

    time: float
    target: Array
    q: Array
    drag: int


class Session(threading.Thread):
    """Runs a scene that is dragged.

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
        self._follow: Point | Frame | None = None
        self._drags = 0
        self._pointer: Pointer | None = None
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
        due = perf_counter()
        while True:
            idle = self._tracker is None and self._frames is None
            wait = None if idle else max(0.0, due - perf_counter())
            try:
                call = self._calls.get(timeout=wait) if wait is None or wait > 0.0 else self._calls.get_nowait()
            except Empty:
                # Late ticks are not made up for: the hand is where it is now.
                due = max(due + self._period, perf_counter())
                if self._tracker is not None:
                    self._tick()
                else:
                    self._show_frame()
                continue
            if call is None:
                return
            try:
                call()
            except AssemblyError as error:
                self.shown = replace(self.shown, status=str(error))
            except Exception:
                # A fault of one call must not end the picture for everybody.
                log.exception("a call of the page failed")
                self.shown = replace(self.shown, status="this failed; the log says how")

    def grab(self, name: str, at: Array | None, client: int) -> None:
        """Begin to drag a body, at a point (3,) of the world or, without one, by its frame."""
        if self.shown.holder not in (None, client):
            self.shown = replace(self.shown, status=f"{self.shown.held} is held in another window")
            return
        body, q = self.scene.body(name), self.shown.q
        if body.fixed:
            self.shown = replace(self.shown, status=f"{name} is fixed")
            return
        row = q[self.scene.bodies.index(body)]
        pose = Pose(row[:3], row[3:])
        follow = body.frame() if at is None else body.point(*pose.inverse().apply(at))
        # It may raise: nothing is taken then.
        tracker = self.scene.tracker(follow, q0=q, stiffness=self._stiffness)
        self._remember()
        self._frames = None
        self._follow, self._tracker = follow, tracker
        self._drags += 1
        start = row.copy() if at is None else np.array(at, dtype=np.float64)
        self._pointer = Pointer(start, perf_counter())
        place = start[:3]
        self.shown = replace(self.shown, holder=client, held=name, point=place, target=place)

    def move(self, target: Array, client: int) -> None:
        """Where the mouse is: a point (3,), or a pose (7,) of a body that is held by its frame."""
        if self._pointer is None or client != self.shown.holder:
            return
        if not self._pointer.move(target, perf_counter()):
            self.shown = replace(self.shown, status="the target is not of finite numbers; it was left out")

    def release(self, client: int) -> None:
        """Let go, if it is this browser that holds; one that is gone lets go as well."""
        if client == self.shown.holder:
            self._tracker = self._pointer = None
            self.shown = replace(self.shown, holder=None, held="", force=np.zeros(3), status="nothing is held")

    def _tick(self) -> None:
        assert self._tracker is not None and self._pointer is not None
        now = perf_counter()
        target = self._pointer.at(now)
        step = self._tracker.step(target)
        if self._records is not None:
            self._records.append(_Record(now, target, step.q, self._drags))
        follow = self._follow
        assert follow is not None
        row = step.q[self.scene.bodies.index(follow.body)]
        place = Pose(row[:3], row[3:]).apply(getattr(follow, "coordinates", np.zeros(3)))
        contacts, values = self.shown.contacts, self.shown.values
        if now - self._looked > CONTACTS_EVERY:
            self._looked, contacts, values = now, _contacts(step.solution), step.solution.values
        self.shown = replace(
            self.shown,
            q=step.q,
            status=_words(step),
            point=place,
            target=target[:3],
            force=step.force,
            violation=step.feasibility,
            seconds=step.seconds,
            contacts=contacts,
            values=values,
            ticks=self.shown.ticks + 1,
        )

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
        if self._tracker is None:
            self._stand(self.scene.solve(self.shown.q))

    def set_value(self, name: str, value: float) -> None:
        """Have a joint's coordinate ("hinge.angle") at a value, from where the bodies are."""
        if self._tracker is None:
            self._stand(set_value(self.scene, name, value, self.shown.q))

    def say_mobility(self) -> None:
        """Say how many degrees of freedom there are."""
        self.shown = replace(self.shown, status=str(self.scene.mobility(self.shown.q)))

    def undo(self) -> None:
        """Go back to where the bodies were before the last drag, solve or value."""
        if self._tracker is None and self._undone:
            *self._undone, q = self._undone
            self._go_back(q, "gone back by one")

    def reset(self) -> None:
        """Go to where it all began."""
        if self._tracker is None:
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
        if self._tracker is None:
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
        """The hand's motion in the drag that was recorded last.

        Raises
        ------
        InputError
            Fewer than two ticks were recorded.
        """
        rows = self._recorded if self._records is None else self._records
        if len(rows) < 2:
            raise InputError(f"{len(rows)} ticks were recorded; expected two at least")
        kept = [row for row in rows if row.drag == rows[-1].drag]
        if len(kept) < 2:
            raise InputError("1 tick of the last drag was recorded; expected two at least")
        times = np.array([row.time for row in kept])
        return Trace(times - times[0], np.array([row.target for row in kept]))


def _contacts(solution: Solution) -> tuple[tuple[Array, Array], ...]:
    return tuple((pair.points[0], pair.normal) for pair in solution.contacts.values() if np.isfinite(pair.gap))


def _words(step: Step) -> str:
    return step.status.value
