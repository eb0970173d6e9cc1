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
from assembly.geometry.faces.trim_table import TrimTable, build
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Boundary", "LoopLike", "make_boundary"]

Array = NDArray[np.float64]
LoopLike = NurbsCurve | Iterable[NurbsCurve] | Loop
# Chains, with the way from the start of each to its end if that is whole periods; their names; edges that are points.
_Chains = tuple[list[tuple[list[NurbsCurve], Array]], list[str], list[NurbsCurve]]
# How far beyond the domain, or off a pole edge or a seam, a curve may be, as a part of the domain.
SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Boundary:
    """Loops as given (turned), all boundary curves, which of them make a chain, pole edges, and the table."""

    outer: Loop | None
    holes: tuple[Loop, ...]
    curves: tuple[NurbsCurve, ...]
    chains: tuple[range, ...]
    table: TrimTable


def segment(start: Array, end: Array) -> NurbsCurve:
    """A line in the plane with speed one."""
    length = float(np.linalg.norm(np.subtract(end, start)))
    return NurbsCurve(np.array([start, end]), [0.0, 0.0, length, length], 1)


def _pole_edges(surface: NurbsSurface) -> list[tuple[int, float]]:
    """Axis and value of the edges of the domain that are one point."""
    ends = [(axis, surface.domain[axis][side]) for axis in range(2) for side in range(2)]
    return [end for k, end in enumerate(ends) if surface._pole_bits >> k & 1]


class _Domain(NamedTuple):
    """What the boundary of a whole surface depends on: its domain, closed directions, periods and bits of poles."""

    ends: tuple[tuple[float, float], tuple[float, float]]
    closed: tuple[bool, bool]
    periods: tuple[float, float]
    poles: int


def _natural(domain: _Domain) -> tuple[list[list[NurbsCurve]], list[NurbsCurve]]:
    """Chains of the edges of the domain, counterclockwise, and the pole edges."""
    (a, b), (c, d) = domain.ends
    corners = np.array([[a, c], [b, c], [b, d], [a, d]])
    closed, poles = domain.closed, domain.poles
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


def _on_line(curve: NurbsCurve, axis: int, value: float, slack: float) -> bool:
    return bool(np.abs(curve.control_points[:, axis] - value).max() <= slack)


def _are_seam(a: NurbsCurve, b: NurbsCurve, period: Array, slack: Array) -> bool:
    """Whether b runs back along a, one period away."""
    ends_a, ends_b = curve_ends(a), curve_ends(b)[::-1]
    jump = ends_b - ends_a
    whole = np.where(period > 0.0, np.round(jump / np.where(period > 0.0, period, 1.0)) * period, 0.0)
    if not whole.any() or (np.abs(jump - whole) > slack).any():
        return False
    # Straight lines along the edge of the domain, or the same curve point by point.
    axis = int(np.argmax(np.abs(whole[0])))
    if _on_line(a, axis, ends_a[0, axis], slack[axis]) and _on_line(b, axis, ends_b[0, axis], slack[axis]):
        return True
    part = np.linspace(0.0, 1.0, 9)
    points = a.evaluate(a.domain[0] + part * (a.domain[1] - a.domain[0]))
    others = b.evaluate(b.domain[1] - part * (b.domain[1] - b.domain[0]))
    return bool((np.abs(others - points - whole[0]) <= slack).all())


