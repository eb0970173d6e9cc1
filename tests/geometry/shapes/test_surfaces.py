from __future__ import annotations

import doctest
from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assembly.geometry import shapes
from assembly.geometry.shapes import path as path_module
from assembly.geometry.shapes.path import Path

# Rounding of a quotient of sums of some sixteen products; the parameter |Su x Sv| adds as much to normals.
TIGHT = 1e-13


def samples(surface, count=400, seed=0):
    """Random parameters, all pairs of knots, and points next to the knots."""
    rng = np.random.default_rng(seed)
    (a, b), (c, d) = surface.domain
    at_u, at_v = surface.breaks()
    near_u = np.clip(np.concatenate([at_u, at_u + 1e-9, at_u - 1e-9]), a, b)
    near_v = np.clip(np.concatenate([at_v, at_v + 1e-9, at_v - 1e-9]), c, d)
    grid = np.meshgrid(near_u, near_v)
    return (
        np.concatenate([rng.uniform(a, b, count), grid[0].ravel()]),
        np.concatenate([rng.uniform(c, d, count), grid[1].ravel()]),
    )


def interior(surface, count=400, seed=0):
    """Random parameters away from poles."""
    rng = np.random.default_rng(seed)
    (a, b), (c, d) = surface.domain
    return rng.uniform(0.99 * a + 0.01 * b, 0.01 * a + 0.99 * b, count), rng.uniform(
        0.99 * c + 0.01 * d, 0.01 * c + 0.99 * d, count
    )


def frustum_gradient(x, slope):
    axis = np.hypot(x[:, 0], x[:, 1])
    return np.stack([x[:, 0] / axis, x[:, 1] / axis, np.full(len(x), slope)], axis=1)


def torus_gradient(x):
    axis = np.hypot(x[:, 0], x[:, 1])[:, None]
    return x - np.concatenate([4.0 * x[:, :2] / axis, 0.0 * axis], axis=1)


# name: surface, function that is zero on it and of the size of one relative error, outward gradient, closed
IMPLICIT = {
    "plane": (shapes.plane(3.0, 5.0), lambda x: x[:, 2], lambda x: np.tile([0, 0, 1.0], (len(x), 1)), (False, False)),
    "sphere": (shapes.sphere(2.5), lambda x: np.linalg.norm(x, axis=1) / 2.5 - 1.0, lambda x: x, (True, False)),
    "ellipsoid": (
        shapes.ellipsoid(1.0, 2.0, 0.5),
        lambda x: ((x / [1.0, 2.0, 0.5]) ** 2).sum(axis=1) - 1.0,
        lambda x: x / [1.0, 4.0, 0.25],
        (True, False),
    ),
    "cylinder": (
        shapes.cylinder(0.3, 7.0),
        lambda x: np.hypot(x[:, 0], x[:, 1]) / 0.3 - 1.0,
        lambda x: frustum_gradient(x, 0.0),
        (True, False),
    ),
    "cone": (
        shapes.cone(2.0, 3.0),
        lambda x: np.hypot(x[:, 0], x[:, 1]) - 2.0 * (1.5 - x[:, 2]) / 3.0,
        lambda x: frustum_gradient(x, 2.0 / 3.0),
        (True, False),
    ),
    "frustum": (
        shapes.cone(1.0, 2.0, top_radius=1.5),
        lambda x: np.hypot(x[:, 0], x[:, 1]) - 1.25 - 0.25 * x[:, 2],
        lambda x: frustum_gradient(x, -0.25),
        (True, False),
    ),
    "torus": (
        shapes.torus(4.0, 1.5),
        lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]) - 4.0, x[:, 2]) / 1.5 - 1.0,
        torus_gradient,
        (True, True),
    ),
}


@pytest.mark.parametrize("name", IMPLICIT)
def test_points_satisfy_the_equation_and_the_normal_is_its_gradient(name):
    surface, equation, gradient, closed = IMPLICIT[name]
    assert np.abs(equation(surface.evaluate(*samples(surface)))).max() < TIGHT
    u, v = interior(surface)
    out = gradient(surface.evaluate(u, v))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    np.testing.assert_allclose(surface.normal(u, v), out, rtol=0, atol=1e-12)
    assert surface.closed == closed


@pytest.mark.parametrize("name", IMPLICIT)
def test_the_whole_shape_is_covered(name):
    surface, *_ = IMPLICIT[name]
    low, high = surface.bounding_box()
    grid_u, grid_v = np.meshgrid(*(np.linspace(*d, 161) for d in surface.domain))
    points = surface.evaluate(grid_u, grid_v).reshape(-1, 3)
    # The extreme points of all these shapes lie on the grid, and the box of their nets is tight.
    np.testing.assert_allclose(points.min(axis=0), low, rtol=0, atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), high, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["plane", "sphere", "ellipsoid", "cylinder", "frustum", "torus"])
