"""Bodies that cross at the pose of a solution.

Pairs of bodies are considered whose boxes meet: bodies are within the hulls of their control points. Hulls of faces
tell of many that lie on each other that they are clear (`proximity/clearance/hulls/`); of others a proof decides
(`proximity/clearance/proof.py`), for most in one look. If flat faces lie on each other, one body is first moved off
them by less than `touching`; others that touch are moved along the directions that a look leaves open; what fills a
bore is made slimmer. If none of this decides, samples do (`samples.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import side_faces
from assembly.constraints.model.couplings import Coupling
from assembly.constraints.model.groups import Group
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.tangent import Tangent
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.body_cells import has_cells
from assembly.proximity.clearance.deforming import smaller_answer
from assembly.proximity.clearance.hulls.scene import HullAnswers
from assembly.proximity.clearance.proof import LEAST_SIZE, ClearanceProof
from assembly.proximity.clearance.touching import filled_bore, left_open, off_contacts
from assembly.solve.clearance_proof import FEW
from assembly.solve.interruption import Interruption
from assembly.solve.samples import ROUNDED, PosedBodies, sampled

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = [
    "Crossing",
    "Crossings",
    "PairLook",
    "crossings_of",
    "find_crossings",
    "free_pairs",
    "joined_pairs",
    "looks_at",
    "posed_box",
]

Array = NDArray[np.float64]
Pair = tuple[Body, Body]
Normal = Callable[[], Array | None]
# Pairs whose proofs are made at once.
AT_ONCE = 64
# Moves that are tried for pairs of nodes that a look leaves open.
TRIES = 2
# What rounding may make of boxes, in parts of where they end.
END_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Crossing(ReadOnlyArrays):
    """Two bodies that cross, or of which one is within the other.

    Attributes
    ----------
    bodies : (name, name)
    depth : float
        No translation by less undoes it; 0 where that is not proven.
    place : (3,)
        Where a crossing was proven, in the world; else NaN.
    proved : bool
        Whether it is proven; else samples tell.
    """

    bodies: tuple[str, str]
    depth: float
    place: Array = field(repr=False)
    proved: bool


@dataclass(frozen=True)
class Crossings:
    """Which bodies cross at a pose, as far as they were searched.

    Attributes
    ----------
    found : tuple of Crossing
        Bodies that cross elsewhere than at their contacts.
    unseen : tuple of (name, name)
        Bodies that were not searched before the time limit: they may cross.
    """

    found: tuple[Crossing, ...]
    unseen: tuple[tuple[str, str], ...] = ()

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the bodies that cross."""
        return tuple(crossing.bodies for crossing in self.found)

    @property
    def is_complete(self) -> bool:
        """Whether all pairs were searched."""
        return not self.unseen

    @property
    def is_clear(self) -> bool:
        """Whether all pairs were searched and none crosses."""
        return not self.found and not self.unseen


class PairLook(NamedTuple):
    """What a pair of bodies is to each other.

    Attributes
    ----------
    answer : Answer
        What is proven.
    crosses : bool or None
        Whether they cross or one is within the other, by that or by samples; None where there was no time.
    proved : bool
        Whether that is proven.
    """

    answer: Answer
    crosses: bool | None
    proved: bool


def _key(a: Body, b: Body) -> frozenset[int]:
    return frozenset((id(a), id(b)))


def _shaped_pairs(bodies: Iterable[Body], constraints: Iterable[Constraint]) -> list[Pair]:
    """All pairs of bodies with shapes that no clearance lets overlap."""
    clearances = [item for item in constraints if isinstance(item, Clearance)]
    excluded = {_key(*pair) for item in clearances for pair in item.exclude}
    shaped = [body for body in bodies if body.faces]
    return [(a, b) for a, b in combinations(shaped, 2) if _key(a, b) not in excluded]


def _ties(constraints: Iterable[Constraint]) -> set[frozenset[int]]:
    """Pairs of bodies that a joint or a group ties, or a coupling, whose teeth are in each other."""
    ties = {_key(*item.bodies) for item in constraints if isinstance(item, Joint) and not isinstance(item, Tangent)}
    ties |= {_key(*pair) for item in constraints if isinstance(item, Group) for pair in combinations(item.bodies, 2)}
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
    return find_crossings(PosedBodies.of(solution), pairs, interruption)


