"""Where a round wire is nearest to an ellipsoid: every local minimum, for wires whose center line stays outside.

The nearest point of an ellipsoid from x outside of it is y_i = a_i^2 x_i / (a_i^2 + m), with m > 0 the one root of
sum (a_i x_i / (a_i^2 + m))^2 = 1, which Newton's method finds. Along the center line
c(s) of a wire the distance d(s) has the slope n.c'; its minima are the sign changes of that over dense samples.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def nearest(semi_axes, x):
    """Nearest points of an ellipsoid about the origin from points (n, 3) outside of it."""
    square, m = np.square(semi_axes), np.zeros(len(x))
    for _ in range(60):
        part = square * x**2 / (square + m[:, None]) ** 2
        total = part.sum(axis=1)
        # Of 1 / sqrt(total) - 1, which is nearly linear in m.
        step = total * (np.sqrt(total) - 1.0) / (part / (square + m[:, None])).sum(axis=1)
        m = np.maximum(m + step, 0.0)
        if (np.abs(step) <= 1e-15 * (square.max() + m)).all():
            break
    return square * x / (square + m[:, None])


def minima(wire, q_wire, semi_axes, q_ellipsoid, samples=1000):
    """Gaps and surface points (n, 2, 3), first on the wire; a wire's ends included. Raises where it dips in."""
    turn = Rotation.from_quat([q_wire[3:], q_ellipsoid[3:]], scalar_first=True).as_matrix()

    def seen(piece, s):
        """Center line in the ellipsoid's axes, its tangent, and the foot."""
        (e, f, _), bend = wire.axes[piece], wire.bend[piece]
        c, i = (np.cos(s / bend)[:, None], np.sin(s / bend)[:, None]) if bend else (None, None)
        local = wire.start[piece] + (bend * (c * e + i * f) if bend else s[:, None] * e)
        tangent = c * f - i * e if bend else np.broadcast_to(e, local.shape)
        x = (local @ turn[0].T + q_wire[:3] - q_ellipsoid[:3]) @ turn[1]
        return x, tangent @ turn[0].T @ turn[1], nearest(semi_axes, x)

    def slope(piece, s):
        x, tangent, foot = seen(piece, s)
        if (np.square(x / semi_axes).sum(axis=1) <= 1.0).any():
            raise ValueError("the center line enters the ellipsoid")
        return ((x - foot) * tangent).sum(axis=1)

    centers, feet = [], []
    for piece in range(wire.bend.size):
        s = np.linspace(0.0, wire.length[piece], samples)
        values = slope(piece, s)
        at = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
        low, high = s[at], s[at + 1]
        for _ in range(60 if at.size else 0):
            middle = 0.5 * (low + high)
            rising = slope(piece, middle) >= 0.0
            low, high = np.where(rising, low, middle), np.where(rising, middle, high)
        x, _, foot = seen(piece, 0.5 * (low + high))
        centers.append(x)
        feet.append(foot)
    ends, out = (value @ turn[0].T for value in wire.ends)
    x = (ends + q_wire[:3] - q_ellipsoid[:3]) @ turn[1]
    foot = nearest(semi_axes, x)
    behind = ((foot - x) * (out @ turn[1])).sum(axis=1) >= 0.0
    x, foot = np.concatenate([*centers, x[behind]]), np.concatenate([*feet, foot[behind]])
    distance = np.linalg.norm(x - foot, axis=1)
    surface = x + wire.radius * (foot - x) / distance[:, None]
    return distance - wire.radius, np.stack([surface, foot], axis=1) @ turn[1].T + q_ellipsoid[:3]
