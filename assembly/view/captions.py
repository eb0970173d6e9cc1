"""What the play bar of a page says at each frame of a motion."""

from __future__ import annotations

from collections.abc import Sequence
from json import dumps
from typing import Any

import numpy as np

from assembly.assembly import Assembly
from assembly.solve.solution import Solution
from assembly.view.dragging.joint_values import freedoms_of
from assembly.view.skeleton import said_value
from assembly.view.style import Style

__all__ = ["captions_text", "driven_captions"]

# Driven coordinates that a caption has room for.
_MOST = 3


def captions_text(captions: Sequence[str]) -> str:
    """What the play bar says at each frame, to stand behind the player."""
    # "</script>" in a caption would end the page's script.
    listed = dumps(list(captions)).replace("<", "\\u003c")
    return f'<script type="text/plain" class="with-viewer">captions.push(...{listed});</script>\n'


def driven_captions(scene: Assembly, trajectory: Any, style: Style) -> tuple[str, ...]:
    """Coordinates that are driven and that change over solutions, at each; nothing where there are none."""
    if isinstance(trajectory, np.ndarray) or not all(isinstance(each, Solution) for each in trajectory):
        return ()
    told: list[list[str]] = []
    for name, freedom in freedoms_of(scene).items():
        values = [each.values.get(name) for each in trajectory]
        if freedom.value is None or None in values or np.ptp(np.array(values, dtype=np.float64)) == 0.0:
            continue
        told.append(
            [f"{name} {said_value(float(v), freedom.coordinate.is_angle, style)}" for v in values if v is not None]
        )
    return tuple(", ".join(each) for each in zip(*told[:_MOST], strict=True))
