"""Wires around poles: where a closed surface is one point, as a sphere is at both ends of its axis.

A face keeps what is on the left of its edges, and the edges in space say all of it. Seams, and the lines in (u, v)
along which a boundary passes a pole, are what OCCT adds to a file, and it turns some of them around, or keeps too
little of the surface. So both are left out here. What is left is linked where edges have a vertex in common. A line
along a pole is drawn from where a boundary comes in to where it goes out, with the face on its left: to growing u at
the low end of v, to falling u at its high end. Then a boundary either closes in (u, v), counterclockwise if it is
around the face and clockwise around a hole, or goes round the axis, with the face above it or below it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, pi, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.step.occt import occt
from assembly.step.surfaces import CONFUSION
from assembly.step.wires import Box, Pair, Traced, Wire

__all__ = ["Polar", "polar"]

Array = NDArray[np.float64]
TURN = 2.0 * pi
# Samples of an edge, by which it is told how a boundary runs.
_SAMPLES = 17
# Edges that meet at a pole within this angle may be tangent: what they do beside the pole counts.
_TANGENT = 1e-3
# Areas in (u, v) that differ by less, over that of a turn, are one.
_SAME = 1e-6
# OCCT stands for "without end" with numbers beyond this one.
_FAR = 1e50


class Polar(NamedTuple):
    """Wires of a face without seams, those that bound it from outside first, and the extent of the face.

    `is_other` says whether that is not the part of the surface that OCCT has.
    """

    wires: list[Wire]
    box: Box
    is_other: bool


@dataclass(frozen=True)
class _Pole:
    """Its v and its point; `way` is 1 where u grows with the face on the left, at the low end of v, else -1."""

    v: float
    point: Array
    way: float


@dataclass(eq=False)
class _Run:
    """An edge that bounds the face, in its sense: its places in (u, v), its vertices, and its pole at either end."""

    traced: Traced
    places: Array
    vertices: tuple[Any, Any]
    poles: tuple[_Pole | None, _Pole | None]
    after: _Run | None = None
    shift: float = 0.0


def polar(wires: Sequence[Wire], surface: Any, face: Any) -> Polar | None:
    """The wires of a face on a surface with poles, drawn anew; None where there is nothing to draw.

    `face` is taken forward.
    """
    o = occt()
    while isinstance(surface, o.Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    if not isinstance(surface, (o.Geom_SphericalSurface, o.Geom_ConicalSurface, o.Geom_SurfaceOfRevolution)):
        return None
    every = [traced for wire in wires for traced in wire.edges]
    degenerated = [traced for traced in every if _is_pole(traced)]
    if not (degenerated or isinstance(surface, o.Geom_SphericalSurface)):
        return None
    if not all(wire.ordered and wire.edges for wire in wires) or any(traced.curve is None for traced in every):
        return None
    poles = _poles(surface, every)
    rows = [_runs(wire, poles) for wire in wires]
    runs = [run for row in rows for run in row if run is not None]
    if not runs:
        return None
    for row in rows:
        _follow(row)
    if not _link(runs):
        return None
    _meet_off_poles(runs, surface)
    loops = [_drawn(cycle, face, degenerated) for cycle in _cycles(runs)]
    if len(wires) == len(loops) == 1 and not degenerated and loops[0].turn == 0.0 and loops[0].area > 0.0:
        return None
    made = _extended(loops, surface, poles)
    return made._replace(is_other=_is_other(degenerated, loops, made))


def _is_other(degenerated: Sequence[Traced], loops: Sequence[_Loop], made: Polar) -> bool:
    """Whether a face is not the part of the surface that OCCT's wires go round.

    Areas in (u, v) are compared, the integrals of -v du: along edges these are the same, along seams zero.
    """
    given = [_swept(traced) for traced in degenerated]
    drawn = [_swept(traced) for loop in loops for traced in loop.wire.edges if _is_pole(traced)]
    low, high = made.box[2:]
    above = sum(loop.turn for loop in loops)
    beyond = above * (high if above > 0.0 else low)
    if not any(loop.turn != 0.0 or loop.area > 0.0 for loop in loops):
        beyond = TURN * (high - low)
    return bool(abs(sum(drawn) + beyond - sum(given)) > _SAME * TURN * max(abs(low), abs(high)))


def _swept(traced: Traced) -> float:
    """The integral of -v du along a line along a pole."""
    (u, v), (x, _) = (traced.curve.Value(t).Coord() for t in (traced.low, traced.high))
    return float(v * (x - u) if traced.edge.Orientation() == occt().TopAbs_REVERSED else v * (u - x))


def _poles(surface: Any, every: Sequence[Traced]) -> list[_Pole]:
    """The places in v at which the surface is one point."""
    o = occt()
    at = [traced.curve.Value(0.5 * (traced.low + traced.high)).Y() for traced in every]
    middle = 0.5 * (min(at) + max(at))
    if isinstance(surface, o.Geom_SphericalSurface):
        heights, middle = [-0.5 * pi, 0.5 * pi], 0.0
    elif isinstance(surface, o.Geom_ConicalSurface):
        heights = [-surface.RefRadius() / sin(surface.SemiAngle())]
    else:
        ends = [v for v in surface.Bounds()[2:] if abs(v) < _FAR]
        lines = [traced.line[0][1] for traced in every if traced.line is not None and _is_pole(traced)]
        origin, axis = np.array(surface.Location().Coord()), np.array(surface.Direction().Coord())
        out = {v: np.cross(np.array(surface.Value(0.0, v).Coord()) - origin, axis) for v in (*ends, *lines)}
        heights = [v for v, off in out.items() if np.linalg.norm(off) < CONFUSION]
    return [_Pole(v, np.array(surface.Value(0.0, v).Coord()), -1.0 if v > middle else 1.0) for v in heights]


def _is_pole(traced: Traced) -> bool:
    """Whether an edge is one point, as OCCT has it."""
    return bool(occt().BRep_Tool.Degenerated_s(traced.edge))


def _runs(wire: Wire, poles: Sequence[_Pole]) -> list[_Run | None]:
    """The edges of a wire in order, None where one is a seam, and nothing where it is a pole."""
    o = occt()
    turned = o.TopAbs_REVERSED
    found: list[_Run | None] = []
    for traced in wire.edges:
        if _is_pole(traced):
            continue
        twice = sum(other.edge.IsSame(traced.edge) for other in wire.edges) > 1
        if traced.seam and twice:
            found.append(None)
            continue
        at = np.linspace(traced.low, traced.high, _SAMPLES)
        if traced.edge.Orientation() == turned:
            at = at[::-1]
        places = np.array([traced.curve.Value(x).Coord() for x in at.tolist()])
        vertices = o.TopExp.FirstVertex_s(traced.edge, True), o.TopExp.LastVertex_s(traced.edge, True)
        ends = (_pole_at(vertices[0], poles), _pole_at(vertices[1], poles))
        found.append(_Run(traced, places, vertices, ends))
    return found


def _pole_at(vertex: Any, poles: Sequence[_Pole]) -> _Pole | None:
    """The pole at which a vertex is."""
    tool = occt().BRep_Tool
    place, reach = np.array(tool.Pnt_s(vertex).Coord()), tool.Tolerance_s(vertex)
    return next((pole for pole in poles if np.linalg.norm(place - pole.point) <= reach), None)


def _follow(row: list[_Run | None]) -> None:
    """Have edges that follow one another in a wire do so."""
    for k, run in enumerate(row):
        after = row[(k + 1) % len(row)]
        if run is not None and after is not None and run.vertices[1].IsSame(after.vertices[0]):
            run.after = after


def _link(runs: list[_Run]) -> bool:
    """Have edges between which there were seams follow the one that goes on from their vertex; whether all do."""
    taken = {id(run.after) for run in runs if run.after is not None}
    for run in runs:
        if run.after is not None:
            continue
        starts = [other for other in runs if id(other) not in taken and run.vertices[1].IsSame(other.vertices[0])]
        if not starts:
            return False
        pole = run.poles[1]
        ways = [_way(run, other, pole) for other in starts]
        run.after = starts[int(np.argmin(ways))]
        taken.add(id(run.after))
    return True


def _meet_off_poles(runs: Sequence[_Run], surface: Any) -> None:
    """Take no vertex for a pole at which two edges come to one place of the surface that is off the pole.

    OCCT draws a line along a pole there for many an edge that goes round the pole and crosses the seam, and gives the
    vertex a tolerance that reaches the pole.
    """
    for run in runs:
        after, pole = run.after, run.poles[1]
        if after is None or pole is None:
            continue
        here, there = (np.array(surface.Value(*place).Coord()) for place in (run.places[-1], after.places[0]))
        off = float(np.linalg.norm(here - pole.point))
        turn = after.places[0, 0] - run.places[-1, 0]
        turn -= TURN * round(turn / TURN)
        if off > CONFUSION and abs(turn) < _TANGENT and np.linalg.norm(there - here) < _TANGENT * off:
            run.poles, after.poles = (run.poles[0], None), (None, after.poles[1])


def _way(run: _Run, after: _Run, pole: _Pole | None) -> float:
    """How far it is from the end of an edge to the start of another: around a pole, or in (u, v)."""
    if pole is not None:
        return _angle(run, after, pole)
    gap = after.places[0] - run.places[-1]
    return float(np.hypot(gap[0] - TURN * round(gap[0] / TURN), gap[1]))


def _angle(run: _Run, after: _Run, pole: _Pole) -> float:
    """The angle of the face at a pole between an edge that comes in and one that goes out, in [0, 2 pi]."""
    angle = pole.way * (after.places[0, 0] - run.places[-1, 0]) % TURN
    if _TANGENT < angle < TURN - _TANGENT:
        return float(angle)
    beside = pole.way * (after.places[1, 0] - run.places[-2, 0])
    beside -= TURN * round(beside / TURN)
    small = angle if angle < pi else angle - TURN
    return float(max(small, 0.0) if beside > 0.0 else min(TURN + small, TURN))


def _cycles(runs: Sequence[_Run]) -> list[list[_Run]]:
    seen: set[int] = set()
    found = []
    for first in runs:
        cycle, run = [], first
        while id(run) not in seen:
            seen.add(id(run))
            cycle.append(run)
            assert run.after is not None
            run = run.after
        if cycle:
            found.append(cycle)
    return found


class _Loop(NamedTuple):
    """A boundary in (u, v): its wire, its whole turns, its area where it has none, and its extent."""

    wire: Wire
    turn: float
    area: float
    box: Box


def _drawn(cycle: Sequence[_Run], face: Any, degenerated: Sequence[Traced]) -> _Loop:
    """The loop of edges that follow one another."""
    edges: list[Traced] = []
    corners: list[Array] = []
    boxes: list[Box] = []
    by = 0.0
    for run in cycle:
        places = run.places + [by, 0.0]
        edges.append(_moved(run.traced, by))
        corners.append(places[:-1])
        low_u, high_u, low_v, high_v = occt().BRepTools.UVBounds_s(face, run.traced.edge)
        # Of an edge on a seam these are the ends of either side.
        low_u, high_u = (low_u + by, high_u + by) if not run.traced.seam else (places[0, 0], places[0, 0])
        boxes.append((low_u, high_u, low_v, high_v))
        assert run.after is not None
        to, pole = places[-1], run.poles[1]
        if pole is not None:
            start, angle = (float(to[0]), pole.v), _angle(run, run.after, pole)
            to = np.array([to[0] + pole.way * angle, pole.v])
            if angle > 0.0:
                edges.append(_along(pole, start, (float(to[0]), pole.v), degenerated))
                corners.append(np.array([start]))
                boxes.append((min(start[0], to[0]), max(start[0], to[0]), pole.v, pole.v))
        by = TURN * round((to[0] - run.after.places[0, 0]) / TURN)
    x, y = np.concatenate(corners).T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    lows_u, highs_u, lows_v, highs_v = zip(*boxes, strict=True)
    box = min(lows_u), max(highs_u), min(lows_v), max(highs_v)
    return _Loop(Wire(None, face, edges, ordered=True, whole=True), by, area, box)


def _moved(traced: Traced, by: float) -> Traced:
    """An edge whose curve is moved in u."""
    if by == 0.0:
        return traced._replace(seam=False)
    curve = traced.curve.Translated(occt().gp_Vec2d(by, 0.0))
    line = traced.line
    if line is not None:
        (u, v), (x, y) = line
        line = (u + by, v), (x + by, y)
    return traced._replace(curve=curve, line=line, seam=False)


def _along(pole: _Pole, start: Pair, end: Pair, degenerated: Sequence[Traced]) -> Traced:
    """The line along a pole."""
    o = occt()
    known = (traced.edge for traced in degenerated if traced.line is not None and traced.line[0][1] == pole.v)
    edge = next(known, None)
    if edge is None:
        edge = o.TopoDS_Edge()
        build = o.BRep_Builder()
        build.MakeEdge(edge)
        build.Degenerated(edge, True)
    length = abs(end[0] - start[0])
    curve = o.Geom2d_Line(o.gp_Pnt2d(*start), o.gp_Dir2d(end[0] - start[0], 0.0))
    return Traced(o.as_edge(edge.Oriented(o.TopAbs_FORWARD)), curve, 0.0, length, (start, end), seam=False)


def _extended(loops: list[_Loop], surface: Any, poles: Sequence[_Pole]) -> Polar:
    """Loops with the one around the others first, if there is one, and the part of the surface that they need."""
    outer = [loop for loop in loops if loop.turn == 0.0 and loop.area > 0.0]
    rings = [loop for loop in loops if loop.turn != 0.0]
    holes = [loop for loop in loops if loop.turn == 0.0 and not loop.area > 0.0]
    ordered = [*outer, *rings, *holes]
    lows_u, highs_u, lows_v, highs_v = zip(*(loop.box for loop in ordered), strict=True)
    box = min(lows_u), max(highs_u), min(lows_v), max(highs_v)
    if not outer:
        # A face above its rings, or with nothing but holes, goes on to the ends of the surface.
        above = sum(loop.turn for loop in rings)
        low, high = _ends(surface, poles)
        box = (
            0.0,
            TURN,
            min(low, box[2]) if above < 0.0 or not rings else box[2],
            max(high, box[3]) if above > 0.0 or not rings else box[3],
        )
    for k, loop in enumerate(ordered):
        loop.wire.is_outer = k < len(ordered) - len(holes) and k == 0
    return Polar([loop.wire for loop in ordered], box, False)


def _ends(surface: Any, poles: Sequence[_Pole]) -> Pair:
    """The ends of v, those of a surface without end where it is one point."""
    _, _, low, high = surface.Bounds()
    heights = [pole.v for pole in poles]
    return (
        low if abs(low) < _FAR else min(heights, default=inf),
        high if abs(high) < _FAR else max(heights, default=-inf),
    )