def _without_seams(loop: Loop, surface: NurbsSurface) -> tuple[list[tuple[list[NurbsCurve], Array]], list[NurbsCurve]]:
    """Chains of a loop (with the way from their start to their end if that is whole periods), and pole edges."""
    curves = list(loop.curves)
    slack = SLACK * np.ptp(np.array(surface.domain), axis=1)
    period = np.array(surface._periods)
    silent: list[NurbsCurve] = []
    keep = np.ones(len(curves), dtype=bool)
    for axis, value in _pole_edges(surface):
        for k, curve in enumerate(curves):
            if keep[k] and _on_line(curve, axis, value, slack[axis]):
                keep[k] = False
                ends = curve_ends(curve)
                ends[:, axis] = value
                silent.append(segment(*ends))
    if period.any():
        ends = np.array([curve_ends(curve) for curve in curves])
        jump = ends[None, :, ::-1] - ends[:, None]
        whole = np.where(period > 0.0, np.round(jump / np.where(period > 0.0, period, 1.0)) * period, 0.0)
        for k, other in np.argwhere((np.abs(jump - whole) <= slack).all(axis=(2, 3))).tolist():
            if k < other and keep[k] and keep[other] and _are_seam(curves[k], curves[other], period, slack):
                keep[k] = keep[other] = False
    if keep.all():
        return [(curves, loop.turn)], silent
    # Runs of what is left, then linked where one ends at the start of another.
    count = len(curves)
    runs: list[list[NurbsCurve]] = []
    for k in range(count):
        if keep[k]:
            if runs and keep[k - 1] and k > 0:
                runs[-1].append(curves[k])
            else:
                runs.append([curves[k]])
    if len(runs) > 1 and keep[0] and keep[-1]:
        runs[0] = runs.pop() + runs[0]
    whole = np.where(period > 0.0, period, 1.0)
    reach = max(loop.tolerance, SLACK) * loop.size

    def apart(a: list[NurbsCurve], b: list[NurbsCurve]) -> Array:
        jump = curve_ends(a[-1])[1] - curve_ends(b[0])[0]
        return np.asarray(jump - np.where(period > 0.0, np.round(jump / whole) * period, 0.0))

    chains = []
    while runs:
        chain = runs.pop(0)
        while np.abs(apart(chain, chain)).max() > reach:
            follows = [k for k, run in enumerate(runs) if np.abs(apart(chain, run)).max() <= reach]
            if not follows:
                break
            chain = chain + runs.pop(follows[0])
        # Joined once more: by whole periods, and exactly at the new corners.
        if np.abs(apart(chain, chain)).max() <= reach:
            joined = Loop.unchecked(chain, 2.0 * reach / loop.size, surface._periods, "loop")
            chains.append((list(joined.curves), joined.turn))
        else:
            chains.append((chain, np.full(2, np.nan)))
    return chains, silent


def _as_loop(given: LoopLike, name: str, surface: NurbsSurface) -> Loop:
    """A loop with the surface's periods, inside the domain of its open directions."""
    if isinstance(given, Loop):
        loop = Loop.unchecked(given.curves, given.tolerance, surface._periods, name)
    else:
        if not isinstance(given, (NurbsCurve, Iterable)):
            raise TypeError(f"{name} is {given!r}; expected a Loop, a NurbsCurve or several")
        loop = Loop.unchecked(given, TOLERANCE, surface._periods, name)
    loop.curves = _in_domain(loop.curves, name, surface)
    return loop


def _in_domain(curves: tuple[NurbsCurve, ...], name: str, surface: NurbsSurface) -> tuple[NurbsCurve, ...]:
    """Curves inside the domain of open directions, their control points near an edge of it moved onto the edge."""
    counts = [len(curve.weights) for curve in curves]
    given = np.concatenate([curve.control_points for curve in curves])
    starts = np.cumsum([0, *counts[:-1]])
    points = given.copy()
    for axis in range(2):
        if surface.closed[axis]:
            continue
        low, high = surface.domain[axis]
        slack = SLACK * (high - low)
        least = np.minimum.reduceat(given[:, axis], starts)
        most = np.maximum.reduceat(given[:, axis], starts)
        for k in np.flatnonzero((least < low - slack) | (most > high + slack)).tolist():
            a, b = _extent(curves[k], axis)
            if a < low - slack or b > high + slack:
                raise InputError(
                    f"{name} leaves the domain: curve {k} has {'uv'[axis]} from {a:g} to {b:g}; "
                    f"expected {'uv'[axis]} in [{low:g}, {high:g}]"
                )
        # A pole edge or a natural edge that was meant is met exactly.
        for edge in (low, high):
            points[np.abs(points[:, axis] - edge) <= slack, axis] = edge
    changed = np.add.reduceat((points != given).any(axis=1), starts) > 0
    if not changed.any():
        return curves
    return tuple(
        NurbsCurve(points[first : first + count], curve.knots, curve.degree, curve.weights, name=curve.name)
        if differs
        else curve
        for curve, first, count, differs in zip(curves, starts, counts, changed, strict=True)
    )


def _extent(curve: NurbsCurve, axis: int) -> tuple[float, float]:
    """Least and largest coordinate of a curve itself, by refined samples."""
    at = curve.breaks()
    t = np.unique(np.concatenate([np.linspace(a, b, 65) for a, b in zip(at[:-1], at[1:], strict=True)]))
    result = []
    for sign in (1.0, -1.0):
        grid = t
        for _ in range(6):
            values = sign * curve.evaluate(grid)[:, axis]
            k = int(np.argmin(values))
            grid = np.linspace(grid[max(k - 1, 0)], grid[min(k + 1, grid.size - 1)], 65)
        result.append(sign * float((sign * curve.evaluate(grid)[:, axis]).min()))
    return result[0], result[1]


