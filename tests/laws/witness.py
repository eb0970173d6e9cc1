"""Extremal pairs in plain numpy, many at a time: what the kernels are compared with.

Surfaces are evaluated from the Cox-de Boor recurrence, the pair is the root of

    (g - f).f_u = (g - f).f_v = (f_u x f_v).g_u = (f_u x f_v).g_v = 0,

and every derivative is a complex step of these equations, exact but for rounding. Nothing here knows of shape
operators, tangent frames or contact rates. Rows are pairs; a pose is [x y z qw qx qy qz].
"""

from __future__ import annotations

import numpy as np

STEP = 1e-30
# Central differences from the values at -3h, ... 3h: error h^6/140 times the seventh derivative.
OFFSETS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
SLOPE = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0


class Stack:
    """Rational surfaces of one degree, a row each, with the side of the outward normal."""

    def __init__(self, surfaces, signs=None):
        self.degree = surfaces[0].degree
        assert all(s.degree == self.degree for s in surfaces)
        self.sign = np.ones(len(surfaces)) if signs is None else np.asarray(signs, float)
        nets = [np.concatenate([s.control_points * s.weights[..., None], s.weights[..., None]], 2) for s in surfaces]
        size = [max(n.shape[k] for n in nets) for k in range(2)]
        self.net = np.stack([np.pad(n, ((0, size[0] - n.shape[0]), (0, size[1] - n.shape[1]), (0, 0))) for n in nets])
        self.counts = [np.array([n.shape[k] for n in nets]) for k in range(2)]
        self.knots = []
        for k in range(2):
            longest = max(s.knots[k].size for s in surfaces)
            self.knots.append(np.stack([np.pad(s.knots[k], (0, longest - s.knots[k].size), "edge") for s in surfaces]))

    def take(self, rows):
        other = object.__new__(Stack)
        other.degree = self.degree
        other.sign, other.net = self.sign[rows], self.net[rows]
        other.counts = [c[rows] for c in self.counts]
        other.knots = [k[rows] for k in self.knots]
        return other

    def _basis(self, k, t):
        """First index and the functions that do not vanish at t, with their derivatives, (rows, degree + 1) each."""
        p, knots, rows = self.degree[k], self.knots[k], np.arange(t.size)
        span = (knots <= t.real[:, None]).sum(axis=1) - 1
        span = np.clip(span, p, self.counts[k] - 1)
        # The end of the domain belongs to the last span that is not empty.
        while (empty := knots[rows, span] == knots[rows, span + 1]).any():
            span = span - empty
        window = knots[rows[:, None], span[:, None] + np.arange(1 - p, p + 1)]  # (rows, 2 p)
        n = np.ones((t.size, 1), t.dtype)
        for d in range(1, p + 1):
            low = window[:, p - d : p]
            width = window[:, p : p + d] - low
            right = n * (t[:, None] - low) / width
            left = n * (window[:, p : p + d] - t[:, None]) / width
            slope = d * n / width
            pad = np.zeros((t.size, 1), n.dtype)
            n = np.concatenate([left, pad], 1) + np.concatenate([pad, right], 1)
        dn = np.concatenate([-slope, pad], 1) + np.concatenate([pad, slope], 1)
        return span - p, n, dn

    def evaluate(self, u, v):
        """S, Su, Sv in body axes, (rows, 3) each."""
        i, a, da = self._basis(0, u)
        j, b, db = self._basis(1, v)
        rows = np.arange(u.size)[:, None, None]
        p, q = self.degree
        net = self.net[rows, (i[:, None] + np.arange(p + 1))[:, :, None], (j[:, None] + np.arange(q + 1))[:, None, :]]
        along, slope = (b[:, None, None, :] @ net)[:, :, 0], (db[:, None, None, :] @ net)[:, :, 0]
        h = (a[:, None, :] @ along)[:, 0]
        hu = (da[:, None, :] @ along)[:, 0]
        hv = (a[:, None, :] @ slope)[:, 0]
        s = h[:, :3] / h[:, 3:]
        return s, (hu[:, :3] - hu[:, 3:] * s) / h[:, 3:], (hv[:, :3] - hv[:, 3:] * s) / h[:, 3:]


