"""Face: a surface with a side that is outside."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.geometry.curve import checked_name
from assembly.geometry.spline import SIGN
from assembly.geometry.surface import NurbsSurface

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

    def __init__(self, surface: NurbsSurface, *, name: str | None = None, reversed: bool = False) -> None:
        if not isinstance(surface, NurbsSurface):
            raise TypeError(f"surface is {surface!r}; expected a NurbsSurface")
        if not isinstance(reversed, (bool, np.bool_)):
            raise TypeError(f"reversed is {reversed!r}; expected True or False")
        self.surface = surface
        self.name = surface.name if name is None else checked_name(name)
        self.reversed = bool(reversed)

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
