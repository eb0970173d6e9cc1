"""The page about CadQuery and build123d: its code runs, each library's where that is installed."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "cad.md"


def blocks(library):
    """The blocks from the one that imports the library to the next one that imports another."""
    found, current = [], None
    for match in re.finditer(r"^```py\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL):
        named = re.match(r"import (cadquery|build123d)", match[1])
        current = named[1] if named else current
        if current == library:
            found.append(match[1])
    return found


@pytest.mark.parametrize("library", ["cadquery", "build123d"])
def test_code_runs_as_it_stands(library, capsys):
    assert len(blocks(library)) == 2
    if find_spec(library) is None:
        pytest.skip(f"needs {library}, in an environment of its own: packaging/check_cad.py")
    namespace = {"__name__": "__main__"}
    for block in blocks(library):
        exec(compile(block, PAGE, "exec"), namespace)
    assert capsys.readouterr().out
