"""Objects of libraries that the user has imported; this package does not import them."""

from __future__ import annotations

import sys
from typing import Any

__all__ = ["is_of", "shown"]


def is_of(library: str, kind: str, thing: Any) -> bool:
    """Whether a thing is of a class of a library, "cadquery" say; not where nobody has imported that library."""
    module = sys.modules.get(library)
    cls = getattr(module, kind, None)
    return cls is not None and isinstance(thing, cls)


def shown(thing: Any) -> str:
    """A thing of any kind as messages show it."""
    text = f"{type(thing).__module__}.{type(thing).__qualname__}"
    return f"a {text}" if text.partition(".")[0] in ("cadquery", "build123d", "OCP") else repr(thing)[:80]
