"""The example of the shaft: from parts that lie about into its bearings, and to both ends of its way."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("shaft_in_bearings", tmp_path_factory.mktemp("shaft_in_bearings"))


def test_all_poses_hold_and_are_proven(run):
    assert len(run.result) == run.module.STEPS + 1
    assert all(solution.success and solution.proved for solution in run.result)
    assert run.result[0].put_together and not any(solution.put_together for solution in run.result[1:])


def test_the_shaft_is_in_both_bores_and_its_collar_between_them(run):
    module = run.module
    for solution in run.result:
        left, right, shaft = (solution.pose(name) for name in ("left", "right", "shaft"))
        assert left.position == pytest.approx([-0.5 * module.APART, 0.0, 0.0], abs=1e-10)
        assert right.position == pytest.approx([0.5 * module.APART, 0.0, 0.0], abs=1e-10)
        ends = shaft.apply(0.5 * module.LENGTH * np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]))
        # Rows hold to 2e-13 of the size, some 140; the play is 0.02.
        assert np.abs(ends[:, 1:]).max() < 1e-9
        assert np.abs(shaft.position[0]) <= module.FREE + 1e-10
    at = [solution.pose("shaft").position[0] for solution in run.result]
    assert [max(at), min(at)] == pytest.approx([module.FREE, -module.FREE], abs=1e-10)


def test_it_turns_twice(run):
    angles = [solution.values["axis.angle"] for solution in run.result]
    assert angles == pytest.approx(np.linspace(0.0, 4.0 * np.pi, run.module.STEPS + 1), abs=1e-11)


def test_it_prints_what_is_left_beside_the_collar(run):
    assert run.lines[0] == "SOLVED: put together first: True"
    assert len(run.lines) == 15 and all(line.endswith("SOLVED, proved") for line in run.lines[2:])
    for line in run.lines[2:]:
        at, left, right = map(float, line.split()[1:4])
        assert left + right == pytest.approx(2.0 * run.module.FREE, abs=2e-6)
        assert left - right == pytest.approx(2.0 * at, abs=2e-4)
    assert "MeshCat.Viewer" in run.page
