"""What a study keeps on disk: killed at any moment, nothing finished is lost, and nothing is counted twice."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import time

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from tests.studies.sweeps.sweep_scenes import columns, four_bar, narrow

ROWS = 300


def rows_of(folder):
    """The rows of all parts."""
    return [
        line["row"]
        for part in sorted(folder.glob("part-*.jsonl"))
        for line in map(json.loads, part.read_text().splitlines()[1:-1])
    ]


def test_a_study_goes_on_where_it_was_stopped(tmp_path):
    stopped = asm.study(*narrow(ROWS), folder=tmp_path, chunk_seconds=1e-4, progress=lambda done, total: done > 100)
    kept = rows_of(tmp_path)
    assert 100 < len(kept) < ROWS and len(set(kept)) == len(kept)
    assert (stopped.table["status"] != "NOT_DONE").sum() == len(kept)
    said = []
    resumed = asm.study(*narrow(ROWS), folder=tmp_path, chunk_seconds=1e-4, progress=lambda *args: said.append(args))
    assert said[0] == (len(kept), ROWS) and sorted(rows_of(tmp_path)) == list(range(ROWS))
    assert columns(resumed) == columns(asm.study(*narrow(ROWS)))


def test_a_folder_is_of_one_study(tmp_path):
    scene, (angle, crank, _), out = four_bar()
    plan = asm.grid({angle: [0.6, 0.7], crank: [1.5]})
    asm.study(scene, plan, out, folder=tmp_path)
    with pytest.raises(InputError, match="is of a study that differs in its values"):
        asm.study(scene, asm.grid({angle: [0.6, 0.8], crank: [1.5]}), out, folder=tmp_path)
    with pytest.raises(InputError, match="is of a study that differs in its measures"):
        asm.study(scene, plan, asm.Measure(scene.bodies[2], "x", name="out"), folder=tmp_path)
    other, parameters, measure = four_bar()
    parameters[2].value = 4.1
    with pytest.raises(InputError, match="is of a study that differs in its scene"):
        asm.study(other, asm.grid({parameters[0]: [0.6, 0.7], parameters[1]: [1.5]}), measure, folder=tmp_path)
    same, parameters, measure = four_bar()
    asm.study(same, asm.grid({parameters[0]: [0.6, 0.7], parameters[1]: [1.5]}), measure, folder=tmp_path)


def test_damaged_parts_are_computed_again(tmp_path):
    whole = asm.study(*narrow(ROWS), folder=tmp_path, chunk_seconds=1e-4)
    parts = sorted(tmp_path.glob("part-*.jsonl"))
    assert len(parts) > 3
    parts[1].write_text(parts[1].read_text()[:-30])
    parts[2].write_text(parts[2].read_text().replace('"iterations": ', '"iterations": 1000000000000'))
    parts[-1].write_bytes(b"")
    (tmp_path / "unfinished-x").write_text("half")
    assert columns(asm.study(*narrow(ROWS), folder=tmp_path)) == columns(whole)
    assert not (tmp_path / "unfinished-x").exists()


def test_one_process_at_a_time(tmp_path):
    pytest.importorskip("fcntl", reason="locks are those of POSIX")

    def second(done, total):
        with pytest.raises(InputError, match="is written to by another process"):
            asm.study(*narrow(40), folder=tmp_path)

    asm.study(*narrow(40), folder=tmp_path, progress=second)


def test_failures_and_messages_are_kept(tmp_path):
    scene, (angle, crank, _), out = four_bar()
    plan = asm.rows({angle: [0.7, 0.7, 0.7], crank: [1.5, 12.0, 1.5]})
    first = asm.study(scene, plan, out, folder=tmp_path)
    again = asm.study(scene, plan, out, folder=tmp_path)
    assert again.table["status"].tolist() == ["SOLVED", "BRANCH_ENDED", "SOLVED"] and np.isnan(again["out"][1])
    assert columns(again) == columns(first)
    assert (again.solution(2).q == first.solution(2).q).all()


def test_a_line_has_all_measures_of_a_row_and_null_for_no_number(tmp_path):
    scene, (angle, crank, _), out = four_bar()
    plan = asm.rows({angle: [0.7, 0.7, 0.75], crank: [1.5, 12.0, 1.5]})
    found = asm.study(scene, plan, {"out": out, "twice": lambda s: 2.0 * out.value(s)}, folder=tmp_path)
    (part,) = tmp_path.glob("part-*.jsonl")
    lines = [json.loads(line) for line in part.read_text().splitlines()[1:-1]]
    told = [[found["out"][k], found["twice"][k]] for k in (0, 2)]
    assert [line["measures"] for line in lines] == [told[0], [None, None], told[1]]
    assert [line["status"] for line in lines] == found.table["status"].tolist()
    assert [line["iterations"] for line in lines] == found.table["iterations"].tolist()


@pytest.mark.skipif(os.name == "nt", reason="there are no forks on this system")
def test_killed_at_any_moment(tmp_path, cases):
    from tests.studies.sweeps.killed_study import go_on  # which solves when it is imported

    rows, kills = cases(1500, 80000), cases(4, 200)
    rng = np.random.default_rng(5)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.studies.sweeps.killed_study"])
    kept: dict[str, str] = {}
    for _ in range(kills):
        process = context.Process(target=go_on, args=(str(tmp_path), rows))
        process.start()
        # From its first part on it is killed at a random moment.
        while process.is_alive() and len(list(tmp_path.glob("part-*"))) <= len(kept):
            time.sleep(0.0005)
        time.sleep(rng.uniform(0.0, 0.01))
        process.kill()
        process.join()
        assert process.exitcode == -signal.SIGKILL  # it was not done
        now = {path.name: path.read_text() for path in tmp_path.glob("part-*")}
        # What was finished is there as it was, and more.
        assert len(now) > len(kept) and all(now[name] == text for name, text in kept.items())
        kept = now
    found = rows_of(tmp_path)
    assert len(set(found)) == len(found) < rows
    resumed = asm.study(*narrow(rows), folder=tmp_path)
    assert columns(resumed) == columns(asm.study(*narrow(rows)))
    assert sorted(rows_of(tmp_path)) == list(range(rows))
