"""Which bodies are in the way where a solve from a solution fails: those without whose clearances it would succeed.

A solve that fails under clearances leaves bodies clear and their drives behind, but does not tell what stopped them. So
the scene is solved with one pair of nearly touching bodies after the other left out, and without any clearance if that
does not tell, as when two posts stop a bar at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from assembly.constraints.model.clearance import Clearance
from assembly.proximity.clearance.answers import Answer
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.interruption import Interruption
from assembly.solve.near_contacts import near_contacts
from assembly.solve.solution import Solution
from assembly.tracking.clear_ticks import ClearTicks

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Obstacles"]

# Bodies whose contacts are open by less, in parts of the size, are nearly in touch.
TOUCHED = 1e-4
# With more pairs of bodies none is left out alone, as each takes a solve.
MOST_TRIED = 16


class Obstacles:
    """The question about a pose of a scene at which a way ends.

    Parameters
    ----------
    scene : Assembly
    at : Solution
    proof : ClearanceProof
    ticks : callable
        A proof of ways that begins at the pose.
    options, interruption
        Of solves.
    """

    def __init__(
        self,
        scene: Assembly,
        at: Solution,
        proof: ClearanceProof,
        ticks: Callable[[], ClearTicks],
        options: dict[str, Any],
        interruption: Interruption,
    ) -> None:
        self._scene, self._at, self._proof, self._ticks = scene, at, proof, ticks
        self._options, self._interruption = options, interruption

    def found(self) -> dict[int, Answer]:
        """The pairs of bodies, by their numbers in the proof, without which the present values are reached.

        Of each, what is proven on the way there.
        """
        near = sorted(near_contacts(self._at, self._proof, TOUCHED * self._scene.packed().scale))
        tried = {k: self._crossed_without([k]) for k in near} if len(near) <= MOST_TRIED else {}
        alone = {k: crossed[k] for k, crossed in tried.items() if k in crossed}
        return alone or self._crossed_without(range(len(self._proof.pairs)))

    def _crossed_without(self, left_out: list[int] | range) -> dict[int, Answer]:
        """The pairs that do not stay clear on the way to what is asked for, where some are not kept apart."""
        other = self._without(left_out)
        settings = other._settings(self._options, self._interruption, warm=False)
        reached = other._solved(settings, self._at.q, None, self._interruption)
        if not reached.success:
            return {}
        there = self._scene._from_start(reached.q, None, {**self._options, "max_iterations": 0}, self._interruption)
        ticks = self._ticks()
        return {} if ticks.holds(there) else ticks.doubtful

    def _without(self, left_out: list[int] | range) -> Assembly:
        """The scene, without the clearances of some pairs."""
        bodies = self._scene.bodies
        pairs = [(bodies[a], bodies[b]) for a, b in (self._proof.pairs[k] for k in left_out)]
        other = type(self._scene)(bodies)
        for item in self._scene.constraints:
            other.constrain(item._without(pairs) if isinstance(item, Clearance) else item)
        other._objectives = list(self._scene._objectives)
        return other
