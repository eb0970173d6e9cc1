"""Tangent: two faces touch at a point, with the side said."""

from __future__ import annotations

from typing import Any, Literal

from assembly.constraints.model.contact import Contact
from assembly.constraints.model.mate_features import one_feature
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import BodyFace
from assembly.selection.faces import Faces

__all__ = ["Tangent"]


class Tangent(Contact):
    """Two faces touch somewhere, and have one tangent plane there: takes away 1 degree of freedom.

    A `Contact` of two faces, with the side on which they touch. Like a contact it means the pair that it tracks, from
    where the solve starts.

    Parameters
    ----------
    a, b : BodyFace
        Or selections of a single face.
    name : str, optional
        "tangent" and the bodies' names by default.
    side : "outside" or "inside"
        Outside: outward normals oppose each other, the bodies are on different sides, as a ball on a floor, and as a
        pin in a wider bore. Inside: the normals are one, the bodies are on the same side, as two drums in one band.
    unilateral : bool
        gap >= 0 instead of gap = 0.

    Raises
    ------
    InputError
        An unknown side, a selection that is not a single face, both faces on one body.
    TypeError
        Something else than a face.
    """

    def __init__(
        self,
        a: BodyFace | Faces,
        b: BodyFace | Faces,
        name: str | None = None,
        *,
        side: Literal["outside", "inside"] = "outside",
        unilateral: bool = False,
    ) -> None:
        one, other = _face("a", a), _face("b", b)
        if not isinstance(side, str) or side not in ("outside", "inside"):
            raise InputError(f"side is {side!r}; expected 'outside' or 'inside'")
        said = f"tangent {one.body.name}-{other.body.name}" if name is None else name
        super().__init__(one, other if side == "outside" else _turned(other), said, unilateral)
        self._side = side
        self._given = one, other

    @property
    def side(self) -> Literal["outside", "inside"]:
        """Whether the outward normals oppose each other where they touch, or are one."""
        return self._side

    @property
    def faces(self) -> tuple[BodyFace, BodyFace]:
        """The two faces as they were given."""
        return self._given

    @property
    def removes(self) -> int:
        """How many degrees of freedom it takes away."""
        return 1

    def __repr__(self) -> str:
        one_sided = ", unilateral=True" if self.unilateral else ""
        settings = f"name={self.name!r}, side={self.side!r}{one_sided}"
        return f"Tangent({self.faces[0]!r}, {self.faces[1]!r}, {settings}; takes away 1 of 6 degrees of freedom)"


def _face(name: str, value: Any) -> BodyFace:
    one = one_feature(value)
    if not isinstance(one, BodyFace):
        raise TypeError(f"{name} is {one!r}; expected a face of a body")
    return one


def _turned(side: BodyFace) -> BodyFace:
    """The same face seen from behind."""
    face = side.face
    turned = Face(face.surface, face.outer, face.holes, name=face.name, reversed=not face.reversed, color=face.color)
    return BodyFace(side.body, turned, side.name)
