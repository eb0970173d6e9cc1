"""The example of the dragged plate: at the hand or at the walls at every tick, proven, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("drag_a_plate", tmp_path_factory.mktemp("drag_a_plate"))


def test_every_tick_is_proven_and_none_is_held(run):
    trace, steps = run.result
    assert len(steps) == len(trace) == 2001 and all(step.proved for step in steps)
    statuses = [step.status.name for step in steps]
    assert set(statuses) <= {"FOLLOWED", "APPROACHING"} and statuses.count("FOLLOWED") > 0.98 * len(steps)


def test_the_plate_is_at_the_hand_or_at_the_walls(run):
    trace, steps = run.result
    off = []
    for target, step in zip(trace.targets, steps, strict=True):
        flat = np.minimum(target[:2], run.module.STOP)
        off.append(np.linalg.norm(step.q[3, :2] - flat))
        # Neither in the table nor in a wall, and flush: by what is called touching, 1e-9 of the scene's size.
        assert step.q[3, 2] == pytest.approx(5.0, abs=3e-7)
        assert (step.q[3, :2] <= run.module.STOP + 3e-7).all()
        assert step.q[3, 3:] == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-8)
    assert np.median(off) < 1e-9 and np.percentile(off, 99) < 1e-6


def test_the_hand_feels_table_and_walls(run):
    trace, steps = run.result
    assert trace.targets[1500, :2] == pytest.approx((75.0, 45.0), abs=1e-9)
    # 2 N/mm times 5 mm that it is beyond each wall, and half a millimeter too low.
    assert steps[1500].force == pytest.approx((-10.0, -10.0, 1.0), abs=1e-6)


def test_it_prints_what_it_did(run):
    assert run.lines[0].endswith("of 2001") and run.lines[1] == "proven: 2001"
    assert run.lines[3] == "the hand feels in the corner [N]: [-10. -10.   1.]"
    assert "MeshCat.Viewer" in run.page
