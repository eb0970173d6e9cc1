"""Andrews' squeezer, a planar mechanism of seven bodies and three loops, at its published poses.

Data, start and end from Hairer and Wanner, Solving Ordinary Differential Equations II, section VI.9, and from the
problem "Andrews' squeezing mechanism" of the Test Set for Initial Value Problem Solvers (Bari): the start to 30 digits,
and after 0.03 s, in which the motor turned two and a half times, a reference computed with a tolerance of 1e-14.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest

import assembly as asm
from tests.validation.mechanisms import CLOSE, Counter, angles, assert_came_back, degrees, drive, planar, shake

# Lengths of the bars and places of the pivots [m].
D, E, RR, SS, U, ZF, ZT = 0.028, 0.02, 0.007, 0.035, 0.04, 0.02, 0.04
A, B = (-0.06934, -0.00227), (-0.03635, 0.03273)
SIZE = ZT
# beta, Theta, gamma, Phi, delta, Omega, epsilon
START = np.array(
    [
        -0.0617138900142764496358948458001,
        0.0,
        0.455279819163070380255912382449,
        0.222668390165885884674473185609,
        0.487364979543842550225598953530,
        -0.222668390165885884674473185609,
        1.23054744454982119249735015568,
    ]
)
END = np.array(
    [
        15.81077119629904,
        -15.75637105984298,
        0.04082224013073101,
        -0.5347301163226948,
        0.5244099658805304,
        0.5347301163226948,
        1.048080741042263,
    ]
)


def closure(q):
    """The six equations of the three loops, and their Jacobian (6, 7)."""
    beta, theta, gamma, phi, delta, omega, epsilon = q
    bt, pd, oe = beta + theta, phi + delta, omega + epsilon
    tip = np.array([RR * cos(beta) - D * cos(bt), RR * sin(beta) - D * sin(bt)])
    ends = [
        (B[0] + SS * sin(gamma), B[1] - SS * cos(gamma)),
        (A[0] + E * sin(pd) + ZT * cos(delta), A[1] - E * cos(pd) + ZT * sin(delta)),
        (A[0] + ZF * cos(oe) + U * sin(epsilon), A[1] + ZF * sin(oe) - U * cos(epsilon)),
    ]
    jacobian = np.zeros((6, 7))
    for row in (0, 2, 4):
        jacobian[row : row + 2, 0] = -RR * sin(beta) + D * sin(bt), RR * cos(beta) - D * cos(bt)
        jacobian[row : row + 2, 1] = D * sin(bt), -D * cos(bt)
    jacobian[:2, 2] = -SS * cos(gamma), -SS * sin(gamma)
    jacobian[2:4, 3] = -E * cos(pd), -E * sin(pd)
    jacobian[2:4, 4] = -E * cos(pd) + ZT * sin(delta), -E * sin(pd) - ZT * cos(delta)
    jacobian[4:, 5] = ZF * sin(oe), -ZF * cos(oe)
    jacobian[4:, 6] = ZF * sin(oe) - U * cos(epsilon), -ZF * cos(oe) - U * sin(epsilon)
    return np.concatenate([tip - end for end in ends]), jacobian


def newton(q, given):
    """The angles that close the loops for the one that is given, from angles nearby."""
    q, free = q.copy(), [k for k in range(7) if k != given]
    for _ in range(8):
        residual, jacobian = closure(q)
        q[free] -= np.linalg.solve(jacobian[:, free], residual)
    return q


class Squeezer:
    """Bodies K1 to K7 as in the book; every hinge's angle is one of the seven, or one that follows from them."""

    def __init__(self, q=START, counted=False):
        beta, theta, gamma, phi, delta, omega, epsilon = q
        ground = planar("ground", fixed=True)
        tip = RR * np.array([cos(beta), sin(beta)])
        h = np.array(A) + ZT * np.array([cos(delta), sin(delta)])
        g = np.array(A) + U * np.array([sin(epsilon), -cos(epsilon)])
        k1, k2 = planar("K1", angle=beta), planar("K2", tip, beta + theta)
        k3, k5, k7 = planar("K3", B, gamma), planar("K5", A, delta), planar("K7", A, epsilon)
        k4, k6 = planar("K4", h, phi + delta), planar("K6", g, omega + epsilon)
        bodies = [ground, k1, k2, k3, k4, k5, k6, k7]
        shake(bodies, 0.02 * SIZE)

        def hinge(name, a, at_a, b, at_b=(0.0, 0.0)):
            return asm.Revolute(a.frame((*at_a, 0.0)), b.frame((*at_b, 0.0)), name)

        self.motor = hinge("beta", ground, (0.0, 0.0), k1)
        self.hinges = [
            self.motor,
            hinge("Theta", k1, (RR, 0.0), k2),
            hinge("gamma", ground, B, k3),
            hinge("Phi", k5, (ZT, 0.0), k4),
            hinge("delta", ground, A, k5),
            hinge("Omega", k7, (0.0, -U), k6),
            hinge("epsilon", ground, A, k7),
        ]
        point = (k2, (-D, 0.0))  # where K2, K3, K4 and K6 meet
        loops = [
            hinge(f"{name} loop", *point, body, at)
            for name, body, at in (("K3", k3, (0.0, -SS)), ("K4", k4, (0.0, -E)), ("K6", k6, (ZF, 0.0)))
        ]
        self.counters = [Counter(ground, joint, SIZE) for joint in self.hinges[1:]] if counted else []
        self.scene = asm.Assembly([*bodies, *(counter.rack for counter in self.counters)])
        self.scene.constrain(*self.hinges, *loops)
        self.scene.constrain(*(row for counter in self.counters for row in counter.constraints))

    def angles(self, solutions):
        return np.column_stack([angles(solutions, joint) for joint in self.hinges])


