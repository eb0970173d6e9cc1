"""Where matrices have entries: with pairs at folds the step is that of the dense matrix, and fill stays in."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly._record import Store
from assembly.constraints.program import records as layout
from assembly.constraints.program.envelope import clear_upper, place_folds
from assembly.solve.linear_algebra.factorize import factorize_shifted, forward_step, solve_step
from assembly.solve.loop.multipliers import curvature_multipliers, toward_rows
from assembly.solve.loop.residuals import Structure, arrange, order_rows
from assembly.solve.loop.workspace import new_rows, new_system
from tests.laws.loop_point import room_of_shape


def random_system(rng, bodies, pairs):
    """A chain of bodies with pairs at folds between random ones; `order`, the dense matrix, its sparse upper half."""
    n = 6 * bodies + 4 * pairs
    last = np.repeat(6 * np.arange(bodies) + 5, 6)
    matrix = np.zeros((n, n))
    folds = np.zeros((pairs + 2, 2), dtype=np.int64)

    def couple(i, wide_i, j, wide_j):
        matrix[i : i + wide_i, j : j + wide_j] = rng.normal(size=(wide_i, wide_j))

    for b in range(bodies):
        couple(6 * b, 6, 6 * b, 6)
        if b + 1 < bodies:
            couple(6 * b, 6, 6 * b + 6, 6)
            last[6 * b] = 6 * b + 11
    for k in range(pairs):
        f = int(rng.integers(-1, bodies))
        g = f + 1 if -1 < f < bodies - 1 else -1
        u = 6 * bodies + 4 * k
        folds[k] = (6 * f if f >= 0 else -6, 6 * g if g >= 0 else -6)
        if rng.random() < 0.5:
            folds[k] = folds[k, ::-1]
        couple(u, 4, u, 4)
        for at in folds[k]:
            if at >= 0:
                couple(at, 6, u, 4)
    folds[-1, 0] = pairs
    last = np.concatenate([np.maximum.accumulate(last), np.repeat(6 * bodies + 4 * np.arange(pairs) + 3, 4)])
    places = np.empty((3, n), np.int64)
    places[0] = last
    order = layout.Sparsity(places, folds, np.empty((1, n)), np.empty(0, np.int64))
    place_folds(n, order)
    dense = np.triu(matrix) + np.triu(matrix, 1).T
    dense += np.diag(np.abs(dense).sum(axis=1) + 1.0)
    return order, dense


@pytest.mark.parametrize("bodies, pairs", [(1, 1), (2, 1), (3, 0), (3, 5), (12, 4), (12, 30)])
def test_the_step_is_that_of_the_dense_matrix(bodies, pairs):
    rng = np.random.default_rng([bodies, pairs])
    order, dense = random_system(rng, bodies, pairs)
    n = len(dense)
    if pairs > 0:
        # A permutation, and rows of the factor that reach farther and farther.
        assert sorted(order.places[1]) == list(range(n))
        assert (np.diff(order.places[2]) >= 0).all()
    # What the order does not list is neither read nor written.
    upper, factor = np.full((n, n), np.nan), np.full((n, n), np.nan)
    clear_upper(order, n, upper)
    known = np.isfinite(upper)
    assert (np.triu(dense)[~known] == 0.0).all()
    upper[known] = np.triu(dense)[known]
    shift = 0.25
    assert factorize_shifted(upper, n, order, shift, factor) == shift
    x = rng.normal(size=n)
    whole = dense + shift * np.eye(n)
    b = whole @ x
    solve_step(factor, n, order, b)
    # A diagonally dominant matrix of a hundred rows at most: some roundings.
    np.testing.assert_allclose(b, x, rtol=0, atol=1e-13)
    # |U^-T b|^2 = b . A^-1 b, in whatever order.
    half = whole @ x
    forward_step(factor, n, order, half)
    np.testing.assert_allclose(half @ half, x @ whole @ x, rtol=1e-13)


def test_a_chain_with_folds_is_as_narrow_as_one_without():
    rng = np.random.default_rng(1)
    order, dense = random_system(rng, 40, 39)
    reach = order.places[2] - np.arange(len(dense))
    # Two bodies and what may stand behind each of them.
    most = np.bincount(np.maximum(order.folds[:39, 0], order.folds[:39, 1]).clip(0) // 6).max()
    assert reach.max() < 12 + 4 * (2 * most + 1)


def test_rows_of_a_chain_meet_only_their_neighbors():
    bodies = [asm.Body("0", asm.shapes.torus(1.0, 0.3), fixed=True)]
    bodies += [asm.Body(f"{k}", asm.shapes.torus(1.0, 0.3), position=(2.7 * k, 0.0, 0.0)) for k in range(1, 20)]
    scene = asm.Assembly(bodies)
    pairs = list(zip(bodies, bodies[1:], strict=False))
    # Contacts stand first in the table, joints behind them, and rows of tangency last.
    scene.constrain(*(asm.Contact(a, b) for a, b in pairs))
    scene.constrain(*(asm.Distance(a.point(0, 0, 0), b.point(0, 0, 0), 2.7) for a, b in pairs))
    table = scene.packed().table
    count = int(table[layout.CONTACTS])
    rows, n = int(table[layout.ROWS]) + 4 * count, 6 * int(table[layout.MOVING]) + 4 * count
    shape = room_of_shape(table, rows, n, table[:0])
    arrange(table, np.arange(count), shape, rows, n)
    order_rows(shape, rows, n)
    bases, _sides, order, (sequence, last_row) = shape
    assert sorted(sequence) == list(range(rows))
    for k, r in enumerate(sequence):
        shared = [l for l, s in enumerate(sequence) if np.intersect1d(bases[r][bases[r] >= 0], bases[s]).size]
        assert last_row[k] >= max(shared)
    # Six rows a pair, and those of the next pair.
    assert (last_row - np.arange(rows)).max() < 18
    # A body, the next one, and the pairs behind both; behind the last one stands the pair with the fixed body as well.
    assert (order.places[2][:n] - np.arange(n)).max() < 24


def test_the_way_back_onto_rows_breaks_no_idle_ones():
    """One body: x is to grow by 1e-3, which alone would break y - x >= 0, idle so far; so y grows as well."""
    rows = 2
    bases = np.full((rows, 3), -1, dtype=np.int64)
    bases[:, 0] = 0
    jacobian = np.zeros((rows, layout.EXTRA_COLUMN))
    jacobian[0, 0], jacobian[1, :2] = 1.0, (-1.0, 1.0)
    places = np.array([np.full(6, 5), np.arange(6), np.full(6, 5)])
    order = layout.Sparsity(places, np.zeros((1, 2), np.int64), np.empty((1, 6)), np.empty(0, np.int64))
    shape = Structure(bases, np.ones(rows, np.int64), order, (np.arange(rows), np.full(rows, rows - 1)))
    given, system = new_rows(rows, 1e-6), new_system(6, 0, order)
    toward_rows(program_of(shape, rows), point_of([-1e-3, 0.0], jacobian), given, system, 1e-6, 0.0)
    out, active = system.directions.step, given.active
    # The square of the step, weighed with 1e-6 against a million times that of the rows, leaves 1e-12 of them.
    np.testing.assert_allclose(jacobian[:, :6] @ out, [1e-3, 0.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(out, [1e-3, 1e-3, 0, 0, 0, 0], rtol=0, atol=1e-14)
    assert active[1] > 0.0


def program_of(shape, rows):
    """A program of so many rows that knows where they stand, and nothing else."""
    table = np.zeros(layout.HEADER, dtype=np.int64)
    table[layout.ROWS] = rows
    return layout.Program(Store(table, None), shape, None, None, None)


def point_of(residual, jacobian):
    return layout.Iterate(None, None, None, np.array(residual), jacobian)


def way_back(sides, residual, jacobian, softness=1.0, enough=0.0):
    """The step back onto rows of one body's six unknowns, and which rows count."""
    rows = len(sides)
    bases = np.full((rows, 3), -1, dtype=np.int64)
    bases[:, 0] = 0
    places = np.array([np.full(6, 5), np.arange(6), np.full(6, 5)])
    order = layout.Sparsity(places, np.zeros((1, 2), np.int64), np.empty((1, 6)), np.empty(0, np.int64))
    shape = Structure(bases, np.array(sides), order, (np.arange(rows), np.full(rows, rows - 1)))
    whole = np.zeros((rows, layout.EXTRA_COLUMN))
    whole[:, :6] = jacobian
    given, system = new_rows(rows, 1e-6), new_system(6, 0, order)
    toward_rows(program_of(shape, rows), point_of(residual, whole), given, system, softness, enough)
    return system.directions.step, given.active > 0.0


