"""Terms of the objective for the reference solver, written from their definitions
(`constraints/model/objectives.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.dexterity import Dexterity
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.objectives import FrameDistance, Objective, PointDistance, Posture, Weight
from assembly.constraints.packing.scene import Packed
from assembly.constraints.packing.terms import natural_unit
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.solve.oracle.dexterity import Mechanism
from assembly.solve.oracle.rows import Poses

__all__ = ["Terms"]

Array = NDArray[np.float64]


class Terms:
    """The objective, scaled, and its parameters: targets and references, which may change between solves.

    Attributes
    ----------
    value : MX
    p : MX
    """

    def __init__(
        self,
        packed: Packed,
        bodies: Sequence[Body],
        objectives: Sequence[tuple[float, Objective]],
        poses: Poses,
        mechanism: Mechanism,
    ) -> None:
        self._packed = packed
        self._bodies = bodies
        self._poses = poses
        self._mechanism = mechanism
        self._places = {id(body): k for k, body in enumerate(bodies)}
        self._given: list[Callable[[Array], Array]] = []
        self._symbols: list[ca.MX] = []
        self.value = ca.MX(0)
        for sign, term in objectives or ((1.0, Posture()),):
            # A dexterity is in the user's units.
            natural = 1.0 if isinstance(term, Dexterity) else natural_unit(term, packed.scale)
            self.value += sign * term.weight * natural / packed.unit * self._term(term)
        self.p = ca.vertcat(ca.MX(0, 1), *self._symbols)

    def values(self, q: Array) -> list[float]:
        """The parameters now, of a solve that starts at q."""
        return [float(value) for given in self._given for value in given(q)]

    def scaled(self, row: Array) -> Array:
        """A pose row as the program has it."""
        return np.concatenate([(row[:3] - self._packed.reference) / self._packed.scale, row[3:]])

    def _parameter(self, count: int, given: Callable[[Array], Array]) -> ca.MX:
        self._symbols.append(ca.MX.sym("given", count))
        self._given.append(given)
        return self._symbols[-1]

    def _term(self, term: Objective) -> ca.MX:
        """A term of weight one, in scaled lengths."""
        if isinstance(term, PointDistance):
            point = self._poses.point(self._places[id(term.point.body)], term.point.coordinates)
            return ca.sumsqr(point - self._target(lambda: term.target))
        if isinstance(term, FrameDistance):
            return self._frame_distance(term)
        if isinstance(term, Expression):
            return self._poses.value(term, [self._places[id(body)] for body in term.bodies])
        if isinstance(term, Dexterity):
            return self._mechanism.value(term)
        if isinstance(term, Posture):
            moving = [k for k, body in enumerate(self._bodies) if not body.fixed]
            return ca.sum1(ca.vertcat(*(self._posture(term, k) for k in moving)))
        if isinstance(term, Weight):
            masses = [mass for mass, _ in term.points]
            places = [self._places[id(body)] for body in term.bodies]
            centers = [
                self._poses.point(k, center) + self._packed.reference / self._packed.scale
                for k, (_, center) in zip(places, term.points, strict=True)
            ]
            parts = [mass / term.mass * ca.dot(term.direction, p) for mass, p in zip(masses, centers, strict=True)]
            return -ca.sum1(ca.vertcat(*parts))
        raise InputError(
            f"objective is {term!r}; expected what the reference solver takes: PointDistance, FrameDistance, Posture, "
            "Weight, Dexterity or Expression"
        )

    def _target(self, target: Callable[[], Array]) -> ca.MX:
        """A place in the world as a parameter."""
        return self._parameter(3, lambda _: (target() - self._packed.reference) / self._packed.scale)

    def _frame_distance(self, term: FrameDistance) -> ca.MX:
        """|p - p_t|^2 + length^2 |A - A_t|^2 / 2, with |A - A_t|^2 = 8 sin^2(angle / 2) of axes as columns."""
        k, frame = self._places[id(term.frame.body)], term.frame
        apart = self._poses.point(k, frame.origin) - self._target(lambda: term.target.position)
        axes = self._parameter(9, lambda _: rotation_matrix(term.target.quaternion).ravel(order="F"))
        turned = self._poses.turns[k] @ frame.axes - ca.reshape(axes, 3, 3)
        return ca.sumsqr(apart) + 0.5 * (term.length / self._packed.scale) ** 2 * ca.sumsqr(turned)

    def _posture(self, term: Posture, k: int) -> ca.MX:
        """|x - x0|^2 + lever^2 4 sin^2(angle / 2) of one body."""
        pose = self._poses.poses[k]
        reference = self._parameter(7, lambda q: self.scaled((q if term.reference is None else term.reference)[k]))
        lever = 0.5 * (self._bodies[k].size or self._packed.scale) / self._packed.scale
        e, o = pose[3:], reference[3:]
        # The vector part of o e^* is the axis times sin(angle / 2).
        turn = e[0] * o[1:] - o[0] * e[1:] - ca.cross(o[1:], e[1:])
        return ca.sumsqr(pose[:3] - reference[:3]) + 4.0 * lever**2 * ca.sumsqr(turn) / ca.dot(e, e)
