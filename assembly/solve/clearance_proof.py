"""Proof of clearances at the end of a solve: bodies are clear of each other, or only touch.

Bodies that touch are not clear. That they only touch is proven if they are clear after a move of one of them by less
than `touching`: the least move that opens the contacts that the solve has listed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import side_faces
from assembly.constraints.packing.scene import Packed
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body
from assembly.proximity.clearance.answers import Answer, Contacts, Verdict, is_proven
from assembly.proximity.clearance.conforming import conforms
from assembly.proximity.clearance.deforming import smaller_answer
from assembly.proximity.clearance.proof import LEAST_SIZE, ClearanceProof
from assembly.proximity.clearance.touching import filled_bore, left_open, move_apart, off_contacts
from assembly.proximity.extrema.pairs import ContactPair
from assembly.solve.contact_pairs import contact_pairs, listed_contacts
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.loop.settings import ANY_POSE, FEASIBILITY
from assembly.solve.samples import PosedBodies, sampled
from assembly.solve.scene import Status

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = [
    "FEW",
    "TRIES",
    "PairAnswer",
    "can_prove",
    "judge_end",
    "lent_proof",
    "near_contacts",
    "new_proof",
    "nothing_known",
    "opening_move",
    "owned_pairs",
    "prove_end",
    "proven_pairs",
]

Array = NDArray[np.float64]
# Contacts that are open by less than so many times how far a body may be moved are in its way.
NEAR = 2.0
# Moves that are tried for contacts without a row.
TRIES = 3
# Pairs of nodes that a look may take where bodies conform.
FEW = 500


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
    touched = {frozenset(id(body) for body in contact.bodies) for contact in packed.contacts}
    return [
        (item, pair, frozenset(map(id, pair)) in touched)
        for item, own in zip(packed.clearances, packed.clearance_pairs, strict=True)
        for pair in own
    ]


def proven_pairs(
    packed: Packed, bodies: Sequence[Body]
) -> tuple[list[tuple[Face, ...]], list[tuple[int, int]], list[float]]:
    """Faces of bodies, pairs of their numbers that clearances keep apart, and least gaps, as a proof takes them."""
    number = {id(body): k for k, body in enumerate(bodies)}
    owned = owned_pairs(packed)
    rows = [(number[id(a)], number[id(b)]) for _, (a, b), _ in owned]
    minimum = [0.0 if touched else item.minimum for item, _, touched in owned]
    return [side_faces(body) for body in bodies], rows, minimum


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


def can_prove(packed: Packed) -> bool:
    """Whether a scene has a size at which a proof is possible; else rows alone keep bodies apart."""
    return LEAST_SIZE < packed.scale < 1.0 / LEAST_SIZE


def judge_end(solution: Solution, settings: NDArray[np.float64], interruption: Interruption) -> None:
    """Set a solution under clearances to STALLED if its bodies are not known to be clear.

    Without an objective, if the loop ended because of a crossing, a pose at which rows hold is a solution if all is
    proven.
    """
    if solution._is_lost or (interruption.is_over() and not solution.success):
        return
    begin = perf_counter()
    solution._clear = prove_end(solution)
    if solution.success and not all(pair.holds for pair in solution._clear):
        solution.status = Status.STALLED
    elif (
        solution.status is Status.STALLED
        and settings[ANY_POSE] == 1.0
        and all(pair.proved for pair in solution._clear)
        and solution.feasibility <= settings[FEASIBILITY] * solution._packed.scale
    ):
        solution.status = Status.SOLVED
    solution.seconds += perf_counter() - begin


def prove_end(solution: Solution) -> list[PairAnswer]:
    """What is proven at the pose of a solution of all pairs that its clearances keep apart."""
    packed, scene = solution._packed, solution._scene
    if not can_prove(packed):
        unknown = Answer(Verdict.UNDECIDED)
        return [
            PairAnswer(item.name, (a.name, b.name), unknown, True, False) for item, (a, b), _ in owned_pairs(packed)
        ]
    touching = solution._touching * packed.scale
    with lent_proof(packed, scene.bodies) as proof:
        wedged = _open_recognized(proof, solution.q, touching)
        answers = _first_looks(proof, solution.q, touching, wedged)
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


def _make_smaller(proof: ClearanceProof, q: Array, touching: float, answers: list[Answer], which: set[int]) -> None:
    """Replace the answers to pairs that no rigid move opens where one of both made smaller is proven to be clear."""
    for k in sorted(which):
        smaller = smaller_answer(proof, k, q, touching) if answers[k].verdict is Verdict.UNDECIDED else None
        if smaller is not None:
            answers[k] = smaller


def _open_recognized(proof: ClearanceProof, q: Array, touching: float) -> set[int]:
    """Find what opens pairs that are recognized to touch, among the moves of a proof; the pairs that nothing opens.

    What opened a pair at the last solve may do so here.
    """
    wedged = set()
    for k in proof.near_pairs(q, touching):
        if proof.moves[k].any():
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


def _first_looks(proof: ClearanceProof, q: Array, touching: float, wedged: set[int]) -> list[Answer]:
    """What is proven of all pairs where their moves open them; of those that nothing opens, whether they cross.

    No look can prove that bodies conform: it would spend its whole budget.
    """
    asked = [k for k in range(len(proof.pairs)) if k not in wedged]
    answers = dict(zip(asked, proof.look(q, touching, proof.moves, which=asked), strict=True))
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


def _contacts(solution: Solution, rows: Sequence[tuple[int, int]]) -> Iterator[tuple[int, ContactPair, float]]:
    """Contacts of a solution between bodies that clearances keep apart: the pair, the contact, -1 if it is turned."""
    for number, _, contact in listed_contacts(solution):
        # Behind them are corners of contacts, of which nothing is proven.
        if number < len(rows):
            yield number, contact, 1.0
    scene = solution._scene
    if not scene.contacts:
        return
    places = {pair: number for number, pair in enumerate(rows)}
    found = contact_pairs(solution)
    for item in scene.contacts:
        f, g = (scene.index(body) for body in item.bodies)
        if (f, g) in places:
            yield places[f, g], found[item.name], 1.0
        elif (g, f) in places:
            yield places[g, f], found[item.name], -1.0


def near_contacts(solution: Solution, proof: ClearanceProof, reach: float) -> dict[int, Contacts]:
    """The contacts of a solution that are open by less than a reach, by the number of their pair of bodies."""
    near: dict[int, list[tuple[Array, Array, float]]] = {}
    for number, contact, sign in _contacts(solution, proof.pairs):
        gap = contact.gap - float(proof.minimum[number])
        if gap < reach:
            near.setdefault(number, []).append((sign * contact.normal, contact.points[1 if sign > 0.0 else 0], gap))
    return {number: Contacts(*(np.array(c) for c in zip(*rows, strict=True))) for number, rows in near.items()}


def opening_move(proof: ClearanceProof, k: int, q: Array, contacts: Contacts | None, depth: float) -> Array:
    """The least move (6) of the second body of pair k, by no more than a depth, that opens contacts; zero if none does.

    Of those that are near it opens what is closed, and closes none.
    """
    if contacts is None or depth <= 0.0:
        return np.zeros(6)
    near = contacts.gaps < NEAR * depth
    if not near.any():
        return np.zeros(6)
    move = move_apart(proof, k, q, Contacts(*(column[near] for column in contacts)), depth)
    return np.zeros(6) if move is None else move
