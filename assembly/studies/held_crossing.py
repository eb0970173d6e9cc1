"""Bodies that cross where constraints hold them: a shaft that is driven into a bore it is too thick for.

From there no other start helps, and solves with the contradicting rows of a bore take seconds until they give up. So
such a start is recognized: constraints hold where they lead without clearances, and bodies cross there that these let
not move against each other, or a shaft in a bore, or a cone in its seat, that they let do no more than turn about its
axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cone, Cylinder
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.manifolds.closed_gaps import wall_manifolds, walls
from assembly.solve.attempts.attempts import as_it_stands
from assembly.solve.clearance_proof import answers_at, can_prove, proven_pairs
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import ALLOWED_OVERLAP, SOLVED, STATIONARITY, UNSURE
from assembly.solve.second_order.dense import LocalModel, null_space
from assembly.studies.parting import is_stuck

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["crosses_where_held"]

Array = NDArray[np.float64]
# What a motion of length one may move of what counts as held, in parts of the scene's size.
STILL = 1e-9
# How far a shaft may be thicker than its bore, in parts of its radius, and still counts as one in it.
THICKER = 0.1


def crosses_where_held(scene: Assembly, q: Array, settings: Array, interruption: Interruption) -> bool:
    """Whether bodies cross at poses q (n, 7), at which constraints hold, and these leave no way apart, however long."""
    packed = scene.packed()
    # Without other constraints bodies are free.
    if not can_prove(packed) or len(packed.clearances) == sum(item._is_asked for item in scene.constraints):
        return False
    inner = scene._part(False, False)
    settings, rows = settings.copy(), inner.packed()
    settings[STATIONARITY] = np.inf
    code, state, *_ = as_it_stands(rows, interruption, settings, inner._start(rows, q, None))
    model = LocalModel.at(rows, state) if code in (SOLVED, UNSURE) and not rows.contacts else None
    if model is None or interruption.is_over():
        return False
    free = null_space(model.jacobian[~model.one_sided], model.jacobian.shape[1])
    fixed, blocks = np.zeros((6, free.shape[1])), rows.unknown_blocks.tolist()
    twists = {body: free[6 * block :][:6] if block >= 0 else fixed for body, block in enumerate(blocks)}
    touching = float(settings[ALLOWED_OVERLAP]) * packed.scale
    answers = answers_at(packed, scene.bodies, q, touching)
    shapes, pairs, _ = proven_pairs(packed, scene.bodies)
    return any(
        _is_held((shapes[a], shapes[b]), (a, b), q, twists, (rows.scale, touching), is_stuck(answer, touching))
        for (a, b), answer in zip(pairs, answers, strict=True)
        if answer.verdict not in (Verdict.CLEAR, Verdict.TOUCHING)
    )


def _is_held(
    shapes: tuple[tuple[Face, ...], tuple[Face, ...]],
    pair: tuple[int, int],
    q: Array,
    twists: dict[int, Array],
    lengths: tuple[float, float],
    crosses: bool,
) -> bool:
    """Whether the free motions move the bodies of a pair against each other by no more than turns about its wall.

    The lengths are what unknowns are divided by, and what counts as touching. Where a look has not told that bodies
    cross, a shaft that is too thick for its bore does.
    """
    (a, b), (scale, touching) = pair, lengths

    def velocity(point: Array) -> Array:
        """Of what of the second body is at a point, seen from the first, for every free motion: (3, motions)."""
        found = np.zeros((3, twists[a].shape[1]))
        for body, sign in ((a, -1.0), (b, 1.0)):
            arm = (point - q[body, :3]) / scale
            found += sign * (twists[body][:3] + np.cross(twists[body][3:].T, arm).T)
        return found

    spin = twists[b][3:] - twists[a][3:]
    if crosses and max(np.abs(spin).max(initial=0.0), np.abs(velocity(q[b, :3])).max(initial=0.0)) < STILL:
        return True
    turn = rotation_matrix(q[a, 3:])
    seen = turn.T @ rotation_matrix(q[b, 3:]), (q[b, :3] - q[a, :3]) @ turn
    for form in _filled_walls(shapes, *seen, touching):
        axis = turn @ form.axis
        point = turn @ (form.apex if isinstance(form, Cone) else form.point) + q[a, :3]
        beside = spin - np.outer(axis, axis @ spin)
        if max(np.abs(beside).max(initial=0.0), np.abs(velocity(point)).max(initial=0.0)) < STILL:
            return True
    return False


def _filled_walls(
    shapes: tuple[tuple[Face, ...], tuple[Face, ...]], turn: Array, shift: Array, touching: float
) -> list[Cylinder | Cone]:
    """Cylinders and cones of the first body that are too tight, or too thick, for one of the second all around."""
    forms = [one.form for one in walls(shapes[0])[1] if isinstance(one.form, Cylinder | Cone)]
    reach = THICKER * max((_radius(form) for form in forms), default=0.0)
    return [forms[i] for (i, _), _ in wall_manifolds(shapes, turn, shift, (-reach, -touching))]


def _radius(form: Cylinder | Cone) -> float:
    return form.radius if isinstance(form, Cylinder) else max(form.heights) * float(np.tan(form.half_angle))
