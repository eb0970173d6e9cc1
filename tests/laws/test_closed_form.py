"""Rates of contact on tori and balls from their principal curvatures: the closed form for orthogonal parameters.

Paper 001, eq. 9, for surfaces at a distance: with lengths a = E_f u_f', b = E_g u_g' (E diagonal),
K the curvature of a shape along u and v (positive where convex), R the reflection or rotation from the axes
of f to those of g and s = -1 or 1 for opposed or equal normals,

    R (I + gap K_f) a - b = v_xy,    s R K_f a - K_g b = (w_y, -w_x),

v and w the velocity of g relative to f at the point of g, in the axes of g.
"""

from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.proximity import contact_jacobian
from tests.laws.scenes import placed, random_quaternion
from tests.laws.witness import moved, rotated


class Torus:
    """Principal curvatures and speeds from the point alone; a ball is a torus with no hole."""

    def __init__(self, major, minor):
        self.major, self.minor = major, minor
        self.face = Face(shapes.torus(major, minor) if major > 0.0 else shapes.sphere(minor))

    def at(self, u, v, q):
        """Point, axes (rows x, y, z), speeds along u and v, curvatures along u and v."""
        p, su, sv = self.face.surface.evaluate(u, v, 1)
        ring = np.hypot(p[0], p[1])
        cosine = (ring - self.major) / self.minor
        out = np.array([p[0] / ring, p[1] / ring, 0.0]) * cosine + np.array([0.0, 0.0, p[2] / self.minor])
        x = np.array([-p[1], p[0], 0.0]) / ring
        axes = np.stack([rotated(q[None], a[None])[0] for a in (x, np.cross(out, x), out)])
        speeds = np.array([np.linalg.norm(su), np.linalg.norm(sv)])
        return rotated(q[None], p[None])[0] + q[:3], axes, speeds, np.array([cosine / ring, 1.0 / self.minor])


@pytest.mark.parametrize("same_side", [False, True])
def test_contact_rates_of_tori_and_balls(same_side):
    rng = np.random.default_rng(11)
    for _ in range(60):
        f, g = (Torus(rng.uniform(2.0, 4.0) * (rng.random() < 0.7), rng.uniform(0.5, 1.5)) for _ in range(2))
        q_f = np.concatenate([rng.uniform(-2.0, 2.0, 3), random_quaternion(rng)])
        # v = 0 is the equator of a torus, and a pole of a ball.
        x = np.array([rng.uniform(0.1, 0.9) * (hi - lo) for s in (f, g) for lo, hi in s.face.surface.domain])
        gap = rng.uniform(-0.3, 2.0)
        q_g = placed(f.face, x[:2], q_f, g.face, x[2:], gap, rng.uniform(0.0, 6.0), same_side)
        twist = rng.normal(size=(1, 12))
        rate = moved(np.concatenate([q_f, q_g])[None], twist, 0.0)[1][0]
        v_f, w_f, v_g, w_g = twist.reshape(4, 3)

        _, axes_f, speeds_f, k_f = f.at(*x[:2], q_f)
        point, axes_g, speeds_g, k_g = g.at(*x[2:], q_g)
        v = axes_g[:2] @ (v_g + np.cross(w_g, point - q_g[:3]) - v_f - np.cross(w_f, point - q_f[:3]))
        w = axes_g @ (w_g - w_f)
        turn = axes_g[:2] @ axes_f[:2].T
        sign = 1.0 if same_side else -1.0
        matrix = np.block([[turn @ np.diag(1.0 + gap * k_f), -np.eye(2)], [sign * turn @ np.diag(k_f), -np.diag(k_g)]])
        if np.linalg.cond(matrix) > 300.0:
            continue
        expected = np.linalg.solve(matrix, [v[0], v[1], w[1], -w[0]]) / np.concatenate([speeds_f, speeds_g])
        found = contact_jacobian(f.face, q_f, g.face, q_g, x) @ rate
        # Roundings, amplified by the condition of the matrix.
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * (1.0 + np.abs(expected).max()))
