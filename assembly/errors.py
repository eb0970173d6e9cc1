"""Errors that this package raises on purpose, and the checks of arguments that raise them.

Bad input raises `InputError` at once. Its text names the argument, what came and what was expected.
"""

from __future__ import annotations

import math
import operator
import warnings
from collections.abc import Iterable, Sequence
from functools import lru_cache
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "FARTHEST",
    "AssemblyError",
    "InputError",
    "KnownSettings",
    "UnknownNameError",
    "bounded",
    "check_coordinates",
    "check_encodable",
    "check_options",
    "checked_color",
    "extent",
    "file_path",
    "integer",
    "is_masked",
    "items",
    "number",
    "positive",
    "real_array",
    "renamed",
    "text",
    "vector",
]


Value = TypeVar("Value")
# Coordinates and lengths are no larger: squares of those that come out of them must not overflow.
FARTHEST = 1e150


class AssemblyError(Exception):
    """Base of everything this library raises on purpose."""


class InputError(AssemblyError, ValueError):
    """An argument that cannot be used; the message says which, its value and what was expected."""


class UnknownNameError(InputError, KeyError):
    """A name that is none of those of a result; a `KeyError`, too."""

    # That of `KeyError` puts quotes around the sentence.
    __str__ = Exception.__str__


@lru_cache(1024)
def _has_attribute(kind: Any, name: str) -> bool:
    """Whether a class, or one that it is made of, says that its objects have an attribute."""
    return any(name in one.__dict__ or name in one.__annotations__ for one in kind.__mro__[:-1])


class KnownSettings:
    """Has no attributes but those its classes say: one that is misspelled, or another class's, is no setting."""

    def __setattr__(self, name: str, value: Any) -> None:
        kind: Any = type(self)
        if name[0] != "_" and not _has_attribute(kind, name):
            classes = type(self).__mro__
            said = {key: what for one in classes[-2::-1] for key, what in one.__dict__.items()}
            # A property that only reads has no setter.
            known = sorted(k for k, p in said.items() if hasattr(p, "__set__") and getattr(p, "fset", p) is not None)
            settable = ", ".join(repr(k) for k in known if k[0] != "_")
            raise AttributeError(f"{type(self).__name__} has no {name!r}; expected {settable or 'no change at all'}")
        super().__setattr__(name, value)


def check_options(options: Iterable[str], known: Iterable[str]) -> None:
    """Raise for a name that no option has, and list those that there are."""
    names = list(known)
    for name in options:
        if name not in names:
            raise InputError(f"option {name!r} is unknown; expected one of {', '.join(names)}")


def _shown(value: Any) -> str:
    """A short form of any value for a message."""
    if isinstance(value, np.ndarray) and value.size > 8:
        return f"an array of shape {value.shape}"
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def is_masked(value: Any) -> bool:
    """Whether an array has masked values: they are no numbers, though what is below the mask may be."""
    return type(value) is not np.ndarray and isinstance(value, np.ndarray) and bool(np.ma.is_masked(value))


