"""Studies: on one branch, with the same bits whoever computes them, told row by row."""

from __future__ import annotations

import pickle
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor

import numpy as np
import pytest

import assembly as asm
from assembly._kernel.targets import PORTABLE_VARIABLES
from assembly.errors import InputError
from assembly.studies.sweeps.fronts import not_dominated
from assembly.studies.sweeps.task import portable_variables
from tests.studies.sweeps.sweep_scenes import (
    GROUND,
    ROCKER,
    ball_on_floor,
    columns,
    elbow_x,
    elbow_y,
    four_bar,
    narrow,
    wide,
)


@pytest.fixture(scope="module")
def found():
    return asm.study(*wide())


def test_designs_are_on_the_branch_of_the_scene_or_told_to_be_none(found):
    angle, crank, rod = found.plan.values.T
    pin = np.stack([crank * np.cos(angle), crank * np.sin(angle)], axis=1)
    across = np.linalg.norm(pin - [GROUND, 0.0], axis=1)
    exists = (np.abs(rod - ROCKER) < across) & (across < rod + ROCKER)
    held = found.success
    assert not (held & ~exists).any()
    # Some lie behind others that do not exist, seen along the line from row to row: 16 of 147.
    assert (exists & ~held).sum() < 0.15 * exists.sum() and exists.sum() < 0.95 * len(exists)
    assert set(found.table["status"][~held]) == {"BRANCH_ENDED"}
    elbow = np.stack([found["elbow_x"], found["elbow_y"]], axis=1)[held]
    side = (pin[held, 0] - GROUND) * elbow[:, 1] - pin[held, 1] * (elbow[:, 0] - GROUND)
    assert (side < 0.0).all()  # as where the scene stands: the other sign is the other assembly of the mechanism
    assert np.allclose(np.linalg.norm(elbow - pin[held], axis=1), rod[held], rtol=0.0, atol=1e-11)
    assert np.isnan(found["out"][~held]).all()


@pytest.mark.parametrize("design", [(5.95, 2.34, 4.87), (5.1, 2.61, 6.81), (0.06, 2.32, 1.55)])
def test_far_designs_that_the_branch_reaches_are_reached(design):
    scene, parameters, out = four_bar()
    now, there = np.array([item.value for item in parameters]), np.array(design)
    angle, crank, rod = (now + np.linspace(0.0, 1.0, 101)[:, None] * (there - now)).T
    across = np.hypot(GROUND - crank * np.cos(angle), crank * np.sin(angle))
    # All of the way exists, and none of it is near an end; steps of 1/64 of it are too long for Newton's method.
    assert np.minimum(rod + ROCKER - across, across - np.abs(rod - ROCKER)).min() > 0.05
    found = asm.study(scene, asm.rows({item: [value] for item, value in zip(parameters, design, strict=True)}), out)
    assert found.success.all()


def test_numbers_and_poses_of_the_scene_are_left_as_they_are():
    scene, plan, of = wide(40)
    before, solution = scene.q.copy(), scene.solve()
    asm.study(scene, plan, of)
    assert [parameter.value for parameter in plan.parameters] == [0.7, 1.5, 4.0]
    assert (scene.q == before).all() and (scene.solve().q == solution.q).all()


class Backward:
    """An executor that begins nothing before it must, and answers the last first."""

    def __init__(self):
        self.waiting = []

    def submit(self, function, *args):
        future = Future()
        self.waiting.append((future, function, args))
        if len(self.waiting) == 3:
            self.run()
        else:
            future.add_done_callback = lambda call, f=future: (Future.add_done_callback(f, call), self.run())
        return future

    def run(self):
        while self.waiting:
            future, function, args = self.waiting.pop()
            future.set_result(pickle.loads(pickle.dumps(function(*args))))


def test_the_bits_are_the_same_whoever_computes_in_whatever_chunks(found):
    assert columns(asm.study(*wide(), chunk_seconds=1e-3)) == columns(found)
    assert columns(asm.study(*wide(), executor=Backward(), chunk_seconds=0.02)) == columns(found)
    with ThreadPoolExecutor(3) as threads:
        assert columns(asm.study(*wide(), executor=threads, chunk_seconds=0.05)) == columns(found)


