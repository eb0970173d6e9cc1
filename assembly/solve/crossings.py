"""Bodies that cross at the pose of a solution.

Of all pairs of bodies those are searched whose boxes meet: bodies are within the hulls of their control points. Of most
a proof tells (`proximity/clearance/proof.py`). Others touch, and updates of a contact manager tell of those, which
go on in slices, between which the interpreter runs, so that Ctrl-C and a time limit are answered.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from time import perf_counter_ns
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import Contact, side_faces
from assembly.constraints.model.couplings import Coupling
from assembly.constraints.model.joint import Joint
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program import records as layout
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.bvh.facet_tree import FacetTree
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.proof import LEAST_SIZE, ClearanceProof
from assembly.proximity.features.solid_contact import PAIR_GAP, TRACK
from assembly.proximity.manager import records as manager_records
from assembly.proximity.manager import update as manager
from assembly.proximity.manager.parameters import SLICE
from assembly.solve.interruption import Interruption

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["Crossings", "PosedBodies", "crossings_of", "find_crossings", "free_pairs", "joined_pairs"]

Array = NDArray[np.float64]
Pair = tuple[Body, Body]
# What is in each other by less, in parts of the scene's size, may be so by rounding.
ROUNDED = 1e-10
# How deep updates see, in parts of that size. A deep update of wires that cross often finds so much that it lacks
# room for the rest, so that there are several.
DEPTHS = (0.005, 0.015, 0.05)
# Contacts of a pair, or of a body in many, that may be near at a time. What is beyond is known where bodies cross by
# more than updates take for nothing.
PLACES = 8
# What rounding may make of boxes, in parts of where they end.
END_ROUNDING = 1e-12


@dataclass(frozen=True)
class Crossings:
    """Which bodies cross at a pose, as far as they were searched.

    Attributes
    ----------
    pairs : tuple of (name, name)
        Bodies that cross elsewhere than at their contacts.
    unseen : tuple of (name, name)
        Bodies of which nobody knows, because the time limit was over: they may cross.
    """

    pairs: tuple[tuple[str, str], ...]
    unseen: tuple[tuple[str, str], ...] = ()

    @property
    def is_complete(self) -> bool:
        """Whether all pairs were searched."""
        return not self.unseen

    @property
    def is_clear(self) -> bool:
        """Whether all pairs were searched and none crosses."""
        return not self.pairs and not self.unseen


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


def _key(a: Body, b: Body) -> frozenset[int]:
    return frozenset((id(a), id(b)))


def _shaped_pairs(bodies: Iterable[Body], constraints: Iterable[Constraint]) -> list[Pair]:
    """All pairs of bodies with shapes that no clearance lets overlap."""
    clearances = [item for item in constraints if isinstance(item, Clearance)]
    excluded = {_key(*pair) for item in clearances for pair in item.exclude}
    shaped = [body for body in bodies if body.faces]
    return [(a, b) for a, b in combinations(shaped, 2) if _key(a, b) not in excluded]


def _ties(constraints: Iterable[Constraint]) -> set[frozenset[int]]:
    """Pairs of bodies that a joint ties, or a coupling, whose teeth are in each other."""
    ties = {_key(*item.bodies) for item in constraints if isinstance(item, Joint)}
    return ties | {_key(*pair) for item in constraints if isinstance(item, Coupling) for pair in item.meshing}


def free_pairs(bodies: Iterable[Body], constraints: Sequence[Constraint]) -> list[Pair]:
    """Pairs of bodies that no joint or coupling ties directly, but those that a clearance lets overlap."""
    ties = _ties(constraints)
    return [pair for pair in _shaped_pairs(bodies, constraints) if _key(*pair) not in ties]


def joined_pairs(bodies: Iterable[Body], constraints: Sequence[Constraint]) -> list[Pair]:
    """Pairs of bodies that a joint or a coupling ties directly, but those that a clearance lets overlap."""
    ties = _ties(constraints)
    return [pair for pair in _shaped_pairs(bodies, constraints) if _key(*pair) in ties]


def crossings_of(solution: Solution, pairs: Sequence[Pair], interruption: Interruption) -> Crossings:
    """Which of those pairs cross elsewhere than at contacts that the scene has, or are in each other."""
    contacts = [item for item in solution._scene.constraints if isinstance(item, Contact)]
    given = solution._parameters[: len(contacts)]
    posed = PosedBodies(solution._scene.bodies, solution.q, solution._touching, contacts, given)
    return find_crossings(posed, pairs, interruption)


def find_crossings(posed: PosedBodies, pairs: Sequence[Pair], interruption: Interruption) -> Crossings:
    """Which of those pairs of bodies are in each other by more than touching, elsewhere than at the contacts.

    Raises
    ------
    InputError
        Bodies of sizes that clearances cannot have.
    """
    near = _near(posed, pairs)
    if not near:
        return Crossings(())
    told = _proven(posed, near, interruption)
    found = _searched(posed, [pair for pair, crosses in zip(near, told, strict=True) if crosses is None], interruption)
    crossing = {_key(a, b) for a, b in found[0]}
    crossing |= {_key(*pair) for pair, crosses in zip(near, told, strict=True) if crosses}
    return Crossings(_named([pair for pair in near if _key(*pair) in crossing]), _named(found[1]))


def _proven(posed: PosedBodies, pairs: Sequence[Pair], interruption: Interruption) -> list[bool | None]:
    """Whether pairs cross, or one is within the other, by a proof; None where it does not tell.

    That is of bodies that touch, and of those that are in each other where a contact of theirs is.
    """
    size = max(body.size for pair in pairs for body in pair)
    if not LEAST_SIZE < size < 1.0 / LEAST_SIZE:
        return [None] * len(pairs)
    number = {id(body): k for k, body in enumerate(posed.bodies)}
    shapes = [side_faces(body) for body in posed.bodies]
    touched = {_key(*contact.bodies) for contact in posed.contacts}
    told: list[bool | None] = []
    for pair in pairs:
        if interruption.is_over():
            return told + [None] * (len(pairs) - len(told))
        a, b = pair
        proof = ClearanceProof(shapes, [(number[id(a)], number[id(b)])], [0.0])
        (answer,) = proof.look(posed.q, max(ROUNDED, posed.touching) * size)
        crosses = answer.verdict in (Verdict.CROSSING, Verdict.ENCLOSED)
        known = answer.verdict is Verdict.CLEAR or (crosses and _key(a, b) not in touched)
        told.append(crosses if known else None)
    return told


def _searched(
    posed: PosedBodies, near: Sequence[Pair], interruption: Interruption
) -> tuple[Sequence[Pair], Sequence[Pair]]:
    """The pairs that updates of a contact manager find to cross, and those that were not searched to the end."""
    if not near:
        return (), ()
    name = "crossings"
    while any(item.name == name for item in posed.contacts):
        name += "'"
    if not _known_shapes(near, interruption):
        return (), near
    packed = Packed(posed.bodies, [*posed.contacts, _Watched(near, name)], ())
    found, is_complete = _seen(packed, posed, interruption)
    crossing = [pair for k, pair in enumerate(near) if k in found]
    unseen = [] if is_complete else [pair for k, pair in enumerate(near) if k not in found]
    return crossing, unseen


def _named(pairs: Sequence[Pair]) -> tuple[tuple[str, str], ...]:
    return tuple((a.name, b.name) for a, b in pairs)


def _near(posed: PosedBodies, pairs: Sequence[Pair]) -> list[Pair]:
    """Those pairs of bodies with shapes whose boxes, along the world's axes, meet."""
    placed = zip(posed.bodies, posed.q, strict=True)
    boxes = {id(body): _box(body, row) for body, row in placed if body.faces}
    low = np.array([[boxes[id(a)][0], boxes[id(b)][0]] for a, b in pairs]).reshape(-1, 2, 3)
    high = np.array([[boxes[id(a)][1], boxes[id(b)][1]] for a, b in pairs]).reshape(-1, 2, 3)
    meet = (low.max(axis=1) <= high.min(axis=1)).all(axis=1)
    return [pair for pair, near in zip(pairs, meet.tolist(), strict=True) if near]


