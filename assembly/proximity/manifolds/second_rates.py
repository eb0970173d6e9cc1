"""Rows of manifolds with exact second derivatives (docs/derivations.md, "Rows of contact manifolds").

A row is a stationary value over the coordinates of what it is between. So its gap changes at first order as where these
coordinates stay, and at second order by what they gain in following. One body stays, and what is at x of the other one
goes to exp(w) x + v, about the origin of the first, in its axes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.manifolds.places import Affine, Place

__all__ = ["ALIKE", "Level", "Ray", "Row", "Socket", "of_both", "skew"]

Array = NDArray[np.float64]
# Newton's method begins at what is off by the lean squared; a step below the last, in coordinates, ends it.
STEPS, ARRIVED = 6, 1e-12
# [of the largest] A direction in which a row grows no more than that is one of many alike, and stays.
ALIKE = 1e-9


def skew(a: Array) -> Array:
    """The matrix (3, 3) of b -> a x b."""
    x, y, z = a.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _turned(c: Array, q: Array) -> Array:
    """The form (3, 3) of w -> c.(w x (w x q))."""
    both = np.outer(c, q)
    return np.asarray(0.5 * (both + both.T) - float(c @ q) * np.eye(3))


def _along(c: Array, bends: Array) -> Array:
    """What bends (3, k, k) are along a vector, (k, k)."""
    return np.asarray((c @ bends.reshape(3, -1)).reshape(bends.shape[1:]))


def _moves(q: Array) -> Array:
    """The velocity of a point by twists, (3, 6)."""
    return np.hstack([np.eye(3), -skew(q)])


@dataclass(frozen=True, eq=False)
class Row(ABC):
    """A row of a manifold, in the axes of the body that stays.

    Attributes
    ----------
    gap : float
    normal, place : (3,)
        From what stays to what moves; a point of what moves.
    of_second : bool
        Whether it is the first body of the manifold that moves.
    x : (k,)
        Coordinates of what it is between: of what moves, then of what stays.
    """

    gap: float
    normal: Array
    place: Array
    of_second: bool
    x: Array

    @abstractmethod
    def second(self) -> Array:
        """The gap's second derivative, (6, 6): along exp(t w) x + t v it is twist^T second twist."""


@dataclass(frozen=True, eq=False)
class Ray(Row):
    """What moves over what stays, seen along a direction: q(t) = p(s) + gap n.

    Of two planes, lines or points there is one solution; where coordinates are left, the gap is stationary over them.

    Attributes
    ----------
    stays, moves : Place
    along : (3,)
        n, of the body that stays.
    """

    stays: Place
    moves: Place
    along: Array

    @classmethod
    def there(
        cls, stays: tuple[Place, Array], moves: tuple[Place, Array], along: Array, at: tuple[float, Array, Array]
    ) -> Ray:
        """The row between places, each with its coordinates; `at` has its gap, normal and place."""
        return cls(at[0], at[1], at[2], False, np.concatenate([moves[1], stays[1]]), stays[0], moves[0], along)

    @classmethod
    def near(
        cls, stays: tuple[Place, Array], moves: tuple[Place, Array], along: Array, at: tuple[float, Array, Array]
    ) -> Ray:
        """The row between places, each with coordinates nearby; `at` has a gap, a normal and a place nearby."""
        row = cls.there(stays, moves, along, at)
        m, is_affine = len(row.x), isinstance(row.stays, Affine) and isinstance(row.moves, Affine)
        for _ in range(1 if is_affine else STEPS):
            matrix, off, _ = row._system()
            right = np.empty(m + 4)
            right[: m + 1], right[m + 1 :] = matrix[: m + 1, m + 1 :] @ row.normal, off
            right[m] += 1.0
            step = np.linalg.solve(matrix, -right)
            x = row.x + step[:m]
            place = row.moves.at(x[: row.moves.count])[0]
            row = replace(row, x=x, gap=row.gap + float(step[m]), normal=row.normal + step[m + 1 :], place=place)
            if float(np.abs(step).max()) <= ARRIVED:
                break
        return row

    def _system(self) -> tuple[Array, Array, Array]:
        """The matrix of the conditions on (x, gap, normal), what the points are off, and the slopes of what moves."""
        k, m, c = self.moves.count, len(self.x), self.normal
        q, q_slopes, q_bends = self.moves.at(self.x[:k])
        p, p_slopes, p_bends = self.stays.at(self.x[k:])
        matrix = np.zeros((m + 4, m + 4))
        if not isinstance(self.moves, Affine):
            matrix[:k, :k] = _along(c, q_bends)
        if not isinstance(self.stays, Affine):
            matrix[k:m, k:m] = -_along(c, p_bends)
        slopes = matrix[m + 1 :]
        slopes[:, :k], slopes[:, k:m], slopes[:, m] = q_slopes, -p_slopes, -self.along
        matrix[: m + 1, m + 1 :] = slopes[:, : m + 1].T
        return matrix, q - p - self.gap * self.along, q_slopes

    def second(self) -> Array:
        """The gap's second derivative, (6, 6)."""
        m = len(self.x)
        matrix, _, slopes = self._system()
        mixed = np.zeros((m, 6))
        mixed[: self.moves.count, 3:] = -(skew(self.normal) @ slopes).T
        follow = np.linalg.solve(matrix, -np.vstack([mixed, np.zeros((1, 6)), _moves(self.place)]))[:m]
        second = mixed.T @ follow
        second = second + second.T + follow.T @ matrix[:m, :m] @ follow
        second[3:, 3:] += _turned(self.normal, self.place)
        return np.asarray(second)


