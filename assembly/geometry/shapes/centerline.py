"""Centerlines (spines) of round wires, found from their surfaces.

A pipe surface is the envelope of balls of one radius r along a curve, its spine:

    S(u, v) = c(u) + r (cos phi(v) N(u) + sin phi(v) t(u) x N(u)),

N across the tangent t and carried along without twist.

Where the spine is made of lines and arcs, spans of u are pieces of it, spans of v equal parts of the circle, and both
are run through as quadratic arcs are,

    angle = A / 2 + 2 arctan(x tan(A / 4)),   x from -1 to 1 over the span,

which is a straight line where A = 0. Half balls close the ends, one more span of u each. Whether a surface is one is
decided by comparing both sides at more points of every span than two rational functions of their degrees can share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Spine", "spine_of"]

Array = NDArray[np.float64]
# A surface is a wire's where it differs by less, in parts of its size; pieces bent by less over it are straight.
SAME, STRAIGHT = 1e-12, 1e-9
# A wire's radius over that of an arc of its spine, at most; the longest arc of one span.
THICKEST, LONGEST = 0.999, 3.0
# A quarter of a circle.
QUARTER = 0.5 * np.pi


@dataclass(frozen=True, eq=False)
class Spine:
    """The center line of a round wire, n pieces one behind the other, each a line or an arc.

    Attributes
    ----------
    along : int
        0 if u runs along the wire, 1 if v does.
    closed : bool
        Whether it comes back to where it starts; else half balls are its ends.
    sense : float
        1 if the other parameter turns about the tangent counterclockwise, -1 if clockwise.
    radius : float
        Of the wire.
    start, tangent, normal : (n, 3)
        Of a piece where it starts: point, direction, and direction to the arc's center (lines: any across).
    curvature, length : (n,)
    turn : (n,)
        From the normal about the tangent to where the other parameter starts.
    """

    along: int
    closed: bool
    sense: float
    radius: float
    start: Array
    tangent: Array
    normal: Array
    curvature: Array
    length: Array
    turn: Array

    def frames(self, piece: int, at: Array) -> tuple[Array, Array, Array]:
        """Points, tangents and normals, (m, 3) each, of a piece at lengths (m,) along it."""
        angle = (self.curvature[piece] * at)[:, None]
        t, n, bend = self.tangent[piece], self.normal[piece], self.curvature[piece]
        way = at[:, None] * t
        if bend > 0.0:
            way = (np.sin(angle) * t + 2.0 * np.sin(0.5 * angle) ** 2 * n) / bend
        return self.start[piece] + way, np.cos(angle) * t + np.sin(angle) * n, np.cos(angle) * n - np.sin(angle) * t

    def begins(self, piece: int, tangents: Array, normals: Array) -> Array:
        """Unit vectors (m, 3) to where the other parameter starts."""
        turn = self.turn[piece]
        return np.asarray(np.cos(turn) * normals + np.sin(turn) * np.cross(tangents, normals))


@lru_cache(maxsize=256)
def spine_of(face: Face) -> Spine | None:
    """The spine of a face that is a whole round wire of lines and arcs, or None."""
    if not any(face.surface.closed) or face.outer is not None or face.holes:
        return None
    for along, surface in enumerate((face.surface, face.surface.transposed())):
        spine = _Candidate(surface, along).spine()
        if spine is not None and _is_outward(face, spine, surface):
            return spine
    return None


class _Piece(NamedTuple):
    """The piece of a spine over a span of u: its start, what it is there, its length and the wire's radius."""

    start: Array
    tangent: Array
    normal: Array
    curvature: float
    length: float
    radius: float


