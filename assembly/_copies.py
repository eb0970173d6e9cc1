"""Independent copies: what changes in one of two objects does not change in the other."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from functools import cache, cached_property
from typing import Any, NoReturn, Self

__all__ = ["FoundAgain", "InOneProcess", "OwnState"]


@cache
def _found(kind: type) -> frozenset[str]:
    """Names of what objects of a class find when it is first asked for."""
    return frozenset(
        name for each in kind.__mro__ for name, value in vars(each).items() if type(value) is cached_property
    )


class FoundAgain:
    """Pickles and copies have what the object was made of; what was found from it since is found again there.

    Packed tables of a surface are thirty times as large as its net.
    """

    def __getstate__(self) -> dict[str, Any]:
        kind: type = type(self)
        found = _found(kind)
        return {name: value for name, value in self.__dict__.items() if name not in found}


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
