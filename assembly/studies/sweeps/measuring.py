"""What a study measures: named numbers of solutions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, NamedTuple

from assembly.derivatives.measure import Measure
from assembly.errors import InputError, items, text
from assembly.solve.solution import Solution

__all__ = ["Column", "columns_of", "measured"]

Number = Callable[[Solution], float]


class Column(NamedTuple):
    """A column of a study's table: its name, its unit, and what it is of a solution."""

    name: str
    unit: str
    of: Measure | Number


def columns_of(of: Any) -> tuple[Column, ...]:
    """The columns that are asked for: measures or functions, one or several, or a mapping of their names.

    Raises
    ------
    InputError, TypeError
        None, others, or two of one name.
    """
    if isinstance(of, Measure) or callable(of):
        of = (of,)
    named = list(of.items()) if isinstance(of, Mapping) else [(None, each) for each in items("of", of, _EXPECTED)]
    if not named:
        raise InputError(f"of is empty; expected {_EXPECTED}")
    columns = []
    for k, (name, each) in enumerate(named):
        if not isinstance(each, Measure) and not callable(each):
            raise TypeError(f"of[{k if name is None else name!r}] is {each!r}; expected a Measure or a function")
        label = getattr(each, "name" if isinstance(each, Measure) else "__name__", None)
        if label is None and name is None:
            raise InputError(f"of[{k}] is {each!r}, which has no name; expected a mapping of names: of={{'name': ...}}")
        columns.append(Column(text("of", name or label), getattr(each, "unit", ""), each))
    names = [column.name for column in columns]
    for k, label in enumerate(names):
        if label in names[:k]:
            raise InputError(f"of has two measures of the name {label!r}; expected distinct ones: name=, or a mapping")
    return tuple(columns)


_EXPECTED = "a Measure, a function of a solution, several, or a mapping of names to them"


def measured(column: Column, solution: Solution) -> float:
    """The number of a solution.

    Raises
    ------
    InputError
        It is no finite number.
    """
    value = column.of.value(solution) if isinstance(column.of, Measure) else column.of(solution)
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"measure {column.name!r} is {value!r}; expected a number") from None
    if not isfinite(number):
        raise InputError(f"measure {column.name!r} is {number}; expected a finite number")
    return number
