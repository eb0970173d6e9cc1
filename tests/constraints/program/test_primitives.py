"""Every coordinate of the joints: values, two derivatives, and the places where a direction is undefined."""

from __future__ import annotations

import math

import numpy as np
import pytest

from assembly._kernel import kernel
from assembly.constraints.program import primitives as P
from assembly.constraints.program.coordinate_hessian import add_coordinate_hessian
from assembly.kinematics import motion

COORDINATES = [
    *((P.COINCIDENT, k) for k in range(3)),
    *((P.SLIDE, k) for k in range(3)),
    (P.DISTANCE, 0),
    *((P.DOT, k) for k in range(9)),
    *((P.SWING, k) for k in range(2)),
    (P.TURN, 0),
    *((P.AZIMUTH, k) for k in range(3)),
    (P.ANGLE, 0),
    (P.RADIUS, 0),
]
TURNING = [(kind, component) for kind, component in COORDINATES if P.DOT <= kind <= P.ANGLE]
every_coordinate = pytest.mark.parametrize(("kind", "component"), COORDINATES)
# From z_a to z_b. SWING is a series below arccos(1 - SERIES) = 0.04472.
SWINGS = [1e-9, 1e-3, 0.0447, 0.0448, 1.5, 3.0, math.pi - 0.02]


def rotations(count, seed):
    rng = np.random.default_rng(seed)
    q, r = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    q *= np.sign(np.einsum("kii->ki", r))[:, None]
    return q * np.linalg.det(q)[:, None, None]


def turn(axis, angle):
    """The rotation matrix about a unit axis."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * k @ k


def scene(seed, swing=None):
    """A pool with the two frames, and poses of the two bodies; z_b at an angle `swing` to z_a, or anywhere."""
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(2, 7))
    q[:, 3:] /= np.linalg.norm(q[:, 3:], axis=1)[:, None]
    a, b = rotations(2, seed + 100)
    if swing is not None:
        heading = rng.uniform(0.0, 2.0 * math.pi)
        axis = (-math.sin(heading), math.cos(heading), 0.0)
        turn_f, turn_g = (np.array(motion.rotation(q, i)).reshape(3, 3) for i in range(2))
        b = turn_g.T @ turn_f @ a @ turn(axis, swing) @ turn((0.0, 0.0, 1.0), rng.uniform(-3.0, 3.0))
    pool = np.concatenate(
        [[np.nan] * 5, rng.uniform(-0.5, 0.5, 3), a.T.ravel(), rng.uniform(-0.5, 0.5, 3), b.T.ravel()]
    )
    return pool, q


def placed(pool, q):
    records = np.full((3, P.RECORD), np.nan)
    P.place_frames(pool, 5, q, 0, 1, records, 1)
    return records


def record(axes_b=None, apart=(0.3, -0.2, 0.4)):
    """A record with the world's axes as frame a."""
    records = np.empty((1, P.RECORD))
    records[0, :3] = 0.1, 0.2, -0.3
    records[0, P.AXES_A : P.ARM_B] = np.eye(3).ravel()
    records[0, P.ARM_B : P.AXES_B] = -0.2, 0.1, 0.4
    records[0, P.AXES_B : P.APART] = (np.eye(3) if axes_b is None else axes_b).T.ravel()
    records[0, P.APART :] = apart
    return records


def value(kind, component, records, k=1, near=0.0):
    return P.coordinate(kind, component, records, k, near)[0]


def gradient(kind, component, records, k=1, near=0.0):
    jacobian = np.full((1, 12), np.nan)
    P.write_gradient(*P.coordinate(kind, component, records, k, near)[1:], 1.0, jacobian, 0, 0)
    return jacobian[0]


def hessian(kind, component, records, k=1, y=1.0):
    """The whole symmetric matrix."""
    out = np.zeros((12, 12))
    add_coordinate_hessian(kind, component, records, k, y, out, 0, 6)
    return np.triu(out) + np.triu(out, 1).T


