"""Balls inside of bodies are inside, and translations at which they overlap are told to the end."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.inscribed import Overlaps, inscribed_balls
from assembly.proximity.features.features import faces_of
from tests.proximity.clearance.scenes import direction

HOLES = [(-15.0, 0.0, 5.0), (15.0, 2.0, 4.0)]


def in_box(p):
    return (np.array([1.0, 1.5, 2.0]) - np.abs(p)).min()


def in_plate(p):
    beside = (np.array([25.0, 10.0, 3.0]) - np.abs(p)).min()
    return min(beside, *(np.hypot(p[0] - x, p[1] - y) - r for x, y, r in HOLES))


def in_torus(p):
    return 1.0 - np.hypot(np.hypot(p[0], p[1]) - 3.0, p[2])


def in_cylinder(p):
    return min(5.0 - np.hypot(p[0], p[1]), 6.0 - abs(p[2]))


def in_cone(p):
    """In a cone of radius 1 at its foot and height 2."""
    across = np.hypot(p[0], p[1])
    return min(p[2], (1.0 - across - 0.5 * p[2]) / np.hypot(1.0, 0.5))


def in_cup(p):
    """In one that gets wider upwards, from radius 0.1 to 1."""
    across = np.hypot(p[0], p[1])
    return min(p[2], 2.0 - p[2], (0.1 + 0.45 * p[2] - across) / np.hypot(1.0, 0.45))


def turned(*profile):
    return asm.shapes.revolution(asm.curves.polygon(profile))


@pytest.mark.parametrize(
    ("shape", "room", "most"),
    [
        (asm.shapes.box(2.0, 3.0, 4.0), in_box, 1.0),
        (asm.shapes.plate(50.0, 20.0, 6.0, HOLES), in_plate, 3.0),
        (asm.shapes.torus(3.0, 1.0), in_torus, 1.0),
        (asm.shapes.solid_cylinder(5.0, 12.0), in_cylinder, 5.0),
        (turned((0, 0), (1, 0), (0, 2)), in_cone, 0.618),
        (turned((0, 0), (0.1, 0), (1, 2), (0, 2)), in_cup, 0.625),
    ],
)
def test_balls_are_inside(shape, room, most):
    centers, radii = inscribed_balls(faces_of("shape", shape))
    assert len(radii) and all(0.0 < r <= room(p) for p, r in zip(centers, radii, strict=True))
    # About the largest there is: first cells are thick by 8e-3 of the size, and centers are on a grid.
    assert radii.max() >= 0.4 * most


def test_open_shapes_have_none():
    centers, radii = inscribed_balls(faces_of("sheet", asm.shapes.plane(2.0, 2.0)))
    assert centers.shape == (0, 3) and not len(radii)


def test_the_next_length_is_in_no_ball_and_all_before_it_are():
    rng = np.random.default_rng(0)
    for _ in range(200):
        balls = [(rng.normal(size=(5, 3)), rng.uniform(0.1, 1.0, 5)) for _ in range(2)]
        found, n, begin = Overlaps(*balls), direction(rng), float(rng.uniform(0.0, 1.0))
        end = found.beyond(n, begin)

        def depth(length, n=n, balls=balls):
            a, b = (centers + (length * n if k else 0.0) for k, (centers, _) in enumerate(balls))
            return (np.add.outer(balls[0][1], balls[1][1]) - np.linalg.norm(a[:, None] - b, axis=2)).max()

        assert depth(end) <= 1e-12
        assert all(depth(length) > -1e-12 for length in np.linspace(begin, end, 40) if length < end)


def test_two_balls_overlap_where_they_are_told_to():
    """As deep as closed forms say, and the place is in both."""
    rng, told = np.random.default_rng(1), 0
    for _ in range(200):
        balls = [(rng.normal(size=(4, 3)), rng.uniform(0.1, 1.0, 4)) for _ in range(2)]
        depth, place = Overlaps(*balls).deepest()
        between = np.linalg.norm(balls[0][0][:, None] - balls[1][0], axis=2)
        assert depth == pytest.approx((np.add.outer(balls[0][1], balls[1][1]) - between).max(), abs=1e-14)
        if depth > 0.0:
            told += 1
            for centers, radii in balls:
                assert (np.linalg.norm(centers - place, axis=1) - radii).min() < 0.0
    assert told > 20


def test_a_ball_about_another_ones_center():
    one = np.zeros((1, 3)), np.ones(1)
    depth, place = Overlaps(one, (np.zeros((1, 3)), np.array([0.2]))).deepest()
    assert depth == 1.2 and not place.any()
