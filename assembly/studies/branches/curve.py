"""The equations of a branch in poses and a parameter, and points that satisfy them.

Where two-sided rows c(x, p) alone determine the pose x, the branch is c = 0. Where an objective decides as well, it is

    L_x = f_x + J^T y = 0,    c = 0    with the rows that hold, one-sided ones at their bound too, and y = W z.

The columns of W (m, r) are an orthonormal basis of the range of [c_x c_p]: rows that repeat each other, as those of a
planar linkage in space do, count once, c = 0 being W^T c = 0. From one point to the next W is carried along without a
turn of its own, so that determinants of W^T [c_x c_p] are continuous, and their signs mean something.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.earlier import taken_over
from assembly.constraints.packing.scene import Packed
from assembly.derivatives.columns import Columns, Frames, Problem, columns_of
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.probed import Evaluated, ProbedScene
from assembly.errors import InputError
from assembly.kinematics.pose import retract, rotation_matrix
from assembly.solve.dense.jacobian import rows_of
from assembly.solve.diagnosis.nearby_poses import moves
from assembly.studies.branches.slots import copy_slots

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Curve", "LostError", "Place", "Point"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# Singular values of rows over the largest that count as none, where a branch begins.
DEPENDENT = 1e-8
# A tangent of which less than this part is of poses and parameter: forces alone grow, and nothing moves.
STANDS = 1e-10
# Newton's method: steps at most; one shorter than EXACT is rounding, and one that is no shorter than the last one is
# so too where it is below ROUNDING.
ITERATIONS, EXACT, ROUNDING = 10, 2e-15, 1e-11


class LostError(Exception):
    """The equations have no value or no direction at a place.

    A contact lost its pair, the number cannot be had, or forces alone grow, as where bodies are squeezed.
    """


@dataclass(frozen=True, eq=False)
class Place:
    """A pose and a value of the parameter, of which nothing is known yet.

    Attributes
    ----------
    packed, state
        The scene as it was packed there, and the state of its loop: poses, tracked values.
    value : float
        Of the parameter.
    forces : (m,)
        Multipliers of all rows.
    """

    packed: Packed
    state: Array
    value: float
    forces: Array

    @property
    def q(self) -> Array:
        """Poses (n, 7)."""
        return self.state[: self.packed.contacts_at].reshape(-1, 7)


@dataclass(frozen=True, eq=False)
class Point:
    """A place with the equations there.

    Attributes
    ----------
    place : Place
    residual : (m,)
        Of all rows.
    equations, matrix : (k,), (k, k + 1)
        Columns: twists of moving bodies, z where an objective counts, the parameter over its unit.
    basis : (h, r)
        W, of the rows that hold.
    tangent : (k + 1,)
        Along the branch, of length one in twists and parameter.
    rates, force_rates : (m,)
        What residuals and multipliers grow by along the tangent.
    determinant : float
        Of the matrix bordered by the tangent, continuous along the branch but for a factor.
    """

    place: Place
    residual: Array
    equations: Array
    matrix: Array
    basis: Array
    tangent: Array
    rates: Array
    force_rates: Array
    determinant: float


class Curve:
    """The equations of a branch, with the rows that hold on it.

    Parameters
    ----------
    scene : Assembly
    parameter : Parameter
    unit : float
        What the parameter is measured in.
    tolerance : float

    Attributes
    ----------
    held : (m,) bool
        Rows that hold: two-sided ones, and one-sided ones at their bound.
    balances : bool
        Whether an objective decides as well.
    """

    def __init__(self, scene: Assembly, parameter: Parameter, unit: float, tolerance: float) -> None:
        packed = scene.packed()
        self.scene, self.parameter, self.unit, self.tolerance = scene, parameter, unit, tolerance
        self.bodies = scene.bodies
        self.moving = np.flatnonzero([not body.fixed for body in self.bodies])
        self.columns = (6 * self.moving[:, None] + np.arange(6)).ravel()
        self.scale, self.held, self.balances = packed.scale, ~packed.one_sided, False

    def with_rows(self, held: Flags, balances: bool) -> Curve:
        """The same with other rows that hold."""
        other = Curve(self.scene, self.parameter, self.unit, self.tolerance)
        other.scale, other.held, other.balances = self.scale, held, balances
        return other

    def point(self, place: Place, border: Array | None = None, basis: Array | None = None) -> Point:
        """The equations at a place; with the tangent whose product with a border (k + 1,) is positive, if it is given.

        Raises
        ------
        LostError
            They have no value there.
        """
        place, problem, columns = self._derived(place)
        basis = self._basis(problem.here, columns, place, basis)
        equations, matrix = self._system(problem, columns, place, basis)
        k = len(equations)
        if border is None or len(border) != k + 1:
            tangent = np.linalg.svd(matrix)[2][-1] if k else np.eye(matrix.shape[1])[-1]
        else:
            bordered = np.vstack([matrix, border])
            try:
                tangent = np.linalg.solve(bordered, np.append(np.zeros(k), 1.0))
            except np.linalg.LinAlgError:
                raise LostError from None
        length = float(np.linalg.norm(self.bordering(tangent)))
        if not length > STANDS * float(np.linalg.norm(tangent)):
            raise LostError
        tangent = tangent / length
        determinant = 0.0
        if matrix.shape[1] == k + 1:
            # Of more or fewer equations there is none, and no branch.
            sign, size = np.linalg.slogdet(np.vstack([matrix, self.bordering(tangent)]))
            determinant = float(sign * np.exp(size))
        n, forces = self.columns.size, np.zeros(len(self.held))
        slopes = problem.here.jacobian[:, self.columns] * self._stretch(place.packed)
        rates = slopes @ tangent[:n] + columns.rows[:, 0] * (self.unit * tangent[-1])
        if self.balances:
            forces[self.held] = basis @ tangent[n:-1]
        return Point(place, problem.here.residual, equations, matrix, basis, tangent, rates, forces, determinant)

    def bordering(self, step: Array) -> Array:
        """A step (k + 1,) without multipliers, which do not count in lengths."""
        border = step.copy()
        border[self.columns.size : -1] = 0.0
        return border

    def moved(self, place: Place, step: Array, basis: Array) -> Place:
        """A place moved by a step (k + 1,)."""
        n, state, forces = self.columns.size, place.state.copy(), place.forces
        q = state[: place.packed.contacts_at].reshape(-1, 7)
        twists = step[:n].reshape(-1, 6) * np.repeat([self.scale, 1.0], 3)
        q[self.moving] = retract(q[self.moving], twists)
        if self.balances:
            forces = forces.copy()
            forces[self.held] += basis @ step[n:-1]
        return Place(place.packed, state, place.value + float(step[-1]) * self.unit, forces)

    def corrected(self, origin: Point, step: Array, border: Array | None = None) -> Point | None:
        """The point of the branch in the plane through a place, a step from a point, across a border: by Newton.

        The border is the point's tangent by default. None where it is not found.
        """
        border = self.bordering(origin.tangent) if border is None else border
        place, before, k = self.moved(origin.place, step, origin.basis), np.inf, len(origin.equations)
        for _ in range(ITERATIONS):
            try:
                _, problem, columns = self._derived(place)
                equations, matrix = self._system(problem, columns, place, origin.basis)
                change = np.linalg.solve(np.vstack([matrix, border]), np.append(-equations, 0.0))
            except (LostError, np.linalg.LinAlgError):
                return None
            size = float(np.abs(self.bordering(change)).max())
            if not np.isfinite(size) or size > 1.0:
                return None
            if size <= EXACT or (size >= 0.5 * before and before <= ROUNDING):
                before = min(before, size)
                # Where poses go on along a line they are exact at once, and multipliers are not yet.
                pushes = change - self.bordering(change)
                if np.abs(pushes).max(initial=0.0) > ROUNDING * (1.0 + np.abs(place.forces).max()):
                    place = self.moved(place, pushes, origin.basis)
                break
            place, before = self.moved(place, change, origin.basis), size
        if before > ROUNDING and k:
            return None
        try:
            found = self.point(self._tracked(place), border, origin.basis)
        except LostError:
            return None
        off = np.abs(found.residual[self.held]).max(initial=0.0)
        return found if off <= self.tolerance else None

    def ahead(self, point: Point, along: float) -> Place:
        """A place so far along a point's tangent, or back."""
        return self._packed_at(self.moved(point.place, along * point.tangent, point.basis))

    def between(self, here: Place, there: Place) -> Array:
        """The twists (n,) that lead from a place to another one, lengths over the size."""
        return moves(here.q[self.moving], there.q[self.moving], self.scale).ravel()

    def objective(self, place: Place) -> float:
        """The objective at a place, over its unit."""
        return self._derived(place)[1].here.value

    def owner(self, row: int) -> str:
        """The name of the constraint that asks for a row."""
        scene = self.scene._scene
        assert scene is not None
        return scene.constraints[int(self.scene.packed().owners[row])].name

    def _packed_at(self, place: Place) -> Place:
        """The place with the scene as it is packed with its value."""
        try:
            self.parameter._number.put(place.value)
            packed = self.scene.packed()
            packed.refresh()
        except InputError:
            raise LostError from None
        if packed is place.packed:
            return replace(place, packed=packed, state=place.state)
        state = taken_over(place.packed, packed, place.state)
        if packed.keeps_apart:
            if packed.clearance_rows != place.packed.clearance_rows:
                raise LostError
            copy_slots(place.packed, place.state, packed, state)
        return replace(place, packed=packed, state=state)

    def _tracked(self, place: Place) -> Place:
        """The place with the pairs of contacts, and turns of angles, that are found there."""
        place = self._packed_at(place)
        try:
            return replace(place, state=rows_of(place.packed, place.state).state)
        except InputError:
            raise LostError from None

    def _derived(self, place: Place) -> tuple[Place, Problem, Columns]:
        """Rows, objective and what a unit of the parameter adds to them."""
        place = self._packed_at(place)
        if place.packed.drawn:
            # A last short step of a pair leaves its rates as they were before it, and the slopes of a place are made
            # of rates: with pairs that begin where they end these are those of the place.
            place = self._tracked(place)
        packed, state, scene = place.packed, place.state, self.scene._scene
        assert scene is not None
        turns = np.array([rotation_matrix(row[3:]) for row in place.q])
        try:
            frames = Frames(packed, [self.parameter], turns, self.bodies)
            probed = ProbedScene(packed, state, self.bodies, frames.each)
            here = probed.evaluate(place.forces)
        except InputError:
            raise LostError from None
        if len(here.residual) > packed.rows:
            # A contact at a fold has unknowns of its own, which come and go.
            raise LostError
        goals = self.scene.objectives
        problem = Problem(
            self.bodies, scene.constraints, goals, packed, state, turns, place.forces, frames, probed, here
        )
        # Between contacts a number of a body may change nothing.
        return place, problem, columns_of(problem, [self.parameter], may_be_idle=packed.keeps_apart)

    def _stretch(self, packed: Packed) -> Array:
        """What columns of twists are multiplied with: lengths are over the size that the scene had at first."""
        return np.tile(np.repeat([self.scale / packed.scale, 1.0], 3), len(self.moving))

    def _basis(self, here: Evaluated, columns: Columns, place: Place, before: Array | None) -> Array:
        """W at a place, with no turn of its own from W before."""
        rows = here.jacobian[np.ix_(self.held, self.columns)] * self._stretch(place.packed)
        both = np.hstack([rows, columns.rows[self.held] * self.unit])
        left, values, _ = np.linalg.svd(both, full_matrices=False)
        if before is None:
            return left[:, : int(np.count_nonzero(values > DEPENDENT * max(values.max(initial=0.0), DEPENDENT)))]
        left = left[:, : before.shape[1]]
        u, _, v = np.linalg.svd(left.T @ before)
        basis: Array = left @ (u @ v)
        return basis

    def _system(self, problem: Problem, columns: Columns, place: Place, basis: Array) -> tuple[Array, Array]:
        """Equations (k,) and their matrix (k, k + 1)."""
        here, stretch = problem.here, self._stretch(place.packed)
        rows = basis.T @ (here.jacobian[np.ix_(self.held, self.columns)] * stretch)
        by = basis.T @ columns.rows[self.held] * self.unit
        off = basis.T @ here.residual[self.held]
        if not self.balances:
            return off, np.hstack([rows, by])
        hessian = here.hessian[np.ix_(self.columns, self.columns)] * stretch * stretch[:, None]
        slopes = (here.gradient + place.forces @ here.jacobian)[self.columns] * stretch
        slopes_by = columns.slopes[self.columns] * stretch[:, None] * self.unit
        none = np.zeros((rows.shape[0], rows.shape[0]))
        matrix = np.vstack([np.hstack([hessian, rows.T, slopes_by]), np.hstack([rows, none, by])])
        return np.concatenate([slopes, off]), matrix

    def balanced(self, place: Place) -> Place:
        """The place with the least multipliers of the rows that hold that balance the objective."""
        place, problem, _ = self._derived(replace(place, forces=np.zeros(len(place.forces))))
        here, forces = problem.here, np.zeros(len(place.forces))
        rows = here.jacobian[np.ix_(self.held, self.columns)]
        forces[self.held] = -np.linalg.lstsq(rows.T, here.gradient[self.columns], rcond=DEPENDENT)[0]
        return replace(place, forces=forces)
