"""Laws of the forces for the hand: each formula does the same work on both of its sides.

Motions are differences of the fourth order of smooth paths with steps of 3e-4: off by 1e-14 times their fifth
derivatives, some thousands, and by roundings over the step, 1e-12 times values up to ten.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

from assembly.errors import InputError
from assembly.kinematics.pose import axes_quaternion, rotation_matrix, skew
from assembly.solve.forces.statics import Wrench, tool_wrench
from assembly.tracking import haptics

STEP = 3e-4


def difference(path):
    """The derivative at 0 of a function of time."""
    near, far = path(STEP) - path(-STEP), path(2.0 * STEP) - path(-2.0 * STEP)
    return (8.0 * near - far) / (12.0 * STEP)


def turn(axis, angle):
    """Rotation (3, 3) about a unit axis, by Rodrigues' formula."""
    k = skew(axis)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def unskewed(m):
    return 0.5 * np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])


@pytest.mark.parametrize("seed", range(20))
def test_equation_5_keeps_the_work(seed):
    rng = np.random.default_rng(seed)
    # Any quaternion, moved in any way: along itself too.
    length, direction = rng.uniform(0.3, 3.0), rng.normal(size=4)
    unit = direction / np.linalg.norm(direction)
    e, rates = length * unit, rng.normal(size=7) * ([1.0] * 3 + [length] * 4)
    velocity = rates[:3]
    in_body = unskewed(rotation_matrix(e).T @ difference(lambda t: rotation_matrix(e + t * rates[3:])))
    wrench = rng.normal(size=6)
    force = haptics.configuration_force(wrench, e)
    assert force @ rates == pytest.approx(wrench[:3] @ velocity + wrench[3:] @ in_body, abs=1e-9)
    # Nothing works along the quaternion, and what a force has there drops out.
    assert force[3:] @ unit == pytest.approx(0.0, abs=1e-14 * np.linalg.norm(force))
    given = rng.normal(size=7)
    back = haptics.body_wrench(given, e)
    lost = (given[3:] @ e) / (e @ e) * (e @ rates[3:])
    work = back[:3] @ velocity + back[3:] @ in_body
    assert work == pytest.approx(given @ rates - lost, abs=1e-9)
    np.testing.assert_allclose(haptics.body_wrench(force, e), wrench, rtol=0, atol=1e-13)


