"""Progress of long work: a bar of tqdm, or a function of the user's that is called with numbers done and in all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["Advance", "Progress", "checked_progress", "watched"]

# What the argument `progress` may be: whether a bar is shown, or who is called with what is done and what there is.
Progress = bool | Callable[[int, int], object]
# Says that so many more are done; whether the work is to go on.
Advance = Callable[[int], bool]


def checked_progress(progress: Any) -> Progress:
    """The argument `progress`, checked.

    Raises
    ------
    TypeError
        Neither a truth value nor callable.
    ImportError
        True without tqdm.
    """
    if progress is True:
        _bar_class()
        return True
    if progress is False:
        return False
    if not callable(progress):
        raise TypeError(f"progress is {progress!r}; expected True, False or a function of (done, total)")
    asked: Progress = progress
    return asked


@contextmanager
def watched(progress: Progress, what: str, total: int, unit: str) -> Iterator[Advance]:
    """Show, or tell, how far work of so many units is, from none of it on.

    A bar may have more than its total, where that is not known before; a function that returns True asks to stop.
    """
    done = 0
    if not callable(progress):
        bar = _bar_class()(desc=what, total=total, unit=unit) if progress else None

        def advance(count: int) -> bool:
            if bar is not None:
                bar.update(count)
            return True

        try:
            yield advance
        finally:
            if bar is not None:
                bar.close()
        return

    def tell(count: int) -> bool:
        nonlocal done
        done += count
        return progress(done, max(total, done)) is not True

    yield tell


def _bar_class() -> Any:
    try:
        from tqdm.auto import tqdm
    except ImportError:
        raise ImportError("progress=True needs tqdm, which is not installed; expected it, or a function") from None
    return tqdm
