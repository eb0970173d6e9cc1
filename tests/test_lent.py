"""Arrays that are lent by a table of their addresses: kernels and Python read and write the arrays themselves."""

from __future__ import annotations

import numpy as np
import pytest

from assembly._kernel import kernel
from assembly._lent import lent_array, lent_table

SHAPES = [(4,), (0,), (2, 3), (0, 5), (2, 3, 4)]
FUNCTIONS = {(item, axes): lent_array(item, axes) for item in ("f8", "i8") for axes in (1, 2, 3)}
VECTOR, ROWS, BLOCK = (FUNCTIONS["f8", axes] for axes in (1, 2, 3))
INTEGERS, INTEGER_ROWS = FUNCTIONS["i8", 1], FUNCTIONS["i8", 2]


@kernel(allocates=True)
def doubled(table):
    """Double all numbers of a vector, rows, a block, integers and rows of integers; how many there are."""
    vector, rows, block = VECTOR(table, 0), ROWS(table, 1), BLOCK(table, 2)
    integers, integer_rows = INTEGERS(table, 3), INTEGER_ROWS(table, 4)
    for i in range(len(vector)):
        vector[i] *= 2.0
    for i in range(rows.shape[0]):
        row = rows[i]
        for j in range(rows.shape[1]):
            row[j] *= 2.0
    for i in range(block.shape[0]):
        for j in range(block.shape[1]):
            for k in range(block.shape[2]):
                block[i, j, k] *= 2.0
    for i in range(len(integers)):
        integers[i] *= 2
    for i in range(integer_rows.shape[0]):
        for j in range(integer_rows.shape[1]):
            integer_rows[i, j] *= 2
    return vector.size + rows.size + block.size + integers.size + integer_rows.size


def test_a_kernel_writes_to_the_arrays():
    rng = np.random.default_rng(1)
    arrays = [rng.normal(size=(5,)), rng.normal(size=(3, 7)), rng.normal(size=(2, 3, 4))]
    arrays += [rng.integers(-9, 9, size=(6,)), rng.integers(-9, 9, size=(4, 2))]
    before = [array.copy() for array in arrays]
    assert doubled(lent_table(arrays)) == sum(array.size for array in arrays)
    assert all(np.array_equal(array, 2 * was) for array, was in zip(arrays, before, strict=True))


@pytest.mark.parametrize("item", ["f8", "i8"])
@pytest.mark.parametrize("shape", SHAPES)
def test_python_reads_and_writes_the_same(item, shape):
    array = np.arange(np.prod(shape), dtype=item).reshape(shape)
    lent = FUNCTIONS[item, len(shape)](lent_table([np.zeros(3), array]), 1)
    assert lent.shape == shape and lent.dtype == array.dtype and np.array_equal(lent, array)
    lent[...] = 7
    assert (array == 7).all()


def test_what_is_not_in_one_piece_is_not_lent():
    with pytest.raises(AssertionError):
        lent_table([np.zeros((4, 4))[:, 1]])
