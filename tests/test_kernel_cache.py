"""The kernel cache, on a small package of its own that holds a copy of assembly/_kernel/."""

from __future__ import annotations

import hashlib
import importlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from assembly._kernel import kernel

KERNEL = Path(__file__).resolve().parent.parent / "assembly" / "_kernel"
FILES = {
    "__init__.py": "from small import _lazy\n",
    "constants.py": "FACTOR = 2.0\n",
    "callee.py": """
from small._kernel import kernel
@kernel
def inner(x):
    return x + 1.0
@kernel(inline=True)
def helper(x):
    return x
""",
    "caller.py": """
from small._kernel import kernel
from small.callee import helper, inner
from small.constants import FACTOR
@kernel
def outer(x):
    return FACTOR * helper(inner(x))
def power(exponent):
    @kernel
    def raised(x):
        return x**exponent
    return raised
""",
    # A driver made of another file's parts, and a kernel that uses nothing of the others.
    "driver.py": """
from small._kernel import kernel
def twice(part):
    @kernel
    def driven(x):
        return part(part(x))
    return driven
""",
    "parts.py": """
from small._kernel import kernel
from small.driver import twice
@kernel(inner=True)
def step(x):
    return x + 5.0
@kernel(inner=True)
def other_step(x):
    return x + 7.0
walked, other_walked = twice(step), twice(other_step)
""",
    "alone.py": """
from small._kernel import kernel
def is_unit(name):
    return name in {"mm", "cm", "m", "km", "inch"}
def negated(is_known):
    @kernel
    def alone(x):
        return -x
    return alone
alone = negated(kernel(is_unit, inner=True))
""",
}
AT = """
@kernel
def at(values, index):
    return values[index]
"""
# Prints the answer, how often it was found on disk and compiled, and where the cache is.
CALL = """
from small.caller import outer
from small._kernel.folders import entry_folder
answer = outer(3.0)
stats = outer.stats
print(answer, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), sep="|", end="|")
print(entry_folder())
"""
UNSET = dict.fromkeys(("NUMBA_DISABLE_JIT", "NUMBA_CACHE_LOCATOR_CLASSES", "XDG_CACHE_HOME", "LOCALAPPDATA"))


