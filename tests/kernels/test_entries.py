"""Entries on disk: damaged ones, folders that cannot be used, several processes at a time."""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from assembly._kernel import kernel
from tests.kernels.small_package import CALL

# The folder of a toolchain.
TOOLCHAIN = "cpython-399-numba0.1-llvmlite0.1-00000000"


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
    assert folders._writable_folder(TOOLCHAIN) is None


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
    users = folders._user_folder() / folders.toolchain()
    users.mkdir(parents=True)
    monkeypatch.setattr(folders, "_writable_folder", lambda _: None)
    assert folders.folders_to_read.__wrapped__() == (folders.Folder(users, "user's cache"),)


def test_folders_do_not_depend_on_where_a_process_stands(folders, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "some/where")
    assert folders._user_folder() == Path.cwd() / "some" / "where" / "assembly"
    monkeypatch.setenv("NUMBA_CACHE_DIR", "~/kept")
    assert folders._user_folder() == Path.home() / "kept" / "assembly"


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
    stamps = [f"{TOOLCHAIN[:-1]}{k}" for k in range(7)]
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
        (root / f"{TOOLCHAIN[:-1]}{k}").mkdir(parents=True)
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
