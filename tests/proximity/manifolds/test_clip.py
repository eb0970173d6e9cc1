"""Segments of plane regions: their boxes, and which points are within a region, judged by polygons of many corners."""

from __future__ import annotations

import numpy as np
import pytest

from assembly._record import rows_of
from assembly.proximity.manifolds.clip import is_within, write_boxes
from assembly.proximity.manifolds.records import SEGMENT, SEGMENT_SIZE
from assembly.proximity.manifolds.regions import plane_region
from tests.proximity.manifolds.plane_faces import plane_faces

# Chords of a quarter circle with so many corners are within radius (pi / 4 / corners)^2 / 2 of it.
CORNERS = 400


def places(segment):
    """Points (n, 2) along a segment, both ends included."""
    part = np.linspace(0.0, 1.0, CORNERS)[:, None]
    if segment.radius == 0.0:
        return segment.begin + part * (segment.end - segment.begin)
    x, y = segment.begin - segment.center
    turn = np.arctan2(y, x) + part[:, 0] * segment.sweep
    return segment.center + segment.radius * np.column_stack([np.cos(turn), np.sin(turn)])


@pytest.mark.parametrize("number", range(len(plane_faces())))
def test_segments_are_within_their_boxes(number):
    segments = rows_of(SEGMENT, plane_region(plane_faces()[number]).segments)
    for s in segments:
        points = places(s)
        # Points are placed to a rounding or two of coordinates near 1.
        assert (points >= s.low - 1e-15).all() and (points <= s.high + 1e-15).all()
        # No wider than the arc needs: its middle is as far from the chord as the box goes beyond its ends.
        wide = s.high - np.maximum(s.begin, s.end)
        assert wide == pytest.approx(s.radius * (1.0 - np.cos(0.5 * s.sweep)), abs=1e-13)


@pytest.mark.parametrize("number", range(len(plane_faces())))
def test_points_within_are_those_within_polygons(number):
    """By crossings of a ray along y, where the kernel's goes along x; points beside a border are left out."""
    region = plane_region(plane_faces()[number])
    rng = np.random.default_rng(number)
    points = rng.uniform(-1.6, 1.6, (300, 2))
    x, y = points.T
    inside, nearest = np.zeros(len(points), dtype=bool), np.full(len(points), np.inf)
    for s in rows_of(SEGMENT, region.segments):
        corners = places(s)
        a, b = corners[:-1, None], corners[1:, None]
        across = (a[..., 0] > x) != (b[..., 0] > x)
        with np.errstate(divide="ignore", invalid="ignore"):
            height = a[..., 1] + (x - a[..., 0]) / (b[..., 0] - a[..., 0]) * (b[..., 1] - a[..., 1])
        inside ^= (across & (height > y)).sum(axis=0) % 2 == 1
        nearest = np.minimum(nearest, np.linalg.norm(points - a, axis=2).min(axis=0))
    judged = nearest > 2e-2
    found = np.array([is_within(region.segments, *point, 1e-12) for point in points])
    assert judged.sum() > 100 and (found == inside)[judged].all()


@pytest.mark.parametrize("number", range(len(plane_faces())))
@pytest.mark.parametrize("tolerance", [1e-12, 1e-6])
def test_borders_are_within_by_a_tolerance(number, tolerance):
    """On either side: points are moved across the border by half of the tolerance."""
    region = plane_region(plane_faces()[number])
    rng = np.random.default_rng(7)
    for s in rows_of(SEGMENT, region.segments):
        corners = places(s)[1:-1:7]
        moved = corners + rng.uniform(-0.35, 0.35, corners.shape) * tolerance
        assert all(is_within(region.segments, *point, tolerance) for point in moved)


def disc(rng):
    """Four arcs of a circle that begin at a random angle, either way around, and the circle's center and radius."""
    segments = np.zeros((4, SEGMENT_SIZE))
    rows = rows_of(SEGMENT, segments)
    center, radius = rng.uniform(-1.0, 1.0, 2), rng.uniform(0.3, 1.0)
    turns = rng.uniform(0.0, 2.0 * np.pi) + rng.choice([-0.5, 0.5]) * np.pi * np.arange(5)
    corners = center + radius * np.column_stack([np.cos(turns), np.sin(turns)])
    rows.begin, rows.end, rows.center, rows.radius = corners[:-1], corners[1:], center, radius
    rows.sweep = np.diff(turns)
    write_boxes(segments)
    return segments, center, radius


@pytest.mark.parametrize("seed", range(40))
def test_arcs_that_bulge_along_the_axes(seed):
    """Where they begin at a multiple of a right angle, as above, ends are farthest out, and no box needs its margin."""
    rng = np.random.default_rng(seed)
    segments, center, radius = disc(rng)
    for s in rows_of(SEGMENT, segments):
        points = places(s)
        assert (points >= s.low - 1e-15).all() and (points <= s.high + 1e-15).all()
    points = rng.uniform(-2.0, 2.0, (200, 2))
    turns = rng.uniform(0.0, 2.0 * np.pi, 200)
    near = center + radius * (1.0 + rng.choice([-1e-9, 1e-9], 200))[:, None] * np.column_stack(
        [np.cos(turns), np.sin(turns)]
    )
    for point in np.vstack([points, near]):
        assert is_within(segments, *point, 1e-12) == (np.linalg.norm(point - center) < radius)
