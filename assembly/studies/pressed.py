"""Bodies that an objective presses onto what they touch, so that no motion is left: forces alone tell that they rest.

Contacts along lines stand for no joint, as those of flat faces and bores do (`resting.py`). But where the objective's
slope is a sum of slopes of closed gaps with multipliers that are not negative, and the rows that push leave no motion
at all, the objective increases to first order along every motion that gaps and constraints allow. Curvatures do not
matter then, and the start is a minimum.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from assembly.constraints.packing.scene import Packed
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.manifolds.closed_gaps import closed_gaps
from assembly.solve.attempts.attempts import as_it_stands
from assembly.solve.clearance_proof import proven_pairs
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import ALLOWED_OVERLAP, DUAL, FIT, SOLVED, STATIONARITY, UNSURE
from assembly.solve.scene import Status
from assembly.solve.second_order.classification import SecondOrder
from assembly.solve.second_order.dense import LocalModel, null_space
from assembly.solve.second_order.leave import Fit
from assembly.solve.solution import Solution
from assembly.solve.start_proof import prove_start
from assembly.studies.fitting import Fitting, Side
from assembly.studies.standing_start import with_contacts

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["BALANCED", "PUSHES", "Pressed", "closed_slopes", "pressed_start"]

Array = NDArray[np.float64]
# [of the objective's slope] What contact forces may leave of it: the joints' solve holds 1e-10 of a largest one of 1.
BALANCED = 1e-9
# A force that is stronger pushes, in parts of the objective's slope.
PUSHES = 1e-7


@dataclass(frozen=True)
class Pressed:
    """That bodies press on each other at a solution, by forces that leave no motion.

    Attributes
    ----------
    forces : tuple of float
        Of the closed gaps that push.
    """

    forces: tuple[float, ...]


def pressed_start(
    scene: Assembly, fit: Fitting, start: Array, settings: Array, interruption: Interruption
) -> Solution | None:
    """The start of a scene as its solution, if the objective presses bodies onto each other so that none can move.

    Parameters
    ----------
    scene : Assembly
    fit : Fitting
        Of the start; hulls of faces have told of all pairs there.
    start : array
        A state of the scene, whose rows hold.
    settings : array
        Settings of the loop.
    interruption : Interruption
    """
    begin, packed = perf_counter(), scene.packed()
    q = start[: packed.contacts_at].reshape(-1, 7)
    settings = settings.copy()
    settings[STATIONARITY] = np.inf
    forces = _forces(scene, fit, q, settings, interruption)
    if forces is None or scene._scene is None:
        return None
    code, state, history, *_ = as_it_stands(packed, interruption, settings, start.copy())
    touching = float(settings[ALLOWED_OVERLAP])
    answers = prove_start(packed, scene.bodies, state, touching) if code in (SOLVED, UNSURE) else None
    if answers is None or interruption.is_over():
        return None
    state[packed.results_at + DUAL] = forces[1]
    fitted = Fit(float(settings[FIT]))
    solution = Solution(scene._scene, packed, state, Status.SOLVED, 0.0, history, SecondOrder.MINIMUM, fitted)
    solution._touching, solution._clear = touching, answers
    solution._lists, solution._rest = partial(with_contacts, scene), forces[0]
    solution.seconds = perf_counter() - begin
    return solution


def _forces(
    scene: Assembly, fit: Fitting, q: Array, settings: Array, interruption: Interruption
) -> tuple[Pressed, float] | None:
    """The forces that hold bodies at poses (n, 7), and what they leave of the slope; None where a motion is left."""
    inner = fit.scene_with(scene, [])
    packed = inner.packed()
    code, state, *_ = as_it_stands(packed, interruption, settings, inner._start(packed, q, None))
    model = LocalModel.at(packed, state) if code in (SOLVED, UNSURE) else None
    if model is None or len(model.jacobian) != packed.rows:
        return None
    slopes, _ = closed_slopes(scene, packed, q, float(settings[ALLOWED_OVERLAP]), fit.near)
    # Limits that are reached push as gaps do.
    limits = model.one_sided & model.touching
    kept = null_space(model.jacobian[~model.one_sided], len(model.gradient))
    rows, goal = np.concatenate([slopes, model.jacobian[limits]]) @ kept, kept.T @ model.gradient
    size = float(np.linalg.norm(goal))
    if not len(rows) or not size > PUSHES:
        return None
    forces, left = nnls(rows.T, goal)
    strong = forces * np.linalg.norm(rows, axis=1) > PUSHES * size
    if left > BALANCED * max(1.0, size) or null_space(rows[strong], rows.shape[1]).shape[1]:
        return None
    return Pressed(tuple(forces[strong].tolist())), float(left)


def closed_slopes(
    scene: Assembly, packed: Packed, q: Array, touching: float, near: Container[tuple[int, int]] | None = None
) -> tuple[Array, list[Side]]:
    """Slopes of gaps that are closed at poses (n, 7), in the unknowns of a packed scene, and the pair of each.

    Gaps up to `touching`, in parts of the scene's size, count as closed. If it is known which pairs are `near`, only
    those are asked.
    """
    shapes, pairs, minimum = proven_pairs(scene.packed(), scene.bodies)
    within = touching * scene.packed().scale
    # Unknowns are numbered by what constraints are between bodies.
    column = {body: 6 * block for body, block in enumerate(packed.unknown_blocks.tolist()) if block >= 0}
    blocks: list[Array] = [np.empty((0, 6 * len(column)))]
    owners: list[Side] = []
    for (a, b), least in zip(pairs, minimum, strict=True):
        if near is not None and (a, b) not in near:
            continue
        turn = rotation_matrix(q[a, 3:])
        seen = turn.T @ rotation_matrix(q[b, 3:]), (q[b, :3] - q[a, :3]) @ turn
        normals, places, is_flat = closed_gaps((shapes[a], shapes[b]), *seen, (least - within, least + within))
        normals, places = normals @ turn.T, places @ turn.T + q[a, :3]
        block = np.zeros((len(normals), 6 * len(column)))
        for body, sign in ((a, -1.0), (b, 1.0)):
            if body in column:
                arms = (places - q[body, :3]) / packed.scale
                block[:, column[body] :][:, :6] = sign * np.hstack([normals, np.cross(arms, normals)])
        blocks.append(block)
        owners += [(a, b, bool(flat)) for flat in is_flat]
    return np.concatenate(blocks), owners
