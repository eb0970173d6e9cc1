"""A dexterity for the reference solver, from its definition: rates that keep the rows, and what they do to the tip.

With rows A that hold the mechanism, in twists of the moving bodies, rows B of the inputs and T of the end effector,

    [ -I   A   0  ] [ r ]   [ 0 ]
    [ A^T  s I B^T ] [ V ] = [ 0 ],      J = T V,
    [ 0    B   0  ] [ Z ]   [ I ]

gives the rates of least squares with unit rates of the inputs. s is so small that it only puts motions to rest which
nothing determines. CasADi differentiates the whole of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from assembly.constraints.model.constraint import Coordinate, RowConstraint
from assembly.constraints.model.dexterity import Dexterity
from assembly.constraints.model.expression import Expression
from assembly.constraints.packing.scene import Packed
from assembly.constraints.packing.terms import dexterity_numbers
from assembly.constraints.program.primitives import ANGLE, AZIMUTH, DISTANCE, RADIUS, SWING, TURN
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.solve.oracle.rows import Poses, RowFrames

__all__ = ["Mechanism"]

# Weight of motions that nothing determines.
REST = 1e-13


class Mechanism:
    """The rows of a scene as expressions of poses alone.

    Parameters
    ----------
    packed, bodies, constraints, poses
        Of the program; constraints in the order in which they are packed.
    """

    def __init__(self, packed: Packed, bodies: Sequence[Body], constraints: Sequence[object], poses: Poses) -> None:
        self._packed, self._poses = packed, poses
        self._places: Mapping[int, int] = {id(body): k for k, body in enumerate(bodies)}
        self._constraints = constraints
        self._moving = [k for k, body in enumerate(bodies) if not body.fixed]

    def value(self, term: Dexterity) -> ca.MX:
        """The measure, in the user's units.

        Raises
        ------
        InputError
            A contact holds the mechanism, or singular values of more than three velocities are asked for alone.
        """
        task, scale = term.tip_task, self._packed.scale
        rows = self._held(self._packed.row_numbers.that_hold(task))
        inputs = [self._coordinate(freedom.coordinate) for freedom in task.inputs]
        a, b = self._by_twists(ca.vertcat(ca.MX(0, 1), *rows)), self._by_twists(ca.vertcat(*inputs))
        m, n, k = a.size1(), a.size2(), b.size1()
        system = ca.blockcat(
            [
                [-ca.MX.eye(m), a, ca.MX(m, k)],
                [a.T, REST * ca.MX.eye(n), b.T],
                [ca.MX(k, m), b, ca.MX(k, k)],
            ]
        )
        right = ca.DM(np.vstack([np.zeros((m + n, k)), np.eye(k)]))
        rates = ca.solve(ca.densify(system), right, "lapacklu")[m : m + n, :]
        numbers = dexterity_numbers(term, 1.0, scale, [])
        linear, angular, direction = numbers[4], numbers[5], numbers[6 : 6 + task.rows]
        factors = [1.0 if freedom.coordinate.is_angle else 1.0 / scale for freedom in task.inputs]
        velocity = self._velocity(self._places[id(task.tip.body)], task.origin, linear, angular)
        counted = [i for i in range(6) if task.bits >> i & 1]
        jacobian = velocity[counted, :] @ rates @ ca.diag(ca.DM(factors))
        return _measure(term.measure, jacobian, direction)

    def _held(self, rows: Sequence[int]) -> list[ca.MX]:
        """The rows of these numbers."""
        packed, found = self._packed, []
        for r in rows:
            item = self._constraints[packed.owners[r]]
            at = int(np.flatnonzero(packed.spans[packed.owners[r]] == r)[0])
            if isinstance(item, RowConstraint):
                equation = item.equations[at]
                unit = 1.0 if equation.terms[0][1].is_angle else packed.scale
                parts = [
                    factor * (1.0 if one.is_angle else packed.scale) / unit * self._coordinate(one)
                    for factor, one in equation.terms
                ]
                found.append(sum(parts[1:], parts[0]))
            elif isinstance(item, Expression):
                found.append(self._poses.value(item, [self._places[id(body)] for body in item.bodies])[at] / item.scale)
            else:
                raise InputError(
                    f"constraint {item!r} holds the mechanism of a Dexterity; "
                    "expected what the reference solver takes there: joints, couplings and expressions"
                )
        return found

    def _coordinate(self, one: Coordinate) -> ca.MX:
        """A coordinate, lengths over the scene's size; angles on any turn."""
        pair = one.frames
        places = (self._places[id(pair.frame_a.body)], self._places[id(pair.frame_b.body)])
        frames = RowFrames.of(one, places, self._poses)
        if one.kind in (TURN, AZIMUTH):
            sine, cosine = frames.parts_of_turn(one)
            return ca.atan2(sine, cosine)
        if one.kind == ANGLE:
            return ca.acos(frames.cosine)
        if one.kind == DISTANCE:
            return ca.norm_2(frames.apart)
        if one.kind == RADIUS:
            return ca.norm_2(frames.across)
        if one.kind == SWING:
            return ca.sqrt(2 / (1 + frames.cosine)) * ca.dot(frames.a[:, one.component], frames.b[:, 2])
        return frames.linear(one)

    def _by_twists(self, values: ca.MX) -> ca.MX:
        """The Jacobian of values in the twists of the moving bodies: of a quaternion, de = (0, w) e / 2."""
        columns = []
        for k in self._moving:
            pose = self._poses.poses[k]
            slopes = ca.jacobian(values, pose)
            w, u = pose[3], pose[4:]
            turn = 0.5 * ca.vertcat(-u.T, w * ca.MX.eye(3) - ca.skew(u))
            columns += [slopes[:, :3], slopes[:, 3:] @ turn]
        return ca.horzcat(*columns)

    def _velocity(self, body: int, origin: np.ndarray, linear: float, angular: float) -> ca.MX:
        """The end effector's velocity (6, n) by the twists of the moving bodies."""
        columns = ca.MX(6, 6 * len(self._moving))
        if body in self._moving:
            at = 6 * self._moving.index(body)
            arm = self._poses.turns[body] @ (origin / self._packed.scale)
            columns[:3, at : at + 3] = linear * ca.MX.eye(3)
            columns[:3, at + 3 : at + 6] = -linear * ca.skew(arm)
            columns[3:, at + 3 : at + 6] = angular * ca.MX.eye(3)
        return columns


