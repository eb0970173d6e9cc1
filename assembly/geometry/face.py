"""Face: a surface with a side that is outside, and with a boundary."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.geometry.boundary import Boundary, LoopLike, make_boundary
from assembly.geometry.curve import NurbsCurve, checked_name, flat, parameters
from assembly.geometry.loop import Loop
from assembly.geometry.spline import SIGN
from assembly.geometry.surface import NurbsSurface
from assembly.geometry.trim import locate_points, nearest_points

__all__ = ["Face"]


class Face:
    """A surface with an orientation.

    Parameters
    ----------
    surface : NurbsSurface
    name : str, optional
        The surface's name by default.
    reversed : bool
        The outward normal is Su x Sv, or its negative when reversed.

    Raises
    ------
    TypeError
        The surface is something else.
    """

    def __init__(
        self,
        surface: NurbsSurface,
        outer: LoopLike | None = None,
        holes: Sequence[LoopLike] = (),
        *,
        name: str | None = None,
        reversed: bool = False,
    ) -> None:
        if not isinstance(surface, NurbsSurface):
            raise TypeError(f"surface is {surface!r}; expected a NurbsSurface")
        if not isinstance(reversed, (bool, np.bool_)):
            raise TypeError(f"reversed is {reversed!r}; expected True or False")
        self.surface = surface
        self.name = surface.name if name is None else checked_name(name)
        self.reversed = bool(reversed)
        self._outer, self._holes = outer, tuple(holes)
        if outer is not None or self._holes:
            _ = self._boundary

    @cached_property
    def _boundary(self) -> Boundary:
        """Made at once where there are loops to be checked, else when it is first asked for."""
        return make_boundary(self.surface, self._outer, self._holes)

    @property
    def outer(self) -> Loop | None:
        """The outer loop, counterclockwise; None for the edge of the surface."""
        return None if self._outer is None else self._boundary.outer

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

    def packed_trim(self, table_at: int = 0, pool_at: int = 0) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Table and pool of the boundary as kernels read it, for being appended at these places."""
        return self._boundary.table.at(table_at, pool_at)

    def locate(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.int64]:
        """1 inside, 0 on the boundary (within 1e-12 of its size), -1 outside; parameters broadcast."""
        at_u, at_v = np.broadcast_arrays(parameters("u", u), parameters("v", v))
        table, pool = self.packed_trim()
        side = np.empty(at_u.size, dtype=np.int64)
        locate_points(table, pool, 0, flat(at_u), flat(at_v), side)
        return side.reshape(at_u.shape)

    def trim_distance(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """Signed distance to the boundary in (u, v), positive inside."""
        at_u, at_v = np.broadcast_arrays(parameters("u", u), parameters("v", v))
        table, pool = self.packed_trim()
        out = np.empty((at_u.size, 7))
        nearest_points(table, pool, 0, 0, len(self.boundary), flat(at_u), flat(at_v), out)
        return out[:, 0].reshape(at_u.shape)

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