def test_the_parameters_are_lengths(name):
    surface, *_ = IMPLICIT[name]
    u, v = interior(surface)
    _, su, sv = surface.evaluate(u, v, 1)
    assert 0.3 < np.linalg.norm(su, axis=1).max() < 2.2
    assert 0.3 < np.linalg.norm(sv, axis=1).max() < 2.2


def test_named_points_of_the_shapes():
    ball = shapes.sphere(2.0)
    # Powers of lengths with pi in them round in the last places.
    close = {"rtol": 0, "atol": 1e-14}
    np.testing.assert_allclose(ball.evaluate(0.0, 0.0), [0.0, 0.0, -2.0], **close)
    np.testing.assert_allclose(ball.evaluate(0.0, pi), [2.0, 0.0, 0.0], **close)
    np.testing.assert_allclose(ball.evaluate(pi, pi), [0.0, 2.0, 0.0], **close)
    ring = shapes.torus(4.0, 1.0)
    np.testing.assert_allclose(ring.evaluate(0.0, 0.0), [5.0, 0.0, 0.0], **close)
    np.testing.assert_allclose(ring.evaluate(2.0 * pi, 0.5 * pi), [0.0, 4.0, 1.0], **close)
    np.testing.assert_allclose(shapes.plane(2.0, 4.0).evaluate(0.25, -1.5), [0.25, -1.5, 0.0], **close)
    np.testing.assert_allclose(shapes.cone(1.0, 2.0).evaluate(0.3, 5.0**0.5), [0.0, 0.0, 1.0], **close)


def test_circles_have_continuous_tangents_at_their_double_knots():
    ring = shapes.torus(4.0, 1.0)
    u, v = ring.breaks()
    step = 1e-13
    for k in (1, 2, 3):
        before, after = ring.evaluate(u[k] - step, 0.4, 1), ring.evaluate(u[k] + step, 0.4, 1)
        np.testing.assert_allclose(before[1], after[1], rtol=0, atol=1e-12)
        before, after = ring.evaluate(1.0, v[k] - step, 1), ring.evaluate(1.0, v[k] + step, 1)
        np.testing.assert_allclose(before[2], after[2], rtol=0, atol=1e-12)


def test_box_has_six_named_outward_faces():
    faces = shapes.box(1.0, 2.0, 3.0)
    assert [face.name for face in faces] == ["left", "right", "front", "back", "bottom", "top"]
    half = np.array([0.5, 1.0, 1.5])
    for k, face in enumerate(faces):
        axis, side = k // 2, 2 * (k % 2) - 1
        want = side * np.eye(3)[axis]
        np.testing.assert_array_equal(face.normal(0.1, 0.2), want)
        u, v = np.meshgrid(*face.surface.domain)
        corners = face.surface.evaluate(u, v).reshape(-1, 3)
        np.testing.assert_array_equal(corners[:, axis], side * half[axis])
        np.testing.assert_array_equal(np.abs(corners), np.tile(half, (4, 1)))
        assert len(np.unique(corners, axis=0)) == 4


# ---------------------------------------------------------------- pipes: an independent center line


def distance_to_path(x, path, beyond=True):
    """Distances (n,) and feet (n, 3) from points to the center line, piece by piece in closed form."""
    best, feet = np.full(len(x), np.inf), np.zeros_like(x)
    for piece in path.pieces:
        if piece.radius is None:
            t = np.clip((x - piece.start) @ piece.tangent, 0.0, piece.length)
            foot = piece.start + t[:, None] * piece.tangent
        else:
            center = piece.start + piece.radius * piece.toward
            away = x - center
            a, b = away @ -piece.toward, away @ piece.tangent
            angle = np.arctan2(b, a)
            # Beyond an end the nearest point is the end on that side.
            middle = 0.5 * piece.angle
            angle = middle + np.clip((angle - middle + pi) % (2 * pi) - pi, -middle, middle)
            foot = center + piece.radius * (
                -np.cos(angle)[:, None] * piece.toward + np.sin(angle)[:, None] * piece.tangent
            )
        d = np.linalg.norm(x - foot, axis=1)
        nearer = d < best
        best[nearer], feet[nearer] = d[nearer], foot[nearer]
    return best, feet


