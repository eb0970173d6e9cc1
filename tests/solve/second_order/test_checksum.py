"""What is kept of the one-sided rows of a factorization: `solve/loop/inertia.py`."""

from __future__ import annotations

import numpy as np

from assembly.solve.loop.inertia import checksum_of_rows

ROWS = 13


def test_sets_of_rows_have_checksums_of_their_own():
    # Of sums of squares 3 and 4 would be 5: an end would be taken for that of other rows.
    one_sided = np.ones(ROWS, dtype=np.int64)
    seen = set()
    for chosen in range(2**ROWS):
        weights = np.array([chosen >> r & 1 for r in range(ROWS)], dtype=float)
        seen.add(checksum_of_rows(ROWS, one_sided, weights, 0.0))
    assert len(seen) == 2**ROWS


def test_rows_that_have_no_weight_or_two_sides_do_not_count():
    one_sided, weights = np.array([1, 0, 1, 1]), np.array([1.0, 1.0, 1e-9, 1.0])
    both = checksum_of_rows(4, one_sided, weights, 1e-6)
    assert both == checksum_of_rows(4, np.array([1, 0, 0, 1]), np.ones(4), 0.0) > 0.0
