"""The example of the branch: its turning points are those of cosines, the loop closes, all of it is printed."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from tests.examples.running import run_example


def test_the_branch_turns_where_cosines_say(tmp_path):
    also = ["follow_branch.png"] if find_spec("matplotlib") else []
    run = run_example("follow_branch", tmp_path, also)
    branch, ends = run.result, [run.module.dead_center(reach) for reach in (4.0, 2.0)]
    turns = sorted(event.value for event in branch.events_of("turning point"))
    np.testing.assert_allclose(turns, ends, rtol=0, atol=1e-12)
    assert branch.closed and branch.closure < 1e-10
    assert f"dead center by cosines: {ends[0]:.12g}" in run.lines
    assert any(line.startswith("  closed loop at 2") for line in run.lines)
