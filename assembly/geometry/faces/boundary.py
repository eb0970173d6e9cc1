"""The boundary of a face: its loops turned the right way, without seams and without edges that are one point."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.faces.loop import TOLERANCE, Loop, curve_ends
from assembly.geometry.faces.loop_seams import SLACK, segment, without_seams
from assembly.geometry.faces.overshoot import clipped, extent, rates, widened
from assembly.geometry.faces.plain_boundary import plain_boundary
from assembly.geometry.faces.relinked import Relinked, relinked
from assembly.geometry.faces.trim_table import TrimTable, build
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["OVERSHOOT", "Boundary", "LoopLike", "boundary_of_parts", "make_boundary"]

Array = NDArray[np.float64]
LoopLike = NurbsCurve | Iterable[NurbsCurve] | Loop
# How far loops may leave the surface, or go into each other, as a part of its size, where no tolerance is given.
OVERSHOOT = 1e-4
_EDGE = "the edge of the domain"


@dataclass(frozen=True, eq=False)
class Boundary:
    """A surface that holds the loops, these (turned), all boundary curves, which make a chain, and the table."""

    surface: NurbsSurface
    outer: Loop | None
    holes: tuple[Loop, ...]
    curves: tuple[NurbsCurve, ...]
    chains: tuple[range, ...]
    table: TrimTable


class _Sheet(NamedTuple):
    """What a boundary needs to know of a surface: its domain, which parameters are closed, which edges are points."""

    domain: tuple[tuple[float, float], tuple[float, float]]
    closed: tuple[bool, bool]
    poles: int

    @classmethod
    def of(cls, surface: NurbsSurface) -> _Sheet:
        """That of a surface."""
        return cls(surface.domain, surface.closed, surface._pole_bits)

    @property
    def periods(self) -> tuple[float, float]:
        """Periods of both parameters, 0 where one is not closed."""
        (a, b), (c, d) = self.domain
        return (b - a if self.closed[0] else 0.0, d - c if self.closed[1] else 0.0)


def _natural(sheet: _Sheet) -> tuple[list[list[NurbsCurve]], list[NurbsCurve]]:
    """Chains of the edges of the domain, counterclockwise, and the pole edges."""
    ((a, b), (c, d)), closed, poles = sheet
    corners = np.array([[a, c], [b, c], [b, d], [a, d]])
    chains: list[list[NurbsCurve]] = []
    silent = []
    last = -2
    for k, (axis, bit) in enumerate(((1, 4), (0, 2), (1, 8), (0, 1))):
        if closed[axis]:
            continue
        edge = segment(corners[k], corners[(k + 1) % 4])
        if poles & bit:
            silent.append(edge)
            continue
        if last == k - 1:
            chains[-1].append(edge)
        else:
            chains.append([edge])
        last = k
    # The left edge runs into the bottom one.
    if len(chains) > 1 and last == 3 and not closed[1] and not poles & 4:
        chains[0] = chains.pop() + chains[0]
    return chains, silent


def _as_loop(given: LoopLike, name: str, surface: NurbsSurface) -> Loop:
    """A loop with the surface's periods."""
    if not isinstance(given, (Loop, NurbsCurve, Iterable)):
        raise TypeError(f"{name} is {given!r}; expected a Loop, a NurbsCurve or several")
    curves, tolerance = (given.curves, given.tolerance) if isinstance(given, Loop) else (given, TOLERANCE)
    return Loop.unchecked(curves, tolerance, surface._periods, name)


