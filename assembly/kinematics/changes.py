"""Counts of what was set anew since the program began: what packed scenes are compared with.

A scene packed at another count looks whether the change is one of its own; where the counts are the same it need not.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["count_edit", "count_number", "edits", "numbers_set", "tried_numbers"]

_counts = {"numbers": 0, "edits": 0}


def numbers_set() -> int:
    """How often a number was set that scenes are packed with: a place of a frame, a face, a least gap, a parameter."""
    return _counts["numbers"]


def count_number() -> None:
    """Say that such a number is another one now."""
    _counts["numbers"] += 1


@contextmanager
def tried_numbers() -> Iterator[None]:
    """What is set within is set back by its end: the count is as before, and scenes stay packed."""
    before = _counts["numbers"]
    try:
        yield
    finally:
        _counts["numbers"] = before


def edits() -> int:
    """How often a body became fixed or free, or a constraint enabled or disabled."""
    return _counts["edits"]


def count_edit() -> None:
    """Say that a body or a constraint is another one now."""
    _counts["edits"] += 1
