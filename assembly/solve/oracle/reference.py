"""The same scene solved another way: one nonlinear program in full space, by CasADi and IPOPT.

It shares neither evaluators nor derivatives nor the loop with `Assembly.solve`, and so checks it. Variables are the
poses of moving bodies, the parameters of every contact and angles (`solve/oracle/rows.py`); with e a quaternion, f and
g points of the two surfaces, d = g - f and n the unit normal of f,

    minimize the objective   subject to   |e|^2 = 1   for every moving body,
    d.f_u = d.f_v = 0,   n.g_u = n.g_v = 0,   n.d = 0  (or >= 0)   for every contact,
    a row for every equation of a joint or a coupling, and for every value of an expression,

the extremal pair in the form that stays regular at contact (paper 001, section 3.2). Lengths are divided by the scene's
size; parameters run at about unit speed. Multipliers of the first four rows vanish at a solution, so that the last
one's is that of the gap in the loop's reduced problem.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from time import perf_counter
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import qr

from assembly._turn import in_turn
from assembly.constraints.model.constraint import Coordinate
from assembly.constraints.packing.scene import Packed
from assembly.errors import InputError
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import Body, BodyFace
from assembly.proximity.features.solid_contact import FEATURE_F, TRACK
from assembly.solve.diagnosis.residual_check import Claim, audit, is_extremal, twist_gradients
from assembly.solve.loop.settings import COUNT, CULPRIT, DUAL, IMPROPER, OBJECTIVE, VIOLATION
from assembly.solve.measure import Near, measure, standing
from assembly.solve.oracle.dexterity import Mechanism
from assembly.solve.oracle.rows import Poses, Rows
from assembly.solve.oracle.surfaces import Pair, Patch
from assembly.solve.oracle.terms import Terms
from assembly.solve.result import Iteration
from assembly.solve.scene import Status
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["ReferenceSolver", "solve"]

Array = NDArray[np.float64]
# Lengths are near one, so tolerances are absolute; what falls short of them is left to the check of the pose.
# With IPOPT's own regularization, 1e-8, redundant rows end in an error of the step or in long detours.
_IPOPT: dict[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-11,
    "constr_viol_tol": 1e-11,
    "acceptable_iter": 0,
    "bound_relax_factor": 0.0,
    "jacobian_regularization_value": 1e-10,
    "perturb_always_cd": "yes",
    "max_iter": 500,
}
# Steps toward the equations, the violation at which they end and the one that counts as held there, and a row's part
# across the others that counts as none; multipliers that tell of such rows.
_PROJECTIONS, _EXACT, _HELD, _DEPENDENT, _ENDLESS = 30, 1e-13, 1e-8, 1e-6, 1e5
_STATUSES = {
    "Solve_Succeeded": Status.SOLVED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
}


def _checked_arguments(scene: Any, ipopt: Any) -> dict[str, str | float]:
    """IPOPT's options as they are kept."""
    # Assembly itself lives above this module.
    if not callable(getattr(scene, "packed", None)):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    if ipopt is not None and not isinstance(ipopt, Mapping):
        raise TypeError(f"ipopt is {ipopt!r}; expected a mapping of IPOPT's options")
    options = dict(ipopt or {})
    for name, option in options.items():
        if not isinstance(name, str) or not isinstance(option, (str, int, float)):
            raise InputError(f"ipopt[{name!r}] is {option!r}; expected a name and a number or a string")
    return options


