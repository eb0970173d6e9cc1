"""Examples whose packages are not there say which to install, in one line."""

from __future__ import annotations

import runpy
import sys

import pytest

from tests.examples.running import EXAMPLES


@pytest.mark.parametrize(
    ("name", "package", "said"),
    [
        ("cadquery_bracket", "cadquery", "pip install cadquery"),
        ("cadquery_solver", "cadquery", "pip install cadquery"),
        ("cluster_study", "distributed", "install the extra cluster"),
    ],
)
def test_what_to_install_is_said(name, package, said, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setattr(sys, "path", list(sys.path))
    with pytest.raises(SystemExit, match=f"not installed; .*{said}"):
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
