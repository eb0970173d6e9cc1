"""The processor that the loop of this process is compiled for: code for another one may round otherwise."""

from __future__ import annotations

import functools

from assembly._kernel.cache import EntryCache
from assembly._kernel.decorator import ENTRIES
from assembly._kernel.targets import own_target, targets_that_run
from assembly.solve.loop.augmented_lagrangian import solve_program

__all__ = ["kernels_of"]


@functools.cache
def kernels_of() -> str:
    """Its name; where the package's portable kernels run, theirs."""
    entry = next((entry for entry in ENTRIES.values() if entry.compiled is solve_program), None)
    cache = entry and entry.compiled._cache
    if entry is None or not isinstance(cache, EntryCache):
        return own_target()[1]
    for target in targets_that_run():
        if any(path.is_file() for types in entry.argument_types() for path in cache.paths(types, target)):
            return target[1]
    return own_target()[1]
