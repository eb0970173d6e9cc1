"""How runs are handed out: workers end together, chunks are few, and who hands out has little to do for a row."""

from __future__ import annotations

import heapq
import pickle
import sys
from concurrent.futures import Future

import numpy as np
import pytest

import assembly as asm
from assembly.studies.sweeps.chain import Start
from assembly.studies.sweeps.cutting import cut
from assembly.studies.sweeps.scheduling import AHEAD, Waiting
from assembly.studies.sweeps.table import Table
from assembly.studies.sweeps.task import Parcel
from assembly.studies.sweeps.work import ChunkDone
from tests.studies.sweeps.sweep_scenes import four_bar

ROW = 50e-6  # seconds a row takes


def simulated(rows, speeds):
    """Seconds and chunks of a study whose rows take as long on all workers of speed 1, from a queue before them."""
    table = Table(np.zeros((rows, 1)), cut(np.arange(rows)), 1)
    waiting, queue, count = Waiting(table, 0.5, len(speeds)), [], 0
    idle, running, now = sorted(range(len(speeds))), [], 0.0
    while waiting or queue or running:
        while waiting and len(queue) + len(running) < AHEAD * len(speeds):
            queue.append(waiting.chunk())
            count += 1
        while queue and idle:
            chunk, worker = queue.pop(0), idle.pop(0)
            seconds = ROW * len(table.rows(chunk)) / speeds[worker]
            heapq.heappush(running, (now + seconds, worker, seconds, chunk))
        now, worker, seconds, chunk = heapq.heappop(running)
        idle.append(worker)
        nothing = np.zeros(len(table.rows(chunk)))
        starts = {number: [None] * len(table.runs[number].rows) for number in chunk if table.runs[number].begins}
        done = ChunkDone(chunk, ("SOLVED",), nothing.astype(int), {}, nothing, nothing[:, None], starts, seconds, "")
        table.take(done)
        waiting.took(done)
    assert all(table.done)
    return now, count


# Seen: 0.3, 0.2, 1.6, 0.5 and 0.6 percent more than the time of the rows over all speeds; 45, 63, 64, 20, 303 chunks.
@pytest.mark.parametrize(
    ("rows", "speeds", "over", "most"),
    [
        (150_000, (1, 1), 0.01, 50),
        (150_000, (1, 1, 1, 1), 0.01, 70),
        (150_000, (1, 1, 1, 0.5), 0.02, 70),
        (20_000, (1, 1), 0.01, 25),
        (1_000_000, (1,) * 16, 0.01, 320),
    ],
)
def test_workers_end_together_after_few_chunks(rows, speeds, over, most):
    seconds, chunks = simulated(rows, speeds)
    assert seconds < (1.0 + over) * rows * ROW / sum(speeds)
    assert chunks <= most


class Elsewhere:
    """An executor that computes what is submitted, and whose work is not counted."""

    _max_workers = 2

    def __init__(self):
        self.chunks = 0

    def submit(self, function, *args):
        counting = sys.getprofile()
        sys.setprofile(None)
        future = Future()
        sent = pickle.loads(pickle.dumps((function, args)))
        future.set_result(pickle.loads(pickle.dumps(sent[0](*sent[1]))))
        self.chunks += 1
        sys.setprofile(counting)
        return future


def calls_of(rows, folder=None, executor=None, of_length=False):
    """How many functions a process calls that hands out a study, or solves its rows."""
    scene, (angle, length, _), out = four_bar()
    plan = asm.grid({angle: np.linspace(0.7, 1.7, rows)})
    if of_length:
        plan = asm.grid({length: length.value * np.linspace(0.99, 1.01, rows)})
    count = 0

    def one_more(_frame, event, _argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(one_more)
    try:
        found = asm.study(scene, plan, out, executor=executor, folder=folder, chunk_seconds=1e6)
    finally:
        sys.setprofile(None)
    assert found.success.all()
    return count


@pytest.mark.parametrize(("kept", "most"), [(False, 0.75), (True, 1.2)], ids=["kept nowhere", "in a folder"])
def test_a_row_costs_hardly_anything_where_it_is_handed_out(kept, most, tmp_path):
    # The first one loads what it needs.
    _, few, many = (calls_of(rows, tmp_path / str(rows) if kept else None, Elsewhere()) for rows in (40, 1000, 3000))
    # 0.65 and 1.14 calls, of runs and coarse rows; solving and measuring a row takes some 160.
    assert (many - few) / 2000 < most


def test_a_row_with_another_length_lends_what_changed():
    # Table and pool of the twin with its numbers. It was 185 where all arrays were lent anew, at 1 to 2 us an array.
    _, few, many = (calls_of(rows, of_length=True) for rows in (40, 200, 600))
    assert (many - few) / 400 < 165


def test_a_single_worker_gets_chunks_of_the_requested_time():
    _, chunks = simulated(150_000, (1,))
    # Of half a second but for the first ones; with shares for others to end together with there were 26.
    assert chunks <= 19


def test_what_workers_are_sent_has_a_name_by_its_content():
    one, same, other = (Parcel(content) for content in (b"rows", b"rows", b"row"))
    assert one.name == same.name != other.name
    there = pickle.loads(pickle.dumps(one))
    assert (there.content, there.name) == (one.content, one.name)


def test_what_workers_give_back_is_one_thing_to_send():
    rng = np.random.default_rng(0)
    starts = {
        k: [Start(rng.normal(size=2), rng.normal(size=(5, 7))) if j != 3 else None for j in range(4)] for k in (2, 5)
    }
    numbers = np.zeros(8, dtype=np.uint8), {3: "none"}, np.arange(8, dtype=np.int32), rng.normal(size=(8, 1))
    for given in (starts, {2: [None, None]}, {}):
        done = ChunkDone([2, 5], ("SOLVED", "STALLED"), *numbers, given, 0.5, "x86-64-v3", interrupted=True)
        apart = []
        again = pickle.loads(pickle.dumps(done, protocol=5, buffer_callback=apart.append), buffers=apart)
        # Dask sends what is apart one by one; there were two arrays of each start, for some 70 us.
        assert not apart
        assert list(again.starts) == list(given)
        for one, other in zip(sum(given.values(), []), sum(again.starts.values(), []), strict=True):
            assert (one is None) == (other is None)
            assert one is None or all(a.tobytes() == b.tobytes() for a, b in zip(one, other, strict=True))
        for name in done._fields:
            if name != "starts":
                np.testing.assert_array_equal(getattr(again, name), getattr(done, name))


def test_dask_takes_the_name_of_what_is_sent_and_does_not_print_it():
    tokenize = pytest.importorskip("dask.tokenize", reason="Dask, of the extra cluster, is not installed").tokenize
    one = Parcel(b"rows")
    named = tokenize(one)
    assert named == tokenize(Parcel(b"rows")) != tokenize(Parcel(b"row"))
    one.content = b"others"
    assert tokenize(one) == named
