"""Boundary curves of a face in (u, v), from the curves that OCCT keeps for its edges.

A curve on a surface whose parameters are lengths or spline parameters is carried over as it is. Around an axis OCCT's
parameter is an angle and ours is rational (`profiles.Turning`): a line along one parameter stays such a line, with its
ends mapped; any other curve, a helix say, has no rational form and is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.step.edges import Edges
from assembly.step.occt import occt
from assembly.step.profiles import Direction, Spline, Unreadable, approximated, profile, spline
from assembly.step.projected import projected, strays
from assembly.step.surfaces import Patch
from assembly.step.tracks import track
from assembly.step.wires import Traced, Wire

__all__ = ["Edge", "Pair", "Segment", "curves_of", "edge_curves"]

Array = NDArray[np.float64]
Pair = tuple[float, float]
# Deviation allowed to curves without rational form, over the shorter side of the surface's domain.
FOLLOWED = 1e-10
# Curves that leave a coordinate line by less, over the side of the domain, run along it.
LEVEL = 1e-9
# A move of an end is spread over the first legs of the control polygon that together are this many times as long.
GENTLE = 10.0


class Segment(NamedTuple):
    """A straight line in (u, v) over an interval of its parameter, where two control points and knots are too much."""

    start: Pair
    end: Pair
    low: float = 0.0
    high: float = 1.0


class Edge(NamedTuple):
    """One boundary curve in our (u, v), run with the material on its left.

    Attributes
    ----------
    curve : Spline or Segment
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

    curve: Spline | Segment
    level: tuple[bool, bool]
    tolerance: float
    name: str
    deviation: float
    seam: bool = False
    loose: bool = False

    @property
    def corners(self) -> tuple[Pair, Pair]:
        """First and last point."""
        if isinstance(self.curve, Segment):
            return self.curve.start, self.curve.end
        (u, v, w), (x, y, z) = self.curve.points[0].tolist(), self.curve.points[-1].tolist()
        return (u / w, v / w), (x / z, y / z)

    @property
    def ends(self) -> Array:
        """The same as an array (2, 2)."""
        return np.array(self.corners)

    def moved(self, start: Pair, end: Pair) -> Edge:
        """The curve with its two ends at two points; what is level stays so."""
        if isinstance(self.curve, Segment):
            if start == self.curve.start and end == self.curve.end:
                return self
            return self._replace(curve=Segment(start, end, self.curve.low, self.curve.high))
        made = self.curve.points.copy()
        if len(made) == 2 and made[0, 2] == made[1, 2] == 1.0:
            made[:, :2] = start, end
            return self._replace(curve=Spline(made, self.curve.knots, self.curve.degree))
        for axis in (0, 1):
            if self.level[axis]:
                made[:, axis] = start[axis] * made[:, 2]
        for points, to in ((made, start), (made[::-1], end)):
            _move_end(points, np.array(to))
        return self._replace(curve=Spline(made, self.curve.knots, self.curve.degree))

    def shifted(self, by: Pair) -> Edge:
        """The curve moved by a vector of (u, v)."""
        if isinstance(self.curve, Segment):
            (u, v), (x, y), low, high = self.curve
            return self._replace(curve=Segment((u + by[0], v + by[1]), (x + by[0], y + by[1]), low, high))
        made = self.curve.points.copy()
        made[:, :2] += np.array(by) * made[:, 2:]
        return self._replace(curve=Spline(made, self.curve.knots, self.curve.degree))

    def nurbs(self, scales: Array) -> NurbsCurve:
        """As the loops of a face take it, its u and v multiplied."""
        return curves_of([self], scales)[0]


