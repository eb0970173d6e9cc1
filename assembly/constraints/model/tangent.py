"""Tangent: two faces touch with a common tangent plane, on a given side.

Of two elementary faces it has rows between planes, axes and centers, of others it is a contact: the class chooses.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint, Equation
from assembly.constraints.model.contact import Contact, side_face
from assembly.constraints.model.elementary_tangents import check_fit, touching_rows
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.mate_features import Mate, one_feature
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.smooth_faces import has_creases
from assembly.kinematics.body import BodyFace
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.extrema.pairs import PairStatus, extremal_pair
from assembly.selection.faces import Faces

__all__ = ["ContactTangent", "SurfaceTangent", "Tangent"]

Array = NDArray[np.float64]
Side = Literal["outside", "inside"]
Touch = Literal["line", "point"]
# Faces that touch along a line or in a point, as is asked.
_EITHER = (["cylinder", "cylinder"], ["cone", "cylinder"])
# Samples of each surface along either parameter, and pairs of them from which an extremal pair is looked for.
_GRID, _TRIED = 16, 8


class Tangent(Constraint):
    """Two faces touch, and have one tangent plane there: takes away 1 degree of freedom, more along lines and circles.

    Planes, cylinders, cones and spheres are treated as unbounded surfaces, held by distances between planes, axes and
    centers. A cylinder or cone lies on a plane along a line, which takes away 2; a cylinder on a parallel one, or along
    a line of a cone, 3. Other faces, those that touch in a point, and `unilateral` ones are a `Contact` with the given
    side: it holds the one pair of points that it tracks from the start of the solve, on the whole surfaces, not within
    their trims. To stay within the trims add a `TrimContact`, or use a `Contact` with edges.

    Parameters
    ----------
    a, b : BodyFace
        Or selections of a single face.
    name : str, optional
        "tangent" and the bodies' names by default.
    side : "outside" or "inside"
        Outside: outward normals are opposed and the bodies are on different sides, such as a ball on a floor or a pin
        in a wider bore. Inside: the normals are equal and the bodies are on the same side, such as two drums in one
        band.
    unilateral : bool
        gap >= 0 instead of gap = 0.
    touch : "line" or "point", optional
        How two cylinders, or a cylinder and a cone, touch: along a line, with parallel axes or an axis parallel to a
        line of the cone, by default; or in a point, as crossed ones do.

    Raises
    ------
    InputError
        An unknown side, a selection that is not a single face, both faces on one body, two planes, a `touch` that the
        faces have not, a ball or a pin that is wider than the bore it is in.
    TypeError
        Something else than a face.
    """

    _side: Side
    _faces: tuple[BodyFace, BodyFace]

    def __new__(
        cls,
        a: Any = None,
        b: Any = None,
        name: str | None = None,
        *,
        side: str = "outside",
        unilateral: bool = False,
        touch: Touch | None = None,
    ) -> Tangent:
        """Choose by the faces; see the class."""
        if cls is not Tangent:
            # What is copied.
            made: Tangent = object.__new__(cls)
            return made
        one, other = one_feature(a), one_feature(b)
        exact = isinstance(one, BodyFace) and isinstance(other, BodyFace) and touch != "point" and not unilateral
        has_rows = exact and touching_rows(one, other, True) is not None
        chosen: Tangent = object.__new__(SurfaceTangent if has_rows else ContactTangent)
        return chosen

    def __init__(
        self,
        a: BodyFace | Faces,
        b: BodyFace | Faces,
        name: str | None = None,
        *,
        side: Side = "outside",
        unilateral: bool = False,
        touch: Touch | None = None,
    ) -> None:
        raise NotImplementedError  # one of the two below is made

    @property
    def side(self) -> Side:
        """Whether the outward normals are opposed or equal where the faces touch."""
        return self._side

    @property
    def faces(self) -> tuple[BodyFace, BodyFace]:
        """The two faces as they were given."""
        return self._faces

    @property
    def touch(self) -> Touch | None:
        """Whether faces that may touch along a line do so, or in a point; None of others, which leave no choice."""
        if _kinds(*self._faces) not in _EITHER or self._is_one_sided:
            return None
        return "line" if isinstance(self, SurfaceTangent) else "point"

    @property
    def _is_one_sided(self) -> bool:
        return isinstance(self, Contact) and self.unilateral

    @property
    def removes(self) -> int:
        """How many degrees of freedom it takes away; one-sided, none while it is open."""
        return sum(not row.one_sided for row in self._own) if isinstance(self, SurfaceTangent) else 1

    def _take(
        self, a: Any, b: Any, name: str | None, side: Side, touch: Any, unilateral: bool
    ) -> tuple[BodyFace, BodyFace, str]:
        """Check what was given, and keep it; the faces and the name."""
        one, other = _face("a", a), _face("b", b)
        if not isinstance(side, str) or side not in ("outside", "inside"):
            raise InputError(f"side is {side!r}; expected 'outside' or 'inside'")
        kinds = one.kind, other.kind
        if set(kinds) == {"plane"}:
            raise InputError(f"a and b are {one!r} and {other!r}, two planes; expected Flush for them")
        if touch is not None:
            if unilateral or _kinds(one, other) not in _EITHER:
                what = "a one-sided tangent" if unilateral else f"a {kinds[0]} and a {kinds[1]}"
                raise InputError(
                    f"touch is {touch!r} of {what}; expected it of two cylinders, or a cylinder and a cone, alone"
                )
            if not isinstance(touch, str) or touch not in ("line", "point"):
                raise InputError(f"touch is {touch!r}; expected 'line' or 'point'")
        self._side = side
        self._faces = one, other
        return one, other, f"tangent {one.body.name}-{other.body.name}" if name is None else name

    def __repr__(self) -> str:
        one_sided = ", unilateral=True" if self._is_one_sided else ""
        touch = "" if self.touch is None else f", touch={self.touch!r}"
        settings = f"name={self.name!r}, side={self.side!r}{one_sided}{touch}"
        count = f"takes away {self.removes} of 6 degrees of freedom"
        return f"Tangent({self.faces[0]!r}, {self.faces[1]!r}, {settings}; {count})"


class SurfaceTangent(Tangent, Mate, Joint):
    """Two elementary faces, by rows between their planes, axes and centers."""

    _sides = ("a", "b")

    def __init__(
        self,
        a: BodyFace | Faces,
        b: BodyFace | Faces,
        name: str | None = None,
        *,
        side: Side = "outside",
        unilateral: bool = False,
        touch: Touch | None = None,
    ) -> None:
        one, other, said = self._take(a, b, name, side, touch, unilateral)
        check_fit(one, other, side == "outside")
        found = touching_rows(one, other, side == "outside")
        assert found is not None, "the faces have rows"
        Joint.__init__(self, found.frame_a, found.frame_b, said, found.axes)
        self._may_be_renamed = name is None
        self._given = {"a": one, "b": other}
        rows = []
        for k, row in enumerate(found.rows):
            setattr(self, f"_value_{k}", row.value)
            terms = tuple((factor, self._coordinate(*which)) for factor, which in row.terms)
            rows.append(Equation(terms, (self, f"_value_{k}") if row.value else None, row.one_sided))
        self._own = tuple(rows)

    def _shared(self) -> Iterable[object]:
        return *super()._shared(), *self._faces


class ContactTangent(Tangent, Contact):
    """Two faces by the pair of points at which they touch."""

    def __init__(
        self,
        a: BodyFace | Faces,
        b: BodyFace | Faces,
        name: str | None = None,
        *,
        side: Side = "outside",
        unilateral: bool = False,
        touch: Touch | None = None,
    ) -> None:
        one, other, said = self._take(a, b, name, side, touch, unilateral)
        # Those with creases are cut into smooth ones, which only edges join.
        edges = None if has_creases(one.face) or has_creases(other.face) else False
        Contact.__init__(self, one, other if side == "outside" else _turned(other), said, unilateral, edges=edges)
        self._may_be_renamed = name is None

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


def _sampled(face: Face, q: Array) -> tuple[Array, Array, Array]:
    """Parameters, points and outward normals in the world of samples of a surface that have a normal."""
    (u0, u1), (v0, v1) = face.surface.domain
    # In the middle of cells: at poles there is none.
    part = (np.arange(_GRID) + 0.5) / _GRID
    u, v = (a.ravel() for a in np.meshgrid(u0 + part * (u1 - u0), v0 + part * (v1 - v0), indexing="ij"))
    turn = rotation_matrix(q[3:])
    return np.column_stack([u, v]), face.surface.evaluate(u, v) @ turn.T + q[:3], face.normal(u, v) @ turn.T


def _kinds(a: BodyFace, b: BodyFace) -> list[str]:
    return sorted((a.kind, b.kind))


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
