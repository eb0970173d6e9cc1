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
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.clearance_proof import can_prove, lent_proof
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import GATHER, NEVER
from assembly.solve.options import Options
from assembly.solve.solution import Solution
from assembly.studies.parting import is_stuck

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["PutTogether", "put_together"]

Array = NDArray[np.float64]
# [size of the scene] Constraints with smaller violations count as held.
HELD = 1e-9


class PutTogether:
    """How bodies are put together without clearances.

    Attributes
    ----------
    keeps_topology : bool
        Whether bodies are clear at the start, but not all parted by planes, so that other ways come first.
    is_asked : bool
        Whether constraints do not hold at the start; otherwise only an objective draws bodies together.
    """

    def __init__(
        self, is_clear: bool, sides: list[Array | None], is_asked: bool, solve: Callable[[], Solution]
    ) -> None:
        self.keeps_topology = is_clear and any(side is None for side in sides)
        self.is_asked, self._sides, self._solve = is_asked, sides, solve

    @cached_property
    def solution(self) -> Solution | None:
        """The solution without clearances; None if it is not found."""
        solution = self._solve()
        return solution if solution.success else None

    def is_meant(self, scene: Assembly, solution: Solution) -> bool:
        """Whether to accept a solution: constraints require it, or no pair has changed sides.

        A pair has sides if a plane separates it at the start, and at the solution, where the bodies may touch.
        """
        if self.is_asked or not solution.success:
            return True
        with lent_proof(scene.packed(), scene.bodies) as proof:
            ends = _sides(proof, solution.q, proof.moves)
        both = zip(self._sides, ends, strict=True)
        return all(side is None or end is None or float(side @ end) > 0.0 for side, end in both)


def _sides(proof: ClearanceProof, q: Array, moves: Array | None = None) -> list[Array | None]:
    """For every pair the normal of a plane between the bodies, after given moves; None if none is found."""
    return [proof.plane_between(k, q, moves) for k in range(len(proof.pairs))]


def put_together(
    scene: Assembly,
    q: Array,
    starts: Mapping[str, ArrayLike] | None,
    options: dict[str, Any],
    interruption: Interruption,
) -> PutTogether | None:
    """Put the bodies of a scene together without clearances, from poses (n, 7).

    None if the other constraints hold and there is no objective, or if the topology of the start is to be kept.
    """
    settings = Options.of(options)
    others = [item for item in scene.constraints if not isinstance(item, Clearance)]
    packed = scene.packed()
    if settings.keep_topology or settings.max_iterations == 0 or not can_prove(packed):
        return None
    inner = type(scene)(scene.bodies)
    inner._take_constraints(others)
    for sign, objective in scene.objectives:
        (inner.minimize if sign > 0.0 else inner.maximize)(objective)
    as_it_is = inner._settings(options | {"max_iterations": 0}, interruption, warm=False)
    as_it_is[GATHER] = NEVER
    is_asked = bool(others) and not inner._solved(as_it_is, q, starts, interruption).feasibility <= HELD * packed.scale
    if not (is_asked or scene.objectives) or interruption.is_over():
        return None
    with lent_proof(packed, scene.bodies) as proof:
        touching = settings.touching * packed.scale
        is_clear = not any(is_stuck(answer, touching) for answer in proof.as_they_stand(q, touching))
        sides = _sides(proof, q)
    solve = partial(inner._from_start, q, starts, options, interruption)
    return PutTogether(is_clear, sides, is_asked, solve)
