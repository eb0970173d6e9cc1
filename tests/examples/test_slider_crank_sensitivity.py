"""The example of the slider-crank: its derivatives against numbers from elsewhere, and what it prints."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example

# By multiple precision, of the closed form.
EXACT = (-1.696392624895384, 0.593033361407271, 1.034951956465550)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    pytest.importorskip("matplotlib").use("Agg")
    return run_example(
        "slider_crank_sensitivity",
        tmp_path_factory.mktemp("slider_crank_sensitivity"),
        also=["slider_crank_sensitivity.png"],
    )


def test_derivatives_are_those_of_the_closed_form(run):
    d, closed, _, _ = run.result
    # The driven angle holds to rounding; what it leaves is multiplied by derivatives of order one.
    assert np.abs(d.matrix[0] - EXACT).max() < 1e-12 and np.abs(closed - EXACT).max() < 1e-14
    assert not d.undetermined.any() and not d.reasons and d.rank == 18


def test_a_longer_crank_moves_the_piston_by_the_derivative(run):
    _, _, predicted, moved = run.result
    # x_rr is -0.092: half of it times the square of 0.01.
    assert moved - predicted == pytest.approx(-4.6e-6, abs=1e-7)
    assert predicted == pytest.approx(0.00593033361407, abs=1e-13)


def test_it_prints_a_table_with_units(run):
    assert run.lines[0] == "the piston is at 6.360826505142"
    assert run.lines[1].split() == "d / d angle [rad] crank [length] rod [length]".split()
    assert run.lines[2].split() == "stroke [length] -1.6963926 0.59303336 1.034952".split()
    assert run.lines[4] == "closed form: -1.6963926 0.59303336 1.034952"
    assert run.lines[5].startswith("a crank longer by 0.01: 0.00593033 by the derivative")
