"""Regions of closed surfaces cut open along the seams, as STEP and OCCT want them; and any region cut in two.

A face's boundary lives in the unrolled plane: a ring closes up to a period, and windows may lie across the seam. Here
every curve is cut where it crosses a seam and moved into the domain. Where a boundary crosses the seam upwards (in
the sense that the material, on its left, is above the crossing), a stretch of the seam begins, and it ends where the
next one crosses downwards, or at a pole. Each stretch becomes two pieces, one on either side of the domain, and the
pieces are linked again. A line inside of the domain cuts a region in the same way, but that nothing moves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.seams.region_pieces import NEAR, POLE, SEAM, Piece, Uncut, closed_at_poles, segment
from assembly.geometry.seams.region_strips import opened
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["cut_in_two", "cut_open", "part_of"]

Array = NDArray[np.float64]


def part_of(curve: NurbsCurve, cuts: list[float]) -> list[NurbsCurve]:
    """The parts of a clamped curve between parameters."""
    p = curve.degree
    level = np.ptp(curve.control_points, axis=0) == 0.0
    value = curve.control_points[0]
    for cut in cuts:
        present = int(np.count_nonzero(curve.knots == cut))
        if present < p:
            curve = curve.insert_knot(cut, p - present)
    bounds = [curve.domain[0], *cuts, curve.domain[1]]
    parts = []
    for a, b in zip(bounds[:-1], bounds[1:], strict=True):
        first = int(np.searchsorted(curve.knots, a, side="right")) - p - 1
        last = int(np.searchsorted(curve.knots, b, side="left"))
        inner = curve.knots[(curve.knots > a) & (curve.knots < b)]
        knots = np.concatenate([np.full(p + 1, a), inner, np.full(p + 1, b)])
        # What is constant stays so to the last bit.
        points = np.where(level, value, curve.control_points[first:last])
        parts.append(NurbsCurve(points, knots, p, curve.weights[first:last], name=curve.name))
    return parts


class _Axis:
    """One closed direction: across the seam s, and h along it so that (s, h) is right-handed."""

    # Whether a line that no boundary crosses may lie inside of the region.
    goes_round = True

    def __init__(self, surface: NurbsSurface, axis: int) -> None:
        self.axis, self.other = axis, 1 - axis
        self.low, self.high = surface.domain[axis]
        self.period = self.high - self.low
        # By what a piece moves for every seam between it and the domain.
        self.shift = self.period
        # u, v itself; for v, s = v and h = -u.
        self.sign = 1.0 if axis == 0 else -1.0
        ends = sorted(self.sign * x for x in surface.domain[self.other])
        self.bottom, self.top = ends[0], ends[1]
        # The seams of u are cut first, and then u is not closed any more.
        self.around = ends[1] - ends[0] if surface.closed[1] and axis == 0 else 0.0
        bits = surface._pole_bits
        low_pole, high_pole = bool(bits & (4, 1)[axis]), bool(bits & (8, 2)[axis])
        self.poles = (low_pole, high_pole) if axis == 0 else (high_pole, low_pole)

    def point(self, s: float, h: float) -> Array:
        """(u, v) of (s, h)."""
        at = np.empty(2)
        at[self.axis], at[self.other] = s, self.sign * h
        return at

    def height(self, point: Array) -> float:
        """h of (u, v)."""
        return float(self.sign * point[self.other])


class _Line(_Axis):
    """A line inside of the domain of a region that is bounded: a seam with a period beyond the domain."""

    goes_round = False

    def __init__(self, surface: NurbsSurface, axis: int, at: float) -> None:
        super().__init__(surface, axis)
        self.period *= 4.0
        self.shift = 0.0
        self.low = self.high = at
        self.around = 0.0
        self.poles = (False, False)


def _root(curve: NurbsCurve, axis: int, line: float, low: float, high: float) -> float:
    """Where a coordinate of a curve takes a value, between parameters on either side of it."""
    from scipy.optimize import brentq  # a quarter of a second of import

    return float(brentq(lambda t: float(curve.evaluate(t)[axis]) - line, low, high, xtol=1e-300, rtol=1e-15))


def _split(piece: Piece, axis: _Axis) -> list[Piece]:
    """The piece cut where it crosses a seam, its ends put onto the seam where they are next to it."""
    curve, a = piece.curve, axis.axis
    points = curve.control_points.copy()
    near = NEAR * axis.period
    for k in (0, -1):
        line = axis.low + np.round((points[k, a] - axis.low) / axis.period) * axis.period
        if abs(points[k, a] - line) <= near:
            points[k, a] = line
    if np.ptp(points[:, a]) <= near:
        points[:, a] = points[0, a]
    curve = NurbsCurve(points, curve.knots, curve.degree, curve.weights, name=curve.name)
    lines = axis.low + axis.period * np.arange(
        np.floor((points[:, a].min() - axis.low) / axis.period),
        np.ceil((points[:, a].max() - axis.low) / axis.period) + 1.0,
    )
    breaks = curve.breaks()
    at = sampled(breaks, 33)
    values = curve.evaluate(at)[:, a]
    cuts = []
    for line in lines:
        side = values - line
        side[np.abs(side) <= near] = 0.0
        # Sides of the samples that are not on the line: a cut where they change.
        off = np.flatnonzero(side)
        for k, after in zip(off.tolist(), off[1:].tolist(), strict=False):
            if side[k] * side[after] < 0.0:
                cuts.append(_root(curve, a, line, at[k], at[after]) if after == k + 1 else float(at[k + 1]))
    made = []
    for part in part_of(curve, sorted(cuts)):
        ends = part.control_points.copy()
        for k in (0, -1):
            line = axis.low + np.round((ends[k, a] - axis.low) / axis.period) * axis.period
            if abs(ends[k, a] - line) <= 10.0 * near:
                ends[k, a] = line
        made.append(Piece(NurbsCurve(ends, part.knots, part.degree, part.weights, name=part.name), piece.kind))
    return made


def _strip(piece: Piece, axis: _Axis) -> int:
    """In which period a cut piece lies; one along a seam lies where its material is."""
    low, high = piece.curve.domain
    middle = float(piece.curve.evaluate(np.linspace(low, high, 9)[1:-1])[:, axis.axis].mean())
    at = (middle - axis.low) / axis.period
    if abs(at - round(at)) <= NEAR:
        up = axis.height(piece.ends[1]) > axis.height(piece.ends[0])
        return round(at) - (1 if up else 0)
    return int(np.floor(at))


def _moved(piece: Piece, axis: _Axis, strips: int) -> None:
    """Move a piece by whole periods into the domain."""
    points = piece.curve.control_points.copy()
    at = points[:, axis.axis] - strips * axis.shift
    # The two sides of the domain are a period apart to rounding only.
    for side in (axis.low, axis.high):
        at[np.abs(at - side) < 1e-12 * axis.period] = side
    points[:, axis.axis] = at
    old = piece.curve
    piece.curve = NurbsCurve(points, old.knots, old.degree, old.weights, name=old.name)


@dataclass
class _Crossing:
    """Where a boundary passes from one period to the next: the pieces before and after, and the way it goes."""

    height: float
    forward: bool
    before: Piece
    after: Piece


def _seam_inside(chains: list[list[Piece]], axis: _Axis) -> bool:
    """Whether a seam that no boundary crosses lies within the region: decided by the boundary nearest to it."""
    if not axis.goes_round:
        return False
    if not chains:
        return True
    reach = [min(float(p.curve.control_points[:, axis.axis].min()) for p in chain) for chain in chains]
    chain = chains[int(np.argmin(reach))]
    corners = np.concatenate([p.curve.evaluate(np.linspace(*p.curve.domain, 17)[:-1]) for p in chain])
    s, h = corners[:, axis.axis], axis.sign * corners[:, axis.other]
    turn = axis.height(chain[-1].ends[1]) - axis.height(chain[0].ends[0])
    if abs(turn) > 0.5 * axis.around > 0.0:
        return turn > 0.0
    return bool(np.sum(s * np.roll(h, -1) - h * np.roll(s, -1)) < 0.0)


def _stretches(crossings: list[_Crossing], axis: _Axis, inside: bool) -> Iterator[tuple[Any, Any, float, float]]:
    """Stretches of the seam in the region: the crossings they run between (None: a pole, or all around), heights."""
    if not crossings:
        if inside:
            yield None, None, axis.bottom, axis.top
        return
    rows = sorted(crossings, key=lambda c: (c.height - axis.bottom) % axis.around if axis.around else c.height)
    # Upward ones come before downward ones at the same height where a stretch of no length lies between them.
    if any(a.forward == b.forward for a, b in zip(rows, rows[1:], strict=False)):
        raise Uncut("its boundary crosses itself at the seam")
    if axis.around:
        for k, row in enumerate(rows):
            if row.forward:
                end = rows[(k + 1) % len(rows)]
                rise = (end.height - row.height) % axis.around or axis.around
                yield row, end, row.height, row.height + rise
        return
    if not rows[0].forward:
        yield None, rows[0], axis.bottom, rows[0].height
    for row, end in zip(rows, rows[1:], strict=False):
        if row.forward:
            yield row, end, row.height, end.height
    if rows[-1].forward:
        yield rows[-1], None, rows[-1].height, axis.top


def _cut(chains: list[list[Piece]], axis: _Axis) -> list[list[Piece]]:
    """Chains cut along the seams of one direction and linked again."""
    inside = _seam_inside(chains, axis)
    crossings: list[_Crossing] = []
    pieces: list[Piece] = []
    for chain in chains:
        row = [part for piece in chain for part in _split(piece, axis)]
        strips = [_strip(piece, axis) for piece in row]
        for k, piece in enumerate(row):
            after = row[(k + 1) % len(row)]
            jump = piece.ends[1, axis.axis] - after.ends[0, axis.axis]
            step = strips[(k + 1) % len(row)] + round(jump / axis.period) - strips[k]
            if step == 0:
                piece.next = after
            elif abs(step) == 1:
                crossings.append(_Crossing(axis.height(piece.ends[1]), step > 0, piece, after))
            else:
                raise Uncut("its boundary jumps over a period")
        for piece, number in zip(row, strips, strict=True):
            _moved(piece, axis, number)
        pieces += row
    for start, end, bottom, top in _stretches(crossings, axis, inside):
        if top - bottom <= NEAR * (axis.top - axis.bottom) and (start is None) != (end is None):
            # The boundary crosses the seam at the pole itself.
            crossing, has_pole = (start, axis.poles[1]) if end is None else (end, axis.poles[0])
            if has_pole:
                cap = Piece(segment(crossing.before.ends[1], crossing.after.ends[0]), POLE)
                crossing.before.next, cap.next = cap, crossing.after
                pieces.append(cap)
                continue
        up = Piece(segment(axis.point(axis.high, bottom), axis.point(axis.high, top)), SEAM)
        down = Piece(segment(axis.point(axis.low, top), axis.point(axis.low, bottom)), SEAM)
        pieces += [up, down]
        if start is None and end is None and axis.around:
            up.next, down.next = up, down
            continue
        for crossing, pole, first, second in ((start, axis.poles[0], down, up), (end, axis.poles[1], up, down)):
            if crossing is None and not pole:
                raise Uncut("its boundary is open at the seam")
            if crossing is None:
                cap = Piece(segment(first.ends[1], second.ends[0]), POLE)
                first.next, cap.next = cap, second
                pieces.append(cap)
        if start is not None:
            start.before.next, down.next = up, start.after
        if end is not None:
            end.before.next, up.next = down, end.after
    return _cycles(pieces)


def _cycles(pieces: list[Piece]) -> list[list[Piece]]:
    seen: set[int] = set()
    cycles = []
    for piece in pieces:
        cycle = []
        at: Piece | None = piece
        while at is not None and id(at) not in seen:
            seen.add(id(at))
            cycle.append(at)
            at = at.next
        if cycle:
            if at is not piece:
                raise Uncut("its boundary is open at the seam")
            cycles.append(cycle)
    return cycles


def cut_open(face: Any) -> tuple[NurbsSurface, list[list[Piece]]]:
    """A surface, and closed chains of pieces in its domain around the face's region.

    Where the region goes round the surface, it is cut at the seam, and the two sides of the seam are pieces in pairs;
    where it does not, the surface is opened beside it. A face without a boundary on a surface that is not closed has
    no chains.

    Raises
    ------
    Uncut
        The boundary encloses no region.
    """
    surface: NurbsSurface = face.surface
    boundary = [curve if _is_clamped(curve) else curve.elevate(curve.degree) for curve in face.boundary]
    chains = closed_at_poles([[boundary[k] for k in chain] for chain in face.chains], surface)
    for axis in (0, 1):
        if surface.closed[axis] and chains:
            surface = opened(chains, surface, axis)
    for axis in (0, 1):
        if surface.closed[axis]:
            chains = _cut(chains, _Axis(surface, axis))
    return surface, chains


def cut_in_two(
    chains: list[list[Piece]], surface: NurbsSurface, axis: int, at: float
) -> tuple[list[list[Piece]], list[list[Piece]]]:
    """The chains around the parts of a bounded region below and above a parameter of u (axis 0) or v (1).

    Raises
    ------
    Uncut
        The chains enclose no region.
    """
    below: list[list[Piece]] = []
    above: list[list[Piece]] = []
    for chain in _cut(chains, _Line(surface, axis, at)):
        middle = np.mean([piece.curve.evaluate(np.linspace(*piece.curve.domain, 9))[:, axis] for piece in chain])
        (below if middle < at else above).append(chain)
    return below, above


def _is_clamped(curve: NurbsCurve) -> bool:
    p, knots = curve.degree, curve.knots
    return bool(knots[0] == knots[p] and knots[-1] == knots[-p - 1])
