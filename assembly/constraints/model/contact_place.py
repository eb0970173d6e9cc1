"""ContactPlace: a place of a face that a contact is drawn to, or kept at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import read_only
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.objectives import Objective
from assembly.constraints.model.trim_contact import single_face
from assembly.errors import InputError, number, positive
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.changes import count_number

__all__ = ["ContactPlace", "Target"]

Array = NDArray[np.float64]
Target = tuple[float | None, float | None]
# A stretch over a whole domain that is shorter than this part of the surface's size is none, and so is an angle
# between the two directions below it: there is a pole.
DEGENERATE = 1e-9
# Samples of a line from which its mean stretch is taken.
SAMPLES = 17


class ContactPlace(Constraint, Objective):
    """A contact is drawn to a place on one of its faces as an objective, or is kept there as a constraint.

    With d the difference between the contact's (u, v) on the face and the target's, in closed directions the shorter
    way, and E = [Su Sv] at the target, the distance is |E d|, a length. The distance to a line of one coordinate is the
    difference in that coordinate times the mean stretch of the surface across the line. As an objective the term is
    weight |E d|^2; as a constraint it has two rows, or one for a line. First and second derivatives are exact.

    The contact is then one of the two surfaces, without their boundaries.

    Parameters
    ----------
    contact : Contact
        Of two single faces, in the same scene.
    side : "a" or "b"
        Which of the contact's faces the place is on.
    target : (float or None, float or None)
        (u, v) in the face's domain, on closed directions anywhere. None leaves a coordinate open: (u, None) is the
        isoparametric line of that u. Settable; a coordinate that is open stays so.
    weight : float
        As an objective: factor, positive. Settable.
    name : str, optional
        "place" and the contact's name by default.

    Raises
    ------
    InputError, TypeError
        No contact, a side with several faces, a target off the domain, with no coordinate, or at a pole, where (u, v)
        have no lengths.

    Notes
    -----
    In a closed direction the objective has a kink (a ridge) half a period from the target; beyond a pole the
    coordinates, and with them the distance, jump by half a turn.
    """

    def __init__(
        self,
        contact: Contact,
        side: Literal["a", "b"],
        target: Sequence[float | None],
        weight: float = 1.0,
        *,
        name: str | None = None,
    ) -> None:
        if not isinstance(contact, Contact):
            raise TypeError(f"contact is {contact!r}; expected a Contact")
        if not isinstance(side, str) or side not in ("a", "b"):
            raise InputError(f"side is {side!r}; expected 'a' or 'b'")
        faces = single_face("a", contact.a), single_face("b", contact.b)
        self._contact = contact
        self._side = "ab".index(side)
        self._measured: tuple[object, Array] | None = None
        Constraint.__init__(self, contact.bodies, f"place {contact.name}" if name is None else name)
        self._weight = positive("weight", weight)
        self._target = self._checked(faces[self._side].surface, target)

    @property
    def contact(self) -> Contact:
        """The contact that comes to the place."""
        return self._contact

    @property
    def side(self) -> int:
        """0 where the place is on the face of side a, 1 where on that of side b."""
        return self._side

    @property
    def face(self) -> Face:
        """The contact's face that the place is on."""
        return single_face("ab"[self._side], self._contact.a if self._side == 0 else self._contact.b)

    @property
    def target(self) -> Target:
        """(u, v) of the place, None where it is a line; settable, in lines the coordinate that they have."""
        return self._target

    @target.setter
    def target(self, value: Sequence[float | None]) -> None:
        target = self._checked(self.face.surface, value)
        if [part is None for part in target] != [part is None for part in self._target]:
            raise InputError(f"target is {value!r}, and was {self._target}; expected the same coordinates to be None")
        self._target = target
        count_number(self)

    @property
    def weight(self) -> float:
        """Factor of the term, positive; settable."""
        return self._weight

    @weight.setter
    def weight(self, value: float) -> None:
        self._weight = positive("weight", value)
        count_number(self)

    @property
    def rows(self) -> int:
        """Lengths that are zero at the place: 2, of a line 1."""
        return 1 if None in self._target else 2

    @property
    def stretch(self) -> Array:
        """E in axes of the tangent plane, (2, 2), upper triangular; of a line one row, (1, 2). Read-only."""
        surface = self.face.surface
        key = surface, self._target
        # Numbers of shapes may be set anew, and the target.
        if self._measured is None or self._measured[0] != key:
            self._measured = key, _stretch(surface, self._target)
        return read_only(self._measured[1])

    def distance(self, u: float, v: float) -> float:
        """The distance of a place (u, v) of the face from the target, a length."""
        periods = self.face.surface._periods
        off = np.zeros(2)
        for k, (value, goal, period) in enumerate(zip((u, v), self._target, periods, strict=True)):
            if goal is not None:
                d = number("uv"[k], value) - goal
                off[k] = d - period * np.floor(d / period + 0.5) if period > 0.0 else d
        return float(np.linalg.norm(self.stretch @ off))

    @property
    def _is_asked(self) -> bool:
        """Whether a solve asks for it, and for its contact."""
        return super()._is_asked and self._contact._is_asked

    @staticmethod
    def _checked(surface: NurbsSurface, target: Sequence[float | None]) -> Target:
        """The target as it is kept; raises where the surface has no such place."""
        if isinstance(target, (str, bytes)) or not hasattr(target, "__len__") or len(target) != 2:
            raise InputError(f"target is {target!r}; expected (u, v), one of which may be None")
        parts = [None if part is None else number(f"target[{k}]", part) for k, part in enumerate(target)]
        if parts == [None, None]:
            raise InputError("target is (None, None); expected a coordinate at least")
        for k, (part, (low, high), closed) in enumerate(zip(parts, surface.domain, surface.closed, strict=True)):
            if part is not None and not closed and not low <= part <= high:
                raise InputError(f"target[{k}] is {part:g}; expected from {low:g} to {high:g}, the face's domain")
        checked = parts[0], parts[1]
        _stretch(surface, checked)
        return checked

    def __repr__(self) -> str:
        target = ", ".join("None" if part is None else f"{part:g}" for part in self._target)
        return (
            f"ContactPlace({self._contact.name!r}, {'ab'[self._side]!r}, target=({target}), "
            f"weight={self._weight:g}, name={self.name!r})"
        )


