"""Rows of joints, couplings and expressions for the reference solver, written from what the coordinates mean.

With d = p_b - p_a and unit axes of frames a and b, rows of one coordinate are

    coinciding points, slides, dot products    as they are,
    SWING k     axis_k(a).z_b sqrt(2 / (1 + z_a.z_b)), of length 2 sin(theta / 2): zero only where z_b = z_a,
    DISTANCE    (|d|^2 - t^2) / (2 t),         t the value asked for,
    RADIUS      ((x_a.d)^2 + (y_a.d)^2 - t^2) / (2 t),
    ANGLE       (cos t - z_a.z_b) / sin t,

which have the gradients of the coordinates wherever they hold, so that multipliers compare; a RADIUS beside another
coordinate is the root that it means. An angle in a plane, of
sine part S and cosine part C, is a variable t with

    atan2(S cos t - C sin t, C cos t + S sin t) = 0,

so that it goes on past a whole turn with nothing to choose; so is an angle between axes that is coupled.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, inf, pi
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint, Coordinate, RowConstraint
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.expression import Expression
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.primitives import (
    ANGLE,
    AZIMUTH,
    COINCIDENT,
    DISTANCE,
    DOT,
    RADIUS,
    SLIDE,
    SWING,
    TURN,
)
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import retract
from assembly.solve.measure import JointRow, Near, measure, standing

__all__ = ["Poses", "RowFrames", "Rows"]

Array = NDArray[np.float64]
# Starts nearer than the first to where a row has no gradient are moved by the second: radians, or lengths over the
# size.
_FLAT, _NUDGE = 1e-3, 0.1
_STEEP = cos(_FLAT)


class Poses:
    """Poses of the program, scaled, and what they give: rotations, and poses in the user's units."""

    def __init__(self, poses: Sequence[ca.MX], packed: Packed) -> None:
        self.poses = poses
        self.scale = packed.scale
        self._reference = packed.reference
        rotation = _rotation()
        self.turns = [rotation(pose[3:]) for pose in poses]

    def point(self, body: int, coordinates: Array) -> ca.MX:
        """A point of a body in the world."""
        return self.poses[body][:3] + self.turns[body] @ (coordinates / self.scale)

    def value(self, expression: Expression, places: Sequence[int]) -> ca.MX:
        """The values of the user's function."""
        given = []
        for k in places:
            x, e = self.poses[k][:3], self.poses[k][3:]
            given.append(ca.vertcat(self.scale * x + self._reference, e / ca.norm_2(e)))
        (value,) = expression.function.call(given, False, False)
        return ca.densify(value)


def _rotation() -> ca.Function:
    """The rotation matrix of e / |e|."""
    e = ca.SX.sym("e", 4)
    w, u = e[0], e[1:]
    matrix = (w * w - ca.dot(u, u)) * ca.SX.eye(3) + 2 * w * ca.skew(u) + 2 * u @ u.T
    return ca.Function("rotation", [e], [matrix / ca.dot(e, e)])


