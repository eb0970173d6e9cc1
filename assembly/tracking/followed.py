"""What all steps of a tracker have in common: the packed scene, and the spring that is the hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.objectives import FrameDistance, PointDistance
from assembly.constraints.packing.scene import Packed
from assembly.kinematics.pose import Pose, rotation_matrix
from assembly.solve.scene import Scene, Status

__all__ = ["Followed"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Followed:
    """A scene whose bodies follow a hand.

    Attributes
    ----------
    scene : Scene
    packed : Packed
    names : list of (str, str)
        Of the bodies of every pair that clearances keep apart.
    hand : PointDistance or FrameDistance
        The spring; its weight is half the stiffness.
    place : int
        Of the body that is held, among those of the scene.
    begun : Status
        SOLVED, or FITTED where rows of the scene repeat each other and disagree: those hold as well as they can.
    """

    scene: Scene
    packed: Packed
    names: list[tuple[str, str]]
    hand: PointDistance | FrameDistance
    place: int
    begun: Status

    def wrench(self, q: Array, target: Array) -> Array:
        """Force and torque of the spring on the hand, (6,), bodies at q (n, 7), the hand at a target."""
        hand = self.hand
        pose = Pose(q[self.place, :3], q[self.place, 3:])
        stiffness = 2.0 * hand.weight
        if isinstance(hand, PointDistance):
            return np.append(stiffness * (pose.apply(hand.point.coordinates) - target), np.zeros(3))
        frame = hand.frame
        force = stiffness * (pose.apply(frame.origin) - target[:3])
        turn = rotation_matrix(pose.quaternion) @ frame.axes @ rotation_matrix(target[3:]).T
        # Twice the skew part of a rotation is its sine along its axis.
        sine = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        return np.append(force, stiffness * hand.length**2 * sine)
