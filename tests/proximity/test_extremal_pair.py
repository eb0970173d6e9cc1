"""Extremal pairs against closed forms, at contact and along paths; what happens where no isolated pair exists."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity import PairStatus, contact_jacobian, extremal_pair, gap_gradient, gap_hessian
from tests.laws.scenes import frame_at, inside, placed, random_quaternion
from tests.laws.witness import rotated

HOME = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def at(x, y, z, e=(1.0, 0.0, 0.0, 0.0)):
    return np.array([x, y, z, *e])


def turned(q, x):
    """A body's point (3,) in world axes."""
    return rotated(np.asarray(q)[None], np.asarray(x, float)[None])[0] + q[:3]


def random_pose(rng, reach=3.0):
    return np.concatenate([rng.uniform(-reach, reach, 3), random_quaternion(rng)])


def close(found, expected, atol=1e-12):
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=atol)


# ---- closed forms: the nearest point of a simple shape's skeleton -------------------------------------------------


def ring_point(radius, x):
    """The point of the circle of a radius about the z axis nearest to x."""
    return radius * np.array([x[0], x[1], 0.0]) / np.hypot(x[0], x[1])


@pytest.mark.parametrize("depth", [2.0, 0.3, 1e-6, 0.0, -1e-6, -0.05])
def test_sphere_and_sphere(depth):
    rng = np.random.default_rng(1)
    for _ in range(20):
        r, s = rng.uniform(0.5, 2.0, 2)
        q_f, q_g = random_pose(rng), random_pose(rng)
        away = rng.normal(size=3)
        away /= np.linalg.norm(away)
        q_g[:3] = q_f[:3] + (r + s + depth) * away
        pair = extremal_pair(shapes.sphere(r), q_f, shapes.sphere(s), q_g)
        assert pair.status is PairStatus.CONVERGED
        close(pair.gap, depth)
        close(pair.normal, away)
        close(pair.points, [q_f[:3] + r * away, q_g[:3] - s * away])


@pytest.mark.parametrize("depth", [1.5, 0.1, 0.0, -0.1])
def test_sphere_and_torus(depth):
    rng = np.random.default_rng(2)
    for _ in range(20):
        major, minor, r = rng.uniform(2.0, 3.0), rng.uniform(0.3, 0.8), rng.uniform(0.3, 0.7)
        q_f, q_g = random_pose(rng), random_pose(rng)
        # Around the outer half of the tube, where one point of the ring is the nearest by far.
        turn, tilt = rng.uniform(0.0, 6.3), rng.uniform(-1.2, 1.2)
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        away = np.cos(tilt) * out + np.sin(tilt) * np.array([0.0, 0.0, 1.0])
        q_g[:3] = turned(q_f, major * out + (minor + r + depth) * away)
        pair = extremal_pair(shapes.torus(major, minor), q_f, shapes.sphere(r), q_g)
        normal = turned(q_f, away) - q_f[:3]
        assert pair.status is PairStatus.CONVERGED
        close(pair.gap, depth)
        close(pair.normal, normal)
        close(pair.points[0], turned(q_f, major * out + minor * away))
        close(pair.points[1], q_g[:3] - r * normal)


@pytest.mark.parametrize("depth", [1.0, 0.0, -0.1])
def test_sphere_and_cylinder_and_plane(depth):
    rng = np.random.default_rng(3)
    for _ in range(20):
        r, s = rng.uniform(0.5, 1.5, 2)
        q_f, q_g = random_pose(rng), random_pose(rng)
        turn, height = rng.uniform(0.0, 6.3), rng.uniform(-2.0, 2.0)
        away = np.array([np.cos(turn), np.sin(turn), 0.0])
        axis = np.array([0.0, 0.0, height])
        q_g[:3] = turned(q_f, (r + s + depth) * away + axis)
        pair = extremal_pair(shapes.cylinder(r, 6.0), q_f, shapes.sphere(s), q_g)
        assert pair.status is PairStatus.CONVERGED
        close(pair.gap, depth)
        close(pair.points[0], turned(q_f, r * away + axis))

        foot = np.array([*rng.uniform(-3.0, 3.0, 2), 0.0])
        q_g[:3] = turned(q_f, foot + [0.0, 0.0, s + depth])
        pair = extremal_pair(shapes.plane(8.0, 8.0), q_f, shapes.sphere(s), q_g)
        assert pair.status is PairStatus.CONVERGED
        close(pair.gap, depth)
        close(pair.points[0], turned(q_f, foot))
        close(pair.parameters[:2], foot[:2])


