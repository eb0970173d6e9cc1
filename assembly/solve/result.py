"""The end of a solve: the state of the loop, and what follows from it directly. `Solution` has the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from assembly._named import Named
from assembly._read_only import ReadOnlyArrays, read_only
from assembly._turn import Turn
from assembly.constraints.model.joint import Joint, Sense
from assembly.constraints.packing.scene import Packed
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.loop.settings import COUNT, HISTORY, VIOLATION
from assembly.solve.measure import measure, standing
from assembly.solve.options import Options
from assembly.solve.scene import Scene, Status

if TYPE_CHECKING:
    from assembly.solve.clearance_proof import PairAnswer
    from assembly.solve.second_order.classification import SecondOrder
    from assembly.solve.second_order.leave import Fit
    from assembly.solve.way import Way

__all__ = ["Ended", "Iteration", "Result"]

Array = NDArray[np.float64]
# A constraint that is off by less than this part of the worst is not one of those that disagree.
IDLE = 1e-3
_new, _new_tuple = object.__new__, tuple.__new__
# To read a member of an enumeration takes as long as to set five attributes.
_SOLVED = Status.SOLVED


class Ended(NamedTuple):
    """A packed scene, and the state of the loop that a solve of it ended with."""

    packed: Packed
    state: Array


class Iteration(tuple[float, ...]):
    """Names of the columns of `Solution.history`."""

    COLUMNS = ("objective", "feasibility", "stationarity", "penalty", "regularization", "step", "radius")


class Result(ReadOnlyArrays):
    """The state that a solve ended with; `Solution` documents the attributes."""

    way: Way | None = None
    # What few solutions have otherwise. Made for every one, they would be a part of what a warm solve takes.
    restarted = False
    put_together = False
    # Of a start that was returned as it is: what lists the contacts of clearances there.
    _lists: Callable[[Result], Ended] | None = None
    # Of a solution at which bodies rest: the joints by which it was found, for solves that go on from it.
    _rest: object = None
    _clear: Sequence[PairAnswer] = ()
    # Of a tick: whether samples stand for its proof.
    _is_sampled = False
    # How much bodies may overlap and still count as touching, in parts of the scene's size.
    _touching = Options.touching
    _order: SecondOrder | None = None
    _fit: Fit | None = None
    # What the objective asked for, where `_asked` does not tell; flat contacts alone need it again, for the center of
    # their pressure.
    _targets: bytes | None = None
    # Where the solve began, if postures are measured from there.
    _begun: Array | None = None

    def __init__(
        self,
        scene: Scene,
        packed: Packed,
        state: Array,
        status: Status,
        seconds: float,
        history: Array | bytes,
        order: SecondOrder | None = None,
        fit: Fit | None = None,
    ) -> None:
        self._scene = scene
        # As `Ended(packed, state)`, which goes through a function of Python's.
        self._ended = _new_tuple(Ended, (packed, state))
        # As bytes where they were read from the memory of a solve, which takes half the time of an array.
        self._figures = history
        self.status = status
        self.seconds = seconds
        if order is not None:
            self._order = order
        if fit is not None:
            self._fit = fit
        # What it was solved with: a solve that goes on from it may ask for the way.
        self._asked = packed.asked
        if scene.contacts:
            self._targets = scene.targets_in(packed)
        if packed.follows_start:
            self._begun = packed.begun_at()

    @classmethod
    def _arrived(cls, scene: Scene, packed: Packed, state: Array, seconds: float, history: Array | bytes) -> Self:
        """The end of a solve at which the loop arrived at once, of what `packed` is asked for now; soon made."""
        if not packed.is_asked_whole and (scene.contacts or packed.follows_start):
            return cls(scene, packed, state, Status.SOLVED, seconds, history)
        self = _new(cls)
        self._scene = scene
        self._ended = _new_tuple(Ended, (packed, state))
        self._figures = history
        self.status = _SOLVED
        self.seconds = seconds
        self._asked = packed.asked
        return self

    @property
    def _turn(self) -> Turn:
        """That of its scene, whose packing it shares."""
        return self._ended.packed.turn

    def _list_contacts(self) -> None:
        """List the contacts of clearances, unless they are: a start that holds is returned before any is looked for."""
        if self._lists is None:
            return
        with self._turn.entry():
            # Another thread may have listed them meanwhile.
            if self._lists is not None:
                self._ended = self._lists(self)
                self._lists = None

    @property
    def _packed(self) -> Packed:
        if self._lists is not None:
            self._list_contacts()
        return self._ended.packed

    @property
    def _state(self) -> Array:
        if self._lists is not None:
            self._list_contacts()
        return self._ended.state

    @cached_property
    def q(self) -> Array:
        """Configuration, (n, 7)."""
        packed, state = self._ended
        return read_only(state[: packed.contacts_at].reshape(-1, 7).copy())

    @property
    def proved(self) -> bool:
        """Whether it is proven that all pairs of bodies which clearances keep apart are clear, or only touch.

        False at an end that is not SOLVED or FITTED, where faces lie on each other and samples stand for the proof, and
        where a clearance asks for a gap above zero beside a contact of the same bodies.
        """
        return self.success and not self._is_sampled and all(pair.proved for pair in self._clear)

    @property
    def _parameters(self) -> Array:
        return self._state[self._packed.contacts_at : self._packed.angles_at].reshape(-1, TRACK)

    @property
    def _residuals(self) -> Array:
        return self._state[self._packed.residuals_at : self._packed.results_at]

    def _result(self, place: int) -> float:
        packed, state = self._ended
        return float(state[packed.results_at + place])

    @property
    def iterations(self) -> int:
        """Steps of the loop."""
        return int(self._result(COUNT))

    @property
    def _is_lost(self) -> bool:
        """Whether the loop could not evaluate its rows at the pose, because a contact had no pair there."""
        return bool(self._scene.contacts) and self._result(VIOLATION) == np.inf

    @property
    def _rows(self) -> Array:
        """One row per iteration."""
        figures = self._figures
        return np.frombuffer(figures).reshape(-1, HISTORY) if isinstance(figures, bytes) else figures

    @property
    def history(self) -> Array:
        """One row per iteration, columns `Iteration.COLUMNS`; none where a contact was lost at the start."""
        return read_only(self._rows[: 0 if self._is_lost and self.iterations == 0 else self.iterations + 1])

    @property
    def success(self) -> bool:
        """Whether the status is SOLVED or FITTED."""
        return self.status is Status.SOLVED or self.status is Status.FITTED

    def _largest(self, unit: float) -> dict[str, float]:
        """The largest violation of every constraint's rows, lengths in a unit."""
        packed = self._packed
        each = np.where(packed.one_sided, np.maximum(-self._residuals, 0.0), np.abs(self._residuals))
        largest = self._by_constraint(np.where(packed.lengths, each / unit, each))
        for pair in self._clear:
            if not pair.holds:
                largest[pair.clearance] = max(largest[pair.clearance], pair.answer.depth / unit)
        return largest

    def _by_constraint(self, each: Array) -> dict[str, float]:
        """The largest of what every constraint's rows have."""
        return Named(
            (constraint.name, float(each[rows].max(initial=0.0)))
            for constraint, rows in zip(self._scene.constraints, self._packed.spans, strict=True)
        )

    @property
    def _allowed(self) -> float:
        """What rows that repeat each other may disagree by, over the size."""
        return Options.fit if self._fit is None else self._fit.allowed

    @cached_property
    def disagreeing(self) -> dict[str, float]:
        """Constraints that repeat each other and disagree, and how far each is off: lengths, radians; worst first."""
        if self._fit is None or self._fit.apart is None:
            return {}
        packed = self._packed
        off = np.abs(self._fit.apart)
        parts = self._by_constraint(off)
        amounts = self._by_constraint(np.where(packed.lengths, off * packed.scale, off))
        least = IDLE * max(parts.values())
        return {name: amounts[name] for name in sorted(parts, key=lambda name: -parts[name]) if parts[name] > least}

    @cached_property
    def multipliers(self) -> dict[str, Array]:
        """Multipliers of every constraint's rows, by name: forces and torques when the objective is an energy."""
        packed = self._packed
        forces = self._state[packed.multipliers_at : packed.residuals_at] * packed.unit
        forces = np.where(packed.lengths, forces / packed.scale, forces)
        return Named(
            (constraint.name, read_only(forces[rows]))
            for constraint, rows in zip(self._scene.constraints, packed.spans, strict=True)
        )

    @property
    def axes(self) -> dict[str, Sense]:
        """Of joints that take nearest axes, by name, whether these are aligned or opposed here."""
        return self._scene.axes.copy()

    @cached_property
    def values(self) -> dict[str, float]:
        """Every coordinate of every joint, "joint.freedom": lengths in the user's unit, angles in radians."""
        return Named(
            (f"{joint.name}.{name}", self._value(joint, name))
            for joint in self._scene.constraints
            if isinstance(joint, Joint)
            for name in joint.freedoms
        )

    def _value(self, joint: Joint, name: str) -> float:
        """One coordinate of one joint."""
        packed, state = self._ended
        coordinate = joint._coordinate_in(name, self._scene.axes.get(joint.name))
        near = 0.0
        for k, other in enumerate(packed._angles):
            if other is coordinate:
                near = float(state[packed.angles][k])
                break
        pair = coordinate.frames
        places = self._scene.index(pair.frame_a.body), self._scene.index(pair.frame_b.body)
        poses = state[: packed.contacts_at].reshape(-1, 7)
        return measure(coordinate, standing(coordinate, poses, places), near)

    def _pool_as_solved(self) -> Array:
        """The pool with the objective as it was in this solve."""
        if self._targets is None:
            return self._packed.as_asked(self._asked).pool
        pool = self._packed.pool.copy()
        pool[self._scene.target_places(self._packed)] = np.frombuffer(self._targets)
        return pool

    def pose(self, body: Body | str) -> Pose:
        """Pose of a body, given itself or its name."""
        row = self.q[self._scene.index(body)]
        return Pose(row[:3], row[3:])
