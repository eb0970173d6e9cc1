"""Proof of clearances at the end of a solve: bodies are clear of each other, or only touch.

Bodies that touch are not clear. That they only touch is proven if they are clear after a move of one of them by less
than `touching`: the least move that opens the contacts that the solve has listed.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, cast, overload

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import side_faces
from assembly.constraints.packing.scene import Packed
from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.proximity.clearance.answers import Answer, Contacts, Verdict, is_proven
from assembly.proximity.clearance.conforming import conforms
from assembly.proximity.clearance.deforming import smaller_answer
from assembly.proximity.clearance.holder_first import holds_first
from assembly.proximity.clearance.hulls.scene import HullAnswers
from assembly.proximity.clearance.proof import LEAST_SIZE, ClearanceProof, stayed_answers
from assembly.proximity.clearance.touching import filled_bore, left_open, off_contacts
from assembly.proximity.clearance.wire_cells import is_of_wires
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.loop.settings import ANY_POSE, FEASIBILITY
from assembly.solve.near_contacts import NEAR, near_contacts, opening_move
from assembly.solve.samples import PosedBodies, sampled
from assembly.solve.scene import Status

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = [
    "FEW",
    "TRIES",
    "PairAnswer",
    "answers_at",
    "can_prove",
    "hull_answers",
    "judge_end",
    "lent_proof",
    "named_answers",
    "new_proof",
    "nothing_known",
    "open_recognized",
    "owned_pairs",
    "part_of_proof",
    "prove_end",
    "proven_pairs",
]

Array = NDArray[np.float64]
# Moves that are tried for contacts without a row.
TRIES = 3
# Pairs of nodes that a look may take where bodies conform, or on the way from the last poses.
FEW = 500
# Poses at which it is kept what hulls tell.
REMEMBERED = 4


@dataclass(frozen=True)
class PairAnswer:
    """What is proven of a pair of bodies that a clearance keeps apart.

    Attributes
    ----------
    clearance : str
    bodies : (str, str)
    answer : Answer
    holds : bool
        Whether they are clear or touch: proven, or by samples where faces lie on each other.
    proved : bool
        Whether that is proven, and the least gap as well: beside a contact it is the rows of the solve that keep it.
    """

    clearance: str
    bodies: tuple[str, str]
    answer: Answer
    holds: bool
    proved: bool


def owned_pairs(packed: Packed) -> list[tuple[Clearance, tuple[Body, Body], bool]]:
    """Clearances and the pairs that they keep apart, in the order of a proof; and whether a contact is between the two.

    What is in the place of a contact is asked for no gap, but it may not cross.
    """
    if packed.owned_pairs is None:
        touched = {frozenset(id(body) for body in contact.bodies) for contact in packed.contacts}
        packed.owned_pairs = [
            (item, pair, frozenset(map(id, pair)) in touched)
            for item, own in zip(packed.clearances, packed.clearance_pairs, strict=True)
            for pair in own
        ]
    return packed.owned_pairs


def proven_pairs(
    packed: Packed, bodies: Sequence[Body]
) -> tuple[list[tuple[Face, ...]], list[tuple[int, int]], list[float]]:
    """Faces of bodies, pairs of their numbers that clearances keep apart, and least gaps, as a proof takes them.

    Of two bodies the one in whose bores the other one is goes first.
    """
    number = {id(body): k for k, body in enumerate(bodies)}
    owned = owned_pairs(packed)
    # What faces are is known of the first shape of this content that was asked for.
    shapes = [first_equal(side_faces(body)) for body in bodies]
    rows = [(number[id(a)], number[id(b)]) for _, (a, b), _ in owned]
    rows = [(b, a) if holds_first(shapes[a], shapes[b]) else (a, b) for a, b in rows]
    minimum = [0.0 if touched else item.minimum for item, _, touched in owned]
    return shapes, rows, minimum


def new_proof(packed: Packed, bodies: Sequence[Body]) -> ClearanceProof:
    """A proof of all pairs that the clearances of a packed scene keep apart."""
    return ClearanceProof(*proven_pairs(packed, bodies))


@contextmanager
def lent_proof(packed: Packed, bodies: Sequence[Body]) -> Iterator[ClearanceProof]:
    """The proof of a packed scene's pairs; threads have proofs of their own."""
    proof = packed.proofs.pop() if packed.proofs else new_proof(packed, bodies)
    try:
        yield proof
    finally:
        packed.proofs.append(proof)


