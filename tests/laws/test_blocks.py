"""Large scenes: the Hessian by blocks is the dense one, and the factor by blocks solves what the dense one does."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly._record import Store
from assembly.constraints.packing import written_scene as packing
from assembly.constraints.packing.elimination_order import block_record
from assembly.constraints.program import records as layout
from assembly.constraints.program.block_factor import (
    factorize_blocks,
    forward_blocks,
    greatest_diagonal,
    substitute_blocks,
)
from assembly.constraints.program.hessian_blocks import (
    BLOCKS,
    COUNT,
    FACTORED,
    FIRST,
    block_row,
    choose_storage,
    is_blocked,
)
from assembly.constraints.program.records import header_at
from assembly.solve.loop.workspace import carve_all, carve_unknowns
from assembly.solve.workspace import new_workspace
from tests.laws.loop_point import LoopPoint


def random_groups(rng, count, shape):
    """Pairs of bodies that meet: a chain, a tree, a grid, or any; some with a fixed body, one of three."""
    if shape == "chain":
        pairs = [(k, k + 1) for k in range(count - 1)]
    elif shape == "tree":
        pairs = [((k - 1) // 2, k) for k in range(1, count)]
    elif shape == "grid":
        side = round(count**0.5)
        pairs = [(k, k + 1) for k in range(count - 1) if (k + 1) % side] + [(k, k + side) for k in range(count - side)]
    else:
        pairs = [tuple(rng.choice(count, 2, replace=False)) for _ in range(2 * count)]
    numbers = rng.permutation(count)
    return [[int(numbers[k]) for k in pair] for pair in pairs] + [[-1, 0], numbers[:3].tolist()]


def random_blocks(rng, count, groups):
    """A record, a dense matrix that is positive definite, and its blocks."""
    blocks = block_record(count, groups)
    n = 6 * count
    dense = np.zeros((n, n))
    for group in [*groups, *([k] for k in range(count))]:
        for i in group:
            for j in group:
                if 0 <= i <= j:
                    block = rng.normal(size=(6, 6))
                    dense[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = block
    dense = np.triu(dense) + np.triu(dense, 1).T
    dense += np.diag(np.abs(dense).sum(axis=1) + 1.0)
    upper = np.full((6 * blocks[BLOCKS], 6), np.nan)
    for i in range(count):
        for j in range(i, count):
            block = dense[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
            if block.any():
                row = block_row(blocks, 6 * i, 6 * j)
                upper[row : row + 6] = np.triu(block) if i == j else block
    assert np.isfinite(upper).all()
    return blocks, dense, upper


@pytest.mark.parametrize("shape", ["chain", "tree", "grid", "any"])
@pytest.mark.parametrize("count", [4, 9, 49])
def test_the_step_is_that_of_the_dense_matrix(shape, count):
    rng = np.random.default_rng([count, len(shape)])
    blocks, dense, upper = random_blocks(rng, count, random_groups(rng, count, shape))
    n = 6 * count
    shift = 0.25
    # The factor writes every place it reads.
    panels, positions, turned = np.full(36 * blocks[FACTORED], np.nan), np.empty(n, np.int64), np.full(36, np.nan)
    assert factorize_blocks(upper, blocks, shift, panels, positions, turned)
    assert np.isfinite(panels).all()
    whole = dense + shift * np.eye(n)
    x = rng.normal(size=n)
    b = whole @ x
    half = np.empty(n)
    forward_blocks(blocks, panels, b, half)
    # |U^-T b|^2 = b . A^-1 b, in whatever order.
    np.testing.assert_allclose(half @ half, x @ whole @ x, rtol=1e-13)
    substitute_blocks(blocks, panels, b, np.empty(n))
    # A diagonally dominant matrix of some hundred rows: some roundings.
    np.testing.assert_allclose(b, x, rtol=0, atol=1e-13)
    assert greatest_diagonal(upper, blocks) == np.abs(np.diag(dense)).max()
    broken = upper.copy()
    broken[6 * blocks[blocks[FIRST]], 0] = np.nan
    assert not greatest_diagonal(broken, blocks) < np.inf
    # One direction downward is enough.
    least = np.linalg.eigvalsh(dense)[0]
    assert factorize_blocks(upper, blocks, -0.999 * least, panels, positions, turned)
    assert not factorize_blocks(upper, blocks, -1.001 * least, panels, positions, turned)


def test_trees_have_no_fill_and_grids_little():
    rng = np.random.default_rng(3)
    for shape in ("chain", "tree"):
        blocks = block_record(400, random_groups(rng, 400, shape)[:-1])
        assert blocks[COUNT] == 400
        assert blocks[FACTORED] == blocks[BLOCKS]
    blocks = block_record(400, random_groups(rng, 400, "grid")[:-1])
    # 4,100 here; an envelope has some 400 times 15.
    assert blocks[FACTORED] < 5_000


def mixed_scene(rng, count=7):
    """Tori that touch, hinges, a gear, a distance, expressions of three bodies as rows and as a term."""
    torus = asm.shapes.torus(1.0, 0.3)
    bodies = [
        asm.Body(f"{k}", torus, (2.7 * k, 0.0, 0.0), asm.Pose.from_axis_angle(rng.normal(size=3), 0.3).quaternion)
        for k in range(count)
    ]
    bodies[0] = asm.Body("0", torus, fixed=True)
    scene = asm.Assembly(bodies)
    hinges = [
        asm.Revolute(bodies[a].frame(z=(1, 0, k)), bodies[b].frame(at=(0, 1, 0)), f"hinge {a} {b}")
        for k, (a, b) in enumerate([(1, 3), (5, 2), (2, 3)])
    ]
    scene.constrain(*(asm.Contact(bodies[a], bodies[b]) for a, b in ((1, 0), (4, 5), (3, 2))))
    scene.constrain(*hinges, asm.Gear(hinges[0], hinges[1], 2.0))
    scene.constrain(asm.Distance(bodies[6].point(0, 0, 1), bodies[4].point(1, 0, 0), 3.0))
    a, b, c = poses = [ca.SX.sym(name, 7) for name in "abc"]
    function = ca.Function("f", poses, [ca.vertcat(ca.sin(a[0] * b[1]) + c[2] ** 2, a[3] * b[4] - c[5])])
    scene.constrain(asm.Expression(function, [bodies[6], bodies[1], bodies[4]], name="rows"))
    wish = ca.Function("g", poses, [ca.cos(a[1] * b[2]) * c[6]])
    scene.minimize(
        asm.Expression(wish, [bodies[5], bodies[2], bodies[6]]),
        asm.PointDistance(bodies[6].point(0.1, 0.2, 0.3), (1.0, 2.0, 3.0)),
        asm.Posture(),
    )
    return scene


def test_derivatives_by_blocks_are_the_dense_ones(monkeypatch):
    monkeypatch.setattr(packing, "FEW", 2)
    rng = np.random.default_rng(1)
    scene = mixed_scene(rng)
    dense, blocked = (LoopPoint(scene, scene.q, blocks=value) for value in (False, True))
    assert dense.room_for_hessian().shape != blocked.room_for_hessian().shape
    y, weights = rng.normal(size=dense.rows), rng.uniform(size=dense.rows)
    # The same products, added up in another order.
    for found, known in zip(blocked.goal(), dense.goal(), strict=True):
        np.testing.assert_allclose(found, known, rtol=0, atol=1e-12 * np.abs(known).max())
    known = dense.row_terms(y, weights)
    np.testing.assert_allclose(blocked.row_terms(y, weights), known, rtol=0, atol=1e-12 * np.abs(known).max())
    # Bodies that meet nowhere have no block.
    assert (known == 0.0).mean() > 0.2


def rings(count):
    """Linked rings on a string, the last one pulled."""
    torus = asm.shapes.torus(1.0, 0.2)
    bodies = [asm.Body("0", torus, fixed=True)]
    for k in range(1, count + 1):
        turn = asm.Pose.from_axis_angle((1.0, 0.0, 0.0), 0.5 * np.pi * (k % 2)).quaternion
        bodies.append(asm.Body(f"{k}", torus, (1.55 * k, 0.0, 0.0), turn))
    scene = asm.Assembly(bodies)
    scene.constrain(*(asm.Contact(a, b, f"{k}") for k, (a, b) in enumerate(zip(bodies, bodies[1:], strict=False))))
    return scene, bodies


@pytest.mark.parametrize("reach", [0.0, 3.0])
def test_solves_by_blocks_end_where_dense_ones_do(monkeypatch, reach):
    """Also where rings are pulled taut and contacts come to folds, whose unknowns no block has."""
    found = []
    for few in (100, 1):
        monkeypatch.setattr(packing, "FEW", few)
        scene, bodies = rings(3)
        if reach:
            scene.minimize(asm.PointDistance(bodies[-1].point(1, 0, 0), (5.65 + reach, 0.1, 0.2)))
        assert bool(scene.packed().table[layout.BLOCK_LENGTH]) == (few == 1)
        found.append(scene.solve())
    dense, blocked = found
    assert blocked.status is dense.status
    assert dense.success
    assert blocked.iterations == dense.iterations
    # Steps differ by rounding alone; the objective's minimum is flat.
    np.testing.assert_allclose(blocked.q, dense.q, rtol=0, atol=1e-7)


@pytest.mark.parametrize("few", [100, 1])
def test_a_workspace_has_room_for_the_system_of_every_count_of_lifted_pairs(monkeypatch, few):
    """The loop checks no end of its blocks of memory; in Python a part that goes beyond an end has no such shape."""
    monkeypatch.setattr(packing, "FEW", few)
    chained = asm.Assembly([asm.Body(f"{k}", None, (k, 0.0, 0.0), fixed=k == 0) for k in range(4)])
    chained.constrain(asm.Distance(chained.bodies[0].point(0, 0, 0), chained.bodies[1].point(0, 0, 0), 1.5))
    for scene in (mixed_scene(np.random.default_rng(1)), rings(3)[0], chained):
        packed = scene.packed()
        table = packed.rows_table
        _, doubles, integers = new_workspace(packed)
        workspace = carve_all(Store(table, packed.rows_pool), np.empty(0), None, doubles, integers)
        header, order = header_at(table, 0), workspace.program.structure.sparsity
        assert is_blocked(order) == (few == 1)
        for lifted in range(header.contacts + 1):
            n = 6 * header.moving + 4 * lifted
            choose_storage(order, n)
            system = carve_unknowns(n, lifted, order, workspace.room)
            assert is_blocked(order) == (few == 1 and lifted == 0)
        # That of all pairs ends where the room does.
        used = system.factor.ctypes.data + system.factor.nbytes
        assert used == workspace.room.ctypes.data + workspace.room.nbytes


def test_a_scene_of_many_bodies_has_blocks_and_few_bodies_none():
    for count, few in ((20, True), (60, False)):
        bodies = [asm.Body(f"{k}", None, (k, 0.0, 0.0), fixed=k == 0) for k in range(count)]
        scene = asm.Assembly(bodies)
        scene.constrain(
            *(
                asm.Distance(a.point(0, 0, 0), b.point(0, 0, 0), 1.5, f"{k}")
                for k, (a, b) in enumerate(zip(bodies, bodies[1:], strict=False))
            )
        )
        assert (scene.packed().table[layout.BLOCK_LENGTH] == 0) == few
        solution = scene.solve()
        assert solution.success
        gaps = np.linalg.norm(np.diff(solution.q[:, :3], axis=0), axis=1)
        np.testing.assert_allclose(gaps, 1.5, rtol=0, atol=1e-9)
