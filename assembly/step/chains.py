"""Boundary curves of a face in (u, v) joined head to tail: moved by periods, and to where neighbors and seams meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.step.profiles import Unreadable
from assembly.step.surfaces import Patch
from assembly.step.trims import Edge, Pair

__all__ = ["chained", "head_to_tail"]

Array = NDArray[np.float64]
# Ends that are nearer to each other, over the side of the domain, are apart by rounding alone.
ROUNDING = 1e-12


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
    periods = patch.periods
    rows = edges
    if any(periods):
        rows = edges[:1]
        for edge in edges[1:]:
            by = _whole(rows[-1].corners[1], edge.corners[0], periods)
            rows.append(edge.shifted(by) if any(by) else edge)
    corners = [edge.corners for edge in rows]
    # A boundary that runs around a closed surface ends whole periods from where it begins.
    ring = _whole(corners[0][0], corners[-1][1], periods)
    # Joint k is where edge k begins.
    before = [(u + 0.0, v + 0.0) for _, (u, v) in corners[-1:] + corners[:-1]]
    before[0] = (before[0][0] + ring[0], before[0][1] + ring[1])
    after = [start for start, _ in corners]
    worst = _checked_gaps(rows, before, after, patch)
    joints = [
        _joint(last, edge, b, a) for last, edge, b, a in zip(rows[-1:] + rows[:-1], rows, before, after, strict=True)
    ]
    _match_seams(rows, joints, periods)
    stops = joints[1:] + joints[:1]
    stops[-1] = (stops[-1][0] - ring[0], stops[-1][1] - ring[1])
    return [edge.moved(start, end) for edge, start, end in zip(rows, joints, stops, strict=True)], worst


def _whole(to: Pair, at: Pair, periods: Pair) -> Pair:
    """The whole periods by which a point has to be moved to be next to another one."""
    (u, v), (period_u, period_v) = to, periods
    return (
        round((u - at[0]) / period_u) * period_u if period_u else 0.0,
        round((v - at[1]) / period_v) * period_v if period_v else 0.0,
    )


def _joint(last: Edge, edge: Edge, before: Pair, after: Pair) -> Pair:
    """Where two edges meet.

    If one of them alone is loose, at the end of the other one. Else in the middle between both ends, except that an
    edge with a constant u or v keeps that coordinate.
    """
    if last.loose != edge.loose:
        return before if edge.loose else after
    u, v = (
        0.5 * (b + a) if last_level == level else b if last_level else a
        for last_level, level, b, a in zip(last.level, edge.level, before, after, strict=True)
    )
    return u, v


def _checked_gaps(rows: list[Edge], before: list[Pair], after: list[Pair], patch: Patch) -> float:
    """The largest gap in space at the start of an edge, where the one before ends; raise beyond their tolerances."""
    noise_u, noise_v = (ROUNDING * side for side in patch.lengths)
    apart = [
        k
        for k, ((u, v), (x, y)) in enumerate(zip(before, after, strict=True))
        if not (abs(u - x) <= noise_u and abs(v - y) <= noise_v)
    ]
    if not apart:
        return 0.0
    # Points may lie beyond the domain.
    at = _within(np.array([[before[k] for k in apart], [after[k] for k in apart]]), patch)
    points = patch.surface.evaluate(at[..., 0], at[..., 1])
    gaps = np.linalg.norm(points[0] - points[1], axis=1).tolist()
    for k, gap in zip(apart, gaps, strict=True):
        if gap > 2.0 * (rows[k - 1].tolerance + rows[k].tolerance):
            raise Unreadable(f"two edges that should meet are {gap:.2g} mm apart")
    return float(max(gaps))


def _match_seams(rows: list[Edge], joints: list[Pair], periods: Pair) -> None:
    """Make both sides of a seam, which is one edge run to and fro, end at the same places up to a period."""
    for i, edge in enumerate(rows):
        for j in range(i + 1, len(rows) if edge.seam else 0):
            if rows[j].name != edge.name:
                continue
            for here, there in ((i, (j + 1) % len(rows)), ((i + 1) % len(rows), j)):
                if here == there:
                    continue
                (u, v), (x, y) = joints[here], joints[there]
                by = _whole((u, v), (x, y), periods)
                off_u, off_v = u - x - by[0], v - y - by[1]
                joints[here] = (u - 0.5 * off_u, v - 0.5 * off_v)
                joints[there] = (x + 0.5 * off_u, y + 0.5 * off_v)
