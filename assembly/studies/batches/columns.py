"""The columns of parameters in a batch: checked, and as what rows write into the pool."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Freedom
from assembly.constraints.packing.scene import Packed
from assembly.derivatives.implicit import check_is_of
from assembly.derivatives.numbers import RowNumber
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.pool_writes import check_writes, pool_writes
from assembly.errors import real_array
from assembly.kinematics.changes import count_number, tried_numbers
from assembly.studies.batches.rows import Writes

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["parameter_columns", "set_all", "writes_of"]

Array = NDArray[np.float64]


def parameter_columns(
    scene: Assembly, parameters: Mapping[Parameter, Any] | None
) -> tuple[tuple[Parameter, ...], Array]:
    """The parameters of a batch and their values, (n, p), such as the scene can have; n is 0 without parameters."""
    if parameters is None:
        return (), np.empty((0, 0))
    if not isinstance(parameters, Mapping) or not parameters:
        raise TypeError(f"parameters is {parameters!r}; expected a mapping of Parameter to values (n,)")
    columns: list[Array] = []
    for item, values in parameters.items():
        if not isinstance(item, Parameter):
            raise TypeError(f"parameters has the key {item!r}; expected a Parameter")
        check_is_of("parameters", scene, item)
        columns.append(real_array(f"parameters[{item.name!r}]", values, (len(columns[0]) if columns else "n",)))
    keys, values = tuple(parameters), np.ascontiguousarray(np.array(columns).T)
    _check_values(keys, values)
    return keys, values


def _check_values(parameters: Sequence[Parameter], values: Array) -> None:
    """Raise for values that the scene cannot have: intervals, so the ends of a column tell."""
    before = [item.value for item in parameters]
    by_freedom: dict[int, list[int]] = {}
    with tried_numbers():
        for k, item in enumerate(parameters):
            owner = getattr(item._number, "owner", None)
            if isinstance(owner, Freedom):
                by_freedom.setdefault(id(owner), []).append(k)
            elif item._number.__class__.__name__ != "ShapeNumber":
                try:
                    for value in (values[:, k].min(), values[:, k].max()):
                        item.value = float(value)
                finally:
                    item.value = before[k]
    for places in by_freedom.values():
        _check_freedom([parameters[k]._number for k in places], values[:, places])


def _check_freedom(numbers: Sequence[Any], values: Array) -> None:
    """The same of the value and the limits of one coordinate, which have to go together in every row."""
    owner = numbers[0].owner
    names = [item.attribute for item in numbers]
    ends = (values.min(axis=0), values.max(axis=0))
    for row in ends if len(names) == 1 else values:
        told = {"value": owner.value, "lower": owner.lower, "upper": owner.upper}
        told.update(zip(names, row.tolist(), strict=True))
        owner._checked(told["value"], told["lower"], told["upper"])


def set_all(parameters: Sequence[Parameter], values: Sequence[float]) -> None:
    """Set parameters to values that were checked, those of one coordinate at once."""
    for item, value in zip(parameters, values, strict=True):
        if isinstance(item._number, RowNumber):
            item._number.put(float(value))
            count_number(item._number.owner)
        else:
            item.value = float(value)


def writes_of(packed: Packed, parameters: Sequence[Parameter], values: Array, rows: int) -> Writes | None:
    """What rows write into their pool; None where a parameter takes more than that."""
    places: list[int] = []
    columns: list[Array] = []
    for k, item in enumerate(parameters):
        found = pool_writes(packed, item)
        if found is None:
            return None
        for write in found:
            numbers = write.numbers(values[:, k])
            check_writes(item.name, write, numbers, packed.scale)
            places.append(write.place)
            columns.append(numbers)
    numbers = np.array(columns).T if columns else np.empty((rows, 0))
    turns = np.array(packed.driven_angles, dtype=np.int64).reshape(-1, 2)
    return Writes(np.array(places, dtype=np.int64), turns, np.ascontiguousarray(numbers, dtype=np.float64))