@pytest.mark.parametrize("softness", [1.0, 1e-9])
@pytest.mark.parametrize("angle", [1e-3, 1e-6])
@pytest.mark.parametrize(("sides", "residual"), [((0, 1), (-1e-10, 3e-10)), ((1, 1), (-3e-10, -1e-10))])
def test_the_way_back_onto_rows_pulls_none_back(sides, residual, angle, softness):
    """Two contacts of the same wires, all but the same row: once one of them holds, the other one does."""
    jacobian = np.zeros((2, 6))
    jacobian[0, 0], jacobian[1, :2] = 1.0, (np.cos(angle), np.sin(angle))
    out, counts = way_back(sides, residual, jacobian, softness)
    # A softness of one leaves a millionth of the gap. To close both is a step of 2e-10 or 4e-10 over the angle.
    np.testing.assert_allclose(out, [-residual[0], 0, 0, 0, 0, 0], rtol=0, atol=1e-15)
    assert counts.tolist() == [True, False]


@pytest.mark.parametrize(("enough", "breaks"), [(1e-9, False), (1e-11, True)])
def test_the_way_back_onto_rows_breaks_others_by_no_more_than_enough(enough, breaks):
    jacobian = np.zeros((2, 6))
    jacobian[0, 0], jacobian[1, :2] = 1.0, (-1.0, 1.0)
    out, counts = way_back((0, 1), (-1e-10, 0.0), jacobian, enough=enough)
    # Alone, the first row breaks the second one by what it gains.
    np.testing.assert_allclose(out[:2], [1e-10, 1e-10 if breaks else 0.0], rtol=0, atol=1e-15)
    assert counts.tolist() == [True, breaks]