def moved(pool, q, twist):
    out = q.copy()
    for i in range(2):
        motion.retract(q, i, tuple(twist[6 * i : 6 * i + 3]), tuple(twist[6 * i + 3 : 6 * i + 6]), out)
    return placed(pool, out)


def workspace(kind, component, records):
    """About how far the coordinate is from where it has no derivative."""
    z = records[1, P.AXES_A + 6 : P.AXES_A + 9]
    v = records[1, P.AXES_B + 6 : P.AXES_B + 9]
    if kind == P.DISTANCE:
        return min(1.0, np.linalg.norm(records[1, P.APART :]))
    if kind == P.RADIUS:
        return min(1.0, np.linalg.norm(np.cross(z, records[1, P.APART :])))
    if kind in (P.SWING, P.TURN):
        return min(1.0, np.linalg.norm(z + v))
    if kind == P.AZIMUTH:
        return np.linalg.norm(np.cross(z, records[1, P.AXES_B + 3 * component : P.AXES_B + 3 * component + 3]))
    return np.linalg.norm(np.cross(z, v)) if kind == P.ANGLE else 1.0


def check_derivatives(kind, component, seed, swing=None):
    """The value along retracted twists: central differences of sixth order for both derivatives."""
    pool, q = scene(seed, swing)
    records = placed(pool, q)
    reach = workspace(kind, component, records)
    assert reach > 1e-3
    start = value(kind, component, records)
    first, second = gradient(kind, component, records), hessian(kind, component, records)
    step = 0.005 * reach
    rng = np.random.default_rng(seed)
    directions = [*np.eye(12), *(rng.normal(size=(12, 12)) / math.sqrt(12.0))]
    for direction in directions:
        up, down = (
            [value(kind, component, moved(pool, q, s * i * step * direction), near=start) for i in (1, 2, 3)]
            for s in (1.0, -1.0)
        )
        odd, even = np.subtract(up, down), np.add(up, down)
        slope = odd @ (45.0, -9.0, 1.0) / (60.0 * step)
        curvature = (even @ (270.0, -27.0, 2.0) - 490.0 * start) / (180.0 * step**2)
        # Derivatives grow as 1 / reach and 1 / reach^2, and the differences drop 1e-12 of that. A value's rounding,
        # which grows as 1 / reach too (for TURN its square), is divided by the step, or by its square.
        noise = 4e-16 / (reach**2 if kind == P.TURN else reach)
        assert direction @ first == pytest.approx(slope, rel=0, abs=1e-11 / reach + 3.0 * noise / step)
        assert direction @ second @ direction == pytest.approx(
            curvature, rel=0, abs=1e-10 / reach**2 + 9.0 * noise / step**2
        )


@every_coordinate
@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_the_value(kind, component, seed):
    check_derivatives(kind, component, seed)


@pytest.mark.parametrize(("kind", "component"), [c for c in TURNING if c[0] in (P.SWING, P.TURN, P.DOT)])
@pytest.mark.parametrize("swing", SWINGS)
def test_derivatives_at_small_and_large_swings(kind, component, swing):
    check_derivatives(kind, component, 11, swing)


@pytest.mark.parametrize(("kind", "component"), [(P.ANGLE, 0), (P.AZIMUTH, 2)])
@pytest.mark.parametrize("swing", [0.002, 0.1, 3.0, math.pi - 0.002])
def test_derivatives_beside_parallel_axes(kind, component, swing):
    check_derivatives(kind, component, 12, swing)


@pytest.mark.parametrize("seed", range(3))
def test_frames_are_placed_in_the_world(seed):
    pool, q = scene(seed)
    records = placed(pool, q)
    assert np.isnan(records[[0, 2]]).all()
    turns = [np.array(motion.rotation(q, i)).reshape(3, 3) for i in range(2)]
    body = pool[5:].reshape(2, 4, 3)
    expected = [body[i] @ turns[i].T for i in range(2)]
    # Sums of three products of numbers of size one.
    np.testing.assert_allclose(records[1, : P.ARM_B], expected[0].ravel(), rtol=0, atol=1e-15)
    np.testing.assert_allclose(records[1, P.ARM_B : P.APART], expected[1].ravel(), rtol=0, atol=1e-15)
    apart = q[1, :3] + expected[1][0] - q[0, :3] - expected[0][0]
    np.testing.assert_allclose(records[1, P.APART :], apart, rtol=0, atol=4e-15)


