"""A scene whose tip is drawn to points, one after the other, with no other objective."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.objectives import PointDistance
from assembly.constraints.model.placements import PointOnPlane
from assembly.kinematics.body import Body, Point
from assembly.kinematics.pose import axes_quaternion
from assembly.solve.solution import Solution
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
    solution : Solution
        Of the scene that draws it.
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

    def to(self, target: Array, start: Solution | Array) -> Stop:
        """The tip drawn to a place from a solution of this scene, or from poses (n, 7) of the bodies."""
        self.aim_at(target)
        if not isinstance(start, Solution):
            extra = [body.pose.q for body in self.scene.bodies[self._count :]]
            start = np.concatenate([start, *(row[None] for row in extra)])
        solution = self.scene.solve(start)
        # The objective is the square of the distance.
        is_there = solution.success and solution.objective <= self._close**2
        return Stop(solution, solution.q[: self._count], solution.success, is_there)

    def aim_at(self, target: Array) -> None:
        """Have the objective draw the tip to a place (3,), without a solve."""
        # A middle of a cell needs no look, which takes as long as a step of a solve.
        self._aim._target = target

    def place(self, stop: Stop) -> Array:
        """The place (3,) of the tip in the world."""
        return stop.solution.pose(self._tip.body).apply(self._tip.coordinates)
