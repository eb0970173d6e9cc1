"""Entries that came with the package: machine code alone, found after the user's own, and only where all of it fits."""

from __future__ import annotations

import os
import shutil

import pytest

from assembly._kernel import toolchain as toolchains
from tests.kernels.small_package import CALL, Package

# Copies the entries of the user's cache into the package, as a build does.
SHIP = """
from small._kernel.cache import write_machine_code
from small._kernel.folders import SHIPPED, entry_folder
for entry in entry_folder().iterdir():
    write_machine_code(entry, SHIPPED / entry_folder().name / entry.name)
    print(entry.stat().st_size > (SHIPPED / entry_folder().name / entry.name).stat().st_size)
"""
# As if a kernel took a minute, so that what is said of a long compilation is said.
SLOW = "from small._kernel import progress\nprogress._SECONDS_PER_KERNEL = 60.0\n"


@pytest.fixture
def shipped(compiled, tmp_path) -> Package:
    """A package with entries of its own and an empty user's cache; `found` is the folder of the package's entries."""
    assert compiled.run(SHIP).split() == ["True", "True"]
    shutil.rmtree(compiled.cache)
    (compiled.found,) = (compiled.folder / "_entries").iterdir()
    return compiled


def test_nothing_is_compiled_where_the_package_has_it(shipped):
    answer, hits, misses, folder = shipped.call()
    assert (answer, hits, misses) == (8.0, 1, 0)
    assert shipped.entries(folder) == []


def test_what_is_loaded_without_bitcode_can_be_linked_to(shipped):
    code = """
from numba import njit
from small.caller import outer
print(outer(3.0), outer.stats.cache_misses.total())
@njit(cache=False)
def user(x):
    return outer(x) + outer(2.0 * x)
print(user(3.0), outer(3.0))
"""
    assert shipped.run(code).split() == ["8.0", "0", str(8.0 + 14.0), "8.0"]


def test_a_users_cached_function_that_links_to_it_stands_alone(shipped):
    module = shipped.folder.parent / "user.py"
    module.write_text("""
from numba import njit
from small.caller import outer
@njit(cache=True)
def user(x):
    return outer(x) + 1.0
""")
    for misses in ("1", "0"):
        said = shipped.run("from user import user\nprint(user(3.0), user.stats.cache_misses.total())")
        assert said.split() == ["9.0", misses]


def test_a_damaged_one_is_compiled_instead(shipped):
    for entry in shipped.entries(shipped.found):
        entry.write_bytes(entry.read_bytes()[:-1])
    said = shipped.run()
    assert said.startswith("8.0|0|1|") and said.count("(the checksum does not fit)") == 2
    assert shipped.call()[:3] == (8.0, 1, 0)  # from the user's cache


def test_one_for_the_processor_itself_comes_before_a_portable_one_of_the_package(compiled):
    from assembly._kernel.targets import PORTABLE_VARIABLES

    shutil.rmtree(compiled.cache)
    compiled.call(**PORTABLE_VARIABLES)
    compiled.run(SHIP)
    shutil.rmtree(compiled.cache)
    assert compiled.call()[:3] == (8.0, 1, 0)
    # A process that only takes its own compiles, and what it kept is what others take from then on.
    compiled.run("from small._kernel.targets import refuse_portable\nrefuse_portable()\n" + CALL)
    used = "import os\nbefore = os.utime\nos.utime = lambda path, *rest: (print(path), before(path, *rest))\n"
    (line,) = [line for line in compiled.run(used + CALL).splitlines() if "caller.outer-" in line]
    assert line.startswith(str(compiled.cache)) and "-x86-64-v3-" not in line


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("toolchain", "are for cpython-399-numba0.1-llvmlite0.1-00000000, not for "),
        ("processor", "are for processors vax; "),
        ("sources", "were made from other sources)"),
    ],
)
def test_why_they_are_not_taken_is_said_where_kernels_compile(shipped, change, reason):
    if change == "toolchain":
        shipped.found.rename(shipped.found.with_name("cpython-399-numba0.1-llvmlite0.1-00000000"))
    elif change == "sources":
        shipped.edit("caller.py", "FACTOR * ", "FACTOR * 1.0 * ")
    else:
        for entry in shipped.entries(shipped.found):
            title, *_, variant, stamp = entry.name.split("-")
            entry.rename(entry.with_name(f"{title}-vax-{variant[::-1]}-{stamp}"))
    said = shipped.run(SLOW + CALL)
    assert said.startswith("8.0|0|1|")
    assert "compiling 3 kernels for caller (outer), about 180 s, once (those of the package " in said
    assert reason in said
    assert f"kept in {shipped.cache}" in said
    # Nothing is said of what takes a moment, and nothing of what is loaded.
    assert "compiling" not in shipped.run(SLOW + CALL)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such permissions")
