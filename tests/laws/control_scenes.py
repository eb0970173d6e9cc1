"""Patches for the laws of the controllers: convex ones, table I of paper 000, and two that break a hypothesis."""

from __future__ import annotations

import numpy as np

from assembly.geometry.splines.surface import NurbsSurface
from benchmarks.controllers import paraboloid


def random_paraboloid(rng):
    """Normals within 40 degrees of the z axis."""
    a, b = rng.uniform(0.005, 0.05, 2)
    return paraboloid(a, b, rng.uniform(-0.5, 0.5))


def arcs(angle, pieces):
    """A circle's arc from 0 as a rational quadratic: points (n, 2), weights, knots."""
    half = 0.5 * angle / pieces
    turns = half * np.arange(2 * pieces + 1)
    weights = np.where(np.arange(turns.size) % 2, np.cos(half), 1.0)
    points = np.stack([np.cos(turns), np.sin(turns)], axis=1) / weights[:, None]
    inner = np.repeat(np.arange(1, pieces), 2) / pieces
    return points, weights, np.concatenate([[0.0] * 3, inner, [1.0] * 3])


def annular_sector():
    """A flat ring of radii 1 (u = 0) and 2 over 300 degrees of v: convex as a surface, with a re-entrant edge."""
    points, weights, knots = arcs(np.radians(300.0), 4)
    net = np.stack([np.pad(points, ((0, 0), (0, 1))) * radius for radius in (1.0, 2.0)])
    return NurbsSurface(net, ([0, 0, 1, 1], knots), (1, 2), np.stack([weights, weights]))


def thin_ellipsoid():
    """A patch of the ellipsoid of half axes 1, 0.1, 1 about its end on the x axis; normals span 173 degrees in xy."""
    a, b, c = 1.0, 0.1, 1.0
    # Normals (cos p / a, sin p / b): the parameter whose normal is half of that from the x axis.
    wide = 2.0 * np.arctan(np.tan(np.radians(86.5)) * b / a)
    across, weights_u, knots_u = arcs(wide, 2)
    along, weights_v, knots_v = arcs(np.radians(60.0), 2)
    c_, s_ = np.cos(0.5 * wide), np.sin(0.5 * wide)
    across = across @ np.array([[c_, -s_], [s_, c_]])
    along = along @ np.array([[np.sqrt(0.75), -0.5], [0.5, np.sqrt(0.75)]])
    net = np.empty((across.shape[0], along.shape[0], 3))
    net[..., 0] = a * across[:, None, 0] * along[None, :, 0]
    net[..., 1] = b * across[:, None, 1] * along[None, :, 0]
    net[..., 2] = c * along[None, :, 1]
    return NurbsSurface(net, (knots_u, knots_v), (2, 2), weights_u[:, None] * weights_v[None, :])


def above(surface, u, v, height):
    """The point at a height over the surface's point, on the side where z grows in the middle, or where x does."""
    p, su, sv = surface.evaluate(u, v, 1)
    _p, mu, mv = surface.evaluate(*(0.5 * (low + high) for low, high in surface.domain), 1)
    n, middle = np.cross(su, sv), np.cross(mu, mv)
    up = middle[2] if abs(middle[2]) > 1e-9 else middle[0]
    return p + np.sign(up) * height * n / np.linalg.norm(n)


def grid(surface, count):
    """Starts (count^2, 2) over the domain."""
    (a, b), (c, d) = surface.domain
    u, v = np.meshgrid(np.linspace(a, b, count), np.linspace(c, d, count), indexing="ij")
    return np.stack([u.ravel(), v.ravel()], axis=1)
