"""The example of mated faces: parts are where the drawing has them, from wherever they lie."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from tests.examples.running import run_example

# Where origins belong: the foot of 6 on the plate of 8, heads at the top of the foot, the pin 20 above it.
PLACES = {
    "plate": (0, 0, 0),
    "bracket": (-10, 0, 7),
    "left bolt": (-15, -18, 10),
    "right bolt": (-15, 18, 10),
    "lever": (-10, 0, 30),
}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("mates_of_faces", tmp_path_factory.mktemp("mates_of_faces"))


def check(scene, solution):
    assert solution.success, solution.message
    for body in scene.bodies:
        assert abs(solution.pose(body).position - PLACES[body.name]).max() < 1e-10, body.name


def test_parts_are_where_they_belong(run):
    check(*run.result)
    assert run.lines[0].startswith("SOLVED, 3 degrees of freedom") and len(run.lines) == 14
    for line in run.lines[9:]:
        assert tuple(map(float, line.split()[-3:])) == PLACES[line[:12].strip()]
    assert "MeshCat.Viewer" in run.page


@pytest.mark.parametrize("seed", range(8))
def test_from_wherever_they_lie(run, seed):
    rng = np.random.default_rng(seed)
    scene = run.module.mated()
    q = scene.q.copy()
    q[1:, :3] = rng.uniform(-60, 60, (4, 3))
    q[1:, 3:] = (turns := rng.normal(size=(4, 4))) / np.linalg.norm(turns, axis=1)[:, None]
    check(scene, scene.solve(q))
    assert isinstance(scene.constraints[3], asm.Insert)
