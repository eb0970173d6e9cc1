"""The result of a tick: its status, and the bodies, forces and contacts."""

from __future__ import annotations

from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays, read_only
from assembly.errors import InputError
from assembly.proximity.manager.events import Event, events_of
from assembly.proximity.manager.records import EVENT_COUNT
from assembly.solve.loop.settings import COUNT, CURVED, DUAL, HISTORY, OBJECTIVE, VIOLATION
from assembly.solve.scene import Status
from assembly.solve.solution import Solution
from assembly.tracking.followed import Followed
from assembly.tracking.hands import Targets

__all__ = ["Step", "TrackStatus"]

Array = NDArray[np.float64]


class TrackStatus(Enum):
    """How a tick ended; the value says it in a sentence.

    Under a clearance a pose holds only where it is proven that bodies are clear or touch, at it and on the way there.
    """

    FOLLOWED = "the constraints hold and the pose is as near to the target as they allow"
    APPROACHING = "the constraints hold; the next tick continues toward the target"
    LATE = "the time was spent; the constraints hold at the pose returned"
    HELD = "no further pose was found that holds; the last one that does is returned"
    BAD_TARGET = "the target is no finite point or pose; nothing moved"
    VIOLATED = "the constraints hold at no pose that was found; the violation says by how much"
    CHANGED = (
        "since the tracker was made a body, a constraint or a term was added or removed, or a constraint gained or "
        "lost a row, or a frame, a shape, a least gap or what is fixed or enabled was set anew; nothing moved, "
        "make another one"
    )


class Step(ReadOnlyArrays):
    """The result of a tick. Tables are computed when they are read; arrays are read-only.

    A step that is LATE at the pose of the step before also has that step's violation, iterations and objective.

    Attributes
    ----------
    q : (n, 7)
        One row per body: x y z qw qx qy qz.
    feasibility : float
        Largest violation of a constraint at `q`, in the user's units.
    status : TrackStatus
    force, wrench : (3,), (6,)
        What the assembly exerts on the hand: force, then torque about the followed point, world axes; stiffness times
        the distance from the target. For several targets read `forces` and `wrenches`.
    forces, wrenches : (k, 3), (k, 6)
        The same for every target.
    is_minimum : bool or None
        Whether the second derivative along what the constraints leave free is positive definite; None if not asked.
    iterations : int
    seconds : float
        From the call of `step` to its end.
    events : tuple of Event
        Contacts of clearances that appeared, disappeared, were handed off or merged in this tick.
    proved : bool
        Whether bodies that clearances keep apart are proven to be clear or to touch only, at the pose and on the way to
        it. False if the constraints do not hold, and if faces lie on each other so that only rows keep them apart.
    way_depth : float
        The largest overlap that bodies which touch may have on the way to the pose.
    solution : Solution
        The same pose as a solution: contacts, multipliers, wrenches of every constraint.
    """

    def __init__(
        self,
        followed: Followed,
        state: Array,
        status: TrackStatus,
        target: Targets,
        seen: float,
        seconds: float,
        way_depth: float | None = 0.0,
    ) -> None:
        self._followed = followed
        self._state = state
        self._target = target
        self.status = status
        self._seen = seen
        self.seconds = seconds
        self.proved = way_depth is not None and status is not TrackStatus.VIOLATED
        self.way_depth = 0.0 if way_depth is None else way_depth

    @cached_property
    def q(self) -> Array:
        """Configuration, (n, 7)."""
        return read_only(self._state[: self._followed.packed.contacts_at].reshape(-1, 7).copy())

    def _result(self, place: int) -> float:
        return float(self._state[self._followed.packed.results_at + place])

    @property
    def feasibility(self) -> float:
        """Largest violation of a constraint, in the user's units."""
        return self._result(VIOLATION)

    @property
    def stationarity(self) -> float:
        """Largest component of the Lagrangian's gradient, scaled."""
        return self._result(DUAL)

    @property
    def objective(self) -> float:
        """The objective, including the energy of the spring to the target."""
        return self._result(OBJECTIVE) * self._followed.packed.unit

    @property
    def iterations(self) -> int:
        """Steps of the loop."""
        return int(self._result(COUNT))

    @property
    def is_minimum(self) -> bool | None:
        """Whether the reduced Hessian is positive definite; None where it was not asked for."""
        return {0.0: None, 1.0: True}.get(self._result(CURVED), False)

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Events of contacts since the step before."""
        followed, packed = self._followed, self._followed.packed
        if not packed.clearance_rows or self._state[packed.memory_at + EVENT_COUNT] == self._seen:
            return ()
        return events_of(self._state[packed.memory_at :], followed.names, packed.scale, int(self._seen))

    @cached_property
    def wrenches(self) -> Array:
        """Force and torque on the hand at every target, (k, 6)."""
        return read_only(self._followed.hands.wrenches(self.q, self._target))

    @property
    def forces(self) -> Array:
        """Force on the hand at every target, (k, 3)."""
        return self.wrenches[:, :3]

    @property
    def wrench(self) -> Array:
        """Force and torque on the hand, (6,)."""
        if len(self.wrenches) > 1:
            raise InputError(
                f"the tracker has {len(self.wrenches)} hands; read forces or wrenches, with a row for each hand"
            )
        wrench: Array = self.wrenches[0]
        return wrench

    @property
    def force(self) -> Array:
        """Force on the hand, (3,)."""
        return self.wrench[:3]

    @cached_property
    def solution(self) -> Solution:
        """The pose as a solution."""
        followed = self._followed
        status = followed.begun if self.status is TrackStatus.FOLLOWED else Status.ITERATION_LIMIT
        # A solution writes what it tracks; the tracker goes back to the state of its last step.
        state = self._state.copy()
        solution = Solution(followed.scene, followed.packed, state, status, self.seconds, np.empty((0, HISTORY)))
        solution._is_sampled = not self.proved
        return solution

    def __repr__(self) -> str:
        return f"Step({self.status.name}, feasibility={self.feasibility:.1e}, {1e6 * self.seconds:.0f} us)"