def _check_apart(table: TrimTable, chains: Sequence[range], names: Sequence[str]) -> None:
    """Raise where curves of a boundary meet beside their common corners."""
    found = table.crossing(TOLERANCE)
    if found is None:
        return
    k, m = sorted(n for curve in found[:2] for n, chain in enumerate(chains) if curve in chain)
    place = f"near (u, v) = ({found[2][0]:.6g}, {found[2][1]:.6g})"
    if names[k] == names[m]:
        raise InputError(f"{names[k]} crosses or touches itself {place}; expected a loop without crossings")
    raise InputError(f"{names[m]} crosses or touches {names[k]} {place}; expected loops that are apart")


def _check_ended(domain: _Domain, table: TrimTable, names: Sequence[str]) -> None:
    """Raise where a face would reach an end of the domain without a boundary there."""
    for axis, (bit_low, bit_high) in ((1, (4, 8)), (0, (1, 2))):
        if domain.closed[axis] or not domain.closed[1 - axis]:
            continue
        for bit, w, end in zip((bit_low, bit_high), table.beyond[axis], domain.ends[axis], strict=True):
            if w != 0.0 and not domain.poles & bit:
                raise InputError(
                    f"{names[0]} has material up to the end of the domain at {'uv'[axis]} = {end:g}; expected a "
                    f"second loop around, or a loop along {'uv'[axis]} = {end:g}"
                )


def make_boundary(surface: NurbsSurface, outer: LoopLike | None, holes: Sequence[LoopLike]) -> Boundary:
    """Check loops and turn them; see `Face`."""
    domain = _Domain(surface.domain, surface.closed, surface._periods, surface._pole_bits)
    if outer is None and not holes:
        return _boundary_of(domain)
    if outer is None:
        chains, names, silent = _edges(domain)
        outer_loop = None
    else:
        outer_loop = _as_loop(outer, "outer", surface)
        if not outer_loop.turn.any() and outer_loop.area < 0.0:
            outer_loop = outer_loop.reversed()
        chains, silent = _without_seams(outer_loop, surface)
        names = ["outer"] * len(chains)
    hole_loops = []
    for k, hole in enumerate(holes):
        loop = _as_loop(hole, f"holes[{k}]", surface)
        if not loop.turn.any() and loop.area > 0.0:
            loop = loop.reversed()
        hole_loops.append(loop)
        more, points = _without_seams(loop, surface)
        chains += more
        silent += points
        names += [f"holes[{k}]"] * len(more)
    return _joined(domain, (chains, names, silent), outer_loop, hole_loops)


def _edges(domain: _Domain) -> _Chains:
    """The edge of a domain."""
    chains = []
    edges, silent = _natural(domain)
    for chain in edges:
        jump = curve_ends(chain[-1])[1] - curve_ends(chain[0])[0]
        closes = [x == 0.0 or abs(x) == p for x, p in zip(jump, domain.periods, strict=True)]
        chains.append((chain, jump if all(closes) else np.full(2, np.nan)))
    return chains, ["the edge of the domain"] * len(chains), silent


@lru_cache(maxsize=256)
def _boundary_of(domain: _Domain) -> Boundary:
    """That of a whole surface: walls of one size have the same."""
    return _joined(domain, _edges(domain), None, [])


def _joined(domain: _Domain, found: _Chains, outer_loop: Loop | None, hole_loops: list[Loop]) -> Boundary:
    """The boundary of chains, checked to bound one face."""
    chains, names, silent = found
    curves = tuple(curve for chain, _ in chains for curve in chain)
    stops = np.cumsum([0] + [len(chain) for chain, _ in chains]).tolist()
    ranges = tuple(range(a, b) for a, b in zip(stops[:-1], stops[1:], strict=True))
    closing = [bool(np.isfinite(turn).all()) for _, turn in chains]
    table = build(curves, ranges, closing, silent if curves else (), domain.ends, domain.periods)
    if outer_loop is not None or hole_loops:
        _check_apart(table, ranges, names)
    for k, name in enumerate(names):
        if table.left[k] != 1.0 or table.right[k] != 0.0:
            raise InputError(
                f"{name} does not bound one face together with {names[0]}: on its left there is material "
                f"{table.left[k]:g} times, on its right {table.right[k]:g} times; expected holes inside the outer "
                "loop, none inside another, and rings with material on their left"
            )
    _check_ended(domain, table, names)
    return Boundary(outer_loop, tuple(hole_loops), curves, ranges, table)
