"""The example of the branch: its turning points are those of cosines, the loop closes, all of it is printed."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from assembly.kinematics.pose import rotation_matrix
from benchmarks.planar_four_bars import FourBar
from tests.examples.running import run_example


def test_the_branch_turns_where_cosines_say(tmp_path):
    also = ["follow_branch.png"] if find_spec("matplotlib") else []
    run = run_example("follow_branch", tmp_path, also)
    (branch, blocked), ends = run.result, [run.module.dead_center(reach) for reach in (4.0, 2.0)]
    turns = sorted(event.value for event in branch.events_of("turning point"))
    np.testing.assert_allclose(turns, ends, rtol=0, atol=1e-12)
    assert branch.closed and branch.closure < 1e-10
    assert f"dead center by cosines: {ends[0]:.12g}" in run.lines
    assert any(line.startswith("  closed loop at 2") for line in run.lines)
    assert blocked.ends == ("blocked", "blocked") and blocked.proved.all() and blocked.depth < 3e-4
    assert sum(line.startswith("  contact closed of clearance, coupler and post near") for line in run.lines) == 2
    for event in blocked.events:
        x, y = 1.35, 1.9
        crank = FourBar(1.0, 3.0, 2.5, 3.2, angle=event.value).q[2]
        across = rotation_matrix(crank[3:])[:, 1] @ ([x, y, 0.0] - crank[:3])
        np.testing.assert_allclose(abs(across), 0.1 + 0.15, rtol=0, atol=1e-12)
