"""A scene whose tip is drawn to places, with nothing else that it is to do: many places in one compiled call.

Nearly all of these solves are the loop alone, which goes on from a solution (`solve/straight.py`). Places that do not
wait for each other are rows of one call (`studies/batches`), and give the same bits as one after the other. What the
loop does not arrive at, and scenes with more than it in a solve, begin again with all there is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.objectives import PointDistance
from assembly.constraints.model.placements import PointOnPlane
from assembly.constraints.packing.scene import Packed
from assembly.derivatives.parameter import Parameter
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Point
from assembly.kinematics.pose import axes_quaternion
from assembly.solve.interruption import CTRL_C
from assembly.solve.loop.settings import OBJECTIVE, SCATTER, SOLVED, UNSURE
from assembly.solve.scene import Status
from assembly.solve.scene_settings import scene_settings
from assembly.solve.solution import Solution
from assembly.studies.batches.columns import writes_of
from assembly.studies.batches.solving import solve_slices
from assembly.studies.batches.starts import begun_states
from assembly.studies.reachable.grid import Grid

__all__ = ["DrawnTip", "Stop", "Stops"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# [cells] A tip that is nearer to the middle of a cell has reached it. The square of this is far above what a solve
# leaves of the objective.
_THERE = 1e-6


class Stop(NamedTuple):
    """Where the tip ends that was drawn to a place by a solve of its own.

    Attributes
    ----------
    solution : Solution
    poses : (n, 7)
        Of the bodies of the scene.
    has_ended : bool
        Whether no pose beside it brings the tip nearer.
    is_there : bool
    """

    solution: Solution
    poses: Array
    has_ended: bool
    is_there: bool


class Stops(NamedTuple):
    """Where the tip ends that was drawn to k places.

    Attributes
    ----------
    states : (k, s)
        Of rows of a call, up to the results of the loop; rows of solves of their own have them where others go on from
        them in a call.
    poses : (k, n, 7)
    has_ended, is_there : (k,) bool
        As of a `Stop`.
    goes_on : (k,) bool
        Whether a solve from a stop is a run of the loop and nothing else, if that arrives.
    solutions : (k,) of Solution or None
        What came of a solve of its own; rows of a call have none.
    """

    states: Array
    poses: Array
    has_ended: Flags
    is_there: Flags
    goes_on: Flags
    solutions: NDArray[np.object_]

    @classmethod
    def of(cls, count: int, size: int, bodies: int) -> Stops:
        """Room for so many, none of which has ended."""
        ended, there, on = np.zeros((3, count), dtype=bool)
        states, poses = np.zeros((count, size)), np.empty((count, bodies, 7))
        return cls(states, poses, ended, there, on, np.full(count, None, dtype=object))

    @property
    def is_left(self) -> Flags:
        """Whether a row of a call has not arrived, (k,), and needs a solve of its own."""
        left: Flags = ~self.has_ended & np.array([each is None for each in self.solutions], dtype=bool)
        return left

    def take(self, rows: Any) -> Stops:
        """Some of them."""
        return Stops(*(part[rows] for part in self))

    @staticmethod
    def joined(several: Sequence[Stops]) -> Stops:
        """All of several."""
        return Stops(*(np.concatenate(parts) for parts in zip(*several, strict=True)))


class DrawnTip:
    """A scene's bodies and constraints, with the tip's distance from a place as its objective.

    In a plane the tip is held in it by a row, which a planar mechanism has already.
    """

    def __init__(self, scene: Assembly, tip: Point, grid: Grid) -> None:
        self._tip = tip
        self._close = _THERE * grid.size
        self.bodies = len(scene.bodies)
        self._aim = PointDistance(tip, grid.origin)
        bodies = list(scene.bodies)
        plane = None
        if grid.dimension == 2:
            name = "plane of the workspace"
            while any(body.name == name for body in bodies):
                name += "'"
            x, y = grid.axes
            turn = axes_quaternion(np.column_stack([x, y, np.cross(x, y)]))
            plane = Body(name, None, grid.origin, turn, fixed=True)
            bodies.append(plane)
        self.scene = Assembly(bodies)
        self.scene._take_constraints(scene.constraints)
        if plane is not None:
            self.scene.constrain(PointOnPlane(tip, plane, f"tip in the {plane.name}"))
        self.scene.minimize(self._aim)
        self._place = tuple(Parameter(self._aim, "target", axis) for axis in "xyz")
        self._body = next(k for k, body in enumerate(bodies) if body is tip.body)

    def to(self, target: Array, start: Solution | Array) -> Stop:
        """The tip drawn to a place from a solution of this scene, or from poses (n, 7) of the bodies."""
        self.aim_at(target)
        solution = self.scene.solve(start if isinstance(start, Solution) else self._with_plane(start[None])[0])
        # The objective is the square of the distance.
        is_there = solution.success and solution.objective <= self._close**2
        return Stop(solution, solution.q[: self.bodies], solution.success, is_there)

    def begin(self, target: Array, start: Array) -> Stops:
        """The same from poses (n, 7), as stops to go on from."""
        packed = self.scene.packed()
        found = Stops.of(1, packed.memory_at if self._has_rows(packed) else 0, self.bodies)
        self._put(found, 0, packed, self.to(target, start))
        return found

    def all_to(self, targets: Array, starts: Stops, alone: bool = True) -> Stops:
        """The tip drawn to places (k, 3), each from a stop of its own.

        Rows of a call that do not arrive are solved `alone`, or left: that takes a hundred times as long.
        """
        packed = self.scene.packed()
        has_rows = self._has_rows(packed)
        found = Stops.of(len(targets), packed.memory_at if has_rows else 0, self.bodies)
        rows = np.flatnonzero(starts.goes_on) if has_rows else np.empty(0, dtype=np.int64)
        if rows.size:
            self._in_one_call(packed, targets, starts.states[rows], True, (rows, found))
        left = ~found.has_ended
        if not alone:
            left[rows] = False
        for k in np.flatnonzero(left).tolist():
            self._put(found, k, packed, self.to(targets[k], self.solution(starts, k)))
        return found

    def all_from(self, targets: Array, poses: Array) -> Stops:
        """The same from poses (k, n, 7) of the bodies."""
        packed = self.scene.packed()
        has_rows = self._has_rows(packed)
        found = Stops.of(len(targets), packed.memory_at if has_rows else 0, self.bodies)
        if packed.is_loop_alone and len(poses):
            packed.refresh()
            # Where the tip is drawn to has no part in the turn that an angle begins on.
            begun = begun_states(self.scene, packed, self._with_plane(poses), False, False)
            if begun is not None:
                self._in_one_call(packed, targets, begun, False, (np.arange(len(poses)), found))
        for k in np.flatnonzero(~found.has_ended).tolist():
            self._put(found, k, packed, self.to(targets[k], poses[k]))
        return found

    def solution(self, stops: Stops, k: int) -> Solution:
        """A stop as a solution: of a row of a call it is made here, with the numbers that its scene was aimed with."""
        own: Solution | None = stops.solutions[k]
        if own is not None:
            return own
        scene, packed = self.scene._scene, self.scene.packed()
        assert scene is not None
        state = packed.new_state()
        state[: packed.memory_at] = stops.states[k]
        return Solution(scene, packed, state, Status.SOLVED, 0.0, np.empty((0, 0)))

    def limit(self, target: Array, stops: Stops, k: int) -> Solution:
        """The solution of a stop on the way to a place, with what it was asked for."""
        if stops.solutions[k] is None:
            self.aim_at(target)
            self.scene.packed().refresh()
        return self.solution(stops, k)

    def aim_at(self, target: Array) -> None:
        """Have the objective draw the tip to a place (3,), without a solve."""
        # A middle of a cell needs no look, which takes as long as a step of a solve.
        self._aim._target = target

    def places(self, poses: Array) -> Array:
        """The places (k, 3) of the tip in the world, of poses (k, n, 7)."""
        rows = poses[:, self._body]
        w, u = rows[:, 3:4], rows[:, 4:]
        cross = np.cross(u, self._tip.coordinates)
        moved: Array = rows[:, :3] + self._tip.coordinates + 2.0 * (w * cross + np.cross(u, cross))
        return moved

    def _has_rows(self, packed: Packed) -> bool:
        """Whether solves may be rows of a call."""
        return packed.is_loop_alone and not packed._turned.coupled

    def _put(self, found: Stops, k: int, packed: Packed, stop: Stop) -> None:
        """Add what came of a solve of its own."""
        found.poses[k], found.has_ended[k], found.is_there[k] = stop.poses, stop.has_ended, stop.is_there
        found.solutions[k] = stop.solution
        (own, state), fit = stop.solution._ended, stop.solution._fit
        # Of rows that repeat each other and disagree, what they disagree by goes from solve to solve.
        if found.states.shape[1] and own is packed and (fit is None or fit.apart is None):
            found.goes_on[k] = True
            found.states[k] = state[: packed.memory_at]

    def _with_plane(self, poses: Array) -> Array:
        """Poses (k, n, 7) of the bodies, and that of the plane, which is a body of this scene alone."""
        extra = [np.broadcast_to(body.pose.q, (len(poses), 1, 7)) for body in self.scene.bodies[self.bodies :]]
        return np.concatenate([poses, *extra], axis=1)

    def _in_one_call(
        self, packed: Packed, targets: Array, begun: Array, warm: bool, out: tuple[NDArray[np.int64], Stops]
    ) -> None:
        """The same for some rows of targets, by the loop from states; those that arrive are written.

        Rows that go on from a solution are `warm`; others may be on other turns where bodies were gathered.
        """
        rows, found = out
        packed.refresh()
        writes = writes_of(packed, self._place, targets[rows], len(rows))
        assert writes is not None, "targets are numbers of the pool"
        # Rows that the last solve evaluated are left out: they are most of a state, and a step is as far as a cell, so
        # that to begin with what they say of the place before takes more steps than to begin without.
        ended = np.empty((len(begun), packed.memory_at))
        solve_slices(packed, scene_settings({}, CTRL_C, True, warm), writes, begun, ended)
        CTRL_C.is_over()
        results = ended[:, packed.results_at :]
        is_there = results[:, OBJECTIVE] * packed.unit <= self._close**2
        # No distance is less than none: a tip that is there needs no proof of a minimum, which an arm that can move
        # with its tip at rest does not have.
        arrived = (results[:, 0] == SOLVED) | ((results[:, 0] == UNSURE) & is_there)
        if not warm and packed.chooses_turns:
            arrived &= results[:, SCATTER] == 0.0
        own = rows[arrived]
        found.poses[own] = ended[arrived, : 7 * self.bodies].reshape(len(own), self.bodies, 7)
        found.is_there[own], found.has_ended[own] = is_there[arrived], True
        if found.states.shape[1]:
            found.states[own], found.goes_on[own] = ended[arrived], True
