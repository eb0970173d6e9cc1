"""The example of the report: what is drawn wrong is found, with depths and gaps in closed form."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from tests.examples.running import run_example


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("interference_report")


@pytest.fixture(scope="module")
def run(folder):
    return run_example("interference_report", folder, ["interference_report.csv"])


def test_what_is_drawn_wrong_is_found(run):
    found = {row.bodies: (row.kind, row.proved, row.gap) for row in run.result}
    # The hole's wall reaches as far into the screw as its middle is off and its radius does not leave.
    module = run.module
    into = module.SCREW + module.WRONG - module.HOLE
    assert found["cover", "right screw"] == ("crossing", True, pytest.approx(-into, abs=1e-9))
    assert found["handle", "weight"] == ("enclosed", True, pytest.approx(-2.0, abs=1e-9))
    assert found["board", "handle"][0] == "touching"
    assert found["housing", "cover"] == ("touching", True, pytest.approx(0.0, abs=1e-12))
    # Nearest points are sought to 1e-9 of the size.
    assert found["cover", "board"] == ("clear", True, pytest.approx(0.3, abs=1e-10))
    # Nearest all around, which radii about the axis prove.
    assert found["cover", "left screw"] == ("clear", True, pytest.approx(0.4, abs=1e-9))
    assert len(found) == 8


def test_it_is_printed_and_written(run, folder):
    assert run.lines[0] == "21 pairs, within 0.5: 4 clear, 2 touching, 1 crossing, 1 enclosed"
    with open(folder / "interference_report.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["a"], row["b"]) for row in rows] == [row.bodies for row in run.result]
    # Where the cover's hole is nearest to the axis of the screw.
    module, crossing = run.module, rows[1]
    wall = np.array([float(crossing[key]) for key in ("ax", "ay")])
    assert wall == pytest.approx([module.RIGHT + module.WRONG - module.HOLE, 0.0], abs=1e-6)
    assert 10.0 - 1e-9 <= float(crossing["az"]) <= 16.0 + 1e-9
