"""``python -m assembly.kernels``: what is listed, what is compiled ahead, and that all of it can be loaded."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import llvmlite.binding as llvm
import pytest

from assembly._kernel import targets
from assembly._kernel.cache import EntryCache
from assembly._kernel.targets import own_target, portable_target, targets_that_run
from assembly.kernels import __main__ as commands
from assembly.kernels.ahead import shares
from assembly.kernels.listing import Item, all_items

ROOT = Path(__file__).resolve().parent.parent.parent
# Seconds that a process may take to begin or to end: where the machine is busy, many.
PATIENCE = 120.0
# Two kernels that take a second.
SMALL = ("assembly.geometry.splines.evaluate.curve_point", "assembly.geometry.splines.curve_tables.swept_area")
# The command, for these alone.
COMMAND = f"""
import sys
from assembly._kernel import folders
from assembly.kernels import __main__ as commands
from assembly.kernels.listing import all_items
folders._installed = lambda: []  # nothing that a build or an installation brought
commands.all_items = lambda: [item for item in all_items() if item.name in {SMALL}]
if __name__ == "__main__":
    sys.exit(commands.main(sys.argv[1:]))
"""
# What a new process makes of them: whether they are for its own processor, whether one of them was compiled or found.
USE = f"""
import numpy as np
from assembly._kernel import folders
from assembly._kernel.targets import own_target
from assembly.kernels.listing import all_items
folders._installed = lambda: []
print(*(item.found().target == own_target() for item in all_items() if item.name in {SMALL}))
from assembly.geometry.splines.curve_tables import swept_area
swept_area(np.zeros(1), np.zeros((0, 2), np.int64), 0.0, 0.0, np.zeros(1), np.zeros(1))
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
    assert capsys.readouterr().out.startswith(f"0 kernels compiled, {len(all_items())} were there, in ")


@pytest.fixture
def command(tmp_path):
    """Run the command for a few kernels with a cache of its own: exit code, output, errors."""
    script = tmp_path / "script.py"
    script.write_text(COMMAND)

    def run(*arguments: str, kind: str = "native") -> tuple[int, str, str]:
        variables = {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT), "ASSEMBLY_KERNELS": kind}
        line = [sys.executable, str(script), *arguments]
        done = subprocess.run(line, env={**os.environ, **variables}, capture_output=True, text=True)
        return done.returncode, done.stdout, done.stderr

    return run


def test_kernels_are_made_ahead_portable_and_native(command, run_python, tmp_path):
    code, said, progress = command("--compile", "--workers", "2", kind="portable")
    assert (code, said[:30]) == (0, "2 kernels compiled, 0 were the")
    assert "compiling kernels: 100%" in progress
    # A process that has none of its own takes them, and so nothing is missing.
    assert run_python(USE, NUMBA_CACHE_DIR=str(tmp_path)).split() == ["False"] * 2 + ["0", "1"]
    assert command("--compile")[1].startswith("0 kernels compiled, 2 were there")
    code, said, _ = command("--compile", "--native", kind="portable")
    assert (code, said[:30]) == (0, "2 kernels compiled, 0 were the")
    assert run_python(USE, NUMBA_CACHE_DIR=str(tmp_path)).split() == ["True"] * 2 + ["0", "1"]


def test_an_old_processor_takes_no_portable_kernels(monkeypatch):
    assert portable_target() in targets_that_run()
    features = llvm.get_host_cpu_features()
    for missing in ("fma", "avx2", "popcnt"):
        monkeypatch.setattr(llvm, "get_host_cpu_features", lambda missing=missing: {**features, missing: False})
        assert targets.why_portable_code_does_not_run.__wrapped__() == f"this processor is without {missing}"


def test_a_damaged_entry_counts_as_missing(tmp_path, monkeypatch):
    item, path = all_items()[0], tmp_path / "entry"
    monkeypatch.setattr(EntryCache, "paths", lambda *_: [path])
    path.write_bytes(b"no checksum" * 9)
    assert item.found() is None
    path.write_bytes(hashlib.sha256(b"sound").digest() + b"sound")
    found = item.found()
    assert (found.path, found.size, found.target) == (path, 5, own_target())


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="processes cannot be looked at here")
def test_workers_end_with_the_command(tmp_path):
    # Each compiles something for ever: those of a command that is killed, and those of one that is interrupted.
    script = tmp_path / "script.py"
    script.write_text("""
import os, sys, time
from assembly.kernels import ahead
from assembly.kernels.listing import Item
class Slow(Item):
    sources, name = frozenset(), "slow"
    @property
    def entry(self):
        open(os.path.join(sys.argv[1], str(os.getpid())), "w").close()
        time.sleep(1e3)
if __name__ == "__main__":
    ahead.compile_all([Slow("slow", k, 0) for k in range(2)], 2, {})
""")
    for number in (signal.SIGKILL, signal.SIGINT):
        folder = tmp_path / str(int(number))
        folder.mkdir()
        variables = {**os.environ, "PYTHONPATH": str(ROOT)}
        # A process begun in the background ignores Ctrl-C, and so do those that it begins.
        wakes = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
        line = [sys.executable, str(script), str(folder)]
        command = subprocess.Popen(line, env=variables, stderr=subprocess.DEVNULL, preexec_fn=wakes)
        wait_for(lambda folder=folder: len(list(folder.iterdir())) == 2)
        workers = [int(path.name) for path in folder.iterdir()]
        command.send_signal(number)
        assert command.wait(PATIENCE) != 0
        wait_for(lambda workers=workers: not any(map(runs, workers)))


def wait_for(condition) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def runs(process: int) -> bool:
    """Whether a process is there, and no zombie."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        (["--compile", "--workers", "0"], "native", "--workers is 0; expected at least 1"),
        (["--native"], "native", "--native and --workers say how to compile; expected --compile with them"),
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
    monkeypatch.setattr(Item, "compiled_for", lambda *_: None)
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
    assert "nothing is compiled: NUMBA_DISABLE_JIT is set" in said


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
    compile_all([Broken("assembly.geometry.splines.curve_tables", 0, 0)], 1, {})
""")
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, str(script)], env=variables, capture_output=True, text=True)
    assert "RuntimeError: assembly.geometry.splines.curve_tables.bezier_tables cannot be compiled" in done.stderr


@pytest.mark.parametrize("workers", [1, 2, 3, 100])
def test_every_kernel_is_in_one_share(workers):
    items = all_items()
    parts = shares(items, workers)
    assert len(parts) == min(workers, len(items))
    assert sorted((item for part in parts for item in part), key=items.index) == items


def test_kernels_of_the_same_sources_are_in_the_same_share():
    # The loop has two signatures; what they share is most of what there is to compile.
    parts = shares(all_items(), 2)
    loops = [
        k for k, part in enumerate(parts) for item in part if item.module == "assembly.solve.loop.augmented_lagrangian"
    ]
    assert len(loops) == 2 and len(set(loops)) == 1
