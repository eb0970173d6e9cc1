"""A contact manifold: the few places where two conforming faces are nearest, and a bound of the gap between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly._record import place_of
from assembly.proximity.manifolds.records import ROW

__all__ = ["NORMAL", "Manifold"]

Array = NDArray[np.float64]
# Columns of `ROW` records: slices of arrays take a tenth of the time of fields of NumPy's records.
NORMAL, PLACE = (slice(place_of(ROW, name), place_of(ROW, name) + 3) for name in ("normal", "place"))
GAP, KINDS = place_of(ROW, "gap"), slice(place_of(ROW, "kind"), place_of(ROW, "second") + 1)


@dataclass(frozen=True, eq=False)
class Manifold(ReadOnlyArrays):
    """Rows of a pair of faces, in the axes of the first body.

    Attributes
    ----------
    normals : (m, 3)
        From the first body to the second. Where the second one is moved by a twist, a velocity v of what is at the
        origin and a turn w about that, a gap changes at the rate normal.(v + w x place).
    places : (m, 3)
        Points of the second face.
    gaps : (m,)
        Negative where the second face is within the first body.
    bound : float
        No gap of the whole pair is less; of what is round on a plane, none along its line.
    kinds : (m, 3)
        What each row is of: `kind`, `first` and `second` of `ROW` (`records.py`), in the order of those who found it.
    """

    normals: Array
    places: Array
    gaps: Array
    bound: float
    kinds: Array

    @classmethod
    def of_rows(cls, rows: Array, bound: float) -> Manifold:
        """That of `ROW` records, one a row, which are copied."""
        return cls(rows[:, NORMAL].copy(), rows[:, PLACE].copy(), rows[:, GAP].copy(), bound, rows[:, KINDS].copy())

    def rates(self) -> Array:
        """How gaps change by twists (v, w) of the second body: (m, 6)."""
        return np.hstack([self.normals, np.cross(self.places, self.normals)])

    def turned(self, turn: Array, shift: Array) -> Manifold:
        """The same with the bodies exchanged, where the first one is at x -> turn x + shift seen from the second."""
        normals, places = -self.normals @ turn.T, self.places @ turn.T + shift
        return Manifold(normals, places, self.gaps.copy(), self.bound, self.kinds)
