from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.splines.cells import COUNT, GROUP, split, surface_cells
from assembly.geometry.splines.evaluate import CELL_SIZE
from assembly.geometry.splines.surface import NurbsSurface
from tests.geometry.splines.test_surface import random_surface

SURFACES = {
    "plane": shapes.plane(3.0, 100.0),
    "sphere": shapes.sphere(2.0),
    "torus": shapes.torus(4.0, 1.0),
    "cone": shapes.cone(2.0, 3.0),
    "clip": shapes.paper_clip(),
    "far": shapes.sphere(1e-3).transformed(translation=(1e5, -2e5, 3e5)),
    "mixed": random_surface(1, (4, 2), ("multiple", "unclamped")),
    "high": random_surface(2, (7, 6)),
    "dot": NurbsSurface(np.ones((2, 2, 3)), ([0, 0, 1, 1], [0, 0, 1, 1]), (1, 1)),
}


@pytest.mark.parametrize("count", [1, 37, COUNT, 500])
@pytest.mark.parametrize("name", SURFACES)
def test_every_sphere_holds_its_cell(name, count):
    surface = SURFACES[name]
    boxes, centers, radii = split(surface, count)
    spans = np.prod(surface.bezier_pieces().shape[:2])
    assert len(boxes) == max(count, spans)
    x = np.random.default_rng(count).uniform(size=(2, 60))
    x = np.concatenate([x, [[0, 0, 1, 1, 0.5], [0, 1, 0, 1, 0.5]]], axis=1)  # corners and middle
    (a, b), (c, d) = surface.domain
    u = np.clip(boxes[:, :1] + x[0] * (boxes[:, 1:2] - boxes[:, :1]), a, b)
    v = np.clip(boxes[:, 2:3] + x[1] * (boxes[:, 3:] - boxes[:, 2:3]), c, d)
    distance = np.linalg.norm(surface.evaluate(u, v) - centers[:, None], axis=-1)
    # The evaluated points are themselves off by some roundings of their coordinates.
    rounding = 4e-15 * np.abs(surface.control_points).max()
    assert (distance <= radii[:, None] + rounding).all()


@pytest.mark.parametrize("name", SURFACES)
def test_boxes_tile_the_domain(name):
    surface = SURFACES[name]
    boxes, _, _ = split(surface)
    (a, b), (c, d) = surface.domain
    area = np.prod(boxes[:, 1::2] - boxes[:, ::2], axis=1).sum()
    assert area == pytest.approx((b - a) * (d - c), rel=1e-12)
    rng = np.random.default_rng(0)
    u, v = rng.uniform(a, b, (500, 1)), rng.uniform(c, d, (500, 1))
    inside = (boxes[:, 0] <= u) & (u < boxes[:, 1]) & (boxes[:, 2] <= v) & (v < boxes[:, 3])
    assert (inside.sum(axis=1) == 1).all()


@pytest.mark.parametrize("name", ["plane", "sphere", "torus", "clip", "mixed"])
def test_more_cells_are_smaller_and_of_a_size(name):
    largest = [split(SURFACES[name], count)[2].max() for count in (64, 256, 1024)]
    # Four times the cells have half the diameter; clumsier ones by less than this.
    assert largest[1] < 0.7 * largest[0] and largest[2] < 0.6 * largest[1]
    box, _, radius = split(SURFACES[name], 1024)
    assert radius.max() < 8.0 * np.median(radius)


@pytest.mark.parametrize("name", ["sphere", "torus", "clip", "mixed"])
def test_cells_that_follow_one_another_are_neighbors(name):
    _, centers, radii = split(SURFACES[name], 256)
    groups = centers.reshape(-1, GROUP, 3)
    spread = np.linalg.norm(groups - groups.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    # Eight of 256 on a surface reach as far as a few cells do, not across it.
    assert np.median(spread) < 5.0 * np.median(radii)


def test_rows_are_what_kernels_read():
    surface = SURFACES["torus"]
    rows = surface_cells(surface)
    boxes, centers, radii = split(surface)
    assert rows.shape == (COUNT, CELL_SIZE)
    np.testing.assert_array_equal(rows[:, 0], boxes[:, :2].mean(axis=1))
    np.testing.assert_array_equal(rows[:, 1], boxes[:, 2:].mean(axis=1))
    np.testing.assert_array_equal(rows[:, 2:5], surface.evaluate(rows[:, 0], rows[:, 1]))
    np.testing.assert_array_equal(rows[:, 5:8], centers)
    np.testing.assert_array_equal(rows[:, 8], radii)
    np.testing.assert_array_equal(rows[:, 9:], 0.5 * (boxes[:, 1::2] - boxes[:, ::2]))
    record, pool = surface.packed()
    np.testing.assert_array_equal(pool[-rows.size :].reshape(rows.shape), rows)


def test_a_surface_of_many_spans_has_one_cell_a_span():
    knots = np.concatenate([[0, 0], np.arange(1, 15), [15, 15]])
    grid = np.stack(np.meshgrid(np.arange(16.0), np.arange(16.0), [0.0], indexing="ij"), axis=-1)[:, :, 0]
    boxes, _, radii = split(NurbsSurface(grid, (knots, knots), (1, 1)))
    assert len(boxes) == 225
    np.testing.assert_allclose(radii, np.sqrt(0.5), rtol=1e-12)
