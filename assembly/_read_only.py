"""Read-only arrays of attributes: writing to them would change nothing, so it raises."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["ReadOnlyArrays", "read_only"]

_Scalar = TypeVar("_Scalar", bound=np.generic)


def read_only(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """A view of an array through which it cannot be written to; the array itself stays as it is."""
    view = array.view()
    view.flags.writeable = False
    return view


def _protected(value: Any) -> Any:
    """The same with read-only views in place of arrays, also in tuples, lists and dictionaries."""
    if isinstance(value, np.ndarray):
        return read_only(value) if value.flags.writeable else value
    if isinstance(value, tuple) and any(isinstance(item, np.ndarray) for item in value):
        parts = map(_protected, value)
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if isinstance(value, dict):
        return type(value)((key, _protected(item)) for key, item in value.items())
    return value


class ReadOnlyArrays:
    """An object whose public attributes have read-only arrays, also after it was copied or pickled.

    NumPy makes arrays of copies and of pickles writable. A dataclass protects its fields when it is made.
    """

    def __post_init__(self) -> None:
        self._protect()

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._protect()

    def _protect(self) -> None:
        """Put read-only views in place of public arrays."""
        for name, value in self.__dict__.items():
            if name[0] != "_":
                # Only values of names that are there change, so that the dictionary can be gone through meanwhile.
                self.__dict__[name] = _protected(value)
