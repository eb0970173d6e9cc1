"""Turns: threads use an object one after another; copies of the object, pickled or not, have turns of their own.

A solve writes where it begins and what it asks for into its packed scene, and what varies numbers of a scene (a study,
say) sets them back only at its end. So each public call that reads or writes these has its scene's turn (`in_turn`),
and so has what is found of a solution when it is first read (`FoundInTurn`).

A callback of the user's may ask for another scene, or for the scene that is being solved. The latter it is given as a
copy. Where threads would wait for each other in a circle nobody waits: whoever comes last to the circle is given a
copy as well.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cached_property, wraps
from threading import Lock, RLock, get_ident
from typing import Any, Self, TypeVar, cast, overload
from weakref import WeakSet

__all__ = ["FoundInTurn", "Turn", "in_child", "in_turn"]

Answer = TypeVar("Answer")
Call = TypeVar("Call", bound=Any)


class Turn:
    """Who holds `lock` has its turn, and may take it again.

    Attributes
    ----------
    lock : RLock
    is_busy : bool
        Set by who has the turn while it is amid something that none of its own callbacks may begin again; also where
        this process was forked while a thread of the other one had the turn.
    holder : int
        The thread that has the turn and may call back the user, who may ask for other turns; else 0.
    """

    __slots__ = ("__weakref__", "holder", "is_busy", "lock")

    def __init__(self) -> None:
        self.lock, self.is_busy, self.holder = RLock(), False, 0
        _all.add(self)

    def __reduce__(self) -> tuple[type[Turn], tuple[()]]:
        return Turn, ()

    def entry(self) -> AbstractContextManager[bool | None]:
        """What a thread enters to have its turn. As its target it gives False where the turn would never come.

        A circle of threads needs `holders`, as all in it are: where there are none, entering `lock` is the same.
        """
        return _Entry(self) if get_ident() in holders else self.lock

    def begin(self) -> tuple[int, bool]:
        """Note that the thread, which has the turn, may call back; what `end` takes.

        A context manager for that would take as long as a fortieth of a small scene's solve.
        """
        me = get_ident()
        before = self.holder, me in holders
        self.holder = me
        holders.add(me)
        return before

    def end(self, before: tuple[int, bool]) -> None:
        """Note that it may not any more, unless it might before."""
        self.holder, was_holder = before
        if not was_holder:
            holders.discard(get_ident())


_all: WeakSet[Turn] = WeakSet()
# Threads that have a turn and may call back.
holders: set[int] = set()
# Of those that wait for a turn, which one.
_waits: dict[int, Turn] = {}
_waits_lock = Lock()


class _Entry:
    """The turn of a thread that has another one, or this one, already."""

    def __init__(self, turn: Turn) -> None:
        self._turn, self._lock = turn, turn.lock
        self._is_mine = False

    def __enter__(self) -> bool:
        if self._lock.acquire(blocking=False):
            self._is_mine = True
            return True
        me = get_ident()
        with _waits_lock:
            if self._closes_circle(me):
                return False
            _waits[me] = self._turn
        try:
            self._is_mine = self._lock.acquire()
        finally:
            _waits.pop(me, None)
        return self._is_mine

    def __exit__(self, *_: object) -> None:
        if self._is_mine:
            self._lock.release()

    def _closes_circle(self, me: int) -> bool:
        """Whether the thread that has the turn waits for one that waits ... for this thread."""
        awaited: Turn | None = self._turn
        while awaited is not None and awaited.holder != me:
            awaited = _waits.get(awaited.holder)
        return awaited is not None and awaited is not self._turn


def in_turn(call: Call, calls_back: bool = True) -> Call:
    """Have a call take the turn of its first argument, a scene; where that is busy the call is of a copy of it.

    What calls back nobody, and asks for no other turn, need not say that it has this one: that takes 0.4 us.
    """
    name = call.__code__.co_varnames[0]

    @wraps(call)
    def taken(*given: Any, **options: Any) -> Any:
        scene = given[0] if given else options.pop(name, None)
        turn: Turn | None = getattr(scene, "_turn", None)
        if turn is None:
            # Something else, as the call will say.
            return call(*given, **options) if given or scene is None else call(scene, **options)
        with turn.entry() as is_mine:
            if not is_mine or turn.is_busy:
                return taken(scene._beside(is_mine), *given[1:], **options)
            if not calls_back:
                return call(scene, *given[1:], **options)
            before = turn.begin()
            try:
                return call(scene, *given[1:], **options)
            finally:
                turn.end(before)

    return cast("Call", taken)


class FoundInTurn(cached_property[Answer]):
    """A property that is found when it is first read, in the turn of its object, and kept.

    Who finds it while the scene is busy, in a callback or where threads would wait in a circle, finds what there is.
    """

    @overload
    def __get__(self, instance: None, owner: type | None = None) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type | None = None) -> Answer: ...
    def __get__(self, instance: Any, owner: type | None = None) -> Self | Answer:
        if instance is None:
            return self
        # A property's own lock, where it has one, is taken after the turn by all threads.
        turn: Turn = instance._turn
        with turn.entry():
            found: Answer = super().__get__(instance, owner)
            return found


def in_child(call: Callable[[], object]) -> None:
    """Have a function called in every process that is forked from this one.

    What other threads of this process hold or are amid then is so for ever there: locks, and what these protect.
    """
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=call)


def _begin_in_child() -> None:
    """Have new locks where other threads of the process that was forked hold the old ones: here they are nowhere."""
    global _waits_lock
    _waits_lock = Lock()
    _waits.clear()
    me = get_ident()
    holders.intersection_update({me})
    for turn in _all:
        if turn.lock.acquire(blocking=False):
            turn.lock.release()
        else:
            # Whatever it was amid is left half done.
            turn.lock, turn.is_busy, turn.holder = RLock(), True, 0


in_child(_begin_in_child)
