from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import assembly as asm
from assembly.kinematics import pose as kinematics

EPSILON = np.finfo(float).eps
coordinate = st.floats(-1.0, 1.0)
vectors = st.lists(coordinate, min_size=3, max_size=3).map(np.array)
# Of lengths from a tenth to two: far from unit as well, where formulas must divide by |e|^2.
quaternions = st.lists(coordinate, min_size=4, max_size=4).map(np.array).filter(lambda e: np.linalg.norm(e) > 0.1)
units = quaternions.map(lambda e: e / np.linalg.norm(e))
I, J, K = np.eye(4)[1:]
ONE = np.eye(4)[0]


def conjugate(e):
    return e * [1.0, -1.0, -1.0, -1.0]


def sandwich(e, v):
    """Vector part of e v e^* / |e|^2, complex numbers allowed: the definition, written out once more."""

    def product(a, b):
        return np.array(
            [
                a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
            ]
        )

    e = np.asarray(e)
    return product(product(e, [0.0, *v]), conjugate(e))[1:] / (e * e).sum()


# Algebra. Values are of order one and sums have a dozen terms: 1e-14 is some fifty roundings.


def test_units_multiply_as_hamilton_said():
    product = kinematics.multiply
    for unit in (I, J, K):
        np.testing.assert_array_equal(product(unit, unit), -ONE)
    np.testing.assert_array_equal(product(I, J), K)
    np.testing.assert_array_equal(product(J, K), I)
    np.testing.assert_array_equal(product(K, I), J)
    np.testing.assert_array_equal(product(J, I), -K)


