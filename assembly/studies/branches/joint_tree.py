"""Poses that joints allow: a tree of joints that carries bodies, and the rows that close loops.

Of the joints between bodies those with the fewest coordinates are taken first, from fixed bodies on. What the tree does
not hold are rows: of joints that close loops, and of all other constraints that are rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, pi
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of, size_of
from assembly.constraints.model.constraint import Constraint, Coordinate, Freedom, RowConstraint
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Cylindrical, Fixed, Planar, Prismatic, Revolute, Screw, Spherical
from assembly.constraints.program.primitives import COINCIDENT, SLIDE, SWING, TURN
from assembly.kinematics.pose import rotation_matrix
from assembly.solve.measure import measure, standing
from assembly.studies.branches.joint_newton import (
    CLOSING_FRAMES,
    CLOSING_ROW,
    TREE_FRAMES,
    TREE_JOINT,
    close_loops,
)

if TYPE_CHECKING:
    from assembly.assembly import Assembly
    from assembly.kinematics.frame import Frame

__all__ = ["JointTree"]

Array = NDArray[np.float64]
# Twists in the moving frame, shift and turn, of what kinds of joints leave free, and the coordinates of these.
_SHIFTS, _TURNS = np.eye(6)[:3], np.eye(6)[3:]
_CARRIES: dict[type[Joint], tuple[tuple[str, ...], Array]] = {
    Fixed: ((), np.empty((0, 6))),
    Revolute: (("angle",), _TURNS[2:]),
    Prismatic: (("slide",), _SHIFTS[2:]),
    Screw: (("angle",), _TURNS[2:]),
    Cylindrical: (("angle", "slide"), np.array([_TURNS[2], _SHIFTS[2]])),
    Planar: (("x", "y", "angle"), np.array([_SHIFTS[0], _SHIFTS[1], _TURNS[2]])),
    Spherical: (("", "", ""), _TURNS),
}
# Kinds of coordinates that close loops.
_KINDS = (COINCIDENT, SLIDE, SWING, TURN)


@dataclass(frozen=True, eq=False)
class _Carried:
    """A joint of the tree: bodies by their numbers, and whether the child is the joint's first body."""

    joint: Joint
    parent: int
    child: int
    is_reversed: bool

    @property
    def frames(self) -> tuple[Frame, Frame]:
        """On the parent, and on the child."""
        pair = self.joint._frames
        return (pair.frame_b, pair.frame_a) if self.is_reversed else (pair.frame_a, pair.frame_b)


