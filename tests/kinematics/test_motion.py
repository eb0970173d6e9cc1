from __future__ import annotations

import math
from ast import literal_eval

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from assembly.kinematics import motion
from assembly.kinematics import pose as kinematics

RNG = np.random.default_rng(7)
# Both sides of the switch of `exponential` from a series to cos and sin, at an angle of 1e-4, and far from it.
ANGLES = [0.0, 5e-324, 1e-200, 1e-20, 1e-9, 5e-5, 0.99999e-4, 1e-4, 1.00001e-4, 2e-4, 1e-3, 0.1, 1.0, 3.0, math.pi, 6.0]


def rows(count):
    q = RNG.normal(size=(count, 7))
    q[:, 3:] /= np.linalg.norm(q[:, 3:], axis=1)[:, None]
    return q


def series(angle):
    """cos(a / 2) and sin(a / 2) / a, summed until terms vanish."""
    half = [(0.5 * angle) ** (2 * k) * (-1) ** k for k in range(12)]
    c = math.fsum(term / math.factorial(2 * k) for k, term in enumerate(half))
    s = 0.5 * math.fsum(term / math.factorial(2 * k + 1) for k, term in enumerate(half))
    return c, s


@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_on_both_sides_of_its_switch(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    w = angle * axis
    e = np.array(motion.exponential(tuple(w)))
    c, s = series(angle) if angle <= 1.0 else (math.cos(0.5 * angle), math.sin(0.5 * angle) / angle)
    # One rounding of a value of one: the series drops less than 1e-17 below the switch.
    np.testing.assert_allclose(e[0], c, rtol=0, atol=3e-16)
    np.testing.assert_allclose(e[1:], s * w, rtol=1e-15, atol=3e-16 * min(1.0, angle))
    assert np.linalg.norm(e) == pytest.approx(1.0, abs=1e-15)


def test_exponential_does_not_jump_at_its_switch():
    low, high = (np.array(motion.exponential((a, 0.0, 0.0))) for a in (math.nextafter(1e-4, 0.0), 1e-4))
    np.testing.assert_allclose(low, high, rtol=0, atol=1.2e-16)


@pytest.mark.parametrize("angle", ANGLES)
def test_retraction_equals_the_one_in_python(angle):
    q = rows(3)
    axis = np.array([1.0, -2.0, 0.5])
    w = angle * axis / np.linalg.norm(axis)
    out = q.copy()
    motion.retract(q, 1, (0.5, -1.0, 2.0), tuple(w), out)
    expected = kinematics.retract(q[1], [0.5, -1.0, 2.0, *w])
    np.testing.assert_allclose(out[1], expected, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(out[[0, 2]], q[[0, 2]])


def test_retraction_in_place():
    q = rows(1)
    expected = kinematics.retract(q[0], [1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    motion.retract(q, 0, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), q)
    np.testing.assert_allclose(q[0], expected, rtol=0, atol=1e-15)


def test_many_retractions_keep_quaternions_unit():
    q = rows(1)
    for step in RNG.normal(size=(1000, 3)):
        motion.retract(q, 0, (0.0, 0.0, 0.0), tuple(step), q)
    # Normalized every time: errors do not add up.
    assert np.linalg.norm(q[0, 3:]) == pytest.approx(1.0, abs=5e-16)


@pytest.mark.parametrize("length", [1.0, 0.3, 7.0])
def test_rotation_and_relative_pose(length):
    for _ in range(20):
        q = rows(2)
        q[:, 3:] *= length
        turn_f, turn_g = (kinematics.rotation_matrix(row[3:]) for row in q)
        packed_f, packed_g = motion.rotation(q, 0), motion.rotation(q, 1)
        np.testing.assert_allclose(np.reshape(packed_f, (3, 3)), turn_f, rtol=0, atol=1e-15)
        turn, shift = motion.relative_pose(q, 0, packed_f, 1, packed_g)
        np.testing.assert_allclose(np.reshape(turn, (3, 3)), turn_f.T @ turn_g, rtol=0, atol=2e-15)
        np.testing.assert_allclose(shift, turn_f.T @ (q[1, :3] - q[0, :3]), rtol=0, atol=1e-14)
        assert motion.position(q, 1) == tuple(q[1, :3])


def test_a_common_offset_cancels_in_the_relative_pose():
    # Multiples of 1/8 and an offset of 2^40 add exactly, so not a bit may change.
    q = rows(2)
    q[:, :3] = [[1.0, -0.5, 0.125], [3.0, 2.25, -1.0]]
    near = motion.relative_pose(q, 0, motion.rotation(q, 0), 1, motion.rotation(q, 1))
    q[:, :3] += 2.0**40
    assert motion.relative_pose(q, 0, motion.rotation(q, 0), 1, motion.rotation(q, 1)) == near


@given(
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array),
    st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4).map(np.array).filter(lambda e: np.linalg.norm(e) > 0.2),
)
def test_quaternion_columns_are_a_row_times_the_rate_map(w, e):
    expected = w @ kinematics.angular_velocity_map(e) / (e @ e)
    # |w| |G| / |e|^2 is 70 at most.
    np.testing.assert_allclose(motion.quaternion_columns(tuple(w), *e), expected, rtol=0, atol=1e-13)


def test_without_jit_the_answers_are_the_same(run_python):
    code = """
import numpy as np
from assembly.kinematics import motion
q = np.array([[1.0, 2, 3, 0.5, 0.1, -0.7, 0.5], [0.3, -2, 1, 0.1, 0.9, 0.2, -0.4]])
out = q.copy()
motion.retract(q, 0, (0.1, 0.2, 0.3), (0.4, -0.5, 0.6), out)
motion.retract(q, 1, (0.1, 0.2, 0.3), (4e-5, -5e-5, 6e-5), out)
turn, shift = motion.relative_pose(q, 0, motion.rotation(q, 0), 1, motion.rotation(q, 1))
columns = motion.quaternion_columns((0.3, 0.2, -0.9), *q[0, 3:])
print(np.array([*out.ravel(), *turn, *shift, *columns]).tolist())
"""
    plain, compiled = (literal_eval(run_python(code, NUMBA_DISABLE_JIT=switch)) for switch in ("1", None))
    # Fused multiply-adds round once where Python rounds twice.
    np.testing.assert_allclose(compiled, plain, rtol=0, atol=4e-15)
