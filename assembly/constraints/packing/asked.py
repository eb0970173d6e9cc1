"""What a solve is asked for that may change between solves, and what is between two of these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.pose import Pose

__all__ = ["Asked"]

Array = NDArray[np.float64]


class Asked(NamedTuple):
    """Values and targets of a packed scene, in its order.

    Attributes
    ----------
    values : list of float
        Right-hand sides of rows: driven values, limits, offsets, in the user's units.
    points : list of (3,) array
        Of terms with a target its position.
    poses : list of Pose
        Targets of frames.
    """

    values: list[float]
    points: list[Array]
    poses: list[Pose]

    def toward(self, other: Asked, part: float) -> Asked:
        """What is asked for a part of the way to another one: numbers go along lines, frames turn the shorter way."""
        return Asked(
            [here + part * (there - here) for here, there in zip(self.values, other.values, strict=True)],
            [here + part * (there - here) for here, there in zip(self.points, other.points, strict=True)],
            [_between(here, there, part) for here, there in zip(self.poses, other.poses, strict=True)],
        )

    def change(self, other: Asked, scale: float, is_angle: list[bool]) -> float:
        """The largest difference to another one: lengths over a scale, and radians."""
        lengths = [1.0 if angle else scale for angle in is_angle]
        values = [abs(b - a) / unit for a, b, unit in zip(self.values, other.values, lengths, strict=True)]
        points = [float(np.linalg.norm(b - a)) / scale for a, b in zip(self.points, other.points, strict=True)]
        turns = [2.0 * _half_angle(a, b) for a, b in zip(self.poses, other.poses, strict=True)]
        return max([*values, *points, *turns], default=0.0)


def _half_angle(here: Pose, there: Pose) -> float:
    """Half the angle of the shorter turn between two poses."""
    cosine = float(here.quaternion @ there.quaternion)
    sine = float(np.linalg.norm(there.quaternion - cosine * here.quaternion))
    return float(np.arctan2(sine, abs(cosine)))


def _between(here: Pose, there: Pose, part: float) -> Pose:
    """A pose a part of the way: its origin goes along a line, and it turns the shorter way at constant speed."""
    half = _half_angle(here, there)
    end = there.quaternion if here.quaternion @ there.quaternion >= 0.0 else -there.quaternion
    weights = np.sinc(np.array([1.0 - part, part]) * half / np.pi) * [1.0 - part, part]
    quaternion = weights @ np.stack([here.quaternion, end])
    return Pose(here.position + part * (there.position - here.position), quaternion / np.linalg.norm(quaternion))