class JointTree:
    """A tree of a scene's joints.

    Parameters
    ----------
    scene : Assembly
    given : mapping of Freedom -> float, optional
        Values that coordinates are held at, in the user's unit, whatever they are driven to.

    Attributes
    ----------
    carried : list of int
        Bodies that the tree carries; others that move are where a start has them.
    loops_close : bool
        Whether Newton's method in the joints' coordinates knows all rows; else starts hold the tree's joints alone.
    """

    def __init__(self, scene: Assembly, given: Mapping[Freedom, float] | None = None) -> None:
        packed = scene.packed()
        assert scene._scene is not None
        self.bodies, self.scale, self.origin = scene.bodies, packed.scale, packed.reference
        self._places = {id(body): k for k, body in enumerate(self.bodies)}
        constraints = scene._scene.constraints
        self._given = dict(given or {})
        self._tree = self._grown(constraints)
        self.carried = [item.child for item in self._tree]
        loose = [k for k, body in enumerate(self.bodies) if not body.fixed and k not in set(self.carried)]
        self.loops_close = bool(self._tree) and not loose
        self._write_joints()
        self._write_rows(constraints)

    def _grown(self, constraints: tuple[Constraint, ...]) -> list[_Carried]:
        """Joints from fixed bodies on, those with few coordinates first."""
        joints = [item for item in constraints if type(item) in _CARRIES and isinstance(item, Joint)]
        joints.sort(key=lambda joint: len(_CARRIES[type(joint)][1]))
        known = {k for k, body in enumerate(self.bodies) if body.fixed}
        tree: list[_Carried] = []
        while True:
            for joint in joints:
                a, b = (self._places[id(body)] for body in joint.bodies)
                if (a in known) != (b in known):
                    tree.append(_Carried(joint, *((b, a, True) if b in known else (a, b, False))))
                    known.add(tree[-1].child)
                    break
            else:
                return tree

    def _pose(self, frame: Frame) -> Array:
        """A frame on its body, (12,), lengths over the size."""
        return np.concatenate([frame.axes.ravel(), frame.origin / self.scale])

    def _write_joints(self) -> None:
        count = len(self._tree)
        self._joints, self._frames = (
            np.zeros((count, size_of(TREE_JOINT)), np.int64),
            np.zeros((count, size_of(TREE_FRAMES))),
        )
        integers, doubles, first = rows_of(TREE_JOINT, self._joints), rows_of(TREE_FRAMES, self._frames), 0
        for k, item in enumerate(self._tree):
            joint = item.joint
            names, twists = _CARRIES[type(joint)]
            twists = twists.copy()
            if isinstance(joint, Screw):
                twists[0, 2] = joint.pitch / (2.0 * pi * self.scale)
            driven = [bool(name) and self._held(joint, name) is not None for name in names]
            if isinstance(joint, Screw):
                driven[0] = driven[0] or self._held(joint, "slide") is not None
            twists = twists[~np.array(driven, dtype=bool)]
            before, after = item.frames
            axes = after.axes.T
            integers[k] = item.parent, item.child, first, len(twists)
            doubles.before[k] = self._pose(before)
            doubles.after[k] = np.concatenate([axes.ravel(), -axes @ after.origin / self.scale])
            doubles.twists[k, : twists.size] = twists.ravel()
            first += len(twists)
        self.coordinates = first

    def _held(self, joint: Joint, name: str) -> float | None:
        """What a coordinate is held at, None where it is free."""
        freedom = joint.freedom(name)
        return self._given.get(freedom, freedom.value)

    def _write_rows(self, constraints: tuple[Constraint, ...]) -> None:
        """Rows that the tree does not hold."""
        held = {id(item.joint) for item in self._tree}
        rows: list[tuple[Coordinate, float]] = []
        for item in constraints:
            if not isinstance(item, RowConstraint):
                self.loops_close = False
                continue
            for equation in item.equations:
                (factor, coordinate), *others = equation.terms
                if equation.one_sided or (id(item) in held and self._is_carried(item, coordinate, others)):
                    continue
                if equation.source is not None and equation.source[0] in self._given:
                    continue
                if others or coordinate.kind not in _KINDS:
                    self.loops_close = False
                    continue
                rows.append((coordinate, equation.current() / factor))
        rows += [(item.coordinate, value) for item, value in self._given.items() if id(item.joint) not in held]
        integers, doubles = [], []
        for coordinate, value in rows:
            a, b = coordinate.frames.frame_a, coordinate.frames.frame_b
            integers.append([coordinate.kind, coordinate.component, *self._bodies_of(coordinate)])
            unit = 1.0 if coordinate.is_angle else self.scale
            doubles.append(np.concatenate([self._pose(a), self._pose(b), [value / unit]]))
        self._rows = np.array(integers, np.int64).reshape(-1, size_of(CLOSING_ROW))
        self._row_frames = np.array(doubles).reshape(-1, size_of(CLOSING_FRAMES))

    def _bodies_of(self, coordinate: Coordinate) -> tuple[int, int]:
        """The bodies of its frames, by their numbers."""
        return self._places[id(coordinate.frames.frame_a.body)], self._places[id(coordinate.frames.frame_b.body)]

    def holds(self, freedom: Freedom) -> bool:
        """Whether the tree, or a row that closes a loop, can hold a coordinate at a value."""
        if any(item.joint is freedom.joint for item in self._tree):
            return freedom.name in _CARRIES[type(freedom.joint)][0] or isinstance(freedom.joint, Screw)
        return self.loops_close and freedom.coordinate.kind in _KINDS

    @staticmethod
    def _is_carried(joint: Constraint, coordinate: Coordinate, others: list[tuple[float, Coordinate]]) -> bool:
        """Whether the motions of a joint of the tree hold one of its rows: all but values of a ball's angles."""
        return not isinstance(joint, Spherical) or coordinate.kind == COINCIDENT

    def drawn(self, rng: np.random.Generator, count: int) -> Array:
        """Motions (count, e, 12) of the tree's joints, coordinates within limits; any angle where there are none."""
        motions = np.zeros((count, len(self._tree), 12))
        motions[:, :, [0, 4, 8]] = 1.0
        for k, item in enumerate(self._tree):
            joint, motion = item.joint, motions[:, k]
            if isinstance(joint, Spherical):
                motion[:, :9] = _any_turns(rng, count)
                continue
            told = {name: self._values(rng, joint.freedom(name), count) for name in joint.freedoms}
            if isinstance(joint, Screw) and self._held(joint, "slide") is not None:
                told["angle"] = told["slide"] / self._lead(joint)
            self._move(item, told, motion)
        return motions

    def standing(self, q: Array) -> Array:
        """Motions (1, e, 12) of the tree's joints: coordinates that are held at their values, others as bodies stand at
        q (n, 7).
        """
        motions = np.zeros((1, len(self._tree), 12))
        motions[:, :, [0, 4, 8]] = 1.0
        for k, item in enumerate(self._tree):
            joint, motion = item.joint, motions[:, k]
            if isinstance(joint, Spherical):
                turns = [rotation_matrix(q[body, 3:]) for body in (item.parent, item.child)]
                before, after = (turn @ frame.axes for turn, frame in zip(turns, item.frames, strict=True))
                motion[:, :9] = (before.T @ after).ravel()
                continue
            told = {}
            for name in joint.freedoms:
                value, coordinate = self._held(joint, name), joint.freedom(name).coordinate
                if value is None:
                    value = measure(coordinate, standing(coordinate, q, self._bodies_of(coordinate)))
                told[name] = np.array([value / (1.0 if coordinate.is_angle else self.scale)])
            if isinstance(joint, Screw) and (
                self._held(joint, "angle") is None or joint.freedom("slide") in self._given
            ):
                told["angle"] = told["slide"] / self._lead(joint)
            self._move(item, told, motion)
        return motions

    def _lead(self, joint: Screw) -> float:
        """Travel a radian, over the size."""
        return joint.pitch / (2.0 * pi * self.scale)

    def _move(self, item: _Carried, told: dict[str, Array], motion: Array) -> None:
        """Write motions (s, 12) of a joint, a rotation and a shift, whose coordinates are told, (s,), over the size."""
        joint = item.joint
        if isinstance(joint, Screw):
            told["slide"] = told["angle"] * self._lead(joint)
        zero = np.zeros(len(motion))
        angle = told.get("angle", zero)
        height = joint.offset / self.scale if isinstance(joint, Planar) else told.get("slide", zero)
        c, s = np.cos(angle), np.sin(angle)
        motion[:, 0], motion[:, 1], motion[:, 3], motion[:, 4] = c, -s, s, c
        motion[:, 9], motion[:, 10], motion[:, 11] = told.get("x", zero), told.get("y", zero), height
        if item.is_reversed:
            turns = motion[:, :9].reshape(-1, 3, 3).transpose(0, 2, 1)
            motion[:, 9:] = -(turns @ motion[:, 9:, None])[:, :, 0]
            motion[:, :9] = turns.reshape(-1, 9)

    def _values(self, rng: np.random.Generator, freedom: Freedom, count: int) -> Array:
        """Values of a coordinate, lengths over the size."""
        is_angle = freedom.coordinate.is_angle
        unit, reach = (1.0, pi) if is_angle else (self.scale, 1.0)
        held = self._held(freedom.joint, freedom.name)
        if held is not None:
            return np.full(count, held / unit)
        low, high = freedom.lower / unit, freedom.upper / unit
        if not isfinite(low) or not isfinite(high) or (is_angle and high - low > 2.0 * pi):
            low = low if isfinite(low) else (high - 2.0 * reach if isfinite(high) else -reach)
            high = min(high, low + 2.0 * reach)
        return rng.uniform(low, high, count)

    def closed(self, motions: Array, q: Array, closes: bool = True) -> tuple[Array, Array]:
        """Poses (s, n, 7) that motions lead to where loops close, and what rows are off by there (s,).

        Where Newton's method does not know all rows, or `closes` is False, loops are left open. Bodies that no
        joint carries are at q (n, 7).
        """
        poses = np.zeros((len(motions), len(q), 12))
        poses[:, :, :9] = np.array([rotation_matrix(row[3:]).ravel() for row in q])
        poses[:, :, 9:] = (q[:, :3] - self.origin) / self.scale
        rows = self._rows if self.loops_close and closes else self._rows[:0]
        off = np.zeros(len(motions))
        close_loops(self._joints, self._frames, rows, self._row_frames, motions, poses, off)
        found = np.empty((len(motions), len(q), 7))
        found[:, :, :3] = poses[:, :, 9:] * self.scale + self.origin
        found[:, :, 3:] = _quaternions(poses[:, :, :9].reshape(-1, 3, 3)).reshape(len(motions), -1, 4)
        others = [k for k in range(len(q)) if k not in set(self.carried)]
        found[:, others] = q[others]
        return found, off


