"""The example of the bolted plates: all parts are where they belong, nothing crosses, and that is proven."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("bolted_plates", tmp_path_factory.mktemp("bolted_plates"))


def test_all_parts_are_where_they_belong(run):
    scene, solution = run.result
    assert solution.success and solution.put_together and solution.proved
    for body in scene.bodies:
        side, _, kind = body.name.rpartition(" ")
        pose = solution.pose(body)
        place = [run.module.SIDES.get(side, 0.0), 0.0, run.module.HEIGHTS[kind]]
        # Rows hold to 1e-12 of the scene's size, some hundred.
        assert pose.position == pytest.approx(place, abs=1e-9)
        # Upright, turned about z as may be.
        assert pose.quaternion[1:3] == pytest.approx([0.0, 0.0], abs=1e-10)


def test_nothing_crosses_in_closed_form(run):
    """Coaxial, what has play has the difference of radii; what is flush is off by the heights that were printed."""
    module, (scene, solution) = run.module, run.result
    heights = {body.name: solution.pose(body).position[2] for body in scene.bodies}
    for side in module.SIDES:
        shank, away = solution.pose(f"{side} bolt").position[:2], solution.pose(f"{side} nut").position[:2]
        assert np.hypot(*(shank - away)) < module.BORE - module.SHANK
        for plate in ("lower", "upper"):
            hole = solution.pose(plate).position[:2] + [module.SIDES[side], 0.0]
            assert np.hypot(*(shank - hole)) < module.HOLE - module.SHANK
        head = heights[f"{side} bolt"] - 0.5 * module.HIGH - (heights["upper"] + 0.5 * module.THICK)
        nut = heights["lower"] - 0.5 * module.THICK - (heights[f"{side} nut"] + 0.5 * module.HIGH)
        assert min(head, nut) > -1e-10
    assert heights["upper"] - heights["lower"] - module.THICK > -1e-10


def test_it_prints_where_parts_are_and_belong(run):
    assert run.lines[0] == "SOLVED: put together first: True, proved: True"
    assert len(run.lines) == 8
    for line in run.lines[2:]:
        x, y, z, at, height = map(float, line.split()[-5:])
        assert (x, y, z) == (at, 0.0, height)
    assert "MeshCat.Viewer" in run.page
