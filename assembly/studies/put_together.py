"""Parts put together without clearances first, where a solve starts far from where its constraints hold.

What the other constraints and the objective ask for is the most that a solution can have. Where nothing crosses at that
pose, it is the solution: no clearance pushes there. To it bodies may pass through each other, as a bolt on the wrong
side of its plate has to. So it is the first thing to try from a start at which bodies are in each other, or each is on
a side of a plane that parts it from the others, as in an exploded view. Elsewhere bodies may be linked, as rings are,
or in each other's holes, and are to stay so: there it is the last thing.

An objective alone also draws bodies onto what is to carry them, a ring down onto a plate, by points beyond. They are to
come to rest on this side of it. So parts that it draws into each other are put together, and those that are beside each
other at the end are if they are on the same side as they were.
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
# [size of the scene] Constraints that are off by no more hold.
HELD = 1e-9


class PutTogether:
    """How bodies are put together without clearances.

    Attributes
    ----------
    keeps_topology : bool
        Whether bodies are clear at the start, but not all parted by planes, so that other ways come first.
    is_asked : bool
        Whether constraints do not hold at the start; else an objective alone asks to put bodies together.
    """

    def __init__(
        self, is_clear: bool, sides: list[Array | None], is_asked: bool, solve: Callable[[], Solution]
    ) -> None:
        self.keeps_topology = is_clear and any(side is None for side in sides)
        self.is_asked, self._sides, self._solve = is_asked, sides, solve

    @cached_property
    def solution(self) -> Solution | None:
        """Where constraints but clearances hold, and objectives are least; None where that is not found."""
        solution = self._solve()
        return solution if solution.success else None

    def is_meant(self, scene: Assembly, solution: Solution) -> bool:
        """Whether bodies are to be where a solution has them: constraints ask for it, or none has changed sides.

        Those have sides that a plane parts at the start, and at the solution where they may touch.
        """
        if self.is_asked or not solution.success:
            return True
        with lent_proof(scene.packed(), scene.bodies) as proof:
            ends = _sides(proof, solution.q, proof.moves)
        both = zip(self._sides, ends, strict=True)
        return all(side is None or end is None or float(side @ end) > 0.0 for side, end in both)


def _sides(proof: ClearanceProof, q: Array, moves: Array | None = None) -> list[Array | None]:
    """Of every pair the normal of a plane between the bodies, after moves if there are; None where none is found."""
    return [proof.plane_between(k, q, moves) for k in range(len(proof.pairs))]


def put_together(
    scene: Assembly,
    q: Array,
    starts: Mapping[str, ArrayLike] | None,
    options: dict[str, Any],
    interruption: Interruption,
) -> PutTogether | None:
    """How bodies of a scene are put together without clearances, from poses (n, 7).

    None where the other constraints hold and there is no objective, and where the topology of the start is to be kept
    in any case.
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
        is_clear = not any(is_stuck(answer, touching) for answer in proof.look(q, touching))
        sides = _sides(proof, q)
    solve = partial(inner._from_start, q, starts, options, interruption)
    return PutTogether(is_clear, sides, is_asked, solve)
