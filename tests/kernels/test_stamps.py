"""What an edit compiles again, and which kernels are told apart."""

from __future__ import annotations

import os
import shutil

import pytest

from tests.kernels.small_package import CALL, Package


def test_second_process_loads_what_the_first_compiled(package):
    answer, hits, misses, folder = package.call()
    assert (answer, hits, misses) == (8.0, 0, 1)
    assert folder.parent == package.cache / "assembly"
    # Two kernels, one signature each: the inlined helper has no entry of its own.
    assert [p.name.split("-")[0] for p in package.entries(folder)] == ["small.callee.inner", "small.caller.outer"]
    before = [p.stat().st_ino for p in package.entries(folder)]
    for path in package.entries(folder):
        os.utime(path, (1000.0, 1000.0))
    assert package.call() == (8.0, 1, 0, folder)
    assert [p.stat().st_ino for p in package.entries(folder)] == before
    # The one that was loaded was used now; the other one is a part of it.
    assert [p.stat().st_mtime > 1000.0 for p in package.entries(folder)] == [False, True]


# What a process says of each kernel: its name, its answer, whether it was compiled.


USED = """
from small.alone import alone
from small.callee import inner
from small.caller import outer
from small.parts import other_walked, walked
for kernel in (alone, inner, outer, walked, other_walked):
    answer = kernel(3.0)
    print(kernel.__name__, answer, "compiled" if kernel.stats.cache_misses else "found")
"""
NAMES = ("alone", "inner", "outer", "driven", "driven")
ANSWERS = (-3.0, 4.0, 8.0, 13.0, 17.0)


def said(package: Package) -> list[list[str]]:
    return [line.split() for line in package.run(USED).splitlines() if line.endswith(("found", "compiled"))]


@pytest.fixture(scope="module")
def all_filled(tmp_path_factory, run_python) -> Package:
    """A package whose cache holds what `USED` needs."""
    package = Package(tmp_path_factory.mktemp("all_filled"), run_python)
    assert said(package) == [[name, str(x), "compiled"] for name, x in zip(NAMES, ANSWERS, strict=True)]
    return package


@pytest.mark.parametrize(
    ("edits", "answers"),
    [
        # Three that have nothing to do with each other. The driver's file knows nothing of the parts: a kernel that it
        # makes depends on what it closes over, too.
        (
            [("alone.py", "-x", "-2.0 * x"), ("caller.py", "FACTOR *", "10.0 *"), ("parts.py", "x + 5.0", "x + 6.0")],
            (-6.0, None, 40.0, 15.0, 17.0),
        ),
        ([("callee.py", "x + 1.0", "x + 2.0")], (None, 5.0, 10.0, None, None)),
        # An inlined callee, and a driver.
        (
            [("callee.py", "    return x\n", "    return -x\n"), ("driver.py", "part(part(x))", "part(x)")],
            (None, 4.0, -8.0, 8.0, 10.0),
        ),
        ([("constants.py", "2.0", "3.0")], (None, None, 12.0, None, None)),
        ([("_kernel/linking.py", '"""How kernels', '"""  How kernels')], ANSWERS),
    ],
    ids=["three files", "a callee", "an inlined callee and a driver", "a constant", "the decorator"],
)
def test_an_edit_compiles_the_callers_and_only_these(package, all_filled, edits, answers):
    shutil.copytree(all_filled.cache, package.cache)
    for edit in edits:
        package.edit(*edit)
    expected = [
        [kernel, str(before), "found"] if now is None else [kernel, str(now), "compiled"]
        for kernel, before, now in zip(NAMES, ANSWERS, answers, strict=True)
    ]
    assert said(package) == expected