@dataclass(frozen=True, eq=False)
class Level(Row):
    """How far along a unit normal of what stays a point of what moves is: normal.(q(t) - o), and a constant.

    Attributes
    ----------
    moves : Place
        Stationary over its coordinate, if it has one.
    origin : (3,)
    turn : ((3,), (3,)) or None
        How the normal changes with an angle, once and twice, over which the row is stationary.
    """

    moves: Place
    origin: Array
    turn: tuple[Array, Array] | None

    def second(self) -> Array:
        """The gap's second derivative, (6, 6). A normal that is one of many alike stays."""
        q, slopes, bends = self.moves.at(self.x)
        c, k = self.normal, self.moves.count
        matrix = _along(c, bends)
        mixed = np.zeros((k, 6))
        mixed[:, 3:] = -(skew(c) @ slopes).T
        if self.turn is not None:
            slope, bend = self.turn
            across = (slope @ slopes)[:, None]
            whole = np.block([[matrix, across], [across.T, np.array([[bend @ (q - self.origin)]])]])
            if k == 0 or abs(np.linalg.det(whole)) > ALIKE * float(np.abs(whole).max()) ** 2:
                matrix, mixed = whole, np.vstack([mixed, slope @ _moves(q)])
        second = np.zeros((6, 6))
        second[3:, 3:] = _turned(c, q)
        return second - mixed.T @ np.linalg.solve(matrix, mixed) if len(matrix) else second


@dataclass(frozen=True, eq=False)
class Socket(Row):
    """How much farther a point of what moves may go from a center of what stays: radius - |q - o|, and a constant.

    Attributes
    ----------
    moves : (3,)
        q, the center of a ball.
    apart : float
        |q - o|. Where that is zero all normals are alike, and the one that it has stays.
    """

    moves: Array
    apart: float

    def second(self) -> Array:
        """The gap's second derivative, (6, 6)."""
        second = np.zeros((6, 6))
        second[3:, 3:] = _turned(self.normal, self.moves)
        if self.apart > 0.0:
            # What goes across the normal goes around the center.
            moves = _moves(self.moves)
            across = moves - np.outer(self.normal, self.normal @ moves)
            second -= across.T @ across / self.apart
        return second


def of_both(rates: Array, second: Array, arm: Array) -> Array:
    """The second derivative (12, 12) by twists of the body that stays, then of that which moves, each about its origin.

    Parameters
    ----------
    rates, second : (6,), (6, 6)
        By twists of the body that moves about the origin of the other one.
    arm : (3,)
        From the origin of the body that moves to that of the other one.
    """
    r, s = rates[:3], rates[3:]
    lift = np.zeros((6, 12))
    lift[:3, :3], lift[:3, 6:9], lift[:3, 9:] = -np.eye(3), np.eye(3), -skew(arm)
    lift[3:, 3:6], lift[3:, 9:] = -np.eye(3), np.eye(3)
    both = lift.T @ second @ lift
    # To second order exp(-w_a) (exp(w_b) arm - arm + v_b - v_a), and the turn is that of exp(-w_a) exp(w_b).
    both[9:, 9:] += _turned(r, arm)
    more = np.zeros((12, 12))
    # -r.(w_a x u) = w_a.(r x u) of u = v_b - v_a + w_b x arm, -1/2 s.(w_a x w_b) = 1/2 w_a.(s x w_b).
    across = skew(r)
    more[3:6, :3], more[3:6, 6:9], more[3:6, 9:] = -across, across, -across @ skew(arm) + 0.5 * skew(s)
    both += more + more.T
    return np.asarray(0.5 * (both + both.T))
