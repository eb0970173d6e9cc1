"""Every nearest point of round wires, by closed forms: what contacts and clearances are judged by.

A wire is what is within r of a center line of straight lines and arcs; its free ends are half balls. Where D is the
distance of two center lines, the surfaces are D - r_f - r_g apart, and every pair of surface points that face each
other, outward normals opposed, belongs to a critical point of D(s, t)^2 (as do the far sides of both, -D - r_f - r_g
apart, which are no contact). These are found, all of them, from polynomials: the nearest and the farthest point of a
circle are known, so that along another circle t the critical ones are among the roots of

    F(t) = (r.r')^2 rho^2 - R^2 (x x' + y y')^2,     r = (x, y, z) in the circle's frame, rho^2 = x^2 + y^2,

a trigonometric polynomial of degree 4 (along a line: a quartic); each is polished by Newton's method in (s, t).

The sum of (-1)^index over all of them is the Euler characteristic of the pairs (s, t): 0 where a wire is closed, else
1 (Morse; an end counts where D grows from it inward, which is where the half ball is met). One missed or doubled
breaks the sum: the search proves itself. Nothing here knows of the library's kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from benchmarks.center_lines import Wire, linking_number

__all__ = ["Extrema", "WireOracle"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Two critical points nearer than this, in sizes of the scene, are one; ends of pieces reach that far too.
SAME = 1e-8
# How far from the unit circle, or from real, roots may be to be polished: what is no root is thrown out afterwards.
NEAR_ROOT = 1e-2
# A point that near to the axis of a circle, in radii, is polished as if it was on it too.
NEAR_AXIS = 1e-3


@dataclass(frozen=True, eq=False)
class Extrema:
    """Critical points of the distances of center lines.

    Attributes
    ----------
    bodies : (n, 2)
    centers, points : (n, 2, 3)
        On the center lines, and on the surfaces.
    gap : (n,)
        Between the surfaces.
    index : (n,)
        How many ways lead downward: 0 for a minimum.
    curvature : (n,)
        The eigenvalue of least size of the Hessian of D^2 / 2 over arc lengths; 1 where two ends meet.
    """

    bodies: Table
    centers: Array
    points: Array
    gap: Array
    index: Table
    curvature: Array

    def take(self, rows: Any) -> Extrema:
        """Some of them."""
        return Extrema(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


class WireOracle:
    """Wires, one a body, in the order of the rows of `q`."""

    def __init__(self, wires: Sequence[Wire]) -> None:
        self.wires = list(wires)
        self.pairs = list(combinations(range(len(self.wires)), 2))
        self.radius = np.array([wire.radius for wire in self.wires])
        self._body = _owners([wire.bend.size for wire in self.wires])
        self._start, self._axes, self._bend, self._length = (
            np.concatenate([getattr(wire, name) for wire in self.wires]) for name in ("start", "axes", "bend", "length")
        )
        self._end_body = _owners([len(wire.ends[0]) for wire in self.wires])
        self._end, self._out = (np.concatenate([wire.ends[k] for wire in self.wires]) for k in range(2))
        self._size = max(float(wire.length.sum()) + wire.radius for wire in self.wires)
        # All pairs of pieces of different bodies, the bend with the smaller number first.
        a, b = np.triu_indices(self._bend.size, 1)
        apart = self._body[a] != self._body[b]
        self._piece_pairs = np.stack([a[apart], b[apart]], axis=1)
        e, k = np.indices((self._end_body.size, self._bend.size)).reshape(2, -1)
        self._end_pairs = np.stack([e, k], axis=1)[self._end_body[e] != self._body[k]]
        a, b = np.triu_indices(self._end_body.size, 1)
        self._corner_pairs = np.stack([a, b], axis=1)[self._end_body[a] != self._end_body[b]]

    def extrema(self, q: ArrayLike) -> Extrema:
        """All critical points, whatever their distance; those of a continuum are some of it.

        Raises
        ------
        ArithmeticError
            The sum of (-1)^index of two bodies is not what it must be: something is missed, or degenerate.
        """
        found = self._extrema(_Posed(self, q))
        sums = np.zeros((len(self.wires), len(self.wires)), dtype=int)
        np.add.at(sums, (found.bodies[:, 0], found.bodies[:, 1]), 1 - 2 * (found.index % 2))
        for i, j in self.pairs:
            expected = int(all(len(self.wires[k].ends[0]) for k in (i, j)))
            if sums[i, j] != expected:
                raise ArithmeticError(f"wires {i} and {j} have the sum {sums[i, j]}; expected {expected}")
        return found

    def minima(self, q: ArrayLike, reach: float = np.inf) -> Extrema:
        """Proper contacts: isolated minima with a gap of at most `reach`, the deepest first."""
        found = self.extrema(q)
        order = np.argsort(found.gap, kind="stable")
        return found.take(order[(found.index[order] == 0) & (found.gap[order] <= reach)])

    def gaps(self, q: ArrayLike) -> Array:
        """The least gap of each of `pairs`; parallel and concentric pieces count as well."""
        posed = _Posed(self, q)
        found = self._extrema(posed)
        least = np.full((len(self.wires), len(self.wires)), np.inf)
        np.minimum.at(least, (found.bodies[:, 0], found.bodies[:, 1]), found.gap)
        # The least value over two pieces is at a critical point, or on their border; a continuum ends there too.
        for bodies, distance in posed.borders():
            pair = np.sort(bodies, axis=1)
            np.minimum.at(least, (pair[:, 0], pair[:, 1]), distance - self.radius[pair].sum(axis=1))
        return np.array([least[i, j] for i, j in self.pairs])

    def deepest(self, q: ArrayLike) -> float:
        """The least gap of all: negative where something crosses."""
        return float(self.gaps(q).min(initial=np.inf))

    def links(self, q: ArrayLike) -> Table:
        """Linking numbers of `pairs`; 0 where a wire has ends.

        They hold for the wires as long as no center line comes nearer to another than a tenth of its radius.
        """
        posed = _Posed(self, q)
        polygons = [posed.polygon(k) if not len(wire.ends[0]) else None for k, wire in enumerate(self.wires)]
        numbers = []
        for i, j in self.pairs:
            a, b = polygons[i], polygons[j]
            numbers.append(0 if a is None or b is None else linking_number(a, b))
        return np.array(numbers)

    def _extrema(self, posed: _Posed) -> Extrema:
        parts = [posed.between_pieces(), posed.at_ends(), posed.corners()]
        bodies, centers, index, curvature = (np.concatenate([part[k] for part in parts]) for k in range(4))
        flipped = bodies[:, 0] > bodies[:, 1]
        bodies[flipped], centers[flipped] = bodies[flipped, ::-1], centers[flipped, ::-1]
        keep = _distinct(bodies, centers, SAME * self._size * 10.0)
        bodies, centers, index, curvature = bodies[keep], centers[keep], index[keep], curvature[keep]
        across = centers[:, 1] - centers[:, 0]
        distance = np.linalg.norm(across, axis=1)
        normal = across / np.where(distance > 0.0, distance, 1.0)[:, None]
        radii = self.radius[bodies]
        points = centers + np.stack([radii[:, :1] * normal, -radii[:, 1:] * normal], axis=1)
        return Extrema(bodies, centers, points, distance - radii.sum(axis=1), index, curvature)


Part = tuple[Table, Array, Table, Array]


class _Posed:
    """The pieces of all wires in the world."""

    def __init__(self, oracle: WireOracle, q: ArrayLike) -> None:
        rows = np.asarray(q, dtype=float)
        if rows.shape != (len(oracle.wires), 7):
            raise ValueError(f"q has the shape {rows.shape}; expected {(len(oracle.wires), 7)}")
        turn, shift = Rotation.from_quat(rows[:, 3:], scalar_first=True).as_matrix(), rows[:, :3]
        body, end_body = oracle._body, oracle._end_body
        self.oracle = oracle
        self.size = oracle._size
        self.bend, self.length = oracle._bend, oracle._length
        self.start = np.einsum("nij,nj->ni", turn[body], oracle._start) + shift[body]
        self.axes = np.einsum("nij,nkj->nki", turn[body], oracle._axes)
        self.end = np.einsum("nij,nj->ni", turn[end_body], oracle._end) + shift[end_body]
        self.out = np.einsum("nij,nj->ni", turn[end_body], oracle._out)

    def at(self, piece: Table, s: Array) -> tuple[Array, Array, Array]:
        """Point, tangent and curvature vector of pieces at arc lengths, (n, 3) each."""
        start, (e, f, _), bend = self.start[piece], np.moveaxis(self.axes[piece], 1, 0), self.bend[piece]
        arc = (bend > 0.0)[:, None]
        angle = s / np.where(bend > 0.0, bend, 1.0)
        c, i, r = np.cos(angle)[:, None], np.sin(angle)[:, None], bend[:, None]
        radial = c * e + i * f
        point = start + np.where(arc, r * radial, s[:, None] * e)
        return point, np.where(arc, c * f - i * e, e), np.where(arc, -radial / np.where(arc, r, 1.0), 0.0)

    def polygon(self, body: int) -> Array:
        """Corners (n, 3) on a closed center line, nowhere farther from it than a twentieth of the wire's radius."""
        corners = []
        for piece in np.flatnonzero(self.oracle._body == body):
            # Of an arc of length l a polygon of n sides is l^2 / (8 R n^2) away.
            bend, length = self.bend[piece], self.length[piece]
            away = length**2 / (8.0 * bend) if bend > 0.0 else 0.0
            count = max(3, int(np.ceil(np.sqrt(away / (0.05 * self.oracle.radius[body])))))
            s = np.linspace(0.0, length, count, endpoint=False)
            corners.append(self.at(np.full(count, piece), s)[0])
        return np.concatenate(corners)

    def within(self, piece: Table, s: Array, margin: float) -> tuple[Array, Mask]:
        """Arc lengths wrapped into the piece where it is an arc, and whether they are on it."""
        full = 2.0 * np.pi * self.bend[piece]
        turns = np.floor((s + margin) / np.where(full > 0.0, full, np.inf))
        s = s - np.where(full > 0.0, turns * full, 0.0)
        return s, (s >= -margin) & (s <= self.length[piece] + margin)

    def foot(self, piece: Table, point: Array) -> Array:
        """Arc length of the nearest point of whole lines and circles."""
        local = np.einsum("nki,ni->nk", self.axes[piece], point - self.start[piece])
        bend = self.bend[piece]
        return np.asarray(np.where(bend > 0.0, bend * np.arctan2(local[:, 1], local[:, 0]), local[:, 0]))

    def between_pieces(self) -> Part:
        """Critical points inside of two pieces."""
        pairs = self.oracle._piece_pairs
        arcs = (self.bend[pairs] > 0.0).sum(axis=1)
        # A line is second where it meets an arc.
        pairs = np.where((self.bend[pairs[:, :1]] == 0.0) & (arcs[:, None] == 1), pairs[:, ::-1], pairs)
        starts = [
            _lines(self, pairs[arcs == 0]),
            _line_roots(self, pairs[arcs == 1]),
            _circle_roots(self, pairs[arcs == 2]),
        ]
        pair, s, t = (np.concatenate([start[k] for start in starts]) for k in range(3))
        margin = 1e-3 * self.size
        s, on_f = self.within(pair[:, 0], s, margin)
        t, on_g = self.within(pair[:, 1], t, margin)
        keep = on_f & on_g
        return self._polished(pair[keep], s[keep], t[keep])

    def _polished(self, pair: Table, s: Array, t: Array) -> Part:
        for _ in range(12):
            gradient, hessian, _ = self._derivatives(pair, s, t)
            # Newton's step, none along which a continuum runs.
            values, vectors = np.linalg.eigh(hessian)
            steep = np.abs(values) > 1e-13 * np.abs(values).max(axis=1, keepdims=True)
            along = np.einsum("nik,ni->nk", vectors, gradient) * steep / np.where(steep, values, 1.0)
            step = -np.einsum("nik,nk->ni", vectors, along)
            s, t = s + step[:, 0], t + step[:, 1]
        s, on_f = self.within(pair[:, 0], s, SAME * self.size)
        t, on_g = self.within(pair[:, 1], t, SAME * self.size)
        gradient, hessian, centers = self._derivatives(pair, s, t)
        keep = on_f & on_g & (np.abs(gradient).max(axis=1, initial=0.0) < 1e-11 * self.size)
        eigenvalues = np.linalg.eigvalsh(hessian[keep])
        index = (eigenvalues < 0.0).sum(axis=1)
        least = np.take_along_axis(eigenvalues, np.abs(eigenvalues).argmin(axis=1)[:, None], 1)[:, 0]
        return self.oracle._body[pair[keep]], centers[keep], index, least

    def _derivatives(self, pair: Table, s: Array, t: Array) -> tuple[Array, Array, Array]:
        """Gradient and Hessian of D^2 / 2, and the two points."""
        p, dp, ddp = self.at(pair[:, 0], s)
        r, dr, ddr = self.at(pair[:, 1], t)
        d = p - r
        gradient = np.stack([(d * dp).sum(1), -(d * dr).sum(1)], axis=1)
        mixed = -(dp * dr).sum(1)
        hessian = np.stack([1.0 + (d * ddp).sum(1), mixed, mixed, 1.0 - (d * ddr).sum(1)], axis=1).reshape(-1, 2, 2)
        return gradient, hessian, np.stack([p, r], axis=1)

    def at_ends(self) -> Part:
        """Where the half ball at an end meets a piece: the nearest and, on arcs, the farthest point."""
        end, piece = self.oracle._end_pairs.T
        s = self.foot(piece, self.end[end])
        arc = self.bend[piece] > 0.0
        end, s = np.concatenate([end, end[arc]]), np.concatenate([s, s[arc] + np.pi * self.bend[piece[arc]]])
        piece = np.concatenate([piece, piece[arc]])
        s, on = self.within(piece, s, SAME * self.size)
        p, _, ddp = self.at(piece, s)
        d = p - self.end[end]
        keep = on & ((d * self.out[end]).sum(1) >= 0.0)
        curvature = (1.0 + (d * ddp).sum(1))[keep]
        bodies = np.stack([self.oracle._end_body[end], self.oracle._body[piece]], axis=1)[keep]
        return bodies, np.stack([self.end[end], p], axis=1)[keep], (curvature < 0.0).astype(int), curvature

    def corners(self) -> Part:
        """Where two half balls meet."""
        pair = self.oracle._corner_pairs
        points = self.end[pair]
        d = points[:, 1] - points[:, 0]
        keep = ((d * self.out[pair[:, 0]]).sum(1) >= 0.0) & ((d * self.out[pair[:, 1]]).sum(1) <= 0.0)
        count = int(keep.sum())
        return self.oracle._end_body[pair][keep], points[keep], np.zeros(count, dtype=int), np.ones(count)

    def borders(self) -> list[tuple[Table, Array]]:
        """Distances of where pieces begin and end from the other pieces and from free ends, with the bodies."""
        pieces = np.arange(self.bend.size)
        corner = np.concatenate([self.at(pieces, 0.0 * self.length)[0], self.at(pieces, self.length)[0], self.end])
        owner = np.concatenate([self.oracle._body, self.oracle._body, self.oracle._end_body])
        c, k = np.indices((owner.size, pieces.size)).reshape(2, -1)
        apart = owner[c] != self.oracle._body[k]
        c, k = c[apart], k[apart]
        s, on = self.within(k, self.foot(k, corner[c]), 0.0)
        distance = np.linalg.norm(self.at(k, s)[0] - corner[c], axis=1)
        a, b = np.triu_indices(owner.size, 1)
        apart = owner[a] != owner[b]
        a, b = a[apart], b[apart]
        return [
            (np.stack([owner[c], self.oracle._body[k]], axis=1)[on], distance[on]),
            (np.stack([owner[a], owner[b]], axis=1), np.linalg.norm(corner[a] - corner[b], axis=1)),
        ]