def test_torus_and_torus_in_special_places():
    major, minor, other, tube = 3.0, 0.5, 2.0, 0.4
    f, g = shapes.torus(major, minor), shapes.torus(other, tube)
    half = np.sqrt(0.5)
    spin = random_quaternion(np.random.default_rng(0))
    spin /= np.linalg.norm(spin)
    for apart in (2.0, 0.1, 0.0, -0.1):
        # In one plane, side by side; and with the second one upright, its ring in the xz-plane.
        for e in ((1.0, 0.0, 0.0, 0.0), (half, half, 0.0, 0.0)):
            x = major + minor + tube + other + apart
            pair = extremal_pair(f, HOME, g, at(x, 0.0, 0.0, e))
            assert pair.status is PairStatus.CONVERGED
            close(pair.gap, apart)
            close(pair.points, [[major + minor, 0.0, 0.0], [major + minor + apart, 0.0, 0.0]])
        # Upright above the first one's tube, across it: both tubes' extreme points meet on the z axis through it.
        q = at(major, 0.0, minor + tube + other + apart, (half, half, 0.0, 0.0))
        pair = extremal_pair(f, HOME, g, q)
        assert pair.status is PairStatus.CONVERGED
        close(pair.gap, apart)
        close(pair.points, [[major, 0.0, minor], [major, 0.0, minor + apart]])


def test_linked_tori():
    # The second ring passes through the hole of the first one, its inner side nearest to the first one's tube.
    f, g = shapes.torus(3.0, 0.5), shapes.torus(2.0, 0.4)
    half = np.sqrt(0.5)
    for shift in (0.6, 0.9, 1.1, 1.2):
        pair = extremal_pair(f, HOME, g, at(3.0 + shift, 0.0, 0.0, (half, half, 0.0, 0.0)))
        assert pair.status is PairStatus.CONVERGED
        close(pair.gap, (2.0 - shift) - 0.5 - 0.4)
        close(pair.normal, [-1.0, 0.0, 0.0])


@pytest.mark.parametrize("gap", [1.0, 1e-6, 0.0, -1e-6, -1e-4, -1e-3, -1e-2])
def test_tori_at_contact(gap, cases):
    rng = np.random.default_rng(4)
    count = 0
    while count < cases(20, 60):
        surfaces = [shapes.torus(rng.uniform(1.5, 3.0), rng.uniform(0.3, 0.8)) for _ in range(2)]
        f, g = (Face(s) for s in surfaces)
        uv_f, uv_g = inside(rng, f.surface), inside(rng, g.surface)
        q_f = random_pose(rng)
        q_g = placed(f, uv_f, q_f, g, uv_g, gap, rng.uniform(0.0, 6.3))
        x = np.array(uv_f + uv_g)
        start = x + 0.01 * rng.choice([-1.0, 1.0], 4)
        rates = contact_jacobian(f, q_f, g, q_g, x)[:, [0, 1, 2, 7, 8, 9]]
        if np.abs(rates).max() > 30.0:
            # Nearly one of a continuum: 0.01 away may belong to another pair.
            continue
        count += 1
        pair = extremal_pair(f, q_f, g, q_g, start)
        assert pair.status is PairStatus.CONVERGED
        # Arc-length parameters: these are lengths near one.
        close(pair.parameters, x)
        close(pair.gap, gap, 1e-14)
        p, axes = frame_at(f, *uv_f)
        close(pair.points[0], turned(q_f, p))
        close(pair.normal, turned(q_f, axes[:, 2]) - q_f[:3])


