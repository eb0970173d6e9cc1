"""Boundary curves of a face in (u, v), from the curves that OCCT keeps for its edges.

A curve on a surface whose parameters are lengths or spline parameters is carried over as it is. Around an axis OCCT's
parameter is an angle and ours is rational (`profiles.Turning`): a line along one parameter stays such a line, with its
ends mapped; any other curve, a helix say, has no rational form and is interpolated.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of
from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import sampled
from assembly.step.edge_ends import (
    EDGE,
    EDGE_SIZE,
    FOLLOWED,
    FREE,
    LEVEL,
    LOOSE,
    POINT,
    TIGHT,
    U_LEVEL,
    UNKNOWN,
    V_LEVEL,
    level_lines,
)
from assembly.step.edges import Edges, Known
from assembly.step.occt import occt
from assembly.step.profiles import Direction, Spline, Unreadable, approximated, profile, spline
from assembly.step.projected import projected, strays
from assembly.step.surfaces import Patch
from assembly.step.tracks import track
from assembly.step.wires import Traced, Wire

__all__ = ["HIGH", "LOW", "Drawn", "Pair", "curves_of", "edge_curves", "moved", "ready_edges", "shifted"]

Array = NDArray[np.float64]
Pair = tuple[float, float]
# Deviation allowed to curves without rational form, over the shorter side of the surface's domain.
FOLLOW = 1e-10
# A move of an end is spread over the first legs of the control polygon that together are this many times as long.
GENTLE = 10.0
# Most halvings of a stretch whose end is moved beside a pole.
_HALVINGS = 40
# Columns of records of edges: both ends, the interval, and what else is asked for here.
ENDS, LOW, HIGH = slice(0, 4), place_of(EDGE, "low"), place_of(EDGE, "high")
TOLERANCE, _LEVEL, _LINE = (place_of(EDGE, name) for name in ("tolerance", "level", "line"))


class Segment(NamedTuple):
    """A straight line in (u, v) over an interval of its parameter, where two control points and knots are too much."""

    start: Pair
    end: Pair
    low: float = 0.0
    high: float = 1.0


class Drawn(NamedTuple):
    """The edges of a wire in our (u, v), run with the material on their left.

    Attributes
    ----------
    rows : (n, EDGE_SIZE)
        An `EDGE` each.
    curves : list of Spline, optional
        Those that are no straight lines.
    names : list of str
        Edges of two faces that are one edge of the solid have one name.
    seams : bool
        Whether the face has some on both sides.
    deviation : float
        Of their interpolation in (u, v), at most.
    """

    rows: Array
    curves: list[Spline | None]
    names: list[str]
    seams: bool
    deviation: float

    @property
    def tolerance(self) -> float:
        """The largest [mm]."""
        return float(self.rows[:, TOLERANCE].max())


def moved(curve: Spline, level: float, start: Pair, end: Pair, patch: Patch | None = None) -> Spline:
    """A curve in (u, v) with its two ends at two points; what is level stays so.

    `patch` is given where the surface has poles.
    """
    counts = np.ones((2, 2))
    if patch is not None:
        counts = patch.counts(np.array([start, end]))
        for to, is_last in ((start, False), (end, True)):
            curve = _halved(curve, np.array(to), is_last, patch)
    made = curve.points.copy()
    if len(made) == 2 and made[0, 2] == made[1, 2] == 1.0:
        made[:, :2] = start, end
        return Spline(made, curve.knots, curve.degree)
    for axis, kept in ((0, U_LEVEL), (1, V_LEVEL)):
        if level == kept:
            made[:, axis] = start[axis] * made[:, 2]
    for points, to, count in ((made, start, counts[0]), (made[::-1], end, counts[1])):
        _move_end(points, np.array(to), count)
    return Spline(made, curve.knots, curve.degree)


def _halved(curve: Spline, to: Array, is_last: bool, patch: Patch) -> Spline:
    """A curve whose stretch at an end is short enough for the end to be moved there.

    A turn around a pole by which nothing moves at the end moves what is farther away.
    """
    for _ in range(_HALVINGS):
        inner = np.unique(curve.knots)
        points, a, b = (curve.points[::-1], *inner[:-3:-1]) if is_last else (curve.points, *inner[:2])
        move, beyond = to - points[0, :2] / points[0, 2], points[curve.degree]
        near, far = patch.counts(np.array([to, beyond[:2] / beyond[2]]))
        if np.abs(move * far).max() <= max(2.0 * GENTLE * np.abs(move * near).max(), FOLLOW * patch.sides.min()):
            break
        made, knots = bezier.insert(curve.points, curve.knots, curve.degree, 0.5 * (a + b), curve.degree)
        curve = Spline(made, knots, curve.degree)
    return curve


def shifted(curve: Spline, by: Array) -> Spline:
    """A curve moved by a vector of (u, v)."""
    made = curve.points.copy()
    made[:, :2] += by * made[:, 2:]
    return Spline(made, curve.knots, curve.degree)


def _move_end(points: Array, to: Array, count: Array) -> None:
    """Move the first control point, homogeneous in (u, v), and some after it by a share of the move.

    Moving the first one alone by more than its leg would turn the curve back. The share falls evenly along the control
    polygon, from one at the end to zero where `GENTLE` moves are passed, as long as their parts in u and in v count.
    """
    plane = points[:, :2] / points[:, 2:]
    move = to - plane[0]
    far = float(np.hypot(*(count * move))) * GENTLE
    legs = np.hypot(*np.diff(plane, axis=0).T)
    if legs[0] < far:
        share = np.maximum(0.0, 1.0 - np.cumsum(legs) / far)
        points[1:-1, :2] += share[:-1, None] * move * points[1:-1, 2:]
    points[0, :2] = to * points[0, 2]


def curves_of(drawn: Drawn, ends: Array, scales: Array) -> list[NurbsCurve]:
    """Edges as the loops of a face take them, lines between their ends (n, 2, 2); their u and v are multiplied."""
    rows, curves, names = drawn.rows, drawn.curves, drawn.names
    intervals = rows[:, LOW : HIGH + 1].tolist()
    if not any(curves):
        return NurbsCurve._lines(ends * scales, [(low, high) for low, high in intervals], names)
    straight = [k for k, curve in enumerate(curves) if curve is None]
    made = NurbsCurve._lines(
        ends[straight] * scales, [(intervals[k][0], intervals[k][1]) for k in straight], [names[k] for k in straight]
    )
    lines = iter(made)
    found = []
    for curve, name in zip(curves, names, strict=True):
        if curve is None:
            found.append(next(lines))
        else:
            points, weights = curve.cartesian
            found.append(NurbsCurve(points * scales, curve.knots, curve.degree, weights, name=name))
    return found


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
    """The curve of an edge, not turned; if it is level or a line, its ends are still in OCCT's (u, v)."""

    curve: Spline | Segment
    level: int
    deviation: float


