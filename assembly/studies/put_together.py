"""Parts put together without clearances first, where a solve starts far from where its constraints hold.

The problem without clearances is a relaxation: if nothing crosses at its solution, that is the solution, because no
clearance pushes there. On the way bodies may pass through each other, as a bolt on the wrong side of its plate must. So
this is tried first from a start at which bodies cross, or at which planes separate all of them, as in an exploded view.
Otherwise bodies may be linked, as rings are, or in each other's holes, and should stay so: there it is tried last.

An objective alone may also draw bodies onto a support by points beyond it, such as a ring down onto a plate; they
should come to rest on this side of it. So parts that it draws into each other are put together, but parts that are
beside each other at the end only if they are on the same side as before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.hulls.body_hulls import BodyHulls, hulls_of_body
from assembly.proximity.clearance.hulls.planes import normal_between
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.clearance_proof import (
    answers_at,
    can_prove,
    hull_answers,
    lent_proof,
    open_recognized,
    owned_pairs,
)
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import CONTACT_LOST, SOLVED
from assembly.solve.options import Options
from assembly.solve.second_order.leave import Outcome
from assembly.solve.solution import Solution
from assembly.studies.parting import is_stuck

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["PutTogether", "put_together"]

Array = NDArray[np.float64]
# [size of the scene] Constraints with smaller violations count as held.
HELD = 1e-9


class There(NamedTuple):
    """Where bodies are put together: poses (n, 7), and how rows alone ended there if that is how they were found."""

    poses: Array
    alone: Outcome | None


class PutTogether:
    """How bodies are put together without clearances.

    Attributes
    ----------
    keeps_topology : bool
        Whether bodies are clear at the start, but not all parted by planes, so that other ways come first.
    is_asked : bool
        Whether constraints do not hold at the start; otherwise only an objective draws bodies together, which alone has
        to keep them on their sides.
    """

    def __init__(
        self, keeps_topology: bool, sides: list[Array | None], is_asked: bool, solve: Callable[[], There | None]
    ) -> None:
        self.keeps_topology, self.is_asked = keeps_topology, is_asked
        self._sides, self._solve = sides, solve

    @cached_property
    def there(self) -> There | None:
        """The solution without clearances; None if it is not found."""
        return self._solve()

    def is_meant(self, scene: Assembly, solution: Solution) -> bool:
        """Whether to accept a solution: constraints require it, or no pair has changed sides.

        A pair has sides if a plane separates it at the start, and at the solution, where the bodies may touch.
        """
        if self.is_asked or not solution.success:
            return True
        with lent_proof(scene.packed(), scene.bodies) as proof:
            # Hulls that prove a solution tell of no plane.
            open_recognized(proof, solution.q, solution._touching * scene.packed().scale)
            ends = _sides(proof, solution.q, proof.moves)
        both = zip(self._sides, ends, strict=True)
        return all(side is None or end is None or float(side @ end) > 0.0 for side, end in both)


def _sides(proof: ClearanceProof, q: Array, moves: Array | None = None) -> list[Array | None]:
    """For every pair the normal of a plane between the bodies, after given moves; None if none is found.

    Of bodies whose boxes no plane parts, the hulls of their faces are asked.
    """
    found = []
    for k, (a, b) in enumerate(proof.pairs):
        side = proof.plane_between(k, q, moves)
        if side is None:
            side = normal_between(_posed_hulls(proof, a, q[a]), _posed_hulls(proof, b, q[b]))
        found.append(side)
    return found


def _posed_hulls(proof: ClearanceProof, body: int, row: Array) -> BodyHulls:
    """The hulls of the faces of a body at its pose (7)."""
    return hulls_of_body(proof.faces[body]).posed(rotation_matrix(row[3:]), row[:3])


def _are_in_one_place(proof: ClearanceProof, k: int, q: Array, touching: float) -> bool:
    """Whether the bodies of pair k are equal, and in one place, as pins that all stand at the origin.

    Then they are in each other, which no look says: their surfaces are the same, and do not cross. Balls inside of both
    (`overlapped.py`) say so of most bodies, and not of those with thin walls.
    """
    a, b = proof.pairs[k]
    turn, shift = proof.relative(k, q)
    off = float(np.linalg.norm(shift)) + proof.size(k) * float(np.linalg.norm(turn - np.eye(3)))
    return proof.faces[a] is proof.faces[b] and off <= touching and solid_of(proof.faces[a]).is_closed


def put_together(
    scene: Assembly,
    q: Array,
    alone: Outcome,
    starts: Mapping[str, ArrayLike] | None,
    options: dict[str, Any],
    interruption: Interruption,
) -> PutTogether | None:
    """Put the bodies of a scene together without clearances, from poses (n, 7) and how rows alone ended from there.

    None if the other constraints hold and there is no objective, or if the topology of the start is to be kept.
    """
    settings, packed = Options.of(options), scene.packed()
    if settings.keep_topology or not can_prove(packed):
        return None
    has_others = len(packed.clearances) < sum(item._is_asked for item in scene.constraints)
    is_asked = has_others and (alone.code == CONTACT_LOST or not float(alone.history[0, 1]) <= HELD)
    if not (is_asked or scene.objectives) or interruption.is_over():
        return None
    touching = settings.touching * packed.scale

    def solve() -> There | None:
        if alone.code == SOLVED:
            # Attempts that needed more slots for contacts have packed the scene anew, and its states have other places.
            is_packed_so = scene.packed() is packed
            return There(alone.state[: packed.contacts_at].reshape(-1, 7).copy(), alone if is_packed_so else None)
        solution = scene._part(False, True)._from_start(q, starts, options, interruption)
        return There(solution.q.copy(), None) if solution.success else None

    if is_asked:
        return PutTogether(_is_clear_but_not_parted(scene, q, touching), [], True, solve)
    with lent_proof(packed, scene.bodies) as proof:
        sides = _sides(proof, q)
    keeps_topology = any(side is None for side in sides) and _is_clear(scene, q, touching)
    return PutTogether(keeps_topology, sides, False, solve)


def _is_clear_but_not_parted(scene: Assembly, q: Array, touching: float) -> bool:
    """Whether no bodies cross at poses (n, 7), and some are parted by no plane.

    Hulls tell it of most bodies, and where one pair crosses no other one is asked.
    """
    packed = scene.packed()
    hulls = hull_answers(packed, scene.bodies, q, touching)
    if hulls.any_crosses() or not _is_clear(scene, q, touching):
        return False
    if all(hulls.parted(k) for k in range(len(owned_pairs(packed)))):
        return False
    with lent_proof(packed, scene.bodies) as proof:
        return any(side is None for side in _sides(proof, q))


def _is_clear(scene: Assembly, q: Array, touching: float) -> bool:
    """Whether no bodies are told to cross at poses (n, 7), or are equal and in one place."""
    packed = scene.packed()
    answers = answers_at(packed, scene.bodies, q, touching)
    if any(is_stuck(answer, touching) for answer in answers):
        return False
    open_yet = [k for k, answer in enumerate(answers) if answer.verdict is Verdict.UNDECIDED]
    if not open_yet:
        return True
    with lent_proof(packed, scene.bodies) as proof:
        return not any(_are_in_one_place(proof, k, q, touching) for k in open_yet)