@pytest.mark.parametrize("whose", ["writable by all", "of another user", "a link"])
def test_what_the_owner_of_the_package_did_not_write_is_not_read(shipped, whose, tmp_path):
    entry = shipped.entries(shipped.found)[0]
    if whose == "writable by all":
        shipped.found.chmod(0o777)
    elif whose == "of another user":
        if os.getuid() != 0:
            pytest.skip("only the administrator gives files away")
        os.chown(entry, 12345, -1)
    else:
        entry.rename(tmp_path / "entry")
        entry.symlink_to(tmp_path / "entry")
    said = shipped.run()
    assert said.startswith("8.0|0|1|") and "are not used: somebody else can write them" in said


def test_what_a_build_left_in_a_checkout_is_taken_there(compiled):
    build = compiled.folder.parent / "build" / "kernels" / "assembly"
    shutil.copytree(compiled.found, build / compiled.found.name)
    shutil.rmtree(compiled.cache)
    (compiled.folder.parent / "pyproject.toml").write_text("")
    assert compiled.call()[:3] == (8.0, 1, 0)
    (compiled.folder.parent / "pyproject.toml").unlink()  # not a checkout: anybody's folder
    assert compiled.call()[:3] == (8.0, 0, 1)


def test_releases_that_differ_by_a_patch_exchange_entries(monkeypatch):
    name = toolchains.toolchain()
    for module in (toolchains.numba, toolchains.llvmlite):
        major, minor, patch = module.__version__.split(".")
        for version, same in (
            (f"{major}.{minor}.{int(patch) + 1}", True),
            (f"{major}.{int(minor) + 1}.{patch}", False),
        ):
            monkeypatch.setattr(module, "__version__", version)
            assert (toolchains.toolchain.__wrapped__() == name) is same
        monkeypatch.undo()
    assert toolchains.is_toolchain(name) and not toolchains.is_toolchain("notes")
    monkeypatch.setattr(toolchains.config, "OPT", 0)
    assert toolchains.toolchain.__wrapped__() != name


def test_the_count_of_kernels_is_the_count_that_is_compiled(package):
    code = """
from types import SimpleNamespace
from small._kernel import progress
from small.caller import outer, power
from small.parts import walked
counts = [progress._missing(entry.py_func) for entry in (outer, power(2), walked)]
for entry in (outer, power(2), walked):
    before = len(progress._COMPILED)
    entry(3.0)
    counts.append(len(progress._COMPILED) - before)
print(*counts, progress._missing(outer.py_func))
"""
    # `outer` calls an entry and a helper; `walked` is made of a step.
    assert package.run(code).split() == ["3", "1", "2", "3", "1", "2", "0"]


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_bar_is_shown_in_a_terminal_alone(package, is_terminal):
    code = f"import sys\nsys.stderr.isatty = lambda: {is_terminal}\n" + SLOW + CALL
    assert ("compiling:   0%|" in package.run(code)) is is_terminal
    silenced = "import logging\nlogging.getLogger('assembly').setLevel(logging.ERROR)\n" + code + "outer(3)\n"
    assert "compiling" not in package.run(silenced)