def _move_end(points: Array, to: Array) -> None:
    """Move the first control point, homogeneous in (u, v), and some after it by a share of the move.

    Moving the first one alone by more than its leg would turn the curve back. The share falls evenly along the control
    polygon, from one at the end to zero where `GENTLE` moves are passed.
    """
    plane = points[:, :2] / points[:, 2:]
    move = to - plane[0]
    far = float(np.hypot(*move)) * GENTLE
    legs = np.hypot(*np.diff(plane, axis=0).T)
    if legs[0] < far:
        share = np.maximum(0.0, 1.0 - np.cumsum(legs) / far)
        points[1:-1, :2] += share[:-1, None] * move * points[1:-1, 2:]
    points[0, :2] = to * points[0, 2]


def curves_of(edges: Sequence[Edge], scales: Array) -> list[NurbsCurve]:
    """Edges as the loops of a face take them, their u and v multiplied."""
    straight = [edge for edge in edges if isinstance(edge.curve, Segment)]
    ends = np.array([edge.corners for edge in straight]).reshape(-1, 2, 2) * scales
    intervals = [(edge.curve.low, edge.curve.high) for edge in straight if isinstance(edge.curve, Segment)]
    lines = iter(NurbsCurve._lines(ends, intervals, [edge.name for edge in straight]))
    made = []
    for edge in edges:
        if isinstance(edge.curve, Segment):
            made.append(next(lines))
        else:
            points, weights = edge.curve.cartesian
            made.append(NurbsCurve(points * scales, edge.curve.knots, edge.curve.degree, weights, name=edge.name))
    return made


def _followed(source: Spline, maps: tuple[Direction, Direction], tolerance: float) -> tuple[Spline, float]:
    """A plane curve of OCCT's (u, v) mapped to ours by interpolation."""
    plain = track(source)
    if plain is None:
        raise Unreadable("a curve in the surface's parameters has knots or points that doubles cannot hold")
    breaks = plain.breaks
    at = sampled(breaks, 17)
    values = plain(at)
    joints = [along.joints(column.min(), column.max()) for along, column in zip(maps, values.T, strict=True)]
    breaks = np.unique(np.append(breaks, plain.crossings(at, joints)))
    short = 1e-9 * (breaks[-1] - breaks[0])
    keep = np.append(True, np.diff(breaks) > short)
    keep[-1] = True
    breaks = breaks[keep]
    if breaks.size > 2 and breaks[-1] - breaks[-2] <= short:
        breaks = np.delete(breaks, -2)
    return approximated(plain.with_maps(maps), breaks, tolerance)


class _Draft(NamedTuple):
    """An edge that is not finished: if it is level or a line, its ends are still in OCCT's (u, v)."""

    curve: Spline | Segment
    level: tuple[bool, bool]
    deviation: float


def edge_curves(wire: Wire, patch: Patch, edges: Edges) -> list[Edge]:
    """The curves of the edges of a wire mapped to our parameters.

    Parameters
    ----------
    wire
        On a face.
    patch
        What that is on.
    edges
        Those of the solid.

    Raises
    ------
    Unreadable
        An edge has no curve on the face, or one that cannot be carried over.
    """
    o = occt()
    size = patch.surface.size
    rows = []
    drafts = []
    for traced in wire.edges:
        known = edges.known(traced.edge)
        made = _projected(traced, wire, patch, edges) if known.loose else None
        if made is None:
            made = _draft(traced, patch)
            # OCCT follows edges around axes by samples, and its tolerance says nothing of what is between them.
            if not (known.loose or patch.is_straight or made.level[0] or made.level[1]) and strays(
                edges.space(traced.edge), edges.side(traced, wire.face, patch), known.tolerance
            ):
                better = _projected(traced, wire, patch, edges)
                if better is not None:
                    made, known = better, known._replace(loose=True)
        rows.append(known)
        drafts.append(made)
    # Ends of all curves that are level are mapped at once.
    level = [draft for draft in drafts if draft.level[0] or draft.level[1]]
    places = np.array([(draft.curve.start, draft.curve.end) for draft in level if isinstance(draft.curve, Segment)])
    mapped = places.reshape(-1, 2)
    if level and not patch.is_straight:
        mapped = np.column_stack([patch.u(mapped[:, 0]), patch.v(mapped[:, 1])])
    points = iter(mapped.tolist())
    found = []
    for traced, known, (curve, sides, deviation) in zip(wire.edges, rows, drafts, strict=True):
        if sides[0] or sides[1]:
            (u, v), (x, y) = next(points), next(points)
            curve = Segment((u, v), (x, y))
        if traced.edge.Orientation() == o.TopAbs_REVERSED:
            curve = _reversed(curve)
        tolerance = edges.forgiven(known.tolerance, size)
        found.append(Edge(curve, sides, tolerance, known.name, deviation, traced.seam, known.loose))
    return found


