"""A second opinion on pairs of a surface and a curve: residual and gap in numpy, differentiated by complex steps.

As `witness.py`: only points and first derivatives are evaluated, from the textbook basis, and nothing of shape
operators, curvatures or tangent frames. `errata_jacobian` is the matrix of paper 001, eq. 22, in corrected form.
"""

from __future__ import annotations

import numpy as np

from tests.laws.witness import STEP, rotated


class CurveStack:
    """Rational curves of one degree and one number of control points, a row each."""

    def __init__(self, curves):
        self.degree = curves[0].degree
        self.knots = np.stack([c.knots for c in curves])
        self.net = np.stack(
            [np.concatenate([c.control_points * c.weights[:, None], c.weights[:, None]], 1) for c in curves]
        )

    def take(self, rows):
        other = object.__new__(CurveStack)
        other.degree, other.knots, other.net = self.degree, self.knots[rows], self.net[rows]
        return other

    def evaluate(self, t):
        """C and C_t, (rows, d) each, by de Boor's algorithm on the points and on their differences."""
        p, rows = self.degree, np.arange(t.size)
        span = np.clip((self.knots <= t.real[:, None]).sum(1) - 1, p, self.net.shape[1] - 1)
        points = self.net[rows[:, None], span[:, None] + np.arange(-p, 1)].astype(t.dtype)
        slopes = None
        for level in range(1, p + 1):
            index = span[:, None] + np.arange(level - p, 1)
            low, high = self.knots[rows[:, None], index], self.knots[rows[:, None], index + p + 1 - level]
            part = ((t[:, None] - low) / (high - low))[..., None]
            if level == p:
                slopes = p * (points[:, 1] - points[:, 0]) / (high - low)
            points = (1.0 - part) * points[:, :-1] + part * points[:, 1:]
        h, d = points[:, 0], slopes
        c = h[:, :-1] / h[:, -1:]
        return c, (d[:, :-1] - d[:, -1:] * c) / h[:, -1:]


class SurfaceCurve:
    """Rows of a surface (on body f) and a curve in space or on a carrier (on body g)."""

    def __init__(self, surfaces, curves, carriers=None):
        self.surfaces, self.curves, self.carriers = surfaces, curves, carriers

    def take(self, rows):
        carriers = None if self.carriers is None else self.carriers.take(rows)
        return SurfaceCurve(self.surfaces.take(rows), self.curves.take(rows), carriers)

    def curve(self, t):
        """C, C_t in body axes."""
        c, d = self.curves.evaluate(t)
        if self.carriers is None:
            return c, d
        s, su, sv = self.carriers.evaluate(c[:, 0], c[:, 1])
        return s, su * d[:, :1] + sv * d[:, 1:]

    def frames(self, x, q):
        """S, S_u, S_v, C, C_t in world axes."""
        s, su, sv = self.surfaces.evaluate(x[:, 0], x[:, 1])
        c, d = self.curve(x[:, 2])
        f, g = q[:, :7], q[:, 7:]
        return rotated(f, s) + f[:, :3], rotated(f, su), rotated(f, sv), rotated(g, c) + g[:, :3], rotated(g, d)

    def residual(self, x, q):
        s, su, sv, c, d = self.frames(x, q)
        return np.stack([((c - s) * su).sum(1), ((c - s) * sv).sum(1), (np.cross(su, sv) * d).sum(1)], 1)

    def gap(self, x, q):
        s, su, sv, c, _ = self.frames(x, q)
        n = self.surfaces.sign[:, None] * np.cross(su, sv)
        return (n * (c - s)).sum(1) / np.sqrt((n * n).sum(1))

    def residual_in_x(self, x, q):
        """(rows, 3, 3), by complex steps."""
        return np.stack(
            [self.residual(x + 1j * STEP * e, q.astype(complex)).imag / STEP for e in np.eye(3)],
            2,
        )

    def solve(self, x, q, iterations):
        """Newton's method from x; the last steps are at rounding."""
        for _ in range(iterations):
            x = x - np.linalg.solve(self.residual_in_x(x, q), self.residual(x, q)[..., None])[..., 0]
        return x

    def jacobian(self, x, q):
        """dx/dq, (rows, 3, 14): implicit differentiation of the residual."""
        in_q = [self.residual(x.astype(complex), q + 1j * STEP * e).imag / STEP for e in np.eye(14)]
        return -np.linalg.solve(self.residual_in_x(x, q), np.stack(in_q, 2))

    def gap_rate(self, x, q, direction):
        """The gap's derivative along `direction`, x following."""
        in_q = self.residual(x.astype(complex), q + 1j * STEP * direction).imag / STEP
        dx = -np.linalg.solve(self.residual_in_x(x, q), in_q[..., None])[..., 0]
        return self.gap(x + 1j * STEP * dx, q + 1j * STEP * direction).imag / STEP

    def speeds(self, x, q):
        """|S_u|, |S_v|, |C_t|, (rows, 3)."""
        _s, su, sv, _c, d = self.frames(x, q)
        return np.stack([np.linalg.norm(a, axis=1) for a in (su, sv, d)], 1)


def errata_jacobian(surface, q_s, curve_jet, q_c, x):
    """d(u, v, t)/dq by the matrix of eq. 22: metric and Gauss map of the surface in its frame, the curve's in its own.

    `surface` is a NurbsSurface, `curve_jet` the curve's point and two derivatives in its body's axes.
    """

    def turn(q):
        return np.stack([rotated(q[None], e[None])[0] for e in np.eye(3)], 1)

    def spin(q):
        """omega = spin e', world axes (eq. 17), for quaternions of any length."""
        w, x, y, z = q[3:]
        return 2.0 / (q[3:] @ q[3:]) * np.array([[-x, w, -z, y], [-y, z, w, -x], [-z, -y, x, w]])

    def skew(a):
        return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])

    rs, rc = turn(q_s), turn(q_c)
    s, su, sv, suu, suv, svv = (rs @ a for a in surface.evaluate(x[0], x[1], 2))
    c, ct, ctt = (rc @ a for a in curve_jet)
    s, c = s + q_s[:3], c + q_c[:3]
    m = np.cross(su, sv)
    z = m / np.linalg.norm(m)
    xs = su / np.linalg.norm(su)
    ps = np.stack([xs, np.cross(z, xs)])
    change = [np.cross(suu, sv) + np.cross(su, suv), np.cross(suv, sv) + np.cross(su, svv)]
    e = ps @ np.stack([su, sv], 1)
    f = ps @ np.stack(change, 1) / np.linalg.norm(m)
    beta = z @ (c - s)
    xc = ct / np.linalg.norm(ct)
    frame = np.stack([xc, np.cross(-z, xc), -z])
    theta = frame[:2] @ ps.T
    speed = np.linalg.norm(ct)
    matrix = np.zeros((3, 3))
    matrix[:2, :2] = theta @ (e + beta * f)
    matrix[0, 2] = -speed
    matrix[2, :2] = -(theta @ f)[0]
    matrix[2, 2] = -z @ ctt / speed
    eye, zero = np.eye(3), np.zeros((3, 3))
    v = frame @ np.hstack([-eye, skew(c - q_s[:3]) @ spin(q_s), eye, -skew(c - q_c[:3]) @ spin(q_c)])
    omega = frame @ np.hstack([zero, -spin(q_s), zero, spin(q_c)])
    return np.linalg.solve(matrix, np.stack([v[0], v[1], omega[1]]))
