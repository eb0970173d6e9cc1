"""Records in flat blocks: kernels and Python read and write the same fields at the same places."""

from __future__ import annotations

import numpy as np
import pytest
from numba.core.errors import TypingError

from assembly._columns import Columns
from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, rows_of, size_of

NODE = record_dtype("f8", radius=1, center=3, rates=(2, 2))
HEAD = record_dtype("i8", count=1, first=1, sides=2)
node_at = record_view(NODE)
head_at = record_view(HEAD)


@kernel(inner=True)
def grown(node, factor):
    """A record goes from kernel to kernel."""
    node.radius *= factor
    return node.center[0] + node.center[2]


@kernel
def changed(table, pool, rows):
    head = head_at(table, 2)
    node = node_at(pool, 3)
    head.count += 1
    head.sides[1] = 40
    node.rates[1, 0] = 7.5
    row = node_at(rows, 1)
    row.center[1] = -1.0
    return grown(node, 2.0) + head.first + row.radius


def blocks():
    return np.arange(9), np.arange(20.0), np.arange(30.0).reshape(3, 10)


def test_fields_are_where_the_dtype_says():
    assert (size_of(NODE), size_of(HEAD)) == (8, 4)
    table, pool, rows = blocks()
    result = changed(table, pool, rows)
    assert result == (4.0 + 6.0) + 3.0 + 10.0
    assert table.tolist() == [0, 1, 3, 3, 4, 40, 6, 7, 8]
    assert pool[[3, 9]].tolist() == [6.0, 7.5]
    assert rows[1, :4].tolist() == [10.0, 11.0, -1.0, 13.0]


def test_python_reads_and_writes_the_same_fields():
    compiled, plain = blocks(), blocks()
    assert changed(*compiled) == changed.py_func(*plain)
    for a, b in zip(compiled, plain, strict=True):
        assert a.tolist() == b.tolist()


def test_where_a_block_has_no_record_python_has_none():
    # A kernel may take a view before it asks whether there is a record; a field of it fails in Python.
    pool = np.zeros(10)
    assert node_at(pool, 3) is None and node_at(pool, -1) is None


def test_records_of_other_numbers_are_refused():
    with pytest.raises(TypeError, match="a record of float64"):
        node_at(np.zeros(10, dtype=np.int64), 0)
    with pytest.raises(TypingError, match="a record of int64"):
        kernel(lambda pool: head_at(pool, 0).count)(np.zeros(10))


def test_rows_are_columns_of_fields():
    rows = np.arange(30.0).reshape(3, 10)
    nodes = rows_of(NODE, rows)
    nodes.radius[1] = -1.0
    assert nodes.center.tolist() == rows[:, 1:4].tolist() and rows[1, 0] == -1.0
    assert (place_of(NODE, "rates"), place_of(HEAD, "first")) == (4, 1)


def test_columns_are_the_fields_of_rows():
    dtype = record_dtype("f8", length=1, place=3)
    block = np.arange(10.0).reshape(2, 5)
    columns, rows = Columns(dtype, block), rows_of(dtype, block)
    assert np.array_equal(columns.length, rows.length) and np.array_equal(columns.place, rows.place)
    columns.length = 7.0
    columns.place[1] = (1.0, 2.0, 3.0)
    assert block[:, 0].tolist() == [7.0, 7.0] and block[1, 1:4].tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(AttributeError, match="no field 'width'"):
        columns.width = 1.0
    with pytest.raises(ValueError, match="broadcast"):
        columns.place = np.zeros(2)
