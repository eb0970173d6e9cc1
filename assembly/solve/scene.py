"""The bodies, contacts and faces that a solution refers to, and its status."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.joint import Sense
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.objective_terms import POINT_DISTANCE, POSTURE, POSTURE_PARAMETERS, TERM
from assembly.constraints.program.records import TERM_TABLE, TERMS
from assembly.errors import InputError
from assembly.kinematics.body import Body

if TYPE_CHECKING:
    from assembly.kinematics.body import BodyFace

__all__ = ["Scene", "Status"]


class Status(Enum):
    """How a solve ended; the value says what to do."""

    SOLVED = "every constraint holds and the objective, if there is one, is at a local minimum"
    INFEASIBLE = "the constraints cannot all hold near this start; the pose violates them least: drop or move one"
    STALLED = "no further progress; look at the worst violation, start elsewhere or loosen the tolerance"
    ITERATION_LIMIT = "out of iterations; raise max_iterations or start nearer"
    CONTACT_LOST = "a contact has no extremal pair at the start; move the bodies or name the faces"
    TIME_LIMIT = (
        "the time limit was reached; the pose is the last that held, if one did: raise time_limit or start nearer"
    )
    STOPPED = "the callback stopped the solve; the pose is the last that held, if one did"
    UNBOUNDED = (
        "the objective is unbounded: it decreases without end along poses that hold; bound it by a limit or a term"
    )
    FITTED = "redundant constraints disagree slightly and hold as well as they can; all others hold"
    BLOCKED = "something is in the way to the given values; the pose is the last one before it: look at the message"


class Scene:
    """The bodies, contacts and faces that a solution speaks of."""

    def __init__(
        self,
        bodies: tuple[Body, ...],
        constraints: tuple[Constraint, ...],
        contacts: tuple[Contact, ...],
        sides: tuple[tuple[Body | BodyFace, Body | BodyFace], ...],
        scale: float,
        seats: tuple[Contact, ...] = (),
    ) -> None:
        self.bodies = bodies
        self.constraints = constraints
        self.contacts = contacts
        self.sides = sides
        self.scale = scale
        # Contacts that are lower pairs: of each a joint of its name is among the constraints.
        self.seats = seats
        # Joints of nearest axes: what these were where the solve began.
        self.axes: dict[str, Sense] = {}
        self._target_places: slice | NDArray[np.int64] | None = None

    def of_size(self, scale: float) -> Scene:
        """The same with another size."""
        other = Scene(self.bodies, self.constraints, self.contacts, self.sides, scale, self.seats)
        other.axes, other._target_places = self.axes, self._target_places
        return other

    def target_places(self, packed: Packed) -> slice | NDArray[np.int64]:
        """Where the pool has what the objective asks for and may change between solves: targets and postures."""
        if self._target_places is None:
            table = packed.rows_table
            records = table[table[TERM_TABLE] :][: TERM * table[TERMS]].reshape(-1, TERM)
            sizes = {POINT_DISTANCE: 7, POSTURE: POSTURE_PARAMETERS}
            places = [np.arange(sizes.get(kind, 0)) + at for kind, _, at, *_ in records.tolist()]
            for term, (weight_at, *numbers_at) in packed._coordinates:
                places += [np.array([weight_at]), *(np.arange(len(term.numbers)) + at for at in numbers_at)]
            found = np.concatenate([*places, np.empty(0, dtype=np.int64)]).astype(np.int64)
            # Of one term it is a slice, which is read in less time.
            is_one = len(found) > 0 and bool((np.diff(found) == 1).all())
            self._target_places = slice(int(found[0]), int(found[-1]) + 1) if is_one else found
        return self._target_places

    def targets_in(self, packed: Packed) -> bytes:
        """What the pool has there: a copy, in the shortest time."""
        places = self.target_places(packed)
        pool = packed.rows_pool
        return (pool.data[places] if isinstance(places, slice) else pool[places]).tobytes()

    def index(self, body: Body | str) -> int:
        """Place of a body, given itself or its name."""
        for k, other in enumerate(self.bodies):
            if other is body or (isinstance(body, str) and other.name == body):
                return k
        known = ", ".join(repr(other.name) for other in self.bodies)
        raise InputError(f"body is {body!r}; expected one of {known}")
