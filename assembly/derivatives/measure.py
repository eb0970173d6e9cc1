"""Measure: a number of a solution, whose derivatives are asked for."""

from __future__ import annotations

from math import dist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint, Freedom
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.joint import Joint
from assembly.derivatives.touching_place import COMPONENTS, place_value
from assembly.errors import InputError, text
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.solve.solution import Solution

__all__ = ["Measure"]

Array = NDArray[np.float64]
AXES = ("x", "y", "z")
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")


class Measure:
    """A number of a solution.

    | thing | component |
    |---|---|
    | a point, a frame, a body | "x", "y" or "z" of it, or of its origin, in the world |
    | a joint or a coordinate | the name of the coordinate; none where there is one |
    | two points (or frames, bodies) | none: their distance |
    | a contact of the scene | none: its gap |
    | a place of a contact (`ContactPlace`) | "u", "v" of the contact on its face, or "x", "y", "z" of its point there |
    | a constraint, `on=body` | "fx" to "tz" of what it exerts on the body, about the body's origin, in world axes |
    | "objective" | none |

    Parameters
    ----------
    thing, component
        As in the table.
    on : Body, optional
        Of a wrench: the body that it acts on.
    name : str, optional
        Its name in tables.

    Raises
    ------
    InputError, TypeError
        A thing that has no such component.
    """

    def __init__(self, thing: Any, component: str | None = None, *, on: Body | None = None, name: str | None = None):
        self.kind, self.thing, self.axis, self.unit = "", thing, 0, "length"
        label = ""
        if on is not None:
            if not isinstance(thing, Constraint) or component not in WRENCH:
                raise InputError(f"component is {component!r} with on={on!r}; expected a constraint and 'fx' to 'tz'")
            if not isinstance(on, Body):
                raise TypeError(f"on is {on!r}; expected a Body")
            # A clearance names no bodies: it is of all of them.
            if thing.bodies and not any(on is body for body in thing.bodies):
                raise InputError(f"on is {on!r}; expected one of {', '.join(repr(body) for body in thing.bodies)}")
            self.kind, self.axis, label = "wrench", WRENCH.index(component), f"{thing.name} on {on.name}.{component}"
            self.unit = "force" if self.axis < 3 else "torque"
        elif isinstance(thing, (Point, Frame, Body)):
            if component not in AXES:
                raise InputError(f"component is {component!r}; expected 'x', 'y' or 'z'")
            self.kind, self.axis = "place", AXES.index(component)
            label = f"{thing.name if isinstance(thing, Body) else thing.body.name}.{component}"
        elif isinstance(thing, (Joint, Freedom)):
            freedom = thing.freedom(component) if isinstance(thing, Joint) else thing
            self.kind, self.thing, label = "coordinate", freedom, f"{freedom.joint.name}.{freedom.name}"
            self.unit = "rad" if freedom.coordinate.is_angle else "length"
        elif isinstance(thing, ContactPlace):
            if component not in COMPONENTS:
                raise InputError(f"component is {component!r}; expected one of {', '.join(map(repr, COMPONENTS))}")
            self.kind, self.axis, label = "touching", COMPONENTS.index(component), f"{thing.contact.name}.{component}"
            self.unit = "parameter" if self.axis < 2 else "length"
        elif isinstance(thing, Contact):
            _none_expected(thing, component)
            self.kind, label = "gap", f"{thing.name}.gap"
        elif isinstance(thing, str) and thing == "objective":
            _none_expected(thing, component)
            self.kind, self.unit, label = "objective", "objective", "objective"
        elif isinstance(thing, tuple) and len(thing) == 2 and all(isinstance(p, (Point, Frame, Body)) for p in thing):
            _none_expected(thing, component)
            self.kind, label = "distance", "-".join(place_of(side)[0].name for side in thing)
        else:
            raise TypeError(
                f"thing is {thing!r}; expected a point, a frame, a body, a joint, a contact, a place of one, a "
                "pair of points, a constraint with on=body, or 'objective'"
            )
        self.on = on
        self.name = label if name is None else text("name", name)

    def value(self, solution: Solution) -> float:
        """The value at a solution, in the user's units; angles continue past whole turns."""
        if not isinstance(solution, Solution):
            raise TypeError(f"solution is {solution!r}; expected a Solution")
        if self.kind == "objective":
            return solution.objective
        if self.kind == "coordinate":
            return solution._value(self.thing.joint, self.thing.name)
        if self.kind == "gap":
            return solution.contacts[self.thing.name].gap
        if self.kind == "wrench":
            assert self.on is not None
            wrenches = solution.wrenches[self.thing.name]
            if self.on.name not in wrenches:
                known = ", ".join(map(repr, wrenches))
                raise InputError(f"measure is of what is exerted on {self.on!r}; expected one of {known}")
            return float(wrenches[self.on.name].vector[self.axis])
        if self.kind == "touching":
            return place_value(self.axis, self.thing, solution)
        sides = self.thing if self.kind == "distance" else (self.thing,)
        rows = [solution.q[solution._scene.index(place_of(side)[0])] for side in sides]
        places = [_place(side, row) for side, row in zip(sides, rows, strict=True)]
        return dist(*places) if len(places) == 2 else places[0][self.axis]

    def __repr__(self) -> str:
        return f"Measure({self.name!r})"


def _none_expected(thing: Any, component: str | None) -> None:
    """Raise where a component is asked of what is one number."""
    if component is not None:
        raise InputError(f"component is {component!r} of {thing!r}; expected none: it is one number")


def place_of(thing: Point | Frame | Body) -> tuple[Body, Array]:
    """The body of a place, and where it is on the body."""
    if isinstance(thing, Body):
        return thing, np.zeros(3)
    return thing.body, thing.coordinates if isinstance(thing, Point) else thing.origin


def _place(thing: Point | Frame | Body, row: Array) -> tuple[float, float, float]:
    """Where a place is, with its body at the pose row (7,).

    In plain floats: arrays this small take five times the time.
    """
    p1, p2, p3, w, x, y, z = row.tolist()
    if isinstance(thing, Body):
        return p1, p2, p3
    v1, v2, v3 = place_of(thing)[1].tolist()
    # v + w t + u x t, where t = 2 u x v / |e|^2.
    part = 2.0 / (w * w + x * x + y * y + z * z)
    t1, t2, t3 = part * (y * v3 - z * v2), part * (z * v1 - x * v3), part * (x * v2 - y * v1)
    return (
        p1 + (v1 + w * t1 + (y * t3 - z * t2)),
        p2 + (v2 + w * t2 + (z * t1 - x * t3)),
        p3 + (v3 + w * t3 + (x * t2 - y * t1)),
    )


def world(thing: Point | Frame | Body, position: Array, rotation: Array) -> tuple[Array, Array]:
    """Where a place is, with its body at a position (3,) and turned by (3, 3); its slopes in the twist, (3, 6)."""
    _, place = place_of(thing)
    x, y, z = arm = rotation @ place
    turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return position + arm, np.hstack([np.eye(3), turn])