def _reversed(curve: Spline | Segment) -> Spline | Segment:
    """A curve run the other way round, over the same interval."""
    if isinstance(curve, Segment):
        both = curve.low + curve.high
        return Segment(curve.end, curve.start, both - curve.high, both - curve.low)
    return Spline(curve.points[::-1], curve.knots[0] + curve.knots[-1] - curve.knots[::-1], curve.degree)


def _projected(traced: Traced, wire: Wire, patch: Patch, edges: Edges) -> _Draft | None:
    """The curve of a loose edge projected; None where the one there will do, or none is."""
    if traced.curve is None or traced.seam:
        return None
    space = edges.space(traced.edge)
    if space is None:
        return None
    own = edges.side(traced, wire.face, patch)
    made = projected(space, own, edges.beyond(traced, wire.face), traced.low, traced.high)
    return None if made is None else _Draft(made[0], (False, False), made[1])


def _draft(traced: Traced, patch: Patch) -> _Draft:
    """The curve of an edge, its ends not mapped where it is level."""
    if traced.curve is None:
        raise Unreadable("an edge has no curve in the surface's parameters")
    if traced.line is not None:
        start, end = traced.line
        us, vs = [start[0], end[0]], [start[1], end[1]]
        if level := _level(us, vs, patch):
            return _leveled(us, vs, level, 0.0)
        if patch.is_straight:
            return _Draft(Segment(start, end, traced.low, traced.high), (False, False), 0.0)
    source, _, deviation = profile(traced.curve, traced.low, traced.high, cut=True)
    points, weights = source.cartesian
    us, vs = points[:, 0].tolist(), points[:, 1].tolist()
    if level := _level(us, vs, patch):
        return _leveled(us, vs, level, deviation)
    if patch.is_straight:
        return _Draft(spline(points, source.knots, source.degree, weights), (False, False), deviation)
    made, error = _followed(source, (patch.u, patch.v), FOLLOWED * float(patch.sides.min()))
    return _Draft(made, (False, False), deviation + error)


def _leveled(us: list[float], vs: list[float], level: tuple[bool, bool], deviation: float) -> _Draft:
    """The line between the ends of a curve, its constant coordinate in the middle of the curve's."""
    if level[0]:
        u = 0.5 * (min(us) + max(us))
        return _Draft(Segment((u, vs[0]), (u, vs[-1])), level, deviation)
    v = 0.5 * (min(vs) + max(vs))
    return _Draft(Segment((us[0], v), (us[-1], v)), level, deviation)


def _level(us: list[float], vs: list[float], patch: Patch) -> tuple[bool, bool] | None:
    """Which of our parameters is constant along a curve in OCCT's, of which these are the control points.

    None for none; the other one has to go one way.
    """
    (scale_u, scale_v), (side_u, side_v) = patch.scales, patch.lengths
    extent_u, extent_v = (max(us) - min(us)) * scale_u / side_u, (max(vs) - min(vs)) * scale_v / side_v
    along_v = extent_v > extent_u
    if not (extent_u if along_v else extent_v) <= LEVEL:
        return None
    row = vs if along_v else us
    if len(row) > 2 and not (all(a <= b for a, b in pairwise(row)) or all(a >= b for a, b in pairwise(row))):
        return None
    return along_v, not along_v
