"""Tangent: two faces touch at a point, with the side said."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.contact import Contact, side_face
from assembly.constraints.model.mate_features import one_feature
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.smooth_faces import has_creases
from assembly.kinematics.body import BodyFace
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.extrema.pairs import PairStatus, extremal_pair
from assembly.selection.faces import Faces

__all__ = ["Tangent"]

Array = NDArray[np.float64]
# Samples of each surface along either parameter, and pairs of them from which an extremal pair is looked for.
_GRID, _TRIED = 16, 8


class Tangent(Contact):
    """Two faces touch somewhere, and have one tangent plane there: takes away 1 degree of freedom.

    A `Contact` of two faces, with the side on which they touch. Like a contact it means the pair that it tracks, from
    where the solve starts. Surfaces count whole, also where faces are trimmed; a `TrimContact` keeps the point inside.

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
        # Those with creases are cut into smooth ones, which only edges join.
        edges = None if has_creases(one.face) or has_creases(other.face) else False
        super().__init__(one, other if side == "outside" else _turned(other), said, unilateral, edges=edges)
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

    def start_at(self, q_a: Array, q_b: Array) -> Array | None:
        """Parameters (4,) of an extremal pair whose outward normals oppose each other, near the ones that nearly do.

        Poses (7,) are those of the bodies of a and b. None where none is found: then the pair is searched as that of
        any contact.
        """
        sides = side_face(self.a).face, side_face(self.b).face
        (uv, x, n), (st, y, m) = (_sampled(face, q) for face, q in zip(sides, (q_a, q_b), strict=True))
        way = y[None] - x[:, None]
        length = np.maximum(np.linalg.norm(way, axis=-1), 1e-300)
        along = np.abs(np.einsum("ijk,ik->ij", way, n)) / length
        # How far the two are from facing each other, and the way between them from their normals.
        off = 2.0 + n @ m.T - along
        # Of those that face each other as well, the nearest.
        merit = (off + 1e-2 * length / length.max()).ravel()
        for k in np.argsort(merit, kind="stable")[:: len(m)][:_TRIED]:
            i, j = divmod(int(k), len(m))
            start = np.concatenate([uv[i], st[j]])
            pair = extremal_pair(sides[0], q_a, sides[1], q_b, start)
            if pair.status not in (PairStatus.CONVERGED, PairStatus.SINGULAR):
                continue
            u, v, s, t = pair.parameters
            f = rotation_matrix(q_a[3:]) @ sides[0].normal(u, v)
            g = rotation_matrix(q_b[3:]) @ sides[1].normal(s, t)
            if f @ g < 0.0:
                return pair.parameters
        return None

    def __repr__(self) -> str:
        one_sided = ", unilateral=True" if self.unilateral else ""
        settings = f"name={self.name!r}, side={self.side!r}{one_sided}"
        return f"Tangent({self.faces[0]!r}, {self.faces[1]!r}, {settings}; takes away 1 of 6 degrees of freedom)"


def _sampled(face: Face, q: Array) -> tuple[Array, Array, Array]:
    """Parameters, points and outward normals in the world of samples of a surface that have a normal."""
    (u0, u1), (v0, v1) = face.surface.domain
    # In the middle of cells: at poles there is none.
    part = (np.arange(_GRID) + 0.5) / _GRID
    u, v = (a.ravel() for a in np.meshgrid(u0 + part * (u1 - u0), v0 + part * (v1 - v0), indexing="ij"))
    turn = rotation_matrix(q[3:])
    return np.column_stack([u, v]), face.surface.evaluate(u, v) @ turn.T + q[:3], face.normal(u, v) @ turn.T


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
