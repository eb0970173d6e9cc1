"""Random curves of every kind, and their distances without the code under test: dense samples, then Newton's method."""

from __future__ import annotations

from math import comb

import numpy as np
from scipy.spatial.distance import cdist

import assembly as asm

# Kinds of spline curves: degree, spans, whether weights differ.
CURVES = {
    "segment": (1, 1, False),
    "polyline": (1, 6, False),
    "arc": (2, 1, True),
    "cubic": (3, 1, False),
    "rational cubic of five spans": (3, 5, True),
    "quintic": (5, 1, False),
    "degree 10": (10, 1, False),
    "rational of degree 6": (6, 2, True),
    "degree 20": (20, 1, False),
}


def random_curve(rng, kind, dimension, size=1.0):
    """A curve in the unit cube, times the size."""
    degree, spans, rational = CURVES[kind]
    inner = np.sort(rng.uniform(0.05, 0.95, spans - 1))
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    points = size * rng.random((degree + spans, dimension))
    weights = rng.uniform(0.3, 3.0, len(points)) if rational else None
    return asm.NurbsCurve(points, knots, degree, weights)


def random_point(rng, curve):
    """Anywhere near a curve, at every order of distance from it."""
    low, high = curve.bounding_box()
    if rng.random() < 0.5:
        return rng.uniform(low - 0.3, high + 0.3)
    away = 10.0 ** rng.uniform(-16.0, -1.0)
    return curve.evaluate(rng.random()) + away * rng.normal(size=len(low))


def bernstein(n, x):
    """Basis functions at x (m,): (m, n + 1)."""
    k = np.arange(n + 1)
    binomials = np.array([float(comb(n, i)) for i in k])
    return binomials * x[:, None] ** k * (1.0 - x[:, None]) ** (n - k)


def piece_values(net, x):
    """Point and two derivatives of Bezier pieces net (m, n + 1, d + 1), piece i at x[i]."""
    n = net.shape[1] - 1
    rows = [np.einsum("mk,mkd->md", bernstein(n, x), net)]
    for order in (1, 2):
        if order > n:
            rows.append(np.zeros_like(rows[0]))
            continue
        factor = n if order == 1 else n * (n - 1)
        rows.append(factor * np.einsum("mk,mkd->md", bernstein(n - order, x), np.diff(net, order, axis=1)))
    w, dw, hw = (row[:, -1:] for row in rows)
    c = rows[0][:, :-1] / w
    d = (rows[1][:, :-1] - dw * c) / w
    return c, d, (rows[2][:, :-1] - 2.0 * dw * d - hw * c) / w


def sampled(net, count):
    """Points (pieces, count, d) of Bezier pieces at even parameters, and those."""
    x = np.linspace(0.0, 1.0, count)
    rows = np.einsum("sk,pkd->psd", bernstein(net.shape[1] - 1, x), net)
    return rows[..., :-1] / rows[..., -1:], x


def nets_of(shape):
    """Bezier pieces of a curve; a point as a piece of degree 0."""
    if isinstance(shape, np.ndarray):
        return np.concatenate([shape, [1.0]])[None, None]
    return shape.bezier_pieces()


def least_distances(pairs, count):
    """The least distances that samples and Newton's method find for pairs (curve, curve or point) of equal kinds."""
    starts, least = [], []
    for a, b in pairs:
        nets = nets_of(a), nets_of(b)
        (u, x), (v, y) = (sampled(net, count if net.shape[1] > 1 else 1) for net in nets)
        d = cdist(u.reshape(-1, u.shape[-1]), v.reshape(-1, v.shape[-1]))
        nearest = np.argpartition(d, min(4, d.size - 1), axis=None)[:4]
        i, j = np.unravel_index(nearest, d.shape)
        starts.append((nets[0][i // len(x)], x[i % len(x)], nets[1][j // len(y)], y[j % len(y)]))
        least.append(d.min())
    # From the nearest samples, each on its own pieces.
    found = polished(*(np.concatenate(part) for part in zip(*starts, strict=True)))
    at = np.cumsum([0] + [len(start[1]) for start in starts[:-1]])
    return np.minimum(least, np.minimum.reduceat(found, at))


def polished(a, x, b, y, steps=12):
    """Least distances along Newton's method from (x, y), held in the unit square."""
    best = np.full(len(x), np.inf)
    for _ in range(steps):
        u, du, hu = piece_values(a, x)
        v, dv, hv = piece_values(b, y)
        d = u - v
        best = np.minimum(best, np.linalg.norm(d, axis=1))
        p = (du * du).sum(1) + (d * hu).sum(1)
        q = -(du * dv).sum(1)
        r = (dv * dv).sum(1) - (d * hv).sum(1)
        gx = (d * du).sum(1)
        gy = -(d * dv).sum(1)
        flat = b.shape[1] == 1
        hold_x = ((x <= 0) & (gx > 0)) | ((x >= 1) & (gx < 0))
        hold_y = ((y <= 0) & (gy > 0)) | ((y >= 1) & (gy < 0)) | flat
        q = np.where(hold_x | hold_y, 0.0, q)
        gx, gy = np.where(hold_x, 0.0, gx), np.where(hold_y, 0.0, gy)
        p, r = np.where(p > 0, p, 1.0), np.where((r > 0) & (not flat), r, 1.0)
        det = p * r - q * q
        q = np.where(det > 1e-12 * p * r, q, 0.0)
        det = p * r - q * q
        x = np.clip(x - (r * gx - q * gy) / det, 0.0, 1.0)
        y = np.clip(y - (p * gy - q * gx) / det, 0.0, 1.0)
    return best
