"""Solves, motions and queries have the results that were recorded, to the last bit.

A failure says that a change moved results. One that was to change the code's form alone is wrong then; one that
changes what is computed, or the order in which numbers are added, records them anew (`tests/recorded/recording.py`),
and says so.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from assembly._kernel.targets import why_portable_code_does_not_run
from tests.recorded.recording import KEPT, run_apart, versions

RECORDED = json.loads(KEPT.read_text(encoding="utf-8"))


def numbers(written):
    return np.array([float.fromhex(x) for x in written])


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    lacking = why_portable_code_does_not_run()
    if lacking:
        pytest.skip(f"the portable code that results are recorded with does not run here: {lacking}")
    file = tmp_path_factory.mktemp("recorded") / "results.json"
    run_apart(file)
    return json.loads(file.read_text(encoding="utf-8"))["results"]


def test_the_same_cases_are_recorded(computed):
    assert {k: sorted(v) for k, v in computed.items()} == {k: sorted(v) for k, v in RECORDED["results"].items()}


@pytest.mark.parametrize("group", RECORDED["results"])
def test_results_are_the_recorded_ones(computed, group):
    same = RECORDED["versions"] == versions()
    moved = []
    for case, values in RECORDED["results"][group].items():
        for name, value in values.items():
            now = computed[group][case].get(name)
            if now == value:
                continue
            if same or now is None or isinstance(value, str) or len(value) != len(now):
                moved.append(f"{case}, {name}: {value} was recorded, {now} is computed")
                continue
            # Other versions add in another order: what solves are held to, of the size of these scenes.
            off = np.abs(numbers(now) - numbers(value))
            if not (off <= 1e-12 * (1.0 + np.abs(numbers(value)))).all():
                moved.append(f"{case}, {name}: off by {off.max():.2g}")
    assert moved == []
    if not same:
        pytest.skip(f"recorded with {RECORDED['versions']}, not {versions()}: compared to 1e-12, not to the last bit")
