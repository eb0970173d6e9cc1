"""Public names that are imported when they are first asked for (PEP 562)."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from importlib import import_module

# When the library was imported first, in seconds since the epoch: `assembly/__init__.py` imports this file.
IMPORTED_AT = time.time()


def lazy_names(
    package: str, modules: Mapping[str, str]
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """The `__getattr__`, `__dir__` and `__all__` of a package.

    Parameters
    ----------
    package
        Name of the package.
    modules
        Public name to the module that defines it. A name that is the last part of its module's
        name stands for the module itself.
    """

    def __getattr__(name: str) -> object:
        if name not in modules:
            message = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(message, name=name, obj=sys.modules[package])
        module = import_module(modules[name])
        value = module if module.__name__.endswith(f".{name}") else getattr(module, name)
        setattr(sys.modules[package], name, value)  # found without this function from now on
        return value

    def __dir__() -> list[str]:
        return sorted(modules)

    return __getattr__, __dir__, sorted(modules)