class ReferenceSolver:
    """An assembly as a nonlinear program, built once; starts, targets and fixed poses may change between solves.

    Parameters
    ----------
    scene : Assembly
    ipopt : mapping, optional
        Options of IPOPT, by its names, over those set here (an exact Hessian, tol 1e-11, max_iter 500, no output).

    Raises
    ------
    TypeError, InputError
        No assembly, no moving body, or an option that IPOPT does not take.
    """

    def __init__(self, scene: Assembly, ipopt: Mapping[str, str | float] | None = None) -> None:
        self.options = _checked_arguments(scene, ipopt)
        self._scene = scene
        self._packed = packed = scene.packed()
        self._moving = [k for k, body in enumerate(scene.bodies) if not body.fixed]
        self._fixed = [k for k, body in enumerate(scene.bodies) if body.fixed]
        patches: dict[NurbsSurface, Patch] = {}
        self._pairs: list[Pair] = []
        for contact, sides in zip(packed.contacts, packed.sides, strict=True):
            faces = _lone_faces(contact.name, sides)
            for side in faces:
                if side.face.surface not in patches:
                    patches[side.face.surface] = Patch(side.face.surface, packed.scale)
            f, g = (patches[side.face.surface] for side in faces)
            i, j = (scene.bodies.index(body) for body in contact.bodies)
            self._pairs.append(Pair(faces, (i, j), (f, g)))
        symbols = [ca.MX.sym("pose", 7) for _ in scene.bodies]
        poses = Poses(symbols, packed)
        self._rows = Rows(packed, scene.bodies, scene.constraints, poses)
        mechanism = Mechanism(packed, scene.bodies, scene.constraints, poses)
        self._terms = Terms(packed, scene.bodies, scene.objectives, poses, mechanism)
        # Of B-splines, and of what is solved for within, there are no scalar instructions.
        self._expands = not self._pairs and not packed.end_effectors
        self._build(poses)

    def _build(self, poses: Poses) -> None:
        rows, terms, free = self._rows, self._terms, [poses.poses[k] for k in self._moving]
        contacts = [ca.MX.sym("contact", 4) for _ in self._pairs]
        units = [ca.dot(pose[3:], pose[3:]) - 1 for pose in free]
        gaps = [ca.DM([0.0, 0.0, 0.0, 0.0, item.minimum / self._packed.scale]) for item in self._packed.contacts]
        extremal = [
            pair.rows(poses.poses, poses.turns, s) - gap
            for pair, s, gap in zip(self._pairs, contacts, gaps, strict=True)
        ]
        bodies, pairs, others = len(free), len(extremal), rows.rows.numel()
        # Rows of unit quaternions, five a contact, of which the last is the gap, the others, definitions.
        self._places = bodies + np.concatenate([4 + 5 * np.arange(pairs), 5 * pairs + np.arange(others)])
        g = ca.vertcat(*units, *extremal, rows.rows, rows.definitions)
        upper = np.zeros(g.numel())
        upper[self._places[self._packed.one_sided]] = np.inf
        # IPOPT refuses more equations than variables, and treats as many in a way of their own.
        self._split = np.cumsum([7 * bodies, 4 * pairs, rows.x.numel()])
        spare = ca.MX.sym("spare", max(0, int((upper == 0.0).sum()) + 1 - int(self._split[-1])))
        x = ca.vertcat(*free, *contacts, rows.x, spare)
        p = ca.vertcat(*(poses.poses[k] for k in self._fixed), rows.p, terms.p)
        options: dict[str, Any] = {
            "print_time": False,
            "show_eval_warnings": False,
            "expand": self._expands,
            "ipopt": _IPOPT | self.options,
        }
        program: dict[str, Any] = {"x": x, "p": p, "f": terms.value + 0.5 * ca.sumsqr(spare), "g": g}
        try:
            self._solver = ca.nlpsol("reference", "ipopt", program, options)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            raise InputError(f"ipopt is {self.options!r}; expected options of IPOPT ({reason})") from error
        judged = ca.vertcat(rows.rows, rows.definitions)
        forces = ca.MX.sym("forces", judged.numel())
        pulled = ca.gradient(terms.value + ca.dot(forces, judged), x)
        self._slopes = ca.Function("slopes", [x, p, forces], [terms.value, ca.gradient(terms.value, x), pulled])
        sides = [patch for pair in self._pairs for patch in pair.patches]
        nothing = np.full(7 * bodies, np.inf), np.full(spare.numel(), np.inf)
        self._bounds = {
            "lbx": np.concatenate([-nothing[0], *(patch.lower for patch in sides), rows.lower, -nothing[1]]),
            "ubx": np.concatenate([nothing[0], *(patch.upper for patch in sides), rows.upper, nothing[1]]),
            "lbg": np.zeros_like(upper),
            "ubg": upper,
        }

    def solve(
        self, q0: ArrayLike | Solution | None = None, *, starts: Mapping[str, ArrayLike] | None = None
    ) -> Solution:
        """As `solve` of this module; raises where the assembly was changed after this solver was made."""
        packed = self._scene.packed()
        if packed is not self._packed:
            raise InputError("scene was changed after this solver was made; expected a new ReferenceSolver")
        state = self._scene._start(packed, q0, starts)
        q = state[: packed.contacts_at].reshape(-1, 7).copy()
        parameters = state[packed.contacts_at : packed.angles_at].reshape(-1, TRACK)[:, :4]
        near = dict(zip(packed._angles, state[packed.angles].tolist(), strict=True))
        p = self._given(q)
        found = [
            pair.find(q, None if np.isnan(at).any() else at) for pair, at in zip(self._pairs, parameters, strict=True)
        ]
        parameters = np.array([pair.parameters for pair in found]).reshape(-1, 4)
        lost = [k for k, pair in enumerate(found) if not is_extremal(pair)]
        if lost:
            forces = np.zeros(self._bounds["lbg"].size)
            return self._checked(q, parameters, near, forces, Status.CONTACT_LOST, p, {"culprit": lost[0]})
        x0, bounds = self._without_redundant_rows(self._variables(self._rows.nudged(q), parameters, near), p)
        x, forces, status, figures = self._run(x0, bounds, p)
        if bounds is self._bounds and (status is not Status.SOLVED or np.abs(forces).max(initial=0.0) > _ENDLESS):
            # Perhaps there are dependent rows that only the end tells of.
            x0, bounds = self._without_redundant_rows(x, p)
            if bounds is not self._bounds:
                again = self._run(x0, bounds, p)
                if again[2] is Status.SOLVED:
                    x, forces, status, figures = again
        poses, contacts, angles, _ = np.split(x, self._split)
        rows = poses.reshape(-1, 7)
        q[self._moving, :3] = rows[:, :3] * packed.scale + packed.reference
        q[self._moving, 3:] = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
        for k, pair in enumerate(self._pairs):
            parameters[k] = pair.parameters(contacts[4 * k : 4 * k + 4])
        return self._checked(q, parameters, near | self._rows.angles(angles), forces, status, p, figures)

    def _run(self, x0: Array, bounds: dict[str, Array], p: Array) -> tuple[Array, Array, Status, dict[str, Any]]:
        """IPOPT from x0: variables, multipliers, what it says, and figures."""
        begin = perf_counter()
        result = self._solver(x0=x0, p=p, **bounds)
        seconds = perf_counter() - begin
        stats = self._solver.stats()
        status = _STATUSES.get(stats["return_status"], Status.STALLED)
        figures = {"seconds": seconds, "iterations": int(stats["iter_count"]), "history": _history(stats)}
        x, forces = (np.array(result[name]).ravel() for name in ("x", "lam_g"))
        if not (np.isfinite(x).all() and np.isfinite(forces).all()):
            return x0, np.zeros_like(forces), Status.STALLED, figures
        return x, forces, status, figures

    def _variables(self, q: Array, parameters: Array, near: Near) -> Array:
        """The program's variables of a configuration, the parameters of the contacts and the turns of angles."""
        rows = [self._terms.scaled(q[k]) for k in self._moving]
        rows += [pair.scaled(at) for pair, at in zip(self._pairs, parameters, strict=True)]
        spare = np.zeros(self._bounds["lbx"].size - self._split[-1])
        return np.concatenate([*rows, self._rows.start(q, near), spare])

    def _without_redundant_rows(self, x0: Array, p: Array) -> tuple[Array, dict[str, Array]]:
        """Start and bounds of the program, such that its equations are independent where they hold.

        Multipliers of dependent rows have no end in IPOPT. Where such rows are found at a point near x0 at which all
        equations hold, that point is the start and they are dropped; the audit looks at them again.
        """
        equal = np.flatnonzero(self._bounds["ubg"] == 0.0)
        rows = self._solver.get_function("nlp_jac_g")

        def evaluate(x: Array) -> tuple[Array, Array, float]:
            g, jacobian = (np.array(ca.densify(out)) for out in rows(x, p))
            return g.ravel()[equal], jacobian[equal], float(np.linalg.norm(g.ravel()[equal]))

        x, (g, jacobian, size) = x0, evaluate(x0)
        # Levenberg and Marquardt's steps, damped by |g|^2: they converge quadratically whatever the rank.
        for _ in range(_PROJECTIONS):
            if not _EXACT < size < np.inf:
                break
            damped = jacobian @ jacobian.T + max(min(size**2, 1.0), 1e-14) * np.eye(len(g))
            try:
                x = x - jacobian.T @ np.linalg.solve(damped, g)
            except np.linalg.LinAlgError:
                # IPOPT went to where slopes are so large that the damping is lost in them.
                break
            g, jacobian, size = evaluate(x)
        if len(g) == 0 or not size <= _HELD:
            return x0, self._bounds
        triangle, order = qr(jacobian.T, mode="r", pivoting=True)
        diagonal = np.abs(np.diag(triangle))
        rank = int((diagonal > _DEPENDENT * diagonal[0]).sum())
        if rank == len(g):
            return x0, self._bounds
        lower, upper = self._bounds["lbg"].copy(), self._bounds["ubg"].copy()
        lower[equal[order[rank:]]], upper[equal[order[rank:]]] = -np.inf, np.inf
        return x, self._bounds | {"lbg": lower, "ubg": upper}

    def _given(self, q: Array) -> Array:
        """The program's parameters: fixed poses, values of rows, targets and references."""
        fixed = [self._terms.scaled(q[k]) for k in self._fixed]
        return np.concatenate([*fixed, self._rows.values(), self._terms.values(q)])

    def _checked(
        self, q: Array, parameters: Array, near: Near, forces: Array, status: Status, p: Array, figures: dict[str, Any]
    ) -> Solution:
        """The solution, its status decided by what an audit finds at q."""
        packed, scene = self._packed, self._scene._scene
        assert scene is not None
        bodies, pairs = len(self._moving), len(self._pairs)
        x = self._variables(q, parameters, near)
        # Of contacts the audit has the wrenches.
        of_others = forces[bodies + 5 * pairs :]
        value, slopes, pulls = (np.array(out).ravel() for out in self._slopes(x, p, of_others))
        _, _, aside, _ = np.split(pulls, self._split)
        angles = self._rows.angles(np.split(x, self._split)[2])
        gradient, balance = (np.zeros((len(q), 6)) for _ in range(2))
        for twists, of in ((gradient, slopes), (balance, pulls)):
            with np.errstate(invalid="ignore"):  # of expressions without a value
                twists[self._moving] = twist_gradients(q[self._moving], of[: 7 * bodies].reshape(-1, 7))
        found = audit(
            self._pairs,
            lambda pose: self._rows.residuals(pose, near),
            packed.one_sided,
            self._moving,
            packed.scale,
            Claim(q, parameters, forces[self._places], gradient, balance, aside),
        )
        if status is not Status.CONTACT_LOST:
            if found.held and found.balanced and np.isfinite(value[0]):
                status = Status.SOLVED
            elif status is Status.SOLVED or (found.held and status is Status.INFEASIBLE):
                status = Status.STALLED
        state = packed.new_state()
        state[: packed.contacts_at] = q.ravel()
        tracked = state[packed.contacts_at : packed.angles_at].reshape(-1, TRACK)
        tracked[:, :4], tracked[:, FEATURE_F:] = found.parameters, 0.0
        state[packed.angles] = [angles[a] if a in angles else self._turned(a, q, near) for a in packed._angles]
        state[packed.multipliers_at : packed.residuals_at] = forces[self._places]
        state[packed.residuals_at : packed.results_at] = np.where(packed.lengths, packed.scale, 1.0) * found.residuals
        results = state[packed.results_at :]
        results[COUNT] = figures.get("iterations", 0)
        results[OBJECTIVE] = value[0] if np.isfinite(value[0]) else np.inf
        results[VIOLATION] = found.feasibility
        results[DUAL] = found.stationarity
        results[CULPRIT] = figures.get("culprit", -1)
        results[IMPROPER] = found.crossing and status is not Status.CONTACT_LOST
        history = figures.get("history", np.empty((0, len(Iteration.COLUMNS))))
        return Solution(scene, packed, state, status, figures.get("seconds", 0.0), history)

    def _turned(self, angle: Coordinate, q: Array, near: Near) -> float:
        """An angle that no row has, only an input of a dexterity."""
        pair = angle.frames
        places = (self._packed.body_places[pair.frame_a.body], self._packed.body_places[pair.frame_b.body])
        return measure(angle, standing(angle, q, places), near.get(angle, 0.0))