def _owners(counts: Sequence[int]) -> Table:
    return np.repeat(np.arange(len(counts)), counts)


def _lines(posed: _Posed, pairs: Table) -> tuple[Table, Array, Array]:
    """Feet of two lines on each other; parallel ones have none."""
    d, e = posed.axes[pairs[:, 0], 0], posed.axes[pairs[:, 1], 0]
    w = posed.start[pairs[:, 1]] - posed.start[pairs[:, 0]]
    b = (d * e).sum(1)
    sine = np.linalg.norm(np.cross(d, e), axis=1) ** 2
    skew = sine > 1e-24
    b, sine, wd, we = b[skew], sine[skew], (w * d).sum(1)[skew], (w * e).sum(1)[skew]
    return pairs[skew], (wd - b * we) / sine, (b * wd - we) / sine


def _companion_roots(c: Array) -> NDArray[np.complex128]:
    """Roots of polynomials (n, degree + 1), lowest power first; those at infinity are very large."""
    size = np.abs(c).max(axis=1, keepdims=True, initial=0.0)
    c = c / np.where(size > 0.0, size, 1.0)
    lead = c[:, -1]
    lead = np.where(np.abs(lead) < 1e-14, 1e-14, lead)
    degree = c.shape[1] - 1
    matrix = np.zeros((len(c), degree, degree), dtype=c.dtype)
    matrix[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    matrix[:, :, -1] = -c[:, :-1] / lead[:, None]
    return np.asarray(np.linalg.eigvals(matrix), dtype=complex)


def _circle_roots(posed: _Posed, pairs: Table) -> tuple[Table, Array, Array]:
    """Starts near all critical points of whole circles."""
    first, second = pairs.T
    radius, other = posed.bend[first][:, None], posed.bend[second][:, None]
    center = np.einsum("nki,ni->nk", posed.axes[first], posed.start[second] - posed.start[first])
    e, f = (np.einsum("nki,ni->nk", posed.axes[first], posed.axes[second, k]) for k in range(2))

    # Sixteen samples determine nine coefficients.
    t = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    r, dr = _on_circle(center, e, f, other, t)
    along = (r * dr).sum(axis=2)
    square = (r[..., :2] ** 2).sum(axis=2)
    turning = (r[..., :2] * dr[..., :2]).sum(axis=2)
    values = along**2 * square - radius**2 * turning**2
    spectrum = np.fft.fft(values, axis=1) / 16.0
    z = _companion_roots(np.concatenate([spectrum[:, -4:], spectrum[:, :5]], axis=1))
    row, column = np.nonzero(np.abs(np.log(np.maximum(np.abs(z), 1e-300))) < NEAR_ROOT)
    t = np.angle(z[row, column])
    r, dr = _on_circle(center[row], e[row], f[row], other[row], t[:, None])
    return _starts(pairs[row], posed.bend[first][row], r[:, 0], dr[:, 0], posed.bend[second][row] * t)


def _on_circle(center: Array, e: Array, f: Array, radius: Array, t: Array) -> tuple[Array, Array]:
    """Points of circles and their derivatives, (n, angles, 3)."""
    c, s = (
        np.broadcast_to(np.cos(t), (len(center), t.shape[-1])),
        np.broadcast_to(np.sin(t), (len(center), t.shape[-1])),
    )
    radial = c[..., None] * e[:, None] + s[..., None] * f[:, None]
    return center[:, None] + radius[..., None] * radial, radius[..., None] * (
        c[..., None] * f[:, None] - s[..., None] * e[:, None]
    )


def _line_roots(posed: _Posed, pairs: Table) -> tuple[Table, Array, Array]:
    """Starts near all critical points of circles and whole lines."""
    first, second = pairs.T
    radius = posed.bend[first]
    axes = posed.axes[first]
    p = np.einsum("nki,ni->nk", axes, posed.start[second] - posed.start[first])
    d = np.einsum("nki,ni->nk", axes, posed.axes[second, 0])
    # From the foot of the center on, in units of the circle's radius: (x.x')^2 is t^2 then.
    foot = (p * d).sum(1)
    p = (p - foot[:, None] * d) / radius[:, None]
    a, b, c = (p[:, :2] ** 2).sum(1), (p[:, :2] * d[:, :2]).sum(1), (d[:, :2] ** 2).sum(1)
    # t^2 (a + 2 b t + c t^2) - (b + c t)^2
    z = _companion_roots(np.stack([-(b**2), -2.0 * b * c, a - c**2, 2.0 * b, c], axis=1))
    row, column = np.nonzero(np.abs(z.imag) < NEAR_ROOT * (1.0 + np.abs(z.real)))
    t = z[row, column].real
    s = radius[row] * t - foot[row]
    local = radius[row, None] * (p[row] + t[:, None] * d[row])
    return _starts(pairs[row], radius[row], local, d[row], s)


def _starts(pairs: Table, radius: Array, local: Array, rate: Array, t: Array) -> tuple[Table, Array, Array]:
    """The nearest and the farthest point of circles from points in their frames, which move at a rate.

    On the axis all points of a circle are as far; critical are those p with (x - p).x' = 0.
    """
    angle = np.arctan2(local[:, 1], local[:, 0])
    axial = np.hypot(local[:, 0], local[:, 1]) < NEAR_AXIS * radius
    across, along = np.hypot(rate[:, 0], rate[:, 1]), (local * rate).sum(axis=1)
    bound = radius * across
    swing = np.arccos(np.clip(along / np.where(bound > 0.0, bound, 1.0), -1.0, 1.0))[axial]
    middle = np.arctan2(rate[:, 1], rate[:, 0])[axial]
    angles = np.concatenate([angle, angle + np.pi, middle + swing, middle - swing])
    rows = np.concatenate([np.arange(t.size), np.arange(t.size), *2 * [np.flatnonzero(axial)]])
    return pairs[rows], radius[rows] * angles, t[rows]


def _distinct(bodies: Table, centers: Array, tolerance: float) -> Mask:
    """The first of those that are in the same places of the same bodies."""
    same = (bodies[:, None] == bodies[None]).all(axis=2)
    same &= (np.abs(centers[:, None] - centers[None]) < tolerance).all(axis=(2, 3))
    return np.asarray(~np.tril(same, -1).any(axis=1))
