"""Measures at all stations as functions of the dimensions, each station from its own solution of the start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.derivatives.response import Response, ResponseError, values_set
from assembly.errors import InputError
from assembly.solve.solution import Solution
from assembly.studies.synthesis.station import Station

__all__ = ["Evaluations", "Evaluated", "drive"]

Array = NDArray[np.float64]


class Evaluated(NamedTuple):
    """Measures (m,) of all stations, one after the other, and their derivatives (m, p) by the dimensions."""

    measures: Array
    rates: Array


class Evaluations:
    """Measures at all stations as functions of the dimensions.

    Stations are solved at the start one from the other. From then on each is solved from its own solution of the start,
    so that values depend on the dimensions alone, and a mechanism stays in the configuration that it has there.

    Attributes
    ----------
    count : int
        Sets of dimensions that were tried.
    failures : list of str
        What was told of those that the scene has no solution with.
    """

    def __init__(
        self,
        scene: Assembly,
        stations: Sequence[Station],
        of: Sequence[Sequence[Measure]],
        parameters: Sequence[Parameter],
    ) -> None:
        self.stations, self._of, self._parameters = stations, of, parameters
        self.count, self.failures = 0, list[str]()
        self._known: dict[bytes, Evaluated | None] = {}
        self._each = []
        for station, solution, measures in zip(stations, drive(scene, stations), of, strict=True):
            with values_set(tuple(station.setting), np.array(list(station.setting.values()))):
                self._each.append(Response(scene, measures, parameters, start=solution))

    def solved(self, values: Array) -> Evaluated | None:
        """At dimensions (p,); None where a station has no solution, or measures no derivatives."""
        key = values.tobytes()
        if key not in self._known:
            self.count += 1
            try:
                self._known[key] = self.at(values)
            except (ResponseError, InputError) as error:
                self.failures.append(str(error))
                self._known[key] = None
        return self._known[key]

    def at(self, values: Array) -> Evaluated:
        """The same, where failures raise."""
        found, rates = [np.empty(0)], [np.empty((0, len(self._parameters)))]
        # Once for all stations: faces that dimensions make are made, and packed, once.
        with values_set(self._parameters, values):
            for station, response in zip(self.stations, self._each, strict=True):
                with values_set(tuple(station.setting), np.array(list(station.setting.values()))):
                    measures, slopes = response.both(values)
                found.append(measures)
                rates.append(slopes)
        return Evaluated(np.concatenate(found), np.concatenate(rates))

    def solved_anew(self, scene: Assembly, values: Array) -> Array:
        """Measures (m,) of stations that are solved one from the other at these dimensions, for a check."""
        with values_set(self._parameters, values):
            solutions = drive(scene, self.stations)
        return np.array([m.value(s) for s, measures in zip(solutions, self._of, strict=True) for m in measures])


def drive(scene: Assembly, stations: Sequence[Station]) -> list[Solution]:
    """Solutions of the stations, each from the one before.

    Raises
    ------
    ResponseError
        One that has none.
    """
    result: list[Solution] = []
    for k, station in enumerate(stations):
        with values_set(tuple(station.setting), np.array(list(station.setting.values()))):
            solution = scene.solve(result[-1] if result else None)
        if not solution.success:
            raise ResponseError(f"the scene has no solution at station {k}; {solution.status.name}: {solution.message}")
        result.append(solution)
    return result