def _in_domain(
    curves: tuple[NurbsCurve, ...], name: str, surface: NurbsSurface, tolerance: Array
) -> tuple[NurbsCurve, ...]:
    """Curves inside the domain of open directions, their control points near an edge of it moved onto the edge.

    What is farther beyond, up to the tolerance, is moved there as well.
    """
    made = list(curves)
    for axis in range(2):
        if surface.closed[axis]:
            continue
        low, high = surface.domain[axis]
        slack = SLACK * (high - low)
        given = np.concatenate([curve.control_points[:, axis] for curve in made])
        if given.min() < low - slack or given.max() > high + slack:
            for k, curve in enumerate(made):
                row = curve.control_points[:, axis]
                if row.min() >= low - slack and row.max() <= high + slack:
                    continue
                a, b = extent(curve, axis)
                if a < low - tolerance[axis] or b > high + tolerance[axis]:
                    raise InputError(
                        f"{name} leaves the domain: curve {k} has {'uv'[axis]} from {a:g} to {b:g}; "
                        f"expected {'uv'[axis]} in [{low:g}, {high:g}]"
                    )
                if a < low - slack or b > high + slack:
                    made[k] = clipped(curve, axis, low, high)
        # A pole edge or a natural edge that was meant is met exactly.
        for k, curve in enumerate(made):
            points = curve.control_points
            near = [np.abs(points[:, axis] - edge) <= slack for edge in (low, high)]
            if any((at & (points[:, axis] != edge)).any() for at, edge in zip(near, (low, high), strict=True)):
                points = points.copy()
                for at, edge in zip(near, (low, high), strict=True):
                    points[at, axis] = edge
                made[k] = NurbsCurve(points, curve.knots, curve.degree, curve.weights, name=curve.name)
    return tuple(made)


def _crossed(found: tuple[int, int, Array], chains: Sequence[range], names: Sequence[str]) -> InputError:
    """What is raised where curves of a boundary meet beside their common corners."""
    k, m = sorted(n for curve in found[:2] for n, chain in enumerate(chains) if curve in chain)
    place = f"near (u, v) = ({found[2][0]:.6g}, {found[2][1]:.6g})"
    if names[k] == names[m]:
        return InputError(f"{names[k]} crosses or touches itself {place}; expected a loop without crossings")
    return InputError(f"{names[m]} crosses or touches {names[k]} {place}; expected loops that are apart")


def _check_bounds(sheet: _Sheet, table: TrimTable, names: Sequence[str]) -> None:
    """Raise where loops do not bound one face, or it would reach an end of the domain without a boundary there."""
    for k, name in enumerate(names):
        if table.left[k] != 1.0 or table.right[k] != 0.0:
            raise InputError(
                f"{name} does not bound one face together with {names[0]}: on its left there is material "
                f"{table.left[k]:g} times, on its right {table.right[k]:g} times; expected holes inside the outer "
                "loop, none inside another, and rings with material on their left"
            )
    domain, closed, poles = sheet
    if not (poles or any(closed)) and table.beyond[0][0] != 0.0:
        raise InputError(f"a hole goes around {names[0]}, with material outside of it; expected holes inside it")
    for axis, (bit_low, bit_high) in ((1, (4, 8)), (0, (1, 2))):
        if closed[axis] or not closed[1 - axis]:
            continue
        for bit, w, end in zip((bit_low, bit_high), table.beyond[axis], domain[axis], strict=True):
            if w != 0.0 and not poles & bit:
                raise InputError(
                    f"{names[0]} has material up to the end of the domain at {'uv'[axis]} = {end:g}; expected a "
                    f"second loop around, or a loop along {'uv'[axis]} = {end:g}"
                )


@lru_cache(maxsize=256)
def _natural_boundary(sheet: _Sheet) -> tuple[tuple[NurbsCurve, ...], tuple[range, ...], TrimTable]:
    """Curves, chains and table of whole surfaces; many of a body are the same in their parameters."""
    chains, silent = _natural_chains(sheet)
    curves, ranges, table = _table_of([(chain, bool(np.isfinite(turn).all())) for chain, turn in chains], sheet, silent)
    _check_bounds(sheet, table, [_EDGE] * len(chains))
    return curves, ranges, table


