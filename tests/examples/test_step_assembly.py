"""The example of the STEP file: the parts in it, where they end up, and the file of the assembly."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest

import assembly as asm
from tests.examples.running import EXAMPLES, run_example

HEXAGON = 1.5 * sqrt(3.0) * 7.5**2
# Volume and origin of each part: a plate 8 thick about the origin, a bracket of 6 on it, heads of 5, nuts of 6.
PARTS = {
    "plate": (48000.0 - 2.0 * pi * 4.5**2 * 8.0, (0.0, 0.0, 0.0)),
    "bracket": ((50.0 * 14.0 + 14.0 * 26.0 - 2.0 * pi * 4.5**2) * 6.0, (-25.0, -20.0, 7.0)),
    "bolt": (5.0 * HEXAGON + 25.0 * pi * 16.0, (17.0, -13.0, 12.5)),
    "bolt 2": (5.0 * HEXAGON + 25.0 * pi * 16.0, (-18.0, 12.0, 12.5)),
    "nut": (6.0 * (HEXAGON - pi * 16.0), (17.0, -13.0, -7.0)),
    "nut 2": (6.0 * (HEXAGON - pi * 16.0), (-18.0, 12.0, -7.0)),
}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    pytest.importorskip("OCP", reason='STEP files need OCCT: pip install "assembly-solver[step]"')
    folder = tmp_path_factory.mktemp("step_assembly")
    result = run_example("step_assembly", folder, also=["step_assembly.step"])
    result.file = folder / "step_assembly.step"
    return result


def test_the_parts_are_where_they_belong(run):
    scene, solution = run.result
    assert solution.success and [body.name for body in scene.bodies] == ["ground", *PARTS]
    for body in scene.bodies[1:]:
        volume, origin = PARTS[body.name]
        pose = solution.pose(body)
        # Constraints hold to 2e-13 of the largest extent, some 120, and a STEP file has 15 digits.
        assert pose.position == pytest.approx(origin, abs=1e-9)
        assert pose.matrix[:3, 2] == pytest.approx([0.0, 0.0, 1.0], abs=1e-11)
        assert sum(side.face.volume_integral() for side in body.faces) == pytest.approx(volume, rel=1e-9)
    assert solution.pose("bracket").matrix[:3, 0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-11)


def test_bolts_and_nuts_can_turn_and_nothing_else(run):
    scene, solution = run.result
    mobility = scene.mobility(solution)
    assert mobility.dof == 4
    motions = mobility.free_motions.reshape(4, len(scene.bodies), 6)
    assert np.abs(motions[:, :3]).max() < 1e-9
    assert np.abs(motions[:, 3:, :5]).max() < 1e-9 and np.linalg.matrix_rank(motions[:, 3:, 5]) == 4


def test_the_file_is_the_assembly(run):
    _, solution = run.result
    back = asm.read_step(run.file)
    assert [body.name for body in back] == list(PARTS)
    for body in back:
        pose = solution.pose(body.name)
        assert body.pose.matrix == pytest.approx(pose.matrix, abs=1e-9)
    assert back[2].faces[0].face is back[3].faces[0].face  # one part, twice


def test_it_prints_where_parts_are(run):
    assert run.lines[0] == "SOLVED; 4 degrees of freedom: bolts and nuts can turn" and len(run.lines) == 7
    for line, (name, (_, origin)) in zip(run.lines[1:], PARTS.items(), strict=True):
        assert line[:9].strip() == name
        assert [float(word) for word in line[9:].split()] == pytest.approx(origin, abs=1.1e-6)
    assert "MeshCat.Viewer" in run.page


def test_without_occt_it_says_so(run_python):
    code = f"""
import runpy, sys
sys.modules["OCP"] = None
try:
    runpy.run_path({str(EXAMPLES / "step_assembly.py")!r}, run_name="__main__")
except SystemExit as end:
    print(end)
"""
    told = run_python(code).splitlines()[-1]
    assert told.startswith('OCCT is not installed: pip install "assembly-solver[step]"')