def _any_turns(rng: np.random.Generator, count: int) -> Array:
    """Rotations (count, 9), all as likely."""
    e = rng.normal(size=(count, 4))
    return np.array([rotation_matrix(row).ravel() for row in e])


def _quaternions(turns: Array) -> Array:
    """Unit quaternions (k, 4) of rotations (k, 3, 3): of the four that are multiples of it, the longest column of
    4 e e^T.
    """
    diagonal = turns[:, [0, 1, 2], [0, 1, 2]].T
    a, b, c = diagonal
    x, y, z = turns[:, 2, 1] - turns[:, 1, 2], turns[:, 0, 2] - turns[:, 2, 0], turns[:, 1, 0] - turns[:, 0, 1]
    xy, xz, yz = turns[:, 1, 0] + turns[:, 0, 1], turns[:, 0, 2] + turns[:, 2, 0], turns[:, 2, 1] + turns[:, 1, 2]
    outer = np.array(
        [
            [1.0 + a + b + c, x, y, z],
            [x, 1.0 + a - b - c, xy, xz],
            [y, xy, 1.0 - a + b - c, yz],
            [z, xz, yz, 1.0 - a - b + c],
        ]
    ).transpose(2, 0, 1)
    longest = outer[:, range(4), range(4)].argmax(axis=1)
    columns = outer[np.arange(len(turns)), longest]
    unit: Array = columns / np.linalg.norm(columns, axis=1, keepdims=True)
    return unit
