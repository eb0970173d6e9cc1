"""The least rigid move that opens the contacts of two bodies: if they are clear after it, they only touch.

A contact with the normal n, from a to b, at an arm p from the middle of b opens by n.(v + w x p) as b is moved by v and
turned by w. The least move that opens every contact by what is asked of it is a least distance program, and a problem
of non-negative least squares (Lawson and Hanson, "Solving Least Squares Problems", chapter 23).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

__all__ = ["least_affine", "least_change", "least_move", "least_shift", "least_similar"]

Array = NDArray[np.float64]
# Residuals of the least squares problem, over what is asked, below which no move opens all contacts.
NONE_LEFT = 1e-9


def least_move(normals: Array, arms: Array, asked: Array, radius: float) -> Array | None:
    """The least move that opens contacts.

    Parameters
    ----------
    normals, arms : (m, 3)
        Unit vectors from a to b, and where contacts are from the middle of b, in the same axes.
    asked : (m,)
        By how much each is to open; where it is negative, it may close by so much.
    radius : float
        Of b: a turn by 1 counts as a way of so much.

    Returns
    -------
    (6,) or None
        A translation and a rotation vector about the middle of b; None where contacts hold b from all sides.
    """
    rates = np.empty((len(normals), 6))
    (x, y, z), (u, v, w) = arms.T, normals.T
    # As np.cross has it, which takes longer than all the rest.
    rates[:, :3], rates[:, 3], rates[:, 4], rates[:, 5] = normals, y * w - z * v, z * u - x * w, x * v - y * u
    rates[:, 3:] /= radius
    move = least_change(rates, asked)
    if move is not None:
        move[3:] /= radius
    return move


def least_similar(normals: Array, arms: Array, asked: Array, radius: float) -> Array | None:
    """The least x -> x + v + s x that opens contacts, in the sense of |v|^2 + R^2 s^2, as `least_affine` has it."""
    found = least_change(np.column_stack([normals, (arms * normals).sum(axis=1) / radius]), asked)
    return None if found is None else np.vstack([found[:3], found[3] / radius * np.eye(3)])


def least_affine(normals: Array, arms: Array, asked: Array, radius: float) -> Array | None:
    """The least affine map x -> x + v + W x that opens contacts, in the sense of |v|^2 + R^2 |W|^2.

    Parameters
    ----------
    normals, arms, asked, radius
        As of `least_move`; W by 1 counts as a way of R.

    Returns
    -------
    (4, 3) or None
        v and then the columns of W; None where no affine map opens all.
    """
    strains = arms[:, :, None] * normals[:, None, :] / radius
    found = least_change(np.column_stack([normals, strains.reshape(-1, 9)]), asked)
    if found is None:
        return None
    found[3:] /= radius
    return found.reshape(4, 3)


def least_shift(normals: Array, asked: Array) -> Array | None:
    """The least translation (3,) of b that opens contacts, as `least_move` has them; None where none does."""
    return least_change(normals, asked)


def least_change(rates: Array, asked: Array) -> Array | None:
    """The shortest x with rates x >= asked, or None."""
    if asked.max() <= 0.0:
        return np.zeros(rates.shape[1])
    unit = float(asked.max())
    design = np.vstack([rates.T, asked / unit])
    goal = np.zeros(len(design))
    goal[-1] = 1.0
    weights, _ = nnls(design, goal)
    rest = design @ weights - goal
    if -rest[-1] <= NONE_LEFT:
        return None
    return np.asarray(-rest[:-1] / rest[-1] * unit)
