"""Forces: what constraints exert on bodies at a solution, and what joints of an arm must hold.

With L = objective + y . c stationary, the constraint with rows c and Jacobian J exerts on the bodies the wrenches

    W = -J^T y,

and the objective -grad; together they vanish on every moving body. They are forces where the objective is an
energy. In the coordinates (x, e) of a pose, e of any length, the rate of work W . twist reads W_c . (x', e') with

    W_c = [f, G^T t / |e|^2],    W = [f, G W_c,e / 4],

t the torque about the body's origin and G (`kinematics/pose.py`) both in world axes or both in body axes: paper 001,
eq. 5, which holds for the turn alone and not for the shift. Nothing works along e: e's length means nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays, read_only
from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint, Freedom
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Cylindrical, Prismatic, Revolute, Screw
from assembly.constraints.program.primitives import TURN
from assembly.errors import InputError, vector
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.kinematics.pose import angular_velocity_map, pose_rows, quaternion_rate_map, rotation_matrix
from assembly.solve.dense.jacobian import rows_of
from assembly.solve.dense.row_table import gradient_at
from assembly.solve.result import Result

if TYPE_CHECKING:
    from assembly.assembly import Assembly
    from assembly.solve.solution import Solution

__all__ = ["Wrench", "geometric_jacobian", "joint_torques", "tool_wrench", "wrenches"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Wrench(ReadOnlyArrays):
    """A force and a torque on a body.

    Parameters
    ----------
    force : (3,)
        World axes.
    torque : (3,)
        About the body's origin, world axes.
    q : (7,)
        The body's pose: x y z qw qx qy qz.

    Raises
    ------
    InputError
        Wrong shapes, numbers that are not finite, a quaternion far from unit.
    """

    force: Array
    torque: Array
    q: Array

    def __post_init__(self) -> None:
        for name in ("force", "torque"):
            value = vector(name, getattr(self, name))
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        row = pose_rows("q", [self.q], 1)[0]
        row.flags.writeable = False
        object.__setattr__(self, "q", row)

    @property
    def vector(self) -> Array:
        """Force, then torque about the body's origin, world axes, (6,), read-only: rate of work = vector . twist."""
        return read_only(np.concatenate([self.force, self.torque]))

    def at(self, point: ArrayLike) -> Array:
        """Force, then torque about a point of the world, world axes, (6,)."""
        arm = self.q[:3] - vector("point", point)
        return np.concatenate([self.force, self.torque + np.cross(arm, self.force)])

    def in_body_axes(self) -> Array:
        """Force, then torque about the body's origin, both in the axes of the body, (6,)."""
        turn = rotation_matrix(self.q[3:])
        return np.concatenate([self.force @ turn, self.torque @ turn])

    def configuration(self) -> Array:
        """Force in the coordinates of the pose, (7,): rate of work = configuration . q'.

        The force, then G^T t for the unit quaternion: the inverse of paper 001, eq. 5.
        """
        return np.concatenate([self.force, angular_velocity_map(self.q[3:]).T @ self.torque])

    @classmethod
    def from_configuration(cls, force: ArrayLike, q: ArrayLike) -> Self:
        """The wrench of a force in the coordinates of a pose, (7,): torque = G force[3:] / 4 (paper 001, eq. 5)."""
        row = pose_rows("q", [vector("q", q, 7)], 1)[0]
        given = vector("force", force, 7)
        return cls(given[:3], quaternion_rate_map(row[3:]).T @ given[3:], row)

    def __repr__(self) -> str:
        force, torque = (", ".join(f"{value + 0.0:.6g}" for value in part) for part in (self.force, self.torque))
        return f"Wrench(force=({force}), torque=({torque}))"


