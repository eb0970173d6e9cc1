"""Some of a scene's constraints, with the values they had at a state, as a problem of its own.

Diagnosis asks what holds without this constraint, or along that motion. The scene may have changed since: driven
values, limits and faces are those of the state.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint, Equation
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.couplings import Coupling
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.trim_contact import TrimContact
from assembly.constraints.packing.scene import Packed
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.attempts.attempts import begin, go_on_once
from assembly.solve.attempts.balance import balanced
from assembly.solve.attempts.starts import Spread
from assembly.solve.dense.jacobian import Rows
from assembly.solve.dense.rank import HELD
from assembly.solve.interruption import STATUSES, Interruption
from assembly.solve.loop.settings import ANY_POSE, GATHER
from assembly.solve.options import Options
from assembly.solve.result import Result
from assembly.solve.scene import Scene, Status

__all__ = ["Problem", "Snapshot"]

Array = NDArray[np.float64]


class _Value(Constraint):
    """Where a row that is kept reads its value."""

    value: float

    def __init__(self, value: float) -> None:
        self.value = value


class _Part(Coupling):
    """Rows of a joint or a coupling as they were."""

    def __init__(self, constraint: Constraint, equations: tuple[Equation, ...]) -> None:
        Constraint.__init__(self, constraint.bodies, constraint.name)
        self._equations = equations

    @property
    def equations(self) -> tuple[Equation, ...]:
        return self._equations


class Problem:
    """Constraints between a scene's bodies, to be held by poses near given ones.

    Parameters
    ----------
    scene : Scene
    constraints : sequence of Constraint
        Contacts name their faces.
    near : mapping of id -> array
        Where tracked values are looked for: parameters by name of a contact, angles by identity of a coordinate.
    held : float
        Violations up to it count as none of what joints, couplings and driven values ask, over the scene's size.
    """

    def __init__(
        self, scene: Scene, constraints: Sequence[Constraint], near: dict[str | int, Array], held: float = HELD
    ) -> None:
        self.packed = Packed(scene.bodies, constraints, ())
        self._size = scene.scale
        self._scene = Scene(
            scene.bodies, tuple(constraints), tuple(self.packed.contacts), tuple(self.packed.sides), self.packed.scale
        )
        self._near = near
        self.held = held

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The constraints of the problem."""
        return self._scene.constraints

    def start(self, q: Array, after: Result | None = None) -> Array:
        """The state of a solve from poses (n, 7); tracked values go on from a solution's."""
        packed = self.packed
        state = packed.new_state()
        state[: packed.contacts_at] = q.ravel()
        packed.refresh()
        tracked = state[packed.contacts_at : packed.multipliers_at].reshape(-1, TRACK)
        if after is not None:
            tracked[:] = after._state[packed.contacts_at : packed.multipliers_at].reshape(-1, TRACK)
        else:
            tracked[:] = np.nan
            for k, contact in enumerate(packed.contacts):
                tracked[k] = self._near[contact.name]
            for k, angle in enumerate(packed._angles):
                tracked[packed.pair_rows + k] = self._near[id(angle)]
            packed.start_angles(state, warm=False)
        return state

    def solve(self, q: Array, interruption: Interruption, after: Result | None = None, gathers: bool = False) -> Result:
        """The nearest poses that hold the constraints, from poses (n, 7); tracked values go on from a solution's.

        Or any poses that hold them, from where scattered bodies were assembled. TimeoutError where the interruption's
        time is over before.
        """
        packed = self.packed
        settings = interruption.settings(interruption.fill(Options().settings()))
        if gathers:
            settings[GATHER] = settings[ANY_POSE] = 1.0
        turns = np.array([self._near[id(angle)][0] for angle in packed._angles])
        outcome = begin(packed, interruption, packed.table, settings, self.start(q, after), turns)
        outcome = balanced(packed, settings, outcome, partial(go_on_once, interruption))
        interruption.check("what constraints allow")
        return Result(self._scene, packed, outcome.state, STATUSES[outcome.code], 0.0, outcome.history)

    def violations(self, solution: Result) -> Array:
        """Violations of the constraints, in their order: lengths over the size of the whole scene."""
        each = self._off(solution)
        return np.array([each[rows].max(initial=0.0) for rows in self.packed.spans])

    def holds(self, solution: Result) -> bool:
        """Whether all constraints hold at a solution: contacts, limits and expressions to rounding."""
        packed = self.packed
        allowed = np.full(packed.rows, min(self.held, HELD))
        values = packed.value_rows
        allowed[values[~packed.one_sided[values]]] = self.held
        return solution.status is not Status.CONTACT_LOST and bool((self._off(solution) <= allowed).all())

    def _off(self, solution: Result) -> Array:
        """Violations of the rows, lengths over the size of the whole scene; infinite where there is no value."""
        packed = self.packed
        values = solution._residuals
        each = np.where(packed.one_sided, np.maximum(-values, 0.0), np.abs(values))
        each = np.where(packed.lengths, each / self._size, each)
        # What never had a pair does not hold.
        return np.where(np.isfinite(each), each, np.inf)


