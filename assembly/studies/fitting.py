"""Joints in the place of clearances, of faces that nearly fit at poses; kept with the scene.

Which faces fit depends on the poses alone, so a solve from the same start begins with the same joints, and with the
scene that is packed with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint
from assembly.proximity.clearance.answers import Verdict
from assembly.solve.clearance_proof import answers_at, hull_answers, proven_pairs
from assembly.studies.seated import NearFit, NotBelow, fits

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Fitting", "Side", "fitting"]

Array = NDArray[np.float64]
# Two bodies, and whether it is their flat faces that lie on each other.
Side = tuple[int, int, bool]
# Starts whose joints are kept.
REMEMBERED = 4


@dataclass
class Fitting:
    """How bodies nearly fit at poses.

    Attributes
    ----------
    others : list of Constraint
        What the scene asks for beside clearances.
    sides : dict of NearFit -> Side
        The joints, and of which two bodies each is.
    near : set of (int, int)
        The pairs of bodies that are not proven to be clear.
    is_told : bool
        Whether hulls of faces prove that all bodies are clear or touch there.
    """

    others: list[Constraint]
    sides: dict[NearFit, Side]
    near: set[tuple[int, int]]
    is_told: bool
    _scenes: dict[tuple[NearFit, ...], Assembly] = field(default_factory=dict)

    def scene_with(self, scene: Assembly, held: Sequence[NearFit]) -> Assembly:
        """The bodies and objectives of a scene, with some of the joints in the place of clearances."""
        key = tuple(held)
        inner = self._scenes.get(key)
        if inner is None:
            inner = type(scene)(scene.bodies)
            inner._take_constraints([*self.others, *(fit.joint for fit in held)])
            for sign, objective in scene.objectives:
                (inner.minimize if sign > 0.0 else inner.maximize)(objective)
            self._scenes[key] = inner
        return inner


def fitting(scene: Assembly, poses: Array, touching: float) -> Fitting:
    """How bodies nearly fit that are not proven to be clear at poses (n, 7).

    The names of the joints are not those of other constraints. Hulls of faces are asked first, since they prove most of
    what fits; cells take ten times as long to make.
    """
    packed = scene.packed()
    shapes, pairs, minimum = proven_pairs(packed, scene.bodies)
    key = poses.tobytes() + np.array([touching, *minimum]).tobytes()
    known = scene._fitted.get(key)
    if known is not None:
        return known
    answers = answers_at(packed, scene.bodies, poses, touching * packed.scale)
    is_told = hull_answers(packed, scene.bodies, poses, touching * packed.scale).all_held() is not None
    near = [pair for pair, answer in zip(pairs, answers, strict=True) if answer.verdict is not Verdict.CLEAR]
    others = [item for item in scene.constraints if not isinstance(item, Clearance)]
    taken = {item.name for item in others}
    names = (name for name in map("fit {}".format, count()) if name not in taken)
    sides = {
        fit: (a, b, isinstance(fit.joint, NotBelow))
        for a, b in near
        for fit in fits((scene.bodies[a], scene.bodies[b]), poses[[a, b]], names)
    }
    while len(scene._fitted) >= REMEMBERED:
        scene._fitted.pop(next(iter(scene._fitted)))
    found = scene._fitted[key] = Fitting(others, sides, set(near), is_told)
    return found
