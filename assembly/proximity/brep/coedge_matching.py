"""Boundary curves of two faces that are one edge: they run through the same points in opposite directions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import pi

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.curve_parts import CORNER
from assembly.proximity.brep.boundary_curves import Batch, Rim, Survey, cross

__all__ = ["STATIONS", "Match", "matches_of"]

Array = NDArray[np.float64]
# Lengths of one curve on two faces differ by less.
_SAME_LENGTH = 1e-2
# Between common ends curves may be so many times the tolerance apart: files approximate where curved faces meet.
_LOOSE = 10.0
# Where two curves are compared, as parts of the domain.
STATIONS = np.linspace(0.0, 1.0, 11)[1:-1]


@dataclass(frozen=True, eq=False)
class Match:
    """Two rims through the same points: how far apart they are, the map of parameters, and how they bend."""

    distance: float
    a: Rim
    b: Rim
    map_b: tuple[float, float]
    convex: bool | None


def _compared(pairs: list[tuple[Rim, Rim]], signs: Array, survey: Survey) -> list[Match]:
    """The matches among pairs of rims: those that run through the same points in opposite directions."""
    pairs = [
        (a, b)
        for a, b in pairs
        if abs(a.length - b.length) <= _SAME_LENGTH * max(a.length, b.length) + 4.0 * survey.tolerance
    ]
    if not pairs:
        return []
    count, stations = len(pairs), STATIONS.size
    rows = np.repeat(np.arange(count), stations)
    first, second = Batch(survey, [a for a, _ in pairs]), Batch(survey, [b for _, b in pairs])
    domains = np.array([(a.curve.domain, b.curve.domain) for a, b in pairs])
    t = domains[:, 0, :1] + (domains[:, 0, 1:] - domains[:, 0, :1]) * STATIONS
    guess = domains[:, 1, 1:] - (domains[:, 1, 1:] - domains[:, 1, :1]) * STATIONS
    points, tangents, normals = first.along(rows, t.ravel())
    at_b, distance = second.nearest(rows, points, guess.ravel())
    _, other_tangents, other_normals = second.along(rows, at_b)
    furthest = distance.reshape(count, stations).max(axis=1)
    # Seen from outside: a face that is reversed has its material on the other side.
    sign_a, sign_b = (signs[[pair[k].number for pair in pairs]][:, None, None] for k in range(2))
    along_a, normal_a, along_b, normal_b = (
        sign * vectors.reshape(count, stations, 3)
        for sign, vectors in ((sign_a, tangents), (sign_a, normals), (sign_b, other_tangents), (sign_b, other_normals))
    )
    opposite = (along_a * along_b).sum(axis=(1, 2)) < 0.0
    at_b = at_b.reshape(count, stations)
    bends = _bends(normal_a, along_a, normal_b)
    result = []
    for k, (a, b) in enumerate(pairs):
        if not opposite[k] or furthest[k] > survey.tolerance * (_LOOSE if a.anchored else 1.0):
            continue
        low, high = b.curve.domain
        there = np.unwrap(at_b[k], period=high - low) if b.closed else at_b[k]
        centered = t[k] - t[k].mean()
        slope = float(centered @ there / (centered @ centered))
        shift = float(there.mean() - slope * t[k].mean())
        result.append(Match(float(furthest[k]), a, b, (shift, slope), bends[k]))
    return result


def _bends(normals_a: Array, along_a: Array, normals_b: Array) -> list[bool | None]:
    """Whether two faces each make a convex edge: from their normals and the first one's tangents (n, stations, 3)."""
    inward = cross(normals_a, along_a)
    size_a, size_b = np.linalg.norm(normals_a, axis=2), np.linalg.norm(normals_b, axis=2)
    size = np.linalg.norm(inward, axis=2) * size_b
    regular = (size > 0.0) & (size_a > 0.0)
    sine = -(inward * normals_b).sum(axis=2) / np.where(regular, size, 1.0)
    cosine = (normals_a * normals_b).sum(axis=2) / np.where(regular, size_a * size_b, 1.0)
    angle = np.where(regular, np.arctan2(sine, cosine), 0.0)
    # Folded back on itself, an edge is a blade whichever way rounding turns it.
    largest, least = angle.max(axis=1), angle.min(axis=1)
    convex = (largest > CORNER) | (least < CORNER - pi)
    bends = np.where(convex, 1, np.where(least < -CORNER, -1, 0))
    return [None if bend == 0 else bend > 0 for bend in bends.tolist()]


def matches_of(
    boundaries: Sequence[Rim], ends: dict[Rim, tuple[int, int]], signs: Array, survey: Survey
) -> dict[Rim, Match]:
    """The match of every rim that has one."""
    groups: dict[tuple[int, int], list[Rim]] = defaultdict(list)
    for boundary, (start, end) in ends.items():
        groups[min(start, end), max(start, end)].append(boundary)
    candidates = [pair for group in groups.values() for pair in combinations(group, 2)]
    rings = [boundary for boundary in boundaries if not boundary.anchored]
    if rings:
        from scipy.spatial import cKDTree

        middles = np.array([boundary.middle for boundary in rings])
        near = cKDTree(middles).query_ball_point(middles, [0.05 * boundary.length for boundary in rings])
        candidates += [(rings[i], rings[j]) for i, found in enumerate(near) for j in found if i < j]
    found = _compared(candidates, signs, survey)
    found.sort(key=lambda match: match.distance)
    taken: dict[Rim, Match] = {}
    for match in found:
        if match.a not in taken and match.b not in taken:
            taken[match.a] = taken[match.b] = match
    return taken