def test_what_solves_of_contacts_leave_in_a_scene_crosses_no_run(cases):
    scene, radius, height = ball_on_floor()
    plan = asm.grid({radius: np.linspace(1.0, 3.0, cases(70, 500))})
    whole = asm.study(scene, plan, height)
    assert whole.success.all()
    assert np.ptp(whole["height"] - whole["ball.radius"]) < 1e-10
    assert columns(asm.study(scene, plan, height, executor=Backward(), chunk_seconds=1e-3)) == columns(whole)


def test_a_row_is_solved_again_with_the_same_bits(found):
    rows = np.flatnonzero(found.success)
    for row in (rows[0], rows[len(rows) // 2], rows[-1]):
        solution = found.solution(row)
        assert elbow_x(solution) == found["elbow_x"][row] and elbow_y(solution) == found["elbow_y"][row]
    with pytest.raises(InputError, match=r"row \d+ is BRANCH_ENDED; expected one that has a solution"):
        found.solution(np.flatnonzero(~found.success)[0])


def test_failures_are_rows():
    scene, (angle, crank, _), out = four_bar()
    plan = [{angle: 0.8, crank: 1.5}, {angle: 0.9, crank: 1.5}, {angle: 1.0, crank: 12.0}, {angle: 1.1, crank: 1.5}]
    found = asm.study(scene, plan, {"out": out, "half": lambda solution: 1 / int(solution.q[1, 3] > 0.9)})
    assert found.table["status"].tolist() == ["SOLVED", "SOLVED", "BRANCH_ENDED", "ERROR"]
    assert found.table["message"][3].startswith("measure 'half' raised ZeroDivisionError")
    assert np.isfinite(found["out"][[0, 1, 3]]).all() and np.isnan(found["half"][3])


def test_refused_numbers_are_rows():
    scene, radius, height = ball_on_floor()
    found = asm.study(scene, asm.rows({radius: [2.0, -1.0, 2.1]}), height)
    assert found.table["status"].tolist() == ["SOLVED", "REFUSED", "SOLVED"]
    assert "radius" in found.table["message"][1]


def test_starts_are_those_of_their_numbers():
    scene, _, out = four_bar()
    few, many = asm.study(scene, asm.starts(5, seed=3), out), asm.study(scene, asm.starts(40, seed=3), out)
    assert few["out"].tobytes() == many["out"][:5].tobytes()
    # Both assemblies of the mechanism are found.
    assert len(set(np.round(many["out"][many.success], 6))) == 2


def test_what_is_best():
    scene, (angle, crank, _), out = four_bar()
    found = asm.study(scene, asm.grid({angle: [0.5, 1.0, 1.5], crank: [1.4, 1.5]}), [out, elbow_x, elbow_y])
    assert found.best("out")["out"] == found["out"].min() and found.best("out", largest=True)["row"] == 4
    front = found.pareto(minimize="elbow_x", maximize=["out"])
    assert 0 < len(front) and (np.diff(front["elbow_x"]) >= 0).all()
    for row in found.table:
        assert any(f["elbow_x"] <= row["elbow_x"] and f["out"] >= row["out"] for f in front)
    assert str(found).startswith("6 designs (grid): 6 SOLVED\n  angle: 0.5 to 1.5")
    with pytest.raises(InputError, match="measure is 'inn'; expected one of 'out', 'elbow_x', 'elbow_y'"):
        found.best("inn")


def test_a_front_has_no_row_that_another_one_is_better_than():
    costs = np.random.default_rng(1).integers(0, 12, (300, 3)).astype(float)
    front = not_dominated(costs)
    for row in range(len(costs)):
        below = (costs[front] <= costs[row]).all(axis=1)
        assert below.any() and (row not in front or (costs[front][below] == costs[row]).all())
    assert len(np.unique(costs[front], axis=0)) == len(front)


def test_a_study_can_be_watched_and_stopped():
    said = []

    def watch(done, total):
        said.append((done, total))
        return done > 50

    stopped = asm.study(*narrow(), progress=watch)
    done = stopped.table["status"] != "NOT_DONE"
    assert stopped.interrupted and 50 < done.sum() == said[-1][0] < 300 and said[-1][1] == 300
    whole = asm.study(*narrow())
    assert stopped.table["out"][done].tobytes() == whole.table["out"][done].tobytes()

    def interrupt(done, total):
        if done > 50:
            raise KeyboardInterrupt

    assert (asm.study(*narrow(), progress=interrupt).table["status"] != "NOT_DONE").sum() >= 32


def test_tables_of_other_libraries():
    scene, (angle, crank, _), out = four_bar()
    found = asm.study(scene, asm.grid({angle: [0.5, 1.0, 1.5], crank: [1.4, 1.5]}), out)
    pandas = pytest.importorskip("pandas", reason="pandas, of the extra tables, is not installed")
    frame = found.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and frame["out"].tolist() == found["out"].tolist()
    again = asm.study(scene, asm.rows(frame, [angle, crank]), out)
    # Solved in another order, and each to 2e-13 of the size.
    assert np.allclose(again["out"], found["out"], rtol=0.0, atol=1e-11)
    pytest.importorskip("xarray", reason="xarray, of the extra tables, is not installed")
    data = found.to_xarray()
    assert float(data["out"].sel(angle=1.0, crank=1.5)) == found["out"][3]


@pytest.mark.parametrize("names", [("out",), ("out", "elbow_x"), ("-out", "elbow_y")])
def test_plots(names, found):
    pytest.importorskip("matplotlib").use("Agg")
    from matplotlib import pyplot

    scene, (angle, crank, _), out = four_bar()
    flat = asm.study(scene, asm.grid({angle: np.linspace(0.5, 1, 4), crank: [1.4, 1.5]}), [out, elbow_x, elbow_y])
    for each in (flat, found, asm.study(scene, asm.grid({angle: [0.5, 0.6]}), [out, elbow_x, elbow_y])):
        axes = each.plot(*names)
        assert names[0].removeprefix("-") in axes.get_xlabel() + axes.get_ylabel() + "".join(
            other.get_ylabel() for other in axes.figure.axes
        )
        pyplot.close(axes.figure)


class Broken:
    """An executor whose only process is gone."""

    def submit(self, function, *args):
        future = Future()
        future.set_exception(BrokenExecutor("gone"))
        return future


def test_an_executor_that_breaks_says_how_to_go_on():
    with pytest.raises(asm.StudyError, match="with a folder= the same call goes on"):
        asm.study(*narrow(40), executor=Broken())


def test_workers_of_other_kernels_are_refused(monkeypatch):
    names = iter(["x86-64-v3", "znver9", "znver9", "znver9"])
    monkeypatch.setattr("assembly.studies.sweeps.work.kernels_of", lambda: next(names))
    with pytest.raises(asm.StudyError, match="kernels for x86-64-v3, and others now by kernels for znver9"):
        asm.study(*narrow(), chunk_seconds=1e-3)


def test_workers_take_the_kernels_that_are_portable():
    assert portable_variables() == PORTABLE_VARIABLES


def test_what_cannot_be_sent_is_told():
    scene, plan, _ = wide(3)
    with ThreadPoolExecutor(1) as threads, pytest.raises((InputError, TypeError), match="pickle"):
        lock = __import__("threading").Lock()
        asm.study(scene, plan, {"locked": lambda solution, lock=lock: 0.0}, executor=threads)


def test_plans_and_measures_that_are_none_are_told():
    scene, plan, _ = wide(3)
    (first, *_) = plan.parameters
    with pytest.raises(TypeError, match=r"of is 'swing'; expected a Measure"):
        asm.study(scene, plan, "swing")
    with pytest.raises(TypeError, match=r"expected asm\.grid\(\.\.\.\) of it"):
        asm.study(scene, {first: [1.0, 2.0]}, lambda solution: 0.0)
    with pytest.raises(InputError, match=r"\] is empty; expected values"):
        asm.grid({first: []})
    with pytest.raises(InputError, match=r"plan has .*, which is of another scene"):
        asm.study(wide(3)[0], plan, lambda solution: 0.0)


def test_a_study_is_shown_by_notebooks():
    scene, plan, of = wide(3)
    assert "3 designs" in asm.study(scene, plan, of)._repr_html_()
