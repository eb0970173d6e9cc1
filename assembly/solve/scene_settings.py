"""What the loop is told where a solve begins: its options, and what a scene without an objective asks for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.loop.settings import ANY_POSE, GATHER, STRAYS
from assembly.solve.options import Options

__all__ = ["scene_settings"]

Array = NDArray[np.float64]


def _made(options: Options, wishes: bool, warm: bool) -> Array:
    """Settings of their own: without an objective any pose will do, and a start with one may stray."""
    settings = CTRL_C.fill(options.settings(warm))
    if not wishes:
        settings[ANY_POSE] = 1.0
        settings[GATHER] = 0.0 if warm else 1.0
    elif not warm:
        settings[STRAYS] = 1.0
    return settings


# Those of solves without options, which are never written to: what begins with them copies them before.
_USUAL = {(wishes, warm): _made(Options(), wishes, warm) for wishes in (False, True) for warm in (False, True)}


def scene_settings(options: dict[str, Any], interruption: Interruption, wishes: bool, warm: bool) -> Array:
    """Settings of a solve, which nobody may write to.

    Parameters
    ----------
    options : dict
        See `Options`.
    interruption : Interruption
        Whom the loop asks whether to go on.
    wishes : bool
        Whether the scene has an objective.
    warm : bool
        Whether the solve goes on from a solution.
    """
    settings = _made(Options.of(options), wishes, warm) if options else _USUAL[wishes, warm]
    return interruption.settings(settings)
