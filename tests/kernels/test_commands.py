"""``python -m assembly.kernels``: what is listed, what is compiled ahead, and that all of it can be loaded."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from assembly.kernels import __main__ as commands
from assembly.kernels.listing import Item, all_items

ROOT = Path(__file__).resolve().parent.parent.parent
# Two kernels that take a second.
SMALL = ("assembly.proximity.spine_curve", "assembly.geometry.curve_tables")
COMPILE = f"""
from assembly.kernels.ahead import compile_all
from assembly.kernels.listing import all_items
from assembly._kernel.targets import PORTABLE_VARIABLES
if __name__ == "__main__":
    compile_all([item for item in all_items() if item.module in {SMALL}], 2, PORTABLE_VARIABLES)
"""
# What a new process has of them, and what one of them says; then whether it was compiled.
USE = f"""
import numpy as np
from assembly._kernel.targets import portable_target
from assembly.kernels.listing import all_items
for item in all_items():
    if item.module in {SMALL}:
        print(item.found()[1] == portable_target())
from assembly.geometry.curve_tables import swept_area
out = swept_area(np.zeros(1), np.zeros((0, 2), np.int64), 0.0, 0.0, np.zeros(1), np.zeros(1))
print(swept_area.stats.cache_misses.total(), swept_area.stats.cache_hits.total())
"""
LOAD = """
import os, sys
from assembly.kernels.listing import all_items
for item in all_items():
    child = os.fork()
    if child == 0:
        kernel = item.entry.compiled
        kernel.compile(item.types)
        # What only a process that compiles needs of Numba was not loaded, so nothing can hide that it was missed.
        os._exit(1 + 2 * ("numba.np.npyimpl" in sys.modules) + 4 * kernel.stats.cache_misses.total())
    print(item.name, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.fixture(scope="module")
def all_compiled() -> None:
    """Nothing is missing, as after `python -m tests` compiled it."""
    subprocess.run([sys.executable, "-m", "assembly.kernels", "--compile"], cwd=ROOT, check=True)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_every_entry_is_loaded_by_a_process_that_compiles_nothing(all_compiled, run_python):
    lines = run_python(LOAD).splitlines()
    assert len(lines) == len(all_items()) > 60
    assert [line for line in lines if not line.endswith(" 1")] == []


def test_the_list_has_every_entry_with_its_size(all_compiled, capsys):
    assert commands.main([]) == 0
    *lines, last = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0].strip() for line in lines] == [item.name for item in all_items()]
    assert all(" kB  for " in line for line in lines)
    assert last.startswith(f"{len(lines)} of {len(lines)} are compiled")


def test_nothing_is_compiled_that_is_there(all_compiled, capsys):
    assert commands.main(["--compile"]) == 0
    assert ", 0 are compiled now" in capsys.readouterr().out


def test_portable_kernels_are_made_ahead_and_found(run_python, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(COMPILE)
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, str(script)], env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "compiling kernels: 100%" in done.stderr
    assert run_python(USE, NUMBA_CACHE_DIR=str(tmp_path)).split() == ["True"] * 5 + ["0", "1"]


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        (["--workers", "0"], "native", "--workers is 0; expected at least 1"),
        (["--workers", "two"], "native", "invalid int value: 'two'"),
        (["--compile"], "fast", "ASSEMBLY_KERNELS is 'fast'; expected native or portable"),
        (["all"], "native", "unrecognized arguments: all"),
    ],
)
def test_what_it_cannot_do_is_said(arguments, kind, message, monkeypatch, capsys):
    monkeypatch.setenv("ASSEMBLY_KERNELS", kind)
    with pytest.raises(SystemExit) as caught:
        commands.main(arguments)
    assert caught.value.code == 2
    assert message in capsys.readouterr().err


def test_kernels_that_cannot_be_kept_are_said(monkeypatch, capsys):
    monkeypatch.setattr(commands, "compile_all", lambda *_: None)  # as on a disk that is full
    monkeypatch.setattr(Item, "path", lambda *_: None)
    assert commands.main(["--compile"]) == 1
    assert f"{len(all_items())} kernels were compiled but could not be kept" in capsys.readouterr().err


def test_without_compilation_there_is_nothing_to_list(run_python):
    code = """
from assembly.kernels.__main__ import main
try:
    main([])
except SystemExit as caught:
    print(caught.code)
"""
    said = run_python(code, NUMBA_DISABLE_JIT="1")
    assert said.startswith("2\n")
    assert "NUMBA_DISABLE_JIT is set, so nothing is compiled" in said


def test_a_cache_that_nobody_can_write_is_said(monkeypatch, capsys):
    monkeypatch.setattr(commands, "entry_folder", lambda: None)
    with pytest.raises(SystemExit):
        commands.main(["--compile"])
    assert "there is no folder to keep kernels in" in capsys.readouterr().err


def test_a_kernel_that_cannot_be_compiled_is_named(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("""
from assembly.kernels.ahead import compile_all
from assembly.kernels.listing import Item
class Broken(Item):
    types = ("no type",)
if __name__ == "__main__":
    compile_all([Broken("assembly.proximity.spine_curve", 0, 0)], 1, {})
""")
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, str(script)], env=variables, capture_output=True, text=True)
    assert "RuntimeError: assembly.proximity.spine_curve.point_of cannot be compiled" in done.stderr