class _Candidate:
    """A surface whose u may run along a wire."""

    def __init__(self, surface: NurbsSurface, along: int) -> None:
        self.surface = surface
        self.along = along
        self.at_u, self.at_v = surface.breaks()
        self.within = SAME * surface.size

    def spine(self) -> Spine | None:
        """The spine, if it is one."""
        surface = self.surface
        closed_u, closed_v = surface.closed
        poles = surface._pole_bits
        is_capped = poles == 3 and not closed_u
        spans = len(self.at_u) - 1 - 2 * is_capped
        if not closed_v or not (is_capped or (closed_u and poles == 0)) or spans < 1 or len(self.at_v) < 3:
            return None
        first = int(is_capped)
        rows = [self._piece(k) for k in range(first, first + spans)]
        if any(row is None for row in rows):
            return None
        start, tangent, normal, curvature, length, radii = (
            np.array(column) for column in zip(*(row for row in rows if row is not None), strict=True)
        )
        if np.ptp(radii) > self.within or radii.max() * curvature.max() > THICKEST:
            return None
        begin = surface.evaluate(self.at_u[first : first + spans], self.at_v[0]) - start
        turn = np.arctan2((begin * np.cross(tangent, normal)).sum(axis=1), (begin * normal).sum(axis=1))
        ahead = surface.evaluate(self.at_u[first], self.at_v[0] + 0.1 * (self.at_v[1] - self.at_v[0])) - start[0]
        sense = 1.0 if np.cross(begin[0], ahead) @ tangent[0] > 0.0 else -1.0
        radius = float(radii.mean())
        spine = Spine(self.along, not is_capped, sense, radius, start, tangent, normal, curvature, length, turn)
        fits = all(self._fits(spine, k, first + k) for k in range(spans)) and self._is_smooth(spine)
        if fits and is_capped:
            fits = self._is_ball(spine, 0, 0, -1.0) and self._is_ball(spine, spans - 1, spans + 1, 1.0)
        return spine if fits else None

    def _center(self, u: float) -> tuple[Array, float]:
        """Center and radius of the circle through three points of the surface at u."""
        low, high = self.at_v[0], self.at_v[-1]
        a, b, c = self.surface.evaluate(u, low + np.array([0.1, 0.4, 0.75]) * (high - low))
        p, q = b - a, c - a
        normal = np.cross(p, q)
        square = normal @ normal
        if not square > 0.0:
            return a, 0.0
        center = a + np.cross((p @ p) * q - (q @ q) * p, normal) / (2.0 * square)
        return center, float(np.linalg.norm(a - center))

    def _piece(self, k: int) -> _Piece | None:
        """The piece over a span of u, if it is a line or an arc."""
        low, high = self.at_u[k], self.at_u[k + 1]
        (a, radius), (b, _), (c, _) = (self._center(u) for u in (low, 0.5 * (low + high), high))
        chord = c - a
        length = float(np.linalg.norm(chord))
        if not (length > 0.0 and radius > 0.0):
            return None
        off = b - 0.5 * (a + c)
        rise = float(np.linalg.norm(off))
        if rise <= max(STRAIGHT * length, self.within):
            tangent = chord / length
            across = self.surface.evaluate(low, self.at_v[0]) - a
            across = across - across @ tangent * tangent
            wide = float(np.linalg.norm(across))
            return _Piece(a, tangent, across / wide, 0.0, length, radius) if wide > 0.0 else None
        # An arc: its middle is above that of the chord.
        bend = 8.0 * rise / (length * length + 4.0 * rise * rise)
        half = 2.0 * np.arctan2(2.0 * rise, length)
        if 2.0 * half > LONGEST:
            return None
        ahead, up = chord / length, -off / rise
        tangent = np.cos(half) * ahead - np.sin(half) * up
        normal = np.sin(half) * ahead + np.cos(half) * up
        return _Piece(a, tangent, normal, bend, 2.0 * half / bend, radius)

    def _fits(self, spine: Spine, piece: int, span: int) -> bool:
        """Whether the surface over a span of u is the wire around a piece."""
        x, y = _nodes(self.surface.degree[0]), _nodes(self.surface.degree[1])
        angle = spine.curvature[piece] * spine.length[piece]
        at = _angle(x, angle) / spine.curvature[piece] if angle > 0.0 else 0.5 * (1.0 + x) * spine.length[piece]
        points, tangents, normals = spine.frames(piece, at)
        begins = spine.begins(piece, tangents, normals)
        expected = points[:, None] + spine.radius * self._around(spine, tangents, begins, y)
        return self._is(expected, span, x, y)

    def _is_ball(self, spine: Spine, piece: int, span: int, side: float) -> bool:
        """Whether the surface over a span of u is a half ball at the end of a piece."""
        x, y = _nodes(self.surface.degree[0]), _nodes(self.surface.degree[1])
        points, tangents, normals = spine.frames(piece, np.array([0.0 if side < 0.0 else spine.length[piece]]))
        ring = self._around(spine, tangents, spine.begins(piece, tangents, normals), y)
        # From the pole at the start to the ring, or from the ring to the pole at the end.
        angle = _angle(x, QUARTER)[:, None, None] - (QUARTER if side < 0.0 else 0.0)
        return self._is(points + spine.radius * (np.cos(angle) * ring + np.sin(angle) * tangents[0]), span, x, y)

    def _around(self, spine: Spine, tangents: Array, begins: Array, y: Array) -> Array:
        """Unit vectors (m, spans of v * nodes, 3) across the tangents."""
        count = len(self.at_v) - 1
        part = 2.0 * np.pi / count
        phi = (part * np.arange(count)[:, None] + _angle(y, part)).ravel()[:, None]
        across = spine.sense * np.cross(tangents, begins)
        return np.asarray(np.cos(phi) * begins[:, None] + np.sin(phi) * across[:, None])

    def _is(self, expected: Array, span: int, x: Array, y: Array) -> bool:
        """Whether the surface has these points (m, spans of v * nodes, 3) at nodes of a span of u."""
        low, high = self.at_u[span], self.at_u[span + 1]
        u = 0.5 * (low + high) + 0.5 * (high - low) * x
        v = 0.5 * (self.at_v[:-1] + self.at_v[1:])[:, None] + 0.5 * np.diff(self.at_v)[:, None] * y
        off = self.surface.evaluate(u[:, None], v.ravel()) - expected
        return bool(np.abs(off).max() <= self.within)

    def _is_smooth(self, spine: Spine) -> bool:
        """Whether every piece begins where and as the one before ends."""
        count = len(spine.length)
        for k in range(count if spine.closed else count - 1):
            points, tangents, _ = spine.frames(k, spine.length[k : k + 1])
            after = (k + 1) % count
            if np.abs(points[0] - spine.start[after]).max() > self.within:
                return False
            if np.abs(tangents[0] - spine.tangent[after]).max() > STRAIGHT:
                return False
        return True


def _nodes(degree: int) -> Array:
    """More points of a span than two rational functions of this degree, and of two, can share."""
    count = degree + 4
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def _angle(x: Array, whole: float) -> Array:
    """Angles along a quadratic arc through `whole` at x from -1 to 1."""
    return np.asarray(0.5 * whole + 2.0 * np.arctan(x * np.tan(0.25 * whole)))


def _is_outward(face: Face, spine: Spine, surface: NurbsSurface) -> bool:
    """Whether the face's outward normal leads away from the spine."""
    first = 0 if spine.closed else 1
    u, v = surface.breaks()[0][first], surface.domain[1][0]
    out = surface.evaluate(u, v) - spine.start[0]
    normal = surface.normal(u, v)
    # The transposed surface has the other normal.
    return bool((normal @ out > 0.0) != (face.reversed != (spine.along == 1)))
