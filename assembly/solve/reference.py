"""The same scene solved another way: one nonlinear program in full space, by CasADi and IPOPT.

It shares neither evaluators nor derivatives nor the loop with `Assembly.solve`, and so checks it. Variables are the
poses of moving bodies and the parameters of every contact; with e a quaternion, f and g points of the two surfaces,
d = g - f and n the unit normal of f,

    minimize the objective   subject to   |e|^2 = 1   for every moving body,
    d.f_u = d.f_v = 0,   n.g_u = n.g_v = 0,   n.d = 0  (or >= 0)   for every contact,

the extremal pair in the form that stays regular at contact (paper 001, section 3.2). Lengths are divided by the scene's
size; parameters run at about unit speed. Multipliers of the first four rows vanish at a solution, so that the last
one's is that of the gap in the loop's reduced problem.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from time import perf_counter
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.objectives import PointDistance, Posture
from assembly.constraints.packing import Packed
from assembly.errors import InputError
from assembly.geometry.surface import NurbsSurface
from assembly.kinematics.body import BodyFace
from assembly.solve.augmented_lagrangian import COUNT, CULPRIT, DUAL, IMPROPER, OBJECTIVE, RESULTS, VIOLATION
from assembly.solve.check import Sides, audit, is_extremal, twist_gradients
from assembly.solve.solution import Iteration, Solution, Status

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["ReferenceSolver", "solve", "spline_function"]

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
_STATUSES = {
    "Solve_Succeeded": Status.SOLVED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
}
# Samples a direction from which a surface's speed is taken.
_GRID = 17


def spline_function(surface: NurbsSurface) -> ca.Function:
    """(u, v) -> S, Su, Sv by CasADi's own B-splines on homogeneous coordinates, to be differentiated further.

    Closed directions wrap: u - period floor((u - low) / period), whose derivative is one, so nothing ends at the seam.
    """
    # The third derivatives of an exact Hessian want cubics: CasADi 3.8 frees memory twice on those of quadratics.
    raised = surface.elevate([max(3, degree) for degree in surface.degree])
    homogeneous = np.concatenate([raised.control_points * raised.weights[..., None], raised.weights[..., None]], axis=2)
    # CasADi counts the outputs fastest, then u, then v.
    coefficients = np.swapaxes(homogeneous, 0, 1).ravel()
    x = ca.MX.sym("x", 2)
    wrapped = []
    for k, (low, high) in enumerate(surface.domain):
        turns = ca.floor((x[k] - low) / (high - low)) if surface.closed[k] else 0
        wrapped.append(x[k] - (high - low) * turns)
    knots = [knots.tolist() for knots in raised.knots]
    spline = ca.bspline(ca.vertcat(*wrapped), ca.DM(coefficients), knots, list(raised.degree), 4, {})
    point = spline[:3] / spline[3]
    rates = ca.jacobian(point, x)
    return ca.Function("surface", [x], [point, rates[:, 0], rates[:, 1]], ["x"], ["S", "Su", "Sv"])


class _Patch:
    """A surface in scaled lengths, with parameters s = (u - low) speed that run at about unit speed."""

    def __init__(self, surface: NurbsSurface, scale: float) -> None:
        self.function = spline_function(surface.transformed(scale=1.0 / scale))
        self.closed = np.array(surface.closed)
        self.low, self.high = np.array(surface.domain).T
        u, v = (np.linspace(low, high, _GRID) for low, high in surface.domain)
        _, su, sv = surface.evaluate(u[:, None], v, 1)
        self.speed = np.array([np.sqrt((rate**2).sum(axis=-1).mean()) for rate in (su, sv)]) / scale
        self.upper = np.where(self.closed, np.inf, (self.high - self.low) * self.speed)
        self.lower = np.where(self.closed, -np.inf, 0.0)

    def expressions(self, s: ca.MX) -> list[ca.MX]:
        """S, Su, Sv at the scaled parameters s."""
        point, su, sv = self.function.call([self.low + s / self.speed], True, False)
        return [point, su / self.speed[0], sv / self.speed[1]]

    def scaled(self, parameters: Array) -> Array:
        """Scaled parameters of the user's."""
        return np.asarray((parameters - self.low) * self.speed)

    def parameters(self, scaled: Array) -> Array:
        """The user's parameters, in the domain."""
        value = self.low + scaled / self.speed
        wrapped = self.low + (value - self.low) % (self.high - self.low)
        return np.asarray(np.where(self.closed, wrapped, np.clip(value, self.low, self.high)))


