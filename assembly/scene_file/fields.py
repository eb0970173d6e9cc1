"""Parts of a JSON document, read with checks that name a part by its path, such as `bodies[1].shape[0].reversed`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isfinite
from typing import Any

from assembly.errors import InputError

__all__ = [
    "at",
    "bad",
    "each",
    "flag",
    "members",
    "number",
    "or_null",
    "table",
    "text",
    "vector",
    "whole",
    "written",
]

_SHOWN = 60


def bad(path: str, value: Any, expected: str) -> InputError:
    """The error of a value that is not what was expected."""
    if isinstance(value, list):
        shown = f"a list of {len(value)}"
    else:
        shown = "an object" if isinstance(value, dict) else json.dumps(value)
    shown = shown if len(shown) <= _SHOWN else f"{shown[: _SHOWN - 3]}..."
    return InputError(f"{path} is {shown}; expected {expected}")


@contextmanager
def at(path: str, names: Mapping[str, str] | None = None) -> Iterator[None]:
    """Put the path of a part before what a constructor says of its arguments.

    `names` are fields by the arguments that they become: a message that begins with an argument is one of the field.
    """
    try:
        yield
    except InputError as error:
        message = str(error)
        for argument, name in (names or {}).items():
            if message.startswith((f"{argument} ", f"{argument}[")):
                raise InputError(f"{path}.{name}{message[len(argument) :]}") from None
        raise InputError(f"{path}: {message}") from None


def members(path: str, value: Any, names: Sequence[str]) -> list[Any]:
    """Values of an object's fields, which must be these and no others."""
    if not isinstance(value, dict):
        raise bad(path, value, f"an object with the fields {', '.join(names)}")
    for name in names:
        if name not in value:
            raise InputError(f"{path} has no field {name!r}; expected the fields {', '.join(names)}")
    for name in value:
        if name not in names:
            raise InputError(f"{path} has the unknown field {name!r}; expected only {', '.join(names)}")
    return [value[name] for name in names]


def each(path: str, value: Any, read: Callable[[str, Any], Any], count: int | None = None) -> list[Any]:
    """The items of a list, each read with its path."""
    if not isinstance(value, list) or (count is not None and len(value) != count):
        raise bad(path, value, "a list" if count is None else f"a list of {count}")
    return [read(f"{path}[{k}]", item) for k, item in enumerate(value)]


def flag(path: str, value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise bad(path, value, "true or false")
    return value


def text(path: str, value: Any) -> str:
    """A string."""
    if not isinstance(value, str):
        raise bad(path, value, "a string")
    return value


def number(path: str, value: Any) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise bad(path, value, "a finite number")
    return float(value)


def whole(path: str, value: Any) -> int:
    """An integer."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise bad(path, value, "an integer")
    return value


def vector(path: str, value: Any) -> list[float]:
    """Three numbers."""
    return each(path, value, number, 3)


def table(depth: int) -> Callable[[str, Any], list[Any]]:
    """A reader of numbers in lists of the given depth."""
    inner = number if depth == 1 else table(depth - 1)
    return lambda path, value: each(path, value, inner)


def or_null(read: Callable[[str, Any], Any]) -> Callable[[str, Any], Any]:
    """A reader that takes null, too."""
    return lambda path, value: None if value is None else read(path, value)


def written(value: Any, indent: str = "") -> str:
    """JSON with a line for every field and every row of a table."""
    inner = indent + " "
    if isinstance(value, dict):
        lines = [f"{json.dumps(key)}: {written(item, inner)}" for key, item in value.items()]
    elif isinstance(value, list) and any(isinstance(item, (dict, list)) for item in value):
        lines = [written(item, inner) if isinstance(item, dict) else json.dumps(item) for item in value]
    else:
        return json.dumps(value)
    left, right = "{}" if isinstance(value, dict) else "[]"
    return f"{left}\n{inner}" + f",\n{inner}".join(lines) + f"\n{indent}{right}"
