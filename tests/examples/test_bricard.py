"""The example of Bricard's ring: mobility against the count, the motion against its closed form."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import assembly as asm
from tests.examples.running import run_example

HINGES = [f"hinge {k}" for k in range(1, 7)]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("bricard", tmp_path_factory.mktemp("bricard"))


def angles(solution):
    return np.array([solution.values[f"{name}.angle"] for name in HINGES])


def test_it_moves_though_the_count_says_no(run):
    mobility, _ = run.result
    assert (mobility.dof, mobility.grubler, mobility.rows, mobility.rank) == (1, 0, 30, 29)
    assert mobility.finite_dof == 1 and not mobility.singular
    assert mobility.redundant_sets == [tuple(HINGES)] and mobility.conflicting == []
    # Of the law below: at the cube, hinges turn at opposite rates by turns.
    turning = mobility.free_motions[0, :, 3:]
    rates = [(turning[k] - turning[k - 1]) @ run.module.AXES[k] for k in range(6)]
    assert rates == pytest.approx(rates[0] * np.array([1, -1, 1, -1, 1, -1]), abs=1e-12) and abs(rates[0]) > 0.1


def test_it_keeps_its_freedom_all_the_way(run):
    ring, _ = run.module.bricard()
    for solution in run.result[1][::12]:
        mobility = ring.mobility(solution.q)
        assert (mobility.dof, mobility.redundant_sets) == (1, [tuple(HINGES)])


def test_every_pose_is_on_the_curve_of_the_closed_form(run):
    """Links of equal length, twists of a right angle: sin a sin b = sin a + sin b, a and b the angles by turns."""
    _, solutions = run.result
    assert len(solutions) == 121 and all(solution.success for solution in solutions)
    swept = np.array([angles(solution) for solution in solutions])
    a, b = swept[:, 0], swept[:, 1]
    # Slopes of the law are up to 2, and angles are found to 1e-12.
    assert np.sin(a) * np.sin(b) == pytest.approx(np.sin(a) + np.sin(b), abs=1e-11)
    # Compared on the circle: half a turn is -pi or pi.
    for k in range(2, 6):
        assert np.exp(1j * swept[:, k]) == pytest.approx(np.exp(1j * swept[:, k % 2]), abs=1e-11)
    # All the way around: both hinges pass half a turn, and in the end everything is where it was.
    assert np.cos(a).min() == pytest.approx(-1.0, abs=1e-12) and np.cos(b).min() == pytest.approx(-1.0, abs=1e-12)
    start, end = solutions[0].q, solutions[-1].q
    assert end * np.sign(end[:, 3:4]) == pytest.approx(start * np.sign(start[:, 3:4]), abs=1e-9)


def test_neighbors_share_their_hinge(run):
    ring, _ = run.module.bricard()
    for solution in run.result[1]:
        for k in range(6):
            ends = run.module.CORNERS[k] + np.outer([-20.0, 20.0], run.module.AXES[k])
            there, here = (solution.pose(ring.bodies[j].name).apply(ends) for j in (k - 1, k))
            # 2e-13 of a tetrahedron, 85 across, and as much turned by its lever.
            assert here == pytest.approx(there, abs=1e-10)


@pytest.mark.parametrize("k", [0, 20, 45, 70, 119])
def test_the_reference_agrees(run, k):
    ring, hinges = run.module.bricard()
    driven = (k - 1) // 30 % 2 if k else 0
    value = angles(run.result[1][k])[driven]
    hinges[driven].angle = value
    other = asm.reference.solve(ring, run.result[1][k - 1 if k else 0].q)
    assert other.success
    mine = run.result[1][k].q
    signs = np.sign((mine[:, 3:] * other.q[:, 3:]).sum(axis=1, keepdims=True))
    assert other.q[:, :3] == pytest.approx(mine[:, :3], abs=1e-8)
    assert other.q[:, 3:] * signs == pytest.approx(mine[:, 3:], abs=1e-8)


def overlap(a, b):
    """How deep two tetrahedra (4, 3) are in each other: the least over the normals of faces and pairs of edges."""
    sides = [(p[j] - p[i]) for p in (a, b) for i, j in combinations(range(4), 2)]
    normals = [np.cross(p[j] - p[i], p[k] - p[i]) for p in (a, b) for i, j, k in combinations(range(4), 3)]
    normals += [np.cross(u, v) for u in sides[:6] for v in sides[6:]]
    n = np.array([normal / np.linalg.norm(normal) for normal in normals if np.linalg.norm(normal) > 1e-6])
    x, y = a @ n.T, b @ n.T
    return np.minimum(x.max(axis=0) - y.min(axis=0), y.max(axis=0) - x.min(axis=0)).min()


def test_tetrahedra_do_not_cross(run):
    ring, _ = run.module.bricard()
    corners = [
        np.unique(np.vstack([side.face.surface.control_points.reshape(-1, 3) for side in body.faces]), axis=0)
        for body in ring.bodies
    ]
    assert [c.shape for c in corners] == [(4, 3)] * 6
    deepest = {1: -np.inf, 2: -np.inf, 3: -np.inf}
    for solution in run.result[1][::3]:
        placed = [solution.pose(body.name).apply(c) for body, c in zip(ring.bodies, corners, strict=True)]
        for i, j in combinations(range(6), 2):
            steps = min(j - i, 6 - j + i)
            deepest[steps] = max(deepest[steps], overlap(placed[i], placed[j]))
    # Neighbors share an edge, and no more; the others are apart.
    assert deepest[1] < 1e-9 and deepest[2] < 1e-9 and deepest[3] < -1.0


def test_surfaces_face_outward(run):
    ring, _ = run.module.bricard()
    for body in ring.bodies:
        middle = np.mean([side.face.surface.evaluate(0.5, 0.5) for side in body.faces], axis=0)
        for side in body.faces:
            point = side.face.surface.evaluate(0.5, 0.5)
            assert (point - middle) @ side.face.normal(0.5, 0.5) > 1.0


def test_it_prints_the_mobility_and_the_angles(run):
    mobility, solutions = run.result
    text, count = str(mobility).splitlines(), len(run.lines) - 13
    assert run.lines[:count] == text
    assert text[0] == "1 degree of freedom; Grubler's count is 0: 30 rows of rank 29"
    for line, solution in zip(run.lines[count:], solutions[::10], strict=True):
        words = line.split()
        assert words[:2] == ["hinges", "[deg]"] and words[-1] == "SOLVED"
        off = np.array(words[2:-1], dtype=float) - np.degrees(angles(solution))
        assert np.abs(off) == pytest.approx(np.zeros(6), abs=5.1e-4)
    # sin a = sin b / (sin b - 1) at b = 60 degrees in the second of the lines.
    assert run.lines[count + 1].split()[2:4] == ["-60.000", "27.652"]
    assert np.sin(np.radians(27.652)) == pytest.approx(np.sin(np.pi / 3) / (1.0 + np.sin(np.pi / 3)), abs=1e-5)
    assert "MeshCat.Viewer" in run.page
