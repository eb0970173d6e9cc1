"""The scenes that a hand drags start as they are said to, and their judges can say no."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.center_lines import paper_clip_wire
from benchmarks.hands import BOWL, NEAR, TAUT, WIRE, ball_in_bowl, bowl_distance, linked_rings, paper_clips, ring_chain
from benchmarks.scenes import MINOR
from benchmarks.wire_oracle import WireOracle


@pytest.mark.parametrize("distance", [NEAR, TAUT])
def test_rings_start_linked_and_clear(distance):
    rings = linked_rings(5, distance)
    assert rings.q.shape == (5, 3, 7) and rings.targets.shape == (5, 3)
    for q, links in zip(rings.q, rings.links, strict=True):
        assert rings.drag.deepest(q) > 0.0
        assert (np.abs(links) == 1).all() and (rings.drag.links(q) == links).all()


def test_rings_that_are_solved_without_clearance_are_seen_to_cross():
    rings = linked_rings(10, TAUT)
    depths, changed = [], 0
    for q, target, starts, links in zip(rings.q, rings.targets, rings.starts, rings.links, strict=True):
        rings.drag.grip.target = target
        solution = rings.drag.scene.solve(q, starts=starts)
        depths.append(rings.drag.deepest(solution.q))
        changed += (rings.drag.links(solution.q) != links).any()
    # Contacts hold one place of each pair; through other places, and out of one another, rings may go.
    assert min(depths) < -0.1 * MINOR and changed
    assert max(depths) < 1e-9  # they touch


def test_clips_start_clear_and_touch_when_solved():
    clips = paper_clips()
    start = clips.scene.q
    assert clips.deepest(start) > 0.4
    np.testing.assert_allclose(clips.hold, clips.scene.bodies[2].pose.apply([0.0, 0.0, -15.0]), rtol=0, atol=1e-14)
    solution = clips.scene.solve()
    assert solution.success and abs(clips.deepest(solution.q)) < 1e-10
    # The oracle's nearest pairs are the solution's three contacts.
    found = WireOracle([paper_clip_wire(33.0, 8.0, WIRE)] * 3).minima(solution.q, reach=1e-9)
    assert sorted(map(tuple, found.bodies.tolist())) == [(0, 1), (0, 2), (1, 2)]
    for (i, j), points in zip(found.bodies.tolist(), found.points, strict=True):
        names = [clips.scene.bodies[k].name for k in (i, j)]
        np.testing.assert_allclose(points, solution.contacts["-".join(names)].points, rtol=0, atol=1e-8)


def test_rings_of_the_chain_are_linked_with_the_next_alone():
    chain = ring_chain()
    q = chain.scene.q.copy()
    assert q.shape == (12, 7) and chain.deepest(q) > MINOR
    links = iter(chain.links(q))
    for i in range(12):
        for j in range(i + 1, 12):
            assert abs(next(links)) == (j == i + 1)
    q[5, 0] += 0.5
    assert chain.deepest(q) < -0.5 * MINOR


def test_the_bowl_is_a_paraboloid_with_a_round_rim():
    face = BOWL.face()
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-BOWL.rim, BOWL.rim, (2, 200))
    x, y, z = face.surface.evaluate(u, v).T
    assert np.abs([x - u, y - v, z - BOWL.steepness * (u**2 + v**2)]).max() < 1e-14 * BOWL.rim
    assert (face.contains(u, v) == (np.hypot(u, v) < BOWL.rim)).all()
    assert face.surface.normal(0.0, 0.0).tolist() == [0.0, 0.0, 1.0]
    # The ball fits in: it is less than the radius of curvature at the bottom.
    assert BOWL.ball < 0.5 / BOWL.steepness


def test_distances_from_the_bowl():
    assert bowl_distance(np.array([0.0, 0.0, 3.0])) == 3.0
    assert bowl_distance(np.array([0.0, 24.0, 9.0])) == 5.0  # of the rim, at a height of 12
    r, angle = np.meshgrid(np.linspace(0.0, BOWL.rim, 801), np.linspace(0.0, 2.0 * np.pi, 801))
    points = np.stack([r * np.cos(angle), r * np.sin(angle), BOWL.steepness * r**2], axis=-1).reshape(-1, 3)
    rng = np.random.default_rng(2)
    places = [*rng.uniform([-25, -25, -5], [25, 25, 30], (20, 3)), np.array([0.0, 0.0, 1 / 0.06]), np.zeros(3)]
    for place in places:
        sampled = np.linalg.norm(points - place, axis=1).min()
        # Samples are 0.04 x 0.16 apart: so much farther at most.
        assert sampled - 0.09 < bowl_distance(place) <= sampled + 1e-12


def test_the_ball_starts_clear_and_follows_over_the_rim():
    drag = ball_in_bowl()
    assert 0.0 < drag.deepest(drag.scene.q) < 1.0
    solution = drag.scene.solve()
    features = set()
    for x in np.arange(0.0, 30.0, 2.0):
        drag.grip.target = (x, 3.0, 16.0)
        solution = drag.scene.solve(solution)
        assert solution.success and abs(drag.deepest(solution.q)) < 1e-9
        features.add(solution.contacts["touch"].features[0].partition(" ")[0])
    assert features == {"face", "edge"}
    assert drag.links(solution.q).tolist() == [0]
