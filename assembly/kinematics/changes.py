"""What was set since the program began, counted and by name: packed scenes are compared with it.

A scene packed at another count looks whether the change is one of its own; where the counts are the same it need not.
The last things whose numbers were set are remembered, so that a scene writes only what depends on them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from weakref import ref

__all__ = ["changes", "count_edit", "count_number", "numbers_set", "set_since", "tried_numbers"]

# How many numbers were set, and a token of the last edit. Scenes compare the pair and the token by identity: what
# another process wrote is never that of now.
_counts: list[tuple[int, object]] = [(0, object())]
# So many things are remembered at least. A scene that has not looked for longer compares all its numbers instead.
REMEMBERED = 256
# What was set last, and the count before the first of these. Dead things are of no scene.
_things: list[ref[object]] = []
_before = [0]


def changes() -> tuple[int, object]:
    """Both, as a pair that is another object where one of them is another one."""
    return _counts[0]


def numbers_set() -> int:
    """How often a number was set that scenes are packed with: a place of a frame, a face, a least gap, a parameter."""
    return _counts[0][0]


def count_number(thing: object) -> None:
    """Say that such a number is another one now, and of what: a frame, a joint, a coordinate, a term, a body."""
    numbers, edited = _counts[0]
    _things.append(ref(thing))
    if len(_things) > 2 * REMEMBERED:
        del _things[:REMEMBERED]
        _before[0] += REMEMBERED
    _counts[0] = (numbers + 1, edited)


def set_since(numbers: int) -> list[object] | None:
    """The things whose numbers were set since a count, without repetition; None where that is too long ago."""
    if not _before[0] <= numbers <= _counts[0][0]:
        return None
    since = _things[numbers - _before[0] :]
    if len(since) == 1:
        only = since[0]()
        return [] if only is None else [only]
    alive = (thing() for thing in since)
    return list({id(thing): thing for thing in alive if thing is not None}.values())


@contextmanager
def tried_numbers() -> Iterator[None]:
    """What is set within is set back by its end: the counts are as before, and scenes stay packed."""
    before = _counts[0]
    try:
        yield
    finally:
        _counts[0] = before
        del _things[max(0, before[0] - _before[0]) :]
        _before[0] = min(_before[0], before[0])


def count_edit() -> None:
    """Say that a body or a constraint is another one now."""
    _counts[0] = (_counts[0][0], object())
