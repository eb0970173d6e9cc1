"""Proof at the start of a solve that bodies are clear or only touch, without any contact.

How faces that touch are opened follows from their kinds: flat faces that lie on each other, a body that fills a bore;
otherwise from what a look leaves open. If all that fails, contacts of the loop may tell (`clearance_proof.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.kinematics.body import Body
from assembly.proximity.clearance.answers import Answer, Verdict, is_proven
from assembly.proximity.clearance.conforming import conforms
from assembly.proximity.clearance.deforming import smaller_answer
from assembly.proximity.clearance.hulls.scene import HullAnswers
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.touching import filled_bore, left_open, off_contacts
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.clearance_proof import (
    TRIES,
    PairAnswer,
    StayedClear,
    hull_answers,
    lent_proof,
    named_answers,
    nothing_known,
    owned_pairs,
    part_of_proof,
)
from assembly.solve.interruption import CTRL_C
from assembly.solve.samples import PosedBodies, sampled

__all__ = ["is_for_proofs", "prove_start", "prove_way"]

Array = NDArray[np.float64]
# Verdicts at which a start does not hold.
CROSSED = (Verdict.CROSSING, Verdict.ENCLOSED)
# Pairs of nodes that are looked at on a way, for each pair of bodies: at first, where faces that come to touch have to
# be opened if it takes more, and then.
QUICK, BUDGET = 500, 2000


def is_for_proofs(packed: Packed) -> bool:
    """Whether proofs alone tell that clearances hold: beside a contact a least gap is kept by rows."""
    return not any(touched and item.minimum > 0.0 for item, _, touched in owned_pairs(packed))


def prove_start(packed: Packed, bodies: Sequence[Body], state: Array, touching: float) -> Sequence[PairAnswer] | None:
    """What is proven of all pairs that clearances keep apart; None if not all of them hold.

    Equal poses are not checked again, whether all held there or not.

    Parameters
    ----------
    packed : Packed
    bodies : sequence of Body
    state : array
        Poses, and pairs of the given contacts.
    touching : float
        How much bodies may overlap and still count as touching, in parts of the scene's size.
    """
    q, asked = state[: packed.contacts_at].reshape(-1, 7), _asked(packed, state)
    # Read once: other threads may solve the scene.
    stood = packed.stood
    if stood is not None and stood[:2] == (asked, touching):
        return stood[2]
    # Hulls of faces prove most of it before there are cells, and of faces that lie on each other in less time.
    found = _told_by_hulls(packed, bodies, state, touching)
    if found is not None:
        return found
    hulls = hull_answers(packed, bodies, q, touching * packed.scale)
    if hulls.any_crosses():
        packed.stood = asked, touching, None
        return None
    answers, conforming = _left_answers(packed, bodies, q, touching * packed.scale, hulls.told())
    if answers is None:
        packed.stood = asked, touching, None
        return None
    owned = owned_pairs(packed)
    if conforming:
        given = state[packed.contacts_at :][: TRACK * len(packed.contacts)].reshape(-1, TRACK)
        posed = PosedBodies(bodies, q, touching, packed.contacts, given)
        if sampled(posed, [owned[k][1] for k in conforming], CTRL_C).crossing:
            packed.stood = asked, touching, None
            return None
    found = named_answers(packed, answers)
    packed.stood = asked, touching, found
    return found


def _left_answers(
    packed: Packed, bodies: Sequence[Body], q: Array, touching: float, told: Mapping[int, Answer]
) -> tuple[list[Answer] | None, list[int]]:
    """As `_answers`; where there are no cells yet, they are made of bodies of pairs alone that are not told."""
    if packed.proofs or not told:
        with lent_proof(packed, bodies) as proof:
            proof.make_slimmer(touching)
            return _answers(proof, q, touching, told)
    left, proof = part_of_proof(packed, bodies, told)
    proof.make_slimmer(touching)
    answers, conforming = _answers(proof, q, touching, {})
    if answers is None:
        return None, []
    found = dict(told) | dict(zip(left, answers, strict=True))
    return [found[k] for k in range(len(found))], [left[place] for place in conforming]


def _told_by_hulls(
    packed: Packed, bodies: Sequence[Body], state: Array, touching: float
) -> Sequence[PairAnswer] | None:
    """What is proven where hulls of faces tell that all pairs hold; None where they do not."""
    q = state[: packed.contacts_at].reshape(-1, 7)
    hulled = hull_answers(packed, bodies, q, touching * packed.scale).all_held()
    if hulled is None:
        return None
    found = named_answers(packed, hulled)
    packed.stood = _asked(packed, state), touching, found
    return found


def _asked(packed: Packed, state: Array) -> bytes:
    """Poses, and pairs of the given contacts, by which a proof is found again."""
    return state[: packed.contacts_at + TRACK * len(packed.contacts)].tobytes()


def prove_way(
    packed: Packed,
    bodies: Sequence[Body],
    last: Array,
    state: Array,
    touching: float,
    may_jump: bool = True,
) -> Sequence[PairAnswer] | None:
    """What is proven of all pairs at poses, and that none has passed through the other on the way from the last ones.

    The straight way is proven; where it is not, it has to be shorter than the least radius of what is round of the two
    bodies, or a quarter of their size. None where that is not so, or the poses are not proven as `prove_start` asks.

    Parameters
    ----------
    packed : Packed
    bodies : sequence of Body
    last : (n, 7)
        The last poses.
    state : array
        Poses, and pairs of the given contacts.
    touching : float
        How much bodies may overlap and still count as touching, in parts of the scene's size.
    may_jump : bool
        Whether a short way is accepted that is not proven. Else the last poses may be any, of no solution.
    """
    q, length = state[: packed.contacts_at].reshape(-1, 7), touching * packed.scale
    if (q == last).all():
        # Nothing has moved: there is no way, and the poses were looked at before.
        return prove_start(packed, bodies, state, touching)
    # A way leads from where all are clear to where they still are. Hulls tell at once of what touches; a look, for
    # which cells are made, would spend its budget there.
    if not may_jump and any(hull_answers(packed, bodies, at, length).any_touches() for at in (last, q)):
        return None
    with lent_proof(packed, bodies) as proof:
        proof.make_slimmer(length)
        if not may_jump:
            # What is found is not to depend on what was solved before.
            proof.begin_anew()
            stood = enumerate(proof.as_they_stand(last, length))
            if any(answer.verdict is not Verdict.CLEAR and not proof.is_of_wires(k) for k, answer in stood):
                return None
        if not (proof.is_at(last) or proof.stays_clear(last, length, proof.moves, QUICK, at_once=True)):
            if may_jump:
                # Where no look proved the last way, none is likely to prove this one, and hulls tell in less time.
                if proof.has_jumped and _is_short_or_clear(proof, last, q, hull_answers(packed, bodies, last, length)):
                    found = _told_by_hulls(packed, bodies, state, touching)
                    if found is not None:
                        return found
                # Hulls may have told of the last poses: what opens faces that touch there is not known yet.
                _answers(proof, last, length, {})
            else:
                proof.look_from(last, length)
        if proof.stays_clear(q, length, proof.moves, QUICK):
            found = StayedClear(packed, *proof.clear_bounds(q, proof.moves))
            packed.stood = _asked(packed, state), touching, found
            proof.has_jumped = False
            return found
        if not may_jump:
            return None
        if any(proof.way_length(k, last, q) > proof.radius(k) for k in _unproven_ways(proof, q, length)):
            return None
        proof.has_jumped = True
    return prove_start(packed, bodies, state, touching)


def _is_short_or_clear(proof: ClearanceProof, last: Array, q: Array, told: HullAnswers) -> bool:
    """Whether ways are shorter than what is round or thin of a pair, or than how far it was apart at the last poses."""
    for k in range(len(proof.pairs)):
        way = proof.way_length(k, last, q)
        if way > proof.radius(k):
            answer = told.held(k)
            if answer is None or answer.bound - way <= proof.minimum[k]:
                return False
    return True


def _unproven_ways(proof: ClearanceProof, q: Array, touching: float) -> list[int]:
    """The pairs whose way to poses is not proven, either, if they are opened there where faces come to touch."""
    closing = [k for k in proof.not_clear() if proof.fronts.pair.known[k] == 1.0]
    for k in closing:
        off = off_contacts(proof, k, q, touching, nothing_known)
        proof.moves[k] = 0.0 if off is None else off
    answers = proof.look(q, touching, proof.moves, closing, swept=True, budget=BUDGET)
    proven = {k for k, answer in zip(closing, answers, strict=True) if is_proven(answer)}
    return [k for k in proof.not_clear() if k not in proven]


def _answers(
    proof: ClearanceProof, q: Array, touching: float, told: Mapping[int, Answer]
) -> tuple[list[Answer] | None, list[int]]:
    """What is proven of all pairs, and those which samples are to tell of; None where any crosses, or may.

    Pairs that are told already are not looked at.
    """
    moves, conforming = _opening(proof, q, touching, told)
    asked = [k for k in range(len(proof.pairs)) if k not in conforming and k not in told]
    answers = [told.get(k, Answer(Verdict.UNDECIDED)) for k in range(len(proof.pairs))]
    for k, answer in zip(asked, proof.look(q, touching, moves, which=asked), strict=True):
        answers[k] = answer
    if any(answer.verdict in CROSSED for answer in answers):
        return None, []
    for k in asked:
        if not is_proven(answers[k]):
            answers[k] = _off_what_is_open(proof, k, q, moves, touching)
        proof.moves[k] = moves[k] if is_proven(answers[k]) else 0.0
    left = []
    for k, answer in enumerate(answers):
        if is_proven(answer):
            continue
        smaller = smaller_answer(proof, k, q, touching)
        if smaller is not None and smaller.verdict in CROSSED:
            return None, []
        if smaller is not None:
            answers[k] = smaller
        # Of bodies that lie on each other without play a least gap is none.
        elif proof.minimum[k] > 0.0 or not conforms(proof, k, q, touching):
            return None, []
        else:
            left.append(k)
    return answers, left


def _opening(proof: ClearanceProof, q: Array, touching: float, told: Mapping[int, Answer]) -> tuple[Array, set[int]]:
    """Of every pair a move (6) that opens it where flat faces touch, and the pairs that none opens.

    What opened contacts before may do so here.
    """
    moves, hopeless = proof.moves.copy(), set()
    for k in proof.near_pairs(q, touching):
        # Wires that touch are slimmer instead.
        if k in told or moves[k].any() or proof.is_of_wires(k):
            continue
        off = None if filled_bore(proof, k, q, touching) else off_contacts(proof, k, q, touching, nothing_known)
        if off is None:
            hopeless.add(k)
        else:
            moves[k] = off
    return moves, hopeless


def _off_what_is_open(proof: ClearanceProof, k: int, q: Array, moves: Array, touching: float) -> Answer:
    """What is proven of a pair that is moved off what is recognized to touch here, or off what looks leave open."""
    off = off_contacts(proof, k, q, touching, nothing_known)
    moves[k] = 0.0 if off is None else off
    (answer,) = proof.look(q, touching, moves, which=[k])
    for _ in range(TRIES):
        move = left_open(proof, k, q, touching) if answer.verdict is Verdict.UNDECIDED else None
        if move is None:
            break
        moves[k] = move
        (answer,) = proof.look(q, touching, moves, which=[k])
    return answer
