"""How far a pose may be from one at which the rows hold exactly, from their residuals.

With the active rows' Jacobian J = U S V^T, a residual of length e along a direction of singular value s is taken back
by a move of e / s. Where s all but vanishes, the rows' second derivative k decides. The residual may have either sign,
so that the move is bounded by the root of s d - k d^2 / 2 = e, or, where that has none, by that of s = 0,

    d = 2 e / (s + sqrt(s^2 - 2 k e)),    s^2 >= 2 k e,
    d = sqrt(2 e / k)                     else,

which is e / s for large s, and is continuous. k is that of the forms

    A_l = sum_r U_rl d2 (residual r) / dx2,    restricted to V_soft,

one for every left singular vector U_l that no large singular value belongs to: the singular values of all of them, one
below the other, are the k, and their right singular vectors the directions. Where both s and k vanish the pose can go
on, as rows that depend on each other let it: a motion that is free, and no error.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.errors import InputError
from assembly.kinematics.pose import retract
from assembly.solve.dense.jacobian import Rows, moving_columns, rows_of
from assembly.solve.loop.parameters import ROUNDING
from assembly.solve.scene import Scene

__all__ = ["pose_error"]

Array = NDArray[np.float64]
# From this singular value on, second derivatives of a residual that counts as held do not matter.
STIFF = 1e-3
# Below these a singular value and a second derivative are zero; the latter are found by differences.
NO_SLOPE, NO_CURVATURE = 1e-7, 1e-6
# Step of the differences, in sizes of the scene and radians: rounding over it and its square are both below 1e-8.
STEP = 1e-4
# One-sided rows this near to their bound count, in sizes of the scene; and the largest violation with which errors are
# given.
BINDING, FARTHEST_OFF = 1e-9, 1e-6


def pose_error(scene: Scene, packed: Packed, state: Array) -> float:
    """The largest root d above, in sizes of the scene and radians; infinite where rows do not hold to 1e-6."""
    try:
        return Balance.at(scene, packed, state).error()
    except InputError:
        # A contact has no pair here, or an expression no slope.
        return inf


@dataclass(frozen=True, eq=False)
class Balance:
    """The active rows at a pose.

    Attributes
    ----------
    columns : array
        Of the Jacobian, those of bodies that move.
    off : float
        Length of the residuals, and of what rounding of coordinates leaves of them.
    """

    packed: Packed
    rows: Rows
    active: NDArray[np.bool_]
    columns: NDArray[np.int64]
    off: float

    @classmethod
    def at(cls, scene: Scene, packed: Packed, state: Array) -> Balance:
        """Evaluate the rows at a state."""
        rows = rows_of(packed, state)
        active = ~rows.one_sided | (rows.residual <= BINDING)
        reach = float(np.abs(rows.state[: packed.contacts_at].reshape(-1, 7)[:, :3] - packed.reference).max())
        off = float(np.linalg.norm(rows.residual[active])) + ROUNDING * (1.0 + reach / packed.scale)
        columns = moving_columns([k for k, body in enumerate(scene.bodies) if not body.fixed])
        return cls(packed, rows, active, columns, off)

    def error(self) -> float:
        """The largest root, over all directions."""
        if not np.abs(self.rows.residual[self.active]).max(initial=0.0) <= FARTHEST_OFF:
            return inf
        if not self.active.any():
            return 0.0
        jacobian = self._jacobian(self.rows)
        left, values, right = np.linalg.svd(jacobian)
        stiff = int((values >= STIFF).sum())
        largest = self.off / float(values[stiff - 1]) if stiff else 0.0
        soft = right[stiff:]
        if not len(soft):
            return largest
        forms = [left[:, stiff:].T @ self._change(direction) @ soft.T for direction in soft]
        # One below the other: with the derivative along v_j the rows of each are its left vectors, the columns the v_k.
        _, found, along = np.linalg.svd(np.concatenate(forms))
        bends = np.zeros(len(soft))
        bends[: len(found)] = found
        slopes = np.linalg.norm(jacobian @ (along @ soft).T, axis=0)
        for slope, bend in zip(slopes.tolist(), bends.tolist(), strict=True):
            if slope > NO_SLOPE or bend > NO_CURVATURE:
                largest = max(largest, _root(self.off, slope, bend if bend > NO_CURVATURE else 0.0))
        return largest

    def _jacobian(self, rows: Rows) -> Array:
        active: Array = rows.jacobian[np.ix_(np.flatnonzero(self.active), self.columns)]
        return active

    def _change(self, direction: Array) -> Array:
        """The derivative of the Jacobian along a twist of the bodies that move."""
        twist = np.zeros(6 * self.packed.count)
        twist[self.columns] = direction
        twist = twist.reshape(-1, 6) * np.repeat([self.packed.scale, 1.0], 3)
        q = self.rows.state[: self.packed.contacts_at].reshape(-1, 7)
        sides = []
        for step in (STEP, -STEP):
            state = self.rows.state.copy()
            state[: self.packed.contacts_at] = retract(q, step * twist).ravel()
            moved = rows_of(self.packed, state)
            if len(moved.residual) != len(self.rows.residual):
                raise InputError("a contact comes to a fold nearby; expected the same rows")
            sides.append(self._jacobian(moved))
        change: Array = (sides[0] - sides[1]) / (2.0 * STEP)
        return change


def _root(off: float, slope: float, bend: float) -> float:
    """The move that takes a residual back, as above."""
    rest = slope * slope - 2.0 * bend * off
    return 2.0 * off / (slope + sqrt(rest)) if rest >= 0.0 else sqrt(2.0 * off / bend)
