"""Boundary curves of a face in (u, v), from the curves that OCCT keeps for its edges.

A curve on a surface whose parameters are lengths or spline parameters is carried over as it is. Around an axis OCCT's
parameter is an angle and ours is rational (`profiles.Turning`): a line along one parameter stays such a line, with its
ends mapped; any other curve, a helix say, has no rational form and is interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.step.occt import occt
from assembly.step.profiles import Direction, Spline, Straight, Unreadable, approximated, crossings, profile, spline
from assembly.step.projected import Side, is_loose, projected
from assembly.step.surfaces import Patch

__all__ = ["Edge", "chained", "edge_curve", "head_to_tail"]

Array = NDArray[np.float64]
# Deviation allowed to curves without rational form, over the shorter side of the surface's domain.
FOLLOWED = 1e-10
# Curves that leave a coordinate line by less, over the side of the domain, run along it.
LEVEL = 1e-9


@dataclass(frozen=True)
class Edge:
    """One boundary curve in our (u, v), run with the material on its left.

    Attributes
    ----------
    curve : Spline
    level : (bool, bool)
        Whether u, or v, is constant along it.
    tolerance : float
        How far its ends may be from those of its neighbors, in space [mm].
    name : str
        Edges of two faces that are one edge of the solid have one name.
    deviation : float
        Of its interpolation in (u, v).
    seam : bool
        Whether the face has it on both sides.
    loose : bool
        Whether it has a tolerance of its own: its ends are less certain than those of others.
    """

    curve: Spline
    level: tuple[bool, bool]
    tolerance: float
    name: str
    deviation: float
    seam: bool = False
    loose: bool = False

    @cached_property
    def ends(self) -> Array:
        """First and last point (2, 2)."""
        points = self.curve.points[[0, -1]]
        return np.asarray(points[:, :2] / points[:, 2:])

    def moved(self, points: Array) -> Edge:
        """The curve with its two ends at the points (2, 2); what is level stays so."""
        made = self.curve.points.copy()
        if len(made) == 2 and made[0, 2] == made[1, 2] == 1.0:
            if (points == self.ends).all():
                return self
            made[:, :2] = points
            return replace(self, curve=Spline(made, self.curve.knots, self.curve.degree))
        for axis in np.flatnonzero(self.level):
            made[:, axis] = points[0, axis] * made[:, 2]
        made[[0, -1], :2] = points * made[[0, -1], 2:]
        return replace(self, curve=Spline(made, self.curve.knots, self.curve.degree))

    def shifted(self, by: Array) -> Edge:
        """The curve moved by a vector of (u, v)."""
        made = self.curve.points.copy()
        made[:, :2] += by * made[:, 2:]
        return replace(self, curve=Spline(made, self.curve.knots, self.curve.degree))

    def nurbs(self, scales: Array) -> NurbsCurve:
        """As the loops of a face take it, its u and v multiplied."""
        points, weights = self.curve.cartesian
        return NurbsCurve(points * scales, self.curve.knots, self.curve.degree, weights, name=self.name)


def _followed(source: Spline, maps: tuple[Direction, Direction], tolerance: float) -> tuple[Spline, float]:
    """A plane curve of OCCT's (u, v) mapped to ours by interpolation."""
    points, weights = source.cartesian
    curve = NurbsCurve(points, source.knots, source.degree, weights)
    breaks = curve.breaks()
    at = sampled(breaks, 17)
    values = curve.evaluate(at)
    cuts = [breaks]
    for axis, along in enumerate(maps):
        joints = along.joints(values[:, axis].min(), values[:, axis].max())
        cuts.append(
            np.array(crossings(values[:, axis], at, lambda t, axis=axis: float(curve.evaluate(t)[axis]), joints))
        )
    breaks = np.unique(np.concatenate(cuts))
    short = 1e-9 * (breaks[-1] - breaks[0])
    keep = np.append(True, np.diff(breaks) > short)
    keep[-1] = True
    breaks = breaks[keep]
    if breaks.size > 2 and breaks[-1] - breaks[-2] <= short:
        breaks = np.delete(breaks, -2)

    def mapped(t: Array) -> Array:
        there = curve.evaluate(np.clip(t, breaks[0], breaks[-1]))
        return np.column_stack([maps[0](there[:, 0]), maps[1](there[:, 1])])

    return approximated(mapped, breaks, tolerance)