def test_equation_5_is_that_of_wrenches_on_bodies():
    rng = np.random.default_rng(1)
    e = rng.normal(size=4)
    q = np.concatenate([rng.normal(size=3), e / np.linalg.norm(e)])
    wrench = Wrench(rng.normal(size=3), rng.normal(size=3), q)
    in_body = np.concatenate([wrench.force, wrench.in_body_axes()[3:]])
    np.testing.assert_allclose(haptics.configuration_force(in_body, q[3:]), wrench.configuration(), rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_equation_6_keeps_the_work_of_the_finger(seed):
    rng = np.random.default_rng(seed)
    force, arm, twist = rng.normal(size=3), rng.normal(size=3), rng.normal(size=6)
    axis, rate = twist[3:] / np.linalg.norm(twist[3:]), np.linalg.norm(twist[3:])
    # The tip of a hand whose wrist moves by the twist.
    speed = difference(lambda t: t * twist[:3] + turn(axis, t * rate) @ arm)
    wrench = haptics.finger_wrench(force, arm)
    assert wrench @ twist == pytest.approx(force @ speed, abs=1e-9)
    np.testing.assert_array_equal(wrench, tool_wrench(force, arm))


class Arm:
    """Turning joints one after the other, known by their axes and places when all angles are zero.

    The axes of the last three go through the wrist; a finger is fixed beyond it.
    """

    def __init__(self, rng, joints=7, wrist_joints=3):
        axes = rng.normal(size=(joints, 3))
        self.axes = axes / np.linalg.norm(axes, axis=1)[:, None]
        self.wrist = rng.normal(size=3)
        self.origins = rng.normal(size=(joints, 3))
        # Anywhere on an axis through the wrist.
        along = rng.normal(size=(wrist_joints, 1))
        self.origins[joints - wrist_joints :] = self.wrist + along * self.axes[joints - wrist_joints :]
        self.tip = self.wrist + rng.normal(size=3)

    def at(self, angles):
        """Axes, origins, the wrist, the tip, and the turn of the hand, by a product of motions."""
        rotation, shift = np.eye(3), np.zeros(3)
        axes, origins = [], []
        for axis, origin, angle in zip(self.axes, self.origins, angles, strict=True):
            axes.append(rotation @ axis)
            origins.append(rotation @ origin + shift)
            own = turn(axis, angle)
            shift = rotation @ (origin - own @ origin) + shift
            rotation = rotation @ own
        return np.array(axes), np.array(origins), rotation @ self.wrist + shift, rotation @ self.tip + shift, rotation


@pytest.mark.parametrize("seed", range(20))
def test_equations_7_and_8_keep_the_work(seed):
    rng = np.random.default_rng(seed)
    arm = Arm(rng)
    angles, rates = rng.uniform(-3.0, 3.0, 7), rng.normal(size=7)
    axes, origins, wrist, tip, rotation = arm.at(angles)
    jacobian = haptics.manipulator_jacobian(axes, (wrist - origins)[:4])
    assert jacobian.shape == (6, 7) and (jacobian[:3, 4:] == 0.0).all()
    # The twist of the wrist.
    velocity = difference(lambda t: arm.at(angles + t * rates)[2])
    angular = unskewed(difference(lambda t: arm.at(angles + t * rates)[4]) @ rotation.T)
    np.testing.assert_allclose(jacobian @ rates, [*velocity, *angular], rtol=0, atol=1e-9)
    # Arms of the last joints may be given, of any length along their axes.
    whole = haptics.manipulator_jacobian(axes, wrist - origins)
    np.testing.assert_allclose(whole, jacobian, rtol=0, atol=1e-14)
    # Power at the joints is power at the wrist, and power of a force at the finger's tip.
    wrench = rng.normal(size=6)
    power = haptics.joint_torques(jacobian, wrench) @ rates
    assert power == pytest.approx(wrench @ [*velocity, *angular], abs=1e-9)
    force = rng.normal(size=3)
    torques = haptics.joint_torques(jacobian, haptics.finger_wrench(force, tip - wrist))
    assert torques @ rates == pytest.approx(force @ difference(lambda t: arm.at(angles + t * rates)[3]), abs=1e-9)


def test_many_ticks_at_once():
    rng = np.random.default_rng(3)
    e, wrench, force = rng.normal(size=(5, 4)), rng.normal(size=(5, 6)), rng.normal(size=7)
    rows = haptics.configuration_force(wrench, e)
    each = haptics.body_wrench(force, e)
    axes, arms = rng.normal(size=(5, 7, 3)), rng.normal(size=(4, 3))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    jacobians = haptics.manipulator_jacobian(axes, arms)
    torques = haptics.joint_torques(jacobians, wrench)
    fingers = haptics.finger_wrench(wrench[:, :3], arms[0])
    assert jacobians.shape == (5, 6, 7) and torques.shape == (5, 7)
    for k in range(5):
        np.testing.assert_allclose(rows[k], haptics.configuration_force(wrench[k], e[k]), rtol=1e-15)
        np.testing.assert_allclose(each[k], haptics.body_wrench(force, e[k]), rtol=1e-15)
        np.testing.assert_array_equal(jacobians[k], haptics.manipulator_jacobian(axes[k], arms))
        np.testing.assert_allclose(torques[k], haptics.joint_torques(jacobians[k], wrench[k]), rtol=1e-13)
        np.testing.assert_array_equal(fingers[k], haptics.finger_wrench(wrench[k, :3], arms[0]))
    # One wrench for the arms of all ticks, and one arm for all wrenches.
    assert haptics.joint_torques(jacobians, wrench[0]).shape == haptics.joint_torques(jacobians[0], wrench).shape


def test_axes_typed_to_two_digits_are_normalized():
    exact = np.array([[0.6, 0.8, 0.0]])
    np.testing.assert_allclose(
        haptics.manipulator_jacobian(1.009 * exact, [[1, 2, 3]]),
        haptics.manipulator_jacobian(exact, [[1, 2, 3]]),
        rtol=1e-15,
    )


E = axes_quaternion(np.eye(3))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: haptics.body_wrench(np.zeros(6), E), "force has shape (6,); expected (..., 7)"),
        (lambda: haptics.body_wrench(np.zeros(7), np.zeros(4)), "quaternion is zero"),
        (lambda: haptics.body_wrench(np.zeros(7), [1, 0, 0, np.nan]), "quaternion[3] is nan"),
        (
            lambda: haptics.body_wrench(np.zeros((3, 7)), np.ones((2, 4))),
            "force has shape (3, 7) and quaternion has shape (2, 4); expected leading axes that broadcast",
        ),
        (lambda: haptics.configuration_force([[1, 2], [1]], E), "wrench has rows of different lengths"),
        (lambda: haptics.configuration_force("push", E), "wrench has shape (); expected (..., 6)"),
        (lambda: haptics.finger_wrench((0, 0, 1), (0, 0)), "arm has shape (2,); expected (..., 3)"),
        (lambda: haptics.finger_wrench(np.zeros((2, 3)), np.zeros((3, 3))), "leading axes that broadcast"),
        (lambda: haptics.manipulator_jacobian((0, 0, 1), (0, 0, 1)), "axes has shape (3,); expected (..., n, 3)"),
        (lambda: haptics.manipulator_jacobian([(0, 0, 2)], [(0, 0, 1)]), "axes has one of length 2; expected unit"),
        (lambda: haptics.manipulator_jacobian(np.eye(3), np.ones((4, 3))), "arms has 4 rows; expected 3 at most"),
        (lambda: haptics.joint_torques(np.ones((5, 7)), np.ones(6)), "jacobian has shape (5, 7); expected (..., 6, n)"),
        (lambda: haptics.joint_torques(np.ones(6), np.ones(6)), "jacobian has shape (6,); expected (..., 6, n)"),
        (lambda: haptics.joint_torques(np.ones((6, 7)), np.full(6, np.inf)), "wrench[0] is inf"),
    ],
)
def test_bad_input(call, message):
    with pytest.raises(InputError, match=re.escape(message)):
        call()
