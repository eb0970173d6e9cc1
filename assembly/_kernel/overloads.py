"""Kernels that kernels call: Numba is told of them when it compiles one, and not before."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.typing.templates import infer, infer_global, make_overload_template

from assembly._kernel.linking import InnerCompiler
from assembly._kernel.sources import PACKAGE

__all__ = ["announce", "make_callable"]

# Functions that kernels may call, and how they are compiled, of which Numba has not been told.
_WAITING: list[tuple[Callable[..., Any], dict[str, Any]]] = []


class _OncePerSignature(dict[Any, Any]):
    """Numba keys what it has compiled for kernels by types and by the caller's flags. Ours have flags of their own.

    Without this a kernel is compiled up to three times: for inline callers, for inner ones, for those that make arrays.
    """

    def __getitem__(self, key: Any) -> Any:
        return super().__getitem__(key[:-1])

    def __setitem__(self, key: Any, value: Any) -> None:
        super().__setitem__(key[:-1], value)


@functools.cache
def _trust_indices() -> None:
    """Have kernels of this package take an index into an array as it stands; it is never negative.

    Numba lets one count from the end. To look whether it does takes a fifth of a large factorization, and a tenth of
    what there is to compile. With `NUMBA_BOUNDSCHECK=1` a negative index is an error, as is one past the end.
    """
    from numba.np import arrayobj

    counting = arrayobj.fix_integer_index
    ours = f"_ZN{len(PACKAGE.name)}{PACKAGE.name}"

    def as_it_stands(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
        if builder.function.name.startswith(ours):
            return context.cast(builder, index, kind, types.intp)
        return counting(context, builder, kind, index, size)

    arrayobj.fix_integer_index = as_it_stands


def announce(function: Callable[..., Any], settings: dict[str, Any]) -> None:
    """Remember a function that kernels may call, compiled by these settings; in Python it stays what it is."""
    function.kernel_settings = settings  # type: ignore[attr-defined]  # a part of what an entry is made from
    _WAITING.append((function, settings))


def make_callable() -> None:
    """Tell Numba of all functions that kernels may call."""
    _trust_indices()
    while _WAITING:
        _make_one_callable(*_WAITING[-1])
        del _WAITING[-1]


def _make_one_callable(function: Callable[..., Any], settings: dict[str, Any]) -> None:
    options = {
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "nopython": True,
        "pipeline_class": InnerCompiler,
        **settings,
    }

    def implementation(*_arguments: Any, **_keywords: Any) -> Callable[..., Any]:
        return function

    template = make_overload_template(function, implementation, options, False, "never", False)
    template._impl_cache = _OncePerSignature()
    infer(template)
    infer_global(function, types.Function(template))