def wrenches(solution: Solution) -> dict[str, dict[str, Wrench]]:
    """What every constraint exerts on each of its bodies, by their names; `Solution.wrenches` keeps it.

    In the objective's units over lengths and radians. For flat faces that lie on each other, force and torque are those
    that balance the objective.

    Raises
    ------
    InputError
        A contact has no extremal pair at the solution.
    """
    packed, scene = solution._packed, solution._scene
    rows = rows_of(packed, solution._state)
    y = solution._state[packed.multipliers_at : packed.residuals_at]
    places, count = np.unique(rows.program_rows, return_counts=True)
    # Of a row's multiplier, least shares; what more there is of several rows is found by balance.
    square = np.bincount(rows.program_rows, rows.shares**2, packed.rows)
    z = y[rows.program_rows] * rows.shares / np.where(square > 0.0, square, 1.0)[rows.program_rows]
    several = places[count > 1]
    if several.size:
        z += _balancing(solution, rows.jacobian, rows.program_rows, rows.shares, several, z)
    found: dict[str, dict[str, Wrench]] = {}
    index = {id(body): k for k, body in enumerate(scene.bodies)}
    scales = packed.unit / np.repeat([packed.scale, 1.0], 3)
    for k, constraint in enumerate(scene.constraints):
        own = rows.owners == k
        push = -(z[own] @ rows.jacobian[own]).reshape(-1, 6) * scales
        found[constraint.name] = {
            body.name: Wrench(push[index[id(body)], :3], push[index[id(body)], 3:], solution.q[index[id(body)]])
            for body in bodies_of(constraint, scene.bodies)
        }
    return found


def bodies_of(constraint: Constraint, bodies: Sequence[Body]) -> Sequence[Body]:
    """The bodies that a constraint is on, among those of its scene."""
    if isinstance(constraint, Clearance) and constraint.is_of_all:
        return [body for body in bodies if body.faces]
    return constraint.bodies


def _balancing(
    solution: Solution,
    jacobian: Array,
    program_rows: NDArray[np.int64],
    shares: Array,
    several: NDArray[np.int64],
    z: Array,
) -> Array:
    """What multipliers of flat contacts lack for balance, in directions in which no share of a gap's multiplier is."""
    packed = solution._packed
    directions = np.zeros((0, len(z)))
    for row in several:
        own = np.flatnonzero(program_rows == row)
        across = np.zeros((len(own) - 1, len(z)))
        across[:, own] = np.linalg.svd(shares[own][None])[2][1:]
        directions = np.vstack([directions, across])
    gradient = np.empty(jacobian.shape[1])
    free = np.empty(packed.pair_rows, dtype=np.int64)
    gradient_at(
        packed.table_at(solution._state),
        solution._pool_as_solved(),
        solution._state,
        free,
        gradient,
        packed.end_effectors,
    )
    moving = np.repeat([not body.fixed for body in solution._scene.bodies], 6)
    lacking = -(gradient + z @ jacobian)[moving]
    amounts = np.linalg.lstsq((directions @ jacobian[:, moving]).T, lacking, rcond=1e-12)[0]
    extra: Array = amounts @ directions
    return extra


def tool_wrench(force: ArrayLike, arm: ArrayLike) -> Array:
    """Force and torque at a wrist, (6,), of a force at a finger's tip: [f, r x f] (paper 001, eq. 6).

    Parameters
    ----------
    force : (3,)
    arm : (3,)
        From the wrist to the tip.
    """
    f = vector("force", force)
    return np.concatenate([f, np.cross(vector("arm", arm), f)])


def geometric_jacobian(at: Solution | Assembly, inputs: Sequence[Joint | Freedom], tip: Point | Frame | Body) -> Array:
    """Velocity of an end effector for unit rates of the joints of an open chain, (6, k): paper 001, eq. 7.

    A column is [z x b, z] for a joint that turns about the axis z, b the vector from the axis to it, and [z, 0]
    for one that slides along z. Coordinates of the chain that are no inputs are held still.

    Parameters
    ----------
    at : Solution or Assembly
        Where the bodies are.
    inputs : sequence of Joint or Freedom
        Coordinates of `Revolute`, `Prismatic` and `Cylindrical` joints; of a joint its only one.
    tip : Point, Frame or Body
        A frame or body stands for its origin. World axes.

    Raises
    ------
    InputError, TypeError
        Inputs of other kinds or of another scene, or an input within a closed loop.
    """
    return _chain(at, inputs, tip)[0]


def joint_torques(
    at: Solution | Assembly, inputs: Sequence[Joint | Freedom], tip: Point | Frame | Body, wrench: Wrench | ArrayLike
) -> Array:
    """J^T W: torques and forces of the joints of an open chain that do the work of a wrench at its end effector, (k,).

    An arm at rest with these torques pushes with the wrench W; to carry a load use the negative of the load's wrench.
    Paper 001, eqs. 6 to 8.

    Parameters
    ----------
    at, inputs, tip
        As in `geometric_jacobian`.
    wrench : Wrench or (6,)
        Force, then torque about the end effector, world axes; `tool_wrench` makes one of a force beside it.
    """
    jacobian, point = _chain(at, inputs, tip)
    pushed = wrench.at(point) if isinstance(wrench, Wrench) else vector("wrench", wrench, 6)
    torques: Array = jacobian.T @ pushed
    return torques