def find_crossings(posed: PosedBodies, pairs: Sequence[Pair], interruption: Interruption) -> Crossings:
    """Which of those pairs of bodies are in each other by more than touching, elsewhere than at the contacts.

    Raises
    ------
    InputError
        Bodies of sizes that clearances cannot have.
    """
    found, unseen = [], []
    near = _near(posed, pairs)
    for (a, b), look in zip(near, looks_at(posed, near, interruption), strict=True):
        if look.crosses is None:
            unseen.append((a.name, b.name))
        elif look.crosses:
            answer = look.answer
            found.append(Crossing((a.name, b.name), answer.depth if look.proved else 0.0, answer.place, look.proved))
    return Crossings(tuple(found), tuple(unseen))


def looks_at(
    posed: PosedBodies,
    pairs: Sequence[Pair],
    interruption: Interruption,
    normals: Sequence[Normal | None] | None = None,
) -> list[PairLook]:
    """What pairs of bodies are to each other: by a proof, or by samples where it does not tell.

    Of bodies that cross and have a contact, samples tell whether they do so elsewhere.

    Parameters
    ----------
    posed : PosedBodies
    pairs : sequence of (Body, Body)
    interruption : Interruption
    normals : sequence of callable or None, optional
        Of every pair, what gives the normal (3,) from the first body to the second where they touch, or None where it
        is not known.

    Raises
    ------
    InputError
        Bodies of sizes that clearances cannot have.
    """
    hints = [normal or _unknown for normal in normals or [None] * len(pairs)]
    touched = {_key(*contact.bodies) for contact in posed.contacts}
    looks = []
    for (a, b), answer in zip(pairs, _answers(posed, pairs, hints, interruption), strict=True):
        crosses = answer.verdict in (Verdict.CROSSING, Verdict.ENCLOSED)
        proved = answer.verdict is not Verdict.UNDECIDED and not (crosses and _key(a, b) in touched)
        looks.append(PairLook(answer, crosses if proved else None, proved))
    asked = [k for k, look in enumerate(looks) if not look.proved]
    found = sampled(posed, [pairs[k] for k in asked], interruption)
    for place, k in enumerate(asked):
        if place in found.crossing or found.is_complete:
            looks[k] = looks[k]._replace(crosses=place in found.crossing)
    return looks


def _unknown() -> None:
    """No normals: nothing is known of where bodies touch."""
    return None


def _answers(
    posed: PosedBodies, pairs: Sequence[Pair], normals: Sequence[Normal], interruption: Interruption
) -> list[Answer]:
    """What is proven of pairs; nothing of those for which there is no time."""
    answers = [Answer(Verdict.UNDECIDED)] * len(pairs)
    size = max((body.size for body in posed.bodies if body.faces), default=0.0)
    if not LEAST_SIZE < size < 1.0 / LEAST_SIZE:
        return answers
    number = {id(body): k for k, body in enumerate(posed.bodies)}
    shapes = [side_faces(body) for body in posed.bodies]
    touching = max(ROUNDED, posed.touching) * size
    used = {number[id(body)] for pair in pairs for body in pair}
    known = {k for k in used if not interruption.is_over() and has_cells(shapes[k])}
    asked = [k for k, pair in enumerate(pairs) if all(number[id(body)] in known for body in pair)]
    asked = _left_by_hulls(posed.q, shapes, {k: _numbers(pairs[k], number) for k in asked}, touching, answers)
    for start in range(0, len(asked), AT_ONCE):
        some = asked[start : start + AT_ONCE]
        if interruption.is_over():
            break
        rows = [_numbers(pairs[k], number) for k in some]
        proof = ClearanceProof(shapes, rows, [0.0] * len(rows))
        told = _proven(proof, posed.q, touching, [normals[k] for k in some], interruption)
        for place, (k, answer) in enumerate(zip(some, told, strict=True)):
            answers[k] = answer
            # No move opens bodies one of which fills a bore.
            if answer.verdict is Verdict.UNDECIDED and not interruption.is_over():
                slim = smaller_answer(proof, place, posed.q, touching)
                answers[k] = answer if slim is None else slim
    return answers


