"""Rank and null space of rows of mixed units, free of scale and of where bodies have their origins.

Lengths come divided by the scene's size. The twist of each body is taken at the point about which the moments of its
rows are least, so that it does not matter where the body's origin is; then every row is divided by its length. The
singular values of the result are of order one, or tell of dependent rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.loop.parameters import NEIGHBORHOOD

__all__ = ["HELD", "SMALLEST", "Balanced", "centered", "orthonormal", "tolerance_at"]

Array = NDArray[np.float64]
# The tolerance at a pose that is exact to rounding.
SMALLEST = 1e-7
# A violation that counts as none, lengths over the scene's size; where there is more, the pose is taken as it is.
HELD = 1e-9
# Within this factor of the tolerance the largest gap between singular values decides.
NEAR = 10.0
# With so many rows or columns a decomposition takes so long that it runs in a thread, which can be interrupted.
LARGE = 200


def tolerance_at(residual: float, fit: float) -> float:
    """The singular value that counts as zero where the rows hold to a residual, lengths over the scene's size.

    Where rows have no first-order part along some motion, a residual c leaves the pose uncertain by the square root
    of c, and singular values with it. Rows that repeat each other and disagree by so much, up to `fit`, are tilted
    against each other by about as much (`solve/attempts/fit.py`).
    """
    if residual <= HELD:
        return max(SMALLEST, 10.0 * float(np.sqrt(residual)))
    return max(SMALLEST, residual / NEIGHBORHOOD) if residual <= fit else SMALLEST


@dataclass(frozen=True, eq=False)
class Balanced:
    """Rows made ready for rank decisions.

    Attributes
    ----------
    rows : (m, 6 k)
        In the twists of k bodies, each at its own center; of length one, or zero.
    centers : (k, 3)
        From the bodies' origins, world axes.
    singular_values : (6 k,)
        Of the rows, falling, as many as there are columns.
    right : (6 k, 6 k)
        Right singular vectors as rows.
    tolerance : float
        Singular values below count as zero.
    near : float
        Within this factor of the tolerance the widest gap between singular values decides.
    """

    rows: Array
    centers: Array
    singular_values: Array
    right: Array
    tolerance: float
    near: float

    @classmethod
    def of(
        cls,
        jacobian: Array,
        residual: float,
        tolerance: float | None = None,
        fit: float = 0.0,
        interruption: Interruption = CTRL_C,
    ) -> Balanced:
        """Balance rows in twists at the bodies' origins that hold to a residual; a tolerance decides if it is given.

        `fit` as of `tolerance_at`. TimeoutError where the interruption's time is over before.
        """
        rows, centers = centered(jacobian)
        lengths = np.linalg.norm(rows, axis=1, keepdims=True)
        expected = tolerance_at(residual, fit)
        counts = lengths > expected
        rows = np.where(counts, rows / np.where(counts, lengths, 1.0), 0.0)
        m, n = rows.shape
        values, right = np.zeros(n), np.eye(n)
        if m > 0 and n > 0:
            found, right = _decomposed(rows, m < n, interruption)[1:]
            values[: len(found)] = found
        decides = (expected, NEAR) if tolerance is None else (tolerance, 1.0)
        return cls(rows, centers, values, right, *decides)

    @cached_property
    def rank(self) -> int:
        """How many singular values count."""
        return self._cut(self.singular_values)

    def free(self, interruption: Interruption = CTRL_C) -> Array:
        """Orthonormal motions that no row forbids, (d, 6 k): twists at the bodies' origins."""
        motions = self.right[self.rank :].reshape(-1, len(self.centers), 6).copy()
        motions[:, :, :3] -= np.cross(motions[:, :, 3:], self.centers[None])
        return orthonormal(motions.reshape(len(motions), 6 * len(self.centers)), interruption)

    def _cut(self, values: Array) -> int:
        """How many of falling singular values count."""
        if not values[0] > self.tolerance:
            return 0
        low = max(1, int(np.count_nonzero(values > self.near * self.tolerance)))
        high = max(1, int(np.count_nonzero(values > self.tolerance / self.near)))
        # What is smaller than this is rounding.
        logs = np.log(np.maximum(np.append(values, 0.0), 1e-16))
        return low + int(np.argmax(logs[low - 1 : high] - logs[low : high + 1]))

    def dependencies(self, interruption: Interruption = CTRL_C) -> Array:
        """Orthonormal combinations of rows that vanish, (m - rank, m)."""
        left = _decomposed(self.rows, True, interruption)[0]
        return left[:, self.rank :].T


def _decomposed(matrix: Array, full: bool, interruption: Interruption) -> tuple[Array, Array, Array]:
    """The singular value decomposition of a matrix, with square factors on both sides if it is to be full."""
    compute = partial(np.linalg.svd, matrix, full_matrices=full)
    left, values, right = interruption.wait_for("rank", compute) if max(matrix.shape) >= LARGE else compute()
    return left, values, right


def centered(jacobian: Array) -> tuple[Array, Array]:
    """Rows in twists at the bodies' origins (m, 6 k) in twists at each body's own center; the centers, (k, 3)."""
    blocks = jacobian.reshape(len(jacobian), jacobian.shape[1] // 6, 6)
    centers = _centers(blocks)
    shifted = blocks.copy()
    shifted[:, :, 3:] -= np.cross(centers[None], blocks[:, :, :3])
    return shifted.reshape(jacobian.shape), centers


def _centers(blocks: Array) -> Array:
    """The points (k, 3) about which the moments h - c x n of rows (m, k, 6) are least, from the origins."""
    n, h = blocks[:, :, :3], blocks[:, :, 3:]
    # sum (n.n I - n n^T) c = sum n x h
    square = np.einsum("mki,mkj->kij", n, n)
    normal = np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3) - square
    moments = np.cross(n, h).sum(axis=0)
    centers: Array = (np.linalg.pinv(normal, rcond=1e-9, hermitian=True) @ moments[:, :, None])[:, :, 0]
    return centers


def orthonormal(motions: Array, interruption: Interruption = CTRL_C) -> Array:
    """An orthonormal basis of the span of independent rows, near to coordinate axes and the same in every run.

    Each is the unit motion nearest to a coordinate axis, that which has most of it in what is left of the span.
    """
    left = np.linalg.qr(motions.T)[0].T
    basis = []
    while len(left):
        interruption.check("free motions")
        most = np.linalg.norm(left, axis=0)
        # The first of those that are the same up to rounding.
        axis = int(np.flatnonzero(most >= (1.0 - 1e-6) * most.max())[0])
        along = left[:, axis] / most[axis]
        basis.append(along @ left)
        # What is orthogonal to it.
        left = np.linalg.svd(along[None])[2][1:] @ left
    return np.array(basis).reshape(motions.shape)
