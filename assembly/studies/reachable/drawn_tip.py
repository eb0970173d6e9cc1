"""A scene whose tip is drawn to places, with nothing else that it is to do: many places in one compiled call.

Nearly all of these solves are the loop alone, which goes on from a solution (`solve/straight.py`). Places that do not
wait for each other are rows of one call (`studies/batches`), and give the same bits as one after the other. What the
loop does not arrive at, and scenes with more than it in a solve, begin again with all there is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.objectives import PointDistance
from assembly.constraints.model.placements import PointOnPlane
from assembly.constraints.packing.scene import Packed
from assembly.derivatives.parameter import Parameter
from assembly.kinematics.body import Body, Point
from assembly.kinematics.pose import Pose, axes_quaternion
from assembly.solve.interruption import CTRL_C
from assembly.solve.loop.settings import OBJECTIVE, SCATTER, SOLVED
from assembly.solve.result import Ended
from assembly.solve.scene import Status
from assembly.solve.scene_settings import scene_settings
from assembly.solve.solution import Solution
from assembly.studies.batches.columns import writes_of
from assembly.studies.batches.solving import solve_slices
from assembly.studies.batches.starts import begun_states
from assembly.studies.reachable.grid import Grid

__all__ = ["DrawnTip", "Stop"]

Array = NDArray[np.float64]
# [cells] A tip that is nearer to the middle of a cell has reached it. The square of this is far above what a solve
# leaves of the objective.
_THERE = 1e-6


class Stop(NamedTuple):
    """Where the tip ends that was drawn to a place.

    Attributes
    ----------
    ended : Ended
        How the scene that draws it was packed, and the state at the end; of rows of a call without what follows its
        results.
    poses : (n, 7)
        Of the bodies of the scene.
    has_ended : bool
        Whether no pose beside it brings the tip nearer.
    is_there : bool
    solution : Solution or None
        What came of a solve of its own; rows of a call have none.
    """

    ended: Ended
    poses: Array
    has_ended: bool
    is_there: bool
    solution: Solution | None = None


class DrawnTip:
    """A scene's bodies and constraints, with the tip's distance from a place as its objective.

    In a plane the tip is held in it by a row, which a planar mechanism has already.
    """

    def __init__(self, scene: Assembly, tip: Point, grid: Grid) -> None:
        self._tip = tip
        self._close = _THERE * grid.size
        self._count = len(scene.bodies)
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
        return Stop(solution._ended, solution.q[: self._count], solution.success, is_there, solution)

    def all_to(self, targets: Array, starts: Sequence[Stop]) -> list[Stop]:
        """The tip drawn to places (k, 3), each from a stop of its own."""
        packed = self.scene.packed()
        rows = [k for k, start in enumerate(starts) if self._is_row(packed, start)]
        found: list[Stop | None] = [None] * len(starts)
        if rows:
            begun = np.array([starts[k].ended.state[: packed.memory_at] for k in rows])
            for k, stop in zip(rows, self._in_one_call(packed, targets[rows], begun, True), strict=True):
                found[k] = stop
        return [
            self.to(target, self.solution(start)) if stop is None else stop
            for target, start, stop in zip(targets, starts, found, strict=True)
        ]

    def all_from(self, targets: Array, poses: Array) -> list[Stop]:
        """The same from poses (k, n, 7) of the bodies."""
        packed = self.scene.packed()
        found: list[Stop | None] = [None] * len(poses)
        if packed.is_loop_alone and len(poses):
            packed.refresh()
            # Where the tip is drawn to has no part in the turn that an angle begins on.
            begun = begun_states(self.scene, packed, self._with_plane(poses), False, False)
            if begun is not None:
                found = self._in_one_call(packed, targets, begun, False)
        return [
            self.to(target, row) if stop is None else stop
            for target, row, stop in zip(targets, poses, found, strict=True)
        ]

    def solution(self, stop: Stop) -> Solution:
        """A stop as a solution: of a row of a call it is made here, with the numbers that its scene was aimed with."""
        if stop.solution is not None:
            return stop.solution
        scene, (packed, known) = self.scene._scene, stop.ended
        assert scene is not None
        state = packed.new_state()
        state[: len(known)] = known
        return Solution(scene, packed, state, Status.SOLVED, 0.0, np.empty((0, 0)))

    def limit(self, target: Array, stop: Stop) -> Solution:
        """The solution of a stop on the way to a place, with what it was asked for."""
        if stop.solution is None:
            self.aim_at(target)
            stop.ended.packed.refresh()
        return self.solution(stop)

    def aim_at(self, target: Array) -> None:
        """Have the objective draw the tip to a place (3,), without a solve."""
        # A middle of a cell needs no look, which takes as long as a step of a solve.
        self._aim._target = target

    def place(self, stop: Stop) -> Array:
        """The place (3,) of the tip in the world."""
        row = stop.poses[self._body]
        return Pose(row[:3], row[3:]).apply(self._tip.coordinates)

    def _is_row(self, packed: Packed, start: Stop) -> bool:
        """Whether a solve from a stop is a run of the loop and nothing else, if that arrives."""
        if not packed.is_loop_alone or packed._turned.coupled or start.ended.packed is not packed:
            return False
        return start.solution is None or start.solution._fit is None

    def _with_plane(self, poses: Array) -> Array:
        """Poses (k, n, 7) of the bodies, and that of the plane, which is a body of this scene alone."""
        extra = [np.broadcast_to(body.pose.q, (len(poses), 1, 7)) for body in self.scene.bodies[self._count :]]
        return np.concatenate([poses, *extra], axis=1)

    def _in_one_call(self, packed: Packed, targets: Array, begun: Array, warm: bool) -> list[Stop | None]:
        """The same for rows of the loop, from states; None where it did not arrive.

        Rows that go on from a solution are `warm`; others may be on other turns where bodies were gathered.
        """
        packed.refresh()
        writes = writes_of(packed, self._place, targets, len(targets))
        assert writes is not None, "targets are numbers of the pool"
        # Rows that the last solve evaluated are left out: they are most of a state, and a step is as far as a cell, so
        # that to begin with what they say of the place before takes more steps than to begin without.
        ended = np.empty((len(begun), packed.memory_at))
        solve_slices(packed, scene_settings({}, CTRL_C, True, warm), writes, begun, ended, 1)
        CTRL_C.is_over()
        poses = ended[:, : packed.contacts_at].reshape(len(ended), -1, 7)[:, : self._count].copy()
        results = ended[:, packed.results_at :]
        is_there = results[:, OBJECTIVE] * packed.unit <= self._close**2
        arrived = results[:, 0] == SOLVED
        if not warm and packed.chooses_turns:
            arrived &= results[:, SCATTER] == 0.0
        return [
            Stop(Ended(packed, state), rows, True, there) if holds else None
            for state, rows, there, holds in zip(ended, poses, is_there.tolist(), arrived.tolist(), strict=True)
        ]