def _numbers(pair: Pair, number: Mapping[int, int]) -> tuple[int, int]:
    """The numbers of two bodies."""
    return number[id(pair[0])], number[id(pair[1])]


def _left_by_hulls(
    q: Array,
    shapes: Sequence[tuple[Face, ...]],
    rows: Mapping[int, tuple[int, int]],
    touching: float,
    answers: list[Answer],
) -> list[int]:
    """Write what hulls of faces tell of pairs that are clear or touch; those of which they do not tell it.

    Of faces that lie on each other they tell more than looks, in less time.
    """
    told = HullAnswers(shapes, list(rows.values()), [0.0] * len(rows), q, touching).told()
    for place, k in enumerate(rows):
        answers[k] = told.get(place, answers[k])
    return [k for place, k in enumerate(rows) if place not in told]


def _proven(
    proof: ClearanceProof, q: Array, touching: float, normals: Sequence[Normal], interruption: Interruption
) -> list[Answer]:
    """What is proven of all pairs of a proof where they are, or after a move."""
    moves, moved, hopeless, asked = np.zeros((len(proof.pairs), 6)), [], [], []
    for k in range(len(proof.pairs)):
        off = None if filled_bore(proof, k, q, touching) else off_contacts(proof, k, q, touching, normals[k])
        if off is None:
            hopeless.append(k)
        elif off.any():
            moves[k] = off
            moved.append(k)
        else:
            asked.append(k)
    answers = dict(zip(moved, proof.look(q, touching, moves, which=moved), strict=True))
    asked += [k for k, answer in answers.items() if answer.verdict is not Verdict.TOUCHING]
    for k in asked:
        answers[k] = Answer(Verdict.UNDECIDED) if interruption.is_over() else _at_rest(proof, k, q, touching)
    # No look at rest tells that bodies conform, and no move opens them: only that they cross may be found.
    answers.update(zip(hopeless, proof.look(q, touching, which=hopeless, budget=FEW), strict=True))
    return [answers[k] for k in range(len(proof.pairs))]


def _at_rest(proof: ClearanceProof, k: int, q: Array, touching: float) -> Answer:
    """What is proven of a pair where it is, or where it is moved off what that leaves open."""
    (answer,) = found = proof.look(q, touching, which=[k])
    moves = np.zeros((len(proof.pairs), 6))
    for _ in range(TRIES):
        move = left_open(proof, k, q, touching) if found[0].verdict is Verdict.UNDECIDED else None
        if move is None:
            break
        moves[k] = move
        found = proof.look(q, touching, moves, which=[k])
    return found[0] if found[0].verdict is Verdict.TOUCHING else answer


def _near(posed: PosedBodies, pairs: Sequence[Pair]) -> list[Pair]:
    """Those pairs of bodies with shapes whose boxes, along the world's axes, meet."""
    placed = zip(posed.bodies, posed.q, strict=True)
    boxes = {id(body): posed_box(body, row) for body, row in placed if body.faces}
    low = np.array([[boxes[id(a)][0], boxes[id(b)][0]] for a, b in pairs]).reshape(-1, 2, 3)
    high = np.array([[boxes[id(a)][1], boxes[id(b)][1]] for a, b in pairs]).reshape(-1, 2, 3)
    meet = (low.max(axis=1) <= high.min(axis=1)).all(axis=1)
    return [pair for pair, near in zip(pairs, meet.tolist(), strict=True) if near]


def posed_box(body: Body, row: Array) -> tuple[Array, Array]:
    """The lower and the upper corner of a box around a body at a pose."""
    points = np.concatenate([face.face.surface.control_points.reshape(-1, 3) for face in body.faces])
    points = points @ rotation_matrix(row[3:]).T + row[:3]
    margin = END_ROUNDING * np.abs(points).max()
    return points.min(axis=0) - margin, points.max(axis=0) + margin
