"""A pose judged afresh: its extremal pairs, their wrenches, and whether surfaces cross beside them.

At a solution the wrenches of the contacts balance the objective and the other rows c,

    grad f + sum_r y_r grad c_r + sum_k y_k [-n, -(f - x_f) x n, n, (g - x_g) x n]_k = 0,

all in twists. Of contacts nothing here uses the derivatives of a solver.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.kinematics.body import BodyFace
from assembly.kinematics.pose import rotate
from assembly.proximity.extrema.pairs import ContactPair, PairStatus, extremal_pair

__all__ = ["FEASIBILITY", "STATIONARITY", "Audit", "Claim", "Sides", "audit", "is_extremal", "twist_gradients"]

Array = NDArray[np.float64]
# What counts as held and as balanced: violations over the scene's size, and the Lagrangian's gradient over one plus
# that of the objective.
FEASIBILITY, STATIONARITY = 1e-9, 1e-6
# An angle between parameter lines below which a point counts as a pole, and a curvature that counts as none.
_POLE, _FLAT = 1e-9, 1e-9


def is_extremal(pair: ContactPair) -> bool:
    """Whether a pair was found at all."""
    return pair.status in (PairStatus.CONVERGED, PairStatus.SINGULAR)


def twist_gradients(q: Array, slopes: Array) -> Array:
    """Derivatives in twists, (n, 6), of those in poses, (n, 7): a turn w moves e by (0, w) e / 2."""
    w, u = q[:, 3:4], q[:, 4:]
    turns = 0.5 * (w * slopes[:, 4:] - slopes[:, 3:4] * u + np.cross(u, slopes[:, 4:]))
    return np.hstack([slopes[:, :3], turns])


class Sides:
    """The two faces of a contact, and the rows of q where their bodies stand."""

    def __init__(self, faces: tuple[BodyFace, BodyFace], bodies: tuple[int, int]) -> None:
        self.faces = faces
        self.bodies = list(bodies)

    def find(self, q: Array, start: Array | None) -> ContactPair:
        """The extremal pair near parameters, (4,), or that of a global start."""
        q_f, q_g = q[self.bodies]
        return extremal_pair(self.faces[0], q_f, self.faces[1], q_g, start)

    def find_again(self, q: Array, parameters: Array) -> ContactPair:
        """The extremal pair near parameters, else that of a global start."""
        pair = self.find(q, parameters)
        return pair if is_extremal(pair) else self.find(q, None)

    def wrench(self, q: Array, pair: ContactPair, scale: float) -> Array:
        """Gradient of the gap in the twists of f, then g, (2, 6): arms divided by `scale`."""
        arms = (pair.points - q[self.bodies, :3]) / scale
        forces = np.array([-pair.normal, pair.normal])
        return np.hstack([forces, np.cross(arms, forces)])

    def cross(self, q: Array, pair: ContactPair) -> bool:
        """Whether the surfaces cross beside the pair: the second order of their distance is indefinite."""
        # Rows: an orthonormal frame of the common tangent plane.
        tangents = np.linalg.svd(pair.normal[None])[2][1:]
        forms = []
        for side, body, (u, v) in zip(self.faces, self.bodies, pair.parameters.reshape(2, 2), strict=True):
            derivatives = rotate(q[body, 3:], np.array(side.face.surface.evaluate(u, v, 2)[1:]))
            rates = tangents @ derivatives[:2].T
            spans = np.linalg.norm(derivatives[:2], axis=1) * np.ptp(side.face.surface.domain, axis=1)
            if spans.min() <= _POLE * side.face.surface.size:
                return False
            uu, uv, vv = derivatives[2:] @ pair.normal
            inverse = np.linalg.inv(rates)
            forms.append(inverse.T @ np.array([[uu, uv], [uv, vv]]) @ inverse)
        low, high = np.linalg.eigvalsh(forms[1] - forms[0])
        return bool(low < -_FLAT * max(np.abs(forms).max(), abs(high)))


@dataclass(frozen=True, eq=False)
class Audit(ReadOnlyArrays):
    """What was found at a pose.

    Attributes
    ----------
    parameters : (k, 4)
        Of the extremal pairs.
    residuals : (m,)
        Of all rows, lengths over the scene's size.
    feasibility : float
        The largest violation, times the scene's size: in the user's unit of length.
    stationarity : float
        The largest component of the Lagrangian's gradient, and what one-sided rows lack in complementarity; scaled.
    held, balanced : bool
        Whether every pair is extremal and every row holds; whether the gradient counts as zero.
    crossing : bool
        Whether surfaces cross beside some pair.
    """

    parameters: Array
    residuals: Array
    feasibility: float
    stationarity: float
    held: bool
    balanced: bool
    crossing: bool


class Claim(NamedTuple):
    """A pose that a solver says to be a solution, and what it says of it; lengths over the scene's size.

    Attributes
    ----------
    q : (n, 7)
        In the user's unit of length.
    parameters : (k, 4)
        Near the pairs.
    forces : (m,)
        Multipliers of the rows.
    gradient : (n, 6)
        Of the objective, in twists.
    balance : (n, 6)
        The same with the forces of the rows after those of the contacts.
    aside : array
        The Lagrangian's gradient in what else is variable.
    """

    q: Array
    parameters: Array
    forces: Array
    gradient: Array
    balance: Array
    aside: Array


def audit(
    contacts: Sequence[Sides],
    others: Callable[[Array], Array],
    one_sided: NDArray[np.bool_],
    moving: Sequence[int],
    scale: float,
    claim: Claim,
) -> Audit:
    """Look at a pose afresh, whatever a solver said of it.

    Parameters
    ----------
    contacts : (k,)
    others : callable
        (n, 7) -> residuals of the rows after those of the contacts, lengths over `scale`.
    one_sided : (m,)
    moving : sequence of int
        Rows of q that are free.
    scale : float
        The scene's size.
    claim : Claim
    """
    q, forces, balance = claim.q, claim.forces, claim.balance.copy()
    pairs = []
    for contact, at, force in zip(contacts, claim.parameters, forces[: len(contacts)], strict=True):
        pairs.append(contact.find_again(q, at))
        balance[contact.bodies] += force * contact.wrench(q, pairs[-1], scale)
    residuals = np.concatenate([[pair.gap / scale for pair in pairs], others(q)])
    violation = float(np.where(one_sided, np.maximum(-residuals, 0.0), np.abs(residuals)).max(initial=0.0))
    # A row without force is complementary wherever it stands, at an infinite residual, too.
    slack = np.maximum(forces, np.abs(forces * np.where(forces == 0.0, 0.0, residuals)))[one_sided]
    parts = np.concatenate([np.abs(balance[moving]).ravel(), np.abs(claim.aside), slack])
    # A user's expression may have no value, and so no gradient.
    stationarity = float(np.nan_to_num(parts.max(initial=0.0), nan=np.inf, posinf=np.inf))
    return Audit(
        parameters=np.array([pair.parameters for pair in pairs]).reshape(-1, 4),
        residuals=residuals,
        feasibility=violation * scale,
        stationarity=stationarity,
        held=violation <= FEASIBILITY and all(map(is_extremal, pairs)),
        # Without a gradient nothing is balanced.
        balanced=stationarity <= STATIONARITY * (1.0 + float(np.abs(claim.gradient).max())) < np.inf,
        crossing=any(contact.cross(q, pair) for contact, pair in zip(contacts, pairs, strict=True)),
    )