def part_of_proof(packed: Packed, bodies: Sequence[Body], told: Container[int]) -> tuple[list[int], ClearanceProof]:
    """The pairs that are not told of, and a proof of these alone: cells are made of their bodies and of no others."""
    shapes, pairs, minimum = proven_pairs(packed, bodies)
    left = [k for k in range(len(pairs)) if k not in told]
    return left, ClearanceProof(shapes, [pairs[k] for k in left], [minimum[k] for k in left])


def hull_answers(packed: Packed, bodies: Sequence[Body], q: Array, touching: float) -> HullAnswers:
    """What hulls of faces tell of all pairs at poses (n, 7): equal poses are asked once, and no pair before it matters.

    Of faces that lie on each other they tell more than looks, in less time, and before there are cells, which take
    longer to make. Of wires that touch they tell nothing: where both bodies of any pair are of wires no pair is asked,
    whatever was solved before.
    """
    shapes, pairs, minimum = proven_pairs(packed, bodies)
    lengths = np.array([touching, *minimum]).tobytes()
    asked = q.tobytes() + lengths
    # Read once: other threads may solve the scene.
    known = packed.hulled
    for key, told in known:
        if key == asked:
            return cast(HullAnswers, told)
    is_silent = any(is_of_wires(shapes[a]) and is_of_wires(shapes[b]) for a, b in pairs)
    last = known[0][1] if known and known[0][0].endswith(lengths) else None
    found = HullAnswers(shapes, pairs, minimum, q.copy(), touching, is_silent, last)
    packed.hulled = ((asked, found), *known[: REMEMBERED - 1])
    return found


def answers_at(packed: Packed, bodies: Sequence[Body], q: Array, touching: float) -> list[Answer]:
    """What all pairs are at poses (n, 7): by hulls of faces, and by looks at pairs of which these do not tell."""
    hulls = hull_answers(packed, bodies, q, touching)
    told = hulls.told_or_crossing()
    if len(told) == len(owned_pairs(packed)):
        return [told[k] for k in range(len(told))]
    if packed.proofs or not told:
        with lent_proof(packed, bodies) as proof:
            return proof.as_they_stand(q, touching)
    if hulls.looked is None:
        left, proof = part_of_proof(packed, bodies, told)
        hulls.looked = dict(zip(left, proof.as_they_stand(q, touching), strict=True))
    found = told | hulls.looked
    return [found[k] for k in range(len(found))]


def can_prove(packed: Packed) -> bool:
    """Whether a scene has a size at which a proof is possible; else rows alone keep bodies apart."""
    return LEAST_SIZE < packed.scale < 1.0 / LEAST_SIZE


def judge_end(solution: Solution, settings: NDArray[np.float64], interruption: Interruption) -> None:
    """Set a solution under clearances to STALLED if its bodies are not known to be clear.

    Without an objective, if the loop ended because of a crossing, a pose at which rows hold is a solution if all is
    proven. Nor is INFEASIBLE said of a pose that holds: where bodies cross at a contradiction, the loop returns to the
    last pose that held.
    """
    if solution._is_lost or (interruption.is_over() and not solution.success):
        return
    begin = perf_counter()
    solution._clear = prove_end(solution)
    stayed = isinstance(solution._clear, StayedClear)
    if solution.success and not (stayed or all(pair.holds for pair in solution._clear)):
        solution.status = Status.STALLED
    elif (
        solution.status in (Status.STALLED, Status.INFEASIBLE)
        and solution.feasibility <= settings[FEASIBILITY] * solution._packed.scale
    ):
        is_solution = settings[ANY_POSE] == 1.0 and all(pair.proved for pair in solution._clear)
        solution.status = Status.SOLVED if is_solution else Status.STALLED
    solution.seconds += perf_counter() - begin


