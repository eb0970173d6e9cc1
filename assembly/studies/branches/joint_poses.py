"""Poses at values of joints: forward kinematics to a start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._named import Named
from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Screw
from assembly.errors import InputError, number
from assembly.studies.branches.joint_tree import JointTree

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["poses_at"]

Array = NDArray[np.float64]
# What rows of closed loops are off by, over the size and in radians: rounding of the bodies on the way around.
CLOSED = 1e-10


def poses_at(scene: Assembly, values: Mapping[str, float]) -> Array:
    """See `Assembly.at`."""
    if not isinstance(values, Mapping):
        raise TypeError(f"values is {values!r}; expected a mapping of 'joint.freedom' to numbers")
    scene.packed()
    assert scene._scene is not None
    known = Named(
        (f"{joint.name}.{name}", joint.freedom(name))
        for joint in scene._scene.constraints
        if isinstance(joint, Joint)
        for name in joint.freedoms
    )
    given = {known[name]: _checked(name, known[name], value) for name, value in values.items()}
    tree = JointTree(scene, given)
    _check_holds(tree, known, given)
    motions, q = tree.standing(scene.q), scene.q
    if tree.loops_close:
        closed, off = tree.closed(motions.copy(), q)
        if off[0] <= CLOSED:
            return np.array(closed[0])
    return np.array(tree.closed(motions, q, closes=False)[0][0])


def _checked(name: str, freedom: Freedom, value: float) -> float:
    """A value within the limits of its coordinate, whatever it is driven to."""
    told = number(f"values[{name!r}]", value)
    if not freedom.lower <= told <= freedom.upper:
        raise InputError(
            f"values[{name!r}] is {told!r}; expected a value within the limits ({freedom.lower:g}, {freedom.upper:g})"
        )
    return told


def _check_holds(tree: JointTree, known: Mapping[str, Freedom], given: Mapping[Freedom, float]) -> None:
    """Raise for coordinates that are not to be set, or twice."""
    for name, freedom in known.items():
        if freedom not in given:
            continue
        if not tree.holds(freedom):
            others = [each for each, other in known.items() if tree.holds(other)]
            raise InputError(f"values has {name!r}, which places no body; expected names of {others}")
        joint = freedom.joint
        if isinstance(joint, Screw) and all(joint.freedom(each) in given for each in ("angle", "slide")):
            raise InputError(
                f"values has the angle and the slide of {joint.name!r}; expected one: a screw has the other"
            )
