"""A scene turned into the table and the pool that the compiled loop works on (`constraints/program/records.py`)."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import cached_property
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of, rows_of
from assembly._turn import Turn
from assembly.constraints.model.constraint import Constraint, RowConstraint, structure_changes
from assembly.constraints.model.objectives import Objective, Posture
from assembly.constraints.packing import manager as manager_packing
from assembly.constraints.packing.asked import Asked
from assembly.constraints.packing.scene_size import check_reach, size_and_extent
from assembly.constraints.packing.written_scene import WrittenScene
from assembly.constraints.program import records as layout
from assembly.constraints.program.coordinates_at import coordinates_at
from assembly.constraints.program.kept import kept_size, kept_unknowns
from assembly.constraints.program.objective_terms import POSTURE, POSTURE_FIELDS, TERM, TERM_RECORD
from assembly.constraints.program.primitives import RECORD as JOINT_FRAMES
from assembly.errors import FARTHEST
from assembly.kinematics.body import Body
from assembly.kinematics.changes import numbers_set
from assembly.proximity.features.solid_contact import TRACK
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager.events import fresh_memory, listed_places
from assembly.proximity.manager.parameters import LARGEST_MARGIN

if TYPE_CHECKING:
    from assembly.constraints.packing.number_places import NumberPlaces
    from assembly.proximity.clearance.proof import ClearanceProof
    from assembly.solve.workspace import Workspace

__all__ = ["MORE_PLACES", "MOST_CROWDING", "Packed", "structure_of"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# A size that rests on values alone is another one where they have grown or shrunk by this factor.
OUTGROWN = 1e4

# Bytes of a state, what touching is, and what was proven there.
Stood = tuple[bytes, float, Sequence[Any] | None]
OwnedPairs = list[Any]
# By what each was asked, and what is told.
Hulled = tuple[tuple[bytes, Any], ...]
# How many times as many places as they ask for a solve gives to clearances.
MORE_PLACES, MOST_CROWDING = 4, 16
# Numbers of the pose that a posture is measured from.
REFERENCE = 7
_put_place: Callable[..., None] = Struct("3d").pack_into
# Numbers of pools that are not as they were packed (0).
_versions = itertools.count(1)


class Packed(WrittenScene):
    """A packed scene: arrays for the loop, and what is needed to refresh them between solves.

    Parameters
    ----------
    bodies, constraints
    objectives : sequence of (sign, term)
        1 to minimize, -1 to maximize; a posture where there is none.
    places : int
        Clearances have so many times the places they ask for.
    corners : bool
        Whether the corners of contacts of solids are listed (`packing/corners.py`).
    size : float, optional
        What lengths are divided by; the scene's size by default.

    Attributes
    ----------
    table, pool : arrays
        See `constraints/program/records.py`. Lengths in the pool are divided by `scale`.
    origin : object
        The same of a scene that is packed again with more places, and of no other one.
    kept_at, kept_size : int
        Where in a state, and how long, what a solve leaves for the next one is (`program/kept.py`).
    workspaces : list of Workspace
        What solves that are over worked in, for the next ones (`solve/workspace.py`).
    proofs : list of ClearanceProof
        Of the pairs that clearances keep apart, of solves that have ended.
    stood : (bytes, float, list) or None
        Poses, with pairs of contacts, that were proven to hold as they stand; what touching was; what was proven.
    hulled : tuple
        What hulls of faces tell at the last poses that were asked for (`solve/clearance_proof.py`), the newest first.
    owned_pairs : list or None
        Clearances and the pairs of bodies that they keep apart (`solve/clearance_proof.py`), once asked.
    asked : Asked
        What the last solve was asked for.
    number_places : NumberPlaces or None
        Where numbers are that were set anew; the same of twins, which have them in the same places.
    derivative_plans : dict
        How solutions are derived (`derivatives/plan.py`), of the scene and its twins.
    has_size : bool
        Whether the scene has a size.
    has_coupled_angles : bool
        Whether an angle is on a turn that another one tells.
    is_asked_whole : bool
        Whether `asked` has all that the objective asks for: no reference of a posture, no coordinate's value.
    is_loop_alone : bool
        Whether a solve that goes on from another one is a run of the loop and nothing else, if that arrives. What has
        no extent may have outgrown its size; corners are tried first; clearances are looked after.
    turn : Turn
        That of the scene, for those that have a solution alone; twins have the same.
    before : Packed or None
        The same scene as it was packed before it had this size, or these rows of clearances.
    lineage : object
        The same of a scene that is packed again because numbers were set anew (`numbers`), and of no other one.
    numbers : int
        The count of such numbers (`kinematics/changes.py`) when it was packed or compared last.
    faces : list of Face
        Of all bodies when it was packed.

    Those of `WrittenScene` and `SceneContents` tell what is in the table.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        constraints: Sequence[Constraint],
        objectives: Sequence[tuple[float, Objective]],
        places: int = 1,
        corners: bool = False,
        size: float | None = None,
    ) -> None:
        self.count = len(bodies)
        self.numbers, self.lineage, self.turn = numbers_set(), object(), Turn()
        self.stamp = structure_changes()
        self.structure = structure_of(constraints)
        measured, self._has_no_extent = size_and_extent(bodies, constraints, objectives)
        size = measured if size is None else size
        self.has_size = size > 0.0
        self.before: Packed | None = None
        self.faces = [side.face for body in bodies for side in body.faces]
        self._measure_by(size if self.has_size else 1.0, bodies, objectives or [(1.0, Posture())])
        self._take_contents(bodies, constraints, objectives, places, corners)
        self.origin = object()
        self._write(bodies, constraints, objectives)
        self._take_addresses()
        # Where the parts of a state begin: tracked values (contacts, angles, sides), multipliers, residuals, results.
        self.contacts_at = 7 * self.count
        self.angles_at = self.contacts_at + TRACK * self.pair_rows
        self.angles = slice(self.angles_at, self.angles_at + TRACK * len(self._angles), TRACK)
        # Where a state looks for each driven angle, and where the pool has its value.
        self.driven_angles = [(self.angles_at + TRACK * k, at) for k, at in self._turned.driven]
        self.multipliers_at = self.contacts_at + TRACK * self.tracked
        self.residuals_at = self.multipliers_at + self.rows
        self.results_at = self.residuals_at + self.rows
        self.memory_at = self.results_at + layout.RESULTS
        self._memory = np.empty(0)
        if self.clearance_rows:
            # The first update sees what crosses at the start as well, if it is no deeper than this.
            self._memory = fresh_memory(len(self.kept_pairs), self.clearance_rows, LARGEST_MARGIN)
        self.asked: Asked = []
        self.workspaces: list[Workspace] = []
        self.proofs: list[ClearanceProof] = []
        self.stood: Stood | None = None
        self.hulled: Hulled = ()
        self.owned_pairs: OwnedPairs | None = None
        self.number_places: NumberPlaces | None = None
        self.derivative_plans: dict[Any, Any] = {}
        self.kept_at = self.memory_at + self._memory.size
        self.rows_table[layout.KEPT] = self.kept_at
        self.kept_size = int(kept_size(self.rows_table))
        # What every solve asks is no property: that would take longer than what it asks.
        self.has_coupled_angles = self._turned.coupled
        self.is_asked_whole = not self._coordinates and not any(
            isinstance(term, Posture) for _, term in objectives or [(1.0, Posture())]
        )
        # The least move of a scene without an objective is no part of what its solutions are.
        self.follows_start = any(isinstance(term, Posture) and term.reference is None for _, term in objectives)
        may_need_more = self._has_no_extent or self.keeps_apart or self.clearance_rows > 0 or bool(self.corners)
        self.is_loop_alone = not may_need_more
        # Without a factor, to copy what a solution keeps takes longer than to evaluate it anew.
        self._state_size = self.kept_at + (self.kept_size if kept_unknowns(self.rows_table) > 0 else 0)

    @property
    def unknown_blocks(self) -> Table:
        """Of every body the number of its block of six unknowns; negative for fixed ones."""
        return self.rows_table[self.rows_table[layout.UNKNOWN_BLOCKS] :][: self.count]

    @cached_property
    def following(self) -> Table:
        """Where the pool has the poses that postures without a reference are measured from, seven numbers of each."""
        table = self.rows_table
        terms = rows_of(TERM_RECORD, table[table[layout.TERM_TABLE] :][: TERM * table[layout.TERMS]].reshape(-1, TERM))
        first = terms.parameters[(terms.kind == POSTURE) & (terms.follows == 1)] + place_of(POSTURE_FIELDS, "position")
        return np.asarray(np.add.outer(first, np.arange(REFERENCE)).ravel())

    def begun_at(self) -> Array:
        """The poses that postures without a reference are measured from: where the last solve began."""
        begun: Array = self.rows_pool[self.following]
        return begun

    def measure_from(self, begun: Array) -> None:
        """Measure postures without a reference from where another solve began, until the next solve begins."""
        self.rows_pool[self.following] = begun

    def is_crowded(self, state: Array) -> bool:
        """Whether contacts of clearances were near that found no place."""
        return self.clearance_rows > 0 and state[self.memory_at + manager_records.CROWDED] == 1.0

    def new_state(self) -> Array:
        """The state of a solve that knows nothing yet."""
        state = np.zeros(self._state_size)
        state[self.memory_at : self.kept_at] = self._memory
        return state

    def has_rows_of(self, other: Packed) -> bool:
        """Whether another scene has the same rows, but for those of clearances."""
        kinds = [
            np.column_stack([packed.owners, packed.one_sided, packed.lengths, packed.drives, packed.pairs >= 0])
            for packed in (self, other)
        ]
        one, two = (
            np.delete(kind, np.arange(packed.clearance_rows) + len(packed.contacts), axis=0)
            for kind, packed in zip(kinds, (self, other), strict=True)
        )
        return len(self.contacts) == len(other.contacts) and np.array_equal(one, two)

    def table_at(self, state: Array) -> Table:
        """The table with the rows of clearances as a state has them; in the packed one they have no contacts."""
        has_clearances = self.clearance_rows > 0 and state.size > self.memory_at
        return manager_packing.table_with_clearances(self.table, self._placed(state)) if has_clearances else self.table

    def may_have_outgrown(self) -> bool:
        """Whether the size rests on values and places alone and the values have become others by far."""
        if not self._has_no_extent or not self.has_size:
            return self._has_no_extent
        values = [abs(row.current()) for row, _, _ in self._sources if not row.terms[0][1].is_angle]
        return self.is_outgrown(max(values, default=0.0))

    def is_outgrown(self, length: float) -> bool:
        """Whether a length, not zero, is another one than the size by far, or there is none."""
        near = self.has_size and self.scale <= OUTGROWN * length <= OUTGROWN**2 * self.scale
        return length > 0.0 and not near

    def listed(self, state: Array) -> list[tuple[int, int]]:
        """Of every place of a contact manager in a state: its pair of bodies, or -1, and the number of its contact."""
        return [(pair, number) for pair, number, _given in self._placed(state)]

    def _placed(self, state: Array) -> list[list[int]]:
        """The same, and whether it is in the place of a given contact."""
        return listed_places(state[self.memory_at :], len(self.kept_pairs), self.clearance_rows)

    def __getstate__(self) -> dict[str, Any]:
        # In copies it is in the same place.
        self._write_manager()
        return {
            **self.__dict__,
            "workspaces": [],
            "proofs": [],
            "stood": None,
            "hulled": (),
            "owned_pairs": None,
            "number_places": None,
            "derivative_plans": {},
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Addresses are those of one process; a copy, or what another process wrote, takes its own.
        self.__dict__.update(state)
        # Counts of another process say nothing here.
        self.numbers = -1
        self.rows_table = self.rows_table.copy()
        self.rows_table[layout.DEEPEST_AT] = 0
        self._take_addresses()

    def start_angles(self, state: Array, warm: bool) -> None:
        """Write the turns that angles start on at the poses of a state into it."""
        if not self._angles:
            return
        pool = self.rows_pool
        if warm and not self.has_coupled_angles:
            for place, at in self.driven_angles:
                state[place] = pool[at]
            return

        def measure() -> Array:
            values = np.empty(len(self._standing))
            if values.size:
                q = state[: self.contacts_at].reshape(-1, 7)
                scaled = q.copy()
                scaled[:, :3] = (q[:, :3] - self.reference) / self.scale
                coordinates_at(
                    self.rows_table, self.rows_pool, scaled, self._standing, np.empty((1, JOINT_FRAMES)), values
                )
            values[self._standing_lengths] *= self.scale
            return values

        self._turned.start(pool, state[self.angles], warm, measure)

    def twin(self) -> Packed:
        """The same with a pool of its own, of which anything may be changed."""
        self._write_manager()
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.rows_table, other.rows_pool = self.rows_table.copy(), self.rows_pool.copy()
        other.rows_table[layout.DEEPEST_AT] = 0
        other.rows_pool[layout.VERSION] = float(next(_versions))
        # Solves of the one and of the other work in the same memory, one after another.
        other.stood = None
        return other

    def as_asked(self, asked: Asked) -> Packed:
        """The same with a pool of its own, in which rows and terms have the values and targets of a solve."""
        other = self.twin()
        # Versions differ in more than values.
        other.pool[layout.VERSION] = self.pool[layout.VERSION]
        for (_, at, unit), value in zip(self._sources, asked, strict=False):
            other.pool[at] = value / unit
        first = len(self._sources)
        for (_, at), target in zip(self._targets, asked[first:], strict=False):
            other.pool[at : at + 3] = (target - self.reference) / self.scale
        first += len(self._targets)
        for (term, at), target in zip(self._turns, asked[first:], strict=False):
            other.pool[at : at + 4] = term.body_quaternion_of(target)
        return other

    @property
    def asked_units(self) -> list[float]:
        """What every number that may change between solves is measured in: the scene's size, or radians."""
        values = [1.0 if equation.terms[0][1].is_angle else self.scale for equation, _, _ in self._sources]
        return [*values, *(self.scale for _ in self._targets), *(1.0 for _ in self._turns)]

    @property
    def value_rows(self) -> NDArray[np.int64]:
        """The rows of joints and couplings, which have a value each."""
        first = int((self.pairs >= 0).sum())
        return np.arange(first, first + len(self._valued))

    def move_values(self, change: Array) -> None:
        """Add a change (m,) to the values of joints' and couplings' rows, until the next `refresh`."""
        self.pool[[at for _, at in self._valued]] += change[self.value_rows]

    def refresh(self) -> None:
        """Write what may have changed since the last solve: values and targets."""
        pool, scale = self.rows_pool, self.scale
        asked: Asked = []
        self.asked = asked
        for owner, name, sign, at, is_length in self._reads:
            current = sign * float(getattr(owner, name))
            value = current / scale if is_length else current
            if is_length and not -FARTHEST <= value <= FARTHEST:
                check_reach(f"a value of {owner!r}", abs(current), scale)
            asked.append(current)
            pool[at] = value
        x, y, z = self._reference
        far = FARTHEST * scale
        for distance, at in self._targets:
            target = distance._target
            asked.append(target)
            a, b, c = target.tolist()
            if not (-far <= a <= far and -far <= b <= far and -far <= c <= far):
                check_reach(f"a target of body {distance.bodies[0].name!r}", max(abs(a), abs(b), abs(c)), scale)
            # To set the numbers of an array one by one takes twice as long.
            _put_place(pool, 8 * at, (a - x) / scale, (b - y) / scale, (c - z) / scale)
        if self._turns or self._coordinates:
            self._write_turns(pool, asked)

    def _write_turns(self, pool: Array, asked: Asked) -> None:
        """Write how frames are to stand, which is also put into `asked`, and numbers of terms of coordinates."""
        for frame_distance, at in self._turns:
            asked.append(frame_distance.target)
            pool[at : at + 4] = frame_distance.body_quaternion
        for term, (_, *places) in self._coordinates:
            numbers = term.numbers
            for at in places:
                pool[at : at + len(numbers)] = numbers

    def ask_for(self, asked: Asked) -> None:
        """Set values and targets of the scene's constraints and objectives, and write them."""
        remaining = iter(asked)
        for equation, _, _ in self._sources:
            equation.ask_for(next(remaining))
        for distance, _ in self._targets:
            distance._target = next(remaining)
        for frame_distance, _ in self._turns:
            frame_distance.target = next(remaining)
        self.refresh()


def structure_of(constraints: Sequence[Constraint]) -> tuple[tuple[object, ...], ...]:
    """Which rows constraints have, whatever their values."""
    return tuple(
        (id(item), id(equation.terms[0][1]), equation.terms[0][0], equation.source and equation.source[1])
        for item in constraints
        if isinstance(item, RowConstraint)
        for equation in item.equations
    )
