"""Settings of the loop at the start of a solve: its options, and those of a scene without an objective."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.loop.settings import ANY_POSE, GATHER, STRAYS
from assembly.solve.options import Options

__all__ = ["scene_settings"]

Array = NDArray[np.float64]


def _made(options: Options, has_objective: bool, warm: bool) -> Array:
    """Settings of their own: without an objective any pose will do, and a start with one may stray."""
    settings = CTRL_C.fill(options.settings(warm))
    if not has_objective:
        settings[ANY_POSE] = 1.0
        settings[GATHER] = 0.0 if warm else 1.0
    elif not warm:
        settings[STRAYS] = 1.0
    return settings


# Settings of solves without options, by (has_objective, warm); a solve copies them before it writes to them.
_USUAL = {
    (has_objective, warm): _made(Options(), has_objective, warm)
    for has_objective in (False, True)
    for warm in (False, True)
}


def scene_settings(options: dict[str, Any], interruption: Interruption, has_objective: bool, warm: bool) -> Array:
    """Settings of a solve, which nobody may write to.

    Parameters
    ----------
    options : dict
        See `Options`.
    interruption : Interruption
        Whom the loop asks whether to go on.
    has_objective : bool
        Whether the scene has an objective.
    warm : bool
        Whether the solve goes on from a solution.
    """
    settings = _made(Options.of(options), has_objective, warm) if options else _USUAL[has_objective, warm]
    return interruption.settings(settings)
