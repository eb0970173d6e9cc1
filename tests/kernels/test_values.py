"""Values that are kept as values are what memory would hold, and errors of kernels arrive."""

from __future__ import annotations

from collections import namedtuple
from contextlib import nullcontext

import numpy as np
import pytest
from llvmlite import ir
from llvmlite.ir import instructions
from numba.core import compiler

from assembly._kernel import kernel, linking
from assembly._kernel.lowering import _CALM
from assembly._kernel.values import ValueBuilder

LONG, WORD = ir.IntType(64), ir.IntType(64).as_pointer()
PAIR = ir.LiteralStructType([LONG, LONG])
Arrays = namedtuple("Arrays", "first second")


@pytest.fixture
def builder():
    """The builder of a function of two integers and a pointer that returns an integer."""
    function = ir.Function(ir.Module(), ir.FunctionType(LONG, [LONG, LONG, WORD]), "function")
    return ValueBuilder(function.append_basic_block("entry"))


def names(builder):
    return [instr.opname for block in builder.function.blocks for instr in block.instructions]


def test_a_part_is_what_was_put_there(builder):
    first, second, address = builder.function.args
    pair = builder.insert_value(builder.insert_value(PAIR(ir.Undefined), first, 0), second, 1)
    assert builder.extract_value(pair, 0) is first and builder.extract_value(pair, [1]) is second
    loaded = builder.load(builder.bitcast(address, PAIR.as_pointer()))
    again = builder.insert_value(loaded, first, 0)
    part = builder.extract_value(again, 1)
    assert part is builder.extract_value(loaded, 1) and part.aggregate is loaded
    assert builder.extract_value(PAIR(None), 1) == LONG(None)
    builder.ret(part)
    builder.finish()
    assert names(builder) == ["bitcast", "load", "extractvalue", "ret"]


def test_a_part_stands_behind_its_value_and_serves_all_blocks(builder):
    pair = builder.load(builder.bitcast(builder.function.args[2], PAIR.as_pointer()))
    ends = [builder.append_basic_block() for _ in range(2)]
    builder.cbranch(builder.icmp_signed("<", *builder.function.args[:2]), *ends)
    parts = []
    for end in ends:
        builder.position_at_end(end)
        parts.append(builder.extract_value(pair, 1))
        builder.ret(parts[-1])
    builder.finish()
    assert parts[0] is parts[1]
    assert names(builder) == ["bitcast", "load", "extractvalue", "icmp", "br", "ret", "ret"]


def test_what_is_loaded_is_what_was_stored_last(builder):
    first, second, _address = builder.function.args
    slot = builder.alloca(PAIR)
    builder.store(PAIR(None), slot)
    places = [builder.gep(slot, [ir.IntType(32)(0), ir.IntType(32)(k)]) for k in range(2)]
    assert builder.load(places[1]) == LONG(None)
    builder.store(first, places[0])
    builder.store(second, places[1])
    assert builder.load(places[0]) is first
    whole = builder.load(slot)
    assert builder.extract_value(whole, 0) is first and builder.extract_value(whole, 1) is second
    builder.store(PAIR(None), slot)
    assert builder.load(places[0]) == LONG(None)
    builder.ret(builder.add(builder.extract_value(whole, 0), builder.extract_value(whole, 1)))
    builder.finish()
    assert names(builder) == ["add", "ret"]


def test_parts_of_parts_are_what_was_stored_last(builder):
    first, second, _address = builder.function.args
    slot = builder.alloca(ir.LiteralStructType([PAIR, LONG]))
    part = builder.gep(slot, [ir.IntType(32)(0), ir.IntType(32)(0)])
    places = [builder.gep(part, [ir.IntType(32)(0), ir.IntType(32)(k)]) for k in range(2)]
    builder.store(first, places[0])
    assert builder.load(places[0]) is first
    builder.store(PAIR(None), part)
    assert builder.load(places[0]) == LONG(None)
    builder.store(second, places[1])
    # What is beside a part of a part is read from memory.
    assert builder.load(places[1]) is second and isinstance(builder.load(places[0]), instructions.LoadInstr)


def test_another_block_loads_from_memory(builder):
    slot = builder.alloca(LONG)
    builder.store(builder.function.args[0], slot)
    following = builder.append_basic_block()
    builder.branch(following)
    builder.position_at_end(following)
    loaded = builder.load(slot)
    assert isinstance(loaded, instructions.LoadInstr) and builder.load(slot) is loaded
    builder.ret(loaded)
    builder.finish()
    assert names(builder) == ["alloca", "store", "br", "load", "ret"]


