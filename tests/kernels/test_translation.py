"""What replaces parts of Numba's translator gives what these give."""

from __future__ import annotations

from itertools import product

from numba import types
from numba.core import compiler, ir, itanium_mangler
from numba.core.targetconfig import TargetConfig

from assembly._kernel.translation import quick_translation
from assembly.constraints.program.evaluate import evaluate
from assembly.solve.loop.augmented_lagrangian import run
from assembly.solve.loop.chord import chord_steps


def instructions():
    """Of some kernels all that Numba asks for its variables."""
    for function in (run, chord_steps, evaluate):
        for block in compiler.run_frontend(function).blocks.values():
            for statement in block.body:
                yield statement
                if isinstance(getattr(statement, "value", None), ir.Inst):
                    yield statement.value


def test_variables_of_instructions_are_those_that_numba_lists():
    found = list(instructions())
    expected = [instruction.list_vars() for instruction in found]
    with quick_translation():
        listed = [instruction.list_vars() for instruction in found]
    assert listed == expected
    assert sum(map(len, listed)) > 1000


def test_flags_are_those_that_numba_lists():
    flags = [compiler.Flags() for _ in range(3)]
    flags[1].nrt, flags[1].error_model = True, "numpy"
    flags[2].nrt = False
    expected = [one.values() for one in flags]
    with quick_translation():
        assert [one.values() for one in flags] == expected
        assert [flags[0] == one for one in flags] == [True, False, True]


def test_names_are_short_and_tell_types_and_flags_apart():
    record = types.Tuple([types.float64[::1]] * 40)
    given = [(types.int64,), (types.float64,), (record,), (record, record)]
    with quick_translation():
        names = {
            itanium_mangler.mangle("assembly.solve.loop.run", args, abi_tags=(tag,), uid=uid)
            for args, tag, uid in product(given, ("a", "b"), (1, 2))
        }
        again = itanium_mangler.mangle("assembly.solve.loop.run", given[2], abi_tags=("a",), uid=1)
    assert len(names) == 16 and again in names
    assert all(len(name) < 80 and name.startswith("_ZN8assembly5solve4loop3run") for name in names)


def test_names_of_others_stay_as_numba_writes_them():
    given = [("user.function", 7), ("assembly.solve", None), ("assemblyline.function", 7)]
    expected = [itanium_mangler.mangle(name, (types.float64,), uid=uid) for name, uid in given]
    before = itanium_mangler.mangle, ir.Inst._rec_list_vars, TargetConfig.values
    with quick_translation():
        assert [itanium_mangler.mangle(name, (types.float64,), uid=uid) for name, uid in given] == expected
    assert before == (itanium_mangler.mangle, ir.Inst._rec_list_vars, TargetConfig.values)
