"""Work that is counted: counts are what results tell, are the same again, and more of it is found."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import __main__ as benchmarks
from benchmarks import counts
from benchmarks.callgrind import Counter
from benchmarks.gate import more_work
from benchmarks.work_cases import BY_INSTRUCTION, FAMILIES

ROOT = Path(__file__).resolve().parents[2]
CASE = "paper clips, a warm step"


def counted(**changes):
    work = {"row evaluations": 9, "factorizations": 9, "surface points": 351, "bounds": 0, "iterations": 3}
    changed = work | {"instructions": 362_325} | changes
    return {"stamp": {"numpy": "2.4.6"}, "missing": "", "work": {CASE: changed, "two cubics": {"bounds": 89}}}


def test_as_much_work_or_less_is_let_pass():
    assert more_work(counted(), counted()) == []
    assert more_work(counted(iterations=2, factorizations=8, instructions=300_000), counted()) == []


@pytest.mark.parametrize("kind", counts.COUNTS)
def test_one_more_is_found(kind):
    before = counted().get("work")[CASE].get(kind, 0)
    assert more_work(counted(**{kind: before + 1}), counted()) == [(CASE, kind, before, before + 1)]


def test_instructions_may_differ_by_what_paths_are_long():
    assert more_work(counted(instructions=367_000), counted()) == []
    assert more_work(counted(instructions=380_000), counted()) == [(CASE, "instructions", 362_325, 380_000)]
    without = counted()
    del without["work"][CASE]["instructions"]
    assert more_work(without, counted()) == more_work(counted(instructions=10**9), without) == []


def test_other_versions_round_in_other_ways():
    def other(**changes):
        return counted(**changes) | {"stamp": {"numpy": "2.5.0"}}

    assert more_work(other(iterations=4, **{"surface points": 358, "instructions": 10**9}), counted()) == []
    assert more_work(other(iterations=5), counted()) == [(CASE, "iterations", 3, 5)]
    assert more_work(other(**{"surface points": 360}), counted()) == [(CASE, "surface points", 351, 360)]


def test_a_case_that_is_gone_is_found():
    now = counted()
    del now["work"]["two cubics"]
    assert [row[:2] for row in more_work(now, counted())] == [("two cubics", "is gone")]
    # One that is new is compared from then on when it is stored.
    assert more_work(counted(), now) == []


def test_the_command_fails_where_a_count_became_more(tmp_path, monkeypatch, capsys):
    stored = tmp_path / "stored" / "counts.json"
    stored.parent.mkdir()
    stored.write_text(json.dumps(counted()))
    monkeypatch.setattr(counts, "STORED", stored)
    monkeypatch.setattr(counts, "count_all", counted)
    monkeypatch.setattr(benchmarks, "pin_to_one_core", lambda: None)
    command = ["--only", "counts", "--gate", "--output", str(tmp_path)]
    assert benchmarks.main(command) == 0
    monkeypatch.setattr(counts, "count_all", lambda: counted(iterations=4))
    assert benchmarks.main(command) == 1
    assert f"worse: {CASE}: iterations: 3 became 4" in capsys.readouterr().out
    # What was counted is there to be looked at, and what is stored is as it was.
    assert json.loads((tmp_path / "counts.json").read_text())["work"][CASE]["iterations"] == 4
    assert json.loads(stored.read_text()) == counted()


def test_calls_in_plain_python_are_what_results_tell(tmp_path):
    file = tmp_path / "plain.json"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", "benchmarks.counts", "plain", str(file), "distances"]
    subprocess.run(command, cwd=ROOT, env=environment, check=True)
    plain = json.loads(file.read_text())
    work, count = counts.WAYS["compiled"]()
    next(family for family in FAMILIES if family.__name__ == "distances")(count)
    assert list(plain) == list(work)
    told = {case: row["evaluations"] for case, row in work.items() if "evaluations" in row}
    # All queries of one pair. Compiled code rounds in other ways, which may change the order of searches.
    assert len(told) == 5
    assert all(abs(plain[case]["bounds"] - value) <= 2 for case, value in told.items())
    assert all(row["bounds"] > 0 for row in plain.values())


def test_what_is_stored_is_of_these_cases():
    cases: list[str] = []

    def name(case, call):
        cases.append(case)
        return call()

    for family in FAMILIES:
        family(name)
    stored = json.loads(counts.STORED.read_text())
    assert list(stored["work"]) == cases
    assert {case for case, row in stored["work"].items() if "instructions" in row} == set(BY_INSTRUCTION)
    assert counts.section(stored)[-1].count("\n") == len(cases) + 1


@pytest.mark.skipif(sys.platform != "linux" or os.uname().machine != "x86_64", reason="requests are machine code")
def test_who_counts_instructions_says_where_nothing_counts_them():
    with pytest.raises(RuntimeError, match="does not run under Valgrind"):
        Counter()


def test_callgrind_s_files_are_read(tmp_path):
    # As the version 3.19 writes them, shortened.
    text = "version: 1\npart: 2\n\ndesc: Trigger: Client Request: two cubics\n\nevents: Ir\nsummary: 192985\n\n\n"
    (tmp_path / "callgrind.2").write_text(text + "fn=(0)\n0 5\n\ntotals: 192985\n")
    (tmp_path / "callgrind").write_text("version: 1\ndesc: Trigger: Program termination\ntotals: 7\n")
    assert counts.callgrind.read_counts(tmp_path / "callgrind") == {"two cubics": 192_985}