def _natural_chains(sheet: _Sheet) -> tuple[list[tuple[list[NurbsCurve], Array]], list[NurbsCurve]]:
    """Chains of the edges of the domain, with the way once around, and the pole edges."""
    edges, silent = _natural(sheet)
    chains = []
    for chain in edges:
        jump = curve_ends(chain[-1])[1] - curve_ends(chain[0])[0]
        closes = [x == 0.0 or abs(x) == p for x, p in zip(jump, sheet.periods, strict=True)]
        chains.append((chain, jump if all(closes) else np.full(2, np.nan)))
    return chains, silent


def _tolerances(surface: NurbsSurface, tolerance: float | None) -> Array:
    """What a tolerance in space is in u and in v."""
    length = OVERSHOOT * surface.size if tolerance is None else tolerance
    least = SLACK * np.ptp(np.array(surface.domain), axis=1)
    return np.asarray(np.maximum(length / np.maximum(rates(surface), 1e-300), least))


def make_boundary(
    surface: NurbsSurface, outer: LoopLike | None, holes: Sequence[LoopLike], tolerance: float | None = None
) -> Boundary:
    """Check loops and turn them; see `Face`."""
    if outer is None and not holes:
        return Boundary(surface, None, (), *_natural_boundary(_Sheet.of(surface)))
    if outer is not None and (plain := plain_boundary(surface, outer, holes, SLACK)) is not None:
        return Boundary(surface, plain[0][0], tuple(plain[0][1:]), *plain[1:])
    chains: list[tuple[list[NurbsCurve], Array]] = []
    names: list[str] = []
    silent: list[NurbsCurve] = []
    outer_loop = None if outer is None else _as_loop(outer, "outer", surface)
    hole_loops = [_as_loop(hole, f"holes[{k}]", surface) for k, hole in enumerate(holes)]
    loops = hole_loops if outer_loop is None else [outer_loop, *hole_loops]
    if loops and not _are_inside(loops, surface):
        allowed = _tolerances(surface, tolerance)
        slack = SLACK * np.ptp(np.array(surface.domain), axis=1)
        if outer_loop is not None:
            surface = widened(surface, [curve for loop in loops for curve in loop.curves], slack, allowed)
        for k, loop in enumerate(loops, 0 if outer_loop is not None else 1):
            loop.curves = _in_domain(loop.curves, f"holes[{k - 1}]" if k else "outer", surface, allowed)
    if outer_loop is None:
        chains, silent = _natural_chains(_Sheet.of(surface))
        names = [_EDGE] * len(chains)
    else:
        if not outer_loop.turn.any() and outer_loop.is_clockwise:
            outer_loop = outer_loop.reversed()
        chains, silent = without_seams(outer_loop, surface)
        names = ["outer"] * len(chains)
    for k, loop in enumerate(hole_loops):
        if not loop.turn.any() and not loop.is_clockwise:
            hole_loops[k] = loop = loop.reversed()
        more, points = without_seams(loop, surface)
        chains += more
        silent += points
        names += [f"holes[{k}]"] * len(more)
    made = _Made(surface, outer_loop, tuple(hole_loops), silent)
    return _bounding(made, chains, names, tolerance)


@dataclass(frozen=True, eq=False)
class _Made:
    """Loops that are in the domain and turned, and the edges of theirs that are one point."""

    surface: NurbsSurface
    outer: Loop | None
    holes: tuple[Loop, ...]
    silent: list[NurbsCurve]


def _are_inside(loops: Sequence[Loop], surface: NurbsSurface) -> bool:
    """Whether no control point is beyond the domain, or so near to its edge that it has to be moved there."""
    points = np.concatenate([curve.control_points for loop in loops for curve in loop.curves])
    least, most = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    for axis, (low, high) in enumerate(surface.domain):
        if surface.closed[axis]:
            continue
        row, slack = points[:, axis], SLACK * (high - low)
        if least[axis] > low + 2.0 * slack and most[axis] < high - 2.0 * slack:
            continue
        off = (np.abs(row - low) <= slack) & (row != low) | (np.abs(row - high) <= slack) & (row != high)
        if off.any() or row.min() < low or row.max() > high:
            return False
    return True


