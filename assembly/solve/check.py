"""What a pose is worth: its extremal pairs found afresh, their wrenches, and whether surfaces cross beside them.

At a solution the wrenches of the contacts balance the objective,

    grad f + sum_k y_k [-n, -(f - x_f) x n, n, (g - x_g) x n]_k = 0,

all in twists. Nothing here uses the derivatives of a solver.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.body import BodyFace
from assembly.kinematics.pose import rotate
from assembly.proximity.pairs import ContactPair, PairStatus, extremal_pair

__all__ = ["FEASIBILITY", "STATIONARITY", "Audit", "Sides", "audit", "is_extremal", "twist_gradients"]

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
class Audit:
    """What was found at a pose.

    Attributes
    ----------
    parameters : (k, 4)
        Of the extremal pairs.
    gaps : (k,)
        In the user's units, as is `feasibility`, the largest violation.
    stationarity : float
        The largest component of the Lagrangian's gradient, and what one-sided contacts lack in complementarity; scaled.
    held, balanced : bool
        Whether every pair is extremal and its row holds; whether the gradient counts as zero.
    crossing : bool
        Whether surfaces cross beside some pair.
    """

    parameters: Array
    gaps: Array
    feasibility: float
    stationarity: float
    held: bool
    balanced: bool
    crossing: bool


def audit(
    contacts: Sequence[Sides],
    one_sided: NDArray[np.bool_],
    q: Array,
    parameters: Array,
    forces: Array,
    gradient: Array,
    moving: Sequence[int],
    scale: float,
) -> Audit:
    """Look at a pose afresh, whatever a solver said of it.

    Parameters
    ----------
    contacts, one_sided : (k,)
    q : (n, 7)
    parameters : (k, 4)
        Near the pairs.
    forces : (k,)
        Multipliers of the gaps, lengths over `scale`.
    gradient : (n, 6)
        Of the objective, in twists, lengths over `scale`.
    moving : sequence of int
        Rows of q that are free.
    scale : float
        The scene's size.
    """
    balance = gradient.copy()
    pairs = []
    for contact, at, force in zip(contacts, parameters, forces, strict=True):
        pairs.append(contact.find_again(q, at))
        balance[contact.bodies] += force * contact.wrench(q, pairs[-1], scale)
    gaps = np.array([pair.gap for pair in pairs])
    feasibility = float(np.where(one_sided, np.maximum(-gaps, 0.0), np.abs(gaps)).max(initial=0.0))
    slack = np.where(one_sided, np.maximum(forces, np.abs(forces * gaps / scale)), 0.0)
    stationarity = max(float(np.abs(balance[moving]).max()), float(slack.max(initial=0.0)))
    return Audit(
        parameters=np.array([pair.parameters for pair in pairs]).reshape(-1, 4),
        gaps=gaps,
        feasibility=feasibility,
        stationarity=stationarity,
        held=feasibility <= FEASIBILITY * scale and all(map(is_extremal, pairs)),
        balanced=stationarity <= STATIONARITY * (1.0 + float(np.abs(gradient).max())),
        crossing=any(contact.cross(q, pair) for contact, pair in zip(contacts, pairs, strict=True)),
    )