def test_the_way_back_onto_rows_pushes_a_whole_line_on():
    """Six bodies in a line touch, and the first has to go: every round finds one more that is in the way."""
    jacobian = np.eye(6) - np.eye(6, k=-1)
    out, counts = way_back([1] * 6, [-1e-6, 0, 0, 0, 0, 0], jacobian)
    # A millionth is left in every row.
    np.testing.assert_allclose(out, np.full(6, 1e-6), rtol=0, atol=3e-11)
    assert counts.all()


@pytest.mark.parametrize("angle", [1e-1, 1e-3, 1e-5])
def test_the_way_back_onto_rows_is_soft_only_where_it_must_be(angle):
    """Rows at a small angle, off to either side: the step between them is long, and is taken."""
    rows = 2
    bases = np.full((rows, 3), -1, dtype=np.int64)
    bases[:, 0] = 0
    jacobian = np.zeros((rows, layout.EXTRA_COLUMN))
    jacobian[0, 0], jacobian[1, :2] = 1.0, (np.cos(angle), np.sin(angle))
    places = np.array([np.full(6, 5), np.arange(6), np.full(6, 5)])
    order = layout.Sparsity(places, np.zeros((1, 2), np.int64), np.empty((1, 6)), np.empty(0, np.int64))
    shape = Structure(bases, np.zeros(rows, np.int64), order, (np.arange(rows), np.full(rows, rows - 1)))
    residual, mu = np.array([1e-10, -1e-10]), 1e-6
    given, system = new_rows(rows, mu), new_system(6, 0, order)
    back = (program_of(shape, rows), point_of(residual, jacobian), given, system, 1.0)
    softness = toward_rows(*back, 0.0)
    assert np.abs(residual + jacobian[:, :6] @ system.directions.step).max() <= 0.1 * 1e-10
    # By as much as the angle asks for: the least singular value is half of it.
    assert softness * mu <= 0.25 * angle**2 and (softness == 1.0) == (angle == 1e-1)
    # What is enough is left alone.
    assert toward_rows(*back, 1e-9) == 1.0


def test_restorations_keep_the_curvature_of_small_violations():
    residual, rows = np.array([3e-4, -2e-5]), new_rows(2, 1.0)
    rows.y[0], rows.active[0] = 1e-5, 1.0
    curvature_multipliers(rows, residual, True)
    assert rows.forces.tolist() == [3e-4, 0.0]
    # Multipliers that small are on their way to zero.
    curvature_multipliers(rows, residual, False)
    assert rows.forces.tolist() == [0.0, 0.0]