def prove_end(solution: Solution) -> Sequence[PairAnswer]:
    """What is proven at the pose of a solution of all pairs that its clearances keep apart."""
    packed, scene = solution._packed, solution._scene
    if not can_prove(packed):
        unknown = Answer(Verdict.UNDECIDED)
        return [
            PairAnswer(item.name, (a.name, b.name), unknown, True, False) for item, (a, b), _ in owned_pairs(packed)
        ]
    touching = solution._touching * packed.scale
    hulls = hull_answers(packed, scene.bodies, solution.q, touching)
    # Where there are no cells yet, none are made for what hulls tell; else a way from the last poses may be shorter.
    hulled = hulls.all_held() if not packed.proofs else None
    if hulled is not None:
        return named_answers(packed, hulled)
    with lent_proof(packed, scene.bodies) as proof:
        proof.make_slimmer(touching)
        stayed = _stayed_clear(packed, proof, solution.q, touching)
        if stayed is not None:
            return stayed
        told = hulls.told()
        if len(told) == len(proof.pairs):
            return named_answers(packed, list(told.values()))
        wedged = open_recognized(proof, solution.q, touching, told)
        answers = _first_looks(proof, solution.q, touching, wedged, told)
        _make_smaller(proof, solution.q, touching, answers, wedged)
        held = {k for k in wedged if conforms(proof, k, solution.q, touching)}
        left = [k for k, answer in enumerate(answers) if not is_proven(answer) or answer.depth > touching]
        left = [k for k in left if k not in held]
        near = near_contacts(solution, proof, NEAR * touching) if left else {}
        for k in left:
            answers[k] = _opened(proof, k, solution.q, near.get(k), touching)
        _make_smaller(proof, solution.q, touching, answers, set(left) - wedged)
        asked = [
            k
            for k, answer in enumerate(answers)
            if answer.verdict is Verdict.UNDECIDED and (k in held or conforms(proof, k, solution.q, touching))
        ]
    owned = owned_pairs(packed)
    found_crossing = sampled(PosedBodies.of(solution), [owned[k][1] for k in asked], CTRL_C).crossing
    clear = {k for place, k in enumerate(asked) if place not in found_crossing}
    found = []
    for k, ((item, (a, b), touched), answer) in enumerate(zip(owned, answers, strict=True)):
        proven = is_proven(answer)
        proved = proven and not (touched and item.minimum > 0.0)
        found.append(PairAnswer(item.name, (a.name, b.name), answer, proven or k in clear, proved))
    return found


def _stayed_clear(packed: Packed, proof: ClearanceProof, q: Array, touching: float) -> StayedClear | None:
    """What is proven at poses that bodies reach straight from the last ones, staying clear; None where that is unknown.

    That is asked first, as most solves go on from the one before: it is one call for all pairs.
    """
    if not proof.has_looked or not proof.stays_clear(q, touching, proof.moves, FEW, at_once=True):
        return None
    bounds, depths = proof.clear_bounds(q, proof.moves)
    return StayedClear(packed, bounds, depths) if (depths <= touching).all() else None


class StayedClear(Sequence[PairAnswer]):
    """What is proven of pairs that stayed clear, all of which hold; the answers are made when they are asked for.

    Parameters
    ----------
    packed : Packed
    bounds, depths : (pairs,)
        Of bodies after they were moved, and by how much they were.
    """

    def __init__(self, packed: Packed, bounds: Array, depths: Array) -> None:
        self._packed, self._bounds, self._depths = packed, bounds, depths
        # Least gaps may be set anew until then.
        self._minimum = [item.minimum for item, _, _ in owned_pairs(packed)]

    @cached_property
    def _answers(self) -> list[PairAnswer]:
        return named_answers(self._packed, stayed_answers(self._bounds, self._depths), self._minimum)

    @overload
    def __getitem__(self, at: int) -> PairAnswer: ...

    @overload
    def __getitem__(self, at: slice) -> list[PairAnswer]: ...

    def __getitem__(self, at: int | slice) -> PairAnswer | list[PairAnswer]:
        return self._answers[at]

    def __len__(self) -> int:
        return len(self._bounds)

    def __reduce__(self) -> tuple[type[list[PairAnswer]], tuple[list[PairAnswer]]]:
        return list, (self._answers,)