def test_a_slot_whose_address_is_given_away_is_memory(builder):
    function = ir.Function(builder.module, ir.FunctionType(LONG, [WORD]), "writes")
    slot, element = builder.alloca(LONG), builder.alloca(ir.ArrayType(LONG, 2))
    builder.store(builder.function.args[0], slot)
    builder.call(function, [slot])
    loaded = builder.load(slot)
    builder.store(ir.ArrayType(LONG, 2)(None), element)
    place = builder.gep(element, [LONG(0), builder.function.args[1]])
    builder.store(loaded, place)
    second = builder.load(builder.gep(element, [LONG(0), LONG(1)]))
    assert isinstance(loaded, instructions.LoadInstr) and isinstance(second, instructions.LoadInstr)
    builder.ret(second)
    builder.finish()
    assert [names(builder).count(name) for name in ("alloca", "store", "load", "call")] == [2, 3, 2, 1]


@kernel(inner=True)
def copies(arrays, target):
    if arrays.first.size > target.size:
        raise ValueError("no room for a copy")
    for k in range(arrays.first.size):
        target[k] = arrays.first[k]
    return arrays.second[0]


@kernel(inline=True)
def twice(arrays, target):
    return copies(arrays, target) + copies(Arrays(arrays.second, arrays.first), target)


@kernel(inner=True)
def last_of(values, start):
    """Variables that are set in some turns of a loop, and used after it."""
    found, before = 0.0, start
    for value in values:
        if value > before:
            found = value - before
            step = 2.0 * found
            before += step
        elif value < 0.0:
            found, before = before, found
    return found, before


@kernel
def entry(first, second, target):
    arrays = Arrays(first, second)
    found, before = last_of(first, 0.5)
    return twice(arrays, target) + 10.0 * found + 100.0 * before


def test_errors_of_inner_kernels_arrive():
    first, second = np.arange(4.0), np.ones(4)
    expected = last_of(first, 0.5)
    assert entry(first, second, np.zeros(4)) == 1.0 + 10.0 * expected[0] + 100.0 * expected[1]
    with pytest.raises(ValueError, match="no room for a copy"):
        entry(first, second, np.zeros(3))


def test_who_raises_no_error_is_known():
    entry(np.arange(4.0), np.ones(4), np.zeros(4))
    calm = [name for name in _CALM if __name__.rpartition(".")[2] in name]
    assert any("last_of" in name for name in calm)
    assert not any("copies" in name or "twice" in name for name in calm)


def test_variables_are_what_python_makes_of_them():
    random = np.random.default_rng(5)
    compiled = kernel(last_of_in_an_entry)
    for _ in range(50):
        values = random.normal(size=random.integers(0, 9))
        assert compiled(values, 0.25) == last_of(values, 0.25)


def last_of_in_an_entry(values, start):
    return last_of(values, start)


Pose = namedtuple("Pose", "position rotation")


def motions():
    """A kernel of sums of products in tuples of tuples, with branches, loops and calls, without fused multiply-add."""

    @kernel(inline=True, exact=True)
    def cross(a, b):
        return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]

    @kernel(inner=True, exact=True)
    def product(p, q):
        x, y = cross(p[1:], q[1:]), p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
        first, second = p[0] * q[1] + q[0] * p[1] + x[0], p[0] * q[2] + q[0] * p[2] + x[1]
        return y, first, second, p[0] * q[3] + q[0] * p[3] + x[2]

    @kernel(inner=True, exact=True)
    def moved(pose, turn, length):
        across = cross(pose.rotation[1:], pose.position)
        if across[0] > length:
            turn, length = product(pose.rotation, turn), 0.5 * length + across[1] * across[2]
        else:
            across = cross(across, turn[1:])
        x, y, z = pose.position
        return Pose((x + length * across[0], y - length * across[1], z + across[2] * x), turn), length

    @kernel(exact=True)
    def entry(numbers, out):
        pose, turn = Pose((1.0, 0.5, -0.25), (0.5, 0.5, -0.5, 0.5)), (1.0, 0.0, 0.0, 0.0)
        length = 0.25
        for k in range(numbers.shape[0]):
            turn = (numbers[k, 0], numbers[k, 1], numbers[k, 2], turn[0])
            pose, length = moved(pose, turn, length)
            if length > 2.0:
                length = 1.0 / length
        out[:3] = pose.position
        out[3:] = pose.rotation

    return entry


def test_without_fused_products_results_have_the_bits_of_numbas_own_translation(monkeypatch):
    # With them LLVM chooses which product of a sum is fused, by the form in which values come to it.
    ours = motions()
    cases = [0.7 * np.random.default_rng(k).normal(size=(6, 3)) for k in range(100)]
    found = np.zeros((len(cases), 2, 7))
    for case, out in zip(cases, found, strict=True):
        ours(case, out[0])
    for name in ("nothing_twice", "short_calls"):
        monkeypatch.setattr(linking, name, nullcontext)
    monkeypatch.setattr(linking.InnerCompiler, "define_pipelines", compiler.Compiler.define_pipelines)
    numbas = motions()
    for case, out in zip(cases, found, strict=True):
        numbas(case, out[1])
    assert np.isfinite(found).all() and len(np.unique(found[:, 0, 0])) == len(cases)
    assert found[:, 0].tobytes() == found[:, 1].tobytes()
