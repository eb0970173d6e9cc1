"""A curve given by a formula packed for the search of `distance/patches/search.py`: tables of `formula_nodes.py`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.expression import formula
from assembly.geometry.splines.bezier_pieces import CENTER, ERROR, HEAD, REACH, UNIT, WEIGHT_RATIO
from assembly.geometry.splines.formula_curve import FormulaCurve

__all__ = ["Formula", "about", "pack_formula"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
# Table and pool of the curve, about its center.
Formula = tuple[Ints, Array]
# Pieces whose rounding is looked at.
_LOOKS = 16


def pack_formula(curve: FormulaCurve) -> tuple[Ints, Array, Formula]:
    """Record and pool of a patch of degrees 2 and 0 that stands for it, and the curve itself about its center.

    `pool[ERROR]` is how far points typically are off: by it a search knows when doubles end, no bound rests on it.
    """
    low, high = np.zeros(3), np.zeros(3)
    low[: curve.dimension], high[: curve.dimension] = curve.bounding_box()
    center = 0.5 * low + 0.5 * high
    head = np.zeros(HEAD)
    # The center is rounded, too.
    head[REACH] = float(np.linalg.norm(0.5 * (high - low))) * (1.0 + 16.0 * UNIT) + 4.0 * UNIT * np.abs(center).sum()
    at = np.linspace(*curve.domain, _LOOKS)
    width = np.ptp(curve.bounds(at, at)[:, 0], axis=1)
    head[ERROR] = 0.5 * float(np.median(np.linalg.norm(width, axis=1)))
    head[CENTER : CENTER + 3] = center
    head[WEIGHT_RATIO] = 1.0
    # Parameters are the curve's own: breaks, tables and the net of a patch are not there.
    record = np.array([2, 0, 1, 1, 0, HEAD, HEAD, HEAD, HEAD, HEAD], dtype=np.int64)
    return record, head, about(curve, center)


def about(curve: FormulaCurve, center: Array) -> Formula:
    """Table and pool of the curve about a center."""
    table, pool = curve.packed()
    pool = pool.copy()
    pool[formula.CENTER : formula.CENTER + 3] = center
    return table, pool
