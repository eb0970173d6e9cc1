"""Multipliers that push: least squares with signs, as by another method."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from assembly._record import Store
from assembly.constraints.program.records import Iterate, Program, Sparsity, header_at
from assembly.solve.loop.multipliers import (
    leave_out,
    let_pushing_count,
    predict_active_set,
    pushing_multipliers,
    weigh_rows,
)
from assembly.solve.loop.parameters import EXCHANGES, FORESEEN, NEAR, ROUNDS
from assembly.solve.loop.residuals import Structure
from assembly.solve.loop.workspace import Directions, System, new_rows

# A Hessian that is kept whole.
DENSE = Sparsity(None, np.zeros((1, 2), np.int64), None, None)


def pushing(jacobian, one_sided, residual, active, gradient, exchanges=EXCHANGES):
    """Of rows of one body: their multipliers, and which rows count."""
    rows = len(jacobian)
    wide = np.zeros((rows, 18))
    wide[:, :6] = jacobian
    bases = np.tile([0, -1, -1], (rows, 1))
    of_rows = np.arange(rows), np.full(rows, rows - 1)
    given = new_rows(rows, 1.0)._replace(active=active.copy(), gram=np.zeros((rows + 1, rows)))
    system = System(gradient, Directions(np.zeros(6), None, None, None), None, None)
    shape, point = Structure(bases, one_sided, None, of_rows), Iterate(None, None, None, residual, wide)
    y = np.full(rows, np.nan)
    pushing_multipliers(shape, point, given, system, exchanges, ROUNDS, y)
    return y, given.active > 0.0


@pytest.mark.parametrize("rank", [2, 3, 6])
@pytest.mark.parametrize("balanced", [True, False])
def test_they_leave_as_little_as_by_another_method(rank, balanced, cases):
    rng = np.random.default_rng(rank)
    for rows in (3, 12, 30):
        for _ in range(cases(8, 20)):
            # As of rows that hold a plane face: many, of a low rank. Some are two-sided, others too far away.
            jacobian = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, 6))
            one_sided = (rng.uniform(size=rows) < 0.8).astype(np.int64)
            near = rng.uniform(size=rows) < 0.8
            residual = np.where(near, rng.uniform(-NEAR, NEAR, rows), 1.0)
            gradient = rng.normal(size=6)
            if balanced:
                force = np.where(near | (one_sided == 0), rng.uniform(size=rows) < 0.2, 0.0) * rng.normal(size=rows)
                gradient = jacobian.T @ np.where(one_sided == 1, abs(force), force)
            # What the loop takes for active is as good as any.
            active = np.where(one_sided == 1, near & (rng.uniform(size=rows) < 0.5), 1.0)
            y, counts = pushing(jacobian, one_sided, residual, active, gradient)
            assert (y[one_sided == 1] <= 0.0).all() and (y[~counts] == 0.0).all()
            assert not (counts & ~near & (one_sided == 1)).any()
            # min |g + J^T y| over y <= 0 of the near rows and y of either sign of the two-sided ones.
            columns = np.concatenate([-jacobian[near & (one_sided == 1)], jacobian[one_sided == 0]])
            columns = np.concatenate([columns, -jacobian[one_sided == 0]]).T
            least = nnls(columns, -gradient, maxiter=1000)[1] if columns.size else np.linalg.norm(gradient)
            left = np.linalg.norm(gradient + jacobian.T @ y)
            # The square of the 1e-10 that |y| is weighed with, and rounding of rows that all but depend on others.
            assert left <= least + 1e-11, (rows, left, least)


def test_a_row_that_pulls_is_left_out_only_where_exchanges_are_asked_for():
    # Two springs of a body on a line: the one that pulls cannot help.
    jacobian = np.array([[1.0, 0, 0, 0, 0, 0], [1.0, 1.0, 0, 0, 0, 0]])
    gradient = np.array([1.0, -0.5, 0, 0, 0, 0])
    one_sided, residual, active = np.ones(2, dtype=np.int64), np.zeros(2), np.ones(2)
    y, counts = pushing(jacobian, one_sided, residual, active, gradient, 0)
    np.testing.assert_allclose(y, [-1.5, 0.0], rtol=0, atol=1e-15)
    y, counts = pushing(jacobian, one_sided, residual, active, gradient)
    np.testing.assert_allclose(y, [-1.0, 0.0], rtol=0, atol=1e-15)
    assert counts.tolist() == [True, False]


def rounds_of(rng, rows, rank, mu):
    """In how many rounds random rows of a rank that a step would break agree, or None; checks where they do."""
    wide = np.zeros((rows, 18))
    wide[:, :6] = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, 6))
    shape = Structure(np.tile([0, -1, -1], (rows, 1)), np.ones(rows, dtype=np.int64), DENSE, None)
    residual, gradient = rng.uniform(0.01, 1.0, rows), rng.normal(size=6)
    given, descent, step = new_rows(rows, mu), -gradient, -gradient
    program = Program(Store(np.zeros(200, dtype=np.int64), None), shape, None, None, None)
    point, hessian = Iterate(None, None, None, residual, wide), np.zeros((6, 6))
    system = System(gradient, Directions(descent, step, None, None), hessian, None)
    fewest, agreed = rows + 1, None
    for count in range(FORESEEN + 1):
        wrong = predict_active_set(program, point, given, system, fewest)
        if wrong == 0:
            agreed = count
            # The least of |d|^2 / 2 + g.d + sum min(c + J d, 0)^2 / 2 mu, and so downhill all the way.
            below = np.minimum(residual + wide[:, :6] @ step, 0.0)
            slope = step + gradient + wide[:, :6].T @ below / mu
            assert abs(slope).max() < 1e-12 / mu
            assert gradient @ step < 0.0
            break
        fewest = min(fewest, wrong)
        # Rows are added to the upper half.
        whole = np.triu(hessian) + np.triu(hessian, 1).T
        step[:] = np.linalg.solve(np.eye(6) + whole, descent)
    leave_out(shape, point, given, system)
    assert not given.foreseen.any() and not given.active.any()
    # Added and taken off again: rounding of c / mu.
    assert abs(descent + gradient).max() < 1e-15 * 1e3 / mu
    assert abs(hessian).max() < 1e-15 * 1e3 / mu
    return agreed


@pytest.mark.parametrize(("rows", "rank"), [(8, 6), (12, 6), (12, 3), (20, 3)])
def test_rows_are_foreseen_until_they_agree_and_left_out_again(rows, rank, cases):
    # Where all that are wrong change at once, 5, 25, 24 and 43 of a hundred change places for ever.
    rng = np.random.default_rng(4)
    rounds = [rounds_of(rng, rows, rank, 1e-3) for _ in range(cases(100, 400))]
    assert None not in rounds
    assert max(rounds) > 4 and np.mean(rounds) < 12.0


def test_rows_with_a_multiplier_and_a_gap_count_from_the_start_and_only_while_they_push():
    rng = np.random.default_rng(5)
    mu, rows, agreed, kept, released = 1e-6, 6, 0, 0, 0
    # Row 0 is of a contact, row 1 of a trim: it is left to the step.
    table = np.zeros(200, dtype=np.int64)
    header_at(table, 0).contacts, header_at(table, 0).trims = 1, 1
    for _ in range(200):
        wide = np.zeros((rows, 18))
        wide[:, :6] = rng.normal(size=(rows, 6))
        one_sided = np.array([1, 1, 1, 1, 1, 0])
        shape = Structure(np.tile([0, -1, -1], (rows, 1)), one_sided, DENSE, None)
        y = np.where(rng.uniform(size=rows) < 0.7, -rng.uniform(0.01, 1.0, rows), 0.0)
        # What is left after sliding, and a row that is violated.
        residual = rng.uniform(1e-5, 1e-3, rows) * [1, 1, 1, 1, -1, 1]
        gradient = rng.normal(size=6)
        given = new_rows(rows, mu)
        given.y[:] = y
        weigh_rows(given, one_sided, residual)
        counted = given.active > 0.0
        assert counted.tolist() == [False] * 4 + [True] * 2
        jacobian = wide[:, :6]
        forces = y + residual / mu
        descent = -gradient - jacobian[counted].T @ forces[counted]
        hessian = np.triu(jacobian[counted].T @ jacobian[counted] / mu)
        before = descent.copy(), hessian.copy()
        program = Program(Store(table, None), shape, None, None, None)
        point = Iterate(None, None, None, residual, wide)
        system = System(gradient, Directions(descent, np.zeros(6), None, None), hessian, None)
        let_pushing_count(program, point, given, system)
        pushed = (y < 0.0) & ~counted & (np.arange(rows) != 1)
        assert (given.foreseen == pushed).all() and ((given.active > 0.0) == (counted | pushed)).all()
        fewest = rows + 1
        for _ in range(20):
            step = np.linalg.solve(np.eye(6) + np.triu(hessian) + np.triu(hessian, 1).T, descent)
            system.directions.step[:] = step
            wrong = predict_active_set(program, point, given, system, fewest)
            fewest = min(fewest, wrong)
            if wrong == 0:
                agreed += 1
                there = forces + jacobian @ step / mu
                # Those that were violated count however they end.
                assert ((given.active > 0.0) == ((there < 0.0) | counted))[np.arange(rows) != 1].all()
                kept += (pushed & (given.foreseen == 1.0)).sum()
                released += (pushed & (given.foreseen == 0.0)).sum()
                break
        leave_out(shape, point, given, system)
        assert ((given.active > 0.0) == counted).all()
        for after, at_first in zip((descent, hessian), before, strict=True):
            assert abs(after - at_first).max() < 1e-14 * 1e2 / mu
    assert agreed == 200 and kept > 50 and released > 50
