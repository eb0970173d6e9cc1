"""Faces of spheres whose edges pass a pole, or run free, on the same sphere about an axis that meets no edge.

A STEP file has no lines along poles: who reads it adds them, and the sides of a seam. OCCT takes the rest of the sphere
for many a face that has a pole on an edge or an edge across the seam, as it does for files that it writes itself. A
sphere may have any axis, so the one whose poles are farthest from the boundary is taken, and a seam that the boundary
crosses least. A face whose edges are circles about its own axis, and meridians that end before the poles, keeps it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.forms import Sphere
from assembly.geometry.seams.region_pieces import POLE, closed_at_poles
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.crossings import crossings
from assembly.step.laid_edges import nearness
from assembly.step.occt import occt
from assembly.step.profiles import approximated
from assembly.step.surfaces import patch

__all__ = ["Region", "region_of"]

Array = NDArray[np.float64]
TURN = 2.0 * pi
# Deviation of curves in (u, v), over the radius: a tenth of that of edges, which are followed along these.
_FOLLOWED = 1e-11
# Directions among which the axis is chosen, and places of a stretch of the boundary that they are compared with.
_DIRECTIONS, _PLACES = 400, 33
# Angles that differ by less are one.
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Region:
    """A surface and the boundary of a face on it, material on the left of its curves, in chains."""

    surface: NurbsSurface
    boundary: tuple[NurbsCurve, ...]
    chains: tuple[range, ...]


def region_of(face: Face | Region) -> Region:
    """What a face is written as: itself, but a sphere's about another axis where its own is in the way.

    Raises
    ------
    Uncut
        The boundary is open.
    Unreadable
        A curve bends too sharply to be followed.
    """
    surface = face.surface
    own = Region(surface, face.boundary, face.chains)
    if not (surface._pole_bits and face.boundary):
        return own
    form = elementary_form(surface)
    if not isinstance(form, Sphere):
        return own
    loops = closed_at_poles([[face.boundary[k] for k in chain] for chain in face.chains], surface)
    if all(piece.kind != POLE and _is_level(piece.curve) for loop in loops for piece in loop):
        return own
    return _Turned(surface, form, [[piece.curve for piece in loop if piece.kind != POLE] for loop in loops]).region()


def _is_level(curve: NurbsCurve) -> bool:
    """Whether u or v is constant along a curve."""
    return bool((np.ptp(curve.control_points, axis=0) == 0.0).any())


class _Turned:
    """A sphere about another axis, and loops on it that are given on the sphere about its own."""

    def __init__(self, surface: NurbsSurface, form: Sphere, loops: list[list[NurbsCurve]]) -> None:
        self.given, self.form, self.loops = surface, form, loops
        rows = [
            np.concatenate([self.directions(curve, sampled(curve.breaks(), _PLACES))[:-1] for curve in loop])
            for loop in loops
        ]
        corners = np.array([self.directions(curve, np.array(curve.domain[:1]))[0] for loop in loops for curve in loop])
        self.z = _clear_axis(np.concatenate(rows))
        self.x = _clear_side(rows, corners, self.z)
        self.y = np.cross(self.z, self.x) * (1.0 if form.outward else -1.0)
        o = occt()
        place = o.gp_Ax3(o.gp_Pnt(*form.center.tolist()), o.gp_Dir(*self.z.tolist()), o.gp_Dir(*self.x.tolist()))
        if not form.outward:
            place.YReverse()
        self.patch = patch(o.Geom_SphericalSurface(place, form.radius), (0.0, TURN, -0.5 * pi, 0.5 * pi))

    def directions(self, curve: NurbsCurve, t: Array) -> Array:
        """Unit vectors (n, 3) from the center to places of a curve."""
        uv = curve.evaluate(t)
        for axis, (low, high) in enumerate(self.given.domain):
            # Off an open domain by rounding.
            uv[:, axis] = uv[:, axis] if self.given.closed[axis] else np.clip(uv[:, axis], low, high)
        out = self.given.evaluate(*uv.T) - self.form.center
        return np.asarray(out / np.linalg.norm(out, axis=1)[:, None])

    def heading(self, out: Array) -> Array:
        """Angles of vectors about the axis."""
        return np.asarray(np.arctan2(out @ self.y, out @ self.x))

    def curve(self, curve: NurbsCurve) -> NurbsCurve:
        """A curve in the (u, v) of the turned sphere."""
        breaks = curve.breaks()
        at = sampled(breaks, _PLACES)
        table = np.unwrap(self.heading(self.directions(curve, at)))

        def angles(t: Array) -> Array:
            out = self.directions(curve, t)
            near, found = np.interp(t, at, table), self.heading(out)
            up = out @ self.z
            across = np.hypot(out @ self.x, out @ self.y)
            return np.column_stack([found + TURN * np.round((near - found) / TURN), np.arctan2(up, across)])

        def mapped(t: Array) -> Array:
            there = angles(t)
            return np.column_stack([self.patch.u(there[:, 0]), self.patch.v(there[:, 1])])

        # Ours is smooth between knots of the curve and lines of knots of either surface.
        values = angles(at)
        lines = [along.joints(*_ends(row)) for along, row in zip((self.patch.u, self.patch.v), values.T, strict=True)]
        cuts = [breaks, crossings(values, at, angles, lines)]
        values = curve.evaluate(at)
        cuts.append(crossings(values, at, curve.evaluate, self._given_lines(values)))
        low, high = curve.domain
        joints = np.unique(np.clip(np.concatenate(cuts), low, high))
        joints = np.append(joints[:-1][np.diff(joints) > _SAME * (high - low)], high)
        joints[0] = low
        made, _ = approximated(mapped, joints, nearness(_FOLLOWED * self.form.radius, self.given))
        points, _ = made.cartesian
        return NurbsCurve(points, made.knots, made.degree, name=curve.name)

    def _given_lines(self, values: Array) -> list[Array]:
        """Knots of the given surface, those of u and v, on all the turns on which values are."""
        rows = []
        for knots, period, row in zip(self.given.breaks(), self.given._periods, values.T, strict=True):
            if period:
                first, last = np.floor((np.array(_ends(row)) - knots[0]) / period)
                knots = np.unique(knots + period * np.arange(first, last + 1.0)[:, None])
            rows.append(knots)
        return rows

    def region(self) -> Region:
        """The loops on the turned sphere."""
        boundary: list[NurbsCurve] = []
        chains = []
        for loop in self.loops:
            chains.append(range(len(boundary), len(boundary) + len(loop)))
            boundary += self._joined([self.curve(curve) for curve in loop])
        return Region(self.patch.surface, tuple(boundary), tuple(chains))

    def _joined(self, curves: list[NurbsCurve]) -> list[NurbsCurve]:
        """Curves each moved by whole turns to where the one before it ends, the last to where the first begins."""
        period = self.patch.periods[0]
        rows = [curve.control_points.copy() for curve in curves]
        for before, row in zip(rows, rows[1:], strict=False):
            row[:, 0] += period * np.round((before[-1, 0] - row[0, 0]) / period)
            row[0] = before[-1]
        rows[-1][-1] = rows[0][0] + [period * np.round((rows[-1][-1, 0] - rows[0][0, 0]) / period), 0.0]
        return [
            NurbsCurve(row, curve.knots, curve.degree, name=curve.name) for row, curve in zip(rows, curves, strict=True)
        ]


def _ends(row: Array) -> tuple[float, float]:
    return float(row.min()), float(row.max())


def _clear_axis(rows: Array) -> Array:
    """The direction that is farthest from others, and its opposite as well: among some that are spread evenly."""
    k = np.arange(_DIRECTIONS) + 0.5
    up, angle = k / _DIRECTIONS, k * pi * (1.0 + sqrt(5.0))
    out = np.sqrt(1.0 - up * up)
    every = np.column_stack([out * np.cos(angle), out * np.sin(angle), up])
    return np.asarray(every[int(np.argmin(np.abs(rows @ every.T).max(axis=0)))])


def _clear_side(loops: list[Array], corners: Array, z: Array) -> Array:
    """A direction at right angles to an axis, on whose side a seam crosses loops least.

    That is the middle of the widest gap between loops that do not go round the axis. One that does is crossed in a
    corner.
    """
    across = np.linalg.svd(z[None])[2][1:]
    rows = [np.arctan2(*(across[::-1] @ loop.T)) for loop in loops]
    turns = [_short(np.diff(np.append(row, row[0]))).sum() for row in rows]
    if max(map(abs, turns)) > pi:
        each = np.arctan2(*(across[::-1] @ corners.T)).tolist()
        angle = each[int(np.argmin([sum(_crossed(row, one) for row in rows) for one in each]))]
    else:
        every = np.sort(np.concatenate(rows))
        gaps = np.diff(np.append(every, every[0] + TURN))
        angle = float((every + 0.5 * gaps)[int(np.argmax(gaps))])
    return np.asarray(np.cos(angle) * across[0] + np.sin(angle) * across[1])


def _short(angles: Array) -> Array:
    """Angles within half a turn."""
    return np.asarray(angles - TURN * np.round(angles / TURN))


def _crossed(row: Array, angle: float) -> int:
    """How often a loop goes by an angle, away from the place where it is at it."""
    off = _short(np.append(row, row[0]) - angle)
    off[np.abs(off) < _SAME] = 0.0
    return int(np.count_nonzero((off[:-1] * off[1:] < 0.0) & (np.abs(off[:-1]) < 0.5 * pi)))
