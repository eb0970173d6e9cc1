"""B-splines straight from the Cox-de Boor recurrence, in any arithmetic: what the tests compare with.

With `HyperDual` numbers the recurrence gives derivatives that are exact but for rounding, with fractions it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np


@dataclass(frozen=True)
class HyperDual:
    """f + f1 e1 + f2 e2 + f12 e1 e2 with e1^2 = e2^2 = 0."""

    f: Any
    f1: Any = 0
    f2: Any = 0
    f12: Any = 0

    @staticmethod
    def of(x):
        return x if isinstance(x, HyperDual) else HyperDual(x)

    def __add__(self, other):
        o = HyperDual.of(other)
        return HyperDual(self.f + o.f, self.f1 + o.f1, self.f2 + o.f2, self.f12 + o.f12)

    __radd__ = __add__

    def __neg__(self):
        return HyperDual(-self.f, -self.f1, -self.f2, -self.f12)

    def __sub__(self, other):
        return self + (-HyperDual.of(other))

    def __rsub__(self, other):
        return HyperDual.of(other) + (-self)

    def __mul__(self, other):
        o = HyperDual.of(other)
        return HyperDual(
            self.f * o.f,
            self.f1 * o.f + self.f * o.f1,
            self.f2 * o.f + self.f * o.f2,
            self.f12 * o.f + self.f1 * o.f2 + self.f2 * o.f1 + self.f * o.f12,
        )

    __rmul__ = __mul__

    def __truediv__(self, other):
        o = HyperDual.of(other)
        i = 1 / o.f
        return self * HyperDual(i, -o.f1 * i * i, -o.f2 * i * i, (2 * o.f1 * o.f2 * i - o.f12) * i * i)


def _value(t):
    return t.f if isinstance(t, HyperDual) else t


def basis(knots, degree, t):
    """All basis functions at t; the last span of the domain holds its end."""
    count = len(knots) - degree - 1
    x = _value(t)
    inside = [j for j in range(degree, count) if knots[j] <= x < knots[j + 1]]
    if not inside:
        assert x == knots[count]
        inside = [max(j for j in range(degree, count) if knots[j] < knots[j + 1])]
    row = [1 if j == inside[0] else 0 for j in range(len(knots) - 1)]
    for p in range(1, degree + 1):
        new = []
        for i in range(len(row) - 1):
            left = (t - knots[i]) * row[i] / (knots[i + p] - knots[i]) if knots[i + p] > knots[i] else 0
            right = knots[i + p + 1] - knots[i + 1]
            new.append(left + ((knots[i + p + 1] - t) * row[i + 1] / right if right > 0 else 0))
        row = new
    return row


def curve_point(points, knots, degree, weights, t):
    """C(t) as a list, in the arithmetic of t."""
    n = basis(knots, degree, t)
    w = sum(a * b for a, b in zip(n, weights, strict=True))
    return [sum(a * b * p[k] for a, b, p in zip(n, weights, points, strict=True)) / w for k in range(len(points[0]))]


def surface_point(points, knots, degree, weights, u, v):
    """S(u, v) as a list, in the arithmetic of u and v."""
    n, m = basis(knots[0], degree[0], u), basis(knots[1], degree[1], v)
    total = [0, 0, 0, 0]
    for i, a in enumerate(n):
        for j, b in enumerate(m):
            w = a * b * weights[i][j]
            total = [total[k] + w * points[i][j][k] for k in range(3)] + [total[3] + w]
    return [x / total[3] for x in total[:3]]


def _parts(values, part):
    return np.array([float(getattr(HyperDual.of(x), part)) for x in values])


def curve_derivatives(curve, t):
    """C, Ct, Ctt of a NurbsCurve by hyper-dual numbers."""
    x = curve_point(
        curve.control_points.tolist(),
        curve.knots.tolist(),
        curve.degree,
        curve.weights.tolist(),
        HyperDual(float(t), 1.0, 1.0),
    )
    return [_parts(x, "f"), _parts(x, "f1"), _parts(x, "f12")]


def surface_derivatives(surface, u, v):
    """S, Su, Sv, Suu, Suv, Svv of a NurbsSurface by hyper-dual numbers."""
    data = (
        surface.control_points.tolist(),
        [k.tolist() for k in surface.knots],
        surface.degree,
        surface.weights.tolist(),
    )
    u, v = float(u), float(v)
    mixed = surface_point(*data, HyperDual(u, 1.0), HyperDual(v, 0.0, 1.0))
    twice_u = surface_point(*data, HyperDual(u, 1.0, 1.0), v)
    twice_v = surface_point(*data, u, HyperDual(v, 1.0, 1.0))
    return [
        _parts(mixed, "f"),
        _parts(mixed, "f1"),
        _parts(mixed, "f2"),
        _parts(twice_u, "f12"),
        _parts(mixed, "f12"),
        _parts(twice_v, "f12"),
    ]


def fractions(values):
    """Nested lists of doubles as exact fractions."""
    return [fractions(x) for x in values] if isinstance(values, list) else Fraction(values)


def knot_vector(rng, degree, count, kind):
    """Random knots of a kind: clamped, multiple (clamped, interior multiplicities up to the degree), unclamped."""
    if kind == "unclamped":
        return np.cumsum(rng.uniform(0.3, 1.0, count + degree + 1)) - 2.0
    interior = count - degree - 1
    if kind == "clamped":
        inner = np.sort(rng.uniform(0.05, 0.95, interior))
    else:
        inner = np.repeat(np.linspace(0.2, 0.8, -(-interior // degree)), degree)[:interior]
    return 3.0 * np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)]) - 1.0


KINDS = ("clamped", "multiple", "unclamped")
