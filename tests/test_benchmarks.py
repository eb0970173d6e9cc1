"""The benchmarks' own machinery; no time is judged here, only how times are taken and reported."""

from __future__ import annotations

import json
import math

import pytest

from benchmarks import __main__ as benchmarks
from benchmarks import timing
from benchmarks.running import run_apart
from benchmarks.timing import Busy, compare, measure


class Clock:
    """A clock that only moves when a task spends time."""

    def __init__(self) -> None:
        self.now = 0.0
        self.calls: list[str] = []

    def __call__(self) -> float:
        return self.now

    def task(self, name: str, seconds: float, first: float | None = None):
        def spend() -> None:
            self.now += first if first is not None and name not in self.calls else seconds
            self.calls.append(name)

        return spend


def test_median_leaves_out_the_first_call():
    clock = Clock()
    timing = measure(clock.task("a", 0.25, first=64.0), repeats=5, duration=2.0, clock=clock)
    # Powers of two add without rounding.
    assert (timing.seconds, timing.low, timing.high, timing.first) == (0.25, 0.25, 0.25, 64.0)
    assert 1.0 <= timing.calls * 0.25 <= 4.0


def test_median_and_quartiles_of_uneven_repeats():
    clock = Clock()
    spent = iter([1.0, 1.0, 1.0, 2.0, 3.0, 4.0, 50.0])  # first call, one trial of the length, five repeats

    def uneven() -> None:
        clock.now += next(spent)

    timing = measure(uneven, repeats=5, duration=1.0, clock=clock)
    assert (timing.low, timing.seconds, timing.high) == (2.0, 3.0, 4.0)


def test_candidates_take_turns():
    clock = Clock()
    rows = compare({"a": clock.task("a", 1.0), "b": clock.task("b", 2.0)}, repeats=3, duration=1.0, clock=clock)
    assert "".join(clock.calls[-6:]) == "ababab"
    assert [row["ratio"] for row in rows] == [1.0, 2.0]


def test_absent_peers_are_rows():
    clock = Clock()
    rows = compare({"peer": None, "ours": clock.task("ours", 1.0)}, repeats=2, duration=1.0, clock=clock)
    assert rows[0] == {"who": "peer", "absent": True}
    assert (rows[1]["who"], rows[1]["ratio"]) == ("ours", 1.0)
    assert compare({"peer": None}) == [{"who": "peer", "absent": True}]


def test_what_this_program_does_is_not_what_others_do(monkeypatch):
    # Seconds of processors: all programs, this one. Others use two of the three between the two readings.
    readings = iter([(10.0, 1.0), (13.0, 2.0)])
    monkeypatch.setattr(timing, "_processor_seconds", lambda: next(readings))
    monkeypatch.setattr(timing.time, "perf_counter", iter([100.0, 104.0]).__next__)
    assert Busy().read() == (4.0, 0.5)


def test_processors_are_read_where_the_system_tells():
    everyone, own = timing._processor_seconds()
    assert own > 0.0 and (everyone is None or everyone > own)


@pytest.mark.parametrize(("name", "value"), [("repeats", 1), ("duration", 0.0), ("duration", math.nan)])
def test_bad_arguments(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value}, expected"):
        compare({}, **{name: value})


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("seconds", 3.5e-8, "35 ns"),
        ("seconds", 1e-6, "1 us"),
        ("first_seconds", 2.5e-2, "25 ms"),
        ("low", 12.0, "12 s"),
        ("ratio", 0.123456, "0.1235"),
        ("seconds", math.nan, "nan ns"),
        ("case", "torus", "torus"),
    ],
)
def test_cells(key, value, text):
    assert benchmarks.shown(key, value) == text


def test_table_has_every_key():
    text = benchmarks.table({"rows": [{"who": "a", "seconds": 1.0}, {"who": "peer", "absent": True}]})
    assert text.splitlines() == ["who   seconds  absent", "a     1 s", "peer           True"]


@pytest.mark.parametrize(
    ("source", "result"),
    [
        ("def run(quick):\n    return {'rows': [{'quick': quick}]}", {"rows": [{"quick": True}]}),
        ("def run(quick):\n    raise RuntimeError('no luck')", "RuntimeError: no luck"),
        ("import os\ndef run(quick):\n    os._exit(3)", "BrokenProcessPool"),
    ],
    ids=["runs", "raises", "crashes"],
)
def test_whatever_happens_is_a_result(tmp_path, monkeypatch, source, result):
    (tmp_path / "some_benchmark.py").write_text(source)
    monkeypatch.syspath_prepend(str(tmp_path))
    found = run_apart("some_benchmark", quick=True)
    if isinstance(result, str):
        assert result in found["error"]
        assert benchmarks.table(found).startswith("failed\n")
    else:
        assert found == result


def test_command(tmp_path, run_python):
    # By runpy and not in this process, which it would pin to one core.
    printed = run_python(
        "import runpy, sys\n"
        f"sys.argv[1:] = ['--quick', '--only', 'start', '--output', {str(tmp_path)!r}]\n"
        "runpy.run_module('benchmarks', run_name='__main__')",
    )
    report = json.loads((tmp_path / "start-quick.json").read_text())
    assert report["quick"] is True
    assert report["machine"]["calibration_seconds"] > 0.0
    assert report["machine"]["versions"]["numba"] != "absent"
    rows = report["benchmarks"]["start"]["rows"]
    assert [row["who"] for row in rows][:2] == ["bare interpreter", "import assembly"]
    assert all(row["who"] in printed for row in rows)
