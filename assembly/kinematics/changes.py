"""Counts of what was set anew since the program began: what packed scenes are compared with.

A scene packed at another count looks whether the change is one of its own; where the counts are the same it need not.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["changes", "count_edit", "count_number", "numbers_set", "tried_numbers"]

# Of numbers, and of edits. Scenes compare by identity: what another process wrote is never the pair of now.
_counts = [(0, 0)]


def changes() -> tuple[int, int]:
    """Both counts, as a pair that is another object where one of them is another one."""
    return _counts[0]


def numbers_set() -> int:
    """How often a number was set that scenes are packed with: a place of a frame, a face, a least gap, a parameter."""
    return _counts[0][0]


def count_number() -> None:
    """Say that such a number is another one now."""
    numbers, edited = _counts[0]
    _counts[0] = (numbers + 1, edited)


@contextmanager
def tried_numbers() -> Iterator[None]:
    """What is set within is set back by its end: the counts are as before, and scenes stay packed."""
    before = _counts[0]
    try:
        yield
    finally:
        _counts[0] = before


def count_edit() -> None:
    """Say that a body or a constraint is another one now."""
    numbers, edited = _counts[0]
    _counts[0] = (numbers, edited + 1)