class Snapshot:
    """The constraints of a scene with the values they had at a state.

    Parameters
    ----------
    scene, packed
        As of the solution.
    state : array
    rows : Rows, optional
        At the state.
    solved : bool
        Whether the state's residuals are those of its poses; values that were driven since then are told by them.
    held : float
        As of `Problem`.
    """

    def __init__(
        self, scene: Scene, packed: Packed, state: Array, rows: Rows | None, solved: bool, held: float = HELD
    ) -> None:
        self.scene, self.turn = scene, packed.turn
        self._held = held
        self.q = state[: packed.contacts_at].reshape(-1, 7)
        self.spread = Spread.of(packed, self.q)
        tracked = state[packed.contacts_at : packed.multipliers_at].reshape(-1, TRACK)
        self._near: dict[str | int, Array] = {contact.name: tracked[k] for k, contact in enumerate(packed.contacts)}
        self._near |= {id(angle): tracked[packed.pair_rows + k] for k, angle in enumerate(packed._angles)}
        self._equations: dict[int, list[Equation]] = {}
        stored = state[packed.residuals_at : packed.results_at]
        now = {} if rows is None or not solved else dict(zip(rows.program_rows.tolist(), rows.residual, strict=True))
        for r, (equation, at, unit) in enumerate(packed._values, int((packed.pairs >= 0).sum())):
            value = float(packed.pool[at]) * unit
            # The row was coordinate - value; the coordinate is the same still.
            change = float(now[r] * unit - stored[r]) if r in now else 0.0
            if HELD * unit < abs(change) < np.inf:
                value += change
            source = None if equation.source is None else (_Value(value), "value")
            kept = Equation(equation.terms, source, equation.one_sided, equation.is_drive)
            self._equations.setdefault(int(packed.owners[r]), []).append(kept)
        self._sides = {contact.name: (packed.sides[k], packed.whole[k]) for k, contact in enumerate(packed.contacts)}

    def problem(self, which: Iterable[int] | None = None, one_sided: bool = True, drives: bool = True) -> Problem:
        """The problem of some of the constraints, by their places; of all by default.

        Parameters
        ----------
        which : iterable of int, optional
        one_sided : bool
            With limits, one-sided contacts and expressions.
        drives : bool
            With driven values.
        """
        places = range(len(self.scene.constraints)) if which is None else which
        parts = [part for part in (self._part(k, one_sided, drives) for k in places) if part is not None]
        # A trim means nothing without its contact.
        contacts = {part.name for part in parts if isinstance(part, Contact)}
        kept = [part for part in parts if not isinstance(part, TrimContact) or part.contact.name in contacts]
        return Problem(self.scene, kept, self._near, self._held)

    def _part(self, place: int, one_sided: bool, drives: bool) -> Constraint | None:
        constraint = self.scene.constraints[place]
        if isinstance(constraint, Contact):
            if constraint.unilateral and not one_sided:
                return None
            sides, whole = self._sides[constraint.name]
            return Contact(*sides, constraint.name, constraint.unilateral, edges=not whole, minimum=constraint.minimum)
        if isinstance(constraint, Clearance):
            return constraint if one_sided else None
        if isinstance(constraint, TrimContact):
            return None if constraint.unilateral and not one_sided else constraint
        if isinstance(constraint, Expression):
            return None if constraint.unilateral and not one_sided else constraint
        kept = tuple(
            row
            for row in self._equations.get(place, ())
            if (one_sided or not row.one_sided) and (drives or row.one_sided or not row.is_drive)
        )
        return _Part(constraint, kept) if kept else None
