"""Fields of records as plain arrays, for what Python reads often."""

from __future__ import annotations

from typing import Any

import numpy as np

from assembly._record import rows_of

__all__ = ["Columns"]


class Columns:
    """The records that begin in the rows of an array: a plain array a field, read and written as an attribute.

    A column of `rows_of` takes a microsecond to read, because NumPy makes a record array of it first; here it is made
    once. The rows have to outlive it.

    Parameters
    ----------
    dtype : dtype
        Of the records.
    rows : (n, size) array
    """

    def __init__(self, dtype: np.dtype[Any], rows: Any) -> None:
        records = rows_of(dtype, rows).view(np.ndarray)
        assert dtype.names is not None
        self.__dict__.update({name: records[name] for name in dtype.names})

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the records have no field {name!r}")

    def __setattr__(self, name: str, value: Any) -> None:
        getattr(self, name)[...] = value
