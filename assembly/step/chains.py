"""Boundary curves of a face in (u, v) joined head to tail: moved by periods, and to where neighbors and seams meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly._record import place_of
from assembly.step.edge_ends import EDGE, join_ends
from assembly.step.profiles import Unreadable
from assembly.step.surfaces import Patch
from assembly.step.trims import Drawn, Pair, moved, shifted

__all__ = ["chained", "head_to_tail"]

Array = NDArray[np.float64]
# Ends that are nearer to each other, over the side of the domain, are apart by rounding alone.
ROUNDING = 1e-12
_LEVEL, _SEAM, TOLERANCE = (place_of(EDGE, name) for name in ("level", "seam", "tolerance"))


def _within(at: Array, patch: Patch) -> Array:
    """(u, v), which may lie beyond the domain, in it."""
    there = at.copy()
    for axis, ((low, high), closed) in enumerate(zip(patch.surface.domain, patch.surface.closed, strict=True)):
        there[..., axis] = (
            low + np.mod(at[..., axis] - low, high - low) if closed else np.clip(at[..., axis], low, high)
        )
    return there


def head_to_tail(drawn: Drawn, patch: Patch) -> Drawn:
    """Edges in an order in which each begins nearest to where the one before ends, up to periods."""
    period = patch.period
    whole = np.where(np.isfinite(period), period, 1.0)
    starts, stops = drawn.rows[:, :2], drawn.rows[:, 2:4]
    order, left = [0], list(range(1, len(starts)))
    while left:
        jumps = starts[left] - stops[order[-1]]
        jumps -= np.where(np.isfinite(period), np.round(jumps / whole) * whole, 0.0)
        order.append(left.pop(int(np.argmin(np.linalg.norm(jumps, axis=1)))))
    curves, names = [drawn.curves[k] for k in order], [drawn.names[k] for k in order]
    return drawn._replace(rows=drawn.rows[order], curves=curves, names=names)


def chained(drawn: Drawn, patch: Patch) -> tuple[Drawn, Array, float]:
    """Edges of one wire, head to tail, moved by periods and joined where they miss one another by the tolerance.

    Returns
    -------
    drawn, ends, gap
        Its curves are moved; where edges begin and end, (n, 2, 2); the largest gap that was closed, in space.

    Raises
    ------
    Unreadable
        Two curves are farther apart than their tolerance.
    """
    rows, n = drawn.rows.copy(), len(drawn.rows)
    periods, noise = np.array(patch.periods), ROUNDING * patch.sides
    shifts, before, joints = np.empty((n + 1, 2)), np.empty((n, 2)), np.empty((n, 2))
    worst = 0.0
    if join_ends(rows, periods, noise, shifts, before, joints):
        worst = _checked_gaps(rows, before, noise, patch)
    if drawn.seams:
        _match_seams(drawn, joints, patch.periods)
    ends = np.empty((n, 2, 2))
    ends[:, 0] = joints
    ends[:-1, 1] = joints[1:]
    # A boundary that runs around a closed surface ends whole periods from where it begins.
    ends[-1, 1] = joints[0] - shifts[n]
    curves = drawn.curves
    if any(curves):
        curves = list(curves)
        levels = rows[:, _LEVEL].tolist()
        polar = patch if patch.surface._pole_bits else None
        for k, ((start, end), by) in enumerate(zip(ends.tolist(), shifts[:n].tolist(), strict=True)):
            curve = curves[k]
            if curve is not None:
                curve = shifted(curve, shifts[k]) if any(by) else curve
                curves[k] = moved(curve, levels[k], (start[0], start[1]), (end[0], end[1]), polar)
    return drawn._replace(rows=rows, curves=curves), ends, worst


def _whole(to: Pair, at: Pair, periods: Pair) -> Pair:
    """The whole periods by which a point has to be moved to be next to another one."""
    (u, v), (period_u, period_v) = to, periods
    return (
        round((u - at[0]) / period_u) * period_u if period_u else 0.0,
        round((v - at[1]) / period_v) * period_v if period_v else 0.0,
    )


def _checked_gaps(rows: Array, before: Array, noise: Array, patch: Patch) -> float:
    """The largest gap in space at the start of an edge, where the one before ends; raise beyond their tolerances."""
    after = rows[:, :2]
    apart = np.flatnonzero(~(np.abs(before - after) <= noise).all(axis=1))
    # Points may lie beyond the domain.
    at = _within(np.array([before[apart], after[apart]]), patch)
    points = patch.surface.evaluate(at[..., 0], at[..., 1])
    gaps = np.linalg.norm(points[0] - points[1], axis=1)
    tolerances = rows[:, TOLERANCE]
    for gap, forgiven in zip(gaps.tolist(), (2.0 * (tolerances[apart - 1] + tolerances[apart])).tolist(), strict=True):
        if gap > forgiven:
            raise Unreadable(f"two edges that should meet are {gap:.2g} mm apart")
    return float(gaps.max())


def _match_seams(drawn: Drawn, joints: Array, periods: Pair) -> None:
    """Make both sides of a seam, which is one edge run to and fro, end at the same places up to a period."""
    names, n = drawn.names, len(joints)
    for i, is_seam in enumerate(drawn.rows[:, _SEAM].tolist()):
        for j in range(i + 1, n if is_seam else 0):
            if names[j] != names[i]:
                continue
            for here, there in ((i, (j + 1) % n), ((i + 1) % n, j)):
                if here == there:
                    continue
                (u, v), (x, y) = joints[here].tolist(), joints[there].tolist()
                by = _whole((u, v), (x, y), periods)
                off_u, off_v = u - x - by[0], v - y - by[1]
                joints[here] = u - 0.5 * off_u, v - 0.5 * off_v
                joints[there] = x + 0.5 * off_u, y + 0.5 * off_v