class RowFrames(NamedTuple):
    """p_b - p_a, scaled, and the axes of both frames as columns."""

    apart: ca.MX
    a: ca.MX
    b: ca.MX

    @classmethod
    def of(cls, coordinate: Coordinate, places: tuple[int, int], poses: Poses) -> RowFrames:
        """The frames of a coordinate, whose bodies are at these places."""
        pair, (i, j) = coordinate.frames, places
        apart = poses.point(j, pair.frame_b.origin) - poses.point(i, pair.frame_a.origin)
        return cls(apart, poses.turns[i] @ pair.frame_a.axes, poses.turns[j] @ pair.frame_b.axes)

    @property
    def cosine(self) -> ca.MX:
        """z_a . z_b."""
        return ca.dot(self.a[:, 2], self.b[:, 2])

    @property
    def across(self) -> ca.MX:
        """p_b - p_a along x_a and y_a."""
        return self.a[:, :2].T @ self.apart

    def parts_of_turn(self, coordinate: Coordinate) -> tuple[ca.MX, ca.MX]:
        """The sine part and the cosine part of an angle in a plane."""
        a, b = self.a, self.b
        if coordinate.kind == TURN:
            sine = ca.dot(a[:, 1], b[:, 0]) - ca.dot(a[:, 0], b[:, 1])
            return sine, ca.dot(a[:, 0], b[:, 0]) + ca.dot(a[:, 1], b[:, 1])
        along = b[:, coordinate.component]
        return ca.dot(a[:, 1], along), ca.dot(a[:, 0], along)

    def linear(self, coordinate: Coordinate) -> ca.MX:
        """A coordinate that is a row as it is."""
        k = coordinate.component
        if coordinate.kind == COINCIDENT:
            return self.apart[k]
        if coordinate.kind == SLIDE:
            return ca.dot(self.a[:, k], self.apart)
        assert coordinate.kind == DOT
        return ca.dot(self.a[:, k // 3], self.b[:, k % 3])


class _Angle:
    """An angle as a variable of the program."""

    def __init__(self, coordinate: Coordinate, places: tuple[int, int]) -> None:
        self.coordinate = coordinate
        self._places = places
        self.x = ca.MX.sym("angle")
        self.lower, self.upper = (0.0, pi) if coordinate.kind == ANGLE else (-inf, inf)

    def definition(self, frames: RowFrames) -> ca.MX:
        """A row, zero where the variable is what the frames say."""
        c, s = ca.cos(self.x), ca.sin(self.x)
        if self.coordinate.kind == ANGLE:
            return frames.cosine - c
        sine, cosine = frames.parts_of_turn(self.coordinate)
        return ca.atan2(sine * c - cosine * s, cosine * c + sine * s)

    def start(self, q: Array, near: Near) -> float:
        """The variable at a configuration."""
        frames = standing(self.coordinate, q, self._places)
        return measure(self.coordinate, frames, near.get(self.coordinate, 0.0))


class Rows:
    """All rows of a scene but those of contacts, in the order in which the scene is packed.

    Attributes
    ----------
    rows : MX (m,)
    definitions : MX
        Of the variables, equal to zero.
    x : MX
        Variables beside the poses, between `lower` and `upper`.
    p : MX
        Parameters: what rows of joints equal, so that driven values and limits may change.
    """

    def __init__(self, packed: Packed, bodies: Sequence[Body], constraints: Sequence[Constraint], poses: Poses) -> None:
        self._scale = packed.scale
        self._fixed = [body.fixed for body in bodies]
        self._angles: dict[Coordinate, _Angle] = {}
        self._joints: list[JointRow] = []
        self._expressions: list[tuple[Expression, list[int]]] = []
        places = {id(body): k for k, body in enumerate(bodies)}
        joints: list[tuple[int, JointRow]] = []
        for span, item in zip(packed.spans, constraints, strict=True):
            if isinstance(item, RowConstraint):
                for row, equation in zip(span, item.equations, strict=True):
                    pairs = [coordinate.frames for _, coordinate in equation.terms]
                    at = tuple((places[id(p.frame_a.body)], places[id(p.frame_b.body)]) for p in pairs)
                    unit = 1.0 if equation.terms[0][1].is_angle else packed.scale
                    joints.append((int(row), JointRow(equation, at, unit)))
            elif isinstance(item, Expression):
                self._expressions.append((item, [places[id(body)] for body in item.bodies]))
            elif not isinstance(item, Contact):
                raise InputError(
                    f"constraint {item.name!r} is {item!r}; "
                    "expected what the reference solver takes: a Contact, a joint, a coupling or an Expression"
                )
        self._joints = [row for _, row in sorted(joints, key=lambda item: item[0])]
        self.p = ca.MX.sym("value", len(self._joints))
        known: dict[int, RowFrames] = {}
        rows = [self._row(row, self.p[k], known, poses) for k, row in enumerate(self._joints)]
        rows += [poses.value(item, at) / item.scale for item, at in self._expressions]
        self.rows = ca.vertcat(ca.MX(0, 1), *rows)
        angles = self._angles.values()
        definitions = [angle.definition(known[id(angle.coordinate.frames)]) for angle in angles]
        self.definitions = ca.vertcat(ca.MX(0, 1), *definitions)
        self.x = ca.vertcat(ca.MX(0, 1), *(angle.x for angle in angles))
        self.lower = np.array([angle.lower for angle in angles])
        self.upper = np.array([angle.upper for angle in angles])

    def _row(self, row: JointRow, value: ca.MX, known: dict[int, RowFrames], poses: Poses) -> ca.MX:
        """The left-hand side less the right-hand side, over the unit; frames of a pair are written once."""
        total = -value
        for (factor, coordinate), places in zip(row.equation.terms, row.places, strict=True):
            if id(coordinate.frames) not in known:
                known[id(coordinate.frames)] = RowFrames.of(coordinate, places, poses)
            frames, kind = known[id(coordinate.frames)], coordinate.kind
            if kind == SWING:
                # No joint drives a swing: the value is zero.
                across = ca.dot(frames.a[:, coordinate.component], frames.b[:, 2])
                total += factor * ca.sqrt(2 / (1 + frames.cosine)) * across
            elif kind == DISTANCE or (kind == RADIUS and len(row.places) == 1):
                t = value / factor
                away = frames.apart if kind == DISTANCE else frames.across
                return factor * (ca.sumsqr(away) - t**2) / (2 * t)
            elif kind == RADIUS:
                total += factor * self._scale / row.unit * ca.norm_2(frames.across)
            elif kind == ANGLE and len(row.places) == 1:
                t = value / factor
                return factor * (ca.cos(t) - frames.cosine) / ca.sin(t)
            elif kind in (TURN, AZIMUTH, ANGLE):
                angle = self._angles.setdefault(coordinate, _Angle(coordinate, places))
                total += factor / row.unit * angle.x
            else:
                unit = 1.0 if coordinate.is_angle else self._scale
                total += factor * unit / row.unit * frames.linear(coordinate)
        return total

    def values(self) -> list[float]:
        """The parameters now."""
        return [row.value() for row in self._joints]

    def start(self, q: Array, near: Near) -> list[float]:
        """The variables at a configuration; `near` tells the turns of angles."""
        return [angle.start(q, near) for angle in self._angles.values()]

    def angles(self, x: Array) -> dict[Coordinate, float]:
        """Every angle that is a variable, of the variables' values."""
        return dict(zip(self._angles, x.tolist(), strict=True))

    def residuals(self, q: Array, near: Near) -> Array:
        """Every row by its definition, over its unit: no expression of the program has a part in it."""
        values = [row.residual(q, near) for row in self._joints]
        for item, places in self._expressions:
            (given,) = item.function.call([ca.DM(q[k]) for k in places])
            # An expression without a value counts as an infinite violation.
            numbers = np.nan_to_num(np.array(ca.densify(given)).ravel(), nan=-inf, posinf=inf, neginf=-inf)
            values += (numbers / item.scale).tolist()
        return np.array(values)

    def nudged(self, q: Array) -> Array:
        """A configuration near q where every row that does not hold has a gradient.

        Opposed axes, points that coincide and the like are saddles, at which nothing says which way to go. Frame b
        leaves toward x_a, or along z_a.
        """
        q = q.copy()
        for row in self._joints:
            if row.equation.one_sided and row.residual(q, {}) >= 0.0:
                continue
            for (_, coordinate), places in zip(row.equation.terms, row.places, strict=True):
                frames, kind = standing(coordinate, q, places), coordinate.kind
                a, z_b = np.array([frames.a(k) for k in range(3)]), np.array(frames.b(2))
                cosine = float(a[2] @ z_b)
                # The only dot product of joints is that of the z axes.
                turns = cosine < -_STEEP if kind == SWING else kind in (DOT, ANGLE) and abs(cosine) > _STEEP
                parts = kind in (DISTANCE, RADIUS) and measure(coordinate, frames) < _FLAT * self._scale
                if turns or parts:
                    away = a[0 if kind == RADIUS else 2]
                    twist = [parts * self._scale * away, turns * a[1]]
                    self._move(q, places, _NUDGE * np.concatenate(twist))
        return q

    def _move(self, q: Array, places: tuple[int, int], twist: Array) -> None:
        """Move the body of frame b, or where it is fixed that of frame a the other way."""
        i, j = places
        if not self._fixed[j]:
            q[j] = retract(q[j], twist)
        elif not self._fixed[i]:
            q[i] = retract(q[i], -twist)