def _rotation() -> ca.Function:
    """The rotation matrix of e / |e|."""
    e = ca.SX.sym("e", 4)
    w, u = e[0], e[1:]
    matrix = (w * w - ca.dot(u, u)) * ca.SX.eye(3) + 2 * w * ca.skew(u) + 2 * u @ u.T
    return ca.Function("rotation", [e], [matrix / ca.dot(e, e)])


def _posture(pose: ca.MX, reference: ca.MX, lever: float) -> ca.MX:
    """|x - x0|^2 + lever^2 4 sin^2(angle / 2)."""
    e, o = pose[3:], reference[3:]
    # The vector part of o e^* is the axis times sin(angle / 2).
    turn = e[0] * o[1:] - o[0] * e[1:] - ca.cross(o[1:], e[1:])
    return ca.sumsqr(pose[:3] - reference[:3]) + 4.0 * lever**2 * ca.sumsqr(turn) / ca.dot(e, e)


class _Pair(Sides):
    """The rows of one contact."""

    def __init__(
        self, faces: tuple[BodyFace, BodyFace], bodies: tuple[int, int], patches: tuple[_Patch, _Patch]
    ) -> None:
        super().__init__(faces, bodies)
        self.patches = patches

    def rows(self, poses: Sequence[ca.MX], turns: Sequence[ca.MX], s: ca.MX) -> ca.MX:
        """Four extremality rows, then the gap; in the axes of f."""
        f, fu, fv = self.patches[0].expressions(s[:2])
        g, gu, gv = self.patches[1].expressions(s[2:])
        (x_f, x_g), (turn_f, turn_g) = ([values[k] for k in self.bodies] for values in (poses, turns))
        turn = turn_f.T @ turn_g
        d = turn_f.T @ (x_g[:3] - x_f[:3]) + turn @ g - f
        n = ca.cross(fu, fv)
        n *= self.faces[0].face.sign / ca.norm_2(n)
        n_g = turn.T @ n
        return ca.vertcat(ca.dot(d, fu), ca.dot(d, fv), ca.dot(n_g, gu), ca.dot(n_g, gv), ca.dot(n, d))

    def scaled(self, parameters: Array) -> Array:
        """The program's variables of the user's parameters."""
        return np.concatenate([p.scaled(x) for p, x in zip(self.patches, parameters.reshape(2, 2), strict=True)])

    def parameters(self, scaled: Array) -> Array:
        """The user's parameters of the program's variables."""
        return np.concatenate([p.parameters(x) for p, x in zip(self.patches, scaled.reshape(2, 2), strict=True)])


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
        self._bodies = scene.bodies
        self._moving = [k for k, body in enumerate(scene.bodies) if not body.fixed]
        self._fixed = [k for k, body in enumerate(scene.bodies) if body.fixed]
        patches: dict[NurbsSurface, _Patch] = {}
        self._pairs: list[_Pair] = []
        for contact, faces in zip(packed.contacts, packed.faces, strict=True):
            for side in faces:
                if side.face.surface not in patches:
                    patches[side.face.surface] = _Patch(side.face.surface, packed.scale)
            f, g = (patches[side.face.surface] for side in faces)
            i, j = (scene.bodies.index(body) for body in contact.bodies)
            self._pairs.append(_Pair(faces, (i, j), (f, g)))
        self._one_sided = np.array([contact.unilateral for contact in packed.contacts], dtype=bool)
        self._terms: list[tuple[PointDistance | Posture, int]] = []
        self._build(scene)

    def _build(self, scene: Assembly) -> None:
        poses = [ca.MX.sym("pose", 7) for _ in self._bodies]
        contacts = [ca.MX.sym("contact", 4) for _ in self._pairs]
        rows = [ca.dot(poses[k][3:], poses[k][3:]) - 1 for k in self._moving]
        rotation = _rotation()
        turns = [rotation(pose[3:]) for pose in poses]
        rows += [pair.rows(poses, turns, s) for pair, s in zip(self._pairs, contacts, strict=True)]
        value = ca.MX(0)
        given: list[ca.MX] = []
        for sign, term in scene.objectives or ((1.0, Posture()),):
            weight = sign * term.weight * self._packed.scale**2 / self._packed.unit
            if isinstance(term, PointDistance):
                k = scene.bodies.index(term.point.body)
                given.append(ca.MX.sym("target", 3))
                point = poses[k][:3] + turns[k] @ (term.point.coordinates / self._packed.scale)
                value += weight * ca.sumsqr(point - given[-1])
                self._terms.append((term, k))
                continue
            assert isinstance(term, Posture)
            for k in self._moving:
                given.append(ca.MX.sym("reference", 7))
                lever = 0.5 * (self._bodies[k].size or self._packed.scale) / self._packed.scale
                value += weight * _posture(poses[k], given[-1], lever)
                self._terms.append((term, k))
        x = ca.vertcat(*(poses[k] for k in self._moving), *contacts)
        p = ca.vertcat(*(poses[k] for k in self._fixed), *given)
        options: dict[str, Any] = {"print_time": False, "show_eval_warnings": False, "ipopt": _IPOPT | self.options}
        program: dict[str, Any] = {"x": x, "p": p, "f": value, "g": ca.vertcat(*rows)}
        try:
            self._solver = ca.nlpsol("reference", "ipopt", program, options)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            raise InputError(f"ipopt is {self.options!r}; expected options of IPOPT ({reason})") from error
        self._objective = ca.Function("objective", [x, p], [value, ca.gradient(value, x)])
        bodies, pairs = len(self._moving), len(self._pairs)
        # Rows of unit quaternions, then five a contact; the last of these is the gap.
        self._gap_rows = bodies + 4 + 5 * np.arange(pairs)
        upper = np.zeros(bodies + 5 * pairs)
        upper[self._gap_rows[self._one_sided]] = np.inf
        free = np.full(7 * bodies, np.inf)
        sides = [patch for pair in self._pairs for patch in pair.patches]
        self._bounds = {
            "lbx": np.concatenate([-free, *(patch.lower for patch in sides)]),
            "ubx": np.concatenate([free, *(patch.upper for patch in sides)]),
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
        q = state[: packed.contacts_at].reshape(-1, 7)
        parameters = state[packed.contacts_at : packed.angles_at].reshape(-1, 4)
        p = self._given(q)
        found = [
            pair.find(q, None if np.isnan(at).any() else at) for pair, at in zip(self._pairs, parameters, strict=True)
        ]
        parameters = np.array([pair.parameters for pair in found]).reshape(-1, 4)
        lost = [k for k, pair in enumerate(found) if not is_extremal(pair)]
        if lost:
            return self._checked(q, parameters, np.zeros(len(parameters)), Status.CONTACT_LOST, p, {"culprit": lost[0]})
        x0 = self._variables(q, parameters)
        begin = perf_counter()
        result = self._solver(x0=x0, p=p, **self._bounds)
        seconds = perf_counter() - begin
        stats = self._solver.stats()
        figures = {"seconds": seconds, "iterations": int(stats["iter_count"]), "history": _history(stats)}
        x = np.array(result["x"]).ravel()
        forces = np.array(result["lam_g"]).ravel()[self._gap_rows]
        status = _STATUSES.get(stats["return_status"], Status.STALLED)
        if not (np.isfinite(x).all() and np.isfinite(forces).all()):
            x, forces, status = x0, np.zeros_like(forces), Status.STALLED
        q = q.copy()
        split = 7 * len(self._moving)
        rows = x[:split].reshape(-1, 7)
        q[self._moving, :3] = rows[:, :3] * packed.scale + packed.reference
        q[self._moving, 3:] = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
        for k, pair in enumerate(self._pairs):
            parameters[k] = pair.parameters(x[split + 4 * k : split + 4 * k + 4])
        return self._checked(q, parameters, forces, status, p, figures)

    def _variables(self, q: Array, parameters: Array) -> Array:
        """The program's variables of a configuration and the parameters of the contacts."""
        rows = [self._scaled(q[k]) for k in self._moving]
        rows += [pair.scaled(at) for pair, at in zip(self._pairs, parameters, strict=True)]
        return np.concatenate(rows)

    def _scaled(self, row: Array) -> Array:
        """A pose row as the program has it."""
        return np.concatenate([(row[:3] - self._packed.reference) / self._packed.scale, row[3:]])

    def _given(self, q: Array) -> Array:
        """The program's parameters: fixed poses, targets and references."""
        values = [self._scaled(q[k]) for k in self._fixed]
        for term, k in self._terms:
            if isinstance(term, PointDistance):
                values.append((term.target - self._packed.reference) / self._packed.scale)
            else:
                values.append(self._scaled((q if term.reference is None else term.reference)[k]))
        return np.concatenate([*values, np.empty(0)])

    def _checked(
        self, q: Array, parameters: Array, forces: Array, status: Status, p: Array, figures: dict[str, Any]
    ) -> Solution:
        """The solution, its status decided by extremal pairs found afresh at q and by the wrenches in them."""
        packed, scene = self._packed, self._scene._scene
        assert scene is not None
        value, slopes = (np.array(out).ravel() for out in self._objective(self._variables(q, parameters), p))
        gradient = np.zeros((len(self._bodies), 6))
        gradient[self._moving] = twist_gradients(q[self._moving], slopes[: 7 * len(self._moving)].reshape(-1, 7))
        found = audit(self._pairs, self._one_sided, q, parameters, forces, gradient, self._moving, packed.scale)
        if status is not Status.CONTACT_LOST:
            if found.held and found.balanced:
                status = Status.SOLVED
            elif status is Status.SOLVED or (found.held and status is Status.INFEASIBLE):
                status = Status.STALLED
        state = np.zeros(packed.results_at + RESULTS)
        state[: packed.contacts_at] = q.ravel()
        state[packed.contacts_at : packed.angles_at] = found.parameters.ravel()
        state[packed.multipliers_at : packed.residuals_at] = forces
        state[packed.residuals_at : packed.results_at] = found.gaps
        results = state[packed.results_at :]
        results[COUNT] = figures.get("iterations", 0)
        results[OBJECTIVE] = value[0]
        results[VIOLATION] = found.feasibility
        results[DUAL] = found.stationarity
        results[CULPRIT] = figures.get("culprit", -1)
        results[IMPROPER] = found.crossing and status is not Status.CONTACT_LOST
        history = figures.get("history", np.empty((0, len(Iteration.COLUMNS))))
        return Solution(scene, packed, state, status, figures.get("seconds", 0.0), history)


def _history(stats: Mapping[str, Any]) -> Array:
    """IPOPT's table in the columns of `Iteration`. It has no trust region: the last column is infinite."""
    table = stats["iterations"]
    names = ("obj", "inf_pr", "inf_du", "mu", "regularization_size", "alpha_pr")
    columns = [np.asarray(table[name], dtype=np.float64) for name in names]
    return np.column_stack([*columns, np.full_like(columns[0], np.inf)])


@lru_cache(maxsize=8)
def _built(scene: Assembly, packed: Packed, ipopt: tuple[tuple[str, Any], ...]) -> ReferenceSolver:
    """The solver of a scene as it is packed now; kept for the next solves."""
    return ReferenceSolver(scene, dict(ipopt))


def solve(
    scene: Assembly,
    q0: ArrayLike | Solution | None = None,
    *,
    starts: Mapping[str, ArrayLike] | None = None,
    ipopt: Mapping[str, str | float] | None = None,
) -> Solution:
    """Solve an assembly with CasADi and IPOPT, in full space.

    Slower than `Assembly.solve` and independent of it. The program is built at the first solve and kept.

    Parameters
    ----------
    scene : Assembly
    q0 : (n, 7) or Solution, optional
        Where to start: a row a body, or an earlier solution, whose contacts are taken up as well. The bodies' own
        poses by default.
    starts : mapping of constraint name -> (4,), optional
        Parameters near the pair each contact is to track; a global start finds the others.
    ipopt : mapping, optional
        IPOPT's options by name, each a number or a string, such as {"max_iter": 100}.

    Returns
    -------
    Solution
        As of `Assembly.solve`. SOLVED where extremal pairs found afresh hold the contacts to `FEASIBILITY` (1e-9) of
        the scene's size, and the Lagrangian's gradient in twists, over one plus that of the objective, is at most
        `STATIONARITY` (1e-7). INFEASIBLE where IPOPT says so: the pose then has the least sum of violations of
        IPOPT's rows nearby. `seconds` is the time in IPOPT.

    Raises
    ------
    TypeError, InputError
        Naming the argument, what came and what was expected.

    Notes
    -----
    At a pole of a surface one parameter moves nothing and rows lose their meaning: a contact there is reached to about
    1e-7 at best, or ends STALLED.
    """
    options = _checked_arguments(scene, ipopt)
    return _built(scene, scene.packed(), tuple(sorted(options.items()))).solve(q0, starts=starts)
