"""Numbers of a solve that may change between solves, and interpolation between two sets of them.

In the order of the packed scene: values of rows (driven values, limits, offsets), in the user's units; positions of
targets; targets of frames, as poses.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.pose import Pose

__all__ = ["Asked", "asked_between", "asked_change"]

Array = NDArray[np.float64]
# Numbers, arrays (3,) and poses.
Asked = list[Any]


def asked_between(here: Asked, there: Asked, part: float) -> Asked:
    """What is asked for a part of the way: numbers and points go along lines, frames turn the shorter way."""
    return [
        _pose_between(a, b, part) if isinstance(a, Pose) else a + part * (b - a)
        for a, b in zip(here, there, strict=True)
    ]


def asked_change(here: Asked, there: Asked, units: list[float]) -> float:
    """The largest difference, each in its unit."""
    changes = [
        2.0 * _half_angle(a, b) if isinstance(a, Pose) else float(np.linalg.norm(b - a))
        for a, b in zip(here, there, strict=True)
    ]
    return max((change / unit for change, unit in zip(changes, units, strict=True)), default=0.0)


def _half_angle(here: Pose, there: Pose) -> float:
    """Half the angle of the shorter turn between two poses."""
    cosine = float(here.quaternion @ there.quaternion)
    sine = float(np.linalg.norm(there.quaternion - cosine * here.quaternion))
    return float(np.arctan2(sine, abs(cosine)))


def _pose_between(here: Pose, there: Pose, part: float) -> Pose:
    """One pose per part of the way: its origin goes along a line, and it turns the shorter way at constant speed."""
    half = _half_angle(here, there)
    end = there.quaternion if here.quaternion @ there.quaternion >= 0.0 else -there.quaternion
    parts = np.array([1.0 - part, part])
    # The common factor half / sin(half) goes with the length.
    quaternion = (parts * np.sinc(parts * half / np.pi)) @ np.stack([here.quaternion, end])
    return Pose(here.position + part * (there.position - here.position), quaternion / np.linalg.norm(quaternion))
