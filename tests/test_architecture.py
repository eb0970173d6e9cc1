"""The pages that lead through the code name files and functions that exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
STATIONS = re.findall(
    r"^\|[^|]*\| `(assembly/[\w/]+\.py)` \| `(\w+)` \|$", (DOCS / "architecture.md").read_text(), re.MULTILINE
)
NAMED = [
    (page, match[1], re.findall(r"`(\w+)`", match[2]))
    for page in ("papers.md", "architecture.md", "glossary.md")
    for match in re.finditer(r"`(assembly/[\w/]+\.py)` \(((?:`\w+`(?:, )?)+)", (DOCS / page).read_text())
]


def defines(path, name):
    return re.search(rf"^\s*(def|class) {name}\b", (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE) is not None


def test_there_are_stations():
    assert len(STATIONS) > 25 and len(NAMED) > 10


@pytest.mark.parametrize(("path", "name"), STATIONS)
def test_stations_exist(path, name):
    assert defines(path, name)


@pytest.mark.parametrize(("page", "path", "names"), NAMED)
def test_functions_that_pages_name_exist(page, path, names):
    assert [name for name in names if not defines(path, name)] == []


@pytest.mark.parametrize("page", ["papers.md", "architecture.md"])
def test_folders_and_files_exist(page):
    named = set(re.findall(r"`((?:assembly|tests|examples)/[\w/.]+)`", (DOCS / page).read_text()))
    assert sorted(name for name in named if not (ROOT / name).exists()) == []