@given(quaternions, quaternions, quaternions)
def test_products_are_associative_and_norms_multiply(a, b, c):
    product = kinematics.multiply
    np.testing.assert_allclose(product(product(a, b), c), product(a, product(b, c)), rtol=0, atol=1e-14)
    assert np.linalg.norm(product(a, b)) == pytest.approx(np.linalg.norm(a) * np.linalg.norm(b), rel=1e-14)
    np.testing.assert_allclose(product(a, conjugate(a)), (a @ a) * ONE, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(product(a, ONE), a)
    np.testing.assert_array_equal(product(ONE, a), a)


@given(quaternions, quaternions, vectors)
def test_rotations_are_a_homomorphism_into_proper_rotations(a, b, v):
    matrix = kinematics.rotation_matrix(a)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(matrix @ v, sandwich(a, v), rtol=0, atol=1e-14)
    np.testing.assert_allclose(kinematics.rotate(a, v), sandwich(a, v), rtol=0, atol=1e-14)
    both = kinematics.rotation_matrix(kinematics.multiply(a, b))
    np.testing.assert_allclose(both, matrix @ kinematics.rotation_matrix(b), rtol=0, atol=1e-14)


@given(quaternions)
def test_a_quaternion_and_its_negative_are_one_rotation_whatever_their_length(e):
    matrix = kinematics.rotation_matrix(e)
    np.testing.assert_array_equal(kinematics.rotation_matrix(-e), matrix)
    for factor in (1e-140, 1e140):
        np.testing.assert_allclose(kinematics.rotation_matrix(factor * e), matrix, rtol=0, atol=1e-14)


def test_quarter_turns_go_the_right_way():
    x, y, z = np.eye(3)
    for axis, before, after in ((x, y, z), (y, z, x), (z, x, y)):
        pose = asm.Pose.from_axis_angle(axis, np.pi / 2)
        np.testing.assert_allclose(pose.apply(before), after, rtol=0, atol=4 * EPSILON)


def test_axes_of_any_length_turn_alike():
    # Squares of these lengths underflow and overflow.
    expected = asm.Pose.from_axis_angle((1, 2, -2), 0.7).q
    for factor in (1e-300, 1e-160, 1e160, 1e300):
        turned = asm.Pose.from_axis_angle(np.array([1, 2, -2]) * factor, 0.7).q
        np.testing.assert_allclose(turned, expected, rtol=0, atol=4 * EPSILON)


# Derivatives: appendix B of paper 001, of the normalized rotation.


@given(quaternions, vectors)
def test_rotation_derivative_against_complex_steps(e, v):
    # A complex step has no cancellation: equal to rounding, of e / |e|^2 up to ten.
    jacobian = kinematics.rotate_jacobian(e, v)
    steps = 1e-30j * np.eye(4)
    expected = np.column_stack([sandwich(e + step, v).imag / 1e-30 for step in steps])
    np.testing.assert_allclose(jacobian, expected, rtol=0, atol=1e-13)
    # -e is the same rotation, met from the other side.
    np.testing.assert_allclose(kinematics.rotate_jacobian(-e, v), -jacobian, rtol=0, atol=1e-14)
    # Stretching e turns nothing.
    np.testing.assert_allclose(jacobian @ e, np.zeros(3), rtol=0, atol=1e-14)


@given(quaternions, vectors)
def test_rotation_derivative_against_central_differences(e, v):
    # Steps of 1e-5 |e|: truncation 1e-10 of a third derivative of a few units, rounding eps / 1e-5 = 2e-11; over |e|.
    h = 1e-5 * np.linalg.norm(e)
    rotate = kinematics.rotate
    differences = [(rotate(e + h * d, v) - rotate(e - h * d, v)) / (2.0 * h) for d in np.eye(4)]
    tolerance = 2e-9 / np.linalg.norm(e)
    np.testing.assert_allclose(kinematics.rotate_jacobian(e, v), np.column_stack(differences), rtol=0, atol=tolerance)


@given(quaternions, st.booleans())
def test_rate_maps_are_inverse_to_each_other(e, body_axes):
    g = kinematics.angular_velocity_map(e, body_axes)
    square = e @ e
    np.testing.assert_allclose(g @ g.T, 4.0 * square * np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(g @ e, np.zeros(3), rtol=0, atol=1e-15)
    back = kinematics.quaternion_rate_map(e, body_axes)
    # omega -> e' -> omega, and e' -> omega -> e' without the part that stretches e.
    np.testing.assert_allclose(g @ back / square, np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(back @ g, square * np.eye(4) - np.outer(e, e), rtol=0, atol=1e-14)


@given(quaternions)
def test_body_axes_are_world_axes_turned_back(e):
    world, body = kinematics.angular_velocity_map(e), kinematics.angular_velocity_map(e, body_axes=True)
    np.testing.assert_allclose(kinematics.rotation_matrix(e) @ body, world, rtol=0, atol=2e-14)


@given(quaternions, st.lists(coordinate, min_size=4, max_size=4).map(np.array))
def test_angular_velocity_is_the_rate_of_the_matrix(e, rate):
    # R' R^T = [omega]x in world axes, R^T R' = [omega]x in body axes; differences as above, |e'| / |e| up to 20.
    h = 1e-5 * np.linalg.norm(e)
    rotation = kinematics.rotation_matrix
    turning = (rotation(e + h * rate) - rotation(e - h * rate)) / (2.0 * h)
    for body_axes in (False, True):
        omega = kinematics.angular_velocity_map(e, body_axes) @ rate / (e @ e)
        spin = rotation(e).T @ turning if body_axes else turning @ rotation(e).T
        np.testing.assert_allclose(spin, kinematics.skew(omega), rtol=0, atol=1e-8 / np.linalg.norm(e))


# Retraction.


@given(units, vectors, st.floats(0.0, 3.0))
def test_retraction_is_the_exponential_in_world_axes(e, axis, angle):
    length = np.linalg.norm(axis)
    w = np.zeros(3) if length < 1e-3 else angle * axis / length
    moved = kinematics.retract([1.0, 2.0, 3.0, *e], [0.5, -1.0, 0.25, *w])
    np.testing.assert_array_equal(moved[:3], [1.5, 1.0, 3.25])
    assert np.linalg.norm(moved[3:]) == pytest.approx(1.0, abs=2 * EPSILON)
    # Rodrigues' formula is written without quaternions.
    k = kinematics.skew(w / angle) if angle > 0.0 else np.zeros((3, 3))
    turn = np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k
    np.testing.assert_allclose(
        kinematics.rotation_matrix(moved[3:]), turn @ kinematics.rotation_matrix(e), rtol=0, atol=2e-14
    )


@given(units, vectors)
def test_half_a_retraction_twice_is_the_whole(e, w):
    q = np.array([0.0, 0.0, 0.0, *e])
    half = np.array([0.0, 0.0, 0.0, *(0.5 * w)])
    twice = kinematics.retract(kinematics.retract(q, half), half)
    np.testing.assert_allclose(twice, kinematics.retract(q, 2.0 * half), rtol=0, atol=2e-15)
    np.testing.assert_allclose(kinematics.retract(kinematics.retract(q, half), -half), q, rtol=0, atol=2e-15)


def test_retraction_of_many_rows_is_that_of_each():
    rng = np.random.default_rng(1)
    q, twist = rng.normal(size=(2, 5, 7)), rng.normal(size=(2, 5, 6))
    moved = kinematics.retract(q, twist)
    for index in np.ndindex(2, 5):
        np.testing.assert_allclose(moved[index], kinematics.retract(q[index], twist[index]), rtol=0, atol=4 * EPSILON)


def test_retraction_leaves_its_arguments_alone():
    q, twist = np.array([1.0, 2, 3, 0, 0, 0, 2]), np.ones(6)
    kinematics.retract(q, twist)
    assert q.tolist() == [1, 2, 3, 0, 0, 0, 2] and twist.tolist() == [1] * 6


# Pose.


poses = st.builds(asm.Pose, vectors, units)


@given(poses, poses, poses, vectors)
def test_poses_compose_and_invert(a, b, c, v):
    np.testing.assert_allclose((a @ b).apply(v), a.apply(b.apply(v)), rtol=0, atol=1e-14)
    np.testing.assert_allclose(((a @ b) @ c).matrix, (a @ (b @ c)).matrix, rtol=0, atol=2e-14)
    np.testing.assert_allclose((a @ b).matrix, a.matrix @ b.matrix, rtol=0, atol=1e-14)
    np.testing.assert_allclose((a @ a.inverse()).matrix, np.eye(4), rtol=0, atol=1e-14)
    np.testing.assert_allclose(a.inverse().apply(a.apply(v)), v, rtol=0, atol=1e-14)
    np.testing.assert_allclose(a.matrix @ [*v, 1.0], [*a.apply(v), 1.0], rtol=0, atol=1e-14)


def test_poses_move_points_of_any_shape():
    pose = asm.Pose((1, 2, 3), (0.5, 0.5, 0.5, 0.5))  # x to y to z to x
    points = np.arange(24.0).reshape(2, 4, 3)
    np.testing.assert_allclose(pose.apply(points), points[..., [2, 0, 1]] + [1, 2, 3], rtol=0, atol=1e-14)
    assert pose.apply(np.empty((0, 3))).shape == (0, 3)


@given(units, st.floats(-0.009, 0.009))
def test_normalization_happens_once(e, error):
    pose = asm.Pose(quaternion=e * (1.0 + error))
    assert np.linalg.norm(pose.quaternion) == pytest.approx(1.0, abs=2 * EPSILON)
    # What was normalized is left as it is, to the bit: files and copies depend on it.
    np.testing.assert_array_equal(asm.Pose(pose.position, pose.quaternion).q, pose.q)
    np.testing.assert_array_equal(kinematics.pose_rows("rows", [pose.q])[0], pose.q)


def test_poses_cannot_be_changed():
    position = np.zeros(3)
    pose = asm.Pose(position)
    position[0] = 1.0
    assert pose.q.tolist() == [0, 0, 0, 1, 0, 0, 0]
    for array in (pose.position, pose.quaternion, pose.q, pose.matrix):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2.0


def test_unit_vectors_of_extreme_lengths():
    for factor in (5e-324, 1e-200, 1.0, 1e308):
        np.testing.assert_allclose(
            kinematics.direction("z", [0.0, factor, -factor]), [0, 0.5**0.5, -(0.5**0.5)], rtol=0, atol=EPSILON
        )