def test_through_contact_continuously():
    # A torus sinks into another: the pair of each position is the start of the next.
    rng = np.random.default_rng(5)
    f, g = Face(shapes.torus(3.0, 1.0)), Face(shapes.torus(2.5, 0.8))
    q_f = random_pose(rng)
    # An outer point of both: convex against convex.
    x = np.array([1.3, 0.5, 2.9, 0.4])
    q_g = placed(f, x[:2], q_f, g, x[2:], 0.6, 0.7)
    normal = turned(q_f, frame_at(f, *x[:2])[1][:, 2]) - q_f[:3]
    slide = np.cross(normal, [0.3, 0.5, -0.2])
    count = 401
    gaps, slopes = np.empty(count), np.empty(count)
    for k in range(count):
        q = q_g.copy()
        q[:3] += k / (count - 1) * (slide - 0.9 * normal)
        pair = extremal_pair(f, q_f, g, q, x)
        assert pair.status is PairStatus.CONVERGED
        x = pair.parameters
        gaps[k] = pair.gap
        slopes[k] = gap_gradient(f, q_f, g, q, x)[7:10] @ (slide - 0.9 * normal)
    assert gaps[0] > 0.5 and gaps[-1] < -0.2 and (np.diff(gaps) < 0.0).all()
    # Smooth: fourth differences are the fourth derivative times h^4 = 4e-11.
    assert np.abs(np.diff(gaps, 4)).max() < 1e-9
    # No jump: Simpson's rule over two steps gives the change of the gap, its error h^5/90 times the fifth derivative.
    change = (slopes[:-2:2] + 4.0 * slopes[1:-1:2] + slopes[2::2]) / (3.0 * (count - 1))
    close(change, gaps[2::2] - gaps[:-2:2], 1e-12)


# ---- no isolated pair -----------------------------------------------------------------------------------------


def cap(height=0.25):
    """A dome over [-1, 1]^2."""
    x = np.linspace(-1.0, 1.0, 4)
    z = height * (2.0 - x[:, None] ** 2 - x[None, :] ** 2)
    points = np.stack([*np.meshgrid(x, x, indexing="ij"), z], 2)
    knots = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]
    return NurbsSurface(points, (knots, knots), (3, 3))


@pytest.mark.parametrize("shift", [(2.5, 0.0), (0.0, -3.0), (4.0, 4.0)])
@pytest.mark.parametrize("start", [None, (0.5, 0.5, 0.5, 0.5)])
def test_beyond_the_edge(shift, start):
    # Both domes look at each other, but the nearest points of their continuations are beyond the edges.
    upside_down = (0.0, 1.0, 0.0, 0.0)
    pair = extremal_pair(cap(), HOME, cap(), at(*shift, 1.6, upside_down), start)
    assert pair.status is PairStatus.LEFT_PATCH
    assert ((pair.parameters >= 0.0) & (pair.parameters <= 1.0)).all()
    assert ((pair.parameters == 0.0) | (pair.parameters == 1.0)).any()
    assert np.isfinite(pair.points).all() and np.isfinite(pair.gap)


def test_above_the_dome_the_pair_is_inside():
    pair = extremal_pair(cap(), HOME, cap(), at(0.2, -0.1, 1.6, (0.0, 1.0, 0.0, 0.0)))
    assert pair.status is PairStatus.CONVERGED
    close(pair.points.mean(axis=0), [0.1, -0.05, 0.8])


POLES = pytest.mark.parametrize(
    "shape, height", [(shapes.sphere(1.0), 1.0), (shapes.ellipsoid(1.0, 1.5, 0.8), 0.8)], ids=["sphere", "ellipsoid"]
)


def above_pole(height, side, gap):
    """A ball over a pole on the z axis, its pose, and its nearest parameters: +x or -x looks down."""
    half = np.sqrt(0.5)
    toward = np.array([0.0 if side > 0.0 else np.pi * 0.7, 0.5 * np.pi * 0.7])
    return shapes.sphere(0.7), at(0.0, 0.0, side * (height + 0.7 + gap), (half, 0.0, half, 0.0)), toward


@POLES
@pytest.mark.parametrize("gap", [0.5, 0.0, -0.1])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_at_a_pole(shape, height, gap, side):
    ball, q, toward = above_pole(height, side, gap)
    exact = (0.3, shape.domain[1][1] if side > 0.0 else 0.0, *toward)
    pair = extremal_pair(shape, HOME, ball, q, exact)
    # The point is smooth, only its coordinates are not.
    assert pair.status is PairStatus.CONVERGED
    close(pair.gap, gap)
    close(pair.normal, [0.0, 0.0, side])
    close(pair.points[0], [0.0, 0.0, side * height])
    close(pair.parameters[1:], exact[1:])
    for function in (gap_gradient, gap_hessian):
        found = function(shape, HOME, ball, q, pair.parameters)
        assert np.isfinite(found).all()
    close(gap_gradient(shape, HOME, ball, q, pair.parameters)[7:10], pair.normal)
    # Balls: the gap is the distance of the centers, whose second derivative is 1/distance across the line.
    if height == 1.0:
        distance = 1.7 + gap
        hessian = gap_hessian(shape, HOME, ball, q, pair.parameters)
        close(hessian[6:9, 6:9], np.diag([1.0, 1.0, 0.0]) / distance, 1e-11)


