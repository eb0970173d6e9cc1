"""Contact: two faces touch at some pair of points."""

from __future__ import annotations

import numpy as np

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.tracked_sizes import check_parameters
from assembly.errors import InputError, bounded
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.smooth_faces import has_creases
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import Body, BodyFace
from assembly.kinematics.changes import count_number

__all__ = ["Contact", "lone_surfaces", "side_face", "side_faces"]


class Contact(Constraint):
    """The extremal gap of two faces is zero (or, one-sided, not negative), or another least gap.

    The gap is that of the pair of points that the solve tracks from its start; its place on the faces is free. With
    edges, the pair is one of features (faces, edges, vertices) and switches between them as the bodies move; without,
    it is a pair of two whole surfaces, flush if both are flat. A bore and a pin of its radius, or a socket and a ball,
    that are in each other at the start touch everywhere or nowhere: a two-sided contact of these two faces is then the
    joint that aligns their axes, or centers.

    Parameters
    ----------
    a, b : Body or BodyFace
        All faces of a body, or one of them.
    name : str, optional
        "a-b" of the bodies' names by default.
    unilateral : bool
        gap >= 0 instead of gap = 0.
    edges : bool, optional
        Whether the faces' edges and vertices take part. By default where a side has several faces, or one with loops
        or creases; without them a contact that would have to leave a surface is lost.
    minimum : float
        The gap instead of zero, or the least gap: a film, a shim, a grinding allowance. Settable between solves. Not
        together with a `Clearance` of the same two bodies.

    Raises
    ------
    InputError, TypeError
        A body without a shape, a body with itself, or something that is no body; surfaces whose parameters have spans
        below 1e-60 or above 1e60.
    """

    def __init__(
        self,
        a: Body | BodyFace,
        b: Body | BodyFace,
        name: str | None = None,
        unilateral: bool = False,
        *,
        edges: bool | None = None,
        minimum: float = 0.0,
    ) -> None:
        for label, side in (("a", a), ("b", b)):
            if not isinstance(side, (Body, BodyFace)):
                raise TypeError(f"{label} is {side!r}; expected a Body or one of its faces")
            if isinstance(side, Body) and not side.faces:
                raise InputError(f"{label} is body {side.name!r} without a shape; expected a body with a face")
            check_parameters(f"{label}, {side!r},", side_faces(side))
        self._a = a
        self._b = b
        if self.body_a is self.body_b:
            raise InputError(f"sides a and b are both on body {self.body_a.name!r}; expected two bodies")
        super().__init__((self.body_a, self.body_b), name)
        if not isinstance(unilateral, (bool, np.bool_)):
            raise InputError(f"unilateral is {unilateral!r}; expected True or False")
        self._unilateral = bool(unilateral)
        self._minimum = _least(minimum)
        if edges is not None and not isinstance(edges, (bool, np.bool_)):
            raise InputError(f"edges is {edges!r}; expected True, False or None")
        sides = [side_faces(side) for side in (a, b)]
        several = any(len(faces) > 1 for faces in sides)
        if several and edges is not None and not edges:
            raise InputError("edges is False for a body with several faces; expected a contact of two single faces")
        self._edges = bool(edges) if edges is not None else several or any(_has_edges(faces[0]) for faces in sides)

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
    def minimum(self) -> float:
        """The gap, or the least one; settable between solves."""
        return self._minimum

    @minimum.setter
    def minimum(self, value: float) -> None:
        self._minimum = _least(value)
        count_number(self)

    @property
    def edges(self) -> bool:
        """Whether edges and vertices take part."""
        return self._edges

    @property
    def body_a(self) -> Body:
        """The body of side a."""
        return self.a if isinstance(self.a, Body) else self.a.body

    @property
    def body_b(self) -> Body:
        """The body of side b."""
        return self.b if isinstance(self.b, Body) else self.b.body

    def __repr__(self) -> str:
        said = (
            f"{', unilateral=True' if self.unilateral else ''}{f', minimum={self.minimum:g}' if self.minimum else ''}"
        )
        return f"Contact({self.a!r}, {self.b!r}, name={self.name!r}{said})"


def _least(value: float) -> float:
    """A least gap."""
    least = bounded("minimum", value)
    if not least >= 0.0:
        raise InputError(f"minimum is {least:g}; expected a length of zero or more")
    return least


def side_faces(side: Body | BodyFace) -> tuple[Face, ...]:
    """The faces that take part on a side of a contact."""
    return (side.face,) if isinstance(side, BodyFace) else tuple(part.face for part in side.faces)


def side_face(side: Body | BodyFace) -> BodyFace:
    """The only face of a side."""
    return side if isinstance(side, BodyFace) else side.faces[0]


def lone_surfaces(sides: tuple[Body | BodyFace, Body | BodyFace]) -> tuple[NurbsSurface, NurbsSurface] | None:
    """The two surfaces of a contact, if each of its sides has one face."""
    f, g = (side_faces(side) for side in sides)
    return (f[0].surface, g[0].surface) if len(f) == len(g) == 1 else None


def _has_edges(face: Face) -> bool:
    """Whether a face was given loops, or has creases."""
    return face.outer is not None or bool(face.holes) or has_creases(face)
