"""Objective, rows and the Hessian of the Lagrangian at a state as dense arrays; and poses beside it that hold."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.program import records as layout
from assembly.constraints.program.contact import TOUCHING
from assembly.solve.second_order.curvature import curvature_at, least_curvature, walk

__all__ = ["LocalModel", "Neighbor", "null_space"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# A multiplier that is stronger pushes.
PUSHING = 1e-7
# Multipliers that leave more of the objective's slope are balanced anew.
UNBALANCED = 1e-9
# What they may leave at a stationary point.
STATIONARY = 1e-6
# Singular values of rows of length one that count as none; what least squares take for none.
DEPENDENT, CUT = 1e-7, 1e-9
# The weight of rows that are kept, against the objective's curvature.
STIFFNESS = 1e6
# How much of an objective may be rounding, and how much of what rows are off, times their forces, is not linear.
NOISE, NONLINEAR = 2e-12, 0.3


@dataclass(frozen=True, eq=False)
class Neighbor:
    """A pose beside that of a model at which all rows hold.

    Attributes
    ----------
    state : array
    rise : float
        How much higher the objective is there; zero where that is within rounding.
    """

    state: Array
    rise: float


@dataclass(frozen=True, eq=False)
class LocalModel:
    """A packed scene to second order at a state, in the unknowns of the loop (`solve/second_order/curvature.py`).

    Attributes
    ----------
    state : array
        The state, with the tracked values found.
    table : array
        With the rows of clearances as the state has them.
    forces : (m,)
        Multipliers of all rows.
    value : float
        Of the objective.
    residual, gradient, jacobian, hessian : (m,), (n,), (m, n), (n, n)
        The Hessian is that of the objective + forces . rows.
    one_sided : (m,) bool
    """

    packed: Packed
    table: NDArray[np.int64]
    state: Array
    forces: Array
    value: float
    residual: Array
    gradient: Array
    jacobian: Array
    hessian: Array
    one_sided: Flags

    @classmethod
    def at(cls, packed: Packed, state: Array) -> LocalModel | None:
        """The model with the multipliers of the state; None where a contact has no pair or anything is not finite."""
        given = state[packed.multipliers_at : packed.residuals_at]
        model = cls._with(packed, packed.table_at(state), state, given)
        if model is None or not model._is_finite:
            return None
        forces = model._balanced()
        return model if np.array_equal(forces, model.forces) else model.under(forces)

    @classmethod
    def at_kink(cls, packed: Packed, state: Array) -> LocalModel | None:
        """The model where the objective has a value but perhaps no derivatives; they count as zero."""
        model = cls._with(packed, packed.table_at(state), state, np.zeros(packed.rows))
        if model is None:
            return None
        model = replace(model, gradient=np.zeros_like(model.gradient), hessian=np.zeros_like(model.hessian))
        return model if model._is_finite else None

    @classmethod
    def coarse(cls, packed: Packed, state: Array) -> LocalModel | None:
        """The model without derivatives, of a large scene, at the pose next to the state at which all rows hold."""
        table, n = packed.table_at(state), 6 * int(packed.table[layout.MOVING])
        state, residual = state.copy(), np.zeros(packed.rows + 4 * packed.pair_rows)
        kept = np.zeros(packed.rows)
        value = float(walk(table, packed.pool, state, np.zeros(n), 0.0, kept, residual, packed.end_effectors))
        if not np.isfinite(value):
            return None
        m = packed.rows
        forces = state[packed.multipliers_at : packed.residuals_at].copy()
        none = (np.zeros(n), np.zeros((m, 0)), np.zeros((0, 0)))
        return cls(packed, table, state, forces, value, residual[:m], *none, packed.one_sided)

    def least_curvature(self) -> tuple[float, Array]:
        """The least curvature along motions that keep the rows which push, and its direction, by inverse iteration."""
        direction = np.zeros(len(self.gradient))
        active = np.where(self.pushing, STIFFNESS, 0.0)
        arguments = (self.state, self.forces, active, direction, self.packed.end_effectors)
        return float(least_curvature(self.table, self.packed.pool, *arguments)), direction

    @classmethod
    def _with(cls, packed: Packed, table: NDArray[np.int64], state: Array, given: Array) -> LocalModel | None:
        most = packed.rows + 4 * packed.pair_rows
        columns = 6 * int(table[layout.MOVING]) + 4 * packed.pair_rows
        out = np.empty(1 + most + columns + most * columns + columns * columns)
        forces, state = np.zeros(most), state.copy()
        forces[: len(given)] = given
        folds = int(curvature_at(table, packed.pool, state, forces, out, packed.end_effectors))
        if folds < 0:
            return None
        m, n = packed.rows + 4 * folds, 6 * int(table[layout.MOVING]) + 4 * folds
        residual, gradient, jacobian, hessian = np.split(out[1:], np.cumsum([m, n, m * n, n * n]))[:4]
        one_sided = np.concatenate([packed.one_sided, np.zeros(m - packed.rows, dtype=bool)])
        shaped = (jacobian.reshape(m, n), hessian.reshape(n, n))
        return cls(packed, table, state, forces[:m], float(out[0]), residual, gradient, *shaped, one_sided)

    @property
    def _is_finite(self) -> bool:
        arrays = (self.value, self.residual, self.gradient, self.jacobian, self.hessian)
        return all(bool(np.isfinite(array).all()) for array in arrays)

    def under(self, forces: Array) -> LocalModel | None:
        """The same with other multipliers."""
        model = self._with(self.packed, self.table, self.state, forces)
        return model if model is not None and model._is_finite else None

    @property
    def touching(self) -> Flags:
        """Rows that count at first order: two-sided ones, and one-sided ones at their bound."""
        return ~self.one_sided | (np.abs(self.residual) <= TOUCHING)

    @property
    def pushing(self) -> Flags:
        """Rows that count whatever moves: two-sided ones, and one-sided ones at their bound with a force."""
        return ~self.one_sided | (self.touching & (self.forces < -PUSHING))

    @property
    def noise(self) -> float:
        """How much of the objective may be rounding."""
        return NOISE * (1.0 + abs(self.value))

    @property
    def is_stationary(self) -> bool:
        """Whether the multipliers balance the objective."""
        return bool(np.abs(self.gradient + self.jacobian.T @ self.forces).max(initial=0.0) <= STATIONARY)

    def _balanced(self) -> Array:
        """The multipliers, with what is missing where they do not balance the objective: rows of tangency have none."""
        left = self.gradient + self.jacobian.T @ self.forces
        rows = np.flatnonzero(self.touching)
        if not np.abs(left).max(initial=0.0) > UNBALANCED or not len(rows):
            return self.forces
        forces = self.forces.copy()
        forces[rows] -= np.linalg.lstsq(self.jacobian[rows].T, left, rcond=CUT)[0]
        forces[self.one_sided] = np.minimum(forces[self.one_sided], 0.0)
        return forces

    def neighbor(self, way: Array, share: float) -> Neighbor | None:
        """Where a share of a step leads, put back onto the rows; None where nothing near there holds.

        Rows that push stay at their bound: opened, they would take from the way what their forces do.
        """
        state, residual = self.state.copy(), np.zeros(len(self.residual))
        kept = np.where(self.one_sided & self.pushing, 1.0, 0.0)
        way = np.ascontiguousarray(way)
        value = walk(self.table, self.packed.pool, state, way, share, kept, residual, self.packed.end_effectors)
        if not np.isfinite(value):
            return None
        # What rows are off, within rounding, changes the objective by their forces.
        off = np.where(self.one_sided & (self.forces == 0.0), 0.0, residual)
        rise = float(value) - self.value + float(self.forces @ (off - self.residual))
        allowed = self.noise + NONLINEAR * float(np.abs(self.forces) @ np.abs(off))
        return Neighbor(state, rise if abs(rise) > allowed else 0.0)


def null_space(rows: Array, n: int) -> Array:
    """Orthonormal columns that rows of any length keep, (n, d)."""
    lengths = np.linalg.norm(rows, axis=1)
    rows = rows[lengths > DEPENDENT] / lengths[lengths > DEPENDENT, None]
    if not len(rows):
        return np.eye(n)
    _, values, right = np.linalg.svd(rows, full_matrices=True)
    basis: Array = right[int(np.count_nonzero(values > DEPENDENT)) :].T
    return basis