@POLES
@pytest.mark.parametrize("gap", [0.5, 0.0, -0.1])
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("away", [None, 0.1, 0.03, 1e-4, 1e-8])
def test_toward_a_pole(shape, height, gap, side, away):
    ball, q, toward = above_pole(height, side, gap)
    start = None
    if away is not None:
        end = shape.domain[1][1]
        start = (0.3, end * (1.0 - away) if side > 0.0 else end * away, toward[0] + 0.1, toward[1] - 0.1)
    pair = extremal_pair(shape, HOME, ball, q, start)
    assert pair.status is PairStatus.CONVERGED
    # The parameter around the pole is free there; points and gap are not.
    close(pair.gap, gap)
    close(pair.normal, [0.0, 0.0, side])
    close(pair.points[0], [0.0, 0.0, side * height])


def check_singular(f, q_f, g, q_g, start, gap):
    """A pair of a continuum near the start; its derivatives are finite."""
    pair = extremal_pair(f, q_f, g, q_g, start)
    assert pair.status is PairStatus.SINGULAR
    close(pair.gap, gap)
    for function in (contact_jacobian, gap_gradient, gap_hessian):
        found = function(f, q_f, g, q_g, pair.parameters)
        assert np.isfinite(found).all()
        # No row blows up along the free direction.
        assert np.abs(found).max() < 1e3
    return pair


def test_ball_in_a_socket_of_its_radius():
    ball, socket = shapes.sphere(1.5), Face(shapes.sphere(1.5), reversed=True)
    half = np.sqrt(0.5)
    quarter = 0.25 * ball.domain[0][1]
    rng = np.random.default_rng(6)
    for turns, e in ((0, (1.0, 0.0, 0.0, 0.0)), (1, (half, 0.0, 0.0, half)), (2, (0.0, 0.0, 0.0, 1.0))):
        for _ in range(5):
            u, v = rng.uniform(4.9, 9.0), rng.uniform(1.0, 3.5)
            # The ball turned about its axis by quarters: nothing has to move.
            start = (u, v, u - turns * quarter, v)
            pair = check_singular(socket, HOME, ball, at(0.0, 0.0, 0.0, e), start, 0.0)
            # Where the matrix is zero but for rounding, a residual of rounding is amplified by 1e7 at the most.
            close(pair.parameters, start, 1e-8)


def test_cylinder_on_a_plane():
    # Lying along the plane's x axis at height 1 + gap; the line of contact is the free direction.
    half = np.sqrt(0.5)
    for gap in (0.4, 0.0, -0.1):
        q = at(0.2, 0.1, 1.0 + gap, (half, 0.0, half, 0.0))
        for v in (0.7, 1.0, 2.6):
            plane, cylinder = shapes.plane(10.0, 10.0), shapes.cylinder(1.0, 4.0)
            pair = extremal_pair(cylinder, q, plane, HOME, (0.3, v, 0.0, 0.0))
            assert pair.status is PairStatus.SINGULAR
            close(pair.parameters[1], v, 1e-9)
            close(pair.gap, gap)
            close(pair.points[0], [pair.points[1][0], 0.1, gap], 1e-9)
            check_singular(cylinder, q, plane, HOME, pair.parameters, gap)
            # The plane as f: its point along the axis stays.
            pair = extremal_pair(plane, HOME, cylinder, q, (0.5, 0.3, 0.3, v))
            assert pair.status is PairStatus.SINGULAR
            close(pair.parameters[0], 0.5, 1e-9)
            close(pair.parameters[1], 0.1, 1e-9)
            close(pair.gap, gap)