def edge_curves(wire: Wire, patch: Patch, edges: Edges) -> Drawn:
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
    turned = occt().TopAbs_REVERSED
    size, deviation, seams = patch.surface.size, 0.0, False
    rows: list[tuple[float, ...]] = []
    curves: list[Spline | None] = []
    names = []
    forgiven = edges.forgiven
    is_point = occt().BRep_Tool.Degenerated_s if patch.surface._pole_bits else None
    for traced, known in zip(wire.edges, edges.known_of(wire), strict=True):
        edge, _, low, high, line, seam = traced
        tolerance, is_turned = forgiven(known.tolerance, size), edge.Orientation() == turned
        if line is None or known.loose:
            draft, known = _best(traced, known, wire, patch, edges)
            deviation = max(deviation, draft.deviation)
            ends, kept = _row(draft, is_turned)
            rows.append((*ends[:6], tolerance, *ends[7:], LOOSE if known.loose else TIGHT, seam))
            curves.append(kept)
        else:
            (u, v), (x, y) = line
            certain = POINT if is_point is not None and is_point(edge) else TIGHT
            rows.append((u, v, x, y, low, high, tolerance, UNKNOWN, 1.0, is_turned, certain, seam))
            curves.append(None)
        names.append(known.name)
        seams = seams or seam
    table = np.array(rows, dtype=np.float64).reshape(-1, EDGE_SIZE)
    if level_lines(table, patch.scales, patch.sides, patch.is_straight):
        for k in np.flatnonzero(table[:, _LEVEL] == FOLLOWED).tolist():
            traced = wire.edges[k]
            draft, known = _best(traced, edges.known(traced.edge), wire, patch, edges)
            deviation = max(deviation, draft.deviation)
            ends, curves[k] = _row(draft, traced.edge.Orientation() == turned)
            table[k] = (*ends[:6], table[k, TOLERANCE], *ends[7:], LOOSE if known.loose else TIGHT, traced.seam)
    if not patch.is_straight:
        # Ends of all lines are mapped at once.
        lines = table[:, _LINE] != 0.0
        places = table[lines, ENDS].reshape(-1, 2)
        table[lines, ENDS] = np.column_stack([patch.u(places[:, 0]), patch.v(places[:, 1])]).reshape(-1, 4)
    return Drawn(table, curves, names, seams, deviation)


def ready_edges(wire: Wire, patch: Patch, edges: Edges) -> None:
    """Have what loose edges of a wire are compared with at hand: their curves in space, and those on the surface."""
    for traced, known in zip(wire.edges, edges.known_of(wire), strict=True):
        if known.loose and traced.curve is not None and not traced.seam:
            if edges.space(traced.edge) is not None:
                edges.side(traced, wire.face, patch).ready()


