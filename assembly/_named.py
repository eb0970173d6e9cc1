"""Results by name: a dictionary that lists its names where an unknown one is asked for."""

from __future__ import annotations

from difflib import get_close_matches
from typing import NoReturn, TypeVar

from assembly.errors import UnknownNameError

__all__ = ["Named"]

Value = TypeVar("Value")
# A message lists no more names than can be read.
LISTED = 20


class Named(dict[str, Value]):
    """What a result has, by name. An unknown name raises and lists the known ones."""

    def __missing__(self, name: object) -> NoReturn:
        near = get_close_matches(name, self, n=3) if isinstance(name, str) else []
        known = ", ".join(map(repr, near or list(self)[:LISTED]))
        more = len(self) - LISTED
        rest = f" and {more} more" if not near and more > 0 else ""
        expected = f"{'perhaps' if near else 'one of'} {known}{rest}" if self else "a name, but there is none"
        raise UnknownNameError(f"name is {name!r}; expected {expected}")
