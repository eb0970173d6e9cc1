"""What a solve returns: the pose, an honest status, and tables that are made when they are read."""

from __future__ import annotations

from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.constraint import Constraint
from assembly.constraints.contact import Contact
from assembly.constraints.packing import Packed
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.proximity.pairs import ContactPair, extremal_pair
from assembly.solve.augmented_lagrangian import COUNT, CULPRIT, DUAL, IMPROPER, OBJECTIVE, VIOLATION

if TYPE_CHECKING:
    from assembly.kinematics.body import BodyFace

__all__ = ["Iteration", "Scene", "Solution", "Status"]

Array = NDArray[np.float64]


class Status(Enum):
    """How a solve ended; the value says what to do."""

    SOLVED = "every constraint holds and the objective is stationary"
    INFEASIBLE = "the constraints cannot all hold near this start; the pose violates them least: drop or move one"
    STALLED = "no further progress; look at the worst violation, start elsewhere or loosen the tolerance"
    ITERATION_LIMIT = "out of iterations; raise max_iterations or start nearer"
    CONTACT_LOST = "a contact has no extremal pair at the start; move the bodies or name the faces"


class Scene:
    """The bodies, contacts and faces that a solution speaks of."""

    def __init__(
        self,
        bodies: tuple[Body, ...],
        constraints: tuple[Constraint, ...],
        contacts: tuple[Contact, ...],
        faces: tuple[tuple[BodyFace, BodyFace], ...],
        scale: float,
    ) -> None:
        self.bodies = bodies
        self.constraints = constraints
        self.contacts = contacts
        self.faces = faces
        self.scale = scale

    def index(self, body: Body | str) -> int:
        """Place of a body, given itself or its name."""
        for k, other in enumerate(self.bodies):
            if other is body or other.name == body:
                return k
        known = ", ".join(repr(other.name) for other in self.bodies)
        raise InputError(f"body is {body!r}; expected one of {known}")


class Iteration(tuple[float, ...]):
    """Names of the columns of `Solution.history`."""

    COLUMNS = ("objective", "feasibility", "stationarity", "penalty", "regularization", "step", "radius")


class Solution:
    """The result of a solve. Its tables are computed when they are read.

    Attributes
    ----------
    q : (n, 7)
        A row a body: x y z qw qx qy qz.
    status : Status
    success : bool
        True only where the constraints, evaluated afresh at `q`, hold to the tolerance and the objective is stationary.
    objective : float
        In the user's units.
    feasibility : float
        Largest violation of a constraint, in the user's units, evaluated at `q`.
    stationarity : float
        Largest component of the Lagrangian's gradient, scaled.
    violations : dict of name -> float
    multipliers : dict of name -> array
        Of L = objective + sum multiplier . residual, in the user's units; not positive for residual >= 0.
    contacts : dict of name -> ContactPair
    iterations : int
    seconds : float
        Time in the compiled loop.
    history : (iterations + 1, 7)
        Columns `Iteration.COLUMNS`; lengths over the scene's size.
    message : str
    """

    def __init__(
        self, scene: Scene, packed: Packed, state: Array, status: Status, seconds: float, history: Array
    ) -> None:
        self._scene = scene
        self._packed = packed
        self._state = state
        self._rows = history
        self.status = status
        self.seconds = seconds

    @cached_property
    def q(self) -> Array:
        """Configuration, (n, 7)."""
        return self._state[: self._packed.contacts_at].reshape(-1, 7)

    @property
    def _parameters(self) -> Array:
        return self._state[self._packed.contacts_at : self._packed.angles_at].reshape(-1, 4)

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
        return self._result(OBJECTIVE) * self._packed.unit

    @property
    def feasibility(self) -> float:
        """Largest violation of a constraint, in the user's units."""
        return self._result(VIOLATION)

    @property
    def stationarity(self) -> float:
        """Largest component of the Lagrangian's gradient, scaled."""
        return self._result(DUAL)

    @property
    def history(self) -> Array:
        """A row an iteration, columns `Iteration.COLUMNS`."""
        return self._rows[: self.iterations + 1]

    @property
    def success(self) -> bool:
        """Whether the status is SOLVED."""
        return self.status is Status.SOLVED

    @cached_property
    def violations(self) -> dict[str, float]:
        """Violation of every constraint, by name: its largest; lengths in the user's unit, angles in radians."""
        packed = self._packed
        each = np.where(packed.one_sided, np.maximum(-self._residuals, 0.0), np.abs(self._residuals))
        return {
            constraint.name: float(each[rows].max(initial=0.0))
            for constraint, rows in zip(self._scene.constraints, packed.spans, strict=True)
        }

    @cached_property
    def multipliers(self) -> dict[str, Array]:
        """Multipliers of every constraint's rows, by name: forces and torques when the objective is an energy."""
        packed = self._packed
        forces = self._state[packed.multipliers_at : packed.residuals_at] * packed.unit
        forces = np.where(packed.lengths, forces / packed.scale, forces)
        return {
            constraint.name: forces[rows]
            for constraint, rows in zip(self._scene.constraints, packed.spans, strict=True)
        }

    @cached_property
    def contacts(self) -> dict[str, ContactPair]:
        """The extremal pair of every contact at `q`, found again from the loop's parameters."""
        pairs = {}
        for k, contact in enumerate(self._scene.contacts):
            f, g = self._scene.faces[k]
            q_f, q_g = (self.q[self._scene.index(body)] for body in contact.bodies)
            start = None if np.isnan(self._parameters[k]).any() else self._parameters[k]
            pairs[contact.name] = extremal_pair(f, q_f, g, q_g, start)
        return pairs

    def pose(self, body: Body | str) -> Pose:
        """Pose of a body, given itself or its name."""
        row = self.q[self._scene.index(body)]
        return Pose(row[:3], row[3:])

    @property
    def message(self) -> str:
        """The status in a sentence, with the constraint that is violated most."""
        text = self.status.value
        culprit = int(self._result(CULPRIT))
        if self.status is Status.CONTACT_LOST and culprit >= 0:
            return f"{self._scene.contacts[culprit].name!r}: {text}"
        tolerance = 1e-9 * self._scene.scale
        held_off = sorted(
            (name for name, value in self.violations.items() if not value <= tolerance),
            key=lambda name: -self.violations[name],
        )
        if held_off and not self.success:
            named = ", ".join(f"{name!r} ({self.violations[name]:.3g})" for name in held_off)
            text += f"; violated: {named}"
        if self._result(IMPROPER) > 0.0:
            text += "; at a contact the surfaces cross beside the point (indefinite relative curvature)"
        return text

    def __repr__(self) -> str:
        return f"Solution({self.status.name}, feasibility={self.feasibility:.1e}, iterations={self.iterations})"

    def __str__(self) -> str:
        lines = [
            f"{self.status.name}: {self.message}",
            f"objective {self.objective:.6g}   feasibility {self.feasibility:.1e}   "
            f"stationarity {self.stationarity:.1e}   {self.iterations} iterations   {1e6 * self.seconds:.0f} us",
        ]
        worst = sorted(self.violations.items(), key=lambda item: -item[1])[:5]
        lines += [f"  {name:<24} violation {value:.1e}" for name, value in worst]
        for body, row in zip(self._scene.bodies, self.q, strict=True):
            place = " ".join(f"{value:9.4f}" for value in row)
            lines.append(f"  {body.name:<24} {place}{'   fixed' if body.fixed else ''}")
        return "\n".join(lines)