def _measure(name: str, jacobian: ca.MX, direction: Sequence[float]) -> ca.MX:
    """A measure of a Jacobian, as `Dexterity` defines it."""
    if name == "force_transmission":
        return 1.0 / ca.norm_2(jacobian.T @ ca.DM(direction))
    rows, columns = jacobian.shape
    gram = jacobian @ jacobian.T if rows <= columns else jacobian.T @ jacobian
    count = min(rows, columns)
    if name == "manipulability":
        return ca.sqrt(ca.det(gram))
    if name == "isotropy":
        return ca.det(gram) ** (1.0 / count) / (ca.trace(gram) / count)
    low, high = _ends(gram, count)
    return ca.sqrt(low) if name == "smallest_singular_value" else ca.sqrt(low / high)


def _ends(gram: ca.MX, count: int) -> tuple[ca.MX, ca.MX]:
    """The least and the greatest eigenvalue of a symmetric matrix of up to three rows, in closed form."""
    if count == 1:
        return gram, gram
    mean = ca.trace(gram) / count
    if count == 2:
        half = ca.sqrt(0.25 * (gram[0, 0] - gram[1, 1]) ** 2 + gram[0, 1] ** 2)
        return mean - half, mean + half
    if count > 3:
        raise InputError(
            f"a Dexterity asks for single ones of {count} singular values; "
            "expected three at most, which is what the reference solver takes"
        )
    # Eigenvalues of three rows by the angle of their characteristic polynomial.
    rest = gram - mean * ca.MX.eye(3)
    spread = ca.sqrt(ca.sumsqr(rest) / 6.0)
    angle = ca.acos(ca.det(rest) / (2.0 * spread**3)) / 3.0
    return mean + 2.0 * spread * ca.cos(angle + 2.0 * np.pi / 3.0), mean + 2.0 * spread * ca.cos(angle)
