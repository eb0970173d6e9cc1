"""What Numba looks up instead of finding it anew is what it finds, and passes that are left out change nothing."""

from __future__ import annotations

import operator
import re
from contextlib import nullcontext

import numpy as np
import pytest
from numba import types
from numba.core import compiler, datamodel
from numba.core.base import BaseContext
from numba.core.bytecode import FunctionIdentity
from numba.core.registry import cpu_target
from numba.core.types.functions import BaseFunction
from numba.core.typing import npydecl

from assembly._kernel import kernel, linking
from assembly._kernel.shortcuts import needed_passes, nothing_twice

LEFT_OUT = {"InlineClosureLikes", "LiteralUnroll", "NopythonRewrites"}


def made():
    """A kernel with branches, loops, tuples, arrays, and kernels that it calls."""

    @kernel(inner=True)
    def largest(values, first):
        found = -1.0
        for k in range(first, values.size):
            found = max(found, abs(values[k]), 0.5 * k)
        return found, first

    @kernel(inline=True)
    def halved(values, given, weight):
        if given is None:
            return values[0] / weight
        values[0] = given[1] * 0.5
        return values[0]

    @kernel
    def entry(values, table):
        total = 0.0
        for r in range(table.shape[0]):
            most, first = largest(values, r)
            if most > 1.0 and not first > 3:
                total += most**2 - min(table[r, 0], 2.0)
            total += halved(values, None, 3.0) + halved(values, (r, total), 2)
        return total

    return entry


def machine_code(entry):
    """The instructions of an entry, without the names of symbols, which are numbered."""
    entry(np.array([3.0, -4.0, 0.5]), np.ones((2, 3)))
    (overload,) = entry.overloads.values()
    lines = (line.strip() for line in overload.library.get_asm_str().splitlines())
    told = [line for line in lines if line and not line.startswith((".", "_", "#"))]
    return [re.sub(r"[\w.$]*(?:_ZN|cfunc|numba)[\w.$@]*|B?\dv\d+", "name", line) for line in told]


def test_machine_code_is_that_of_numbas_own_passes(monkeypatch):
    short = machine_code(made())
    monkeypatch.setattr(linking, "nothing_twice", nullcontext)
    monkeypatch.setattr(linking.InnerCompiler, "define_pipelines", compiler.Compiler.define_pipelines)
    whole = machine_code(made())
    assert short == whole and len(short) > 100


def passes(function, allocates):
    """Names of the passes by which a function would be compiled."""
    state = compiler.StateDict()
    state.func_ir, state.func_id, state.flags = None, FunctionIdentity.from_function(function), compiler.Flags()
    state.flags.nrt, state.flags.enable_ssa = allocates, True
    return [made.__name__ for made, _said in needed_passes(state).passes]


def test_passes_are_left_out_where_they_have_nothing_to_do():
    def plain(x):
        return x + 1.0

    def with_a_function(x):
        return sum([x * k for k in range(3)], (lambda: x)())

    def that_catches(x):
        try:
            return 1.0 / x
        except ZeroDivisionError:
            return 0.0

    short, counting, closing = passes(plain, False), passes(plain, True), passes(with_a_function, False)
    assert not LEFT_OUT & set(short)
    assert LEFT_OUT <= set(counting) and counting == closing == passes(that_catches, False)
    short = [name.replace("KernelLowering", "NativeLowering") for name in short]
    assert [name for name in counting if name in short and name != "DeadBranchPrune"] == [
        name for name in short if name != "DeadBranchPrune"
    ]


@pytest.mark.parametrize("name", ["arguments", "signatures", "loops", "sizes"])
def test_what_is_looked_up_is_what_numba_finds(name):
    context, typing = cpu_target.target_context, cpu_target.typing_context
    array, pair = types.float64[::1], types.Tuple([types.float64[:, ::1], types.int64])
    given = [(array, pair), (types.int64, types.float64), (types.float64, types.boolean), (pair, pair)]
    scalars = given[1:3]

    def found():
        if name == "arguments":
            packers = [context.get_arg_packer(kinds) for kinds in given]
            return [(one.argument_types, [type(model) for model in one._dm_args]) for one in packers]
        if name == "signatures":
            functions = [typing.resolve_value_type(one) for one in (operator.add, operator.lt, max)]
            return [str(one.get_call_type(typing, kinds, {})) for one in functions for kinds in scalars]
        if name == "loops":
            return [npydecl.ufunc_find_matching_loop(np.add, kinds) for kinds in scalars]
        return [context.get_abi_sizeof(context.get_value_type(kind)) for kinds in given for kind in kinds]

    context.refresh()
    expected = found()
    with nothing_twice():
        assert found() == expected
        assert found() == expected


def test_numba_is_as_before_at_the_end():
    def replaced():
        return (
            BaseFunction.get_call_type,
            npydecl.ufunc_find_matching_loop,
            BaseContext.refresh,
            BaseContext.get_arg_packer,
            BaseContext.get_abi_sizeof,
        )

    before = replaced()
    with pytest.raises(KeyError), nothing_twice():
        assert not set(map(id, before)) & set(map(id, replaced()))
        assert isinstance(cpu_target.target_context.get_arg_packer(()), datamodel.ArgPacker)
        raise KeyError
    assert replaced() == before