def rotated(q, x):
    """Vectors (rows, 3) turned by the normalized quaternions of poses (rows, 7): e x e^-1, e of any length."""
    w, e = q[:, 3:4], q[:, 4:7]
    square = w * w + (e * e).sum(1, keepdims=True)
    c = np.cross(e, x)
    return x + 2.0 * (w * c + np.cross(e, c)) / square


class Pairs:
    """Rows of pairs: stacks of surfaces f and g."""

    def __init__(self, f, g):
        self.f, self.g = f, g

    def take(self, rows):
        return Pairs(self.f.take(rows), self.g.take(rows))

    def frames(self, x, q):
        """f, f_u, f_v, g, g_u, g_v in world axes."""
        out = []
        for k, side in enumerate((self.f, self.g)):
            s, su, sv = side.evaluate(x[:, 2 * k], x[:, 2 * k + 1])
            pose = q[:, 7 * k : 7 * k + 7]
            out += [rotated(pose, s) + pose[:, :3], rotated(pose, su), rotated(pose, sv)]
        return out

    def residual(self, x, q):
        f, fu, fv, g, gu, gv = self.frames(x, q)
        n = np.cross(fu, fv)
        return np.stack([((g - f) * fu).sum(1), ((g - f) * fv).sum(1), (n * gu).sum(1), (n * gv).sum(1)], 1)

    def gap(self, x, q):
        f, fu, fv, g, _, _ = self.frames(x, q)
        n = self.f.sign[:, None] * np.cross(fu, fv)
        return (n * (g - f)).sum(1) / np.sqrt((n * n).sum(1))

    def residual_in_x(self, x, q):
        """(rows, 4, 4), by complex steps."""
        steps = 1j * STEP * np.eye(4)
        return np.stack([self.residual(x + step, q.astype(complex)).imag / STEP for step in steps], 2)

    def solve(self, x, q, iterations=8):
        """Newton's method from x; the last steps are at rounding."""
        for _ in range(iterations):
            x = x - np.linalg.solve(self.residual_in_x(x, q), self.residual(x, q)[..., None])[..., 0]
        return x

    def rates(self, x, q, direction):
        """dx/dt where q moves by `direction`: implicit differentiation of the residual."""
        in_q = self.residual(x.astype(complex), q + 1j * STEP * direction).imag / STEP
        return -np.linalg.solve(self.residual_in_x(x, q), in_q[..., None])[..., 0]

    def jacobian(self, x, q):
        """dx/dq, (rows, 4, 14)."""
        in_q = [self.residual(x.astype(complex), q + 1j * STEP * e).imag / STEP for e in np.eye(14)]
        return -np.linalg.solve(self.residual_in_x(x, q), np.stack(in_q, 2))

    def gap_rate(self, x, q, direction):
        """The gap's derivative along `direction`, x following."""
        dx = self.rates(x, q, direction)
        return self.gap(x + 1j * STEP * dx, q + 1j * STEP * direction).imag / STEP


def product(a, b):
    """Quaternion products, (rows, 4)."""
    w = a[:, :1] * b[:, :1] - (a[:, 1:] * b[:, 1:]).sum(1, keepdims=True)
    return np.concatenate([w, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])], 1)


def moved(q, twist, t):
    """Poses (rows, 14) along x + t dx, exp(t dw) e for twists (rows, 12), and the velocity of these poses at t."""
    out, rate = q.copy(), np.zeros_like(q)
    for k in range(2):
        dx, dw = twist[:, 6 * k : 6 * k + 3], twist[:, 6 * k + 3 : 6 * k + 6]
        angle = np.sqrt((dw * dw).sum(1, keepdims=True))
        turn = np.concatenate([np.cos(0.5 * t * angle), dw * (0.5 * t) * np.sinc(0.5 * t * angle / np.pi)], 1)
        e = product(turn, q[:, 7 * k + 3 : 7 * k + 7])
        out[:, 7 * k : 7 * k + 3] += t * dx
        out[:, 7 * k + 3 : 7 * k + 7] = e
        rate[:, 7 * k : 7 * k + 3] = dx
        rate[:, 7 * k + 3 : 7 * k + 7] = 0.5 * product(np.pad(dw, ((0, 0), (1, 0))), e)
    return out, rate
