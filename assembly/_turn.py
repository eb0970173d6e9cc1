"""A lock of an object that threads use one after another; copies of the object, pickled or not, have their own."""

from __future__ import annotations

from threading import RLock

__all__ = ["Turn"]


class Turn:
    """Who holds `lock` has its turn, and may take it again.

    Attributes
    ----------
    lock : RLock
    is_busy : bool
        Set by who has the turn while it is amid something that none of its own callbacks may begin again. A context
        manager for that would take as long as a fortieth of a small scene's solve.
    """

    __slots__ = ("is_busy", "lock")

    def __init__(self) -> None:
        self.lock, self.is_busy = RLock(), False

    def __reduce__(self) -> tuple[type[Turn], tuple[()]]:
        return Turn, ()
