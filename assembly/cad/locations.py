"""Locations of OCCT, which both libraries wrap, as poses and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.kinematics.pose import Pose
from assembly.step.occt import occt

__all__ = ["frame_on", "location_of", "pose_of", "transformation"]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
# What OCCT's own products of placements leave of a scale of one.
SCALE_ROUNDING = 1e-9


def pose_of(location: Any, name: str) -> Pose:
    """The pose that a TopLoc_Location stands for.

    Parameters
    ----------
    location : TopLoc_Location
    name
        What the message calls it.

    Raises
    ------
    InputError
        It mirrors or scales, which no rigid body does.
    """
    move = location.Transformation()
    if abs(move.ScaleFactor() - 1.0) > SCALE_ROUNDING:
        raise InputError(f"the location of {name} mirrors or scales by {move.ScaleFactor():g}; expected a rigid one")
    turn, shift = move.GetRotation(), move.TranslationPart()
    return Pose((shift.X(), shift.Y(), shift.Z()), (turn.W(), turn.X(), turn.Y(), turn.Z()))  # type: ignore[arg-type]  # Pose converts them


def transformation(pose: Pose) -> Any:
    """A pose as a gp_Trsf."""
    o = occt()
    w, x, y, z = pose.quaternion.tolist()
    move = o.gp_Trsf()
    move.SetRotation(o.gp_Quaternion(x, y, z, w))
    move.SetTranslationPart(o.gp_Vec(*pose.position.tolist()))
    return move


def location_of(pose: Pose) -> Any:
    """A pose as a TopLoc_Location."""
    return occt().TopLoc_Location(transformation(pose))


def frame_on(body: Body, origin: Sequence[float], z: Vector) -> Frame:
    """The same frame as `body.frame(origin, z)` of a unit vector z, in a fraction of the time.

    Assemblies have hundreds of them.
    """
    sizes = [abs(value) for value in z]
    k = sizes.index(min(sizes))
    a, b, c = -z[k] * z[0], -z[k] * z[1], -z[k] * z[2]
    a, b, c = a + (k == 0), b + (k == 1), c + (k == 2)
    norm = (a * a + b * b + c * c) ** 0.5
    a, b, c = a / norm, b / norm, c / norm
    axes = np.array(
        [
            [a, z[1] * c - z[2] * b, z[0]],
            [b, z[2] * a - z[0] * c, z[1]],
            [c, z[0] * b - z[1] * a, z[2]],
        ]
    )
    axes.flags.writeable = False
    place = np.array(origin, dtype=np.float64)
    place.flags.writeable = False
    return Frame(body, place, axes)
