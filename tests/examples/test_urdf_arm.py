"""The robot arm of a URDF file: joints hold, links keep clear of the wall by closed forms, the tool follows."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from tests.examples.running import run_example
from tests.files.robots import forward_kinematics

pytest.importorskip("yourdfpy")
pytest.importorskip("pygltflib")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("urdf_arm")
    found = run_example("urdf_arm", folder, also=["urdf_arm.urdf", "urdf_arm.glb", "urdf_arm_again.urdf"])
    found.folder = folder
    return found


SIZES = {"upper arm": (500.0, 30.0), "forearm": (400.0, 25.0), "hand": (120.0, 20.0)}


def away(solution):
    """How far the links' axes are from the wall, less their radii: balls at their ends aside."""
    found = []
    for name, (length, radius) in SIZES.items():
        points = solution.pose(name).apply(np.linspace([0.0, 0, 0], [length, 0, 0], 400))
        beyond = np.maximum(np.abs(points - (420.0, 0.0, 215.0)) - (20.0, 250.0, 215.0), 0.0)
        found.append(np.linalg.norm(beyond, axis=1).min() - radius)
    return min(found)


def test_the_tool_follows_where_the_wall_lets_it(run):
    _, _, solutions, way = run.result
    assert len(solutions) == len(way) == 48 and all(solution.success and solution.proved for solution in solutions)
    missed = []
    for target, solution in zip(way, solutions, strict=True):
        tool = solution.pose("hand").apply((120.0, 0.0, 0.0))
        # The posture of least moves weighs 1e-4 of the target, over some hundred millimeters.
        if np.linalg.norm(tool - target) > 0.2:
            missed.append(solution)
    assert 0 < len(missed) < 8
    # A cylinder's rim is nearer than its axis less the radius by what it is turned: the wall is what holds it back.
    assert all(away(solution) < 10.0 + 1.0 for solution in missed)


def test_links_keep_clear_of_the_wall(run):
    """A point of an axis is farther from the wall than the least gap and the radius, but for flat ends of cylinders."""
    _, _, solutions, _ = run.result
    assert min(map(away, solutions)) > 10.0 - 1e-6


def test_joints_are_those_of_the_file(run):
    robot, scene, solutions, _ = run.result
    text = (run.folder / "urdf_arm_again.urdf").read_text()
    limits = {"waist": (-3.0, 3.0), "shoulder": (-2.2, 0.5), "elbow": (-0.2, 2.6), "wrist": (-1.6, 1.6)}
    for solution in solutions[::8]:
        values = {name: solution.values[f"{name}.angle"] for name in limits}
        for name, (low, high) in limits.items():
            assert low - 1e-9 <= values[name] <= high + 1e-9
        places = forward_kinematics(text[text.index("<robot") :], values)
        for name in ("upper arm", "forearm", "hand"):
            np.testing.assert_allclose(solution.pose(name).position, 1000.0 * places[name][:3, 3], rtol=0, atol=1e-7)
    assert isinstance(scene, asm.Assembly) and len(robot.joints) == 4
