"""Whether points are within bodies, against signed distances in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.proximity.clearance.inside import UNCLEAR, winding_of
from tests.proximity.clearance.nodes import forest_of
from tests.proximity.clearance.scenes import direction, faces_of
from tests.validation.clearance_scenes import parts

CLOSED = [name for name, part in parts().items() if part.is_closed]


def windings(forest, points):
    """Of each point alone."""
    stack, out = np.zeros(4096, dtype=np.int64), np.zeros(1, dtype=np.int64)
    told = []
    for point in np.atleast_2d(points):
        while True:
            assert winding_of(forest.arrays, forest.roots[0], np.ascontiguousarray(point[None]), stack, out) == 1
            if out[0] != UNCLEAR or not forest.is_full or not forest.grow():
                break
        told.append(int(out[0]))
    return np.array(told)


@pytest.mark.parametrize("name", CLOSED)
def test_random_points(name, cases):
    part, rng = parts()[name], np.random.default_rng(0)
    forest = forest_of(faces_of(part.shape))
    points = rng.uniform(-1.3, 1.3, (cases(60, 3000), 3)) * part.half_extents
    points = np.vstack([points, part.inner[:10]])
    told, distance = windings(forest, points), part.distance(points)
    known = told != UNCLEAR
    assert ((told == 1) == (distance < 0.0))[known].all()
    assert set(told[known].tolist()) == {0, 1}
    assert known.mean() > 0.97


@pytest.mark.parametrize("name", CLOSED)
def test_points_near_the_boundary(name, cases):
    """On either side of samples, by 1e-3 to 1e-7 of the size, along the slope of the distance."""
    part, rng = parts()[name], np.random.default_rng(1)
    forest = forest_of(faces_of(part.shape))
    samples = part.samples[rng.integers(len(part.samples), size=cases(16, 400))]
    points = np.array([x + 10.0 ** rng.uniform(-7.0, -3.0) * part.size * direction(rng) for x in samples])
    told, distance = windings(forest, points), part.distance(points)
    known = (told != UNCLEAR) & (np.abs(distance) > 1e-13)
    assert ((told == 1) == (distance < 0.0))[known].all()
    assert known.mean() > 0.8


def test_the_first_point_that_tells_is_enough():
    forest = forest_of(faces_of(parts()["ball"].shape))
    stack, out = np.zeros(4096, dtype=np.int64), np.zeros(3, dtype=np.int64)
    points = np.array([[0.4, 0.0, 0.0], [0.0, 0.1, 0.0], [9.0, 0.0, 0.0]])
    asked = winding_of(forest.arrays, forest.roots[0], points, stack, out)
    assert asked == 2 and out[0] == UNCLEAR and out[1] == 1


def test_in_a_hole_and_in_a_ring_is_outside():
    for name, point in (("torus", [0, 0, 0]), ("plate", [-0.7, 0, 0]), ("tube", [0, 0, 0]), ("L", [0.3, 0.3, 0])):
        assert windings(forest_of(faces_of(parts()[name].shape)), np.array(point, dtype=float)).tolist() == [0]
