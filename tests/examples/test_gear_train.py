"""The example of the gear train: turns that count on, a rack that drives backward, teeth that mesh."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from tests.examples.running import run_example

TURN = 2.0 * np.pi
STEPS = 240


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("gear_train", tmp_path_factory.mktemp("gear_train"))


def expected(turns):
    """Angles of the three shafts and the slide of the rack, from the numbers of teeth."""
    shaft, pinion = -turns * 12 / 48, turns * 12 / 48 * 16 / 40
    return {
        "crank.angle": turns * TURN,
        "shaft.angle": shaft * TURN,
        "pinion.angle": pinion * TURN,
        "rail.slide": 14.0 * (pinion - 0.5) * TURN,
    }


def test_turns_count_on_past_whole_turns(run):
    assert len(run.result) == STEPS + 2 and all(solution.success for solution in run.result)
    for k, solution in enumerate(run.result[:-1]):
        # A solve holds rows to 2e-13 of the largest body, the rack of 151; a shaft's angle is that over a lever.
        assert solution.values == pytest.approx(expected(10.0 * k / STEPS), abs=1e-9)
        angle = expected(10.0 * k / STEPS)["pinion.angle"]
        assert solution.pose("third").matrix[:2, 0] == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-11)


def test_the_rack_drives_the_crank_back_by_five_turns(run):
    assert run.result[-2].values["crank.angle"] == pytest.approx(10.0 * TURN, abs=1e-9)
    assert run.result[-1].values == pytest.approx(expected(5.0), abs=1e-9)


def test_the_train_has_one_freedom_and_a_drive(run):
    train, crank, _ = run.module.gear_train()
    driven = train.mobility(run.result[7].q)
    assert (driven.dof, driven.grubler, driven.redundant) == (0, 0, [])
    crank.angle = None
    assert train.mobility(run.result[7].q).dof == 1


@pytest.mark.parametrize("k", [0, 5, 100, STEPS])
def test_the_reference_agrees(run, k):
    train, crank, _ = run.module.gear_train()
    crank.angle = 10.0 * TURN * k / STEPS
    other = asm.reference.solve(train, run.result[k].q)
    assert other.success
    assert other.q == pytest.approx(run.result[k].q, abs=1e-8)
    assert other.values == pytest.approx(run.result[k].values, abs=1e-8)


def outline(solution, train, name, layer=0):
    """Corners (n, 2) of the teeth of a body in the world, seen along the shafts."""
    surface = train.body(name).faces[layer].face.surface
    return solution.pose(name).apply(surface.control_points[:, 1])[:, :2]


def inside(points, polygon):
    """Whether points (n, 2) lie in a polygon (m, 2): a ray along x crosses its sides an odd number of times."""
    (x, y), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
    beside = (y <= points[:, 1:]) != (y1 <= points[:, 1:])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x + (points[:, 1:] - y) * (x1 - x) / (y1 - y)
    return ((points[:, :1] < at) & beside).sum(axis=1) % 2 == 1


def test_teeth_mesh(run):
    train, _, _ = run.module.gear_train()
    for solution in run.result:
        wheels = {
            "first": outline(solution, train, "first"),
            "second below": outline(solution, train, "second", 0),
            "second above": outline(solution, train, "second", 1),
            "third below": outline(solution, train, "third", 0),
            "third above": outline(solution, train, "third", 1),
        }
        rack = outline(solution, train, "rack")
        # The bar behind its teeth belongs to it.
        wheels["rack"] = np.vstack([rack, rack[-1] - [0.0, 5.8], rack[0] - [0.0, 5.8]])
        for a, b in (("first", "second below"), ("second above", "third below"), ("third above", "rack")):
            corners, others = wheels[a], wheels[b]
            # No corner is in the other wheel, and corners come near: teeth reach into gaps.
            assert not inside(corners, others).any() and not inside(others, corners).any()
            apart = np.linalg.norm(corners[:, None] - others[None], axis=2)
            assert apart.min() < 1.2


def test_it_prints_turns_and_travel(run):
    solutions = [*run.result[:-1:24], run.result[-1]]
    assert len(run.lines) == len(solutions) == 12
    for line, turns in zip(run.lines, [*range(11), 5], strict=True):
        words = line.split()
        assert words[0:8:2] == ["crank", "shaft", "pinion", "rail"] and words[8:] == ["mm", "SOLVED"]
        wanted = expected(float(turns))
        numbers = [wanted[f"{name}.angle"] / TURN for name in ("crank", "shaft", "pinion")] + [wanted["rail.slide"]]
        assert [float(word) for word in words[1:8:2]] == pytest.approx(numbers, abs=5.1e-5)
    assert "MeshCat.Viewer" in run.page and "frame" in run.page
