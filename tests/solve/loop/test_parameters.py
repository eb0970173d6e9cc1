"""The numbers that tune the loop are documented where they stand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from assembly.solve.loop import parameters

BLOCKS = re.findall(
    r"((?:^#.*\n)+)^([A-Z_, ]+) = ", Path(parameters.__file__).read_text(encoding="utf-8"), re.MULTILINE
)


@pytest.mark.parametrize(("comment", "names"), BLOCKS, ids=[names for _, names in BLOCKS])
def test_it_says_what_doubling_does_and_where_the_value_is_from(comment, names):
    assert "Doubled" in comment
    assert "From:" in comment or "Chosen" in comment


def test_all_of_them_are_looked_at():
    # Each once: a name that stands there twice would have the second value for both.
    listed = [name for _, names in BLOCKS for name in names.split(", ")]
    assert sorted(listed) == sorted(name for name in vars(parameters) if name.isupper())
