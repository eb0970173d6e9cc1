"""Dexterity: how well a mechanism moves its end effector, as an objective."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import read_only
from assembly.constraints.model.constraint import Constraint, Freedom
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.objectives import Objective
from assembly.errors import InputError, items, positive, real_array
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point

__all__ = ["MEASURES", "TASKS", "Axes", "Dexterity", "Measure", "Task", "TipTask"]

Array = NDArray[np.float64]
Measure = Literal["manipulability", "inverse_condition", "isotropy", "smallest_singular_value", "force_transmission"]
Task = Literal["position", "rotation", "pose"]
Axes = str | tuple[str, str]
# In the order of the kernel's numbers (`solve/loop/dexterity.py`).
MEASURES = ("manipulability", "inverse_condition", "isotropy", "smallest_singular_value", "force_transmission")
TASKS = ("position", "rotation", "pose")


class TipTask:
    """An end effector, the inputs that move it, and which of its velocities count: what its Jacobian is of.

    Parameters
    ----------
    tip : Point, Frame or Body
    inputs : sequence of Joint or Freedom
        Joints with one coordinate, or coordinates, `joint.freedom(name)`; rates of angles [rad] and of slides.
    task : "position", "rotation" or "pose", optional
        Its linear velocity, angular velocity, or both (linear first), world axes. Position for a point, pose for a
        frame or a body by default.
    length : float, optional
        In a pose task, angular velocities count as those of points this far off. Half the body's size by default, 1
        for a body without shape.
    axes : str or (str, str), optional
        The world axes along which these velocities count, in the order x, y, z: "xy" of a planar arm's position, "z" of
        its rotation, ("xy", "z") of its pose, linear and then angular ones. All by default.
    ignoring : sequence of Constraint
        Constraints that express the task, a tip held at a place say: their rows do not hold the mechanism.
    holding : sequence of Constraint
        Constraints whose one-sided rows, a limit or a one-sided contact, hold it as two-sided rows do, touching or not.

    Attributes
    ----------
    bits : int
        The velocities that count, a bit each: three of the linear one, then three of the angular one.
    """

    def __init__(
        self,
        tip: Point | Frame | Body,
        inputs: Sequence[Joint | Freedom],
        task: Task | None = None,
        length: float | None = None,
        *,
        axes: Axes | None = None,
        ignoring: Iterable[Constraint] = (),
        holding: Iterable[Constraint] = (),
    ) -> None:
        if isinstance(tip, Body):
            tip = tip.frame()
        if not isinstance(tip, (Point, Frame)):
            raise TypeError(f"tip is {tip!r}; expected a point, a frame or a body")
        chosen = ("position" if isinstance(tip, Point) else "pose") if task is None else task
        if not isinstance(chosen, str) or chosen not in TASKS:
            raise InputError(f"task is {task!r}; expected one of {', '.join(map(repr, TASKS))}")
        if isinstance(inputs, (Joint, Freedom)) or not isinstance(inputs, Sequence) or not inputs:
            raise InputError(f"inputs is {inputs!r}; expected joints or their coordinates, at least one")
        self.tip = tip
        self.inputs = tuple(self._freedom(k, value) for k, value in enumerate(inputs))
        if len({id(freedom.coordinate) for freedom in self.inputs}) < len(self.inputs):
            raise InputError(f"inputs is {list(inputs)!r}; expected each coordinate once")
        self.task: str = chosen
        self.length = 0.5 * tip.body.size or 1.0 if length is None else positive("length", length)
        self.bits = _bits(chosen, axes)
        self.ignoring = _constraints("ignoring", ignoring)
        self.holding = _constraints("holding", holding)
        for item in self.ignoring:
            if any(item is other for other in self.holding):
                raise InputError(f"holding has {item.name!r}, and so has ignoring; expected it in one of them")

    @staticmethod
    def _freedom(k: int, value: object) -> Freedom:
        if isinstance(value, Freedom):
            return value
        if not isinstance(value, Joint):
            raise TypeError(
                f"inputs[{k}] is {value!r}; expected a joint or one of its coordinates, joint.freedom(name)"
            )
        if len(value.freedoms) != 1:
            known = ", ".join(map(repr, value.freedoms)) or "none"
            raise InputError(f"inputs[{k}] is {value.name!r}; expected a joint with one coordinate; it has {known}")
        return value.freedom()

    @property
    def origin(self) -> Array:
        """The end effector in body coordinates."""
        return self.tip.coordinates if isinstance(self.tip, Point) else self.tip.origin

    @property
    def rows(self) -> int:
        """Rows of the Jacobian."""
        return self.bits.bit_count()

    @property
    def axes(self) -> str | tuple[str, str]:
        """The world axes along which velocities count; of a pose linear and angular ones."""
        linear, angular = ("".join(a for k, a in enumerate("xyz") if self.bits >> (k + s) & 1) for s in (0, 3))
        return {"position": linear, "rotation": angular}.get(self.task, (linear, angular))

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies of the end effector and of the inputs."""
        bodies = [self.tip.body, *(body for freedom in self.inputs for body in freedom.joint.bodies)]
        return tuple(dict.fromkeys(bodies))


