"""What an assembly is made of: bodies, constraints and terms of the objective, with names that are distinct."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from operator import is_
from typing import Self, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from assembly._html import Table, as_html
from assembly._read_only import read_only
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.dexterity import Dexterity
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.objectives import Objective
from assembly.constraints.model.trim_contact import TrimContact
from assembly.errors import InputError, items
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose

__all__ = ["Contents"]

Array = NDArray[np.float64]
Item = TypeVar("Item", bound=Constraint | Objective)


class Contents:
    """Bodies, constraints between them and terms of an objective.

    Parameters
    ----------
    bodies : iterable of Body
        Names must be distinct.
    """

    def __init__(self, bodies: Iterable[Body] = ()) -> None:
        self._bodies: list[Body] = []
        self._named: dict[str, Body] = {}
        self._constraints: list[Constraint] = []
        self._taken: set[str] = set()  # names of constraints
        self._objectives: list[tuple[float, Objective]] = []
        self._stood: tuple[list[Pose], Array] = [], np.empty((0, 7))
        # Another object after whatever was added or removed: trackers compare it at every tick.
        self._edition = object()
        for body in items("bodies", bodies, "bodies, at least one"):
            self.add(body)

    def __copy__(self) -> Self:
        """The same bodies, constraints and terms, in lists of its own."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        for name in ("_bodies", "_named", "_constraints", "_taken", "_objectives"):
            setattr(other, name, self.__dict__[name].copy())
        other._has_changed()
        return other

    def _has_changed(self) -> None:
        """What was made of the contents before holds no more."""

    def _was_edited(self) -> None:
        """Something was added or removed."""
        self._edition = object()
        self._has_changed()

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Bodies in the order of q's rows."""
        return tuple(self._bodies)

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """Constraints in the order they were given."""
        return tuple(self._constraints)

    @property
    def objectives(self) -> tuple[tuple[float, Objective], ...]:
        """Terms with their signs: 1 minimized, -1 maximized."""
        return tuple(self._objectives)

    def _repr_html_(self) -> str:
        rows = [(body.name, len(body.faces), "fixed" if body.fixed else "") for body in self._bodies]
        held = [
            (item.name, type(item).__name__, ", ".join(body.name for body in item.bodies)) for item in self._constraints
        ]
        terms = [("minimize" if sign > 0.0 else "maximize", repr(term)) for sign, term in self._objectives]
        return as_html(
            repr(self),
            Table(("body", "faces", ""), list(rows)),
            Table(("constraint", "kind", "bodies"), list(held)),
            Table(("objective", ""), list(terms)),
        )

    def body(self, name: str) -> Body:
        """The body of that name."""
        if isinstance(name, str) and name in self._named:
            return self._named[name]
        known = ", ".join(repr(body.name) for body in self._bodies)
        raise InputError(f"name is {name!r}; expected " + (f"one of {known}" if known else "a body, but there is none"))

    def __getitem__(self, name: str) -> Body:
        """The body of that name, as `body` gives it."""
        if isinstance(name, str) and name not in self._named and name in self._taken:
            raise InputError(f"name is {name!r}, that of a constraint; expected a body, or scene.constraint({name!r})")
        return self.body(name)

    def __contains__(self, body: object) -> bool:
        """Whether a body, given itself or its name, is in the assembly."""
        if isinstance(body, str):
            return body in self._named
        return isinstance(body, Body) and self._named.get(body.name) is body

    # Without it Python would go through the bodies by numbers, which `[]` does not take.
    __iter__ = None

    def constraint(self, name: str) -> Constraint:
        """The constraint of that name.

        Raises
        ------
        InputError
            There is none; the message lists those that there are.
        """
        for item in self._constraints:
            if item.name == name:
                return item
        known = ", ".join(repr(item.name) for item in self._constraints)
        raise InputError(
            f"name is {name!r}; expected " + (f"one of {known}" if known else "a constraint, but there is none")
        )

    def add(self, body: Body) -> Body:
        """Add a body and return it."""
        if not isinstance(body, Body):
            raise TypeError(f"body is {body!r}; expected a Body")
        other = self._named.get(body.name)
        if other is body:
            raise InputError(f"body {body.name!r} is in the assembly already; expected each body once")
        if other is not None:
            raise InputError(f"body has the name {body.name!r} of another body; expected distinct names")
        self._bodies.append(body)
        self._named[body.name] = body
        self._was_edited()
        return body

    def constrain(self, *constraints: Constraint) -> None:
        """Add constraints; their names must be distinct and their bodies in the assembly."""
        for constraint in constraints:
            if isinstance(constraint, (list, tuple)):
                raise TypeError("constraint is a sequence; expected separate arguments: constrain(*constraints)")
            if not isinstance(constraint, Constraint):
                raise TypeError(
                    f"constraint is {constraint!r}; expected a Contact or a trim of one, a Clearance, a joint, "
                    "a coupling or an Expression"
                )
            self._check_bodies(constraint.name, constraint.bodies)
            if all(constraint is not other for other in self._constraints):
                constraint._named_beside(self._taken)
            if constraint.name in self._taken:
                raise InputError(f"constraint name {constraint.name!r} is taken; expected distinct names, say name=...")
            if isinstance(constraint, (TrimContact, ContactPlace)) and constraint.contact not in self._constraints:
                raise InputError(
                    f"constraint {constraint.name!r} keeps contact {constraint.contact.name!r}, which is not in the "
                    "assembly; expected its contact to be constrained before it"
                )
            if constraint.bodies and all(body.fixed for body in constraint.bodies):
                raise InputError(f"constraint {constraint.name!r} is between two fixed bodies; expected one that moves")
            self._take_constraints([constraint])

    def _take_constraints(self, constraints: Iterable[Constraint]) -> None:
        """Add constraints of another scene of these bodies, some of which may be fixed by now."""
        for constraint in constraints:
            self._constraints.append(constraint)
            self._taken.add(constraint.name)
        self._was_edited()

    @overload
    def remove(self, constraint: str) -> Constraint: ...
    @overload
    def remove(self, constraint: Item) -> Item: ...
    def remove(self, constraint: Constraint | Objective | str) -> Constraint | Objective:
        """Take a constraint, the one of that name, or a term of the objective out of the assembly, and return it.

        What is both is taken out of the constraints, and out of the objective by another call.

        Raises
        ------
        InputError
            It is not in the assembly, or a `TrimContact` or a `ContactPlace` there is of it.
        """
        for item in self._constraints:
            if item is constraint or (isinstance(constraint, str) and item.name == constraint):
                break
        else:
            kept = [(sign, term) for sign, term in self._objectives if term is not constraint]
            if isinstance(constraint, Objective) and len(kept) < len(self._objectives):
                self._objectives[:] = kept
                self._was_edited()
                return constraint
            known = ", ".join(repr(item.name) for item in self._constraints) or "none"
            raise InputError(f"constraint is {constraint!r}; expected one of the assembly: {known}, or a term")
        for other in (*self._constraints, *(term for _, term in self._objectives)):
            if isinstance(other, (TrimContact, ContactPlace)) and other.contact is item:
                raise InputError(
                    f"constraint is {item.name!r}, whose contact {other.name!r} constrains to a place; "
                    f"expected {other.name!r} to be removed first"
                )
        self._constraints.remove(item)
        self._taken.discard(item.name)
        self._was_edited()
        return item

    def minimize(self, *objectives: Objective) -> None:
        """Add terms to the objective."""
        self._add_terms(1.0, objectives)

    def maximize(self, *objectives: Objective) -> None:
        """Subtract terms from the objective."""
        self._add_terms(-1.0, objectives)

    def _add_terms(self, sign: float, objectives: Iterable[Objective]) -> None:
        for objective in objectives:
            if not isinstance(objective, Objective):
                raise TypeError(f"objective is {objective!r}; expected an objective such as PointDistance or Posture")
            if isinstance(objective, Expression) and objective.count != 1:
                raise InputError(f"objective {objective.name!r} has {objective.count} values; expected one")
            self._check_bodies(repr(objective), objective.bodies)
            for what, named in _named_by(objective):
                for item in named:
                    if not any(item is other for other in self._constraints):
                        raise InputError(
                            f"{what} of objective {objective!r} names {item.name!r}, which is not in the assembly; "
                            "expected it to be constrained before"
                        )
            self._objectives.append((sign, objective))
            self._was_edited()

    def _check_bodies(self, what: str, bodies: Iterable[Body]) -> None:
        for body in bodies:
            if self._named.get(body.name) is not body:
                known = ", ".join(repr(other.name) for other in self._bodies) or "no bodies yet"
                raise InputError(f"{what} is on body {body.name!r}; expected a body of this assembly: {known}")

    @property
    def q(self) -> Array:
        """Where the bodies stand, (n, 7), read-only; set the pose of a body instead."""
        poses = [body.pose for body in self._bodies]
        before, q = self._stood
        # Poses do not change, bodies get others: those of the last call are compared in a fraction of the time.
        if len(before) != len(poses) or not all(map(is_, before, poses)):
            q = np.array([pose.row for pose in poses]).reshape(-1, 7)
            self._stood = poses, q
        return read_only(q)


def _named_by(objective: Objective) -> list[tuple[str, Sequence[Constraint]]]:
    """The constraints that a term of an objective names, and as what."""
    if isinstance(objective, ContactPlace):
        return [("contact", (objective.contact,))]
    if isinstance(objective, Dexterity):
        task = objective.tip_task
        return [("ignoring", task.ignoring), ("holding", task.holding)]
    return []
