"""Several starts of one scene, and the distinct solutions they lead to."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from assembly._progress import Progress, checked_progress, watched
from assembly.errors import integer
from assembly.solve.attempts.postures import postures_from
from assembly.solve.attempts.starts import moving_rows, scattered
from assembly.solve.interruption import Interruption
from assembly.solve.solution import Solution
from assembly.studies.distinct import are_one

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["solve_all"]

_LOG = logging.getLogger("assembly.studies")


def solve_all(
    scene: Assembly,
    starts: int,
    seed: int,
    interruption: Interruption,
    progress: Progress,
    options: Mapping[str, Any],
) -> list[Solution]:
    """See `Assembly.solve_all`."""
    count = integer("starts", starts, 1, 10**6)
    rng = np.random.default_rng(integer("seed", seed, 0, 2**63 - 1))
    packed = scene.packed()
    moving = moving_rows(scene.bodies)
    found: list[Solution] = []
    checked_progress(progress)
    begun = 0
    with postures_from(packed, scene.q), watched(progress, "solve_all", count, "start") as advance:
        try:
            for start in range(count):
                begun = start
                q = scene.q if start == 0 else scattered(rng, scene.q, moving, packed.scale)
                solution = scene._from_start(q, None, dict(options), interruption)
                if solution.success and not any(are_one(solution, other) for other in found):
                    found.append(solution)
                if not advance(1) or interruption.is_over():
                    break
        except KeyboardInterrupt:
            # What is found is found.
            _LOG.warning("solve_all was interrupted in start %d of %d", begun + 1, count)
    # Of equal objectives, which are so up to rounding only where a scene is symmetric, the first found comes first.
    return sorted(found, key=lambda solution: solution.objective)
