"""What a solve returns: the pose, an honest status, and tables that are made when they are read."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._named import Named
from assembly._turn import FoundInTurn
from assembly.constraints.program.records import IMPLICIT
from assembly.errors import InputError
from assembly.proximity.extrema.pairs import ContactPair
from assembly.solve.loop.settings import DUAL, OBJECTIVE
from assembly.solve.result import Result
from assembly.solve.scene import Status

if TYPE_CHECKING:
    from assembly.solve.crossings import Crossings
    from assembly.solve.diagnosis.mobility import Mobility
    from assembly.solve.forces.statics import Wrench
    from assembly.solve.second_order.classification import SecondOrder

__all__ = ["Solution"]

Array = NDArray[np.float64]


class Solution(Result):
    """The result of a solve. Its tables are computed when they are read; its arrays are read-only.

    Attributes
    ----------
    q : (n, 7)
        One row per body: x y z qw qx qy qz.
    status : Status
    success : bool
        True only if the constraints, evaluated afresh at `q`, hold to the tolerance and the objective, if there is one,
        is stationary without a lower pose found nearby: SOLVED. Also True for FITTED, where redundant constraints
        disagree by no more than `fit`. Without an objective it says that constraints hold near the start: the least
        move is a soft objective.
    objective : float
        In the user's units.
    proved : bool
        Whether all pairs of bodies that clearances keep apart are proven to be clear or to touch only. False if faces
        lie on each other and samples had to be used, and if a clearance asks for a gap beside a contact.
    restarted : bool
        Whether the constraints did not hold near the start, and the solution was found from another one.
    put_together : bool
        Whether bodies were put together without clearances first, because joints or contacts did not hold at the start,
        or because an objective draws them together; they may have passed through each other. The option `keep_topology`
        forbids it.
    way : Way or None
        For a solve with `swept=True`: how far its way is clear, and if BLOCKED what is in the way.
    feasibility : float
        Largest violation of a constraint, in the user's units, evaluated at `q`. For a contact without an extremal pair
        it is the distance of the points in `contacts`. Infinite only if an `Expression` or a derivative of it has no
        finite value; then its objective is infinite as well.
    second_order : SecondOrder
        What the end is: `minimum`, `not isolated` (along some motions the objective does not change to second order),
        `undecided`, `saddle` (not SOLVED: lower poses are nearby, but no step was left to go there), `no objective`.
        None if the solve failed otherwise.
    stationarity : float
        Largest component of the Lagrangian's gradient, scaled; of the objective's gradient if a contact was lost.
    violations : dict of name -> float
    multipliers : dict of name -> array
        For L = objective + sum multiplier . residual, in the user's units; not positive for residual >= 0.
    wrenches : dict of name -> dict of body's name -> Wrench
        What each constraint exerts on its bodies: multipliers as forces and torques.
    values : dict of "joint.freedom" -> float
        Every coordinate of every joint, in the user's units and radians; driven and limited angles continue past whole
        turns.
    disagreeing : dict of name -> float
        For a FITTED solve: the redundant constraints, and by how much each is off, the worst first.
    conflicting : list of name
        For an INFEASIBLE solve: constraints that cannot hold together; `conflicting_sets` has the minimal sets.
    mobility : Mobility
        Degrees of freedom at `q`, free motions, redundant constraints.
    pose_error : float
        About how far `q` is from where all rows hold exactly, in sizes of the scene and radians.
    contacts : dict of name -> ContactPair
        For a clearance, every contact that is near: "clearance: a-b", "clearance: a-b 2" and so on.
    crossings : tuple of (name, name)
        Bodies that cross elsewhere than at their contacts, except pairs that a clearance excludes and pairs that a
        joint, gear or rack connects directly.
    crossings_of_joined : tuple of (name, name)
        The pairs that cross among those that a joint or a coupling connects directly.
    iterations : int
    seconds : float
        Time in the compiled loop; with `swept=True` the whole time.
    history : (iterations + 1, 7)
        Columns `Iteration.COLUMNS`; lengths over the scene's size.
    message : str
    """

    @property
    def objective(self) -> float:
        """Value of the objective, in the user's units."""
        value = self._result(OBJECTIVE)
        if np.isfinite(value) or not self._is_lost:
            return value * self._ended.packed.unit
        return self._goal[0]

    @property
    def feasibility(self) -> float:
        """Largest violation of a constraint, in the user's units."""
        return max(self.violations.values(), default=0.0)

    @property
    def stationarity(self) -> float:
        """Largest component of the Lagrangian's gradient, scaled."""
        value = self._result(DUAL)
        if np.isfinite(value) or not self._is_lost:
            return value
        return self._goal[1]

    @property
    def second_order(self) -> SecondOrder | None:
        """What the end of a solve is; judged when it is read, unless the solve had to judge it."""
        if self._order is None and self.success:
            self._order = self._judged
        return self._order

    @FoundInTurn
    def _judged(self) -> SecondOrder:
        from assembly.solve.second_order.classification import SecondOrder, judge

        packed = self._packed
        if packed.table[IMPLICIT] != 0:
            return SecondOrder.NO_OBJECTIVE
        if self._begun is not None:
            # Other solves of the scene may have begun elsewhere since.
            packed = packed.twin()
            packed.measure_from(self._begun)
        verdict, model = judge(packed, self._state, sample=False)
        # Targets may be others by now.
        judged = model is not None and model.is_stationary
        return verdict.kind if judged else SecondOrder.UNDECIDED

    @FoundInTurn
    def _goal(self) -> tuple[float, float]:
        """Of a lost contact: the objective and the largest component of its gradient."""
        from assembly.solve.diagnosis.lost import goal

        return goal(self)

    @cached_property
    def violations(self) -> dict[str, float]:
        """The largest violation of every constraint, by name; lengths in the user's unit, angles in radians."""
        return self._lost_violations if self._is_lost else self._largest(1.0)

    @FoundInTurn
    def _lost_violations(self) -> dict[str, float]:
        from assembly.solve.diagnosis.lost import violations

        return Named(violations(self))

    @FoundInTurn
    def wrenches(self) -> dict[str, dict[str, Wrench]]:
        """What every constraint exerts on each of its bodies, by their names."""
        from assembly.solve.forces.statics import wrenches

        return Named(wrenches(self))

    @FoundInTurn
    def mobility(self) -> Mobility:
        """Degrees of freedom at `q`, free motions, redundant constraints; `Assembly.mobility` has options."""
        from assembly.solve.diagnosis.mobility import Mobility

        return Mobility.at(self._scene, self._packed, self._state, solved=True, fit=self._allowed)

    @FoundInTurn
    def conflicting_sets(self) -> list[tuple[str, ...]]:
        """Disjoint minimal sets of constraints that cannot hold together; [] where the status is not INFEASIBLE.

        Found by solves that leave out one constraint after the other, when this is first read.
        """
        if self.status is not Status.INFEASIBLE:
            return []
        from assembly.solve.diagnosis.conflicts import conflicts_at

        return conflicts_at(self._scene, self._packed, self._state, self._allowed)

    @property
    def conflicting(self) -> list[str]:
        """Names in `conflicting_sets`, sorted, each once."""
        return sorted({name for names in self.conflicting_sets for name in names})

    @FoundInTurn
    def contacts(self) -> dict[str, ContactPair]:
        """The extremal pair of every contact at `q`, found again from the loop's parameters."""
        from assembly.solve.contact_pairs import contact_pairs

        return Named(contact_pairs(self))

    @cached_property
    def crossings(self) -> tuple[tuple[str, str], ...]:
        """Names of bodies that cross at `q` elsewhere than at their contacts; all pairs are searched when it is read.

        Pairs that a joint or a coupling connects directly, which usually overlap, are in `crossings_of_joined`; those
        that a clearance excludes may overlap. A body inside the material of another one crosses it, too.
        """
        return self.find_crossings().pairs

    @cached_property
    def crossings_of_joined(self) -> tuple[tuple[str, str], ...]:
        """The same for bodies that a joint or a coupling connects directly: a pin in its bore, gears, thick links."""
        return self.find_crossings(joined=True).pairs

    def find_crossings(self, *, joined: bool = False, time_limit: float | None = None) -> Crossings:
        """Bodies that cross at `q`, searched for a limited time; `crossings` has no limit.

        Parameters
        ----------
        joined : bool
            Whether to search the pairs that a joint or a coupling connects directly, as in `crossings_of_joined`, or
            the others.
        time_limit : float, optional
            Seconds after which the remaining pairs are `unseen`.

        Returns
        -------
        Crossings
            `pairs` that cross and those that are `unseen`; `is_clear` where all were searched and none crosses.
        """
        from assembly.solve.crossings import crossings_of, free_pairs, joined_pairs
        from assembly.solve.interruption import CTRL_C, Interruption

        if not isinstance(joined, (bool, np.bool_)):
            raise InputError(f"joined is {joined!r}; expected True or False")
        asked = CTRL_C if time_limit is None else Interruption(time_limit)
        choose = joined_pairs if joined else free_pairs
        return crossings_of(self, choose(self._scene.bodies, self._scene.constraints), asked)

    @FoundInTurn
    def pose_error(self) -> float:
        """About how far `q` is from where all rows hold exactly, by their residuals: in sizes of the scene and radians.

        Residual over the smallest singular value of the active rows; at a dead center, where that is zero, the square
        root of twice the residual over the rows' curvature: a residual of 1e-13 there gives 4e-7. Free motions do not
        count, nor does the distance from an objective's minimum; infinite if rows do not hold to 1e-6.
        """
        from assembly.solve.diagnosis.pose_error import pose_error

        # Values may be others by now.
        return pose_error(self._scene, self._packed.as_asked(self._asked), self._state)

    @property
    def message(self) -> str:
        """The status in a sentence; what is violated, worst first, and what contradicts what."""
        from assembly.solve.words import message

        return message(self)

    def iteration_table(self) -> str:
        """The history as text, one line per iteration."""
        from assembly.solve.words import iteration_table

        return iteration_table(self)

    def __repr__(self) -> str:
        return f"Solution({self.status.name}, feasibility={self.feasibility:.1e}, iterations={self.iterations})"

    def __str__(self) -> str:
        from assembly.solve.words import table

        return table(self)

    def _repr_html_(self) -> str:
        from assembly.solve.words import html_table

        return html_table(self)
