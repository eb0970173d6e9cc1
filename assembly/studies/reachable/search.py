"""The workspace of a tip: what it can reach from the start of a scene, or from several."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._progress import Progress, checked_progress, watched
from assembly._turn import in_turn
from assembly.assembly import Assembly
from assembly.errors import InputError, integer, items, positive, vector
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.kinematics.pose import pose_rows
from assembly.solve.solution import Solution
from assembly.studies.reachable.content import content
from assembly.studies.reachable.drawn_tip import DrawnTip
from assembly.studies.reachable.flood import Flood
from assembly.studies.reachable.grid import Grid, grid_of
from assembly.studies.reachable.result import Workspace

__all__ = ["workspace"]

Array = NDArray[np.float64]


def workspace(
    scene: Assembly,
    tip: Point | Frame | Body,
    *,
    cell: float,
    plane: Frame | str | None = None,
    starts: Iterable[ArrayLike | Solution] = (),
    within: tuple[ArrayLike, ArrayLike] | None = None,
    flips: int = 1,
    most: int = 200_000,
    progress: Progress = False,
) -> Workspace:
    """Find the positions that a tip can reach with all constraints, limits and clearances (paper 001, section 3.1).

    Space, or a plane, is divided into cells. From the start the tip is drawn to the centers of neighboring cells by
    warm solves, until it reaches no further cell. Where it stops on the way to a center is the boundary.

    Parameters
    ----------
    scene : Assembly
        Driven values hold; its objective is not used.
    tip : Point, Frame or Body
        A frame or body stands for its origin.
    cell : float
        Length of a cell's sides.
    plane : Frame of a fixed body, "xy", "yz" or "zx", optional
        Compute the area in the x-y plane of a frame, or in a plane of the world through the tip's start; by default the
        volume.
    starts : several (n, 7) or Solution, optional
        Further poses to start from, for positions that the tip reaches only with another assembly of the mechanism.
    within : ((3,), (3,)), optional
        Lower and upper corner of a box in the world to which the search is limited, for tips that can move without end.
        The tip starts in it; area and volume are those inside of it.
    flips : int
        How often the search may go on in another configuration where the mechanism is straight or folded; see Notes.
    most : int
        Cells after which the search ends with an error.
    progress : bool or callable
        True shows a progress bar; a function is called with the number of solves so far, twice, as the total is
        unknown.

    Returns
    -------
    Workspace

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used, a scene whose start cannot be solved, or more cells than `most`.

    Notes
    -----
    The error of the estimate is proportional to the square of the cell's size, in parts of the boundary's radius of
    curvature. A part of the set that is thinner than a cell may be missed, as may one that is reached only by a
    configuration that needs more flips or other starts: an arm has two for its elbow, and each joint like it takes one
    flip more. A tip that moves along a curve, or on a surface, reaches no cell and has no area or volume.
    """
    if not isinstance(scene, Assembly):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    point = _point(scene, tip)
    size = positive("cell", cell)
    integer("flips", flips, 0, 64)
    integer("most", most, 1, 10**7)
    checked_progress(progress)
    first = _solved(scene, None)
    grid = grid_of(plane, first.pose(point.body).apply(point.coordinates), size)
    region = _Region(grid, within)
    drawn = DrawnTip(scene, point, grid)
    flood = Flood(grid, drawn, 0.5 * _size(scene), flips, most)
    others = items("starts", starts, "poses or solutions")
    with watched(progress, "workspace", 0, "solve") as flood.advance:
        for start in (first, *(_solved(scene, each, f"starts[{k}]") for k, each in enumerate(others))):
            place = start.pose(point.body).apply(point.coordinates)
            stop = drawn.begin(grid.origin + (place - grid.origin) @ grid.axes.T @ grid.axes, start.q)
            flood.run(grid.cell(drawn.places(stop.poses)[0]), stop, region.holds)
    return _found(scene, flood, region)


def _found(scene: Assembly, flood: Flood, region: _Region) -> Workspace:
    """Cells, poses and boundary in order."""
    grid = flood.grid
    cells, poses = flood.reached.in_order()
    limits = [limit for at in sorted(flood.limits) for limit in flood.limits[at]]
    targets, places, normals = (np.array([limit[k] for limit in limits]).reshape(-1, 3) for k in range(3))
    return Workspace(
        cells=cells,
        poses=poses,
        boundary=places,
        normals=normals,
        content=content(grid, cells, places, normals, region.holds),
        undecided=len(flood.undecided),
        solves=flood.solves,
        grid=grid,
        scene=scene,
        _targets=targets,
        _stops=tuple(limit[3] for limit in limits),
        _drawn=flood.tip,
    )


@in_turn
def _size(scene: Assembly) -> float:
    return scene.packed().scale


def _point(scene: Assembly, tip: Point | Frame | Body) -> Point:
    if isinstance(tip, Body):
        tip = tip.frame()
    if isinstance(tip, Frame):
        tip = tip.body.point(*tip.origin.tolist())
    if not isinstance(tip, Point):
        raise TypeError(f"tip is {tip!r}; expected a point, a frame or a body")
    if not any(body is tip.body for body in scene.bodies):
        raise InputError(f"tip is a point of {tip.body.name!r}; expected one of a body of the scene")
    if tip.body.fixed:
        raise InputError(f"tip is a point of {tip.body.name!r}, which is fixed; expected one that moves")
    return tip


def _solved(scene: Assembly, start: ArrayLike | Solution | None, name: str = "the start") -> Solution:
    """Where constraints hold near a start."""
    if start is not None and not isinstance(start, Solution):
        start = pose_rows(name, start)
    still = Assembly(scene.bodies)
    still._take_constraints(scene.constraints)
    solution = still.solve(start.q if isinstance(start, Solution) else start)
    if not solution.success:
        raise InputError(f"scene has no pose near {name} at which all holds; {solution.message}")
    return solution


class _Region:
    """The box of the world in which it is looked."""

    def __init__(self, grid: Grid, box: tuple[ArrayLike, ArrayLike] | None) -> None:
        self._grid = grid
        self._box = None
        if box is not None:
            corners = items("within", box, "a lower and an upper corner")
            if len(corners) != 2:
                raise InputError(f"within is {box!r}; expected a lower and an upper corner")
            low, high = vector("within[0]", corners[0]), vector("within[1]", corners[1])
            if not (low < high).all():
                raise InputError(f"within is {box!r}; expected a lower and an upper corner")
            self._box = low, high

    def holds(self, places: Array) -> NDArray[np.bool_]:
        """Whether places (..., 3) are in it."""
        if self._box is None:
            return np.ones(places.shape[:-1], dtype=bool)
        inside = (self._box[0] <= places) & (places <= self._box[1])
        return np.asarray(inside.all(axis=-1))
