"""What a solve returns: the pose, an honest status, and tables that are made when they are read."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays, read_only
from assembly.constraints.model.joint import Joint
from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.records import IMPLICIT
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.proximity.extrema.pairs import ContactPair
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.loop.settings import COUNT, DUAL, OBJECTIVE, VIOLATION
from assembly.solve.measure import measure, standing
from assembly.solve.options import Options
from assembly.solve.scene import Scene, Status

if TYPE_CHECKING:
    from assembly.solve.crossings import Crossings
    from assembly.solve.diagnosis.mobility import Mobility
    from assembly.solve.forces.statics import Wrench
    from assembly.solve.second_order.classification import SecondOrder
    from assembly.solve.second_order.leave import Fit

__all__ = ["Iteration", "Solution"]

Array = NDArray[np.float64]
# A constraint that is off by less than this part of the worst is not one of those that disagree.
IDLE = 1e-3


class Iteration(tuple[float, ...]):
    """Names of the columns of `Solution.history`."""

    COLUMNS = ("objective", "feasibility", "stationarity", "penalty", "regularization", "step", "radius")


class Solution(ReadOnlyArrays):
    """The result of a solve. Its tables are computed when they are read; its arrays are read-only.

    Attributes
    ----------
    q : (n, 7)
        A row a body: x y z qw qx qy qz.
    status : Status
    success : bool
        True only where the constraints, evaluated afresh at `q`, hold to the tolerance, and the objective, if there is
        one, is stationary and no pose beside `q` was found to be lower: SOLVED. FITTED, too, where constraints that
        repeat each other disagree by no more than `fit`. Without an objective it says that constraints hold near the
        start: the least move is a preference.
    objective : float
        In the user's units.
    restarted : bool
        Whether the constraints did not hold near the start, and the solution was found from another one.
    feasibility : float
        Largest violation of a constraint, in the user's units, evaluated at `q`. Of a contact that has no extremal pair
        there it is the distance of the points in `contacts`. Infinite only where an `Expression` or a derivative of it
        has no finite value, and so is the objective of one.
    second_order : SecondOrder
        What the end is: `minimum`, `not isolated` (along some motions the objective does not change to second order),
        `undecided`, `saddle` (not SOLVED: lower poses are beside it, which no step was left for), `no objective`. None
        of a solve that failed otherwise.
    stationarity : float
        Largest component of the Lagrangian's gradient, scaled; of the objective's where a contact was lost.
    violations : dict of name -> float
    multipliers : dict of name -> array
        Of L = objective + sum multiplier . residual, in the user's units; not positive for residual >= 0.
    wrenches : dict of name -> dict of body's name -> Wrench
        What each constraint exerts on its bodies: multipliers as forces and torques.
    values : dict of "joint.freedom" -> float
        Every freedom of every joint, in the user's units and radians; driven and limited angles go on past whole turns.
    disagreeing : dict of name -> float
        Of a FITTED solve: the constraints that repeat each other, and by how much each is off, the worst first.
    conflicting : list of name
        Of an INFEASIBLE solve: constraints that cannot hold together; `conflicting_sets` has the minimal sets.
    mobility : Mobility
        Degrees of freedom at `q`, free motions, redundant constraints.
    pose_error : float
        About how far `q` is from where all rows hold exactly, in sizes of the scene and radians.
    contacts : dict of name -> ContactPair
        Of a clearance every contact that is near, "clearance: a-b", "clearance: a-b 2" and so on.
    crossings : tuple of (name, name)
        Bodies that cross elsewhere than at their contacts, but pairs that a clearance excludes and those that a joint
        ties directly, or a gear or a rack, whose teeth are in each other.
    crossings_of_joined : tuple of (name, name)
        Of the pairs that a joint or a coupling ties directly those that cross.
    iterations : int
    seconds : float
        Time in the compiled loop.
    history : (iterations + 1, 7)
        Columns `Iteration.COLUMNS`; lengths over the scene's size.
    message : str
    """

    def __init__(
        self,
        scene: Scene,
        packed: Packed,
        state: Array,
        status: Status,
        seconds: float,
        history: Array,
        order: SecondOrder | None = None,
        fit: Fit | None = None,
    ) -> None:
        self._scene = scene
        self._packed = packed
        self._state = state
        self._rows = history
        self.status = status
        self.seconds = seconds
        self._order = order
        self.restarted = False
        self._fit = fit
        # What bodies may be in each other and still touch, in parts of the scene's size.
        self._touching = Options.touching
        # Flat contacts alone need it again, for the center of their pressure.
        self._wishes = packed.pool[scene.wished(packed)] if scene.contacts else None

    @cached_property
    def q(self) -> Array:
        """Configuration, (n, 7)."""
        return read_only(self._state[: self._packed.contacts_at].reshape(-1, 7).copy())

    @property
    def _parameters(self) -> Array:
        return self._state[self._packed.contacts_at : self._packed.angles_at].reshape(-1, TRACK)

    @property
    def _residuals(self) -> Array:
        return self._state[self._packed.residuals_at : self._packed.results_at]

    def _result(self, place: int) -> float:
        return float(self._state[self._packed.results_at + place])

    @property
    def iterations(self) -> int:
        """Steps of the loop."""
        return int(self._result(COUNT))

    @property
    def objective(self) -> float:
        """Value of the objective, in the user's units."""
        value = self._result(OBJECTIVE)
        if np.isfinite(value) or not self._is_lost:
            return value * self._packed.unit
        from assembly.solve.diagnosis.lost import goal

        return goal(self)[0]

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
        from assembly.solve.diagnosis.lost import goal

        return goal(self)[1]

    @property
    def _is_lost(self) -> bool:
        """Whether the loop could not evaluate its rows at the pose, because a contact had no pair there."""
        return bool(self._scene.contacts) and self._result(VIOLATION) == np.inf

    @property
    def history(self) -> Array:
        """A row an iteration, columns `Iteration.COLUMNS`; none where a contact was lost at the start."""
        return read_only(self._rows[: 0 if self._is_lost and self.iterations == 0 else self.iterations + 1])

    @property
    def success(self) -> bool:
        """Whether the status is SOLVED or FITTED."""
        return self.status is Status.SOLVED or self.status is Status.FITTED

    @property
    def second_order(self) -> SecondOrder | None:
        """What the end of a solve is; looked at when it is read, unless the solve had to."""
        if self._order is None and self.success:
            from assembly.solve.second_order.classification import SecondOrder, judge

            self._order = SecondOrder.NO_OBJECTIVE
            if self._packed.table[IMPLICIT] == 0:
                verdict, look = judge(self._packed, self._state, sample=False)
                # Targets may be others by now.
                judged = look is not None and look.is_stationary
                self._order = verdict.kind if judged else SecondOrder.UNDECIDED
        return self._order

    @cached_property
    def violations(self) -> dict[str, float]:
        """Violation of every constraint, by name: its largest; lengths in the user's unit, angles in radians."""
        if self._is_lost:
            from assembly.solve.diagnosis.lost import violations

            return violations(self)
        return self._largest(1.0)

    def _largest(self, unit: float) -> dict[str, float]:
        """The largest violation of every constraint's rows, lengths in a unit."""
        packed = self._packed
        each = np.where(packed.one_sided, np.maximum(-self._residuals, 0.0), np.abs(self._residuals))
        return self._by_constraint(np.where(packed.lengths, each / unit, each))

    def _by_constraint(self, each: Array) -> dict[str, float]:
        """The largest of what every constraint's rows have."""
        return {
            constraint.name: float(each[rows].max(initial=0.0))
            for constraint, rows in zip(self._scene.constraints, self._packed.spans, strict=True)
        }

    @property
    def _allowed(self) -> float:
        """What rows that repeat each other may disagree by, over the size."""
        return Options.fit if self._fit is None else self._fit.allowed

    @cached_property
    def disagreeing(self) -> dict[str, float]:
        """Constraints that repeat each other and disagree, and how far each is off: lengths, radians; worst first."""
        if self._fit is None or self._fit.apart is None:
            return {}
        packed = self._packed
        off = np.abs(self._fit.apart)
        parts = self._by_constraint(off)
        amounts = self._by_constraint(np.where(packed.lengths, off * packed.scale, off))
        least = IDLE * max(parts.values())
        return {name: amounts[name] for name in sorted(parts, key=lambda name: -parts[name]) if parts[name] > least}

    @cached_property
    def multipliers(self) -> dict[str, Array]:
        """Multipliers of every constraint's rows, by name: forces and torques when the objective is an energy."""
        packed = self._packed
        forces = self._state[packed.multipliers_at : packed.residuals_at] * packed.unit
        forces = np.where(packed.lengths, forces / packed.scale, forces)
        return {
            constraint.name: read_only(forces[rows])
            for constraint, rows in zip(self._scene.constraints, packed.spans, strict=True)
        }

    @cached_property
    def wrenches(self) -> dict[str, dict[str, Wrench]]:
        """What every constraint exerts on each of its bodies, by their names."""
        from assembly.solve.forces.statics import wrenches

        return wrenches(self)

    @cached_property
    def values(self) -> dict[str, float]:
        """Every freedom of every joint, "joint.freedom": lengths in the user's unit, angles in radians."""
        packed = self._packed
        near = dict(
            zip(map(id, packed._angles), self._state[packed.angles_at : packed.multipliers_at : TRACK], strict=True)
        )
        values = {}
        for joint in self._scene.constraints:
            for name, freedom in joint.freedoms.items() if isinstance(joint, Joint) else ():
                coordinate = freedom.coordinate
                pair = coordinate.frames
                frames = standing(
                    coordinate, self.q, (self._scene.index(pair.frame_a.body), self._scene.index(pair.frame_b.body))
                )
                values[f"{joint.name}.{name}"] = measure(coordinate, frames, float(near.get(id(coordinate), 0.0)))
        return values

    @cached_property
    def mobility(self) -> Mobility:
        """Degrees of freedom at `q`, free motions, redundant constraints; `Assembly.mobility` has options."""
        from assembly.solve.diagnosis.mobility import Mobility

        return Mobility.at(self._scene, self._packed, self._state, solved=True, fit=self._allowed)

    @cached_property
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

    def _wished_pool(self) -> Array:
        """The pool with the objective as it was in this solve."""
        pool = self._packed.pool.copy()
        pool[self._scene.wished(self._packed)] = self._wishes
        return pool

    @cached_property
    def contacts(self) -> dict[str, ContactPair]:
        """The extremal pair of every contact at `q`, found again from the loop's parameters."""
        from assembly.solve.contact_pairs import contact_pairs

        return contact_pairs(self)

    @cached_property
    def crossings(self) -> tuple[tuple[str, str], ...]:
        """Names of bodies that cross at `q` elsewhere than at their contacts, by a look at all pairs when it is read.

        Pairs that a joint or a coupling ties directly, one in the other as a rule, are in `crossings_of_joined`; those
        which a clearance excludes may overlap. A body in the material of another one crosses it, too.
        """
        return self.find_crossings().pairs

    @cached_property
    def crossings_of_joined(self) -> tuple[tuple[str, str], ...]:
        """The same of bodies that a joint or a coupling ties directly: a pin in its bore, teeth, links too thick."""
        return self.find_crossings(joined=True).pairs

    def find_crossings(self, *, joined: bool = False, time_limit: float | None = None) -> Crossings:
        """Bodies that cross at `q`, as far as a look of limited time tells: `crossings` has no limit.

        Parameters
        ----------
        joined : bool
            Whether it is the pairs that a joint or a coupling ties directly, as in `crossings_of_joined`, or others.
        time_limit : float, optional
            Seconds after which the pairs that were not looked at to the end are `unseen`.

        Returns
        -------
        Crossings
            `pairs` that cross and those that are `unseen`; `is_clear` where all were looked at and none crosses.
        """
        from assembly.solve.crossings import crossings_of, free_pairs, joined_pairs
        from assembly.solve.interruption import CTRL_C, Interruption

        if not isinstance(joined, (bool, np.bool_)):
            raise InputError(f"joined is {joined!r}; expected True or False")
        asked = CTRL_C if time_limit is None else Interruption(time_limit)
        choose = joined_pairs if joined else free_pairs
        return crossings_of(self, choose(self._scene.bodies, self._scene.constraints), asked)

    @cached_property
    def pose_error(self) -> float:
        """About how far `q` is from where all rows hold exactly, by their residuals: in sizes of the scene and radians.

        Residual over the smallest singular value of the active rows, and at a dead center, where that is zero, the
        root of twice the residual over the rows' curvature: 1e-13 there is 4e-7. Free motions do not count, nor does
        how far an objective is from its best; infinite where rows do not hold to 1e-6.
        """
        from assembly.solve.diagnosis.pose_error import pose_error

        return pose_error(self._scene, self._packed, self._state)

    def pose(self, body: Body | str) -> Pose:
        """Pose of a body, given itself or its name."""
        row = self.q[self._scene.index(body)]
        return Pose(row[:3], row[3:])

    @property
    def message(self) -> str:
        """The status in a sentence; what is violated, worst first, and what contradicts what."""
        from assembly.solve.words import message

        return message(self)

    def iteration_table(self) -> str:
        """The history as text, a line an iteration."""
        from assembly.solve.words import iteration_table

        return iteration_table(self)

    def __repr__(self) -> str:
        return f"Solution({self.status.name}, feasibility={self.feasibility:.1e}, iterations={self.iterations})"

    def __str__(self) -> str:
        from assembly.solve.words import table

        return table(self)
