"""A lock of an object that threads use one after another; copies of the object, pickled or not, have their own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

__all__ = ["Turn"]


class Turn:
    """Who holds `lock` has its turn, and may take it again.

    Attributes
    ----------
    lock : RLock
    is_busy : bool
        Whether whoever has the turn is amid something that none of its own callbacks may begin again.
    """

    __slots__ = ("is_busy", "lock")

    def __init__(self) -> None:
        self.lock, self.is_busy = RLock(), False

    def __reduce__(self) -> tuple[type[Turn], tuple[()]]:
        return Turn, ()

    @contextmanager
    def busy(self) -> Iterator[None]:
        """Be amid that; for who holds `lock`."""
        try:
            self.is_busy = True
            yield
        finally:
            self.is_busy = False