class Package:
    """A package `small` with kernels, a cache folder, and fresh processes that use both."""

    def __init__(self, folder: Path, run_python) -> None:
        self.folder = folder / "source" / "small"
        self.folder.mkdir(parents=True)
        for name, text in FILES.items():
            (self.folder / name).write_text(text)
        shutil.copytree(KERNEL, self.folder / "_kernel", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(KERNEL.with_name("_lazy.py"), self.folder)
        for path in (self.folder / "_kernel").iterdir():
            path.write_text(path.read_text().replace("from assembly.", "from small."))
        self.cache = folder / "cache"
        self._run_python = run_python

    def run(self, code: str = CALL, **variables: str | None) -> str:
        settings = {**UNSET, "NUMBA_CACHE_DIR": str(self.cache), **variables}
        return self._run_python(code, path=self.folder.parent, **settings)

    def call(self, **variables: str | None) -> tuple[float, int, int, Path | None]:
        """Answer, cache hits, compilations, cache folder, of a process that calls `outer(3.0)`."""
        answer, hits, misses, folder = self.run(**variables).strip().splitlines()[0].split("|")
        return float(answer), int(hits), int(misses), None if folder == "None" else Path(folder)

    def edit(self, name: str, old: str, new: str) -> None:
        text = (self.folder / name).read_text()
        assert text.count(old) == 1
        (self.folder / name).write_text(text.replace(old, new))

    def entries(self, folder: Path) -> list[Path]:
        return sorted(folder.iterdir())


@pytest.fixture
def package(tmp_path, run_python) -> Package:
    return Package(tmp_path, run_python)


@pytest.fixture(scope="module")
def filled(tmp_path_factory, run_python) -> Package:
    """A package whose cache holds what `outer(3.0)` needs."""
    package = Package(tmp_path_factory.mktemp("filled"), run_python)
    assert package.call()[:3] == (8.0, 0, 1)
    return package


@pytest.fixture
def compiled(package, filled) -> Package:
    """The same with a cache of its own, from what another process of another folder compiled; `found` is its folder."""
    shutil.copytree(filled.cache, package.cache)
    (package.found,) = (package.cache / "assembly").iterdir()
    return package


@pytest.fixture
def folders(package, monkeypatch):
    """The copied module of folders in this process, with the user's cache in the package's cache folder."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(package.cache))
    monkeypatch.syspath_prepend(str(package.folder.parent))
    monkeypatch.setattr(tempfile, "tempdir", str(package.folder.parent.parent / "temporary"))
    Path(tempfile.gettempdir()).mkdir()
    yield importlib.import_module("small._kernel.folders")
    for name in [name for name in sys.modules if name.partition(".")[0] == "small"]:
        del sys.modules[name]


def test_second_process_loads_what_the_first_compiled(package):
    answer, hits, misses, folder = package.call()
    assert (answer, hits, misses) == (8.0, 0, 1)
    assert folder.parent == package.cache / "assembly"
    # Two kernels, one signature each: the inlined helper has no entry of its own.
    assert [p.name.split("-")[0] for p in package.entries(folder)] == ["small.callee.inner", "small.caller.outer"]
    before = [p.stat().st_ino for p in package.entries(folder)]
    assert package.call() == (8.0, 1, 0, folder)
    assert [p.stat().st_ino for p in package.entries(folder)] == before


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


def test_an_index_is_taken_as_it_stands_in_the_package_alone(package):
    package.edit("callee.py", "from small._kernel import kernel", "from small._kernel import kernel\n" + AT)
    code = """
import numpy as np
from numba import njit
from small.callee import at
@njit
def elsewhere(values, index):
    return values[index]
values = np.array([1.0, 2.0, 3.0])
print(at(values, 2), elsewhere(values, -1), sep="|", end="|")
try:
    at(values, -1)
except IndexError:
    print("IndexError")
"""
    # Without the check, what an index of -1 reads is not defined.
    assert package.run(code, NUMBA_BOUNDSCHECK="1").startswith("3.0|3.0|IndexError\n")


def flip_a_bit(entry: bytes) -> bytes:
    middle = len(entry) // 2
    return entry[:middle] + bytes([entry[middle] ^ 1]) + entry[middle + 1 :]


@pytest.mark.parametrize(
    "damages",
    [(flip_a_bit, lambda entry: entry[: len(entry) // 2]), (lambda entry: b"", lambda entry: b"not a pickle" * 9)],
    ids=["flipped bit, half of it", "empty, something else"],
)
def test_a_damaged_entry_is_compiled_again(compiled, damages):
    for damage, entry in zip(damages, compiled.entries(compiled.found), strict=True):
        entry.write_bytes(damage(entry.read_bytes()))
    output = compiled.run()
    assert output.startswith("8.0|0|1|")
    assert output.count("is damaged: ") == output.count("(the checksum does not fit)") == 2
    assert compiled.call()[:3] == (8.0, 1, 0)  # and mended


def test_where_one_entry_is_damaged_another_one_is_taken(package):
    from assembly._kernel.targets import PORTABLE_VARIABLES

    assert package.call(**PORTABLE_VARIABLES)[:3] == (8.0, 0, 1)
    code = """
from numba import float64
from small._kernel.targets import own_target, portable_target
from small.caller import outer
(path,) = outer._cache.paths((float64,), own_target())
(portable,) = outer._cache.paths((float64,), portable_target())
path.write_bytes(b"damaged" * 9)
print(portable.exists(), oct(portable.stat().st_mode & 0o777))
"""
    assert package.run(code).split() == ["True", "0o644"]
    output = package.run()
    assert output.startswith("8.0|1|0|") and "is damaged" in output


def test_an_entry_that_numba_cannot_load_is_compiled_again(compiled):
    # A sound checksum around something that Numba does not expect.
    for entry in compiled.entries(compiled.found):
        payload = pickle.dumps((1, 2, 3))
        entry.write_bytes(hashlib.sha256(payload).digest() + payload)
    assert compiled.run().startswith("8.0|0|1|")
    assert compiled.call()[:3] == (8.0, 1, 0)


def test_unwritable_cache_falls_back_to_a_private_temporary_folder(package, tmp_path):
    # Below a regular file no folder can be made, not even by root.
    (tmp_path / "file").write_text("")
    (tmp_path / "temporary").mkdir()
    blocked = {"NUMBA_CACHE_DIR": str(tmp_path / "file" / "cache"), "TMPDIR": str(tmp_path / "temporary")}
    answer, hits, misses, folder = package.call(**blocked)
    assert (answer, hits, misses) == (8.0, 0, 1)
    assert folder.parent.parent == tmp_path / "temporary"
    assert folder.parent.stat().st_mode & 0o077 == 0
    assert package.call(**blocked) == (8.0, 1, 0, folder)
    folder.parent.chmod(0o777)  # others could put code there that we would run: not ours any more
    assert package.call(**blocked) == (8.0, 0, 1, None)


def test_no_writable_place_at_all(package, folders, monkeypatch):
    (package.cache.parent / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(package.cache.parent / "file" / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(package.cache.parent / "file"))
    assert folders._writable_folder("0" * 24) is None


def test_a_package_without_sources_is_not_cached(package):
    subprocess.run([sys.executable, "-m", "compileall", "-q", "-b", str(package.folder)], check=True)
    for source in package.folder.rglob("*.py"):
        source.unlink()
    answer, hits, misses, folder = package.call()
    assert (answer, hits, misses) == (8.0, 0, 1)
    assert package.entries(folder) == []


def test_cache_that_vanishes_or_fills_up_while_in_use(package):
    code = """
import shutil
from small._kernel.folders import entry_folder
from small.caller import outer
folder = entry_folder()
shutil.rmtree(folder)
folder.write_text("")
print(outer(3.0), outer.stats.cache_misses.total(), flush=True)
folder.unlink()
print(outer(3), outer.stats.cache_misses.total(), len(list(folder.iterdir())))
"""
    lines = [line for line in package.run(code).splitlines() if line[0].isdigit()]
    # Integer argument: another signature of both kernels, saved into a folder that is made again.
    assert lines == ["8.0 1", "8.0 2 2"]


def test_an_entry_that_cannot_be_replaced(compiled):
    for entry in compiled.entries(compiled.found):
        entry.unlink()
        entry.mkdir()  # neither readable as a file nor replaced by one
    assert compiled.call()[:3] == (8.0, 0, 1)
    assert len(compiled.entries(compiled.found)) == 2  # nothing unfinished beside them


def test_what_is_found_on_disk_needs_no_word_to_numba(compiled):
    code = (
        CALL + "from small._kernel.overloads import _WAITING\nprint([function.__name__ for function, _ in _WAITING])\n"
    )
    assert compiled.run(code).splitlines()[-1] == "['helper']"


def test_a_kernel_links_to_one_that_was_found_on_disk(compiled):
    code = """
from small._kernel import kernel
from small.callee import helper, inner
assert inner(1.0) == 2.0 and inner.stats.cache_hits.total() == 1
@kernel
def mine(x):
    return helper(inner(x)) + 1.0
print(mine(1.0), inner.stats.cache_misses.total())
"""
    assert compiled.run(code).splitlines()[-1] == "3.0 0"


def test_a_kernel_tied_to_this_process_is_not_cached(package):
    # Numba passes an array of more than a megabyte by its address.
    package.edit("caller.py", "@kernel\ndef outer", "import numpy as np\nTABLE = np.ones(200_000)\n@kernel\ndef outer")
    package.edit("caller.py", "FACTOR *", "FACTOR * TABLE[int(x)] *")
    for _ in range(2):
        output = package.run()
        assert output.startswith("8.0|0|1|")
        assert "outer uses an address or a large global array and is not cached" in output


# Whatever calls an inner kernel: a user's function, one of those that an entry calls, a function of Numba's.
AROUND = """
from numba import njit
from small._kernel import kernel
from small._kernel.overloads import make_callable
from small.nested import inside, outside
make_callable()
@njit
def mine(x):
    return outside(x) + 1.0
@kernel
def through_mine(x):
    return -mine(x)
@kernel
def mapped(n):
    total = 0.0
    for y in map(outside, range(n)):
        total += y
    return total
print(through_mine(3.0), mapped(3), mine(3.0))
"""


def test_an_inner_kernel_can_be_called_by_others_than_entries(package):
    (package.folder / "nested.py").write_text("""
from small._kernel import kernel
@kernel(inner=True)
def inside(x):
    return x + 1.0
@kernel(inner=True)
def outside(x):
    return inside(x) * 2.0
""")
    assert package.run(AROUND).splitlines()[0] == "-9.0 12.0 9.0"


def test_what_is_changed_to_compile_is_changed_back(package):
    code = """
import gc
from numba.core import event
from small._kernel import kernel
from small.caller import outer
@kernel
def broken(x):
    return x.nothing
timer = event.install_timer
outer(1.0)
print(gc.isenabled(), event.install_timer is timer)
try:
    broken(1.0)
except Exception:
    print(gc.isenabled(), event.install_timer is timer)
gc.disable()
outer(1)
print(gc.isenabled())
"""
    assert package.run(code).split()[:5] == ["True", "True", "True", "True", "False"]


def test_what_an_entry_calls_is_linked_as_its_own(package):
    code = """
from small.caller import outer
outer(3.0)
(compiled,) = outer.overloads.values()
functions = {f.name: f.linkage.name for f in compiled.library.get_defined_functions()}
names = compiled.fndesc
own = {names.llvm_func_name, names.llvm_cpython_wrapper_name, names.llvm_cfunc_wrapper_name}
print({linkage for name, linkage in functions.items() if name not in own} <= {"internal"}, own <= {*functions})
"""
    assert package.run(code).splitlines()[0] == "True True"


def test_what_cannot_be_dropped_stops_nothing(compiled):
    (first,) = [p for p in compiled.entries(compiled.found) if "outer" in p.name]
    for k in range(5):
        first.with_name(first.name[:-16] + f"{k:016d}").mkdir()
    compiled.edit("caller.py", "from small._kernel", "\nfrom small._kernel")
    assert compiled.call()[:3] == (8.0, 0, 1)


def test_what_a_process_that_ended_left_is_dropped(compiled):
    left, young = compiled.found / "unfinished-old", compiled.found / "unfinished-young"
    for path in (left, young):
        path.write_bytes(b"")
    os.utime(left, (1000.0, 1000.0))
    compiled.edit("caller.py", "from small._kernel", "\nfrom small._kernel")
    compiled.call()
    assert (left.exists(), young.exists()) == (False, True)


def test_a_folder_that_cannot_be_written_to_is_read(folders, monkeypatch):
    users = folders._user_folder() / folders._toolchain()
    users.mkdir(parents=True)
    monkeypatch.setattr(folders, "_writable_folder", lambda _: None)
    assert folders.folders_to_read.__wrapped__() == (users,)


def test_folders_do_not_depend_on_where_a_process_stands(folders, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "some/where")
    assert folders._user_folder() == Path.cwd() / "some" / "where" / "assembly"
    monkeypatch.setenv("NUMBA_CACHE_DIR", "~/kept")
    assert folders._user_folder() == Path.home() / "kept" / "assembly"


def test_compiling_is_logged_once_and_loading_is_not(package):
    line = "compiling kernels"
    code = CALL + "outer(3)\n"
    assert package.run(code).count(line) == 1
    assert package.run(code).count(line) == 0


def test_kernels_of_a_factory_do_not_share_an_entry(package):
    code = "from small.caller import power\nprint(power(2)(3.0), power(3)(3.0))"
    for _ in range(2):
        assert package.run(code).splitlines()[0] == "9.0 27.0"


def test_recompile_replaces_the_entry(compiled):
    code = CALL + "outer.recompile()\nprint(outer(3.0), outer.stats.cache_misses.total())"
    assert compiled.run(code).splitlines()[1] == "8.0 1"
    assert compiled.call()[:3] == (8.0, 1, 0)


def test_concurrent_processes(package):
    environment = {**os.environ, "PYTHONPATH": str(package.folder.parent), "NUMBA_CACHE_DIR": str(package.cache)}
    code = CALL.replace("answer = outer(3.0)", "outer(3)\nanswer = outer(3.0)")
    processes = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    answers = [process.communicate()[0].strip().split("|") for process in processes]
    assert [answer[0] for answer in answers] == ["8.0"] * 3
    folder = Path(answers[0][3])
    # Two kernels with two signatures each, and nothing unfinished left behind.
    assert len(package.entries(folder)) == 4
    assert package.call()[:3] == (8.0, 1, 0)


def test_only_the_folders_used_last_are_kept(folders, package):
    root = package.cache / "assembly"
    stamps = [f"{k:024d}" for k in range(7)]
    for age, stamp in enumerate(stamps[:6]):
        folders._writable_folder(stamp)
        os.utime(root / stamp, (1000.0 + age, 1000.0 + age))
    (root / "notes").mkdir()  # somebody else's
    folders._writable_folder(stamps[2])  # in use again, so the youngest
    folders._writable_folder(stamps[6])
    assert sorted(p.name for p in root.iterdir()) == [stamps[2], stamps[4], stamps[5], stamps[6], "notes"]


def test_dropping_folders_survives_another_process_doing_the_same(folders, package, monkeypatch):
    root = package.cache / "assembly"
    for k in range(8):
        (root / f"{k:024d}").mkdir(parents=True)
    sound = Path.iterdir

    def iterdir(folder):
        for found in list(sound(folder)):
            shutil.rmtree(found)  # dropped between being listed and being looked at
            yield found

    monkeypatch.setattr(Path, "iterdir", iterdir)
    folders._drop_old_folders(root)
    monkeypatch.undo()
    assert list(root.iterdir()) == []


def test_a_kernel_outside_the_package_is_not_cached():
    @kernel
    def doubled(x):
        return 2.0 * x

    assert doubled(2.0) == 4.0
    assert doubled.stats.cache_path is None
