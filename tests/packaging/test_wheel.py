"""A wheel built from this checkout, installed apart from it: its first solve compiles nothing."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from assembly._kernel.folders import BUILD
from assembly._kernel.targets import own_target, portable_target
from assembly._kernel.toolchain import toolchain
from assembly.kernels.listing import Item, all_items

ROOT = Path(__file__).resolve().parent.parent.parent


def is_built(item: Item, kind: str) -> bool:
    """Whether a build of this checkout left a kernel."""
    target = own_target() if kind == "native" else portable_target()
    paths = item.entry.compiled._cache.paths(item.types, target)
    return any((BUILD / "assembly" / toolchain() / path.name).is_file() for path in paths)


def run(*command: str | Path, folder: Path = ROOT, **variables: str) -> str:
    """What a command printed; its errors where it fails."""
    environment = {**os.environ, **variables}
    for name in ("PYTHONPATH", "NUMBA_CACHE_DIR", "PIP_QUIET"):
        environment.pop(name, None)
    environment.update(variables)
    line = list(map(str, command))
    done = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module", params=["native", "portable"])
def built(request, tmp_path_factory, alone) -> tuple[str, Path, str]:
    """The kind of kernels, the wheel, and what the build said."""
    if not request.config.getoption("--long") and not all(is_built(item, request.param) for item in all_items()):
        pytest.skip(f"compiling all {request.param} kernels takes minutes; --long does, and so does a build before")
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "-v", "--no-deps", "--no-build-isolation", "--wheel-dir", folder]
    # It is built in the checkout.
    with alone():
        said = run(*command, ROOT, ASSEMBLY_KERNELS=request.param)
    (wheel,) = folder.iterdir()
    return request.param, wheel, said


def test_a_build_says_what_it_does_and_reuses_what_is_there(built):
    kind, wheel, said = built
    processor = (own_target() if kind == "native" else portable_target())[1]
    count = len(all_items())
    assert f"{count} kernels for {processor} in the package" in said
    again = run(sys.executable, "-m", "assembly.kernels.ship", wheel.parent / "again", **variables(kind))
    assert f"{count} of {count} kernels for {processor} are there from an earlier build" in again
    assert "compiling" not in again


def variables(kind: str) -> dict[str, str]:
    """The environment in which a build runs what compiles."""
    return {"ASSEMBLY_KERNELS": kind, "NUMBA_CACHE_DIR": str(BUILD), "PYTHONPATH": str(ROOT)}


def test_a_wheel_has_every_kernel_is_for_one_python_and_small(built):
    _, wheel, _ = built
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert re.fullmatch(rf"assembly_solver-[\d.]+-{python}-{python}-\w+\.whl", wheel.name)
    names = zipfile.ZipFile(wheel).namelist()
    assert len([name for name in names if name.startswith("assembly/_entries/")]) == len(all_items())
    assert wheel.stat().st_size < 12e6


def test_the_first_solve_of_an_installed_wheel_compiles_nothing(built, tmp_path):
    _, wheel, _ = built
    run(sys.executable, "-m", "pip", "install", "--no-deps", "--target", tmp_path / "installed", wheel)
    path = {"PYTHONPATH": str(tmp_path / "installed")}
    said = run(sys.executable, ROOT / "packaging" / "check_wheel.py", folder=tmp_path, **path)
    assert said.startswith(f"{tmp_path / 'installed'}") and "SOLVED" in said and "compiled: nothing" in said
    listed = run(sys.executable, "-m", "assembly.kernels", folder=tmp_path, **path, NUMBA_CACHE_DIR=str(tmp_path))
    assert listed.count(", package\n") == len(all_items())


@pytest.mark.parametrize(("kind", "expected"), [("native", True), ("portable", True), ("0", False), ("fast", None)])
def test_what_a_build_needs(kind, expected, monkeypatch):
    pytest.importorskip("hatchling", reason="builds need hatchling")
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setenv("ASSEMBLY_KERNELS", kind)
    if expected is None:
        with pytest.raises(ValueError, match="ASSEMBLY_KERNELS is 'fast'; expected one of native, portable, 0"):
            module.wanted()
        return
    assert module.wanted() == kind
    from hatchling.metadata.core import ProjectMetadata

    hook = module.Kernels(str(ROOT), {}, None, ProjectMetadata(str(ROOT), None), str(ROOT), "wheel")
    names = {re.match(r"[\w-]+", line)[0] for line in hook.dependencies()}
    assert names == (set(module.COMPILING) if expected else set())
    # An editable install has none, and neither has a build that wants none.
    data: dict[str, object] = {}
    if not expected:
        hook.initialize("standard", data)
    hook.initialize("editable", data)
    assert data == {}