def test_few_states_of_the_sources_are_kept(compiled):
    (first,) = [p for p in compiled.entries(compiled.found) if "outer" in p.name]
    older = [first.with_name(first.name[:-16] + f"{k:016d}") for k in range(5)]
    for age, path in enumerate(older):
        path.write_bytes(b"")
        os.utime(path, (1000.0 + age, 1000.0 + age))
    compiled.edit("caller.py", "from small._kernel", "\nfrom small._kernel")
    assert compiled.call()[:3] == (8.0, 0, 1)
    kept = {p for p in compiled.entries(compiled.found) if "outer" in p.name}
    # The new one and those that were used last; of `inner`, which did not change, one.
    assert len(kept) == 4
    assert {first, *older[3:]} < kept
    assert len(compiled.entries(compiled.found)) == 5


def test_an_edit_that_is_undone_finds_the_old_entry(compiled):
    compiled.edit("callee.py", "x + 1.0", "x + 2.0")
    compiled.call()
    compiled.edit("callee.py", "x + 2.0", "x + 1.0")
    assert compiled.call() == (8.0, 1, 0, compiled.found)


# Code that writes a file of the package while a process runs.
EDIT = """
from pathlib import Path
import small
def edit(name, text):
    (Path(small.__file__).parent / name).write_text(text)
"""


@pytest.mark.parametrize(
    "before",
    [
        # After all is imported; and between the imports of a constant and of the kernel that holds it.
        "from small.caller import outer; edit('constants.py', 'FACTOR = 5.0')",
        "import small.constants; edit('constants.py', 'FACTOR = 5.0')",
    ],
)
def test_of_a_file_that_changes_while_a_process_runs_nothing_is_kept_or_found(compiled, before):
    assert compiled.run(EDIT + before + CALL).startswith("8.0|0|1|")
    assert compiled.call()[:3] == (20.0, 0, 1)


def test_kernels_that_differ_in_what_a_factory_gives_them_have_entries_of_their_own(package):
    (package.folder / "several.py").write_text("""
from small._kernel import kernel
from small.driver import twice
def exactly(exact):
    @kernel(exact=exact)
    def rest(x, y):
        return x * y - (x * y)
    return rest
def part(constant):
    def step(x, y=constant):
        return x + y
    return kernel(step, inner=True)
def step(x):
    return x + 5.0
first = twice(kernel(step, inner=True))
def step(x):
    return x + 7.0
second = twice(kernel(step, inner=True))
def pair(a, b, c):
    @kernel
    def of_three(x):
        return a * x * x + b * x + c
    return of_three
""")
    code = """
from small._kernel import kernel
from small.several import first, second, twice, pair, part, exactly
print(first(1.0), second(1.0), twice(part(5.0))(1.0), twice(part(7.0))(1.0), pair(1, 2, 1)(2.0), pair(1, 2, 2)(2.0))
print(exactly(True).stats.cache_path is not None, exactly(True)(0.1, 0.1))
paths = {made._cache._stamp for made in (exactly(True), exactly(False))}
print(len(paths))
"""
    for _ in range(2):
        lines = package.run(code).splitlines()
        assert lines[0] == "11.0 15.0 11.0 15.0 9.0 10.0"
        assert lines[2] == "2"


def test_kernels_that_call_each_other_can_be_made_by_a_factory(package):
    (package.folder / "recursive.py").write_text("""
from small._kernel import kernel
def made():
    @kernel
    def even(n):
        return True if n == 0 else not even(n - 1)
    return even
""")
    code = "from small.recursive import made\nmade()(6)\nprint(made()(7))"
    assert package.run(code).splitlines()[0] == "False"


def test_settings_that_change_the_code_have_their_own_folder(compiled):
    checked = compiled.call(NUMBA_BOUNDSCHECK="1")
    assert checked[:3] == (8.0, 0, 1)
    assert checked[3] != compiled.found


def test_kernels_of_a_factory_do_not_share_an_entry(package):
    code = "from small.caller import power\nprint(power(2)(3.0), power(3)(3.0))"
    for _ in range(2):
        assert package.run(code).splitlines()[0] == "9.0 27.0"