def named_answers(
    packed: Packed, answers: Sequence[Answer], minimum: Sequence[float] | None = None
) -> list[PairAnswer]:
    """Answers that hold, with the names of what they are of; least gaps are those of now if none are given."""
    owned, found = owned_pairs(packed), []
    asked = [item.minimum for item, _, _ in owned] if minimum is None else minimum
    for (item, (a, b), touched), answer, least in zip(owned, answers, asked, strict=True):
        proved = is_proven(answer) and not (touched and least > 0.0)
        found.append(PairAnswer(item.name, (a.name, b.name), answer, True, proved))
    return found


def _make_smaller(proof: ClearanceProof, q: Array, touching: float, answers: list[Answer], which: set[int]) -> None:
    """Replace the answers to pairs that no rigid move opens where one of both made smaller is proven to be clear."""
    for k in sorted(which):
        smaller = smaller_answer(proof, k, q, touching) if answers[k].verdict is Verdict.UNDECIDED else None
        if smaller is not None:
            answers[k] = smaller


def open_recognized(proof: ClearanceProof, q: Array, touching: float, but: Container[int] = ()) -> set[int]:
    """Find what opens pairs that are recognized to touch, among the moves of a proof; the pairs that nothing opens.

    What opened a pair at the last solve may do so here. Some pairs may be left out.
    """
    wedged = set()
    for k in proof.near_pairs(q, touching):
        if k in but:
            continue
        # Wires that touch are slimmer instead.
        if proof.moves[k].any() or proof.is_of_wires(k):
            continue
        off = None if filled_bore(proof, k, q, touching) else off_contacts(proof, k, q, touching, nothing_known)
        if off is None:
            wedged.add(k)
        else:
            proof.moves[k] = off
    return wedged


def nothing_known() -> None:
    """No normals: nothing is known of where bodies touch."""
    return None


def _first_looks(
    proof: ClearanceProof, q: Array, touching: float, wedged: set[int], told: dict[int, Answer]
) -> list[Answer]:
    """What is proven of all pairs where their moves open them; of those that nothing opens, whether they cross.

    No look can prove that bodies conform: it would spend its whole budget. So would one at bodies that touch where
    their moves do not open them, so that these looks take few pairs of nodes. What hulls have told of is not looked at.
    """
    asked = [k for k in range(len(proof.pairs)) if k not in wedged and k not in told]
    answers = told | dict(zip(asked, proof.look(q, touching, proof.moves, which=asked, budget=FEW), strict=True))
    answers |= dict(zip(wedged, proof.look(q, touching, which=list(wedged), budget=FEW), strict=True))
    return [answers[k] for k in range(len(proof.pairs))]


def _opened(proof: ClearanceProof, k: int, q: Array, near: Contacts | None, touching: float) -> Answer:
    """The answer to a pair, moved by what opens its contacts, or else pairs of nodes that a look leaves open.

    The latter is for contacts that no row tells of.
    """
    moves = proof.moves
    moves[k] = opening_move(proof, k, q, near, touching)
    (answer,) = found = proof.look(q, touching, moves, which=[k])
    if moves[k].any() and not is_proven(answer):
        moves[k] = 0.0
        (answer,) = found = proof.look(q, touching, moves, which=[k])
    for _ in range(TRIES):
        move = None if is_proven(found[0]) or answer.depth > touching else left_open(proof, k, q, touching)
        if move is None:
            break
        moves[k] = move
        found = proof.look(q, touching, moves, which=[k])
    if not is_proven(found[0]):
        moves[k] = 0.0
        return answer
    return found[0]
