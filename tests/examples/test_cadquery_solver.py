"""The example of the door: every constraint holds, and the frame is where its sizes say."""

from __future__ import annotations

import pytest

from tests.examples.running import run_example

pytest.importorskip("cadquery", reason="needs CadQuery, in an environment of its own: packaging/check_cad.py")

from tests.cad.residuals import moved, violation  # noqa: E402  # it is of cadquery's objects


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("cadquery_solver", tmp_path_factory.mktemp("cadquery_solver"))


def test_every_constraint_holds(run):
    assembly, solution = run.result
    # 2e-13 of the size, some 400.
    assert solution.success and violation(assembly) < 1e-10 and solution.mobility.dof == 0


def test_the_door_is_where_its_sizes_say(run):
    assembly, _ = run.result
    side, width, height = run.module.SIDE, run.module.WIDTH, run.module.HEIGHT
    places = {
        "top": (side / 2, 0, height - side / 2),
        "bottom": (side / 2, 0, side / 2),
        "right": (width + side, 0, 0),
        "panel": (side / 2 + width / 2, -side / 2 + 4, height / 2),
    }
    for name, place in places.items():
        assert moved(assembly, name)[1] == pytest.approx(place, abs=1e-9), name


def test_it_tells_both_times(run):
    assert run.lines[0].startswith("CadQuery's solver: ") and "SOLVED" in run.lines[1]
