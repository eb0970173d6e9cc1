"""The small package, empty, and as other processes left it."""

from __future__ import annotations

import importlib
import shutil
import sys
import tempfile
from pathlib import Path

import pytest

from tests.kernels.small_package import Package


@pytest.fixture
def package(tmp_path, run_python) -> Package:
    return Package(tmp_path, run_python)


@pytest.fixture(scope="session")
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
