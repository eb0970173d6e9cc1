"""Directed curves in (u, v) that go round a region, with what STEP wants and the boundary of a face leaves out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.errors import AssemblyError
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["EDGE", "POLE", "SEAM", "Piece", "Uncut", "begun_at_pole", "closed_at_poles", "segment", "shifted"]

Array = NDArray[np.float64]
EDGE, SEAM, POLE = "edge", "seam", "pole"
# Parts of a period, or of the domain, within which a point is on a seam or at a pole.
NEAR = 1e-9


class Uncut(AssemblyError):
    """A boundary that does not enclose a region."""


@dataclass(eq=False)
class Piece:
    """A directed curve in (u, v) with the material on its left, and what it is: EDGE, SEAM or POLE."""

    curve: NurbsCurve
    kind: str
    next: Piece | None = None

    @property
    def ends(self) -> Array:
        """First and last point (2, 2)."""
        return self.curve.control_points[[0, -1]]


def segment(a: Array, b: Array) -> NurbsCurve:
    """The straight line from a to b over [0, 1]."""
    return NurbsCurve([a, b], [0.0, 0.0, 1.0, 1.0], 1)


def shifted(piece: Piece, by: Array) -> None:
    """Move a piece by a vector of (u, v)."""
    old = piece.curve
    piece.curve = NurbsCurve(old.control_points + by, old.knots, old.degree, old.weights, name=old.name)


def _along_pole(point: Array, surface: NurbsSurface) -> tuple[int, int, float] | None:
    """The pole that a boundary ends at: its side (0, 1, 2, 3: low u, high u, low v, high v), the direction along it
    (0: u, 1: v), and the sign of that direction with the material to the left.
    """
    for side in range(4):
        axis, end = divmod(side, 2)
        low, high = surface.domain[axis]
        if surface._pole_bits & (1 << side) and abs(point[axis] - (low, high)[end]) <= NEAR * (high - low):
            return side, 1 - axis, 1.0 if side in (1, 2) else -1.0
    return None


def closed_at_poles(chains: list[list[NurbsCurve]], surface: NurbsSurface) -> list[list[Piece]]:
    """Chains with the edges at poles, which the boundary of a face leaves out.

    A boundary that ends at a pole goes on along it, with the material to the left, to the next one that begins there.
    """
    sides = [high - low for low, high in surface.domain]
    around = surface._periods
    size = max(sides)
    done: list[list[Piece]] = []
    broken: list[list[Piece]] = []
    for chain in chains:
        row = [Piece(curve, EDGE) for curve in chain]
        gap = row[0].ends[0] - row[-1].ends[1]
        whole = [round(g / t) * t if t else 0.0 for g, t in zip(gap, around, strict=True)]
        (done if np.abs(gap - whole).max() <= NEAR * size else broken).append(row)
    while broken:
        row = broken.pop()
        while True:
            end = row[-1].ends[1]
            pole = _along_pole(end, surface)
            if pole is None:
                raise Uncut("its boundary is open")
            side, along, sign = pole
            period = around[along]
            found: list[tuple[float, int, list[Piece]]] = []
            for other in (row, *broken):
                start = other[0].ends[0]
                there = _along_pole(start, surface)
                way = sign * float(start[along] - end[along])
                if period:
                    way %= period
                if there is not None and there[0] == side and way >= 0.0:
                    found.append((way, len(found), other))
            if not found:
                raise Uncut("its boundary is open at a pole")
            way, _, other = min(found)
            corner = end.copy()
            corner[along] += sign * way
            row.append(Piece(segment(end, corner), POLE))
            if other is row:
                break
            broken = [each for each in broken if each is not other]
            row += other
        done.append(row)
    return done


def begun_at_pole(chain: list[Piece], surface: NurbsSurface) -> list[Piece]:
    """A closed chain that begins where it is nearest to a pole, after what runs along that."""
    far = np.full(len(chain), np.inf)
    for side in range(4):
        axis, end = divmod(side, 2)
        if surface._pole_bits & (1 << side):
            starts = np.array([piece.ends[0, axis] for piece in chain])
            far = np.minimum(far, np.abs(starts - surface.domain[axis][end]))
    # What runs along a pole is as near to it at its start.
    far[[piece.kind == POLE for piece in chain]] = np.inf
    first = int(np.argmin(far))
    return chain[first:] + chain[:first]
