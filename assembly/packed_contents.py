"""A scene as it is packed for the compiled loop: once after a change, and again if a solve needs more slots.

More slots for contacts of clearances, rows for corners of contacts, joints for contacts that are lower pairs: what a
solve was found to need stays with the scene, and states of earlier solutions are converted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from typing import TYPE_CHECKING, Any, Self, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._turn import Turn
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint, Coordinate, structure_changes
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.contents import Contents
from assembly.constraints.model.joint import Joint, Sense
from assembly.constraints.packing.earlier import (
    adopted,
    differs_in_joints,
    handed_over,
    is_alike,
    is_earlier,
    is_same_scene,
    taken_over,
)
from assembly.constraints.packing.given_starts import place_starts, place_tangents
from assembly.constraints.packing.lower_pairs import LowerPair, lower_pairs
from assembly.constraints.packing.renumbered import renumbered
from assembly.constraints.packing.scene import MORE_PLACES, Packed, structure_of
from assembly.constraints.packing.scene_size import check_reach, scene_size
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.changes import changes, numbers_set
from assembly.kinematics.pose import pose_rows
from assembly.solve.scene import Scene
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.studies.fitting import Fitting

__all__ = ["PackedContents"]

Array = NDArray[np.float64]
# What a constraint is where a solve begins: a contact a joint, a joint of nearest axes one of either sense.
Seat = Joint | Sense


class PackedContents(Contents):
    """Bodies, constraints and terms, and how they are packed; see `Assembly`."""

    # Whether failed solves are not tried from elsewhere: following a branch has to end where the branch does.
    _stays_near = False

    def __init__(self, bodies: Iterable[Body] = ()) -> None:
        self._packed: Packed | None = None
        self._asked_for: list[bool] = []  # of every body whether it is fixed, of every constraint whether it counts
        self._turns_near: Mapping[Coordinate, float] = {}  # where angles are, of solves that begin at poses
        self._crowding = 1  # how many times as many places as clearances ask for
        # A solve writes where it begins and what it asks for into what is packed, and may pack it anew.
        self._turn = Turn()
        self._has_changed()
        super().__init__(bodies)

    def __copy__(self) -> Self:
        other = super().__copy__()
        other._turn = Turn()
        return other

    def _beside(self, is_mine: bool | None) -> Self:
        """What a thread uses that has no turn while the scene is busy: a copy, that nobody else has.

        Where the turn is this thread's and nobody is amid anything, the process was forked: the scene is packed anew.
        """
        if is_mine and not self._turn.holder:
            self._has_changed()
            self._turn.is_busy = False
            return self
        other = copy(self)
        # What a solve or a study has set until it ends.
        other._axes_at, other._turns_near, other._stays_near = None, {}, False
        return other

    def _has_changed(self) -> None:
        # Packed anew: of copies what a solve of the one has changed there the other does not know.
        self._packed = None
        # What was set anew (`kinematics/changes.py`) when it was as it is packed.
        self._seen: tuple[int, object] | None = None
        self._scene: Scene | None = None
        self._corners = False  # whether corners of contacts of solids are listed
        self._lower_pairs: list[LowerPair] | None = None
        self._nearest: dict[int, Joint] = {}  # joints whose axes are aligned or opposed as they are where solves begin
        self._seats: tuple[tuple[int, Seat], ...] = ()  # where the last solve began
        self._axes_at: Array | None = None  # where axes are nearest, if that is not where a solve begins
        self._packings: dict[tuple[tuple[int, Seat], ...], tuple[Packed | None, Scene | None]] = {}
        # Scenes of the same bodies without clearances, or objectives, which solves begin with; packed once.
        self._parts: dict[tuple[bool, bool], Self] = {}
        # Scenes with joints in the place of clearances, by where faces fit so.
        self._fitted: dict[bytes, Fitting] = {}

    def __getstate__(self) -> dict[str, Any]:
        """State for pickles and deep copies: what the scene is made of, without its packing, which is 100 times as
        large.

        That a solve needed more slots or rows of corners is kept, so that the copy solves as the original does.
        """
        other = copy(self)
        return {**other.__dict__, "_corners": self._corners}

    def packed(self) -> Packed:
        """The scene as the compiled loop reads it; made at first use."""
        is_new = self._seen is not changes()
        if is_new:
            self._notice_edits()
        if self._packed is not None and self._packed.stamp != structure_changes():
            # A row came or went somewhere; perhaps in another scene.
            if self._packed.structure == structure_of(self._seated_constraints()):
                self._packed.stamp = structure_changes()
            else:
                self._packed = None
        if is_new:
            if self._packed is not None and self._packed.numbers != numbers_set():
                self._with_numbers_of_now(self._packed)
            self._seen = changes()
        before = self._packed
        if before is not None and before.may_have_outgrown():
            # Nothing was a length then, a slide driven to 0 say, or only one that was rounding.
            if before.is_outgrown(scene_size(self._bodies, self._constraints, self._objectives)):
                self._packed = None
        if self._packed is None:
            if all(body.fixed for body in self._bodies):
                raise InputError(f"bodies are {[body.name for body in self._bodies]}, none moving; expected one")
            return self._pack(before)
        return self._packed

    def _part(self, has_clearances: bool, has_objectives: bool) -> Self:
        """The same bodies with some of the constraints and terms; kept until the scene has others."""
        key = has_clearances, has_objectives
        part = self._parts.get(key)
        if part is None:
            kept = [item for item in self._constraints if has_clearances or not isinstance(item, Clearance)]
            part = type(self)(self._bodies)
            part._turn = self._turn
            part._take_constraints(kept)
            for sign, objective in self._objectives if has_objectives else ():
                (part.minimize if sign > 0.0 else part.maximize)(objective)
            self._parts[key] = part
        return part

    def _notice_edits(self) -> None:
        """Forget how the scene is packed if a body became fixed or free, or a constraint enabled or disabled."""
        if self._seen is not None and self._seen[1] is changes()[1]:
            return
        asked = [body.fixed for body in self._bodies] + [item._is_asked for item in self._constraints]
        if asked != self._asked_for:
            self._asked_for = asked
            self._has_changed()

    def _with_numbers_of_now(self, before: Packed) -> Packed:
        """The scene packed with the numbers that it has now: in the same places, or anew where they make others."""
        packed: Packed | None = renumbered(before, self._bodies, self._seated_constraints, self._objectives)
        if packed is None:
            constraints = self._seated_constraints()
            packed = Packed(self._bodies, constraints, self._objectives, self._crowding, self._corners)
            packed.lineage = before.lineage
        if packed is before:
            return packed
        packed.turn = self._turn
        if packed.number_places is not None and packed.number_places is before.number_places and self._scene:
            # What solutions speak of is the same.
            packed.before, self._packed = before.before, packed
            if packed.scale != before.scale:
                self._scene = self._scene.of_size(packed.scale)
        else:
            self._take_packed(packed, before.before)
        return packed

    def _follows_numbers(self) -> bool:
        """Have the numbers of now, where nothing else was set anew since the scene was packed; whether that is so."""
        seen, now = self._seen, changes()
        if seen is None or seen[1] is not now[1] or self._packed is None:
            return False
        self._lower_pairs = None
        self._with_numbers_of_now(self._packed)
        self._seen = now
        return True

    def _pack(self, before: Packed | None) -> Packed:
        """Pack the scene, which was packed otherwise before."""
        constraints = self._seated_constraints()
        packed = Packed(self._bodies, constraints, self._objectives, self._crowding, self._corners)
        self._take_packed(packed, before)
        return packed

    def _take_packed(self, packed: Packed, before: Packed | None) -> None:
        """Have a packed scene, and what solutions of it speak of."""
        constraints = self._seated_constraints()
        seats = tuple(item for number, _ in self._seats if isinstance(item := self._constraints[number], Contact))
        self._scene = Scene(
            self.bodies, tuple(constraints), tuple(packed.contacts), tuple(packed.sides), packed.scale, seats
        )
        self._scene.axes = {item.name: item.axes for item in constraints if _takes_nearest(item)}
        packed.before, packed.turn = before, self._turn
        self._packed = packed

    def _pack_with_more_places(self) -> Packed:
        """The scene packed again, with more slots for contacts of clearances. Proofs of its pairs are kept."""
        before = self.packed()
        self._crowding *= MORE_PLACES
        packed = self._pack(before)
        packed.origin, packed.proofs = before.origin, before.proofs
        packed.stood, packed.hulled = before.stood, before.hulled
        return packed

    def _packed_as(self, packed: Packed) -> Packed | None:
        """The scene as it is packed now, if nothing but values and places are others than in an earlier one."""
        mine = self._packed
        is_same = (
            mine is not None
            and mine.origin is packed.origin
            and mine.structure == structure_of(self._seated_constraints())
        )
        return mine if is_same else None

    def _seated_constraints(self) -> list[Constraint]:
        """The constraints, and joints in place of contacts that are lower pairs where the last solve began.

        Joints of nearest axes take those of that start: another scene with the same joint may have turned it.
        """
        constraints = self._constraints.copy()
        for number, seat in self._seats:
            if isinstance(seat, Joint):
                constraints[number] = seat
            else:
                self._nearest[number]._take_axes(seat)
        return [seat for seat, item in zip(constraints, self._constraints, strict=True) if item._is_asked]

    def _take_seats(self, q0: ArrayLike | Solution | None, starts: Mapping[str, ArrayLike] | None = None) -> None:
        """Make those contacts joints that are lower pairs at a start, or were where a solution began.

        One whose pair the user starts is none of them. What was packed for others is kept for their solutions.
        """
        if self._seen is not changes():
            self._notice_edits()
            # Faces may have other radii.
            self._lower_pairs = None
        if isinstance(q0, Solution):
            packed = q0._ended.packed
            if packed is self._packed or (self._packed is not None and is_same_scene(packed, self._packed)):
                return
            kept = self._packings.items()
            known = (key for key, (other, _) in kept if other is not None and is_same_scene(packed, other))
            seats = next(known, None)
            if seats is None:
                # Of another scene like this one: seats are those where it ended.
                seats = self._seats_at(q0.q, {}) if len(q0.q) == len(self._bodies) else self._seats
        else:
            seats = self._seats_at(q0, starts if isinstance(starts, Mapping) else {})
        if seats != self._seats:
            self._packings[self._seats] = self._packed, self._scene
            self._packed, self._scene = self._packings.pop(seats, (None, None))
            self._seen = None
            self._seats = seats

    def _seats_at(self, q0: ArrayLike | None, named: Mapping[str, ArrayLike]) -> tuple[tuple[int, Seat], ...]:
        """The seats of a start, but for contacts whose pairs the user names."""
        if self._lower_pairs is None:
            self._lower_pairs = lower_pairs(self._constraints, self._objectives)
            self._nearest = {k: item for k, item in enumerate(self._constraints) if _takes_nearest(item)}
        if not self._lower_pairs and not self._nearest:
            return self._seats
        poses = dict(zip(self._bodies, self._given(q0), strict=True))
        found = [(pair.number, pair.at(poses)) for pair in self._lower_pairs]
        seats: tuple[tuple[int, Seat], ...] = tuple(
            (k, joint) for k, joint in found if joint is not None and self._constraints[k].name not in named
        )
        if self._axes_at is not None:
            poses = dict(zip(self._bodies, self._axes_at, strict=True))
        return seats + tuple((k, joint._nearest_at(poses)) for k, joint in self._nearest.items())

    @contextmanager
    def _axes_as_at(self, q: Array) -> Iterator[None]:
        """Have nearest axes as they are at poses (n, 7), wherever solves begin."""
        self._axes_at = q
        try:
            yield
        finally:
            self._axes_at = None

    @contextmanager
    def _angles_near(self, values: Mapping[Coordinate, float]) -> Iterator[None]:
        """Have angles start near values where solves begin at poses: these do not tell how often an angle turned."""
        self._turns_near = values
        try:
            yield
        finally:
            self._turns_near = {}

    def _given(self, q0: ArrayLike | None) -> Array:
        """Poses (n, 7) of a start."""
        return self.q if q0 is None else pose_rows("q0", q0, len(self._bodies))

    def _start(
        self,
        packed: Packed,
        q0: ArrayLike | Solution | None,
        starts: Mapping[str, ArrayLike] | None,
        turns: Array | None = None,
        contacts: Array | None = None,
    ) -> Array:
        """State of the loop: configuration, contact parameters (NaN: to be found), multipliers, room for results.

        Of poses the pairs of contacts may be known: `contacts` are their parameters.
        """
        is_warm = isinstance(q0, Solution)
        if isinstance(q0, Solution):
            state, is_warm = self._begun_by(packed, q0)
        else:
            state = packed.new_state()
            q = state[: packed.contacts_at].reshape(-1, 7)
            q[:] = self.q if q0 is None else pose_rows("q0", q0, len(self._bodies))
            check_reach("a coordinate of the start", float(np.abs(q[:, :3]).max()), packed.scale)
            state[packed.contacts_at : packed.angles_at] = np.nan
            if turns is not None:
                state[packed.angles] = turns
            place_tangents(packed, self._bodies, state)
            if contacts is not None:
                state[packed.contacts_at :][: len(contacts)] = contacts
        if starts is not None:
            place_starts(packed, state, starts)
        packed.refresh()
        packed.start_angles(state, is_warm)
        return state

    def _begun_by(self, packed: Packed, q0: Solution) -> tuple[Array, bool]:
        """The state in which a solve from a solution begins, and whether the turns of all angles are known."""
        return self._handed_over(packed, q0) or (self._state_of("q0", packed, q0).copy(), True)

    def _handed_over(self, packed: Packed, solution: Solution) -> tuple[Array, bool] | None:
        """What a solution hands over that is of this scene before coordinates of joints became driven, free or limited.

        And whether the turns of all angles are known. None where it is no such solution.
        """
        there, earlier = solution._scene, solution._ended.packed
        if is_same_scene(earlier, packed) or len(there.bodies) != len(self._bodies):
            return None
        bodies_are_same = all(a is b for a, b in zip(there.bodies, self._bodies, strict=True))
        are_same = _told(there.bodies, there.constraints) == _told(self._bodies, self._seated_constraints())
        if not (bodies_are_same and are_same and differs_in_joints(earlier, packed)):
            return None
        return handed_over(earlier, packed, solution._ended.state)

    def _state_of(self, name: str, packed: Packed, solution: Solution) -> Array:
        ended = solution._ended
        if ended.packed is packed:
            return ended.state
        if is_earlier(ended.packed, packed):
            return taken_over(ended.packed, packed, ended.state)
        theirs = _told(solution._scene.bodies, solution._scene.constraints)
        if theirs == _told(self._bodies, self._seated_constraints()) and is_alike(ended.packed, packed):
            return adopted(ended.packed, packed, ended.state)
        raise InputError(
            f"{name} is a solution of another assembly, or of this one before a change; expected its own, "
            "or one of a scene with the same bodies and constraints by name"
        )


def _told(bodies: Iterable[Body], constraints: Iterable[Constraint]) -> tuple[list[object], list[object]]:
    """What two scenes have in common that are the same but for numbers: one was pickled, say, or built anew."""
    solids = [(body.name, body.fixed, [side.name for side in body.faces]) for body in bodies]
    return [*solids], [(type(item), item.name) for item in constraints]


def _takes_nearest(item: Constraint) -> TypeGuard[Joint]:
    """Whether a constraint is a joint whose axes are aligned or opposed as they are where a solve begins."""
    return isinstance(item, Joint) and item.asked_axes == "nearest"
