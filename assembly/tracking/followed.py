"""What all steps of a tracker share: the packed scene, and the springs to the targets."""

from __future__ import annotations

from dataclasses import dataclass

from assembly.constraints.packing.scene import Packed
from assembly.solve.scene import Scene, Status
from assembly.tracking.hands import Hands

__all__ = ["Followed"]


@dataclass(frozen=True, eq=False)
class Followed:
    """A scene whose bodies follow hands.

    Attributes
    ----------
    scene : Scene
    packed : Packed
    names : list of (str, str)
        Of the bodies of every pair that clearances keep apart.
    hands : Hand or SeveralHands
        The springs.
    begun : Status
        SOLVED, or FITTED where rows of the scene repeat each other and disagree: those hold as well as they can.
    """

    scene: Scene
    packed: Packed
    names: list[tuple[str, str]]
    hands: Hands
    begun: Status
