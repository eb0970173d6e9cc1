"""The example of the crank: it goes all around, proven to be clear; the rocker is where circles meet."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.examples.running import run_example


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("crank_with_thick_links", tmp_path_factory.mktemp("crank_with_thick_links"))


def test_it_goes_all_around(run):
    assert len(run.result) == 73 and all(solution.success and solution.proved for solution in run.result)
    angles = np.array([solution.values["drive.angle"] for solution in run.result])
    assert angles == pytest.approx(np.linspace(0.0, 2.0 * np.pi, 73), abs=1e-12)


def test_the_rocker_is_where_circles_meet(run):
    for solution in run.result:
        assert solution.values["swing.angle"] == pytest.approx(
            run.module.swing(solution.values["drive.angle"]), abs=1e-11
        )


def test_links_lie_on_each_other_and_pins_in_their_bores(run):
    """All are flat and upright: heights tell what is on what, and each pin is in the middle of two bores."""
    heights = {"crank": 6.0, "coupler": 12.0, "rocker": 6.0, "pin A": 3.0, "pin B": 9.0, "pin C": 9.0, "pin D": 3.0}
    lengths = run.module.LENGTHS
    bored = {"A": ("ground", -1, "crank", -1), "B": ("crank", 1, "coupler", -1)}
    bored |= {"C": ("rocker", 1, "coupler", 1), "D": ("ground", 1, "rocker", -1)}
    for solution in run.result:
        for name, height in heights.items():
            # 2e-13 of the size, 120, and what slopes of rows make of it.
            assert solution.pose(name).position[2] == pytest.approx(height, abs=1e-10)
            assert solution.pose(name).quaternion[1:3] == pytest.approx([0.0, 0.0], abs=1e-11)
        for pin, (one, end, other, side) in bored.items():
            for link, at in ((one, end), (other, side)):
                bore = solution.pose(link).apply((0.5 * at * lengths[link], 0.0, 0.0))
                assert np.hypot(*(solution.pose(f"pin {pin}").position - bore)[:2]) < 1e-9


def test_no_contact_is_looked_for_on_the_way(run):
    """Joints say where all goes; each step is proven after it."""
    assert all(solution._lists is not None for solution in run.result[1:])
    # Poses follow each other: no step leads to the other way to close the four-bar.
    assert all(np.abs(b.q - a.q)[:, :3].max() < 6.0 for a, b in pairwise(run.result))


def test_it_prints_the_rocker(run):
    assert run.lines[0] == "72 of 72 steps are solved, and proven to be clear"
    assert len(run.lines) == 15
    for line in run.lines[2:]:
        _, found, exact = line.split()
        assert found == exact
    assert "MeshCat.Viewer" in run.page and "crank 180 deg" in run.page
