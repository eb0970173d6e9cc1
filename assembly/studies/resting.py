"""Bodies that an objective draws onto faces that they fit: a plug into its seat, a lid onto its rim.

Faces that lie on each other act as joints as long as contact forces push. So where faces of bodies nearly fit, the
objective is minimized with joints in place of contacts: a solve of few steps with a fixed set of rows. At its end the
objective's slope has to be a sum of slopes of gaps with nonnegative multipliers, and the rows of gaps that push must
leave no motion that the joints forbid. Then it is a minimum with clearances as well: the objective increases along
every motion that opens a contact, and by the joints' solve along those that open none. Joints of faces that nothing
pushes onto each other are removed, and the objective is minimized again.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from assembly.constraints.model.clearance import Clearance
from assembly.solve.attempts.attempts import as_it_stands
from assembly.solve.attempts.postures import postures_from
from assembly.solve.clearance_proof import can_prove
from assembly.solve.interruption import Interruption
from assembly.solve.loop.settings import (
    ALLOWED_OVERLAP,
    DUAL,
    FEASIBILITY,
    FIT,
    GATHER,
    NEVER,
    OBJECTIVE,
    SOLVED,
    STATIONARITY,
    UNSURE,
)
from assembly.solve.scene import Status
from assembly.solve.second_order.dense import LocalModel, null_space
from assembly.solve.second_order.leave import Fit
from assembly.solve.solution import Solution
from assembly.solve.start_proof import is_for_proofs, prove_start, prove_way
from assembly.studies.fitting import Fitting, Side, fitting
from assembly.studies.pressed import BALANCED, PUSHES, Pressed, closed_slopes, pressed_start
from assembly.studies.seated import drop_farthest
from assembly.studies.standing_start import with_contacts
from assembly.studies.unhindered import Prove

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Rest", "beside_others", "resting", "resting_start", "rests_again"]

Array = NDArray[np.float64]
# What rounding alone may change of an objective, in parts of it.
ROUNDED = 1e-14


class Rest(NamedTuple):
    """Joints that hold bodies on what they rest on.

    Attributes
    ----------
    inner : Assembly
        The scene with joints in the place of clearances, after its other constraints.
    there : Solution
        Of that.
    sides : tuple of Side
        Of each joint.
    """

    inner: Assembly
    there: Solution
    sides: tuple[Side, ...]

    @property
    def owners(self) -> NDArray[np.int64]:
        """Of every row the number of its joint; below zero for rows of other constraints."""
        owners: NDArray[np.int64] = self.there._packed.owners - (len(self.inner.constraints) - len(self.sides))
        return owners

    def loose(self, model: LocalModel) -> set[int]:
        """The numbers of the joints of flat faces that stay off each other."""
        owners = self.owners
        return set(owners[(owners >= 0) & model.one_sided & ~model.touching].tolist())

    def is_as(self, other: Rest) -> bool:
        """Whether poses and forces are those of another one, to the bit."""
        packed, state = self.there._ended
        before, known = other.there._ended
        forces = slice(packed.multipliers_at, packed.residuals_at)
        same = packed is before and bool((self.there.q == other.there.q).all())
        return same and bool((state[forces] == known[forces]).all())


def resting(
    scene: Assembly,
    poses: Array,
    reference: Array,
    prove: Prove,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
) -> Solution | Rest | None:
    """The solution of a scene with clearances and an objective at which bodies rest on what they fit near poses (n, 7).

    None if they do not fit, or if a fit would have to pull; how they rest if they are not proven to be clear there.

    Parameters
    ----------
    scene : Assembly
    poses, reference : (n, 7)
        Where to begin, and what moves are measured from.
    prove : callable
        Proves the scene's pairs at a state, for a given overlap that counts as touching; None if that fails.
    settings : array
        Settings of the loop.
    starts : mapping of constraint name -> (4,), optional
    interruption : Interruption
    """
    if not _is_possible(scene):
        return None
    begin = perf_counter()
    fit = fitting(scene, poses, float(settings[ALLOWED_OVERLAP]))
    rest = _rest(scene, fit, poses, reference, settings, starts, interruption)
    return None if rest is None else _proven(scene, rest, prove, settings, starts, interruption, begin) or rest


def resting_start(
    scene: Assembly,
    q: Array,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
) -> Solution | None:
    """Poses q (n, 7) as the solution of a scene, if bodies rest there under its objective; else None.

    That takes one look by hulls of faces, a solve without steps with joints in the place of contacts, and the forces of
    closed gaps: no cells are made, and no contacts listed.
    """
    packed = scene.packed()
    if not _is_possible(scene):
        return None
    begin = perf_counter()
    stands = settings.copy()
    stands[STATIONARITY] = np.inf
    start = scene._start(packed, q, starts)
    code, state, *_ = as_it_stands(packed, interruption, stands, start.copy())
    if code not in (SOLVED, UNSURE) or state[packed.results_at + DUAL] <= settings[STATIONARITY]:
        # Rows do not hold, or nothing presses: rows alone tell more.
        return None
    fit = fitting(scene, q, float(settings[ALLOWED_OVERLAP]))
    if not fit.is_told:
        return None
    if not fit.sides:
        # What touches along lines alone has no joints.
        return pressed_start(scene, fit, start, settings, interruption)
    rest = _rest(scene, fit, q, q, settings, starts, interruption, may_move=False)
    prove = partial(prove_start, packed, scene.bodies)
    return None if rest is None else _proven(scene, rest, prove, settings, starts, interruption, begin)


def _rest(
    scene: Assembly,
    fit: Fitting,
    poses: Array,
    reference: Array,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
    may_move: bool = True,
) -> Rest | None:
    """How bodies rest on what they fit near poses (n, 7), or at these; None if they do not."""
    touching, held = float(settings[ALLOWED_OVERLAP]), list(fit.sides)
    settings = settings.copy()
    settings[GATHER] = NEVER
    while held and not interruption.is_over():
        inner = fit.scene_with(scene, held)
        there = inner._solved(settings, poses, starts, interruption, reference)
        if not may_move and not (there.success and _is_where(there.q, poses, scene.packed().scale, touching)):
            return None
        if not there.success:
            if there.status is Status.UNBOUNDED or not drop_farthest(held, there.violations):
                return None
            continue
        if _rises(there, touching):
            return None
        rest = Rest(inner, there, tuple(fit.sides[one] for one in held))
        with postures_from(there._packed, reference):
            model = LocalModel.at(there._packed, there._state)
        if model is None or len(model.jacobian) != there._packed.rows:
            return None
        # Flat faces that stay off each other are let go.
        loose = rest.loose(model)
        if loose:
            poses, held = there.q.copy(), [one for k, one in enumerate(held) if k not in loose]
            continue
        pushing = _pushing(closed_slopes(scene, there._packed, there.q, touching), model, rest)
        if pushing is None:
            return None
        if pushing.issuperset(rest.sides):
            return rest
        poses, held = there.q.copy(), [one for one in held if fit.sides[one] in pushing]
    return None


def rests_again(
    scene: Assembly,
    last: Solution,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
) -> Solution | Rest | None:
    """The solution of a scene with an objective that is found by the joints by which the last one was, or None.

    The contacts of the last solution need not be listed for that. Returns how bodies rest where that is not proven to
    be clear.
    """
    packed, rest = scene.packed(), last._rest
    if isinstance(rest, Pressed) and last.success and last._ended.packed is packed:
        return resting_start(scene, last.q.copy(), settings, starts, interruption)
    if not isinstance(rest, Rest) or not last.success or last._ended.packed is not packed or not _is_possible(scene):
        return None
    begin = perf_counter()
    there = rest.inner._solved(settings, rest.there, starts, interruption)
    if not there.success or interruption.is_over():
        return None
    now = Rest(rest.inner, there, rest.sides)
    if not now.is_as(rest):
        model = LocalModel.at(there._packed, there._state)
        if model is None or len(model.jacobian) != there._packed.rows or now.loose(model):
            return None
        pushing = _pushing(closed_slopes(scene, there._packed, there.q, float(settings[ALLOWED_OVERLAP])), model, now)
        if pushing is None or not pushing.issuperset(now.sides):
            return None
    prove = partial(prove_way, packed, scene.bodies, last.q)
    return _proven(scene, now, prove, settings, starts, interruption, begin) or now


def _is_possible(scene: Assembly) -> bool:
    """Whether proofs alone tell that the clearances of a scene hold."""
    packed = scene.packed()
    return scene._scene is not None and not packed.corners and can_prove(packed) and is_for_proofs(packed)


def beside_others(
    scene: Assembly,
    rest: Rest,
    poses: Array,
    reference: Array,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
) -> Solution | None:
    """The solution where bodies rest and others are in the way, as for a ball whose stem leans on its cap, or None.

    The joints hold those that rest, and clearances the others: rows of both faces of a ball in its socket would
    contradict each other until it is there. From there the scene itself is solved.
    """
    resting_pairs = [(scene.bodies[a], scene.bodies[b]) for a, b in {(a, b) for a, b, _ in rest.sides}]
    clearances = [item._without(resting_pairs) for item in scene.constraints if isinstance(item, Clearance)]
    if interruption.is_over() or not any(item.pairs(scene.bodies) for item in clearances):
        return None
    inner = type(scene)(scene.bodies)
    inner._take_constraints([*rest.inner.constraints, *clearances])
    inner._objectives = list(scene._objectives)
    beside = inner._solved(settings, poses, starts, interruption, reference)
    if not beside.success or interruption.is_over():
        return None
    solution = scene._solved(settings, beside.q, starts, interruption, reference)
    return solution if solution.success else None


def _is_where(q: Array, poses: Array, scale: float, touching: float) -> bool:
    """Whether poses (n, 7) are others up to `touching`: joints that hold up to rounding are moved by that."""
    off = np.abs(q - poses)
    return float(max(off[:, :3].max() / scale, off[:, 3:].max())) <= touching


def _rises(there: Solution, touching: float) -> bool:
    """Whether bodies fit at the start of a solve, up to `touching`, with a lower objective: then they stay there."""
    objective, violation = there.history[:, 0], there.history[:, 1]
    return len(objective) > 1 and bool(
        violation[0] <= touching and objective[-1] - objective[0] > ROUNDED * abs(objective[0])
    )


def _pushing(closed: tuple[Array, list[Side]], model: LocalModel, rest: Rest) -> set[Side] | None:
    """The pairs whose contacts push where joints replace them; None if the joints hold what contacts would not.

    Slopes of closed gaps and the pair of each are given, and a model of the joints' solve.
    """
    slopes, owners = closed
    if not len(slopes):
        return None
    of_rows = rest.owners
    is_joint = of_rows >= 0
    kept = null_space(model.jacobian[~is_joint & model.touching], len(model.gradient))
    if not kept.shape[1]:
        # Other constraints hold all: no contact has to. `nnls` returns memory as it finds it where there are no rows.
        return set()
    goal, slopes = kept.T @ model.gradient, slopes @ kept
    size = max(float(np.linalg.norm(goal)), PUSHES)
    forces, left = nnls(slopes.T, goal)
    if left > BALANCED * max(1.0, size):
        return None
    strong = forces * np.linalg.norm(slopes, axis=1) > PUSHES * size
    pushing = {owners[k] for k in np.flatnonzero(strong)}
    # Rows opposite to rows that push hold, too: both sides of a bore.
    loose = null_space(slopes[strong], slopes.shape[1])
    held = strong | (np.linalg.norm(slopes @ loose, axis=1) < PUSHES) | _opposed(slopes @ loose)
    free = null_space(slopes[held], slopes.shape[1])
    own = [rest.sides[k] in pushing for k in of_rows[is_joint]]
    forbidden = model.jacobian[is_joint][own] @ kept @ free
    return pushing if np.abs(forbidden).max(initial=0.0) < 1e-6 else None


def _opposed(slopes: Array) -> NDArray[np.bool_]:
    """Which rows no motion opens that closes none of the others: less than each is a sum of the others."""
    found = np.zeros(len(slopes), dtype=bool)
    for k, slope in enumerate(slopes):
        size = float(np.linalg.norm(slope))
        if size >= PUSHES and not found[k]:
            forces, left = nnls(slopes.T, -slope)
            if left < PUSHES * size:
                found[k] = True
                found |= forces * np.linalg.norm(slopes, axis=1) > PUSHES * size
    return found


def _proven(
    scene: Assembly,
    rest: Rest,
    prove: Prove,
    settings: Array,
    starts: Mapping[str, ArrayLike] | None,
    interruption: Interruption,
    begin: float,
) -> Solution | None:
    """The solution of a scene where bodies rest, if its rows hold there and it is proven that bodies are clear.

    Its time is that since `begin`.
    """
    packed, there = scene.packed(), rest.there
    settings = settings.copy()
    settings[STATIONARITY] = np.inf
    code, state, history, *_ = as_it_stands(packed, interruption, settings, scene._start(packed, there.q, starts))
    touching = float(settings[ALLOWED_OVERLAP])
    answers = prove(state, touching) if code in (SOLVED, UNSURE) else None
    if answers is None or interruption.is_over() or scene._scene is None:
        return None
    state[packed.results_at + DUAL] = there.stationarity
    if not scene.objectives:
        # The least move is that from where the solve began.
        state[packed.results_at + OBJECTIVE] = there.objective / packed.unit
    fit = Fit(float(settings[FIT]))
    solution = Solution(scene._scene, packed, state, Status.SOLVED, 0.0, history, there.second_order, fit)
    solution._touching, solution._clear = touching, answers
    solution._lists, solution._rest = partial(with_contacts, scene), rest
    # Samples replace a proof where faces lie on each other: there rows are checked as well.
    held = solution.proved or solution.feasibility <= float(settings[FEASIBILITY]) * packed.scale
    solution.seconds = perf_counter() - begin
    return solution if held else None
