"""The bodies that are written to a file, and where they stand."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.solve.solution import Solution

__all__ = ["placed_bodies"]


def placed_bodies(what: Any) -> list[tuple[Body, Pose]]:
    """Bodies and where they stand."""
    if isinstance(what, Solution):
        return [(body, what.pose(body)) for body in what._scene.bodies]
    bodies = [what] if isinstance(what, Body) else getattr(what, "bodies", what)
    if not isinstance(bodies, Iterable) or isinstance(bodies, str):
        raise TypeError(f"what is {what!r}; expected an Assembly, a Solution, a Body or several")
    rows = list(bodies)
    for body in rows:
        if not isinstance(body, Body):
            raise TypeError(f"what holds {body!r}; expected bodies")
    if not rows:
        raise InputError("what has no bodies; expected at least one")
    return [(body, body.pose) for body in rows]