def edge_curve(
    edge: Any, face: Any, patch: Patch, name: str, beyond: Callable[[Any, Any], Side | None] = lambda *_: None
) -> Edge:
    """The curve of an edge on a face (which is taken forward), mapped to our parameters.

    `beyond` finds the surface of the face on the other side of an edge, if there is one; only for edges that are off.

    Raises
    ------
    Unreadable
        The edge has no curve on the face, or one that cannot be carried over.
    """
    o = occt()
    low, high = o.BRep_Tool.Range_s(edge, face)
    raw = o.BRep_Tool.CurveOnSurface_s(edge, face, low, high)
    if raw is None:
        raise Unreadable("an edge has no curve in the surface's parameters")
    line, level, deviation = None, (False, False), 0.0
    seam = o.BRep_Tool.IsClosed_s(edge, face)
    anew = None
    loose = is_loose(edge)
    if loose and not seam:
        anew = projected(edge, Side(raw, patch), beyond(edge, face), low, high)
    if anew is None:
        source, _, deviation = profile(raw, low, high, cut=True)
        line, level = _level_line(source, patch)
    if anew is not None:
        made, deviation = anew
    elif line is not None:
        made = line
    elif isinstance(patch.u, Straight) and isinstance(patch.v, Straight):
        points, weights = source.cartesian
        made = spline(points, source.knots, source.degree, weights)
    else:
        made, error = _followed(source, (patch.u, patch.v), FOLLOWED * float(patch.sides.min()))
        deviation += error
    if edge.Orientation() == o.TopAbs_REVERSED:
        made = Spline(made.points[::-1], made.knots[0] + made.knots[-1] - made.knots[::-1], made.degree)
    tolerance = o.BRep_Tool.Tolerance_s(edge)
    for vertex in (o.TopExp.FirstVertex_s(edge), o.TopExp.LastVertex_s(edge)):
        if not vertex.IsNull():
            tolerance = max(tolerance, o.BRep_Tool.Tolerance_s(vertex))
    return Edge(made, level, tolerance, name, deviation, seam, loose)


def _level_line(source: Spline, patch: Patch) -> tuple[Spline | None, tuple[bool, bool]]:
    """The line along one of our parameters that a curve in OCCT's is, and which of them is constant; None if none."""
    points = source.cartesian[0]
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    extent = [(b - a) * k / side for a, b, k, side in zip(low, high, patch.scales, patch.sides.tolist(), strict=True)]
    along = int(extent[1] > extent[0])
    if not extent[1 - along] <= LEVEL:
        return None, (False, False)
    row = points[:, along].tolist()
    if not (all(a <= b for a, b in pairwise(row)) or all(a >= b for a, b in pairwise(row))):
        return None, (False, False)
    ends = points[[0, -1]]
    ends[:, 1 - along] = 0.5 * (low[1 - along] + high[1 - along])
    made = np.ones((2, 3))
    made[:, 0], made[:, 1] = patch.u(ends[:, 0]), patch.v(ends[:, 1])
    return Spline(made, np.array([0.0, 0.0, 1.0, 1.0]), 1), (along == 1, along == 0)


def _within(at: Array, patch: Patch) -> Array:
    """(u, v), which may lie beyond the domain, in it."""
    moved = at.copy()
    for axis, ((low, high), closed) in enumerate(zip(patch.surface.domain, patch.surface.closed, strict=True)):
        moved[..., axis] = (
            low + np.mod(at[..., axis] - low, high - low) if closed else np.clip(at[..., axis], low, high)
        )
    return moved