def _stretch(surface: NurbsSurface, target: Target) -> Array:
    """Lengths for differences of coordinates from a target; see `ContactPlace.stretch`. Raises at a pole."""
    spans = [high - low for low, high in surface.domain]
    least = DEGENERATE * surface.size
    u, v = (
        low + (part - low) % (high - low) if part is not None and closed else part
        for part, (low, high), closed in zip(target, surface.domain, surface.closed, strict=True)
    )
    if u is not None and v is not None:
        _, su, sv = (np.asarray(part, dtype=np.float64).reshape(3) for part in surface.evaluate(u, v, 1))
        a, b = float(np.linalg.norm(su)), float(np.linalg.norm(sv))
        area = float(np.linalg.norm(np.cross(su, sv)))
        if not (a * spans[0] > least and b * spans[1] > least and area > DEGENERATE * a * b):
            raise InputError(
                f"target is ({u:g}, {v:g}), a pole of the face; expected a place where u and v have lengths"
            )
        return np.array([[a, su @ sv / a], [0.0, area / a]])
    k = 0 if u is not None else 1
    low, high = surface.domain[1 - k]
    along = np.linspace(low, high, SAMPLES)[1:-1]
    fixed = np.full(along.size, u if k == 0 else v)
    at = (fixed, along) if k == 0 else (along, fixed)
    _, su, sv = surface.evaluate(at[0], at[1], 1)
    line = sv if k == 0 else su
    lengths = np.linalg.norm(line, axis=1)
    if not (lengths * spans[1 - k] > least).all():
        raise InputError(f"target is {'uv'[k]} = {fixed[0]:g}, a pole of the face; expected a line")
    across = float((np.linalg.norm(np.cross(su, sv), axis=1) / lengths).mean())
    if not across * spans[k] > least:
        raise InputError(f"target is {'uv'[k]} = {fixed[0]:g}, across which the face has no length; expected another")
    return np.array([[across, 0.0] if k == 0 else [0.0, across]])
