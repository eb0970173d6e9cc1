"""Copies that are their own: what changes in one of two objects does not change in the other."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any, NoReturn, Self

__all__ = ["InOneProcess", "OwnState"]


class OwnState:
    """`copy.copy` copies what the object keeps for itself, and shares what it is about."""

    def _shared(self) -> Iterable[object]:
        """What a copy has in common with the original."""
        raise NotImplementedError  # every class that copies itself so says it

    def __copy__(self) -> Self:
        # What stands in the memo is taken for copied already.
        return copy.deepcopy(self, {id(item): item for item in self._shared()})


class InOneProcess:
    """What holds memory of this process: neither copied nor pickled, and it says what to keep instead."""

    _instead: str

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        kind = type(self).__name__
        raise TypeError(f"a {kind} is of this process alone and cannot be copied or pickled; {self._instead}")
