"""Contact: two faces touch somewhere, wherever that is."""

from __future__ import annotations

import numpy as np

from assembly.constraints.constraint import Constraint
from assembly.errors import InputError
from assembly.kinematics.body import Body, BodyFace

__all__ = ["Contact"]


class Contact(Constraint):
    """The extremal gap of two faces is zero (or, one-sided, not negative).

    The gap is that of the pair of points the solve tracks from its start; where it lies on the faces is free.

    Parameters
    ----------
    a, b : Body or BodyFace
        Of a body with several faces, the face nearest to the other side at the first solve takes part; say
        `body.face(name)` to choose.
    name : str, optional
        "a-b" of the bodies' names by default.
    unilateral : bool
        gap >= 0 instead of gap = 0.

    Raises
    ------
    InputError, TypeError
        A body without a shape, a body with itself, or something that is no body.
    """

    def __init__(
        self,
        a: Body | BodyFace,
        b: Body | BodyFace,
        name: str | None = None,
        unilateral: bool = False,
    ) -> None:
        for label, side in (("a", a), ("b", b)):
            if not isinstance(side, (Body, BodyFace)):
                raise TypeError(f"{label} is {side!r}; expected a Body or one of its faces")
            if isinstance(side, Body) and not side.faces:
                raise InputError(f"{label} is body {side.name!r} without a shape; expected a body with a face")
        self._a = a
        self._b = b
        if self.body_a is self.body_b:
            raise InputError(f"sides a and b are both on body {self.body_a.name!r}; expected two bodies")
        super().__init__((self.body_a, self.body_b), name)
        if not isinstance(unilateral, (bool, np.bool_)):
            raise InputError(f"unilateral is {unilateral!r}; expected True or False")
        self._unilateral = bool(unilateral)

    @property
    def a(self) -> Body | BodyFace:
        """One side, as it was given."""
        return self._a

    @property
    def b(self) -> Body | BodyFace:
        """The other side, as it was given."""
        return self._b

    @property
    def unilateral(self) -> bool:
        """Whether the gap may be positive."""
        return self._unilateral

    @property
    def body_a(self) -> Body:
        """The body of side a."""
        return self.a if isinstance(self.a, Body) else self.a.body

    @property
    def body_b(self) -> Body:
        """The body of side b."""
        return self.b if isinstance(self.b, Body) else self.b.body

    def __repr__(self) -> str:
        return f"Contact({self.a!r}, {self.b!r}, name={self.name!r}{', unilateral=True' if self.unilateral else ''})"
