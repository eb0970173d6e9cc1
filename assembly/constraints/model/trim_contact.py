"""TrimContact: where on a face a contact may be."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import Contact
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.loop import Loop
from assembly.geometry.splines.curve import NurbsCurve
from assembly.kinematics.body import Body, BodyFace

__all__ = ["FORMS", "Form", "Keep", "TrimContact", "single_face"]

Keep = Literal["on", "inside", "outside"]
Form = Literal["signed", "parametric", "cartesian", "between"]
# In the order of the numbers that kernels know (`constraints/program/trim.py`).
FORMS: tuple[Form, ...] = get_args(Form)


class TrimContact(Constraint):
    """A contact is kept on a loop, or on one side of it.

    The contact is then one of the two whole surfaces, without their boundaries; the trim says where it may be.

    Parameters
    ----------
    contact : Contact
        Of two single faces, in the same scene.
    loop : Loop, NurbsCurve or several curves
        Closed, in the (u, v) of one of the two faces: `face.outer`, one of `face.holes`, or any other.
    keep : "on", "inside" or "outside"
        On the loop, or on the side that it encloses or does not; the loop itself belongs to both sides.
    form : "signed", "parametric", "cartesian" or "between"
        The rows. "signed": the signed distance of the contact from the loop in (u, v), times the mean stretch of the
        surface over the loop, one row. The others are those of paper 001, section 3.4, with c the point of the loop's
        own extremum against the other surface: u_f - c, f(u_f) - f(c) and g(u_g) - f(c). The first two are replaced by
        their signed length, negative on the wrong side, in the first row; their other rows are zero. "between" contains
        the gap and is for "on" alone; its three rows are dependent at a solution, which slows a solve. On a loop with
        corners these are the rows of the smooth side that the contact is on; an additional last row is the signed
        distance, one-sided, of the neighboring side at the corner next to the contact.
    side : "a" or "b", optional
        Which of the contact's faces the loop is on; by default the face that has the loop, otherwise "a".
    name : str, optional
        "trim" and the contact's name by default.

    Raises
    ------
    InputError, TypeError
        No contact, a side with several faces, a loop that is open or crosses itself, unknown words.
    """

    def __init__(
        self,
        contact: Contact,
        loop: Loop | NurbsCurve | Sequence[NurbsCurve],
        keep: Keep = "on",
        form: Form = "signed",
        *,
        side: Literal["a", "b"] | None = None,
        name: str | None = None,
    ) -> None:
        if not isinstance(contact, Contact):
            raise TypeError(f"contact is {contact!r}; expected a Contact")
        for word, value, known in (("keep", keep, get_args(Keep)), ("form", form, FORMS)):
            if value not in known:
                raise InputError(f"{word} is {value!r}; expected one of {', '.join(map(repr, known))}")
        if form == "between" and keep != "on":
            raise InputError(f"keep is {keep!r} with form 'between', which contains the gap; expected 'on'")
        if side not in (None, "a", "b"):
            raise InputError(f"side is {side!r}; expected 'a', 'b' or None")
        self._faces = (single_face("a", contact.a), single_face("b", contact.b))
        self._contact = contact
        if not isinstance(loop, (Loop, NurbsCurve, Iterable)):
            raise TypeError(f"loop is {loop!r}; expected a Loop, a closed NurbsCurve, or several that close")
        self._loop = loop if isinstance(loop, Loop) else Loop(loop)
        self._side = (0 if side == "a" else 1) if side is not None else self._owner()
        # A face of its own checks the loop against the surface, whose outer loop it is there.
        try:
            self._region = Face(self._faces[self._side].surface, self._loop)
        except InputError as error:
            raise InputError(str(error).replace("outer", "loop", 1)) from None
        self._keep: Keep = keep
        self._form: Form = form
        super().__init__(contact.bodies, f"trim {contact.name}" if name is None else name)

    def _owner(self) -> int:
        """The side whose face has the loop."""
        for side, face in enumerate(self._faces):
            if self._loop is face.outer or any(self._loop is hole for hole in face.holes):
                return side
        return 0

    @property
    def contact(self) -> Contact:
        """The contact that is kept."""
        return self._contact

    @property
    def loop(self) -> Loop:
        """The loop."""
        return self._loop

    @property
    def keep(self) -> Keep:
        """Where the contact is kept."""
        return self._keep

    @property
    def form(self) -> Form:
        """Which rows say so."""
        return self._form

    @property
    def side(self) -> int:
        """0 where the loop is on the face of side a, 1 where on that of side b."""
        return self._side

    @property
    def face(self) -> Face:
        """The contact's face that the loop is on."""
        return self._faces[self._side]

    @property
    def region(self) -> Face:
        """The surface with the loop as its boundary."""
        return self._region

    @cached_property
    def stretch(self) -> float:
        """Length in space of a unit step across the loop in (u, v): the mean over the loop."""
        steps = []
        for curve in self._region.boundary:
            at = np.linspace(*curve.domain, 17)[1:-1]
            place, rate = curve.evaluate(at, 1)
            _, su, sv = self._region.surface.evaluate(place[:, 0], place[:, 1], 1)
            across = (rate[:, :1] * sv - rate[:, 1:] * su) / np.linalg.norm(rate, axis=1, keepdims=True)
            steps.append(np.linalg.norm(across, axis=1))
        return float(np.concatenate(steps).mean())

    @property
    def unilateral(self) -> bool:
        """Whether the contact may leave the loop."""
        return self._keep != "on"

    @property
    def _is_asked(self) -> bool:
        """Whether a solve asks for it, and for its contact."""
        return super()._is_asked and self._contact._is_asked

    def __repr__(self) -> str:
        return f"TrimContact({self._contact.name!r}, keep={self._keep!r}, form={self._form!r}, name={self.name!r})"


def single_face(label: str, side: Body | BodyFace) -> Face:
    """The only face of a side of a contact."""
    if isinstance(side, BodyFace):
        return side.face
    if len(side.faces) != 1:
        raise InputError(
            f"contact has body {side.name!r} with {len(side.faces)} faces as side {label}; expected one of its faces"
        )
    return side.faces[0].face
