"""Manager: which bodies are near each other and where, for given poses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import inf, nan

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._copies import OwnState
from assembly._read_only import ReadOnlyArrays
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import side_faces
from assembly.constraints.packing.scene import Packed
from assembly.errors import InputError, number, renamed
from assembly.kinematics.body import Body
from assembly.kinematics.pose import pose_rows
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.extrema.rates import ARM_F, GAP, NORMAL
from assembly.proximity.features.solid_contact import CONTACT_RECORD, TRACK
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager.events import Event, PairState, events_of
from assembly.solve.crossings import find_crossings
from assembly.solve.interruption import CTRL_C
from assembly.solve.options import Options, touching_part
from assembly.solve.samples import PosedBodies
from assembly.tracking.follow import follow

__all__ = ["ListedContact", "Manager"]

Array = NDArray[np.float64]
_STATES = tuple(PairState)
# Largest reach, in parts of the size of the scene.
MOST_REACH = 0.2
# Parts of a gap that are tried as bounds, and pairs of nodes that each may take: exact hulls need few.
BOUND_BUDGET = 20_000
BOUND_PARTS = ((1.0 - 1e-9, 2000), (0.95, BOUND_BUDGET))


@dataclass(frozen=True, eq=False)
class ListedContact(ReadOnlyArrays):
    """An extremal pair of points of two bodies that is tracked.

    Attributes
    ----------
    bodies : (str, str)
        Names of f and g.
    number : int
        Of the contact; numbers count up and are not used twice.
    parameters : (4,)
        u_f, v_f, u_g, v_g; of solids with edges the coordinates on the two features.
    points : (2, 3)
        On f, and on g, in the world.
    normal : (3,)
        Outward from f.
    gap : float
        Positive apart, negative interpenetrating.
    """

    bodies: tuple[str, str]
    number: int
    parameters: Array
    points: Array
    normal: Array
    gap: float

    def __repr__(self) -> str:
        return f"ListedContact({self.bodies[0]!r}, {self.bodies[1]!r}, number={self.number}, gap={self.gap:.3g})"


class _Everything(Clearance):
    """A clearance of bodies any of which may be moved, and extrema alone."""

    corners = False

    def pairs(self, bodies: Sequence[Body]) -> list[tuple[Body, Body]]:
        """All pairs."""
        return list(combinations(self.bodies, 2))


class Manager(OwnState):
    """The global stage without a solve: pairs of bodies from far to near to tracked contacts (paper 001, section 5).

    Every `update` gives the poses of the bodies. A listed contact is predicted by the contact velocity formulation and
    corrected by Newton's method; if it loses its extremum, or is corrected so much that it may have moved to another
    one, its pair of bodies is searched again. Other pairs are searched when the bodies have moved as far as the last
    search allows.

    Parameters
    ----------
    bodies : iterable of Body
        Two or more, with shapes and distinct names; each may move, fixed ones too.
    reach : float, optional
        Contacts with a gap up to this are all listed, in the unit of the bodies; at most a fifth of the largest body's
        size. By default zero: contacts that touch or cross are listed, and near ones depending on how fast the bodies
        move.
    merge_radius : float
        Two contacts of the same two bodies whose points are nearer than this on both, and near along the surfaces as
        well, are one: the radius of the spheres of neglect, in parts of the scene's size. Contacts farther apart are
        all kept, also across a wire thinner than the radius.
    slots : int, optional
        How many contacts may be near at a time, initially; doubled when that is not enough.
    neglect, places
        Former names of `merge_radius` and `slots`; they warn.
    touching : float
        How much bodies may overlap and still count as touching, in parts of the scene's size; only deeper overlaps are
        crossings. For parts of files use 1e-6, for example.

    Raises
    ------
    InputError, TypeError
        Fewer than two bodies, bodies without shape, names used twice, numbers out of range.
    """

    def __init__(
        self,
        bodies: Iterable[Body],
        *,
        reach: float | None = None,
        merge_radius: float = 1e-6,
        slots: int | None = None,
        neglect: float | None = None,
        places: int | None = None,
        touching: float = Options.touching,
    ) -> None:
        try:
            self._bodies = tuple(bodies)
        except TypeError:
            raise TypeError(f"bodies is {bodies!r}; expected bodies") from None
        merge_radius = renamed("merge_radius", merge_radius, "neglect", neglect)
        slots = renamed("slots", slots, "places", places)
        clearance = Clearance(self._bodies, merge_radius=merge_radius, slots=slots)
        names = [body.name for body in self._bodies]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise InputError(f"bodies[{k}] has the name {name!r} of another body; expected distinct names")
        size = max(body.size for body in self._bodies)
        self._reach = 0.0 if reach is None else number("reach", reach)
        if not 0.0 <= self._reach <= MOST_REACH * size:
            raise InputError(
                f"reach is {self._reach:g}; expected a length from 0 to {MOST_REACH * size:g}, "
                "a fifth of the largest body"
            )
        self._merge_radius = clearance.merge_radius
        self._touching = touching_part(touching)
        self._pairs = list(combinations(names, 2))
        self._proof: ClearanceProof | None = None
        self._seen = 0.0
        self._set_up(slots)

    def _set_up(self, slots: int | None) -> None:
        """Pack, with room for so many contacts."""
        # What is to be listed is what comes nearer than this.
        everything = _Everything(self._bodies, self._reach, merge_radius=self._merge_radius, slots=slots)
        packed = self._packed = Packed(self._bodies, [everything], ())
        count, rows = packed.count, packed.clearance_rows
        self._memory = packed.new_state()[packed.memory_at : packed.kept_at]
        self._poses = np.full((count, 7), np.nan)
        self._poses[:, 3:] = [1.0, 0.0, 0.0, 0.0]
        self._tracked = np.full((rows, TRACK), np.nan)
        self._records = np.zeros((rows, CONTACT_RECORD))
        self._last = (self._poses, self._tracked, self._records)
        self._workspace = (
            np.empty((count, 7)),
            np.zeros((count, 6)),
            np.zeros((rows, TRACK)),
            np.zeros((rows, TRACK)),
            np.zeros((2, rows)),
        )
        self._free = np.full(rows, -1, dtype=np.int64)

    def _grow(self) -> None:
        """Twice as many places; what is known stays."""
        old = (self._packed, self._memory, self._poses, self._tracked)
        self._set_up(2 * old[0].clearance_rows)
        pairs, places, events = self._parts(*old[:2])
        new_pairs, new_places, new_events = self._parts(self._packed, self._memory)
        head = manager_records.MEMORY_HEADER
        self._memory[:head] = old[1][:head]
        new_pairs[:] = pairs
        new_places[: len(places)] = places
        new_places[len(places) :] = 0.0
        new_places[len(places) :, manager_records.PLACE_PAIR] = -1.0
        new_events[:] = events
        # Every pair is updated once more.
        new_pairs[:, manager_records.PAIR_TURN] = nan
        self._poses[:] = old[2]
        self._tracked[: len(places)] = old[3]

    @staticmethod
    def _parts(packed: Packed, memory: Array) -> tuple[Array, Array, Array]:
        """Views of what a memory knows of pairs, of places, and of events."""
        pairs_at = manager_records.MEMORY_HEADER
        places_at = pairs_at + manager_records.PAIR_MEMORY * len(packed.kept_pairs)
        events_at = places_at + manager_records.PLACE_MEMORY * packed.clearance_rows
        return (
            memory[pairs_at:places_at].reshape(-1, manager_records.PAIR_MEMORY),
            memory[places_at:events_at].reshape(-1, manager_records.PLACE_MEMORY),
            memory[events_at:],
        )

    def _shared(self) -> Iterable[object]:
        return self._bodies

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Bodies in the order of q's rows."""
        return self._bodies

    @property
    def reach(self) -> float:
        """Contacts with a gap up to this are all listed."""
        return self._reach

    @property
    def merge_radius(self) -> float:
        """Radius of the spheres of neglect, in parts of the scene's size."""
        return self._merge_radius

    @property
    def neglect(self) -> float:
        """`merge_radius`, by its former name."""
        return renamed("merge_radius", self._merge_radius, "neglect", self._merge_radius)

    @property
    def touching(self) -> float:
        """What bodies may be in each other and still touch, in parts of the scene's size."""
        return self._touching

    @property
    def crossings(self) -> tuple[tuple[str, str], ...]:
        """Names of pairs of bodies that overlap by more than `touching`, or enclose each other; () before an update.

        At the poses of the last update. All pairs are searched anew when this is read, which takes longer than an
        update.
        """
        if np.isnan(self._poses).any():
            return ()
        q = self._standing()
        shaped = [body for body in self._bodies if body.faces]
        posed = PosedBodies(self._bodies, q, self._touching)
        return find_crossings(posed, list(combinations(shaped, 2)), CTRL_C).pairs

    def update(self, q: ArrayLike) -> tuple[Event, ...]:
        """Set the poses of the bodies.

        Parameters
        ----------
        q : (n, 7)
            One row per body: x y z qw qx qy qz.

        Returns
        -------
        tuple of Event
            Contacts that came near, went away, were handed back to the global search or merged, in the order in which
            this happened; the last 64 of them.

        Raises
        ------
        InputError
            Wrong shape, numbers that are not finite, quaternions far from unit; then nothing has changed.
        """
        rows = q if isinstance(q, np.ndarray) and q.dtype == np.float64 and q.shape == self._poses.shape else None
        code = -1 if rows is None or not rows.flags.carray else self._follow(rows)
        if code < 0:
            code = self._follow(pose_rows("q", q, len(self._bodies)))
        while code > 0 and self._is_full():
            self._grow()
            code += self._follow(pose_rows("q", q, len(self._bodies)))
        if code == 0:
            return ()
        since, self._seen = int(self._seen), self._memory[manager_records.EVENT_COUNT]
        return events_of(self._memory, self._pairs, self._packed.scale, since)

    def _follow(self, q: Array) -> int:
        """One call of the kernel."""
        packed = self._packed
        return int(follow(packed.table, packed.pool, q, self._last, self._workspace, self._free, self._memory))

    def _is_full(self) -> bool:
        """Whether every place has a contact."""
        return bool((self._parts(self._packed, self._memory)[1][:, manager_records.PLACE_PAIR] >= 0.0).all())

    @property
    def contacts(self) -> tuple[ListedContact, ...]:
        """The contacts that are listed, in the order of their numbers."""
        packed = self._packed
        places = self._parts(packed, self._memory)[1]
        index = {body: k for k, body in enumerate(body.name for body in self._bodies)}
        found = []
        for k in np.flatnonzero(places[:, manager_records.PLACE_PAIR] >= 0.0).tolist():
            bodies = self._pairs[int(places[k, manager_records.PLACE_PAIR])]
            record = self._records[k]
            gap, normal = float(record[GAP]), record[NORMAL : NORMAL + 3].copy()
            there = self._poses[index[bodies[0]], :3] + record[ARM_F : ARM_F + 3]
            found.append(
                ListedContact(
                    bodies=bodies,
                    number=int(places[k, manager_records.PLACE_NUMBER]),
                    parameters=self._tracked[k, :4].copy(),
                    points=np.array([there - gap * normal, there]) * packed.scale + packed.reference,
                    normal=normal,
                    gap=gap * packed.scale,
                )
            )
        return tuple(sorted(found, key=lambda contact: contact.number))

    @property
    def states(self) -> dict[tuple[str, str], PairState]:
        """How every pair of bodies is tracked; "far" before the first update."""
        pairs = self._parts(self._packed, self._memory)[0]
        return {
            names: _STATES[int(state)]
            for names, state in zip(self._pairs, pairs[:, manager_records.STATE].tolist(), strict=True)
        }

    @property
    def gaps(self) -> dict[tuple[str, str], float]:
        """A lower bound of the gap of every pair of bodies, proven anew where it is read.

        The gap of the nearest listed contact, or the least distance of all that is not listed, less a part of 1e-9; a
        smaller one if that is not proven. Not positive, and no bound, where bodies cross or touch; minus infinity
        before the first update, and where nothing is proven.
        """
        pairs = self._parts(self._packed, self._memory)[0]
        if np.isnan(pairs[:, manager_records.PAIR_TURN]).any():
            return dict.fromkeys(self._pairs, -inf)
        left = pairs[:, manager_records.MOTION_BOUND] * (1.0 - pairs[:, manager_records.PART])
        told = dict(zip(self._pairs, (self._reach + self._packed.scale * left).tolist(), strict=True))
        for contact in self.contacts:
            told[contact.bodies] = min(told[contact.bodies], contact.gap)
        q = self._standing()
        return {names: self._proven(k, q, gap) for k, (names, gap) in enumerate(told.items())}

    def _standing(self) -> Array:
        """Where bodies stand, (n, 7), in the unit of the scene."""
        q = self._poses.copy()
        q[:, :3] = q[:, :3] * self._packed.scale + self._packed.reference
        return q

    def _proven(self, k: int, q: Array, gap: float) -> float:
        """The gap of pair k that is told, or the largest part of it that is proven to be a bound."""
        if not gap > 0.0:
            return gap
        if self._proof is None:
            pairs = list(combinations(range(len(self._bodies)), 2))
            self._proof = ClearanceProof([side_faces(body) for body in self._bodies], pairs, [0.0] * len(pairs))
        # What is not listed may be nearer than motion bounds say, but hardly than the reach.
        tried = [(part * whole, most) for whole in (gap, min(gap, self._reach)) for part, most in BOUND_PARTS]
        for bound, most in dict.fromkeys((*tried, (0.0, BOUND_BUDGET))):
            if self._proof.is_apart(k, q, bound, most):
                return bound
        return -inf

    @property
    def log(self) -> tuple[Event, ...]:
        """The last 64 events, the oldest first."""
        return events_of(self._memory, self._pairs, self._packed.scale)

    def __repr__(self) -> str:
        return f"Manager({len(self._bodies)} bodies, {len(self._pairs)} pairs, reach={self._reach:g})"
