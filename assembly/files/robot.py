"""A robot: links as bodies, the joints between them, and the links' masses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.couplings import Coupling
from assembly.constraints.model.joint import Joint
from assembly.errors import InputError
from assembly.kinematics.body import Body

__all__ = ["Inertial", "Robot", "UrdfError", "UrdfWarning", "yourdfpy"]

Array = NDArray[np.float64]


class UrdfError(InputError):
    """A robot that cannot be read or written; the text says which link or joint, and why."""


class UrdfWarning(UserWarning):
    """Something of a robot was left out; the text says what."""


@dataclass(frozen=True, eq=False)
class Inertial(ReadOnlyArrays):
    """What a link weighs, as its file says.

    Attributes
    ----------
    mass : float
        In kilograms.
    center_of_mass : (3,)
        In the axes of the link, in the unit that the robot was read with.
    inertia : (3, 3)
        About the center of mass, along the axes of the link, in kilograms and squares of that unit.
    """

    mass: float
    center_of_mass: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class Robot:
    """Links and joints of a robot.

    Attributes
    ----------
    name : str
    bodies : tuple of Body
        One a link, in the order of the file, where they are when all joints are at zero; the first link of the tree
        is fixed.
    joints : tuple of Joint
        In the order of the file, `frame_a` on the parent and `frame_b` on the child; driven values are free.
    couplings : tuple of Coupling
        Joints that mimic others.
    inertials : mapping of str -> Inertial
        By the names of links.
    """

    name: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    couplings: tuple[Coupling, ...]
    inertials: Mapping[str, Inertial]

    def body(self, name: str) -> Body:
        """The body of a link.

        Raises
        ------
        InputError
            No such link; the message lists them.
        """
        found: Body = _named("body", name, self.bodies)
        return found

    def joint(self, name: str) -> Any:
        """A joint by name.

        Raises
        ------
        InputError
            No such joint; the message lists them.
        """
        return _named("joint", name, self.joints)

    def assembly(self) -> Assembly:
        """A scene of all of it."""
        scene = Assembly(self.bodies)
        constraints: tuple[Constraint, ...] = (*self.joints, *self.couplings)
        scene.constrain(*constraints)
        return scene

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, {len(self.bodies)} bodies, {len(self.joints)} joints)"


def _named(what: str, name: str, things: tuple[Any, ...]) -> Any:
    for thing in things:
        if thing.name == name:
            return thing
    known = ", ".join(repr(thing.name) for thing in things) or "none"
    raise InputError(f"name is {name!r}; expected a {what} of the robot: {known}")


def yourdfpy() -> Any:
    """The module that reads and writes the text of URDF files."""
    try:
        return import_module("yourdfpy.urdf")
    except ImportError:
        raise ImportError("robots need yourdfpy, which is not installed; install the extra robots") from None