def test_parallel_planes():
    plane = shapes.plane(4.0, 4.0)
    for gap in (0.5, 0.0, -0.2):
        q = at(0.3, -0.2, gap, (0.0, 1.0, 0.0, 0.0))
        pair = check_singular(plane, HOME, plane, q, (0.4, 0.5, 0.0, 0.0), gap)
        close(pair.parameters[:2], [0.4, 0.5], 1e-9)
        close(pair.points[1], [0.4, 0.5, gap], 1e-9)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("offset", [0.0, 0.3, -0.9, 1.49, 1.51, -1.6])
def test_a_pair_of_a_continuum_is_one_inside_both_patches(offset, swapped):
    """Parallel cylinders of heights 2 and 1: a pair at the end of one goes on where both are, if they are anywhere."""
    long, short = shapes.cylinder(3.0, 2.0), shapes.cylinder(0.5, 1.0)
    q = at(0.0, 3.6, offset)
    for v in (0.0, 0.5, 2.0):
        for w in (0.0, 0.4, 1.0):
            start = (0.25 * long.domain[0][1] + 0.05, v, 0.75 * short.domain[0][1] - 0.02, w)
            if swapped:
                pair = extremal_pair(short, q, long, HOME, start[2:] + start[:2])
            else:
                pair = extremal_pair(long, HOME, short, q, start)
            reach = abs(offset) < 1.5
            assert pair.status is (PairStatus.SINGULAR if reach else PairStatus.LEFT_PATCH)
            if reach:
                close(pair.gap, 0.1)
                close(pair.points[1] - pair.points[0], -0.1 * pair.normal if pair.gap < 0.0 else 0.1 * pair.normal)


@pytest.mark.parametrize("offset", [0.0, 1.9, -1.2])
def test_a_pair_of_planes_is_one_inside_both_patches(offset):
    large, small = shapes.plane(4.0, 4.0), shapes.plane(1.0, 1.0)
    q = at(offset, -0.2, 0.3, (0.0, 1.0, 0.0, 0.0))
    for start in ((-2.0, 2.0, 0.5, 0.5), (2.0, -2.0, -0.5, 0.1), (0.0, 0.0, 0.0, 0.0)):
        pair = extremal_pair(large, HOME, small, q, start)
        assert pair.status is PairStatus.SINGULAR
        close(pair.points[1], pair.points[0] + [0.0, 0.0, 0.3])


@pytest.mark.parametrize("shift", [1e-9, 1e-7, 1e-5, 1e-3])
def test_nearly_a_continuum(shift):
    # A ball a little smaller than its socket: whatever the status, the answer is finite and no step runs away.
    socket, ball = Face(shapes.sphere(1.0), reversed=True), shapes.sphere(1.0 - shift)
    start = (1.0, 1.3, 1.1, 1.25)
    pair = extremal_pair(socket, HOME, ball, at(0.3 * shift, 0.2 * shift, 0.1 * shift), start)
    assert np.isfinite(pair.parameters).all() and np.isfinite(pair.points).all() and np.isfinite(pair.gap)
    low, high = np.array([*socket.surface.domain, *ball.domain]).T
    assert ((pair.parameters >= low) & (pair.parameters <= high)).all()
    if shift >= 1e-5:
        # Well enough separated to converge, at one end of the line of centers or the other.
        assert pair.status is PairStatus.CONVERGED
        ends = shift * (1.0 + np.sqrt(0.14) * np.array([-1.0, 1.0]))
        close(np.abs(pair.gap - ends).min(), 0.0)


# ---- bad input -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change, text",
    [
        ({"surface_f": "torus"}, "surface_f"),
        ({"q_f": [0.0] * 6}, "q_f"),
        ({"q_g": [0.0, 0.0, np.nan, 1.0, 0.0, 0.0, 0.0]}, r"q_g\[2\]"),
        ({"q_g": [0.0] * 7}, r"q_g\[3:\]"),
        ({"start": [0.0, 0.0, 0.0]}, "start"),
        ({"start": [0.0, 0.0, 9.0, 0.0]}, r"start\[2\]"),
        ({"start": [0.0, 0.0, np.inf, 0.0]}, r"start\[2\]"),
    ],
)
def test_bad_input(change, text):
    good = {"surface_f": shapes.torus(3.0, 1.0), "q_f": HOME, "surface_g": cap(), "q_g": at(6.0, 0.0, 0.0)}
    with pytest.raises((ValueError, TypeError), match=text):
        extremal_pair(**{**good, **change})