def test_a_common_offset_cancels():
    pool, q = scene(4)
    q[:, :3] = np.round(q[:, :3] * 1024.0) / 1024.0  # so that adding the offset rounds nothing
    shifted = q.copy()
    shifted[:, :3] += 2.0**20
    np.testing.assert_array_equal(placed(pool, shifted)[1], placed(pool, q)[1])


@pytest.mark.parametrize("seed", range(5))
def test_values_agree_with_each_other_and_with_numpy(seed):
    records = placed(*scene(seed))
    a, b = (records[1, o : o + 9].reshape(3, 3) for o in (P.AXES_A, P.AXES_B))
    apart = records[1, P.APART :]
    relative = a @ b.T
    dots = [value(P.DOT, k, records) for k in range(9)]
    np.testing.assert_allclose(dots, relative.ravel(), rtol=0, atol=1e-15)
    np.testing.assert_array_equal([value(P.COINCIDENT, k, records) for k in range(3)], apart)
    np.testing.assert_allclose([value(P.SLIDE, k, records) for k in range(3)], a @ apart, rtol=0, atol=4e-15)
    assert value(P.DISTANCE, 0, records) == pytest.approx(np.linalg.norm(apart), rel=1e-15)
    theta = value(P.ANGLE, 0, records)
    # Axes have unit length to a few roundings.
    assert math.cos(theta) == pytest.approx(dots[8], rel=0, abs=2e-15)
    swing = [value(P.SWING, k, records) for k in range(2)]
    # Values of size three, after a division by a sine of 0.1 or more.
    assert math.hypot(*swing) == pytest.approx(theta, rel=0, abs=2e-14)
    assert math.atan2(swing[1], swing[0]) == pytest.approx(value(P.AZIMUTH, 2, records), rel=0, abs=2e-14)
    # Undoing the swing leaves a turn about z_a.
    axis = np.cross((0.0, 0.0, 1.0), relative[:, 2])
    rest = turn(axis / np.linalg.norm(axis), -theta) @ relative
    assert math.atan2(rest[1, 0], rest[0, 0]) == pytest.approx(value(P.TURN, 0, records), rel=0, abs=2e-14)


@pytest.mark.parametrize("theta", [0.0, 5e-324, 1e-200, 1e-12, 1e-9, 1e-4, 0.04, 0.0447, 0.0448, 0.1, 1.0, 3.0])
def test_a_swing_is_exact_to_rounding(theta):
    heading = 0.7
    c, s = math.cos(theta), math.sin(theta)
    x = np.array([s * math.cos(heading), s * math.sin(heading), c])
    axes = np.stack([np.zeros(3), np.zeros(3), x], axis=1)
    for k, share in enumerate((math.cos(heading), math.sin(heading))):
        # Relative, however small; half a dozen roundings. Those of z_b count as 1 / sin(theta).
        assert value(P.SWING, k, record(axes), 0) == pytest.approx(
            theta * share, rel=2e-15 + 4e-16 / max(s, 0.1), abs=0
        )


@pytest.mark.parametrize("x", [0.0, 1e-12, 0.5 * P.SERIES, 0.999999 * P.SERIES])
def test_the_series_of_a_swing(x):
    """The three sums of b_n x^n, b_n = b_(n-1) n / (2 n + 1), and their derivatives, until terms vanish."""
    b = np.cumprod([1.0, *(n / (2 * n + 1) for n in range(1, 20))])
    axes = np.zeros((3, 3))
    axes[:, 2] = 0.6 * math.sqrt(2.0 * x), 0.8 * math.sqrt(2.0 * x), 1.0 - x
    found = P.swing(0, record(axes), 0)
    x = 1.0 - (1.0 - x)
    expected = [math.fsum(b[n] * x**n for n in range(20))]
    expected.append(-math.fsum(n * b[n] * x ** (n - 1) for n in range(1, 20)))
    expected.append(math.fsum(n * (n - 1) * b[n] * x ** (n - 2) for n in range(2, 20)) * axes[0, 2])
    # The second derivative counts with sin(theta)^3 = 1e-4 at most: three digits less.
    for k, (sum_, tolerance) in enumerate(zip(expected, (4e-16, 4e-16, 1e-12), strict=True)):
        assert found[(4, 7, 8)[k]] == pytest.approx(sum_, rel=tolerance, abs=0)