def _table_of(
    chains: Sequence[tuple[list[NurbsCurve], bool]], sheet: _Sheet, silent: Sequence[NurbsCurve]
) -> tuple[tuple[NurbsCurve, ...], tuple[range, ...], TrimTable]:
    curves = tuple(curve for chain, _ in chains for curve in chain)
    stops = np.cumsum([0] + [len(chain) for chain, _ in chains]).tolist()
    ranges = tuple(range(a, b) for a, b in zip(stops[:-1], stops[1:], strict=True))
    poles = silent if curves else ()
    table = build(curves, ranges, [closes for _, closes in chains], poles, sheet.domain, sheet.periods)
    return curves, ranges, table


def _bounding(
    made: _Made, chains: list[tuple[list[NurbsCurve], Array]], names: list[str], tolerance: float | None
) -> Boundary:
    """Chains as a boundary, cut and linked anew where loops touch."""
    surface, outer, holes = made.surface, made.outer, made.holes
    rows = [(chain, bool(np.isfinite(turn).all())) for chain, turn in chains]
    curves, ranges, table = _table_of(rows, _Sheet.of(surface), made.silent)
    if outer is not None or holes:
        found = table.crossing(TOLERANCE)
        if found is not None:
            nearest = table.nearness(TOLERANCE)
            side = np.ptp(np.array(surface.domain), axis=1)
            allowed = float((_tolerances(surface, tolerance) / side).max())
            new = relinked(chains, names, surface, (table.extent, nearest, allowed))
            if new is None:
                raise _crossed(found, ranges, names)
            names = [chain.name for chain in new.chains]
            curves, ranges, table = _table_of(
                [(chain.curves, chain.closes) for chain in new.chains], _Sheet.of(surface), made.silent
            )
            if table.crossing(TOLERANCE, joined=True) is not None:
                raise _crossed(found, ranges, names)
            outer, holes = _loops_of(new, outer, holes, surface)
    _check_bounds(_Sheet.of(surface), table, names)
    return Boundary(surface, outer, holes, curves, ranges, table)


def _loops_of(
    new: Relinked, outer: Loop | None, holes: tuple[Loop, ...], surface: NurbsSurface
) -> tuple[Loop | None, tuple[Loop, ...]]:
    """Loops with their curves cut, all that touch as one, which touches itself; the given ones if some end at poles."""
    if not all(chain.closes for chain in new.walks):
        return outer, holes
    loops = [Loop.unchecked(chain.curves, TOLERANCE, surface._periods, chain.name) for chain in new.walks]
    around = new.chains[0].name
    names = [chain.name for chain in new.walks]
    first = names.index(around)
    return loops[first], tuple(loops[:first] + loops[first + 1 :])


def boundary_of_parts(boundary: Boundary, parts: Sequence[Sequence[NurbsCurve]]) -> Boundary:
    """The boundary with every curve replaced by its parts, which run head to tail; its loops stay as they are."""
    sheet = _Sheet.of(boundary.surface)
    chains, silent = [], [] if boundary.outer is not None else _natural(sheet)[1]
    for loop in (boundary.outer, *boundary.holes):
        if loop is not None:
            silent += without_seams(loop, boundary.surface)[1]
    for chain in boundary.chains:
        jump = curve_ends(boundary.curves[chain[-1]])[1] - curve_ends(boundary.curves[chain[0]])[0]
        closes = True
        for off, period, (low, high) in zip(jump.tolist(), sheet.periods, sheet.domain, strict=True):
            whole = round(off / period) * period if period else 0.0
            closes = closes and abs(off - whole) <= SLACK * (high - low)
        chains.append(([part for k in chain for part in parts[k]], closes))
    return Boundary(boundary.surface, boundary.outer, boundary.holes, *_table_of(chains, sheet, silent))
