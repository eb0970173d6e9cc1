"""The example of the pin in the slot: places and gaps in closed form, all the way in and along."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example

REACH, PLAY = 22.0, 1.0  # of the pin's axis along the slot and across it


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("pin_in_slot", tmp_path_factory.mktemp("pin_in_slot"))


def in_slot(run, point):
    """Along the slot and to its left."""
    return np.array([run.module.ALONG, run.module.LEFT]) @ np.asarray(point)[:2]


def test_the_pin_is_where_it_is_nearest_to_the_hand(run):
    targets, solutions = run.result
    assert len(solutions) == len(targets) == 176 and all(solution.success for solution in solutions)
    for target, solution in zip(targets, solutions, strict=True):
        pose = solution.pose("pin")
        x, y = in_slot(run, target)
        middle = np.array([np.clip(x, -REACH, REACH), 0.0])
        away = np.array([x, y]) - middle
        exact = middle + away / max(np.hypot(*away) / PLAY, 1.0)
        # Constraints hold to 2e-13 of the extent, some 120, and slopes to 1e-10.
        assert in_slot(run, pose.position) == pytest.approx(exact, abs=1e-8)
        assert pose.position[2] == pytest.approx(target[2], abs=1e-8)
        # Upright: two components of the quaternion are zero.
        assert pose.quaternion[1:3] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_no_wall_is_run_through_and_gaps_are_those_of_the_plane_figure(run):
    targets, solutions = run.result
    for target, solution in zip(targets, solutions, strict=True):
        gaps = {name: pair.gap for name, pair in solution.contacts.items()}
        assert min(gaps.values()) > -1e-9
        if target[2] > 20.0:
            continue  # still above the plate
        x, y = in_slot(run, solution.pose("pin").position)
        # The flat walls end where the round one begins.
        beyond = max(x - REACH, 0.0)
        assert gaps["slot left"] == pytest.approx(np.hypot(beyond, 8.0 - y) - 7.0, abs=1e-9)
        assert gaps["slot right"] == pytest.approx(np.hypot(beyond, 8.0 + y) - 7.0, abs=1e-9)
        if x > REACH:
            assert gaps["slot end"] == pytest.approx(PLAY - np.hypot(x - REACH, y), abs=1e-9)


def test_it_stops_at_the_round_end(run):
    targets, solutions = run.result
    assert in_slot(run, targets[-1])[0] == pytest.approx(40.0)
    last = in_slot(run, solutions[-1].pose("pin").position)
    assert 22.8 < last[0] < 23.0 and solutions[-1].contacts["slot end"].gap == pytest.approx(0.0, abs=1e-9)


def test_it_prints_both_places_and_what_touches(run):
    targets, solutions = run.result
    assert len(run.lines) == 19
    for line, k in zip(run.lines[1:], range(5, 176, 10), strict=True):
        words = line.split(maxsplit=8)
        assert [float(word) for word in words[:3]] == pytest.approx(targets[k], abs=5.1e-4)
        place = [float(word) for word in words[3:6]]
        assert place == pytest.approx(solutions[k].pose("pin").position, abs=5.1e-4)
        assert place[:2] == pytest.approx([float(word) for word in words[6:8]], abs=1.1e-3)
        held = np.hypot(*np.array(place[:2]) - targets[k][:2]) > 1e-2
        assert (len(words) == 9) == held
    assert "MeshCat.Viewer" in run.page
