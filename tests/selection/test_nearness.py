"""Distances of points from faces and edges, proven: closed forms, and what samples between spans miss."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix

SEEDS = range(8)
# Bounds are 1e-12 of the coordinates apart, which are some 20.
EXACT = 1e-10


def unit(vector):
    return vector / np.linalg.norm(vector)


def placed(seed, shape):
    """A body whose shape is turned and moved in it, and what takes a point of the shape there."""
    rng = np.random.default_rng(seed)
    turn, shift = rotation_matrix(unit(rng.normal(size=4))), rng.uniform(-3, 3, 3)
    faces = [face if isinstance(face, asm.Face) else asm.Face(face) for face in shape]
    return (
        asm.Body("part", [face.transformed(turn, shift) for face in faces]),
        lambda p: turn @ np.asarray(p) + shift,
        rng,
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_from_the_faces_of_a_plate(seed):
    """Of a top with a round hole: within its outline the distance of the plane, over the hole that of the rim."""
    body, at, rng = placed(seed, asm.shapes.plate(10, 8, 2, [(1, -1, 2)]))
    top, wall = body.face("top"), body.face("hole 1")
    for x, y, z in rng.uniform((-8, -7, -4), (8, 7, 4), (12, 3)):
        aside = np.maximum(np.abs([x, y]) - [5, 4], 0)
        inward = max(2 - hypot(x - 1, y + 1), 0.0)
        expected = hypot(*aside, inward, z - 1)
        assert top.distance(at((x, y, z))) == pytest.approx(expected, abs=EXACT)
        around = abs(hypot(x - 1, y + 1) - 2)
        assert wall.distance(at((x, y, z))) == pytest.approx(hypot(around, max(abs(z) - 1, 0)), abs=EXACT)


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_from_edges(seed):
    body, at, rng = placed(seed, asm.shapes.plate(10, 8, 2, [(1, -1, 2)]))
    mouth = next(edge for edge in body.edges.circles() if np.allclose(edge.center, at((1, -1, 1))))
    line = next(edge for edge in body.edges.lines() if np.allclose(edge.center, at((5, 0, 1))))
    for x, y, z in rng.uniform((-8, -7, -4), (8, 7, 4), (12, 3)):
        point = at((x, y, z))
        assert mouth.distance(point) == pytest.approx(hypot(hypot(x - 1, y + 1) - 2, z - 1), abs=EXACT)
        assert line.distance(point) == pytest.approx(hypot(x - 5, max(abs(y) - 4, 0), z - 1), abs=EXACT)
        gaps = [edge.distance(point) for edge in body.edges]
        assert body.edges.near(point).one().distance(point) <= min(gaps) + EXACT
    assert mouth.distance(mouth.center) == pytest.approx(2, abs=EXACT)


def saw(tooth):
    """A strip of 200 spans, one of whose corners between two spans stands up."""
    points = np.zeros((201, 2, 3))
    points[..., 0], points[..., 1] = np.linspace(0, 20, 201)[:, None], (0, 1)
    points[tooth, :, 2] = 5.0
    knots = np.concatenate([[0], np.arange(201), [200]]).astype(float)
    return asm.NurbsSurface(points, (knots, [0, 0, 1, 1]), (1, 1))


@pytest.mark.parametrize("tooth", [1, 50, 101, 163])
def test_a_tooth_between_samples_is_found(tooth):
    body = asm.Body("saw", saw(tooth))
    assert body.face().distance((0.1 * tooth, 0.5, 5.5)) == pytest.approx(0.5, abs=EXACT)
    assert body.face().distance((0.1 * tooth, 0.5, 3.0)) == pytest.approx(0.2 / hypot(5, 0.1), abs=EXACT)


def test_near_tells_faces_apart_by_what_is_proven():
    """The tip of a tooth is nearer than a plate over it, by less than samples see."""
    plate = asm.shapes.plane(4, 4).transformed(translation=(10.1, 0.5, 6.0005))
    body = asm.Body("press", [asm.Face(plate, name="plate"), asm.Face(saw(101), name="saw")])
    assert body.faces.near((10.1, 0.5, 5.5)).one().name == "saw"
    assert body.faces.near((10.1, 0.5, 5.501)).one().name == "plate"


def test_points_far_away_and_on_faces():
    body = asm.Body("ball", asm.shapes.sphere(2), (5, 0, 0))
    assert body.face().distance((0, 0, 2)) < 1e-12 and body.face().distance((0, 0, 0)) == pytest.approx(2, abs=EXACT)
    assert body.face().distance((1e6, 0, 0)) == pytest.approx(1e6 - 2, rel=1e-12)
    with pytest.raises(InputError, match="point has shape"):
        body.face().distance((1, 2))
    with pytest.raises(InputError, match="point"):
        body.face().distance((np.nan, 0, 0))


@pytest.mark.parametrize(("shape", "expected"), [("cone", 1.2), ("ellipsoid", 2.0), ("cylinder", 2.0), ("torus", 3.0)])
def test_points_on_axes(shape, expected):
    """Where all points of a circle are nearest, the bounds do not meet; what is found is the distance all the same."""
    sizes = {"cone": (3, 4), "ellipsoid": (2, 2, 3), "cylinder": (2, 6), "torus": (4, 1)}
    body = asm.Body("part", getattr(asm.shapes, shape)(*sizes[shape]))
    assert body.face().distance((0, 0, 0)) == pytest.approx(expected, abs=1e-11)
    edges = asm.Body("cup", asm.shapes.solid_cylinder(2, 6)).edges
    assert edges.near((0, 0, 2)).one().distance((0, 0, 2)) == pytest.approx(hypot(2, 1), abs=1e-11)
