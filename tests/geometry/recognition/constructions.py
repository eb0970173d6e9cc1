"""Elementary surfaces built here, and the same surfaces written in other ways."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from assembly import NurbsSurface
from assembly.geometry.splines import bezier

Z = np.array([0.0, 0.0, 1.0])


def arc(angle, spans):
    """Homogeneous points (2 spans + 1, 3), (w cos, w sin, w), of an arc of the unit circle from angle 0, and knots."""
    at = np.linspace(0.0, angle, spans + 1)
    half = 0.5 * angle / spans
    net = np.empty((2 * spans + 1, 3))
    net[::2] = np.column_stack([np.cos(at), np.sin(at), np.ones(spans + 1)])
    middle = 0.5 * (at[:-1] + at[1:])
    net[1::2] = np.column_stack([np.cos(middle), np.sin(middle), np.full(spans, np.cos(half))])
    return net, bezier.full_knots(at, 2)


def revolved(profile, knots, degree, angle, spans):
    """A homogeneous profile (n, 3), (w rho, w z, w), turned about the z axis from the x axis on; u goes around."""
    ring, around = arc(angle, spans)
    net = np.empty((len(ring), len(profile), 4))
    net[..., :2] = ring[:, None, :2] * profile[None, :, :1]
    net[..., 2:] = ring[:, None, 2:] * profile[None, :, 1:]
    return NurbsSurface(net[..., :3] / net[..., 3:], (around, knots), (2, degree), net[..., 3])


def line(*ends):
    """A straight profile through two points (rho, z), and its knots and degree."""
    return np.column_stack([np.array(ends, dtype=float), np.ones(2)]), np.array([0.0, 0.0, 1.0, 1.0]), 1


def circle_profile(center, radius, start, angle, spans):
    """An arc as a profile, from an angle with the rho axis on, and its knots and degree."""
    net, knots = arc(angle, spans)
    c, s = np.cos(start), np.sin(start)
    turned = net[:, :2] @ np.array([[c, s], [-s, c]])
    return np.column_stack([radius * turned + net[:, 2:] * np.asarray(center), net[:, 2]]), knots, 2


def reparameterized(surface, direction, factor):
    """The same surface with a Moebius map of the parameter in every span: Bezier point k, times factor^k."""
    pieces = np.moveaxis(surface.bezier_pieces(), (direction, 2 + direction), (0, 1)).copy()
    degree = surface.degree[direction]
    powers = factor ** (np.arange(len(pieces))[:, None] * degree + np.arange(degree + 1))
    pieces *= powers.reshape(*powers.shape, 1, 1, 1)
    rows = bezier.joined(pieces)  # (n, spans, q + 1, 4)
    net = bezier.joined(np.moveaxis(rows, 0, 2)).swapaxes(0, 1)  # (n, m, 4)
    other = 1 - direction
    at = surface.breaks()
    knots = [bezier.full_knots(at[direction], degree), bezier.full_knots(at[other], surface.degree[other])]
    degrees = [degree, surface.degree[other]]
    if direction == 1:
        net, knots, degrees = net.swapaxes(0, 1), knots[::-1], degrees[::-1]
    return NurbsSurface(net[..., :3] / net[..., 3:], knots, degrees, net[..., 3])


def rewritten(surface, rng):
    """The same points and sides in higher degrees, with more knots, other speeds, u and v exchanged."""
    if rng.random() < 0.5:
        surface = surface.elevate([d + int(rng.integers(3)) for d in surface.degree])
    for direction in (0, 1):
        if rng.random() < 0.5:
            at = surface.breaks()[direction]
            surface = surface.insert_knot(direction, float(rng.uniform(at[0], at[1])), int(rng.integers(1, 2)))
        if rng.random() < 0.5:
            surface = reparameterized(surface, direction, float(rng.uniform(0.7, 1.4)))
    if rng.random() < 0.5:
        # Twice the other side: the outward side stays.
        surface = surface.transposed().reversed(int(rng.integers(2)))
    return surface


class Placement:
    """A random similarity: turned, scaled, and moved by about so many sizes."""

    def __init__(self, rng, size, far):
        self.rotation = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
        self.scale = 10.0 ** rng.uniform(-3.0, 3.0)
        self.translation = far * size * self.scale * rng.standard_normal(3)

    def surface(self, surface):
        return surface.transformed(self.rotation, self.translation, self.scale)

    def point(self, x):
        return self.scale * self.rotation @ np.asarray(x, dtype=float) + self.translation

    def direction(self, x):
        return self.rotation @ np.asarray(x, dtype=float)


def samples(surface, count=41):
    """Points (n, 3) all over a surface, its edges among them."""
    u, v = (np.linspace(*ends, count) for ends in surface.domain)
    return surface.evaluate(u[:, None], v[None, :]).reshape(-1, 3)


def distances(form, points):
    """Of points from what a form is."""
    name = type(form).__name__
    if name == "Plane":
        return np.abs((points - form.point) @ form.normal)
    if name == "Sphere":
        return np.abs(np.linalg.norm(points - form.center, axis=1) - form.radius)
    origin = {"Cylinder": "point", "Cone": "apex", "Torus": "center"}[name]
    off = points - getattr(form, origin)
    z = off @ form.axis
    rho = np.linalg.norm(off - z[:, None] * form.axis, axis=1)
    if name == "Cylinder":
        return np.abs(rho - form.radius)
    if name == "Torus":
        return np.abs(np.hypot(rho - form.major, z) - form.minor)
    return np.abs(rho * np.cos(form.half_angle) - z * np.sin(form.half_angle))