def head_to_tail(edges: list[Edge], patch: Patch) -> list[Edge]:
    """Edges in an order in which each begins nearest to where the one before ends, up to periods."""
    period = patch.period
    whole = np.where(np.isfinite(period), period, 1.0)
    row, left = edges[:1], edges[1:]
    while left:
        jumps = np.array([edge.ends[0] for edge in left]) - row[-1].ends[1]
        jumps -= np.where(np.isfinite(period), np.round(jumps / whole) * whole, 0.0)
        row.append(left.pop(int(np.argmin(np.linalg.norm(jumps, axis=1)))))
    return row


def chained(edges: list[Edge], patch: Patch) -> tuple[list[Edge], float]:
    """Edges of one wire, head to tail, moved by periods and joined where they miss one another by the tolerance.

    Returns
    -------
    edges, gap
        The largest gap that was closed, in space.

    Raises
    ------
    Unreadable
        Two curves are farther apart than their tolerance.
    """
    period = patch.period
    open_ = ~np.isfinite(period)
    whole, periods = np.where(open_, 1.0, period), np.where(open_, 0.0, period)
    rows = edges
    if not open_.all():
        rows = edges[:1]
        for edge in edges[1:]:
            turns = np.where(open_, 0.0, np.round((rows[-1].ends[1] - edge.ends[0]) / whole))
            rows.append(edge.shifted(turns * periods) if turns.any() else edge)
    ends, level = np.array([edge.ends for edge in rows]), np.array([edge.level for edge in rows])
    # A ring closes up to a period, and so does its joint.
    ring = np.where(open_, 0.0, np.round((ends[0, 0] - ends[-1, 1]) / whole)) * periods
    # Joint k is where edge k begins: where the end that is not loose is; else what is level keeps its coordinate.
    before, after = np.roll(ends[:, 1], 1, axis=0) + 0.0, ends[:, 0]
    before[0] += ring
    last_level = np.roll(level, 1, axis=0)
    joints = np.where(last_level != level, np.where(last_level, before, after), 0.5 * (before + after))
    loose = np.array([edge.loose for edge in rows])
    last_loose = np.roll(loose, 1)
    joints[loose & ~last_loose] = before[loose & ~last_loose]
    joints[last_loose & ~loose] = after[last_loose & ~loose]
    worst = _checked_gaps(rows, before, after, patch)
    _match_seams(rows, joints, period)
    stops = np.roll(joints, -1, axis=0)
    stops[-1] -= ring
    return [edge.moved(pair) for edge, pair in zip(rows, np.stack([joints, stops], axis=1), strict=True)], worst


def _checked_gaps(rows: list[Edge], before: Array, after: Array, patch: Patch) -> float:
    """The largest gap in space at the start of an edge, where the one before ends; raise beyond their tolerances."""
    apart = np.flatnonzero((before != after).any(axis=1))
    if not apart.size:
        return 0.0
    # Points may lie beyond the domain.
    at = _within(np.stack([before[apart], after[apart]]), patch)
    points = patch.surface.evaluate(at[..., 0], at[..., 1])
    gaps = np.linalg.norm(points[0] - points[1], axis=1).tolist()
    for k, gap in zip(apart.tolist(), gaps, strict=True):
        if gap > 2.0 * (rows[k - 1].tolerance + rows[k].tolerance):
            raise Unreadable(f"two edges that should meet are {gap:.2g} mm apart")
    return float(max(gaps))


def _match_seams(rows: list[Edge], joints: Array, period: Array) -> None:
    """Make both sides of a seam, which is one edge run to and fro, end at the same places up to a period."""
    whole = np.where(np.isfinite(period), period, 1.0)
    for i, edge in enumerate(rows):
        for j in range(i + 1, len(rows) if edge.seam else 0):
            if rows[j].name != edge.name:
                continue
            for here, there in ((i, (j + 1) % len(rows)), ((i + 1) % len(rows), j)):
                if here == there:
                    continue
                off = joints[here] - joints[there]
                off -= np.where(np.isfinite(period), np.round(off / whole) * whole, 0.0)
                joints[here] -= 0.5 * off
                joints[there] += 0.5 * off
