"""Parts put together without clearances first, where a solve begins with joints and contacts that do not hold.

What the other constraints ask for is the least that a solution has to have. Where nothing crosses at that pose, it is
the solution: no clearance pushes there. To it bodies may pass through each other, as a bolt on the wrong side of its
plate has to. So it is the first thing to try from a start at which bodies are far from where joints want them, or in
each other; from one that is near and clear it is the last, because there linked rings are to stay linked.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import Contact
from assembly.solve.clearance_proof import can_prove, lent_proof
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import GATHER, NEVER
from assembly.solve.options import Options
from assembly.studies.parting import is_stuck

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["PutTogether", "put_together"]

Array = NDArray[np.float64]
# [size of the scene] Constraints that are off by no more hold; where joints are off by more bodies are far away, and
# what is clear there is no topology to keep. That a contact is open says nothing of it: rings that are to touch are.
HELD, FAR = 1e-9, 0.1


@dataclass(frozen=True, eq=False)
class PutTogether:
    """Where bodies are put together without clearances.

    Attributes
    ----------
    poses : (n, 7)
    keeps_topology : bool
        Whether the start was near and clear, so that other ways come first.
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
    off = max((start.violations[item.name] for item in others if not isinstance(item, Contact)), default=0.0)
    return PutTogether(solution.q.copy(), is_clear and off <= FAR * packed.scale)