CLIP = Path((0, 0, 0), (0, 0, 1)).line(12).arc(3.0, pi, (1, 0, 0)).line(9).arc(2.0, pi, (-1, 0, 0)).line(4.0)
PATHS = {
    "line": Path((1, 2, 3), (1, 1, 0)).line(4.0),
    "hook": Path((0, 0, 0), (0, 0, 1)).line(20.0).arc(4.0, pi, (1, 0, 0)).line(5.0),
    "clip": CLIP,
    "arc": Path((0, 0, 0), (0, 1, 0)).arc(2.0, 1.0, (1, 0, 0)),
    "space": Path((0, 0, 0), (1, 0, 1)).line(3.0).arc(2.0, 2.5, (0, 1, 0)).line(1.0).arc(3.0, 1.2, (0, 0.3, 1)).line(2),
    "far": Path((1e4, -1e4, 2e4), (0, 0, 1)).line(3.0).arc(2.0, 1.5, (1, 0, 0)),
}
LOOPS = {
    "ring": Path((3, 0, 0), (0, 1, 0)).arc(3.0, 2 * pi, (-1, 0, 0)),
    "link": Path((0, 0, 0), (0, 0, 1)).line(5).arc(2.0, pi, (1, 0, 0)).line(5).arc(2.0, pi, (-1, 0, 0)),
}


