"""The numbers that tune the loop and the contact manager are documented where they stand."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest

from assembly.proximity.manager import parameters as of_manager
from assembly.solve.loop import parameters as of_loop

MODULES = (of_loop, of_manager)


def _blocks(module: ModuleType) -> list[tuple[str, str]]:
    """Every comment with the names that stand below it."""
    text = Path(str(module.__file__)).read_text(encoding="utf-8")
    return re.findall(r"((?:^#.*\n)+)^([A-Z_, ]+) = ", text, re.MULTILINE)


BLOCKS = [block for module in MODULES for block in _blocks(module)]


@pytest.mark.parametrize(("comment", "names"), BLOCKS, ids=[names for _, names in BLOCKS])
def test_it_says_what_doubling_does_and_where_the_value_is_from(comment, names):
    assert re.search("[Dd]oubled|Larger", comment)
    assert "From:" in comment or "Chosen" in comment


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_all_of_them_are_looked_at(module):
    # Each once: a name that stands there twice would have the second value for both.
    listed = [name for _, names in _blocks(module) for name in names.split(", ")]
    assert sorted(listed) == sorted(name for name in vars(module) if name.isupper())