def _box(body: Body, row: Array) -> tuple[Array, Array]:
    """The lower and the upper corner of a box around a body at a pose."""
    points = np.concatenate([face.face.surface.control_points.reshape(-1, 3) for face in body.faces])
    points = points @ rotation_matrix(row[3:]).T + row[:3]
    margin = END_ROUNDING * np.abs(points).max()
    return points.min(axis=0) - margin, points.max(axis=0) + margin


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


def _seen(packed: Packed, posed: PosedBodies, interruption: Interruption) -> tuple[set[int], bool]:
    """Places of pairs that updates of several depths find to cross, and whether all were searched."""
    q, contacts = posed.q.copy(), len(posed.contacts)
    q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    count = manager_records.PAIR_MEMORY * len(packed.clearance_pairs[0])
    deep = max(ROUNDED, posed.touching)
    record = packed.table[layout.MANAGER_RECORD]
    # Where there is no clock updates are not cut.
    packed.table[record + manager_records.CLOCK] = packed.table[layout.CLOCK_AT]
    found: set[int] = set()
    for depth in DEPTHS:
        state = packed.new_state()
        memory = state[packed.memory_at :]
        memory[manager_records.OVERLAP] = posed.touching
        pairs = memory[manager_records.MEMORY_HEADER :][:count].reshape(-1, manager_records.PAIR_MEMORY)
        pairs[:, manager_records.QUERY_MARGIN] = depth
        tracked = np.full((packed.pair_rows, TRACK), np.nan)
        if posed.given is not None:
            tracked[:contacts] = posed.given
        is_cut = True
        while is_cut and not interruption.is_over():
            memory[manager_records.DEADLINE] = perf_counter_ns() + SLICE
            manager.update(packed.table, packed.pool, record, memory, q, tracked, manager.EVERYTHING)
            is_cut = memory[manager_records.DEADLINE] < 0.0
        found |= set(np.flatnonzero(pairs[:, manager_records.CROSSED] == 1.0).tolist())
        gaps = tracked[contacts:, PAIR_GAP]
        found |= {pair for gap, (pair, _) in zip(gaps, packed.listed(state), strict=True) if pair >= 0 and gap < -deep}
        if is_cut:
            return found, False
    return found, True
