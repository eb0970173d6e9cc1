"""Plans of studies: which numbers of a scene take which values, one row per design."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.derivatives.implicit import several
from assembly.derivatives.parameter import Parameter
from assembly.errors import InputError, integer, items, real_array
from assembly.studies.sweeps.cutting import Run, cut, cut_apart
from assembly.studies.sweeps.order import curve_order, snake_order

__all__ = ["Plan", "as_plan", "grid", "latin_hypercube", "rows", "sobol", "starts"]

Array = NDArray[np.float64]
# A study has no more rows.
MOST_ROWS = 10**9


@dataclass(frozen=True, eq=False)
class Plan(ReadOnlyArrays):
    """Values of parameters, one row per design.

    Attributes
    ----------
    parameters : tuple of Parameter
        The p numbers that are set.
    values : (n, p)
    order : (n,) int
        The rows in the order in which they are solved: neighbors in it are near each other.
    kind : str
        "grid", "sobol", "latin hypercube", "rows" or "starts".
    seed : int or None
        Of what was drawn.
    axes : tuple of arrays
        Of a grid the values of each parameter.
    """

    parameters: tuple[Parameter, ...]
    values: Array
    order: NDArray[np.int64]
    kind: str
    seed: int | None = None
    axes: tuple[Array, ...] = ()

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        names = ", ".join(repr(parameter.name) for parameter in self.parameters)
        return f"Plan({self.kind}, {len(self)} rows{', ' if names else ''}{names})"

    @property
    def names(self) -> list[str]:
        """Of the parameters."""
        return [parameter.name for parameter in self.parameters]

    def runs(self) -> list[Run]:
        """How it is cut."""
        return cut_apart(len(self)) if self.kind == "starts" else cut(self.order)


def grid(axes: Mapping[Parameter, ArrayLike]) -> Plan:
    """Every combination of values; the last parameter varies fastest.

    Parameters
    ----------
    axes : mapping of Parameter -> (k,)
        Values of each, ``np.linspace(1.0, 2.0, 50)`` say.

    Returns
    -------
    Plan

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used.
    """
    parameters = _parameters("axes", axes)
    lines = tuple(_column(f"axes[{p.name!r}]", values) for p, values in axes.items())
    shape = tuple(map(len, lines))
    _count_rows(int(np.prod([float(k) for k in shape])))
    values = np.stack([each.ravel() for each in np.meshgrid(*lines, indexing="ij")], axis=1)
    return Plan(parameters, values, snake_order(shape), "grid", axes=lines)


def sobol(ranges: Mapping[Parameter, ArrayLike], n: int, seed: int = 0) -> Plan:
    """The first `n` points of a scrambled Sobol' sequence: even in all projections; powers of 2 are best.

    Parameters
    ----------
    ranges : mapping of Parameter -> (low, high)
    n : int
    seed : int
        Of the scrambling: the same seed, the same points.

    Returns
    -------
    Plan

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used.
    """
    from scipy.stats.qmc import Sobol

    count = integer("n", n, 1, 2**30)

    def points(dimensions: int, rng: np.random.Generator) -> Array:
        # Of a power of 2 SciPy has nothing to warn of.
        return np.asarray(Sobol(dimensions, rng=rng).random_base2((count - 1).bit_length())[:count])

    return _drawn("sobol", ranges, points, seed)


def latin_hypercube(ranges: Mapping[Parameter, ArrayLike], n: int, seed: int = 0) -> Plan:
    """Points of a Latin hypercube: each of n parts of each parameter's range has one.

    Parameters
    ----------
    ranges : mapping of Parameter -> (low, high)
    n : int
    seed : int
        The same seed, the same points.

    Returns
    -------
    Plan

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used.
    """
    from scipy.stats.qmc import LatinHypercube

    count = integer("n", n, 1, MOST_ROWS)
    return _drawn("latin hypercube", ranges, lambda d, rng: LatinHypercube(d, rng=rng).random(count), seed)


def rows(table: Any, parameters: Parameter | Sequence[Parameter] | None = None) -> Plan:
    """The rows of a table, solved in their order.

    Parameters
    ----------
    table : mapping of Parameter -> (n,), or a table with named columns
        Without `parameters` a mapping of them; with them a structured array, a DataFrame or a mapping of names, or
        (n, p) numbers in the order of the parameters.
    parameters : Parameter or several, optional
        Those of the columns, which have their names; other columns are left out.

    Returns
    -------
    Plan

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used.
    """
    if parameters is None:
        named = _parameters("table", table)
        columns = [_column(f"table[{p.name!r}]", table[p]) for p in named]
    else:
        named = _distinct("parameters", several("parameters", parameters, Parameter))
        if isinstance(table, (np.ndarray, list)) and not getattr(getattr(table, "dtype", None), "names", None):
            columns = list(real_array("table", table, ("n", len(named))).T)
        else:
            columns = [_column(f"table[{p.name!r}]", _named_column(table, p.name)) for p in named]
    counts = {p.name: len(column) for p, column in zip(named, columns, strict=True)}
    if len(set(counts.values())) > 1:
        raise InputError(f"table has columns of different lengths, {counts}; expected one length")
    values = np.stack(columns, axis=1)
    _count_rows(len(values))
    return Plan(named, values, np.arange(len(values), dtype=np.int64), "rows")


def starts(n: int, seed: int = 0) -> Plan:
    """The same scene from `n` starts: the bodies' poses, then random ones, as `Assembly.solve_all` draws them.

    Parameters
    ----------
    n : int
    seed : int
        Of the random starts: row k is the same whatever n is.

    Returns
    -------
    Plan

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used.
    """
    count = integer("n", n, 1, MOST_ROWS)
    integer("seed", seed, 0, 2**63 - 1)
    return Plan((), np.empty((count, 0)), np.arange(count, dtype=np.int64), "starts", int(seed))


def as_plan(plan: Any) -> Plan:
    """A plan, or the rows of an iterable of dictionaries of parameters and values."""
    if isinstance(plan, Plan):
        return plan
    if isinstance(plan, Mapping):
        raise TypeError(f"plan is {plan!r}; expected asm.grid(...) of it, or a list of dictionaries, one for each row")
    if isinstance(plan, (str, bytes)) or not isinstance(plan, Iterable):
        raise TypeError(
            f"plan is {plan!r}; expected asm.grid, asm.sobol, asm.latin_hypercube, asm.rows, asm.starts, or "
            "dictionaries of parameter -> value"
        )
    given = list(plan)
    if not given:
        raise InputError("plan is empty; expected a dictionary of parameter -> value at least")
    for k, row in enumerate(given):
        if not isinstance(row, Mapping):
            raise TypeError(f"plan[{k}] is {row!r}; expected a dictionary of parameter -> value")
    parameters = _parameters("plan[0]", given[0])
    values = np.empty((len(given), len(parameters)))
    for k, row in enumerate(given):
        if len(row) != len(parameters) or any(p not in row for p in parameters):
            raise InputError(f"plan[{k}] has {list(row)}; expected the parameters of plan[0], {list(parameters)}")
        values[k] = _column(f"plan[{k}]", [row[p] for p in parameters])
    return Plan(parameters, values, np.arange(len(values), dtype=np.int64), "rows")


def _drawn(
    kind: str,
    ranges: Mapping[Parameter, ArrayLike],
    points: Callable[[int, np.random.Generator], Array],
    seed: int,
) -> Plan:
    """A plan of points (n, p) of the unit cube, which a number of dimensions and a seeded generator give."""
    parameters, low, high = _ranges(ranges)
    parts = points(len(parameters), np.random.default_rng(integer("seed", seed, 0, 2**63 - 1)))
    return Plan(parameters, low + parts * (high - low), curve_order(parts), kind, int(seed))


def _parameters(name: str, given: Any) -> tuple[Parameter, ...]:
    """The keys of a mapping."""
    if not isinstance(given, Mapping) or not given:
        raise TypeError(f"{name} is {given!r}; expected a mapping of Parameter to values")
    for key in given:
        if not isinstance(key, Parameter):
            raise TypeError(f"{name} has the key {key!r}; expected a Parameter")
    return _distinct(name, tuple(given))


def _distinct(name: str, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    names = [parameter.name for parameter in parameters]
    for k, each in enumerate(names):
        if each in names[:k]:
            raise InputError(f"{name} has two parameters of the name {each!r}; expected distinct ones: name=")
    return parameters


def _column(name: str, values: Any) -> Array:
    """Finite numbers (k,), one at least."""
    if np.ndim(values) == 1 and not len(values):
        raise InputError(f"{name} is empty; expected values, one at least")
    return real_array(name, values, ("k",))


def _named_column(table: Any, name: str) -> Any:
    try:
        return table[name]
    except (KeyError, IndexError, TypeError, ValueError):
        raise InputError(f"table has no column {name!r}; expected one of each parameter's name") from None


def _ranges(ranges: Mapping[Parameter, ArrayLike]) -> tuple[tuple[Parameter, ...], Array, Array]:
    parameters = _parameters("ranges", ranges)
    ends = []
    for parameter, pair in ranges.items():
        column = _column(f"ranges[{parameter.name!r}]", list(items("ranges", pair, "a lower and an upper end")))
        if len(column) != 2 or not column[0] < column[1]:
            raise InputError(f"ranges[{parameter.name!r}] is {pair!r}; expected (low, high), low below high")
        ends.append(column)
    low, high = np.array(ends).T
    return parameters, low, high


def _count_rows(count: int) -> None:
    if count > MOST_ROWS:
        raise InputError(f"the plan has {count} rows; expected {MOST_ROWS} at most")