def _bits(task: str, axes: object) -> int:
    """The velocities that count."""
    expected = "letters of 'xyz' in this order"
    if task == "pose":
        expected = "two words, linear and angular axes, of letters of 'xyz' in this order"
    words = axes if task == "pose" else (axes,)
    if axes is None:
        words = ("xyz",) * (2 if task == "pose" else 1)
    if not isinstance(words, (tuple, list)) or len(words) != (2 if task == "pose" else 1):
        raise InputError(f"axes is {axes!r} of task {task!r}; expected {expected}")
    bits = 0
    for word, first in zip(words, (0, 3) if task == "pose" else (3 * (task == "rotation"),), strict=True):
        if not isinstance(word, str) or "".join(a for a in "xyz" if a in word) != word:
            raise InputError(f"axes is {axes!r} of task {task!r}; expected {expected}")
        bits += sum(1 << (first + "xyz".index(letter)) for letter in word)
    if not bits:
        raise InputError(f"axes is {axes!r}; expected one axis at least")
    return bits


def _constraints(name: str, value: object) -> tuple[Constraint, ...]:
    """Distinct constraints."""
    if isinstance(value, (Constraint, str)):
        raise InputError(f"{name} is {value!r}; expected constraints, a list of them")
    found = items(name, value, "a list of constraints")
    for item in found:
        if not isinstance(item, Constraint):
            raise TypeError(f"{name} has {item!r}; expected a constraint")
    return tuple(dict.fromkeys(found))


class Dexterity(Objective):
    """A measure of the Jacobian of an end effector, to be maximized: what unit rates of the inputs do to it.

    The Jacobian is taken through closed loops and contacts by the rows of the scene's bilateral constraints; driven
    values do not count as such, limits and one-sided contacts only where they are `holding`. The gradient is exact.

    Parameters
    ----------
    tip, inputs, task, length, axes, ignoring, holding
        As of `TipTask`; constraints are in the scene.
    measure : str
        With singular values s_i of the Jacobian J in the user's units:
        "manipulability": the product of s_i, which is sqrt(det J J^T), or sqrt(det J^T J) where there are fewer inputs
        than rows (paper 001, eq. 1);
        "inverse_condition": s_min / s_max;
        "isotropy": (product of s_i^2)^(1/r) / (mean of s_i^2);
        "smallest_singular_value": s_min;
        "force_transmission": 1 / |J^T u|, the force along the unit vector u that inputs of unit norm hold.
    direction : (rows of the task,), optional
        u, along the axes of the task, for "force_transmission" and nothing else.
    weight : float
        Positive.

    Raises
    ------
    InputError, TypeError
        Unknown words, no inputs, a joint with several coordinates, a direction where none belongs or none where one
        does.

    Notes
    -----
    Where the inputs do not determine its motion, or depend on each other, the objective is infinite and a solve that
    starts there ends STALLED.
    """

    def __init__(
        self,
        tip: Point | Frame | Body,
        inputs: Sequence[Joint | Freedom],
        measure: Measure = "manipulability",
        *,
        task: Task | None = None,
        length: float | None = None,
        axes: Axes | None = None,
        ignoring: Iterable[Constraint] = (),
        holding: Iterable[Constraint] = (),
        direction: ArrayLike | None = None,
        weight: float = 1.0,
    ) -> None:
        self._tip_task = TipTask(tip, inputs, task, length, axes=axes, ignoring=ignoring, holding=holding)
        if not isinstance(measure, str) or measure not in MEASURES:
            raise InputError(f"measure is {measure!r}; expected one of {', '.join(map(repr, MEASURES))}")
        if (measure == "force_transmission") != (direction is not None):
            raise InputError(
                f"direction is {direction!r} with measure {measure!r}; expected one for 'force_transmission' alone"
            )
        super().__init__(self._tip_task.bodies, weight)
        self._measure = measure
        self._direction: Array | None = None
        if direction is not None:
            u = real_array("direction", direction, (self._tip_task.rows,))
            norm = float(np.linalg.norm(u))
            if not norm > 0.0:
                raise InputError(f"direction is {u.tolist()}; expected a direction other than zero")
            # A unit vector is left as it is, so that reading a written one changes no bit.
            self._direction = u if abs(norm - 1.0) <= 1e-15 else u / norm

    @property
    def tip_task(self) -> TipTask:
        """End effector, inputs and task."""
        return self._tip_task

    @property
    def measure(self) -> str:
        """The measure's name."""
        return self._measure

    @property
    def direction(self) -> Array | None:
        """Unit direction of the force, read-only; None for other measures."""
        return None if self._direction is None else read_only(self._direction)

    def __repr__(self) -> str:
        inputs = ", ".join(f"{freedom.joint.name!r}.{freedom.name}" for freedom in self._tip_task.inputs)
        return f"Dexterity({self._tip_task.tip!r}, [{inputs}], {self._measure!r}, weight={self.weight:g})"
