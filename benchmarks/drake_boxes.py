"""Drake's inverse kinematics, solved by SNOPT, on boxes that stand on one another; None where it is not installed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Drake"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drake:
    """A stack of unit boxes, the lowest welded to the world, each with its center of the bottom on the top before.

    The centers of a box's bottom and top are held on the axis of the box under it, the top above: five rows a mate, as
    of a hinge. There is no objective; a solve ends where the rows hold.
    """

    plant: Any
    bodies: Sequence[Any]
    problem: Any
    unknowns: Any
    solver: Any
    options: Any

    @classmethod
    def of(cls, count: int) -> Drake | None:
        """Such a stack of so many boxes."""
        try:
            multibody, tree = import_module("pydrake.multibody.plant"), import_module("pydrake.multibody.tree")
            kinematics = import_module("pydrake.multibody.inverse_kinematics")
            solvers = import_module("pydrake.solvers")
        except ImportError:
            return None
        plant = multibody.MultibodyPlant(0.0)
        inertia = tree.SpatialInertia.SolidBoxWithMass(1.0, 1.0, 1.0, 1.0)
        bodies = [plant.AddRigidBody(f"box {k}", inertia) for k in range(count)]
        plant.WeldFrames(plant.world_frame(), bodies[0].body_frame())
        plant.Finalize()
        stack = kinematics.InverseKinematics(plant)
        top = [0.0, 0.0, 0.5]
        for lower, upper in zip(bodies, bodies[1:], strict=False):
            frames = upper.body_frame(), lower.body_frame()
            stack.AddPositionConstraint(frames[0], [0.0, 0.0, -0.5], frames[1], top, top)
            stack.AddPositionConstraint(frames[0], top, frames[1], top, [0.0, 0.0, math.inf])
        return cls(plant, bodies, stack.prog(), stack.q(), solvers.SnoptSolver(), solvers.SolverOptions())

    def solve(self, start: Array, tolerance: float) -> tuple[bool, float, Array]:
        """Whether SNOPT says that it solved it, its seconds, and the poses, from a start (bodies, 7)."""
        first = np.zeros(self.plant.num_positions())
        places = [body.floating_positions_start() for body in self.bodies[1:]]
        for place, q in zip(places, start[1:], strict=True):
            first[place : place + 7] = (*q[3:], *q[:3])
        for name in ("Major feasibility tolerance", "Minor feasibility tolerance"):
            self.options.SetOption(self.solver.id(), name, tolerance)
        begin = perf_counter()
        result = self.solver.Solve(self.problem, first, self.options)
        seconds = perf_counter() - begin
        x = np.asarray(result.GetSolution(self.unknowns))
        q = start.copy()
        for body, place in enumerate(places, 1):
            q[body, :3], turn = x[place + 4 : place + 7], x[place : place + 4]
            q[body, 3:] = turn / np.linalg.norm(turn)
        return bool(result.is_success()), seconds, q
