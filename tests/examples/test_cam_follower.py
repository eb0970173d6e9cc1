"""The example of the cam: the roller's heights against the offset of the profile, found in two more ways."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("cam_follower", tmp_path_factory.mktemp("cam_follower"))


def test_heights_are_those_of_the_offset_curve(run):
    angles, solutions = run.result
    assert len(solutions) == 73 and all(solution.success for solution in solutions)
    found = np.array([solution.values["guide.slide"] for solution in solutions])
    # Gaps hold to 2e-13 of the largest extent, some 130, slopes of the profile are below one.
    assert found == pytest.approx(run.module.heights(angles), abs=1e-10)
    # On the axis of symmetry: radii of 25 and 37, and the roller's 8.
    assert found[[18, 54]] == pytest.approx([33.0, 45.0], abs=1e-10)
    assert found[0] == pytest.approx(found[-1], abs=1e-10)


def test_heights_are_the_lowest_at_which_no_point_of_the_cam_is_in_the_roller(run):
    angles, solutions = run.result
    (wall,) = [side.face.surface for side in solutions[0]._scene.bodies[1].faces if side.name == "cam"]
    around = np.linspace(*wall.domain[0], 200001)
    profile = wall.evaluate(around, np.full(around.size, wall.domain[1][0]))[:, :2] @ [1.0, 1j]
    for angle, solution in list(zip(angles, solutions, strict=True))[::8]:
        turned = profile * np.exp(1j * angle)
        under = turned[np.abs(turned.real) < run.module.ROLLER]
        lowest = (under.imag + np.sqrt(run.module.ROLLER**2 - under.real**2)).max()
        # Points are 1e-3 apart on the profile, near the touching one: the square of that.
        assert solution.values["guide.slide"] == pytest.approx(lowest, abs=1e-6)


def test_cam_and_roller_touch_along_a_line(run):
    _, solutions = run.result
    for solution in solutions[::8]:
        pair = solution.contacts["touch"]
        assert abs(pair.gap) < 1e-10 and pair.normal[2] == pytest.approx(0.0, abs=1e-12)
        axis = solution.pose("roller").position
        assert np.hypot(*(pair.points[1] - axis)[:2]) == pytest.approx(run.module.ROLLER, abs=1e-10)
        assert pair.points[1] == pytest.approx(pair.points[0], abs=1e-10)


def test_one_freedom_is_left_without_the_drive(run):
    scene, _ = run.module.cam_and_roller()
    solution = scene.solve()
    assert scene.mobility(solution).dof == 0 and scene.mobility(solution, drives=False).dof == 1


def test_it_prints_both(run):
    angles, solutions = run.result
    assert len(run.lines) == 14
    for line, angle, solution in zip(run.lines[1:], angles[::6], solutions[::6], strict=True):
        degrees, found, exact, status = line.split()
        assert float(degrees) == pytest.approx(np.degrees(angle), abs=0.051) and status == "SOLVED"
        assert float(found) == pytest.approx(solution.values["guide.slide"], abs=5.1e-13)
        assert float(exact) == pytest.approx(float(found), abs=1e-10)
    assert "MeshCat.Viewer" in run.page
