"""Orders in which rows are solved, and how these are cut."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.studies.sweeps.cutting import RUN, cut, cut_apart
from assembly.studies.sweeps.order import curve_order, snake_order


@pytest.mark.parametrize("shape", [(7,), (4, 5), (3, 4, 5), (1, 6, 1), (5, 1)])
def test_neighbors_in_a_snake_are_neighbors_in_the_grid(shape):
    order = snake_order(shape)
    assert sorted(order) == list(range(np.prod(shape)))
    places = np.stack(np.unravel_index(order, shape), axis=1)
    assert (np.abs(np.diff(places, axis=0)).sum(axis=1) == 1).all()


@pytest.mark.parametrize(("dimensions", "bits"), [(2, 4), (3, 3), (4, 2), (5, 2)])
def test_a_hilbert_curve_goes_from_cell_to_cell(dimensions, bits):
    side = 2**bits
    cells = np.stack(np.meshgrid(*[np.arange(side)] * dimensions, indexing="ij"), axis=-1).reshape(-1, dimensions)
    shuffled = np.random.default_rng(0).permutation(cells)
    order = curve_order((shuffled + 0.5) / side)
    assert sorted(order) == list(range(len(cells)))
    # Neighbors along the curve share a side: with more bits than the cells have too, as a cell is gone through whole.
    assert (np.abs(np.diff(shuffled[order], axis=0)).sum(axis=1) == 1).all()


def test_points_of_one_place_stay_in_their_order():
    assert curve_order(np.zeros((5, 3))).tolist() == [0, 1, 2, 3, 4]
    assert curve_order(np.ones((3, 70))).tolist() == [0, 1, 2]


@pytest.mark.parametrize("count", [1, 2, 32, 33, 1024, 1025, 1056, 1057, 5000, 40000])
def test_every_row_is_in_one_run_that_begins_at_a_row_before(count):
    order = np.random.default_rng(count).permutation(count).astype(np.int64)
    runs = cut(order)
    assert sorted(np.concatenate([run.rows for run in runs])) == list(range(count))
    assert all(len(run.rows) <= RUN for run in runs)
    begun = {}
    for number, run in enumerate(runs):
        for other in run.begins:
            assert other not in begun and other > number
            assert runs[other].start in run.rows
            begun[other] = number
    assert sorted(begun) == list(range(1, len(runs)))
    place = {int(row): k for k, row in enumerate(order)}
    for run in runs[1:]:
        gap = place[int(run.rows[0])] - place[run.start]
        assert gap in (1, RUN, RUN**2)


def test_a_cut_depends_on_nothing_but_the_rows_before_it():
    short, long = cut(np.arange(2048)), cut(np.arange(32768))
    known = {tuple(run.rows): run.start for run in long[1:]}
    assert all(known[tuple(run.rows)] == run.start for run in short[1:])


def test_starts_are_cut_apart():
    runs = cut_apart(70)
    assert [len(run.rows) for run in runs] == [32, 32, 6] and all(run.start is None for run in runs)
