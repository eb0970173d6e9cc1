"""What an optimizer needs of a synthesis: residuals, a cost, margins to bounds, and their derivatives.

Dimensions x (p,) are counted in parts of the width of their bounds. Where the greatest of a measure is minimized, one
variable more, s, follows them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from assembly.assembly import Assembly
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.response import ResponseError, values_set
from assembly.errors import InputError, items, number
from assembly.studies.synthesis.evaluations import Evaluated, Evaluations
from assembly.studies.synthesis.station import Station

__all__ = ["Bound", "Goal", "Relation"]

Array = NDArray[np.float64]
Relation = Callable[[Array], tuple[float, Sequence[float]]]
Bound = tuple[Measure | Relation, float | None, float | None]
# How much worse than the last ones, in parts of them, cost and rooms of a step without a solution are.
_WORSE = 1e3
# [parts of a bound's width] What is this near to a bound is at it.
_CLOSE = 1e-7


class _Bounded(NamedTuple):
    """Rows of measures, or a function of the dimensions; and a lower and an upper bound, infinite for none."""

    what: NDArray[np.int64] | Relation
    low: float
    high: float


class Goal:
    """What an optimizer asks of a synthesis.

    Attributes
    ----------
    parameters : tuple of Parameter
    low, width : (p,)
        Their lower bounds, and how far the upper ones are from them.
    evaluations : Evaluations
    rows : (m,) of int
        Which of the measures are wanted to be numbers.
    worst : (k,) of int, or None
        Which of the measures are those whose greatest is minimized.
    relation : function or None
        The function of the dimensions that is minimized; the scene has them meanwhile.
    bounds : list
    count : int
        Measures of all stations.
    """

    def __init__(
        self,
        scene: Assembly,
        minimize: Measure | Relation | Station | Sequence[Station],
        parameters: Mapping[Parameter, tuple[float, float]],
        subject_to: Sequence[Bound],
        stations: Sequence[Station],
    ) -> None:
        self.parameters, self.low, self.width = _dimensions(parameters)
        given = items("subject_to", subject_to, "bounds (what, low, high)")
        measure = minimize if isinstance(minimize, Measure) else None
        self.relation: Relation | None = minimize if callable(minimize) else None
        listed = _stations(minimize, stations)
        asked = [bound[0] for bound in map(_three, given) if isinstance(bound[0], Measure)]
        if self.relation is not None and not asked and not any(station.wanted for station in listed):
            # Nothing is measured.
            listed = ()
        of = [list(station.wanted or {}) + ([measure] if measure else []) + asked for station in listed]
        starts = np.cumsum([0, *map(len, of)])[: len(of)]
        firsts = [at + np.arange(len(station.wanted or {})) for at, station in zip(starts, listed, strict=True)]
        self.count = sum(map(len, of))
        self.rows = np.concatenate([np.empty(0), *firsts]).astype(np.int64)
        self.worst = np.array([at + len(r) for at, r in zip(starts, firsts, strict=True)]) if measure else None
        if measure is not None and len(self.rows):
            raise InputError(
                "stations have wanted values of measures, and minimize is a measure; expected one of the two"
            )
        if self.relation is not None and len(self.rows):
            raise InputError(
                "stations have wanted values of measures, and minimize is a function; expected one of the two"
            )
        if measure is None and self.relation is None and not len(self.rows):
            raise InputError("minimize is stations without wanted values; expected a measure with a value")
        self._wanted = np.array([value for station in listed for value in (station.wanted or {}).values()])
        self._weights = np.concatenate(
            [np.empty(0), *(np.full(len(r), s.weight) for r, s in zip(firsts, listed, strict=True))]
        )
        ends = starts + np.array(list(map(len, of)), dtype=np.int64) - len(asked)
        self.bounds, k = list[_Bounded](), 0
        for bound in map(_three, given):
            low, high = _sides(bound)
            if isinstance(bound[0], Measure):
                self.bounds.append(_Bounded(ends + k, low, high))
                k += 1
            else:
                self.bounds.append(_Bounded(bound[0], low, high))
        self.evaluations = Evaluations(scene, listed, of, self.parameters)
        self.start = (np.array([p.value for p in self.parameters]) - self.low) / self.width
        # What was told last of dimensions with a solution; those of the start have one, or raise.
        self._last = self.evaluations.at(self.values(self.start)), self.start
        self._related: dict[bytes, tuple[float, Array]] = {}

    @property
    def range(self) -> tuple[float | Array, float | Array]:
        """Lower and upper bounds of x and s."""
        if self.worst is None:
            return 0.0, 1.0
        ends = np.zeros(len(self.low)), np.ones(len(self.low))
        return np.append(ends[0], -np.inf), np.append(ends[1], np.inf)

    def values(self, x: Array) -> Array:
        """The dimensions (p,) themselves."""
        result: Array = self.low + x[: len(self.low)] * self.width
        return result

    def differences(self, measures: Array) -> Array:
        """Measures less what is wanted, times weights, (m,)."""
        result: Array = self._weights * (measures[self.rows] - self._wanted)
        return result

    def residuals(self, x: Array) -> Array:
        """The same at x; NaN where there is no solution."""
        known = self._known(x)
        return np.full(len(self.rows), np.nan) if known is None else self.differences(known.measures)

    def residual_rates(self, x: Array) -> Array:
        """Their derivatives by x, (m, p)."""
        rates = self._last_known(x).rates[self.rows]
        return self._weights[:, None] * rates * self.width

    def start_of_search(self) -> Array:
        """Where the optimizer begins: x, and s where there is one."""
        if self.worst is None:
            return self.start
        return np.append(self.start, self._last[0].measures[self.worst].max())

    def cost(self, x: Array) -> tuple[float, Array]:
        """What SLSQP minimizes, and its slopes: half the sum of squares, or s."""
        if self.worst is not None:
            return float(x[-1]), np.append(np.zeros(len(self.low)), 1.0)
        if self.relation is not None:
            return self.related(x)
        known = self._last_known(x)
        left = self.differences(known.measures)
        cost, slopes = 0.5 * float(left @ left), left @ self.residual_rates(x)
        return (cost if self._known(x) is not None else cost + _WORSE * (1.0 + cost)), slopes

    def related(self, x: Array) -> tuple[float, Array]:
        """What the function gives that is minimized, and its slopes; where it has none, worse than all before."""
        assert self.relation is not None
        key = x.tobytes()
        if key not in self._related:
            try:
                with values_set(self.parameters, self.values(x)):
                    value, slopes = _related(self.relation, self.values(x))
                self._related[key] = value, slopes * self.width
            except (ResponseError, InputError) as error:
                if not self._related:
                    raise
                self.evaluations.failures.append(str(error))
                worst = max(cost for cost, _ in self._related.values())
                self._related[key] = worst + _WORSE * (1.0 + abs(worst)), next(reversed(self._related.values()))[1]
        return self._related[key]

    def rooms(self, x: Array) -> Array:
        """What SLSQP holds at zero or more: how far bounds are, and s above each measure."""
        known = self._last_known(x)
        rooms = self._rooms(x, known)[0]
        return rooms if self._known(x) is not None else rooms - _WORSE * (1.0 + np.abs(rooms))

    def room_rates(self, x: Array) -> Array:
        """Their derivatives by x and s."""
        return self._rooms(x, self._last_known(x))[1]

    def passed(self, values: Array, measures: Array) -> float:
        """By how much bounds are passed at most."""
        x = (values - self.low) / self.width
        if self.worst is not None:
            x = np.append(x, measures[self.worst].max())
        rooms = self._rooms(x, Evaluated(measures, np.zeros((len(measures), len(self.low)))))[0]
        return float(np.max(-rooms, initial=0.0)) + 0.0

    def slope_left(self, values: Array) -> float:
        """How far slopes of the cost are from what bounds and rooms at zero balance, in parts of what they are of."""
        x = (values - self.low) / self.width
        known = self.evaluations.solved(values)
        if known is None:
            return np.inf
        sizes = np.ones(len(x))
        if self.worst is not None:
            x, sizes = np.append(x, known.measures[self.worst].max()), np.ones(len(x) + 1)
        elif self.relation is not None:
            sizes *= 1.0 + abs(self.related(x)[0])
        else:
            # Of a sum of squares r.r / 2 slopes are r.J. Residuals are good to what solves leave.
            missing = float(np.linalg.norm(self.differences(known.measures)))
            missing += 0.01 * (1.0 + np.abs(self._wanted).max())
            sizes = missing * np.linalg.norm(self.residual_rates(x), axis=0)
        rooms, rates = self._rooms(x, known)
        walls = np.eye(len(x))[: len(self.low)]
        at_low, at_high = x[: len(self.low)] <= _CLOSE, x[: len(self.low)] >= 1.0 - _CLOSE
        normals = np.concatenate([rates[rooms <= _CLOSE * (1.0 + np.abs(x).max())], walls[at_low], -walls[at_high]])
        slopes = self.cost(x)[1]
        left = slopes - normals.T @ nnls(normals.T, slopes)[0] if len(normals) else slopes
        return float(np.max(np.abs(left) / np.where(sizes > 0.0, sizes, 1.0)))

    def _rooms(self, x: Array, known: Evaluated) -> tuple[Array, Array]:
        """Rooms (r,) and their derivatives by x and s."""
        count = len(self.low)
        rooms, rates = [np.empty(0)], [np.empty((0, len(x)))]
        for bound in self.bounds:
            if callable(bound.what):
                value, slopes = _related(bound.what, self.values(x))
                values, by = np.array([value]), slopes[None, :] * self.width
            else:
                values, by = known.measures[bound.what], known.rates[bound.what] * self.width
            by = np.hstack([by, np.zeros((len(by), len(x) - count))])
            for side, sign in ((bound.low, 1.0), (bound.high, -1.0)):
                if np.isfinite(side):
                    rooms.append(sign * (values - side))
                    rates.append(sign * by)
        if self.worst is not None:
            rooms.append(x[-1] - known.measures[self.worst])
            rates.append(np.hstack([-known.rates[self.worst] * self.width, np.ones((len(self.worst), 1))]))
        return np.concatenate(rooms), np.concatenate(rates)

    def _known(self, x: Array) -> Evaluated | None:
        known = self.evaluations.solved(self.values(x))
        if known is not None:
            self._last = known, x
        return known

    def _last_known(self, x: Array) -> Evaluated:
        """At x, or where there is no solution at the last x that had one."""
        self._known(x)
        return self._last[0]


def _dimensions(parameters: Mapping[Parameter, tuple[float, float]]) -> tuple[tuple[Parameter, ...], Array, Array]:
    """Parameters, their lower bounds, and widths."""
    if not isinstance(parameters, Mapping) or not parameters:
        raise TypeError(f"parameters is {parameters!r}; expected a mapping of Parameter to (low, high)")
    low, high = [], []
    for parameter, sides in parameters.items():
        if not isinstance(parameter, Parameter):
            raise TypeError(f"parameters has the key {parameter!r}; expected a Parameter")
        name = f"parameters[{parameter.name!r}]"
        if len(items(name, sides, "a lower and an upper bound")) != 2:
            raise InputError(f"{name} is {sides!r}; expected a lower and an upper bound")
        low.append(number(f"{name}[0]", sides[0]))
        high.append(number(f"{name}[1]", sides[1]))
        if not low[-1] < high[-1] or not low[-1] <= parameter.value <= high[-1]:
            raise InputError(f"{name} is {sides!r}; expected bounds on either side of {parameter.value:.9g}")
    return tuple(parameters), np.array(low), np.array(high) - np.array(low)


def _stations(
    minimize: Measure | Relation | Station | Sequence[Station], stations: Sequence[Station]
) -> tuple[Station, ...]:
    """Stations of a goal, in order; of a measure alone one where nothing is set."""
    others = items("stations", stations, "several Station")
    if isinstance(minimize, Measure) or callable(minimize):
        listed = others or (Station({}, {}),)
    elif others:
        raise InputError("stations are given beside stations to minimize; expected them with a measure to minimize")
    else:
        listed = (minimize,) if isinstance(minimize, Station) else items("minimize", minimize, "a measure or stations")
    for k, station in enumerate(listed):
        if not isinstance(station, Station):
            raise TypeError(f"station {k} is {station!r}; expected a Station")
    if not listed:
        raise InputError("minimize is empty; expected a measure, or stations")
    return listed


def _three(bound: Bound) -> Bound:
    if not isinstance(bound, tuple) or len(bound) != 3 or not (isinstance(bound[0], Measure) or callable(bound[0])):
        raise InputError(f"subject_to has {bound!r}; expected a measure or a function, a lower and an upper bound")
    return bound


def _sides(bound: Bound) -> tuple[float, float]:
    low = -np.inf if bound[1] is None else number("a lower bound in subject_to", bound[1])
    high = np.inf if bound[2] is None else number("an upper bound in subject_to", bound[2])
    if not low <= high or (np.isinf(low) and np.isinf(high)):
        raise InputError(f"subject_to has the bounds {bound[1:]!r}; expected a lower one and an upper one, or either")
    return low, high


def _related(relation: Relation, values: Array) -> tuple[float, Array]:
    """What a function of the dimensions gives."""
    given = relation(values.copy())
    if not isinstance(given, tuple) or len(given) != 2:
        raise InputError(f"a function in subject_to gave {given!r}; expected a number and its derivatives")
    slopes = np.asarray(given[1], dtype=np.float64)
    if slopes.shape != values.shape or not np.isfinite(slopes).all():
        raise InputError(f"a function in subject_to gave the derivatives {given[1]!r}; expected {len(values)} numbers")
    return number("what a function in subject_to gave", given[0]), slopes