@pytest.mark.parametrize("caps", [True, False])
@pytest.mark.parametrize("name", PATHS)
def test_a_pipe_keeps_its_radius_from_its_path(name, caps):
    path, radius = PATHS[name], 0.7
    surface = shapes.pipe(path, radius, caps)
    assert surface.degree == (2, 2) and surface.closed == (False, True)
    u, v = samples(surface)
    distance, _ = distance_to_path(surface.evaluate(u, v), path)
    scale = max(1.0, np.abs(surface.control_points).max())
    assert np.abs(distance - radius).max() < TIGHT * scale
    u, v = interior(surface)
    points = surface.evaluate(u, v)
    _, feet = distance_to_path(points, path)
    np.testing.assert_allclose(surface.normal(u, v), (points - feet) / radius, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("name", LOOPS)
def test_a_closed_path_gives_a_closed_pipe_without_caps(name):
    path = LOOPS[name]
    assert path.closed
    surface = shapes.pipe(path, 0.5)
    assert surface.closed == (True, True)
    distance, _ = distance_to_path(surface.evaluate(*samples(surface)), path)
    assert np.abs(distance - 0.5).max() < TIGHT * path.length
    assert surface.domain[0][1] == pytest.approx(sum(piece.span for piece in path.pieces), rel=1e-14)


@pytest.mark.parametrize("name", PATHS)
def test_caps_are_poles_that_reach_the_radius_beyond_the_ends(name):
    path, radius = PATHS[name], 0.5
    surface = shapes.pipe(path, radius)
    (low, high), (_, around) = surface.domain
    v = np.linspace(0.0, around, 7)
    scale = max(1.0, np.abs(surface.control_points).max())
    for u, tip, out in ((low, path.start, -path.start_direction), (high, path.end, path.end_direction)):
        at, _, sv = surface.evaluate(u, v, 1)
        np.testing.assert_allclose(at, np.tile(tip + radius * out, (7, 1)), rtol=0, atol=1e-14 * scale)
        assert np.abs(sv).max() < 1e-13 * scale
        np.testing.assert_allclose(surface.normal(u, v), np.tile(out, (7, 1)), rtol=0, atol=1e-13 * scale)


@pytest.mark.parametrize("name", ["hook", "clip", "space"])
def test_the_speed_along_the_center_line_is_continuous(name):
    surface = shapes.pipe(PATHS[name], 0.5)
    step = 1e-9
    around = np.linspace(0.0, surface.domain[1][1], 9)[:-1]
    for u in surface.breaks()[0][1:-1]:
        for side in (-step, step):
            _, su = surface.evaluate(u + side, around, 1)[:2]
            # The mean over the cross section is the center's velocity; half the points are opposite pairs.
            assert np.linalg.norm(su.mean(axis=0)) == pytest.approx(1.0, abs=1e-8)


# ---------------------------------------------------------------- paper clips


def spiral(length, width, wire_radius, gap, legs):
    """Points of the center line of a Gem clip, by hand, with the arc length of each."""
    pitch = 2 * wire_radius + gap
    a = width / 2 - wire_radius
    b, c = a - pitch / 2, a - pitch
    top = length / 2 - wire_radius - a
    bottom = -length / 2 + wire_radius + b
    first, third, fourth = legs
    third_top = bottom + third
    half = np.linspace(0.0, pi, 400)

    def leg(x, z0, z1):
        return np.stack([np.full(400, x), np.linspace(z0, z1, 400)], axis=1)

    def turn(x, z, r, side, up):
        return np.stack([x - side * r * np.cos(half), z + up * r * np.sin(half)], axis=1)

    parts = [
        leg(-a, top - first, top),
        turn(0.0, top, a, 1, 1),
        leg(a, top, bottom),
        turn(pitch / 2, bottom, b, -1, -1),
        leg(-c, bottom, third_top),
        turn(0.0, third_top, c, 1, 1),
        leg(c, third_top, third_top - fourth),
    ]
    line = np.concatenate(parts)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return line, along


def test_the_default_clip_is_a_gem_clip_around_the_origin():
    clip = shapes.paper_clip(length=33.0, width=8.0, wire_radius=0.5)
    low, high = clip.bounding_box()
    np.testing.assert_allclose(low, [-4.0, -0.5, -16.5], rtol=0, atol=1e-13)
    np.testing.assert_allclose(high, [4.0, 0.5, 16.5], rtol=0, atol=1e-13)
    u, v = samples(clip)
    points = clip.evaluate(u, v)
    second = 33.0 - 1.0 - 3.5 - 2.75
    line, _ = spiral(33.0, 8.0, 0.5, 0.5, second * np.array([0.7, 0.8, 0.55]))
    line = np.stack([line[:, 0], np.zeros(len(line)), line[:, 1]], axis=1)
    distance = np.linalg.norm(points[:, None] - line, axis=2).min(axis=1)
    # The hand-made line is a polygon: a point of the wire is off by at most half a step of 0.065, squared.
    assert np.abs(distance - 0.5).max() < 2e-3
    assert np.array_equal(shapes.paper_clip().control_points, clip.control_points)
    # Three half turns of two pieces, four legs and two caps.
    assert clip.bezier_pieces().shape[:2] == (12, 4)


@settings(max_examples=40, deadline=None)
@given(
    st.floats(0.05, 0.8),
    st.floats(0.01, 1.0),
    st.floats(0.01, 6.0),
    st.floats(0.1, 30.0),
    st.tuples(st.floats(0.01, 0.999), st.floats(0.01, 0.999), st.floats(0.01, 0.999)),
)
def test_a_clip_does_not_run_into_itself(wire_radius, gap, workspace, second, parts):
    pitch = 2 * wire_radius + gap
    width = 4 * wire_radius + 2 * pitch + workspace
    length = second + width - pitch / 2
    legs = second * np.array([parts[0], parts[1], parts[1] * parts[2]])
    clip = shapes.paper_clip(length, width, wire_radius, gap=gap, legs=legs)
    line, along = spiral(length, width, wire_radius, gap, legs)
    line, along = line[::8], along[::8]
    distance = np.linalg.norm(line[:, None] - line, axis=2)
    # Two points farther apart along the wire than around the sharpest bend it has.
    apart = np.abs(along[:, None] - along) > pi * (width / 2 - wire_radius)
    assert distance[apart].min() >= min(pitch, 2 * (width / 2 - wire_radius - pitch)) - 1e-9
    np.testing.assert_allclose(np.ptp(clip.control_points, axis=(0, 1)), [width, 2 * wire_radius, length], rtol=1e-12)


# ---------------------------------------------------------------- paths


def test_paths_know_their_ends_and_lengths():
    path = Path((0, 0, 0), (0, 0, 2)).line(20.0).arc(4.0, pi, (1, 0, 5)).line(5.0)
    np.testing.assert_allclose(path.end, [8.0, 0.0, 15.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(path.end_direction, [0.0, 0.0, -1.0], rtol=0, atol=1e-15)
    assert path.length == pytest.approx(25.0 + 4.0 * pi, rel=1e-15)
    assert path.smallest_radius == 4.0 and not path.closed
    assert len(path.pieces) == 4 and "4 pieces" in repr(path)
    assert Path().line(1.0).smallest_radius == np.inf and not Path().closed
    # A path is never changed: extending one leaves it alone.
    short = Path().line(1.0)
    short.line(2.0)
    assert short.length == 1.0


def test_an_arc_turns_about_the_side_it_is_given():
    for angle in (0.1, 1.0, pi / 2, 2.0, 3.0, 5.0, 2 * pi):
        path = Path((1, 1, 1), (1, 0, 0)).arc(2.0, angle, (3, 4, 0))
        want = [1 + 2 * sin(angle), 1 + 2 * (1 - cos(angle)), 1.0]
        np.testing.assert_allclose(path.end, want, rtol=0, atol=1e-14)
        np.testing.assert_allclose(path.end_direction, [cos(angle), sin(angle), 0.0], rtol=0, atol=1e-14)
        assert max(piece.angle for piece in path.pieces) <= pi / 2 * (1 + 1e-9)
    assert path.closed


def test_the_example_in_the_documentation_runs():
    failed, tried = doctest.testmod(path_module)
    assert failed == 0 and tried == 3
