"""The example of the three paper clips: solved, threaded, and no wire in another."""

from __future__ import annotations

from contextlib import redirect_stdout
from importlib.util import module_from_spec, spec_from_file_location
from io import StringIO
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import assembly as asm

ROOT = Path(__file__).resolve().parents[2]
WIRE_RADIUS = 0.5
PAIRS = list(combinations(("red", "green", "blue"), 2))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The scene, its solution, what was printed, and the folder the example wrote into."""
    spec = spec_from_file_location("paper_clips", ROOT / "examples" / "paper_clips.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    folder = tmp_path_factory.mktemp("clips")
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as printed:
        patch.chdir(folder)
        solution = module.main()
    return module.paper_clips(), solution, printed.getvalue(), folder


def center_line(t):
    """Points of a clip's center line without its round caps, t from 0 to 1: halfway between opposite points."""
    clip = asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=WIRE_RADIUS)
    low, high = clip.breaks()[0][[1, -2]]
    u = low + (high - low) * np.clip(t, 0.0, 1.0)
    return 0.5 * (clip.evaluate(u, 0.0) + clip.evaluate(u, np.pi * WIRE_RADIUS))


def nearest(pose_a, pose_b):
    """Smallest distance of two center lines: samples 0.1 apart, and the ten closest stretches again, finer."""
    t = np.linspace(0.0, 1.0, 1000)
    line = center_line(t)

    def distances(s, t):
        a, b = pose_a.apply(center_line(s)), pose_b.apply(center_line(t))
        return np.linalg.norm(a[:, None] - b[None, :], axis=2)

    a, b = pose_a.apply(line), pose_b.apply(line)
    rough = np.linalg.norm(a[:, None] - b[None, :], axis=2)
    # Every sample that is closer than those around it.
    inner = np.pad(rough, 1, constant_values=np.inf)
    around = np.min(
        [inner[1 + i : 1001 + i, 1 + j : 1001 + j] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j], axis=0
    )
    best = []
    closest = sorted(np.argwhere(rough <= around), key=lambda k: rough[tuple(k)])[:10]
    for s, u in (t[k] for k in closest):
        width = t[1]
        for _ in range(8):
            fine_s, fine_u = s + width * np.linspace(-1, 1, 21), u + width * np.linspace(-1, 1, 21)
            grid = distances(fine_s, fine_u)
            i, j = np.unravel_index(grid.argmin(), grid.shape)
            s, u, width = fine_s[i], fine_u[j], 0.2 * width
        best.append(grid.min())
    return min(best)


def loops():
    """The lower and the upper loop of a clip, each closed by a straight line across (n, 3)."""
    line = center_line(np.linspace(0.0, 1.0, 1200))
    bottom, top = line[:, 2].argmin(), line[:, 2].argmax()
    return line[bottom - 230 : bottom + 150 : 4], line[top - 180 : top + 230 : 4]


def linking_number(a, b):
    """How often the closed polygon a goes through b: the sum of solid angles of pairs of sides, over 4 pi."""
    a1, b1 = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
    corners = b[None] - a[:, None], b[None] - a1[:, None], b1[None] - a1[:, None], b1[None] - a[:, None]

    def solid_angle(p, q, r):  # van Oosterom & Strackee, 1983
        lp, lq, lr = (np.linalg.norm(x, axis=-1) for x in (p, q, r))
        volume = (p * np.cross(q, r)).sum(-1)
        return 2.0 * np.arctan2(
            volume, lp * lq * lr + (p * q).sum(-1) * lr + (q * r).sum(-1) * lp + (p * r).sum(-1) * lq
        )

    p, q, r, s = corners
    return (solid_angle(p, q, r) + solid_angle(p, r, s)).sum() / (4.0 * np.pi)


def test_it_is_solved(run):
    _, solution, _, _ = run
    assert solution.success and solution.status is asm.Status.SOLVED
    assert set(solution.violations) == set(solution.contacts) == {f"{a}-{b}" for a, b in PAIRS}
    assert max(solution.violations.values()) < 1e-9 * WIRE_RADIUS
    tip = solution.pose("blue").apply([0.0, 0.0, -15.0])
    # The objective is the square; it ends where its gradient, not it, is at the tolerance.
    assert tip == pytest.approx([12.0, 4.0, -40.0], abs=1e-8)
    assert solution.pose("red").q == pytest.approx([0, 0, 0, 1, 0, 0, 0], abs=0)


def test_the_hand_has_some_way_to_go(run):
    chain, _, _, _ = run
    assert np.linalg.norm(chain.body("blue").pose.apply([0.0, 0.0, -15.0]) - [12.0, 4.0, -40.0]) > 3.0


@pytest.mark.parametrize(("a", "b"), PAIRS)
def test_wires_touch_and_nowhere_cross(run, a, b):
    chain, solution, _, _ = run
    distance = nearest(solution.pose(a), solution.pose(b))
    # They touch where the contact says (the center lines are two radii apart), and are nowhere nearer.
    assert distance == pytest.approx(2.0 * WIRE_RADIUS, abs=1e-6)
    assert nearest(chain.body(a).pose, chain.body(b).pose) > 2.0 * WIRE_RADIUS + 0.1


def test_clips_are_threaded(run):
    _, solution, _, _ = run
    lower, upper = loops()
    red = lower
    green, blue = (solution.pose(name).apply(upper) for name in ("green", "blue"))
    for a, b in combinations((red, green, blue), 2):
        # A whole number, found by adding 10,000 angles.
        assert abs(linking_number(a, b)) == pytest.approx(1.0, abs=1e-9)
    assert linking_number(upper, green) == pytest.approx(0.0, abs=1e-9)


def test_it_prints_the_solution_and_writes_the_page(run):
    _, solution, printed, folder = run
    assert printed == f"{solution}\n"
    assert printed.startswith("SOLVED: every constraint holds")
    page = folder / "paper_clips.html"
    assert "MeshCat.Viewer" in page.read_text(encoding="utf-8")
    assert page.stat().st_size < 1_000_000
