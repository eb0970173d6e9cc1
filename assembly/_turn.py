"""A lock of an object that threads use one after another; copies of the object, pickled or not, have their own."""

from __future__ import annotations

from threading import RLock

__all__ = ["Turn"]


class Turn:
    """Who holds `lock` has its turn, and may take it again.

    Attributes
    ----------
    lock : RLock
    """

    __slots__ = ("lock",)

    def __init__(self) -> None:
        self.lock = RLock()

    def __reduce__(self) -> tuple[type[Turn], tuple[()]]:
        return Turn, ()