def _history(stats: Mapping[str, Any]) -> Array:
    """IPOPT's table in the columns of `Iteration`. It has no trust region: the last column is infinite."""
    table = stats.get("iterations")
    if table is None:  # no number at the start
        return np.empty((0, len(Iteration.COLUMNS)))
    names = ("obj", "inf_pr", "inf_du", "mu", "regularization_size", "alpha_pr")
    columns = [np.asarray(table[name], dtype=np.float64) for name in names]
    return np.column_stack([*columns, np.full_like(columns[0], np.inf)])


@lru_cache(maxsize=8)
def _built(scene: Assembly, packed: Packed, ipopt: tuple[tuple[str, Any], ...]) -> ReferenceSolver:
    """The solver of a scene as it is packed now; kept for the next solves."""
    return ReferenceSolver(scene, dict(ipopt))


@in_turn
def solve(
    scene: Assembly,
    q0: ArrayLike | Solution | None = None,
    *,
    starts: Mapping[str, ArrayLike] | None = None,
    ipopt: Mapping[str, str | float] | None = None,
) -> Solution:
    """Solve an assembly with CasADi and IPOPT, in full space.

    Slower than `Assembly.solve` and independent of it. The program is built at the first solve and kept; driven values,
    limits, offsets, targets and starts may change between solves.

    Parameters
    ----------
    scene : Assembly
    q0 : (n, 7) or Solution, optional
        Where to start: one row per body, or an earlier solution, whose contacts are taken up as well. The bodies' own
        poses by default.
    starts : mapping of constraint name -> (4,), optional
        Surface parameters near the pair that a contact is to track; for other contacts a global search finds the pair.
    ipopt : mapping, optional
        IPOPT's options by name, each a number or a string, such as {"max_iter": 100}.

    Returns
    -------
    Solution
        As of `Assembly.solve`. SOLVED where extremal pairs and coordinates found afresh hold every row to
        `FEASIBILITY` (1e-9), lengths over the scene's size, and the Lagrangian's gradient in twists, over one plus that
        of the objective, is at most `STATIONARITY` (1e-6). INFEASIBLE where IPOPT says so: the pose then has the least
        sum of violations of IPOPT's rows nearby. `seconds` is the time in IPOPT.

    Raises
    ------
    TypeError, InputError
        The message names the argument, its value and what was expected.

    Notes
    -----
    Of redundant rows, as in a planar four-bar in space, some are left to the final check: their multipliers are zero,
    and others carry what `Assembly.solve` distributes over all.

    Without an objective bodies stay close to where the solve starts. `Assembly.solve` first assembles scattered bodies
    and stays close to the poses found so; to compare, minimize a `Posture()`.

    At a pole of a surface one parameter moves nothing and rows lose their meaning: a contact there is reached to about
    1e-7 at best, or ends STALLED.
    """
    options = _checked_arguments(scene, ipopt)
    return _built(scene, scene.packed(), tuple(sorted(options.items()))).solve(q0, starts=starts)


def _lone_faces(name: str, sides: tuple[Body | BodyFace, Body | BodyFace]) -> tuple[BodyFace, BodyFace]:
    """The two faces of a contact, which are taken as whole surfaces here."""
    faces = [side if isinstance(side, BodyFace) else side.faces[0] for side in sides]
    for side in sides:
        if isinstance(side, Body) and len(side.faces) > 1:
            raise InputError(
                f"contact {name!r} is of body {side.name!r} with {len(side.faces)} faces; "
                "expected what the reference solver takes: contacts of single faces"
            )
    return faces[0], faces[1]
