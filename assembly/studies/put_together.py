"""Parts put together without clearances first, where a solve begins with joints and contacts that do not hold.

What the other constraints ask for is the least that a solution has to have. Where nothing crosses at that pose, it is
the solution: no clearance pushes there. To it bodies may pass through each other, as a bolt on the wrong side of its
plate has to. So it is the first thing to try from a start at which bodies are in each other, or each is on a side of a
plane that parts it from the others, as in an exploded view. Elsewhere bodies may be linked, as rings are, or in each
other's holes, and are to stay so: there it is the last thing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.solve.clearance_proof import can_prove, lent_proof
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import GATHER, NEVER
from assembly.solve.options import Options
from assembly.studies.parting import is_stuck

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["PutTogether", "put_together"]

Array = NDArray[np.float64]
# [size of the scene] Constraints that are off by no more hold.
HELD = 1e-9


@dataclass(frozen=True, eq=False)
class PutTogether:
    """Where bodies are put together without clearances.

    Attributes
    ----------
    poses : (n, 7)
    keeps_topology : bool
        Whether bodies were clear at the start, but not all parted by planes, so that other ways come first.
    """

    poses: Array
    keeps_topology: bool


def put_together(
    scene: Assembly,
    q: Array,
    starts: Mapping[str, ArrayLike] | None,
    options: dict[str, Any],
    interruption: Interruption,
) -> PutTogether | None:
    """Where the constraints of a scene but its clearances hold, from poses (n, 7) at which they do not.

    None where they hold, where they cannot be made to, or where the topology of the start is to be kept in any case.
    """
    settings = Options.of(options)
    others = [item for item in scene.constraints if not isinstance(item, Clearance)]
    packed = scene.packed()
    if not others or settings.keep_topology or settings.max_iterations == 0 or not can_prove(packed):
        return None
    inner = type(scene)(scene.bodies)
    inner.constrain(*others)
    for sign, objective in scene.objectives:
        (inner.minimize if sign > 0.0 else inner.maximize)(objective)
    as_it_is = inner._settings(options | {"max_iterations": 0}, interruption, warm=False)
    as_it_is[GATHER] = NEVER
    start = inner._solved(as_it_is, q, starts, interruption)
    if start.feasibility <= HELD * packed.scale or interruption.is_over():
        return None
    solution = inner._from_start(q, starts, options, interruption)
    if not solution.success:
        return None
    with lent_proof(packed, scene.bodies) as proof:
        touching = settings.touching * packed.scale
        is_clear = not any(is_stuck(answer, touching) for answer in proof.look(q, touching))
        # The boxes of whole bodies.
        is_parted = all(proof.is_apart(k, q, 0.0, 1) for k in range(len(proof.pairs)))
    return PutTogether(solution.q.copy(), is_clear and not is_parted)