def test_a_swing_does_not_jump_where_its_series_ends():
    below, above = (turn((0.6, 0.8, 0.0), math.acos(1.0 - P.SERIES * s)) for s in (1.0 - 1e-12, 1.0 + 1e-12))
    for k in range(2):
        # The angle differs by 5e-14; second derivatives hold roundings over sin(theta)^2.
        for function, tolerance in ((value, 1e-13), (gradient, 1e-13), (hessian, 1e-12)):
            low, high = (function(P.SWING, k, record(axes), 0) for axes in (below, above))
            np.testing.assert_allclose(low, high, rtol=0, atol=tolerance)


def test_aligned_frames_are_at_zero_with_a_full_gradient():
    records = record()
    assert [value(kind, k, records, 0) for kind, k in ((P.SWING, 0), (P.SWING, 1), (P.TURN, 0))] == [0.0, 0.0, 0.0]
    rows = [gradient(kind, k, records, 0)[9:] for kind, k in ((P.SWING, 0), (P.SWING, 1), (P.TURN, 0))]
    # A small rotation w of b moves z_b by (w_y, -w_x) and turns it by w_z.
    np.testing.assert_array_equal(rows, [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("away", [0.0, 1e-17, 1e-13])
def test_opposed_axes_do_not_look_satisfied(away):
    axes = np.diag([1.0, -1.0, -1.0])
    axes[:2, 2] = 0.0, away
    records = record(axes)
    assert value(P.SWING, 0, records, 0) == pytest.approx(math.pi, rel=1e-15)
    assert value(P.SWING, 1, records, 0) == 0.0
    # As if z_b had come from z_a over x: it goes on about y, and sideways about x, steeply.
    np.testing.assert_allclose(gradient(P.SWING, 0, records, 0)[9:], [0.0, 1.0, 0.0], rtol=0, atol=1e-9)
    sideways = gradient(P.SWING, 1, records, 0)[9:]
    np.testing.assert_allclose(sideways, [math.pi / P.OPPOSED, 0.0, 0.0], rtol=1e-12, atol=1e-9)


def test_opposed_axes_of_turned_bodies():
    for seed in range(5):
        records = placed(*scene(seed, math.pi))
        # Axes opposed up to rounding: whichever direction it takes, the swing has the length pi.
        assert math.hypot(*(value(P.SWING, k, records) for k in range(2))) == pytest.approx(math.pi, rel=1e-14)


@pytest.mark.parametrize("theta", [math.pi - 1e-2, math.pi - 2e-3, math.pi - 5e-4, math.pi - 1e-9])
def test_a_swing_beside_opposed_axes_keeps_its_value_and_bounds_its_gradient(theta):
    for heading in (0.0, 0.7, 2.0, 4.0):
        axes = turn((-math.sin(heading), math.cos(heading), 0.0), theta)
        for k, share in enumerate((math.cos(heading), math.sin(heading))):
            # The rounding of z_b is that of the direction times the sine.
            assert value(P.SWING, k, record(axes), 0) == pytest.approx(
                theta * share, rel=0, abs=1e-15 / math.sin(theta)
            )
            assert np.abs(gradient(P.SWING, k, record(axes), 0)).max() < 1.01 * math.pi / P.OPPOSED
        # Away from z_a the angle grows at rate one, also where the sideways rate is bounded.
        both = [gradient(P.SWING, k, record(axes), 0)[9:] for k in range(2)]
        away = math.cos(heading) * both[0] + math.sin(heading) * both[1]
        np.testing.assert_allclose(away, [-math.sin(heading), math.cos(heading), 0.0], rtol=0, atol=2e-6)


DEGENERATE = [(P.DISTANCE, 0), (P.RADIUS, 0), (P.SWING, 0), (P.SWING, 1), (P.TURN, 0), (P.AZIMUTH, 2), (P.ANGLE, 0)]


@pytest.mark.parametrize(("kind", "component"), DEGENERATE)
@pytest.mark.parametrize("away", [0.0, 1e-300, 1e-170, 1e-16, 1e-12, 1e-9, 1e-6, 1e-5])
@pytest.mark.parametrize("opposed", [False, True])
def test_everything_is_finite_beside_degenerate_places(kind, component, away, opposed):
    axes = turn((0.6, -0.8, 0.0), away)
    if opposed:
        axes = axes @ np.diag([1.0, -1.0, -1.0])
    for records in (
        record(axes, (0.6 * away, 0.0, 0.8 * away)),
        placed(*scene(3, math.pi - away if opposed else away)),
    ):
        k = records.shape[0] // 2
        assert np.isfinite(value(kind, component, records, k, 0.5))
        first, second = gradient(kind, component, records, k, 0.5), hessian(kind, component, records, k)
        # The poles of TURN and AZIMUTH let most through: 2 / POLE, and its square.
        assert np.abs(first).max() < 4.0 / P.POLE
        assert np.abs(second).max() < 8.0 / P.POLE**2


def test_a_distance_of_zero():
    for away in (0.0, 1e-300, 1e-13):
        records = record(apart=(away, 0.0, 0.0))
        assert value(P.DISTANCE, 0, records, 0) == pytest.approx(away, abs=1e-160)
        np.testing.assert_array_equal(gradient(P.DISTANCE, 0, records, 0)[6:9], [0.0, 0.0, 1.0])
        second = hessian(P.DISTANCE, 0, records, 0)
        np.testing.assert_allclose(second[6:9, 6:9], np.diag([1.0, 1.0, 0.0]) / P.LEAST_DIVISOR, rtol=1e-15)


def test_a_small_distance_has_its_own_direction_and_a_bounded_curvature():
    n = np.array([0.6, 0.0, -0.8])
    for length in (1e-9, 1e-5):
        records = record(apart=length * n)
        np.testing.assert_allclose(gradient(P.DISTANCE, 0, records, 0)[6:9], n, rtol=0, atol=4e-16)
        second = hessian(P.DISTANCE, 0, records, 0)[6:9, 6:9]
        # One rounding of 1 is 1e-16 of the curvature.
        np.testing.assert_allclose(
            second * max(length, P.LEAST_DIVISOR), np.eye(3) - np.outer(n, n), rtol=0, atol=1e-15
        )


@pytest.mark.parametrize("opposed", [False, True])
def test_an_angle_between_parallel_axes(opposed):
    flip = np.diag([1.0, -1.0, -1.0]) if opposed else np.eye(3)
    records = record(flip)
    assert value(P.ANGLE, 0, records, 0) == (math.pi if opposed else 0.0)
    np.testing.assert_array_equal(gradient(P.ANGLE, 0, records, 0)[9:], [0.0, 1.0, 0.0])
    second = hessian(P.ANGLE, 0, records, 0)[9:, 9:]
    sign = -1.0 if opposed else 1.0
    # (c (I - n n^T) - c z z^T) / LEAST_DIVISOR: sideways about x, and nothing about the axis itself.
    np.testing.assert_allclose(second * P.LEAST_DIVISOR, np.diag([sign, 0.0, 0.0]), rtol=0, atol=1e-15)
    for away in (1e-9, 1e-7):
        records = record(turn((0.6, -0.8, 0.0), away) @ flip)
        assert value(P.ANGLE, 0, records, 0) == pytest.approx(math.pi - away if opposed else away, rel=1e-15)
        expected = np.array([0.6, -0.8, 0.0]) * sign
        np.testing.assert_allclose(gradient(P.ANGLE, 0, records, 0)[9:], expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("kind", "component", "flip"), [(P.TURN, 0, True), (P.AZIMUTH, 2, True), (P.AZIMUTH, 2, False)]
)
def test_slopes_end_beside_poles_and_values_at_them(kind, component, flip):
    axes = np.diag([1.0, -1.0, -1.0]) if flip else np.eye(3)
    # What is undefined by rounding keeps the number it had; nearer than POLE slopes are as steep as there.
    for away, kept, curves in (
        (0.0, True, False),
        (0.9 * P.UNDEFINED, True, False),
        (1e-9, False, False),
        (0.9 * P.POLE, False, False),
        (1.1 * P.POLE, False, True),
    ):
        records = record(turn((0.6, 0.8, 0.0), away) @ axes)
        found, slope = value(kind, component, records, 0, 40.0), np.abs(gradient(kind, component, records, 0)).max()
        assert (found == 40.0) == kept and abs(found - 40.0) <= math.pi
        assert (slope == 0.0) == kept and slope <= 2.0 / P.POLE * (1.0 + 1e-6)
        assert kept or slope > 0.5 / P.POLE
        assert (np.abs(hessian(kind, component, records, 0)).max() == 0.0) != curves
        if not kept and kind == P.AZIMUTH:
            # z_b goes from the axis at right angles to what it is turned about.
            way = np.array([0.8, -0.6]) if axes[2, 2] > 0.0 else np.array([-0.8, 0.6])
            assert math.remainder(found - math.atan2(way[1], way[0]), 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("kind", "component"), [(P.TURN, 0), *((P.AZIMUTH, k) for k in range(3))])
def test_turns_are_unwrapped(kind, component):
    records = placed(*scene(6))
    raw = value(kind, component, records)
    assert abs(raw) <= math.pi
    for turns in range(-7, 8):
        for offset in (-3.14, -1.0, 0.0, 3.14):
            expected = raw + 2.0 * math.pi * turns
            found = value(kind, component, records, near=expected + offset)
            assert found == pytest.approx(expected, rel=0, abs=1e-14)
            np.testing.assert_array_equal(
                gradient(kind, component, records, near=expected + offset), gradient(kind, component, records)
            )


def test_a_turn_followed_over_several_revolutions():
    near = 0.0
    for angle in np.arange(0.0, 20.0, 2.5):
        near = value(P.TURN, 0, record(turn((0.0, 0.0, 1.0), angle)), 0, near)
        assert near == pytest.approx(angle, rel=0, abs=2e-14)


@every_coordinate
def test_gradients_are_written_where_they_belong(kind, component):
    records = placed(*scene(7))
    found = P.coordinate(kind, component, records, 1, 0.0)
    jacobian = np.full((3, 20), np.nan)
    P.write_gradient(*found[1:], -2.5, jacobian, 1, 4)
    np.testing.assert_allclose(jacobian[1, 4:16], -2.5 * gradient(kind, component, records), rtol=0, atol=1e-14)
    jacobian[1, 4:16] = np.nan
    assert np.isnan(jacobian).all()


@every_coordinate
@pytest.mark.parametrize(("f", "g"), [(0, 6), (6, 0), (9, 1), (2, 12), (-6, 6), (0, -6), (7, -1), (-1, -1)])
def test_hessians_are_added_where_they_belong(kind, component, f, g):
    """Into the upper triangle, and to nothing else than the blocks of moving bodies."""
    records = placed(*scene(8))
    before = np.random.default_rng(9).normal(size=(18, 18))
    after = before.copy()
    add_coordinate_hessian(kind, component, records, 1, -1.5, after, f, g)
    full = -1.5 * hessian(kind, component, records)
    expected = np.zeros((18, 18))
    places = [(o, 6 * i) for i, o in enumerate((f, g)) if o >= 0]
    for row, i in places:
        for column, j in places:
            expected[row : row + 6, column : column + 6] = full[i : i + 6, j : j + 6]
    upper = np.triu_indices(18)
    # Additions to numbers of size one.
    tolerance = 1e-14 * (1.0 + np.abs(full).max())
    np.testing.assert_allclose((after - before)[upper], expected[upper], rtol=0, atol=tolerance)
    changed = np.tril(after != before, -1)
    for row, _ in places:
        for o in (row, row + 3):
            changed[o : o + 3, o : o + 3] = False
    assert not changed.any()


@kernel
def run(pool, q, kinds, components, near, records, values, jacobian, second, f, g):
    """All rows compiled, as the loop calls them."""
    P.place_frames(pool, 5, q, 0, 1, records, 1)
    for r in range(kinds.size):
        values[r], n, arm_f, arm_g, h = P.coordinate(kinds[r], components[r], records, 1, near)
        P.write_gradient(n, arm_f, arm_g, h, 1.0, jacobian, r, 0)
        add_coordinate_hessian(kinds[r], components[r], records, 1, 1.0, second[r], f, g)


@pytest.mark.parametrize("swing", [None, 0.0, 0.01, 3.0, math.pi])
def test_compiled_and_plain_python_agree(swing):
    pool, q = scene(10, swing)
    kinds, components = np.array(COORDINATES, dtype=np.int64).T.copy()
    count = kinds.size
    values, jacobian = np.empty(count), np.empty((count, 12))
    records = np.full((3, P.RECORD), np.nan)
    plain = placed(pool, q)
    for f, g in ((0, 6), (6, 0), (-1, 0)):
        second = np.zeros((count, 12, 12))
        run(pool, q, kinds, components, 8.0, records, values, jacobian, second, f, g)
        np.testing.assert_allclose(records[1], plain[1], rtol=0, atol=2e-15)
        for r, (kind, component) in enumerate(COORDINATES):
            if swing in (0.0, math.pi) and (kind, component) in ((P.AZIMUTH, 2), (P.ANGLE, 0)):
                continue  # the direction is a matter of rounding
            if swing == math.pi and kind in (P.SWING, P.TURN):
                continue
            # Other roundings (fused multiply-add), and steep derivatives where z_b is near opposed.
            expected = np.zeros((12, 12))
            add_coordinate_hessian(kind, component, plain, 1, 1.0, expected, f, g)
            scale = 1.0 + np.abs(expected).max()
            assert values[r] == pytest.approx(value(kind, component, plain, near=8.0), rel=0, abs=1e-14 * scale)
            np.testing.assert_allclose(jacobian[r], gradient(kind, component, plain), rtol=0, atol=1e-14 * scale)
            np.testing.assert_allclose(second[r], expected, rtol=0, atol=1e-13 * scale)
    assert np.isfinite(values).all() and np.isfinite(jacobian).all()


def test_a_radius_of_zero():
    """Toward x_a where there is no direction, as what a point leaves the axis along; a bounded curvature around it."""
    for away in (0.0, 1e-300, 1e-15):
        records = record(apart=(0.0, -away, 0.7))
        assert value(P.RADIUS, 0, records, 0) == pytest.approx(away, abs=1e-160)
        np.testing.assert_array_equal(gradient(P.RADIUS, 0, records, 0)[6:9], [1.0, 0.0, 0.0])
        second = hessian(P.RADIUS, 0, records, 0)
        np.testing.assert_allclose(second[6:9, 6:9], np.diag([0.0, 1.0, 0.0]) / P.LEAST_DIVISOR, rtol=1e-15)


@pytest.mark.parametrize("away", [1e-9, 1e-5, 0.3])
def test_a_radius_has_the_direction_across_the_axis(away):
    records = record(apart=(0.6 * away, -0.8 * away, 2.0))
    assert value(P.RADIUS, 0, records, 0) == pytest.approx(away, rel=1e-15)
    np.testing.assert_allclose(gradient(P.RADIUS, 0, records, 0)[6:9], [0.6, -0.8, 0.0], rtol=0, atol=4e-16)
    second = hessian(P.RADIUS, 0, records, 0)[6:9, 6:9]
    around = np.array([0.8, 0.6, 0.0])
    np.testing.assert_allclose(second * max(away, P.LEAST_DIVISOR), np.outer(around, around), rtol=0, atol=1e-15)
