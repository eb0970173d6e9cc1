"""Work during which Python does not look for cycles of objects."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["uncollected"]


@contextmanager
def uncollected() -> Iterator[None]:
    """Keep Python from looking for cycles of objects, for work of a bounded time that makes next to none.

    What is released otherwise still is. A look at all objects takes longer than the solve of a hundred joints where CAD
    libraries are loaded; programs like the workers of Dask listen to each look, which took a tenth of their time.
    Where the caller has the collection off, it stays off.
    """
    if not gc.isenabled():
        yield
        return
    try:
        # In here: Ctrl-C may come as soon as it is off.
        gc.disable()
        yield
    finally:
        gc.enable()