def _chain(
    at: Solution | Assembly, inputs: Sequence[Joint | Freedom], tip: Point | Frame | Body
) -> tuple[Array, Array]:
    """The Jacobian of an end effector and where it is."""
    scene = at._scene if isinstance(at, Result) else at
    bodies = scene.bodies
    rows = {id(body): row for body, row in zip(bodies, at.q, strict=True)}
    if not isinstance(tip, (Point, Frame, Body)):
        raise TypeError(f"tip is {tip!r}; expected a point, a frame or a body")
    body, coordinates = _place(tip)
    if id(body) not in rows:
        raise InputError(f"tip is on body {body.name!r}; expected a body of this assembly")
    if isinstance(inputs, (Joint, Freedom)) or not isinstance(inputs, Sequence):
        raise TypeError(f"inputs is {inputs!r}; expected a sequence of joints or joint coordinates")
    point = _world(rows[id(body)], coordinates)
    columns = []
    for k, given in enumerate(inputs):
        freedom = _input(f"inputs[{k}]", given)
        pair = freedom.coordinate.frames
        if not any(freedom.joint is constraint for constraint in scene.constraints):
            raise InputError(f"inputs[{k}] is of joint {freedom.joint.name!r}; expected one of this assembly")
        side = _carried(f"inputs[{k}]", freedom.joint, body, scene.constraints)
        row = rows[id(pair.frame_a.body)]
        axis = rotation_matrix(row[3:]) @ pair.frame_a.axes[:, 2]
        if freedom.coordinate.kind == TURN:
            column = np.concatenate([np.cross(axis, point - _world(row, pair.frame_a.origin)), axis])
        else:
            column = np.concatenate([axis, np.zeros(3)])
        columns.append(side * column)
    return np.array(columns).reshape(-1, 6).T, point


def _place(tip: Point | Frame | Body) -> tuple[Body, Array]:
    """The body of an end effector, and its place in the body's coordinates."""
    if isinstance(tip, Body):
        return tip, np.zeros(3)
    return tip.body, tip.coordinates if isinstance(tip, Point) else tip.origin


def _world(row: Array, coordinates: Array) -> Array:
    point: Array = row[:3] + rotation_matrix(row[3:]) @ coordinates
    return point


def _input(name: str, given: Joint | Freedom) -> Freedom:
    """The coordinate that is meant; one that turns about the joint's axis or slides along it."""
    if not isinstance(given, (Joint, Freedom)):
        raise TypeError(f"{name} is {given!r}; expected a joint or one of its coordinates, joint.freedom(name)")
    if isinstance(given, Joint) and len(given.freedoms) != 1:
        known = ", ".join(map(repr, given.freedoms)) or "none"
        raise InputError(f"{name} is {given.name!r}; expected a joint with one coordinate; it has {known}")
    freedom = given.freedom() if isinstance(given, Joint) else given
    if not isinstance(freedom.joint, (Revolute, Prismatic, Cylindrical)) or isinstance(freedom.joint, Screw):
        raise InputError(f"{name} is {freedom!r}; expected a coordinate of a Revolute, Prismatic or Cylindrical joint")
    return freedom


def _carried(name: str, joint: Joint, tip: Body, constraints: Sequence[Constraint]) -> float:
    """1 where the joint moves the end effector on its side b, -1 on its side a, 0 where it does not move it."""
    if tip.fixed:
        return 0.0
    # All that is fixed is one body.
    ground = [body for constraint in constraints for body in constraint.bodies if body.fixed]
    reached: dict[int, Body] = {}
    waiting = [tip]
    while waiting:
        body = waiting.pop()
        if id(body) not in reached:
            reached[id(body)] = body
            waiting += ground if body.fixed else []
            for constraint in constraints:
                if constraint is not joint and any(body is other for other in constraint.bodies):
                    waiting += constraint.bodies
    on_a, on_b = (id(frame.body) in reached for frame in (joint.frame_a, joint.frame_b))
    if on_a and on_b:
        raise InputError(f"{name} is of joint {joint.name!r} in a closed loop; expected an open chain")
    grounded = any(body.fixed for body in reached.values())
    if grounded:
        return 0.0
    return 1.0 if on_b else -1.0 if on_a else 0.0
