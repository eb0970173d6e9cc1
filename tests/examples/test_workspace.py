"""The example of the arm's workspace: areas by closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("workspace", tmp_path_factory.mktemp("workspace"))


def test_areas(run):
    module = run.module
    free, stops, both = run.result
    outer, inner = module.UPPER + module.FORE, module.UPPER - module.FORE
    # Cells are 1/25 of the outer radius; errors are their square.
    assert free.estimate == pytest.approx(np.pi * (outer**2 - inner**2), rel=2e-4)
    least = np.hypot(module.UPPER + module.FORE * np.cos(2.4), module.FORE * np.sin(2.4))
    assert stops.estimate == pytest.approx(np.pi * (outer**2 - least**2), rel=5e-4)
    gone = np.pi * (module.POST + module.TIP) ** 2
    assert stops.estimate - both.estimate == pytest.approx(gone, rel=0.05)


def test_what_it_prints(run):
    assert [line.split()[0] for line in run.lines] == ["neither", "stops", "stops", "4"]
    assert run.lines[-1].split() == ["4", "pi", "l1", "l2", "753982", "mm^2"]
