"""How the boundary of a workspace moves with numbers of its scene, and what that adds to the area or volume.

At a place x of the boundary the tip was drawn to a target m outside, and |m - x|^2 is the least that the objective of
that solve can be. By the envelope theorem its derivative by a parameter is that of the objective and the rows with the
pose held; so that of the distance d = |m - x| is known, and the boundary comes nearer by -dd/dp along its normal. The
content changes by the integral of that over the boundary.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.renumbered import have_same_numbers
from assembly.constraints.program.contact import TOUCHING
from assembly.derivatives.columns import Frames, Problem, columns_of
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.probed import ProbedScene
from assembly.errors import InputError
from assembly.solve.second_order.dense import PUSHING
from assembly.solve.solution import Solution
from assembly.studies.reachable.drawn_tip import DrawnTip

__all__ = ["BoundaryStops", "boundary_integral"]

Array = NDArray[np.float64]
# Singular values of rows of length one that count as none, and what rows that repeat each other may ask for
# differently, over what is asked, as derivatives of solutions have them.
_DEPENDENT, _AGREE = 1e-7, 1e-7


class BoundaryStops(NamedTuple):
    """Places (m, 3) of the boundary, the targets (m, 3) the tip was drawn to, and the m solutions."""

    tip: DrawnTip
    places: Array
    targets: Array
    solutions: Sequence[Solution]


class _Slopes(NamedTuple):
    """What a unit of each parameter adds at a place with the pose held, and what holds there.

    Attributes
    ----------
    values : (p,)
        To the objective.
    rows : (m, p)
        To the rows that hold; zero in others.
    forces : (m,)
    jacobian, gradient : (m, n), (n,)
        Of the rows that hold, zero in others, and of the objective, in the twists of moving bodies.
    unit : float
        The objective's.
    """

    values: Array
    rows: Array
    forces: Array
    jacobian: Array
    gradient: Array
    unit: float


def boundary_integral(stops: BoundaryStops, shares: Array, parameters: Sequence[Parameter]) -> Array:
    """The derivatives (p,) of the content, with the lengths or areas (m,) that places stand for."""
    _check_numbers(stops)
    counted = np.flatnonzero(shares > 0.0)
    velocities = _normal_velocities(stops, counted, parameters)
    told = np.isfinite(velocities).all(axis=1)
    weights = shares[counted]
    if not told.any():
        raise InputError("no place of the boundary has a derivative by the parameters; expected another scene")
    # Places without a derivative move as the others do on average.
    result: Array = weights[told] @ velocities[told] * (weights.sum() / weights[told].sum())
    return result


def _normal_velocities(stops: BoundaryStops, which: NDArray[np.int64], parameters: Sequence[Parameter]) -> Array:
    """How fast the boundary goes outward at some of the places, a unit of each parameter, (k, p); NaN for unknown."""
    result = np.full((len(which), len(parameters)), np.nan)
    # Places with a contact at a fold have more rows than others.
    alike: dict[tuple[int, ...], list[tuple[int, _Slopes]]] = {}
    for place, k in enumerate(which.tolist()):
        slopes = _slopes_at(stops, k, parameters)
        alike.setdefault(slopes.jacobian.shape, []).append((place, slopes))
    lengths = np.linalg.norm(stops.targets[which] - stops.places[which], axis=1)
    for found in alike.values():
        each = [slopes for _, slopes in found]
        places = [place for place, _ in found]
        result[places] = -_envelopes(each) / (2.0 * lengths[places, None])
    return result


def _envelopes(each: Sequence[_Slopes]) -> Array:
    """Derivatives (k, p) of the least value of the objective at k places; NaN where rows contradict each other."""
    jacobians = np.stack([slopes.jacobian for slopes in each])
    rows = np.stack([slopes.rows for slopes in each])
    gradients, forces = (np.stack([getattr(slopes, name) for slopes in each]) for name in ("gradient", "forces"))
    lengths = np.sqrt((jacobians**2).sum(axis=2))
    scales = np.where(lengths > _DEPENDENT, 1.0 / np.maximum(lengths, _DEPENDENT), 0.0)
    left, values, right = np.linalg.svd(jacobians * scales[:, :, None], full_matrices=False)
    counts = values > _DEPENDENT
    # Multipliers of a solve balance the objective to what it ends with; the least change makes it exact.
    missing = gradients + (forces[:, None, :] @ jacobians)[:, 0]
    along = (right @ missing[:, :, None])[:, :, 0] * np.where(counts, 1.0 / np.where(counts, values, 1.0), 0.0)
    forces = forces - scales * (left @ along[:, :, None])[:, :, 0]
    asked = rows * np.where(scales > 0.0, scales, 1.0)[:, :, None]
    inside = left @ (counts[:, :, None] * (np.swapaxes(left, 1, 2) @ asked))
    sizes = np.abs(asked).max(axis=1)
    contradicts = np.abs(asked - inside).max(axis=1) > _AGREE * np.maximum(sizes, _AGREE)
    units = np.array([slopes.unit for slopes in each])[:, None]
    slopes = units * (np.stack([slopes.values for slopes in each]) + (forces[:, None, :] @ rows)[:, 0])
    return np.where(contradicts, np.nan, slopes)


def _check_numbers(stops: BoundaryStops) -> None:
    """Raise where the scene has other numbers than the first place was found with; all were found with these."""
    solution = stops.solutions[0]
    stops.tip.aim_at(stops.targets[0])
    packed = solution._packed
    is_same = have_same_numbers(packed, stops.tip.scene.packed())
    if is_same:
        packed.refresh()
        is_same = all(np.array_equal(a, b) for a, b in zip(packed.asked, solution._asked, strict=True))
    if not is_same:
        raise InputError("scene has other numbers now; expected those with which the workspace was found")


def _slopes_at(stops: BoundaryStops, k: int, parameters: Sequence[Parameter]) -> _Slopes:
    """What parameters add at a place, with its solution as it is."""
    solution, scene = stops.solutions[k], stops.tip.scene
    stops.tip.aim_at(stops.targets[k])
    packed, state = solution._packed, solution._state
    packed.refresh()
    bodies = scene.bodies
    turns = _rotations(state[: packed.contacts_at].reshape(-1, 7)[:, 3:])
    frames = Frames(packed, parameters, turns, bodies)
    probed = ProbedScene(packed, state, bodies, frames.each)
    given = state[packed.multipliers_at : packed.residuals_at]
    here = probed.evaluate(given)
    folds = np.zeros(len(here.residual) - packed.rows)
    forces = np.concatenate([given, folds])
    one_sided = np.concatenate([packed.one_sided, folds > 0.0])
    holds = ~one_sided | ((np.abs(here.residual) <= TOUCHING) & (forces < -PUSHING))
    forces = np.where(holds, forces, 0.0)
    problem = Problem(
        bodies, solution._scene.constraints, scene.objectives, packed, state, turns, forces, frames, probed, here
    )
    columns = columns_of(problem, parameters)
    moving = np.repeat([not body.fixed for body in bodies], 6)
    own = np.concatenate([moving, np.ones(len(here.gradient) - len(moving), dtype=bool)])
    return _Slopes(
        columns.values,
        np.where(holds[:, None], columns.rows, 0.0),
        forces,
        np.where(holds[:, None], here.jacobian[:, own], 0.0),
        here.gradient[own],
        packed.unit,
    )


def _rotations(quaternions: Array) -> Array:
    """Rotations (n, 3, 3) of quaternions (n, 4) of a solution; `rotation_matrix` takes one, and looks at it first."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1)[:, None]).T
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
