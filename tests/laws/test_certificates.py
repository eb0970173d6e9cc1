"""Certificates hold: no sample, and no minimum that Newton's method finds, is nearer than the lower bound.

The counts here take a second or two; `python -m tests.laws.certificates` makes 100,000 queries of each sort.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws.certificates import PAIRS, curve_queries, faults, point_queries
from tests.laws.curve_queries import CURVES


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kind", CURVES)
def test_points_and_curves(kind, dimension, cases):
    assert faults(point_queries(np.random.default_rng(1), kind, dimension, cases(40, 100)), 33) == []


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_two_curves(kinds, dimension, cases):
    assert faults(curve_queries(np.random.default_rng(2), kinds, dimension, cases(2, 10)), 25) == []
