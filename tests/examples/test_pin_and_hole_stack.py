"""The example of the loose pin: its range and its stack by hand."""

from __future__ import annotations

from math import acos, atan2, hypot, sqrt, tan

import pytest

from tests.examples.running import run_example


def test_figures(tmp_path):
    pytest.importorskip("matplotlib").use("Agg")
    run = run_example("pin_and_hole_stack", tmp_path, also=["pin_and_hole_stack.png"])
    loose, found = run.result
    # The pin's wall goes through the edges of the hole that are across: 8.4 cos a = 8 + 12 sin a.
    slope = tan(acos(8.0 / hypot(8.4, 12.0)) - atan2(12.0, 8.4))
    most = 26.0 * slope
    assert [loose.least.value, loose.most.value] == pytest.approx([-most, most], abs=1e-9)
    # A plate that is higher takes the middle of the hole nearer to the end, to either side.
    worst = most + 3.0 * 0.05 + slope * (0.5 + 0.2)
    assert found.worst[0] == pytest.approx([-worst, worst], abs=1e-7)
    assert found.sigma[0] == pytest.approx(sqrt((2.0 * most) ** 2 / 12.0 + 0.05**2), abs=1e-7)
    share = 0.05**2 / found.sigma[0] ** 2
    assert found.contributions[0] == pytest.approx([share, 0.0, 0.0], abs=1e-7)
    assert found.play_contributions[0] == pytest.approx(1.0 - share, abs=1e-7)
    assert run.lines[2].split() == ["play", "98.99", "%"] and "play from -0.85724777 to 0.85724777" in run.lines[6]
