"""Path: straight lines and circular arcs, one after the other without a kink.

Every line and every arc of at most a quarter turn is one rational quadratic piece. An arc through the angle a
of radius R has the weights 1, cos(a/2), 1 and, over a knot span h, the end speed 2 R sin(a/2) / h (The NURBS
Book, section 7.3), so that spans as long as the chords give speed one at every joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, cos, pi, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, extent, positive, vector

__all__ = ["Path"]

Array = NDArray[np.float64]
# Rounding of a few hundred segments is far below this, a gap that was meant is far above.
_JOINED = 1e-10


def unit(name: str, value: ArrayLike) -> Array:
    """A checked vector scaled to length one."""
    given = vector(name, value)
    length = float(np.linalg.norm(given))
    if length == 0.0:
        raise InputError(f"{name} is {given.tolist()}; expected a vector with a direction")
    return given / length


@dataclass(frozen=True, eq=False)
class Piece:
    """A line (radius None) or an arc of at most a quarter turn.

    Attributes
    ----------
    start, tangent : (3,) arrays
        First point and unit tangent there.
    length : float
        Arc length.
    toward : (3,) array
        Unit normal at the start, to the arc's center.
    radius, angle : float or None, float
        Of an arc.
    """

    start: Array
    tangent: Array
    length: float
    toward: Array | None = None
    radius: float | None = None
    angle: float = 0.0

    @property
    def span(self) -> float:
        """Knot span that gives speed one at both ends: the chord."""
        return self.length if self.radius is None else 2.0 * self.radius * sin(0.5 * self.angle)

    def turned(self, point: Array, angle: float, stretch: float = 1.0) -> Array:
        """Points (..., 3) turned about the arc's axis, and moved from it by a factor."""
        assert self.toward is not None and self.radius is not None
        axis = np.cross(self.tangent, self.toward)
        center = self.start + self.radius * self.toward
        offset = point - center
        axial = (offset @ axis)[..., None] * axis
        across = offset - axial
        moved = stretch * (cos(angle) * across + sin(angle) * np.cross(axis, across))
        return np.asarray(center + axial + moved)

    def middle(self, points: Array) -> tuple[Array, float]:
        """Middle Bezier points and their weight for points (n, 3) that are swept from the start to the end."""
        if self.radius is None:
            return points + 0.5 * self.length * self.tangent, 1.0
        half = 0.5 * self.angle
        return self.turned(points, half, 1.0 / cos(half)), cos(half)

    def end(self) -> Array:
        """Last point."""
        if self.radius is None:
            return self.start + self.length * self.tangent
        assert self.toward is not None
        chord_along = self.radius * sin(self.angle)
        chord_across = 2.0 * self.radius * sin(0.5 * self.angle) ** 2
        return np.asarray(self.start + chord_along * self.tangent + chord_across * self.toward)

    def carried(self, direction: Array) -> Array:
        """A direction (3,) at the start, carried to the end without twist."""
        if self.radius is None:
            return direction
        assert self.toward is not None
        axis = np.cross(self.tangent, self.toward)
        along = direction @ axis * axis
        across = direction - along
        result = along + cos(self.angle) * across + sin(self.angle) * np.cross(axis, across)
        return np.asarray(result / np.linalg.norm(result))


class Path:
    """A smooth path of lines and arcs in space, for `pipe`; every call returns a longer path.

    Parameters
    ----------
    start : (3,)
        First point.
    direction : (3,)
        Direction at the start, of any length.

    Examples
    --------
    A hook in the xz-plane, drawn upward and bent toward +x by half a turn:

    >>> import math
    >>> hook = Path((0, 0, 0), (0, 0, 1)).line(20.0).arc(4.0, math.pi, toward=(1, 0, 0)).line(5.0)
    >>> hook.end.round(12).tolist()
    [8.0, 0.0, 15.0]
    """

    def __init__(self, start: ArrayLike = (0.0, 0.0, 0.0), direction: ArrayLike = (0.0, 0.0, 1.0)) -> None:
        self.start: Array = vector("start", start)
        self.start_direction: Array = unit("direction", direction)
        self.pieces: tuple[Piece, ...] = ()

    def __repr__(self) -> str:
        ends = "closed" if self.closed else f"from {self.start.tolist()} to {self.end.tolist()}"
        return f"Path({len(self.pieces)} pieces, length {self.length:g}, {ends})"

    @property
    def end(self) -> Array:
        """Last point, (3,)."""
        return self.pieces[-1].end() if self.pieces else self.start

    @property
    def end_direction(self) -> Array:
        """Unit tangent at the end, (3,)."""
        return self.pieces[-1].carried(self.pieces[-1].tangent) if self.pieces else self.start_direction

    @property
    def length(self) -> float:
        """Arc length."""
        return sum(piece.length for piece in self.pieces)

    @property
    def closed(self) -> bool:
        """Whether the path ends where it starts, in the direction it starts with."""
        return bool(
            self.pieces
            and np.linalg.norm(self.end - self.start) <= _JOINED * self.length
            and np.linalg.norm(self.end_direction - self.start_direction) <= _JOINED
        )

    @property
    def smallest_radius(self) -> float:
        """Radius of the sharpest arc; infinite without arcs."""
        return min((piece.radius for piece in self.pieces if piece.radius is not None), default=float("inf"))

    def _extended(self, *pieces: Piece) -> Path:
        longer = Path(self.start, self.start_direction)
        longer.pieces = self.pieces + pieces
        return longer

    def line(self, length: float) -> Path:
        """Add a straight line.

        Raises
        ------
        ValueError
            The length is not positive.
        """
        return self._extended(Piece(self.end, self.end_direction, extent("length", length)))

    def arc(self, radius: float, angle: float, toward: ArrayLike) -> Path:
        """Add an arc of a circle.

        Parameters
        ----------
        radius : float
            Of the circle.
        angle : float
            How far to turn [rad], at most a full turn.
        toward : (3,)
            Side on which the center lies; only its part across the path counts.

        Raises
        ------
        ValueError
            An angle outside (0, 2 pi], or `toward` along the path.
        """
        radius = extent("radius", radius)
        angle = positive("angle", angle)
        if angle > 2.0 * pi * (1.0 + 1e-12):
            raise InputError(f"angle is {angle:g}; expected at most a full turn, 2 pi")
        tangent = self.end_direction
        wanted = unit("toward", toward)
        across = wanted - wanted @ tangent * tangent
        if np.linalg.norm(across) < 1e-6:
            raise InputError(f"toward is {wanted.tolist()}, along the path; expected a direction across it")
        # Taking out the tangent twice leaves a normal that is orthogonal to rounding.
        across /= np.linalg.norm(across)
        across -= across @ tangent * tangent
        across /= np.linalg.norm(across)
        # An exact quarter turn must not split for its rounding.
        count = max(1, ceil(angle / (0.5 * pi) - 1e-9))
        step = angle / count
        start, pieces = self.end, []
        for _ in range(count):
            piece = Piece(start, tangent, radius * step, across, radius, step)
            pieces.append(piece)
            start, tangent, across = piece.end(), piece.carried(tangent), piece.carried(across)
        return self._extended(*pieces)
