"""What was found of a workspace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from assembly._html import printed
from assembly._read_only import ReadOnlyArrays
from assembly.assembly import Assembly
from assembly.constraints.model.dexterity import Dexterity
from assembly.derivatives.implicit import several
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError
from assembly.kinematics.picture_mesh import PictureMesh
from assembly.solve.forces.end_effector import dexterity_value
from assembly.solve.solution import Solution
from assembly.studies.reachable.boundary import Boundary, boundary_shares
from assembly.studies.reachable.content import Content
from assembly.studies.reachable.drawn_tip import DrawnTip
from assembly.studies.reachable.grid import Grid
from assembly.studies.reachable.moving_boundary import BoundaryStops, boundary_integral
from assembly.studies.reachable.picture import cell_values, cells_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Workspace"]

Array = NDArray[np.float64]
# Reached cells from whose poses a place is tried, and [cells] how far it may be from the nearest one.
_TRIED, _FAR = 4, 2.0
# [cells] Places that are farther from the plane are not in it.
_FLAT = 1e-6


@dataclass(frozen=True, eq=False)
class Workspace(ReadOnlyArrays):
    """The positions that a tip can reach: cells whose centers it reaches, and points of the boundary.

    Attributes
    ----------
    cells : (k, d) of int
        Those reached, in order; two numbers in a plane, three in space.
    poses : (k, n, 7)
        Poses of all bodies, with the tip at the center of each cell.
    boundary, normals : (m, 3)
        Points at which the tip stopped, and the outward unit normals of the set there, in the world.
    undecided : int
        Cells for which a solve did not succeed; they count as not reached.
    solves : int
        How many there were.
    scene : Assembly
    """

    cells: NDArray[np.int64] = field(repr=False)
    poses: Array = field(repr=False)
    boundary: Array = field(repr=False)
    normals: Array = field(repr=False)
    content: Content
    undecided: int
    solves: int
    grid: Grid = field(repr=False)
    scene: Assembly = field(repr=False)
    _targets: Array = field(repr=False)
    _stops: tuple[Solution, ...] = field(repr=False)
    _drawn: DrawnTip = field(repr=False)

    @property
    def estimate(self) -> float:
        """Area or volume; cells that the boundary cuts count by their part in the set."""
        return self.content.estimate

    @property
    def inner(self) -> float:
        """Area or volume of the reached cells whose neighbors are all reached."""
        return self.content.inner

    @property
    def outer(self) -> float:
        """Area or volume of the reached cells and their neighbors."""
        return self.content.outer

    @property
    def centers(self) -> Array:
        """Centers of the reached cells, in the world, (k, 3)."""
        return self.grid.centers(self.cells)

    def _repr_html_(self) -> str:
        return printed(self)

    def __str__(self) -> str:
        what = "area" if self.grid.dimension == 2 else "volume"
        text = f"{what} {self.estimate:.6g}, between {self.inner:.6g} and {self.outer:.6g}; {len(self.cells)} cells"
        return text + (f", {self.undecided} undecided" if self.undecided else "")

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether the tip can reach points (..., 3) of the world, from poses at which it is near; shape (...).

        Each takes a solve. Points off the plane of an area are not in it.
        """
        try:
            places = np.asarray(points, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"points are {points!r}; expected coordinates (..., 3)") from None
        if places.ndim < 1 or places.shape[-1] != 3 or not np.isfinite(places).all():
            raise InputError(f"points are {points!r}; expected finite coordinates (..., 3)")
        result = np.zeros(places.shape[:-1], dtype=bool)
        if len(self.cells):
            tree = cKDTree(self.centers)
            for index in np.ndindex(result.shape):
                result[index] = self._holds(places[index], tree)
        return result

    def _holds(self, place: Array, tree: Any) -> bool:
        size, origin = self.grid.size, self.grid.origin
        flat = origin + (place - origin) @ self.grid.axes.T @ self.grid.axes
        if np.linalg.norm(place - flat) > _FLAT * size:
            return False
        reach = _FAR * size * np.sqrt(self.grid.dimension)
        distances, nearest = tree.query(place, k=min(_TRIED, len(self.cells)))
        return any(
            self._drawn.to(place, self.poses[k]).is_there
            for distance, k in zip(np.atleast_1d(distances), np.atleast_1d(nearest), strict=True)
            if distance <= reach
        )

    def gradient(self, parameters: Parameter | Sequence[Parameter]) -> Array:
        """How the area or volume changes with numbers of the scene, (p,): the boundary integral of its normal velocity.

        For each point of the boundary the distance from the tip's target is differentiated. Points whose distance has
        no derivative are taken to move as the others do on average.

        Raises
        ------
        InputError, TypeError
            A scene whose numbers are others than when the workspace was found, no cells, a parameter that enters
            nothing.
        """
        if not len(self.cells) or not len(self.boundary):
            raise InputError("the workspace has no cells, or no boundary; expected an area or a volume")
        boundary = Boundary.of(self.grid, self.boundary, self.normals, self._targets)
        shares = boundary_shares(self.grid, self.cells, boundary)
        stops = BoundaryStops(self._drawn, self.boundary, self._targets, self._stops)
        return boundary_integral(stops, shares, several("parameters", parameters, Parameter))

    def dexterity(self, measure: Dexterity) -> Array:
        """The measure of a `Dexterity` with the tip in each cell, at the pose that `poses` has, (k,).

        NaN where it is infinite, or the inputs do not determine the tip. It is that of one configuration; others may
        move the tip better or worse there.
        """
        if not isinstance(measure, Dexterity):
            raise TypeError(f"measure is {measure!r}; expected a Dexterity")
        for body in measure.bodies:
            if not any(body is other for other in self.scene.bodies):
                raise InputError(f"measure is of body {body.name!r}; expected bodies of the scene")
        result = np.full(len(self.cells), np.nan)
        for k, q in enumerate(self.poses):
            try:
                result[k] = dexterity_value(self.scene, measure, q)
            except InputError:  # at this pose
                continue
        return result

    def picture(self, values: ArrayLike | None = None) -> PictureMesh:
        """The cells in the world, for a body that shows them: `asm.Body("reach", picture=found.picture(values))`.

        Parameters
        ----------
        values : (k,), optional
            One number per cell, as of `dexterity`: dark for the least, bright for the greatest, gray for NaN.
        """
        if not len(self.cells):
            raise InputError("the workspace has no cells; expected some to draw")
        numbers = None if values is None else cell_values(values, len(self.cells))
        return cells_picture(self.grid, self.cells, numbers)

    def plot(self, values: ArrayLike | None = None, axes: Axes | None = None) -> Axes:
        """Draw an area by matplotlib, in the axes of its plane, with the boundary as dots.

        Parameters
        ----------
        values : (k,), optional
            One number per cell, as of `dexterity`; NaN is left out.
        axes : matplotlib.axes.Axes, optional
            Where to draw; new ones by default.

        Raises
        ------
        InputError
            Values of another shape, a volume, or no cells.
        ImportError
            Without matplotlib, of the extra `plot`.
        """
        from assembly.view.workspace_plot import plot_workspace

        return plot_workspace(self, None if values is None else cell_values(values, len(self.cells)), axes)
