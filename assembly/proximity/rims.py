"""The boundary curves of faces as curves in space: C(t) = S(c(t)), sampled, measured and projected onto."""

from __future__ import annotations

from functools import cached_property
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.geometry.curve import NurbsCurve
from assembly.geometry.curve_parts import CORNER, between, creases
from assembly.geometry.face import Face

__all__ = ["Rim", "corners", "cross", "turn"]

Array = NDArray[np.float64]
# Gauss points of an interval between samples; the middle one shows how far the curve bulges.
_GAUSS = np.array([-sqrt(0.6), 0.0, sqrt(0.6)])
_GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
_NEWTON_STEPS = 12
# A place is good enough when it is known to this part of the tolerance.
_CLOSE = 1e-3


def cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (..., 3), for a few of them much faster than numpy's."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    p, q, r = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p], axis=-1)


def turn(a: Array, b: Array) -> Array:
    """Angles between vectors (..., 3), right to rounding for small ones too."""
    across = cross(a, b)
    angle: Array = np.arctan2(np.sqrt((across**2).sum(axis=-1)), (a * b).sum(axis=-1))
    return angle


class Rim:
    """One boundary curve of a face, in space.

    Attributes
    ----------
    face : Face
    number : int
        Of the face among those of the topology.
    index : int
        Of the boundary curve of the face, as it was given, that it is or is a part of.
    curve : NurbsCurve
        Plane curve in the parameters of the face.
    tolerance : float
        How far points of it may be apart and still be one.
    anchored : bool
        Whether its ends are vertices; False for a closed curve without corners.
    """

    def __init__(self, face: Face, number: int, index: int, curve: NurbsCurve, tolerance: float) -> None:
        self.face = face
        self.number = number
        self.index = index
        self.curve = curve
        self.tolerance = tolerance
        self.anchored = True

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array]:
        """Points and derivatives, each of the shape of t + (3,)."""
        uv, rate = self.curve.evaluate(t, 1)
        point, su, sv = self.face.surface.evaluate(*self._inside(uv), 1)
        return point, su * rate[..., :1] + sv * rate[..., 1:]

    def tangents(self, t: ArrayLike) -> tuple[Array, Array]:
        """Su and Sv of the surface along the curve, each of the shape of t + (3,)."""
        _, su, sv = self.face.surface.evaluate(*self._inside(self.curve.evaluate(t)), 1)
        return su, sv

    def frames(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, outward normals and tangents with material on their left seen from outside; not normalized."""
        uv, rate = self.curve.evaluate(t, 1)
        point, su, sv = self.face.surface.evaluate(*self._inside(uv), 1)
        tangent = su * rate[..., :1] + sv * rate[..., 1:]
        return point, self.face.sign * cross(su, sv), self.face.sign * tangent

    def _inside(self, uv: Array) -> tuple[Array, Array]:
        """Parameters without the little by which a curve of a file runs out of an open direction."""
        surface = self.face.surface
        inside = []
        for k in range(2):
            x = uv[..., k]
            inside.append(x if surface.closed[k] else np.clip(x, *surface.domain[k]))
        return inside[0], inside[1]

    @cached_property
    def _measured(self) -> tuple[Array, Array, Array, Array]:
        """Sample parameters, their points, half widths and lengths of the intervals between them."""
        at = self.curve.breaks()
        surface = self.face.surface
        across = sum(spans.size - 1 for spans in surface.breaks())
        each = max(4, -(-(12 + 4 * across) // (at.size - 1)))
        steps = np.arange(each) / each
        t = np.append((at[:-1, None] + np.diff(at)[:, None] * steps).ravel(), at[-1])
        half = 0.5 * np.diff(t)
        middle = t[:-1] + half
        points, rates = self.evaluate(np.concatenate([t, (middle[:, None] + half[:, None] * _GAUSS).ravel()]))
        inner = points[t.size :].reshape(-1, 3, 3)
        speeds = np.linalg.norm(rates[t.size :], axis=1).reshape(-1, 3)
        corners = points[: t.size]
        center = 0.5 * (corners[:-1] + corners[1:])
        spread = np.concatenate([inner, corners[:-1, None], corners[1:, None]], axis=1) - center[:, None]
        # The curve between the five points of an interval strays little beyond them.
        reach = 1.25 * np.sqrt((spread**2).sum(axis=2).max(axis=1))
        return t, corners, reach, 2.0 * half * (speeds @ _GAUSS_WEIGHTS)

    @property
    def samples(self) -> tuple[Array, Array]:
        """Parameters (n,) and points (n, 3) along the curve, its ends among them."""
        return self._measured[0], self._measured[1]

    @cached_property
    def length(self) -> float:
        """Length of the curve in space."""
        return float(self._measured[3].sum())

    @cached_property
    def closed(self) -> bool:
        """Whether the two ends are one point."""
        first, last = self.ends
        return bool(np.linalg.norm(last - first) <= self.tolerance)

    @property
    def ends(self) -> Array:
        """Where it begins and ends, (2, 3)."""
        return self._measured[1][[0, -1]]

    @cached_property
    def corner(self) -> bool:
        """Whether the tangent jumps from its end to its beginning."""
        _, tangents = self.evaluate(np.array(self.curve.domain))
        return bool(turn(tangents[1], tangents[0]) > CORNER)

    def parts(self, at: ArrayLike) -> list[Rim]:
        """The rims that it falls into when it is cut at increasing parameters."""
        cuts = np.concatenate([self.curve.domain[:1], np.asarray(at, dtype=float), self.curve.domain[1:]])
        curves = [between(self.curve, low, high) for low, high in zip(cuts[:-1], cuts[1:], strict=True)]
        return [Rim(self.face, self.number, self.index, curve, self.tolerance) for curve in curves]

    def balls(self) -> tuple[Array, Array]:
        """Centers (n, 3) and radii (n,) of balls that the curve runs through, by samples."""
        points, reach = self._measured[1], self._measured[2]
        return 0.5 * (points[:-1] + points[1:]), reach

    def middle(self) -> Array:
        """The mean point along the curve, (3,)."""
        points, lengths = self._measured[1], self._measured[3]
        return np.asarray(lengths @ (0.5 * (points[:-1] + points[1:])) / lengths.sum())

    def nearest(self, points: Array, guess: Array | None = None) -> tuple[Array, Array]:
        """Parameters (m,) of the nearest points of the curve and distances (m,) of points (m, 3) near it.

        Gauss and Newton's iteration: it converges quadratically for points on the curve. It starts from the given
        parameters, or where they are far off or missing from the nearest sample.
        """
        samples, at = self.samples
        low, high = self.curve.domain
        if guess is not None:
            place, _ = self.evaluate(guess)
            if (np.abs(points - place) <= _CLOSE * self.tolerance).all():
                return guess, np.sqrt(((points - place) ** 2).sum(axis=1))
        t = samples[((points[:, None] - at) ** 2).sum(axis=2).argmin(axis=1)]
        best, least = t, np.full(len(points), np.inf)
        for _ in range(_NEWTON_STEPS):
            place, rate = self.evaluate(t)
            offset = points - place
            distance = np.sqrt((offset**2).sum(axis=1))
            speed = np.maximum((rate**2).sum(axis=1), 1e-300)
            step = (offset * rate).sum(axis=1) / speed
            t = t + step
            t = low + (t - low) % (high - low) if self.closed else np.clip(t, low, high)
            nearer = distance < least
            # One step further than what has been measured: the last one, if small, leaves rounding alone.
            best, least = np.where(nearer, t, best), np.where(nearer, distance, least)
            if not nearer.any() or (np.abs(step) * np.sqrt(speed) <= _CLOSE * self.tolerance).all():
                break
        return best, least


def corners(rim: Rim) -> Array:
    """Parameters inside a curve's domain where its tangent in space jumps."""
    at, before, after = creases(rim.curve)
    if not at.size:
        return at
    su, sv = rim.tangents(at)
    tangents = (su * d[:, :1] + sv * d[:, 1:] for d in (before, after))
    return np.asarray(at[turn(*tangents) > CORNER])