def _row(draft: _Draft, is_turned: bool) -> tuple[tuple[float, ...], Spline | None]:
    """The first ten fields of an `EDGE`, its tolerance left out, of a curve that is turned where it has to be."""
    curve, level, _ = draft
    if isinstance(curve, Segment):
        if is_turned:
            both = curve.low + curve.high
            curve = Segment(curve.end, curve.start, both - curve.high, both - curve.low)
        return (*curve.start, *curve.end, curve.low, curve.high, 0.0, level, 1.0, 0.0), None
    if is_turned:
        curve = Spline(curve.points[::-1], curve.knots[0] + curve.knots[-1] - curve.knots[::-1], curve.degree)
    (u, v, w), (x, y, z) = curve.points[0].tolist(), curve.points[-1].tolist()
    return (u / w, v / w, x / z, y / z, 0.0, 1.0, 0.0, level, 0.0, 0.0), curve


def _best(traced: Traced, known: Known, wire: Wire, patch: Patch, edges: Edges) -> tuple[_Draft, Known]:
    """The curve of an edge, projected where the one that is given is off."""
    made = _projected(traced, wire, patch, edges) if known.loose else None
    if made is not None:
        return made, known
    made = _draft(traced, wire, patch, edges)
    # OCCT follows edges around axes by samples, and its tolerance says nothing of what is between them.
    if not (known.loose or patch.is_straight or made.level != FREE) and strays(
        edges.space(traced.edge), edges.side(traced, wire.face, patch), known.tolerance
    ):
        better = _projected(traced, wire, patch, edges)
        if better is not None:
            return better, known._replace(loose=True)
    return made, known


def _projected(traced: Traced, wire: Wire, patch: Patch, edges: Edges) -> _Draft | None:
    """The curve of a loose edge projected; None where the one there will do, or none is."""
    if traced.curve is None or traced.seam:
        return None
    space = edges.space(traced.edge)
    if space is None:
        return None
    own = edges.side(traced, wire.face, patch)
    made = projected(space, own, edges.beyond(traced, wire.face), traced.low, traced.high)
    return None if made is None else _Draft(made[0], FREE, made[1])


def _draft(traced: Traced, wire: Wire, patch: Patch, edges: Edges) -> _Draft:
    """The curve of an edge, its ends not mapped where it is level."""
    if traced.curve is None:
        raise Unreadable("an edge has no curve in the surface's parameters")
    if traced.line is not None:
        start, end = traced.line
        us, vs = [start[0], end[0]], [start[1], end[1]]
        if level := _level(us, vs, patch):
            return _leveled(us, vs, level, 0.0)
        if patch.is_straight:
            return _Draft(Segment(start, end, traced.low, traced.high), FREE, 0.0)
    if traced.seam:
        source, _, deviation = profile(traced.curve, traced.low, traced.high, cut=True)
    else:
        source, _, deviation = edges.side(traced, wire.face, patch).profile
    points, weights = source.cartesian
    us, vs = points[:, 0].tolist(), points[:, 1].tolist()
    if level := _level(us, vs, patch):
        return _leveled(us, vs, level, deviation)
    if patch.is_straight:
        return _Draft(spline(points, source.knots, source.degree, weights), FREE, deviation)
    made, error = _followed(source, (patch.u, patch.v), FOLLOW * float(patch.sides.min()))
    return _Draft(made, FREE, deviation + error)


def _leveled(us: list[float], vs: list[float], level: int, deviation: float) -> _Draft:
    """The line between the ends of a curve, its constant coordinate in the middle of the curve's."""
    if level == U_LEVEL:
        u = 0.5 * (min(us) + max(us))
        return _Draft(Segment((u, vs[0]), (u, vs[-1])), level, deviation)
    v = 0.5 * (min(vs) + max(vs))
    return _Draft(Segment((us[0], v), (us[-1], v)), level, deviation)


def _level(us: list[float], vs: list[float], patch: Patch) -> int:
    """Which of our parameters is constant along a curve in OCCT's, of which these are the control points.

    0 for none; the other one has to go one way.
    """
    (scale_u, scale_v), (side_u, side_v) = patch.scales.tolist(), patch.lengths
    extent_u, extent_v = (max(us) - min(us)) * scale_u / side_u, (max(vs) - min(vs)) * scale_v / side_v
    along_v = extent_v > extent_u
    if not (extent_u if along_v else extent_v) <= LEVEL:
        return 0
    row = vs if along_v else us
    if len(row) > 2 and not (all(a <= b for a, b in pairwise(row)) or all(a >= b for a, b in pairwise(row))):
        return 0
    return U_LEVEL if along_v else V_LEVEL
