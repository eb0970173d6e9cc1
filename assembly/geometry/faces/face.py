"""Face: a surface with a side that is outside, and with a boundary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._copies import FoundAgain
from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, checked_color, items, positive
from assembly.geometry.faces.boundary import Boundary, LoopLike, boundary_of_parts, make_boundary
from assembly.geometry.faces.loop import Loop
from assembly.geometry.faces.measures import face_integrals
from assembly.geometry.faces.space_nearest import nearest_in_space
from assembly.geometry.faces.trim import locate_points
from assembly.geometry.faces.trim_nearest import nearest_points
from assembly.geometry.splines.curve import NurbsCurve, checked_name, flat, parameters
from assembly.geometry.splines.derivative_bounds import derivative_bounds
from assembly.geometry.splines.evaluate import SIGN
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["BoundaryPoint", "Face", "whole_face"]


@dataclass(frozen=True, eq=False)
class BoundaryPoint(ReadOnlyArrays):
    """Nearest points of a boundary: signed distance (positive inside), curve, its parameter, and (u, v)."""

    distance: NDArray[np.float64]
    curve: NDArray[np.int64]
    t: NDArray[np.float64]
    point: NDArray[np.float64]


class Face(FoundAgain):
    """A surface with a side that is outside, and with a boundary: what is left of it after trimming.

    Parameters
    ----------
    surface : NurbsSurface
    outer : NurbsCurve, several of them, or Loop, optional
        The outer boundary in (u, v); the edge of the surface by default. On a surface that is closed in u or v it
        may be drawn with seams, or be a ring once around with material on its left, the other ring among `holes`.
    holes : sequence of the same
        Inner boundaries. The outer loop is turned counterclockwise and holes clockwise; rings stay as they are.
    name : str, optional
        The surface's name by default.
    reversed : bool
        The outward normal is Su x Sv, or its negative when reversed.
    color : (red, green, blue), optional
        0 to 1 each; that of the body by default.
    tolerance : float, optional
        How far loops may leave the surface, or go into each other [length]; 1e-4 of the surface's size by default. The
        surface is continued to where they end, as its last span goes on. What lies between loops that go into each
        other belongs to no face.

    Attributes
    ----------
    surface : NurbsSurface
        The given one, or its continuation.
    boundary : tuple of NurbsCurve
        All boundary curves, material on their left, without seams and without edges that are one point in space.
    chains : tuple of range
        Which of them follow one another.

    Raises
    ------
    TypeError
        The surface or a loop is something else.
    InputError
        Naming the loop: one that is open, crosses itself or another or leaves the domain by more than the tolerance,
        touches another along a stretch, or does not bound the face together with the others. Loops may touch in points,
        and are cut there; those that do are one of `outer` and `holes`, and in `chains` none passes a place twice.
    """

    def __init__(
        self,
        surface: NurbsSurface,
        outer: LoopLike | None = None,
        holes: Sequence[LoopLike] = (),
        *,
        name: str | None = None,
        reversed: bool = False,
        color: Sequence[float] | None = None,
        tolerance: float | None = None,
    ) -> None:
        if not isinstance(surface, NurbsSurface):
            raise TypeError(f"surface is {surface!r}; expected a NurbsSurface")
        if not isinstance(reversed, (bool, np.bool_)):
            raise TypeError(f"reversed is {reversed!r}; expected True or False")
        if tolerance is not None:
            tolerance = positive("tolerance", tolerance)
        self.surface = surface
        self.name = surface.name if name is None else checked_name(name)
        self.reversed = bool(reversed)
        self.color = color
        self._outer, self._holes = outer, items("holes", holes, "a sequence of loops")
        if outer is not None or self._holes:
            self._boundary = make_boundary(surface, outer, self._holes, tolerance)
            self.surface = self._boundary.surface

    def __getstate__(self) -> dict[str, Any]:
        # Loops are made with the face.
        made = {"_boundary": self._boundary} if self._outer is not None or self._holes else {}
        return {**super().__getstate__(), **made}

    @cached_property
    def _boundary(self) -> Boundary:
        """Of a surface without loops, when it is first asked for."""
        return make_boundary(self.surface, None, ())

    @property
    def color(self) -> tuple[float, float, float] | None:
        """Red, green and blue, 0 to 1; None for the color of the body. Settable."""
        return self._color

    @color.setter
    def color(self, value: Sequence[float] | None) -> None:
        self._color = checked_color(value)

    @property
    def outer(self) -> Loop | None:
        """The outer loop, counterclockwise; None for the edge of the surface."""
        return self._boundary.outer if self._outer is not None or self._holes else None

    @property
    def holes(self) -> tuple[Loop, ...]:
        """The other loops, clockwise."""
        return self._boundary.holes if self._holes else ()

    @property
    def boundary(self) -> tuple[NurbsCurve, ...]:
        """All boundary curves, material to the left; none for a closed surface without loops."""
        return self._boundary.curves

    @property
    def chains(self) -> tuple[range, ...]:
        """Which boundary curves follow one another."""
        return self._boundary.chains

    def transformed(
        self,
        rotation: ArrayLike | None = None,
        translation: ArrayLike = (0.0, 0.0, 0.0),
        scale: float = 1.0,
        *,
        name: str | None = None,
    ) -> Face:
        """The face moved by x -> scale rotation x + translation; its loops, which are in (u, v), stay as they are.

        Parameters
        ----------
        rotation : (3, 3), optional
        translation : (3,)
        scale : float
            Above zero.
        name : str, optional
            Its own by default.

        Raises
        ------
        InputError
            A matrix that is no rotation, a scale that is not positive.
        """
        moved = object.__new__(Face)
        moved.surface = self.surface.transformed(rotation, translation, scale)
        moved.name = self.name if name is None else checked_name(name)
        moved.reversed, moved.color = self.reversed, self.color
        moved._outer, moved._holes = self._outer, self._holes
        if "_boundary" in self.__dict__:
            # What it is in (u, v) does not change.
            moved.__dict__["_boundary"] = self._boundary
        return moved

    def _of_parts(self, parts: Sequence[Sequence[NurbsCurve]]) -> Face:
        """The face with every curve of its boundary replaced by its parts; its loops stay as they are."""
        made = object.__new__(Face)
        made.surface, made.name, made.reversed, made.color = self.surface, self.name, self.reversed, self.color
        made._outer, made._holes = self._outer, self._holes
        made.__dict__["_boundary"] = boundary_of_parts(self._boundary, parts)
        return made

    def packed_trim(self, table_at: int = 0, pool_at: int = 0) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Table and pool of the boundary as kernels read it, for being appended at these places."""
        return self._boundary.table.at(table_at, pool_at)

    def _at(self, u: ArrayLike, v: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, ...]]:
        """Flat parameters and their common shape."""
        at_u, at_v = parameters("u", u), parameters("v", v)
        try:
            shape = np.broadcast_shapes(at_u.shape, at_v.shape)
        except ValueError:
            raise InputError(
                f"u and v have shapes {at_u.shape} and {at_v.shape}; expected shapes that broadcast"
            ) from None
        for name, at in (("u", at_u), ("v", at_v)):
            if not np.isfinite(at).all():
                raise InputError(f"{name} is {at[~np.isfinite(at)].flat[0]}; expected finite parameters")
        if at_u.shape != at_v.shape:
            at_u, at_v = np.broadcast_to(at_u, shape), np.broadcast_to(at_v, shape)
        return flat(at_u), flat(at_v), shape

    def locate(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.int64]:
        """On which side of the boundary points are, decided on its true curves.

        Parameters
        ----------
        u, v : arrays that broadcast
            Any sheet of a closed direction.

        Returns
        -------
        1 inside, 0 on the boundary (within 1e-12 of its size in (u, v)), -1 outside; the common shape.

        Raises
        ------
        InputError
            A parameter that is not finite.
        """
        at_u, at_v, shape = self._at(u, v)
        table, pool = self.packed_trim()
        side = np.empty(at_u.size, dtype=np.int64)
        locate_points(table, pool, 0, at_u, at_v, side)
        return side.reshape(shape)

    def contains(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.bool_]:
        """Whether points are inside or on the boundary; see `locate`."""
        return np.asarray(self.locate(u, v) >= 0)

    def _nearest(self, u: ArrayLike, v: ArrayLike) -> tuple[NDArray[np.float64], tuple[int, ...]]:
        at_u, at_v, shape = self._at(u, v)
        table, pool = self.packed_trim()
        out = np.empty((at_u.size, 7))
        nearest_points(table, pool, 0, 0, len(self.boundary), at_u, at_v, out)
        return out, shape

    def trim_distance(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """Signed Euclidean distance to the boundary in (u, v), positive inside, infinite without a boundary.

        Parameters
        ----------
        u, v : arrays that broadcast

        Raises
        ------
        InputError
            A parameter that is not finite.
        """
        out, shape = self._nearest(u, v)
        return out[:, 0].reshape(shape)

    def nearest_on_boundary(self, u: ArrayLike, v: ArrayLike) -> BoundaryPoint:
        """The nearest point of the boundary in (u, v), certified by branch and bound.

        Parameters
        ----------
        u, v : arrays that broadcast

        Raises
        ------
        InputError
            A parameter that is not finite, or a face without a boundary.
        """
        if not self.boundary:
            raise InputError(f"{self!r} has no boundary: its surface is closed and has no loops")
        out, shape = self._nearest(u, v)
        return BoundaryPoint(
            distance=out[:, 0].reshape(shape),
            curve=out[:, 1].astype(np.int64).reshape(shape),
            t=out[:, 2].reshape(shape),
            point=out[:, 3:5].reshape((*shape, 2)),
        )

    def space_distance(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """Signed distance in space from S(u, v) to the boundary, positive inside, infinite without a boundary.

        Parameters
        ----------
        u, v : arrays that broadcast
            In the domain of open directions; beyond it they count as at its end.

        Raises
        ------
        InputError
            A parameter that is not finite.
        """
        at_u, at_v, shape = self._at(u, v)
        table, pool, trim_at = self._packed_whole
        out = np.empty((at_u.size, 3))
        nearest_in_space(table, pool, 0, trim_at, self._derivative_bounds, at_u, at_v, out)
        return np.where(self.locate(at_u, at_v) < 0, -out[:, 0], out[:, 0]).reshape(shape)

    @cached_property
    def _packed_whole(self) -> tuple[NDArray[np.int64], NDArray[np.float64], int]:
        """Table and pool of the surface and the boundary behind it, and where that begins in the table."""
        record, surface_pool = self.surface.packed()
        table, pool = self.packed_trim(record.size, surface_pool.size)
        return np.concatenate([record, table]), np.concatenate([surface_pool, pool]), record.size

    @cached_property
    def _derivative_bounds(self) -> NDArray[np.float64]:
        return derivative_bounds(self.surface)

    def integrals(self, center: NDArray[np.float64]) -> tuple[Any, Any]:
        """Integrals of area, volume and moments about a center, with Su x Sv; see `face_integrals`."""
        return face_integrals(self.surface, self._boundary.table, center)

    @cached_property
    def _integrals(self) -> Any:
        return self.integrals(np.zeros(3))[0]

    def area(self) -> float:
        """Area of the face, to 1e-10 of itself."""
        return float(self._integrals.area)

    @cached_property
    def _centroid(self) -> NDArray[np.float64]:
        return np.asarray(self._integrals.moment / self._integrals.area)

    def centroid(self) -> NDArray[np.float64]:
        """Center of the face's area (3,), to 1e-10 of its extent."""
        return np.array(self._centroid)

    def volume_integral(self) -> float:
        """One third of the integral of S.n over the face, n outward: summed over a closed body, its volume."""
        return self.sign * float(self._integrals.flux.sum()) / 3.0

    def __repr__(self) -> str:
        label = "" if self.name is None else f"{self.name!r}, "
        return f"Face({label}{self.surface!r}{', reversed' if self.reversed else ''})"

    @property
    def sign(self) -> int:
        """1, or -1 when reversed."""
        return -1 if self.reversed else 1

    def normal(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """Unit outward normal, shape of the parameters + (3,); see `NurbsSurface.normal`."""
        return self.sign * self.surface.normal(u, v)

    def packed(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The surface's record and pool, with the sign of the outward normal in the record."""
        record, pool = self.surface.packed()
        if not self.reversed:
            return record, pool
        record = record.copy()
        record[SIGN] = -1
        return record, pool


def whole_face(surface: NurbsSurface) -> Face:
    """All of a surface as a face, the same as long as the surface is there: what is known of it is kept with it."""
    kept: Face | None = surface.__dict__.get("_whole_face")
    if kept is None:
        kept = surface.__dict__["_whole_face"] = Face(surface)
    return kept
