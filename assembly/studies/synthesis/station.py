"""Station: a state to which a mechanism is driven, and the values that measures should have there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.errors import number, positive

__all__ = ["Station"]


@dataclass(frozen=True, eq=False)
class Station:
    """A state that a mechanism is driven to, and what is wanted of it there.

    Parameters
    ----------
    setting : mapping of Parameter -> float
        Driven values, targets and other numbers that are so at this station.
    wanted : mapping of Measure -> float, optional
        What measures are to be there.
    weight : float
        By which differences from what is wanted are multiplied.

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used.
    """

    setting: Mapping[Parameter, float]
    wanted: Mapping[Measure, float] | None = None
    weight: float = 1.0

    def __post_init__(self) -> None:
        for name, given, kind in (("setting", self.setting, Parameter), ("wanted", self.wanted or {}, Measure)):
            if not isinstance(given, Mapping):
                raise TypeError(f"{name} is {given!r}; expected a mapping of {kind.__name__} to numbers")
            for key, value in given.items():
                if not isinstance(key, kind):
                    raise TypeError(f"{name} has the key {key!r}; expected a {kind.__name__}")
                number(f"{name}[{key.name!r}]", value)
        positive("weight", self.weight)
        object.__setattr__(self, "setting", dict(self.setting))
        object.__setattr__(self, "wanted", dict(self.wanted or {}))
