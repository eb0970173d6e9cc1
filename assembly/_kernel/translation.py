"""Parts of Numba's translator that take long for kernels of this package, in less time and with the same result.

A kernel here is made of some 300 small ones, which take named tuples of arrays. Three fifths of its first compilation
are Numba's own Python, from byte code to text for LLVM, and a part of that is spent on:

- names of some 6,000 letters, since Numba writes all types of arguments into the name of a function, down to the fields
  of records. Half of an entry's machine code on disk was such names;
- lists of variables of instructions, found by asking for each value of each instruction what it is, in four ways;
- flags of compilation compared by name, one property of 22 after the other, wherever a kernel is called.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import ir, itanium_mangler
from numba.core.targetconfig import TargetConfig

from assembly._kernel.sources import PACKAGE

__all__ = ["quick_translation", "variables_in"]

_DIGEST_LENGTH = 16
# How a qualified name of this package begins, and that of a place for its environment.
_OURS = (f"{PACKAGE.name}.", f".NumbaEnv.{PACKAGE.name}.")
_mangled: Callable[..., str] = itanium_mangler.mangle


def _short_name(name: str, types: tuple[Any, ...], *, abi_tags: Any = (), uid: int | None = None) -> str:
    """The symbol of a function: of this package with a digest of types and flags in place of these.

    It stays unique by the digest, also among entries that other processes compiled and numbered.
    """
    if uid is None or not name.startswith(_OURS):
        return _mangled(name, types, abi_tags=abi_tags, uid=uid)
    written = repr((itanium_mangler.mangle_args(types), tuple(abi_tags)))
    digest = hashlib.sha256(written.encode()).hexdigest()[:_DIGEST_LENGTH]
    return _mangled(name, (), abi_tags=(digest,), uid=uid)


# What values of a type are for a list of variables: a variable, an instruction, a sequence or mapping of such, or else.
_VARIABLE, _INSTRUCTION, _SEQUENCE, _MAPPING, _ELSE = range(5)
_KINDS: tuple[tuple[Any, int], ...] = (
    (ir.Var, _VARIABLE),
    (ir.Inst, _INSTRUCTION),
    ((list, tuple), _SEQUENCE),
    (dict, _MAPPING),
    (object, _ELSE),
)


class _KindOfType(dict[type, int]):
    """The kind of a type, found once."""

    def __missing__(self, kind_of: type) -> int:
        kind = self[kind_of] = next(kind for parent, kind in _KINDS if issubclass(kind_of, parent))
        return kind


_KIND_OF_TYPE = _KindOfType()


def variables_in(value: Any) -> list[Any]:
    """The variables in a value, in the order in which they stand there."""
    found: list[Any] = []
    _add_variables(value, found)
    return found


def _list_variables(_instruction: Any, value: Any) -> list[Any]:
    return variables_in(value)


def _add_variables(value: Any, found: list[Any]) -> None:
    kind = _KIND_OF_TYPE[type(value)]
    if kind == _ELSE:
        return
    if kind == _VARIABLE:
        found.append(value)
    elif kind == _INSTRUCTION:
        found += value.list_vars()
    else:
        for part in value.values() if kind == _MAPPING else value:
            _add_variables(part, found)


# Of every class of flags what they are where they are not set.
_DEFAULTS: dict[type, dict[str, Any]] = {}


def _values_of_flags(flags: Any) -> dict[str, Any]:
    """All flags by name."""
    defaults = _DEFAULTS.get(type(flags))
    if defaults is None:
        defaults = _DEFAULTS[type(flags)] = {name: option.default for name, option in flags.options.items()}
    return {**defaults, **flags._values}


@contextmanager
def quick_translation() -> Iterator[None]:
    """Have Numba translate so, until the end. Numba compiles under a lock: one thread at a time is here."""
    before = itanium_mangler.mangle, ir.Inst._rec_list_vars, TargetConfig.values
    itanium_mangler.mangle = _short_name
    ir.Inst._rec_list_vars = _list_variables
    TargetConfig.values = _values_of_flags
    try:
        yield
    finally:
        itanium_mangler.mangle, ir.Inst._rec_list_vars, TargetConfig.values = before