def test_the_published_angles_close_the_loops():
    # Printed to 30 and to 16 digits: as good as doubles are; END's, of an integration to 1e-14, nearly.
    for q, error in ((START, 1e-16), (END, 1e-15)):
        assert np.abs(closure(q)[0]).max() < error
        assert np.abs(newton(q, 0) - q).max() < 20 * error


@pytest.mark.parametrize("given", [1, 0])
def test_start(given):
    # Said by Theta = 0, as it is published, or by beta; the other angles are at their extremes there.
    made = Squeezer()
    (solution,) = drive(made.scene, made.hinges[given].freedom(), [START[given]])
    assert np.abs(made.angles([solution])[0] - START).max() < CLOSE


def test_motion_from_start_to_end():
    """Two and a half turns of the motor: the published end, and Newton's method in between."""
    made = Squeezer(counted=True)
    values = np.linspace(START[0], END[0], 150)
    solutions = drive(made.scene, made.motor.freedom(), values)
    expected = [START]
    for value in values[1:]:
        turned = value - expected[-1][0]
        expected.append(newton(expected[-1] + turned * np.array([1.0, -1.0, 0, 0, 0, 0, 0]), 0))
        expected[-1][0] = value
        expected[-1] = newton(expected[-1], 0)
    expected = np.array(expected)
    found = made.angles(solutions)
    # The inverse of the closure's Jacobian, lengths over SIZE, has the norm 3 at most on this way.
    assert np.abs(found - expected).max() < CLOSE
    assert np.abs(found[-1] - END).max() < CLOSE
    counted = np.column_stack([counter.read(solutions) for counter in made.counters])
    assert np.abs(counted - expected[:, 1:]).max() < CLOSE


def test_two_turns_and_back():
    made = Squeezer()
    values = degrees(turns=2, start=START[0])
    solutions = drive(made.scene, made.motor.freedom(), values)
    assert_came_back(solutions[0], solutions[-1], SIZE)
    solutions = drive(made.scene, made.motor.freedom(), values[::-1], solutions[-1])
    assert_came_back(solutions[0], solutions[-1], SIZE)
    assert np.abs(made.angles(solutions[-1:])[0] - START).max() < CLOSE
