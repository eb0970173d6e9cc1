"""The example of the coupler's path: the lengths that made it are found again."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example


def test_lengths_are_found_again(tmp_path):
    pytest.importorskip("matplotlib").use("Agg")
    run = run_example("path_synthesis", tmp_path, also=["path_synthesis.png"])
    found, known = run.result
    assert found.success and not found.failures
    # Steps of Gauss and Newton from a tenth off: 1e-1, 1e-2, 1e-4, 1e-8, and what solves leave.
    np.testing.assert_allclose(found.values, known, rtol=0, atol=1e-10)
    assert found.evaluations <= 10
    assert len(found.residuals) == 16 and np.abs(found.residuals).max() < 1e-10
