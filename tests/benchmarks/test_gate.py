"""The gate: what became worse is found, and what did not is not."""

from __future__ import annotations

import copy

import pytest

from benchmarks.figures import figure
from benchmarks.gate import regressions


def report(seconds=1e-3, error=1e-12, solved=10, ratio=1.0, loop=1e-3, **others):
    rows = [
        figure("a call", "seconds", seconds),
        figure("an error", "error", error),
        figure("solved", "count", solved, of=10),
        figure("idle", "ratio", ratio, reach=1.05),
    ]
    result = {"figures": rows} | others
    return {"quick": False, "machine": {"calibration_seconds": loop}, "benchmarks": {"one": result}}


def test_the_same_run_is_not_worse():
    assert regressions(report(), report()) == []


@pytest.mark.parametrize(
    "change, what",
    [
        ({"seconds": 2e-3}, "a call"),
        ({"error": 1e-10}, "an error"),
        ({"solved": 9}, "solved"),
        ({"ratio": 1.3}, "idle"),
    ],
)
def test_what_is_worse_is_named(change, what):
    assert [row[:2] for row in regressions(report(**change), report())] == [("one", what)]


def test_a_slower_machine_is_no_regression():
    assert regressions(report(seconds=3e-3, loop=3e-3), report()) == []
    # And a faster one hides none.
    assert regressions(report(seconds=1e-3, loop=0.5e-3), report()) != []


def test_rounding_is_no_error():
    assert regressions(report(error=9e-13), report(error=1e-16)) == []


def test_a_failure_is_a_regression():
    bad = copy.deepcopy(report())
    bad["benchmarks"]["one"] = {"error": "it broke"}
    assert [row[1] for row in regressions(bad, report())] == ["failed"]
    assert regressions(bad, bad) == []


def test_runs_of_two_kinds_are_not_compared():
    quick = report() | {"quick": True}
    with pytest.raises(ValueError, match="quick"):
        regressions(quick, report())
