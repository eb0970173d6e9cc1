"""Boundary curves cut where others end, so that one of a face is one of its neighbor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.brep.boundary_curves import Batch, Rim, Survey

__all__ = ["Ends", "all_live", "cut_at_vertices", "live_boundaries"]

Array = NDArray[np.float64]
Ends = dict[Rim, tuple[int, int]]


def live_boundaries(boundaries: Iterable[Rim]) -> list[Rim]:
    """Those that are not points."""
    return [boundary for boundary in boundaries if not boundary.is_point]


def all_live(chains: Sequence[list[list[Rim]]]) -> list[Rim]:
    """Those that are not points, of the loops of all faces."""
    return [boundary for loops in chains for loop in loops for boundary in live_boundaries(loop)]


def _replaced(loops: list[list[Rim]], cuts: dict[Rim, Array], survey: Survey) -> None:
    """Cut rims of the loops of a face, in place."""
    parts = {boundary: boundary.parts(at) for boundary, at in cuts.items()}
    survey.measure(part for each in parts.values() for part in each)
    for k, loop in enumerate(loops):
        loops[k] = [part for boundary in loop for part in parts.get(boundary, [boundary])]


def cut_at_vertices(chains: list[list[list[Rim]]], survey: Survey) -> tuple[set[int], Array, Ends]:
    """Cut rims at corners and where other rims end, in place.

    The numbers of the faces that changed come back, the vertices (n, 3) of the end, and the pair of them of every rim.
    """
    changed = set()

    def cut(found: dict[Rim, Array]) -> None:
        for number in {boundary.number for boundary, at in found.items() if at.size}:
            _replaced(
                chains[number],
                {boundary: at for boundary, at in found.items() if boundary.number == number and at.size},
                survey,
            )
            changed.add(number)

    cut(survey.corners(all_live(chains)))
    lone = [live[0] for loops in chains for loop in loops if len(live := live_boundaries(loop)) == 1 and live[0].closed]
    for boundary, corner in zip(lone, survey.close_with_corners(lone).tolist(), strict=True):
        boundary.anchored = corner
    while True:
        boundaries = all_live(chains)
        points, ends = _merged(boundaries, survey.tolerance)
        found = _crossings(boundaries, points, ends, survey)
        if not found:
            return changed, points, ends
        cut(found)


def _merged(boundaries: Sequence[Rim], tolerance: float) -> tuple[Array, Ends]:
    """Vertices (n, 3) where anchored rims end, and the pair of them of every such rim."""
    anchored = [boundary for boundary in boundaries if boundary.anchored]
    if not anchored:
        return np.empty((0, 3)), {}
    # Loaded only here: it takes a tenth of a second, and bodies without edges do without.
    from scipy.spatial import cKDTree

    ends = np.concatenate([boundary.ends for boundary in anchored])
    labels = _joined(len(ends), cKDTree(ends).query_pairs(tolerance))
    count = int(labels.max()) + 1
    points = np.zeros((count, 3))
    np.add.at(points, labels, ends)
    points /= np.bincount(labels, minlength=count)[:, None]
    numbers = labels.reshape(-1, 2).tolist()
    return points, {boundary: (start, end) for boundary, (start, end) in zip(anchored, numbers, strict=True)}


def _joined(count: int, pairs: Iterable[tuple[int, int]]) -> NDArray[np.int64]:
    """Of so many things, some of which are joined in pairs, the numbers of what they are joined to, in their order."""
    first = list(range(count))

    def root(k: int) -> int:
        while first[k] != k:
            first[k] = first[first[k]]
            k = first[k]
        return k

    for i, j in pairs:
        a, b = root(i), root(j)
        first[max(a, b)] = min(a, b)
    numbers: dict[int, int] = {}
    return np.array([numbers.setdefault(root(k), len(numbers)) for k in range(count)], dtype=np.int64)


def _crossings(boundaries: Sequence[Rim], points: Array, ends: Ends, survey: Survey) -> dict[Rim, Array]:
    """Where rims run through vertices that they do not end at: increasing parameters.

    A closed rim with a vertex at the point where it closes is anchored there; it comes with no parameters.
    """
    if not len(points):
        return {}
    from scipy.spatial import cKDTree

    tolerance = survey.tolerance
    balls = np.concatenate([boundary.balls for boundary in boundaries])
    owners = np.repeat(np.arange(len(boundaries)), [len(boundary.balls) for boundary in boundaries])
    near: set[tuple[int, int]] = set()
    found = cKDTree(points).query_ball_point(balls[:, :3], balls[:, 3] + tolerance)
    for owner, inside in zip(owners.tolist(), found, strict=True):
        if inside:
            own = ends.get(boundaries[owner], ())
            near.update((owner, vertex) for vertex in inside if vertex not in own)
    if not near:
        return {}
    which, vertices = np.array(sorted(near), dtype=np.int64).T
    batch = Batch(survey, boundaries)
    t, distance = batch.nearest(
        which, points[vertices], np.array([boundaries[k].curve.domain[0] for k in which.tolist()])
    )
    reached = distance <= tolerance
    # Ends are merged already: a vertex as near to one as this is a vertex beside it.
    apexes = np.array([boundaries[k].ends for k in which.tolist()])
    from_ends = np.linalg.norm(points[vertices][:, None] - apexes, axis=2).min(axis=1)
    inner = reached & (from_ends > 2.0 * tolerance)
    cuts = {}
    for k in np.unique(which[reached]).tolist():
        at = np.sort(t[(which == k) & inner])
        if at.size or not boundaries[k].anchored:
            boundaries[k].anchored = True
            cuts[boundaries[k]] = at
    return cuts
