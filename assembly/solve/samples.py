"""Which bodies overlap by the samples of a contact manager, where no proof decides.

Updates go on in slices, between which the interpreter runs, so that Ctrl-C and a time limit are answered.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from time import perf_counter_ns
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import Contact, side_faces
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program import records as layout
from assembly.kinematics.body import Body
from assembly.proximity.bvh.facet_tree import FacetTree
from assembly.proximity.features.solid_contact import PAIR_GAP, TRACK
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager import update as manager
from assembly.proximity.manager.parameters import SLICE
from assembly.solve.interruption import Interruption

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["PosedBodies", "Sampled", "sampled"]

Array = NDArray[np.float64]
Pair = tuple[Body, Body]
# What is in each other by less, in parts of the scene's size, may be so by rounding.
ROUNDED = 1e-10
# How deep an update sees, in parts of that size.
DEPTH = 0.015
# Contacts of a pair, or of a body in many, that may be near at a time. Of those of a pair the deepest come first; pairs
# for which none are left, as beside faces that lie on each other, are searched in an update of their own.
PLACES = 8


@dataclass(frozen=True, eq=False)
class PosedBodies:
    """Bodies at poses, and what of them is no crossing.

    Attributes
    ----------
    bodies : sequence of Body
    q : (n, 7)
    touching : float
        What may be in each other and still touch, in parts of the scene's size.
    contacts : sequence of Contact
    given : (k, TRACK), optional
        Pairs of the contacts, as they are tracked.
    """

    bodies: Sequence[Body]
    q: Array
    touching: float
    contacts: Sequence[Contact] = ()
    given: Array | None = None

    @classmethod
    def of(cls, solution: Solution) -> PosedBodies:
        """Those of a solution."""
        contacts = [item for item in solution._scene.constraints if isinstance(item, Contact)]
        given = solution._parameters[: len(contacts)]
        return cls(solution._scene.bodies, solution.q, solution._touching, contacts, given)


@dataclass(frozen=True)
class Sampled:
    """What an update finds.

    Attributes
    ----------
    crossing : set of int
        Numbers of the pairs that cross elsewhere than at the contacts.
    is_complete : bool
        Whether all pairs were searched.
    """

    crossing: set[int]
    is_complete: bool


class _Watched(Clearance):
    """A clearance of given pairs, any bodies of which may be moved, and extrema alone."""

    corners = False

    def __init__(self, pairs: Sequence[Pair], name: str) -> None:
        bodies = dict.fromkeys(body for pair in pairs for body in pair)
        super().__init__(bodies, name=name, slots=PLACES * (1 + min(len(pairs), len(bodies))))
        self._pairs = list(pairs)

    def pairs(self, bodies: Sequence[Body]) -> list[Pair]:
        """Those that were given."""
        return self._pairs


def sampled(posed: PosedBodies, pairs: Sequence[Pair], interruption: Interruption) -> Sampled:
    """Which of those pairs are in each other by more than touching, elsewhere than at the contacts.

    Raises
    ------
    InputError
        Bodies of sizes that clearances cannot have.
    """
    if not pairs:
        return Sampled(set(), True)
    name = "crossings"
    while any(item.name == name for item in posed.contacts):
        name += "'"
    if not _known_shapes(pairs, interruption):
        return Sampled(set(), False)
    crossing: set[int] = set()
    left = list(range(len(pairs)))
    while left:
        watched = _Watched([pairs[k] for k in left], name)
        seen, without = _seen(Packed(posed.bodies, [*posed.contacts, watched], ()), posed, interruption)
        crossing |= {left[k] for k in seen.crossing}
        if not seen.is_complete:
            return Sampled(crossing, False)
        # The first pair has slots at each update, so that these become fewer.
        left = [left[k] for k in without if len(without) < len(left)]
    return Sampled(crossing, True)


def _known_shapes(pairs: Iterable[Pair], interruption: Interruption) -> bool:
    """Make what an update has to know of shapes, which takes longer than the update; whether there was time to.

    Where there is no limit it is made as the scene is packed: of very many shapes it is not kept until then.
    """
    if not interruption.is_limited:
        return True
    for faces in dict.fromkeys(side_faces(body) for pair in pairs for body in pair):
        FacetTree.of(faces)
        if interruption.is_over():
            return False
    return True


def _seen(packed: Packed, posed: PosedBodies, interruption: Interruption) -> tuple[Sampled, list[int]]:
    """What the update finds, and the pairs for whose contacts no slots were left."""
    q, contacts = posed.q.copy(), len(posed.contacts)
    q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    count = manager_records.PAIR_MEMORY * len(packed.kept_pairs)
    record = packed.table[layout.MANAGER_RECORD]
    # Where there is no clock updates are not cut.
    packed.table[record + manager_records.CLOCK] = packed.table[layout.CLOCK_AT]
    state = packed.new_state()
    memory = state[packed.memory_at :]
    memory[manager_records.OVERLAP] = posed.touching
    pairs = memory[manager_records.MEMORY_HEADER :][:count].reshape(-1, manager_records.PAIR_MEMORY)
    pairs[:, manager_records.QUERY_MARGIN] = DEPTH
    tracked = np.full((packed.pair_rows, TRACK), np.nan)
    if posed.given is not None:
        tracked[:contacts] = posed.given
    is_cut = True
    while is_cut and not interruption.is_over():
        memory[manager_records.DEADLINE] = perf_counter_ns() + SLICE
        manager.update(packed.table, packed.pool, record, memory, q, tracked, manager.EVERYTHING)
        is_cut = memory[manager_records.DEADLINE] < 0.0
    known = rows_of(manager_records.PAIR_STATE, pairs)
    found = set(np.flatnonzero(known.crossed == 1.0).tolist())
    deep, gaps = max(ROUNDED, posed.touching), tracked[contacts:, PAIR_GAP]
    listed = [pair for pair, _ in packed.listed(state)]
    found |= {pair for gap, pair in zip(gaps, listed, strict=True) if pair >= 0 and gap < -deep}
    wanting: list[int] = np.flatnonzero(known.wanting == 1.0).tolist()
    return Sampled(found, not is_cut), sorted(set(wanting).difference(listed))
