"""What there is to compile, and what is compiled."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from assembly._kernel.cache import EntryCache, read_entry
from assembly._kernel.decorator import ENTRIES, Entry
from assembly._kernel.folders import folders_to_read
from assembly._kernel.sources import PACKAGE, source_of, sources_of
from assembly._kernel.targets import Target, targets_that_run

__all__ = ["Compiled", "Item", "all_items"]


@dataclass(frozen=True)
class Compiled:
    """A compiled form on disk.

    Attributes
    ----------
    path : Path
        The file.
    size : int
        Without its checksum, in bytes.
    target : tuple of str
        Triple, processor and features that it is for.
    origin : str
        Who keeps it, in words.
    """

    path: Path
    size: int
    target: Target
    origin: str


@dataclass(frozen=True)
class Item:
    """One signature of one entry.

    Attributes
    ----------
    module : str
        Where the entry is made.
    position : int
        Which of this module's entries it is.
    number : int
        Which of the entry's signatures.
    """

    module: str
    position: int
    number: int

    @property
    def entry(self) -> Entry:
        """The entry; its module is imported."""
        import_module(self.module)
        return [entry for entry in ENTRIES.values() if entry.compiled.__module__ == self.module][self.position]

    @property
    def types(self) -> tuple[Any, ...]:
        """Numba's types of the arguments."""
        return self.entry.argument_types()[self.number]

    @property
    def name(self) -> str:
        """Name of the kernel, and of several signatures which."""
        entry = self.entry
        which = f" {self.number + 1}" if len(entry.signatures) > 1 else ""
        return f"{self.module}.{entry.compiled.__qualname__}{which}"

    @property
    def sources(self) -> frozenset[Path]:
        """The files that it is made from."""
        return sources_of(source_of(self.entry.compiled.py_func))

    def compiled_for(self, target: Target) -> Compiled | None:
        """The compiled form for a target, if there is a sound one."""
        cache = self.entry.compiled._cache
        paths = cache.paths(self.types, target) if isinstance(cache, EntryCache) else []
        for path, folder in zip(paths, folders_to_read(), strict=False):
            with suppress(OSError, ValueError):
                return Compiled(path, len(read_entry(path)), target, folder.origin)
        return None

    def found(self) -> Compiled | None:
        """What this machine would run; None if it has to be compiled."""
        forms = (self.compiled_for(target) for target in targets_that_run())
        return next((form for form in forms if form is not None), None)


def _modules() -> Iterator[str]:
    """Names of the modules that make kernels."""
    for path in sorted(PACKAGE.rglob("*.py")):
        if "from assembly._kernel import kernel" in path.read_text(encoding="utf-8"):
            yield ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)


def all_items() -> list[Item]:
    """Every signature of every entry, in the order of modules."""
    items: list[Item] = []
    for module in _modules():
        import_module(module)
        entries = [entry for entry in ENTRIES.values() if entry.compiled.__module__ == module]
        items += [Item(module, i, n) for i, entry in enumerate(entries) for n in range(len(entry.signatures))]
    return items
