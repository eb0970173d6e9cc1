"""The example of a six-bar's designs, with fewer of them: it goes on after the kill, and its front is one."""

from __future__ import annotations

import os

import numpy as np
import pytest

from tests.examples.running import EXAMPLES, run_example


def test_designs(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib").use("Agg")
    if os.name == "nt":
        pytest.skip("the process that the example kills is killed by a signal")
    monkeypatch.setenv("PYTHONPATH", str(EXAMPLES.parent))
    run = run_example(
        "dexterity_study",
        tmp_path,
        also=["dexterity_study", "dexterity_study.png"],
        main=lambda module: module.main(designs=400),
    )
    found, finished = run.result
    assert 0 < finished <= 400 and len(found) == 400 and not found.interrupted
    assert found.success.sum() > 300
    # By hand: from the crank's pin to the rocker's post, and the sine of the triangle's angle across.
    held = found.table[found.success]
    pin = held["crank"] * np.exp(1.1j)
    reach = abs(pin - 80.0)
    cosine = (held["coupler"] ** 2 + 60.0**2 - reach**2) / (2.0 * held["coupler"] * 60.0)
    assert held["transmission"] == pytest.approx(np.sqrt(1.0 - cosine**2), abs=1e-9)
    front = found.pareto(maximize=["speed", "transmission"])
    assert len(front) > 3 and (np.diff(front["speed"]) <= 0.0).all()
    assert run.lines[1].startswith("400 designs (grid)")
