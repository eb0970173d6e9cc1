"""Logs of ticks: filled in order, counted and printed, kept in files."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.tracking.log import LoggedEvent, kind_name

RNG = np.random.default_rng(8)


class Ended(Enum):
    WELL = "it did"
    LATE = "out of time"
    LOST = "nowhere"


class Kind(Enum):
    ADDED = "a contact appeared"
    REMOVED = "it went"


@dataclass(frozen=True)
class Change:
    kind: Kind
    name: str

    def __str__(self):
        return f"{self.name}: {self.kind.value}"


def recorded(ticks=1000, stride=1, budget=5e-5, workspace=None):
    """A log, and what it is of: seconds, violations, statuses, iterations, poses."""
    rng = np.random.default_rng(ticks)
    seconds, violations = rng.lognormal(-11.0, 0.5, ticks), rng.uniform(0.0, 1e-12, ticks)
    statuses, steps = rng.integers(0, 2, ticks), rng.integers(1, 9, ticks)
    q = rng.normal(size=(ticks, 2, 7))
    recorder = asm.TrackLog.recorder(
        2.0 + 0.001 * np.arange(workspace or ticks), 2, Ended, stride=stride, budget=budget
    )
    for k in range(ticks):
        recorder.record(k, q[k], seconds[k], violations[k], statuses[k], steps[k])
        if k % 100 == 7:
            recorder.note(k, (Change(Kind.ADDED, f"pair {k}"),) + (k > 500) * (Change(Kind.REMOVED, "pair 7"),))
    return recorder.log(), (seconds, violations, statuses, steps, q)


@pytest.mark.parametrize("stride", [1, 7, 5000])
def test_a_log_holds_what_was_recorded(stride):
    log, (seconds, violations, statuses, steps, q) = recorded(stride=stride)
    for held, given in zip(
        (log.seconds, log.feasibility, log.status, log.iterations), (seconds, violations, statuses, steps), strict=True
    ):
        np.testing.assert_array_equal(held, given)
    np.testing.assert_array_equal(log.q, q[::stride])
    np.testing.assert_array_equal(log.pose_times, log.times[::stride])
    assert len(log) == 1000 and log.times[0] == 2.0 and log.stride == stride
    assert not any(part.flags.writeable for part in (log.times, log.seconds, log.q, log.status))


def test_a_log_may_end_early():
    log, (_, _, _, _, q) = recorded(ticks=11, stride=5, workspace=1000)
    assert len(log) == len(log.times) == 11
    np.testing.assert_array_equal(log.q, q[[0, 5, 10]])
    # The log does not change with the recorder.
    recorder = asm.TrackLog.recorder([0.0, 1.0], 1, Ended)
    recorder.record(0, np.zeros((1, 7)), 1.0, 2.0, 0, 3)
    first = recorder.log()
    recorder.record(0, np.ones((1, 7)), 9.0, 9.0, 1, 9)
    assert first.seconds[0] == 1.0 and first.q[0, 0, 0] == 0.0 and len(first) == 1
    with pytest.raises(IndexError):
        recorder.record(2, np.zeros((1, 7)), 1.0, 2.0, 0, 3)


def test_percentiles_are_of_ticks():
    log, (seconds, *_) = recorded()
    ordered = np.sort(seconds)
    # p percent of 1,000 ticks took no longer, and no fewer of them do.
    assert log.percentile(99.9) == ordered[998] and log.percentile(100) == ordered[999]
    assert log.median == ordered[499] and log.percentile(90) == ordered[899]
    assert log.percentile(0) == ordered[0]
    with pytest.raises(InputError, match="p is 101; expected percents from 0 to 100"):
        log.percentile(101)


def test_counts():
    log, (seconds, violations, statuses, _, _) = recorded()
    late = [k for k in range(1000) if seconds[k] > 5e-5]
    assert log.late.tolist() == late and 0 < len(late) < 100
    assert log.later_than(0.0).tolist() == list(range(1000))
    assert replace(log, budget=None).late.size == 0
    assert log.worst_violation == max(violations)
    assert log.count(Ended.WELL) == log.count("WELL") == list(statuses).count(0)
    assert log.count(Ended.LOST) == 0
    with pytest.raises(InputError, match="status is 'BAD'; expected one of 'WELL', 'LATE', 'LOST'"):
        log.count("BAD")
    assert log.kinds == {"ADDED": 10, "REMOVED": 5}
    assert log.events[0] == (7, Change(Kind.ADDED, "pair 7"))


def test_a_violation_that_is_no_number_does_not_hide():
    log, (_, violations, *_) = recorded()
    for value in (np.inf, np.nan):
        worst = np.where(np.arange(1000) == 3, value, violations)
        bad = replace(log, feasibility=worst)
        np.testing.assert_equal(bad.worst_violation, value)
        assert "in tick 3" in str(bad)


def test_it_prints_as_a_table():
    seconds = 1e-6 * np.arange(1, 1001)
    log = asm.TrackLog(
        0.001 * np.arange(1000),
        seconds[::-1],
        np.where(np.arange(1000) == 12, 2.5e-13, 0.0),
        np.arange(1000) == 5,
        np.ones(1000, dtype=int),
        np.zeros((1000, 1, 7)),
        ("WELL", "LATE"),
        ((3, LoggedEvent("ADDED", "a")), (4, LoggedEvent("ADDED", "b")), (9, LoggedEvent("REMOVED", "a"))),
        budget=950e-6,
    )
    assert str(log).splitlines() == [
        "1000 ticks over 0.999 s",
        "              median       p90       p99     p99.9       max",
        "tick [us]        500       900       990       999      1000",
        "late      50 of 1000, budget 950 us",
        "violation 2.5e-13 at worst, in tick 12",
        "status    999 WELL, 1 LATE",
        "events    2 ADDED, 1 REMOVED",
    ]
    assert repr(log) == "TrackLog(1000 ticks, median 500 us, worst 2.5e-13)"
    bare = str(replace(log, budget=None, events=()))
    assert "late" not in bare and bare.endswith("events    none")


@pytest.mark.parametrize("budget", [None, 1e-4])
def test_files_keep_every_bit(tmp_path, budget):
    log = recorded(ticks=120, stride=7, budget=budget)[0]
    log.save(tmp_path / "log.npz")
    again = asm.TrackLog.load(str(tmp_path / "log.npz"))
    for name in ("times", "seconds", "feasibility", "status", "iterations", "q"):
        np.testing.assert_array_equal(getattr(again, name), getattr(log, name))
    assert (again.statuses, again.stride, again.budget) == (log.statuses, 7, budget)
    assert again.events == tuple((k, LoggedEvent(kind_name(event), str(event))) for k, event in log.events)
    assert again.events[0] == (7, LoggedEvent("ADDED", "pair 7: a contact appeared"))
    assert again.kinds == log.kinds and str(again) == str(log)
    # A log without events, and one from a file, are saved as well.
    replace(again, events=()).save(tmp_path / "quiet.npz")
    assert asm.TrackLog.load(tmp_path / "quiet.npz").events == ()
    again.save(tmp_path / "again.npz")
    assert asm.TrackLog.load(tmp_path / "again.npz").events == again.events


def test_files_that_are_no_logs(tmp_path):
    log = recorded(ticks=3)[0]
    with pytest.raises(InputError, match="path is 'log.csv'; expected a name that ends with .npz"):
        log.save("log.csv")
    with pytest.raises(FileNotFoundError):
        asm.TrackLog.load(tmp_path / "log.npz")
    path = tmp_path / "log.npz"
    for content in (b"", b"PK\x03\x04"):
        path.write_bytes(content)
        with pytest.raises(InputError, match="log.npz holds no log of version 1"):
            asm.TrackLog.load(path)
    log.save(path)
    with np.load(path) as data:
        arrays = dict(data)
    for name, value in (("version", 2), ("times", np.zeros(3)), ("seconds", np.zeros(2)), ("q", np.zeros((3, 7)))):
        np.savez(path, **(arrays | {name: value}))
        with pytest.raises(InputError, match=rf"log.npz holds no log of version 1: {name}"):
            asm.TrackLog.load(path)
    del arrays["status"]
    np.savez(path, **arrays)
    with pytest.raises(InputError, match="log.npz holds no log of version 1: .*status"):
        asm.TrackLog.load(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": np.zeros(0)}, "times is empty or does not increase"),
        ({"times": np.zeros(3)}, "times is empty or does not increase"),
        ({"times": "now"}, "times is str; expected numbers"),
        ({"seconds": np.zeros(4)}, "seconds has shape (4,); expected (3)"),
        ({"status": np.zeros(3)}, "status is ndarray; expected numbers"),
        ({"status": [0, 1, 3]}, "status goes from 0 to 3; expected places in 3 statuses"),
        ({"status": [0, -1, 0]}, "status goes from -1 to 0; expected places in 3 statuses"),
        ({"q": np.zeros((2, 2, 7))}, "q has shape (2, 2, 7); expected (3, n, 7)"),
        ({"stride": 2}, "q has shape (3, 2, 7); expected (2, n, 7)"),
        ({"stride": 0}, "stride is 0; expected an integer from 1"),
        ({"budget": -1.0}, "budget is -1; expected a positive number"),
        ({"events": ((3, LoggedEvent("ADDED", "")),)}, "tick of an event is 3; expected an integer from 0 to 2"),
    ],
)
def test_bad_input(change, message):
    log = recorded(ticks=3)[0]
    with pytest.raises(InputError, match=re.escape(message)):
        replace(log, **change)


def test_an_empty_recorder_has_no_log():
    with pytest.raises(InputError, match="expected the times of one tick at least"):
        asm.TrackLog.recorder([0.0, 1.0], 1, Ended).log()


def test_a_recorder_raises_before_the_first_tick():
    for arguments, message in (
        (([], 1, Ended), "times is empty or does not increase"),
        (([0.0, 0.0], 1, Ended), "times is empty or does not increase"),
        (([0.0, np.nan], 1, Ended), "times is empty or does not increase"),
        (([0.0], 0, Ended), "bodies is 0; expected an integer from 1"),
    ):
        with pytest.raises(InputError, match=message):
            asm.TrackLog.recorder(*arguments)
    with pytest.raises(InputError, match="budget is 0; expected a positive number"):
        asm.TrackLog.recorder([0.0], 1, Ended, budget=0.0)
    with pytest.raises(InputError, match="stride is 1.5; expected an integer from 1"):
        asm.TrackLog.recorder([0.0], 1, Ended, stride=1.5)