def real_array(name: str, value: ArrayLike, shape: Sequence[int | str]) -> NDArray[np.float64]:
    """A new array of finite doubles of the given shape.

    Parameters
    ----------
    name
        The argument's name, for the message.
    value
        What came.
    shape
        The expected shape; a string stands for any extent of at least one.

    Raises
    ------
    InputError
        Not numeric, another shape, or not finite.
    """
    try:
        came = np.asarray(value)
        array = np.array(came, dtype=np.float64, order="C") if came.dtype.kind in "iuf" else None
    except (TypeError, ValueError, OverflowError):
        array = None
    if is_masked(value):
        raise InputError(f"{name} has masked values; expected real numbers")
    # What nearly always comes, without numpy's price for small arrays. A sum may overflow: that is seen below.
    if array is not None and array.ndim == len(shape) and math.isfinite(sum(array.ravel().tolist())):
        pairs = zip(array.shape, shape, strict=True)
        if array.shape == shape or all(has == want or (has >= 1 and isinstance(want, str)) for has, want in pairs):
            return array
    wanted = "(" + ", ".join(str(extent) for extent in shape) + ("," if len(shape) == 1 else "") + ")"
    if array is None:
        raise InputError(f"{name} is {_shown(value)}; expected real numbers of shape {wanted}")
    fits = array.ndim == len(shape) and all(
        (has >= 1 if isinstance(want, str) else has == want) for has, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        raise InputError(f"{name} has shape {array.shape}; expected {wanted}")
    finite = np.isfinite(array)
    if not finite.all():
        where = tuple(int(k) for k in np.argwhere(~finite)[0])
        raise InputError(f"{name}[{', '.join(map(str, where))}] is {array[where]}; expected finite numbers")
    return array


def vector(name: str, value: ArrayLike, length: int = 3) -> NDArray[np.float64]:
    """A finite vector of the given length."""
    return real_array(name, value, (length,))


def renamed(new: str, value: Value, old: str, old_value: Value | None) -> Value:
    """The value of an argument that had another name, under which it still works, with a warning."""
    if old_value is None:
        return value
    warnings.warn(f"{old} is called {new} now", DeprecationWarning, stacklevel=3)
    return old_value


def number(name: str, value: Any) -> float:
    """A finite real number."""
    if type(value) is float and math.isfinite(value):
        return value
    try:
        if isinstance(value, (str, bytes, bool, np.bool_)):
            raise TypeError
        result = float(value)
    except (TypeError, ValueError, OverflowError, RuntimeError):  # the last is CasADi's, of a vector
        raise InputError(f"{name} is {_shown(value)}; expected a finite real number") from None
    if not math.isfinite(result):
        raise InputError(f"{name} is {result}; expected a finite real number")
    return result


def bounded(name: str, value: Any) -> float:
    """A number that may be a length: its square does not overflow."""
    result = number(name, value)
    if not -FARTHEST <= result <= FARTHEST:
        raise InputError(f"{name} is {result:g}; expected a number from {-FARTHEST:g} to {FARTHEST:g}")
    return result


def check_coordinates(name: str, coordinates: Sequence[float], row: str = "") -> None:
    """Raise where coordinates, finite ones, are so large that their squares overflow; `row` is "2, " in row 2."""
    for k, x in enumerate(coordinates):
        if not -FARTHEST <= x <= FARTHEST:
            raise InputError(f"{name}[{row}{k}] is {x:g}; expected coordinates from {-FARTHEST:g} to {FARTHEST:g}")


def positive(name: str, value: Any) -> float:
    """A finite number above zero."""
    result = number(name, value)
    if result <= 0.0:
        raise InputError(f"{name} is {result:g}; expected a positive number")
    return result


def extent(name: str, value: Any) -> float:
    """A length whose volumes neither overflow nor vanish."""
    result = positive(name, value)
    if not 1e-100 <= result <= 1e100:
        raise InputError(f"{name} is {result:g}; expected a length from 1e-100 to 1e+100")
    return result


def file_path(name: str, value: str | PathLike[str]) -> Path:
    """The path of a file."""
    try:
        return Path(fspath(value))
    except TypeError:
        raise TypeError(f"{name} is {_shown(value)}; expected the path of a file, a str or a PathLike") from None


def items(name: str, value: Any, expected: str) -> tuple[Any, ...]:
    """The members of what can be gone through, but not the letters of a string."""
    if isinstance(value, (str, bytes)):
        raise TypeError(f"{name} is {_shown(value)}; expected {expected}")
    try:
        return tuple(value)
    except TypeError:
        raise TypeError(f"{name} is {_shown(value)}; expected {expected}") from None


def text(name: str, value: Any) -> str:
    """A nonempty string that files and pages can hold."""
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{name} is {_shown(value)}; expected a nonempty string")
    check_encodable(name, value)
    return value


def check_encodable(name: str, value: str) -> None:
    """Raise where a string has half of a pair of surrogates alone, which is no character."""
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise InputError(
            f"{name} is {_shown(value)} with {value[error.start]!r} at {error.start}; "
            "expected characters that UTF-8 has"
        ) from None


def integer(name: str, value: Any, low: int, high: int) -> int:
    """An integer from low to high, both included."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        result = operator.index(value)
    except TypeError:
        raise InputError(f"{name} is {_shown(value)}; expected an integer from {low} to {high}") from None
    if not low <= result <= high:
        raise InputError(f"{name} is {result}; expected an integer from {low} to {high}")
    return result


def checked_color(value: Any) -> tuple[float, float, float] | None:
    """Red, green and blue from 0 to 1, or None."""
    if value is None:
        return None
    if isinstance(value, str):
        raise InputError(f"color is {value!r}; expected three numbers from 0 to 1, red, green and blue")
    red, green, blue = vector("color", value, 3).tolist()
    if min(red, green, blue) < 0.0 or max(red, green, blue) > 1.0:
        raise InputError(f"color is {value!r}; expected three numbers from 0 to 1, red, green and blue")
    return red, green, blue
