"""The simulation of a study on many machines: every row once, and times between what they must be."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location

import numpy as np
import pytest

from tests.examples.running import EXAMPLES


@pytest.fixture(scope="module")
def example():
    spec = spec_from_file_location("thousand_machines", EXAMPLES / "thousand_machines.py")
    module = module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(__import__("sys").modules, "thousand_machines", module)
        spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("between", [np.inf, 200.0])
@pytest.mark.parametrize("machines", [1, 7])
def test_every_row_comes_once_and_takes_its_time(example, machines, between):
    costs = example.Costs(np.array([0.5, 1.5]), 1e-4)
    rows = 5000
    found = example.simulated(costs, machines, between, rows=rows)
    assert found.rows == rows and (found.failures == 0) == (between == np.inf)
    work = found.useful * found.seconds * machines
    assert work == pytest.approx(rows * example.ROW, rel=0.1)
    # No less than its share of the work, and with failures no less than what these cost as well.
    assert found.seconds >= (work + found.lost * found.seconds * machines) / machines
    if between == np.inf:
        # The first three runs stand alone, then all machines have work.
        assert found.seconds <= 1.2 * work / machines + 3 * 32 * 1.5 * example.ROW
    again = example.simulated(costs, machines, between, rows=rows)
    assert again == found


def test_the_example_prints_a_row_each(example, capsys):
    outcomes = example.main(rows=4096)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 6 and [found.rows for found in outcomes] == [4096] * 5
