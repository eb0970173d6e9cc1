"""A response as a function of CasADi: its values are solves of the scene, its Jacobian is theirs, exactly.

CasADi calls back into Python for both. What raises there ends the call, and an optimizer of CasADi shortens its step
then, as Ipopt does, or ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError

if TYPE_CHECKING:
    from assembly.derivatives.response import Response

__all__ = ["response_function"]

Array = NDArray[np.float64]


def response_function(response: Response, name: str, measures: int, parameters: int) -> ca.Function:
    """The function of values (p, 1) that gives measures (m, 1)."""
    if not ca.Function.check_name(name):
        raise InputError(f"name is {name!r}; expected letters, digits and single underscores, a letter first")
    return _Values(response, name, measures, parameters)


class _Values(ca.Callback):
    """Measures (m, 1) of values (p, 1)."""

    def __init__(self, response: Response, name: str, measures: int, parameters: int) -> None:
        ca.Callback.__init__(self)
        self._response, self._shape = response, (measures, parameters)
        # CasADi has no hold on what is written in Python.
        self._slopes: dict[str, _Slopes] = {}
        self.construct(name, {})

    def get_n_in(self) -> int:
        return 1

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return "values"

    def get_name_out(self, i: int) -> str:
        return "measures"

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._shape[1], 1)

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._shape[0], 1)

    def eval(self, given: Sequence[Any]) -> Sequence[Any]:
        """Measures."""
        return [ca.DM(np.atleast_1d(self._response(_numbers(given[0]))))]

    def has_jacobian(self) -> bool:
        return True

    def get_jacobian(
        self, name: str, inames: Sequence[str], onames: Sequence[str], opts: Mapping[str, Any]
    ) -> ca.Function:
        """The function that gives the Jacobian."""
        if name not in self._slopes:
            self._slopes[name] = _Slopes(self._response, name, self._shape, (inames, onames), opts)
        return self._slopes[name]


class _Slopes(ca.Callback):
    """Derivatives (m, p) at values (p, 1); CasADi gives the measures (m, 1) as well, which are not needed."""

    def __init__(
        self,
        response: Response,
        name: str,
        shape: tuple[int, int],
        names: tuple[Sequence[str], Sequence[str]],
        options: Mapping[str, Any],
    ) -> None:
        ca.Callback.__init__(self)
        self._response, self._shape, self._names = response, shape, names
        self.construct(name, options)

    def get_n_in(self) -> int:
        return 2

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return self._names[0][i]

    def get_name_out(self, i: int) -> str:
        return self._names[1][i]

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._shape[1 - i], 1)

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._shape)

    def eval(self, given: Sequence[Any]) -> Sequence[Any]:
        """Derivatives."""
        rates = self._response.jacobian(_numbers(given[0]))
        return [ca.DM(rates.reshape(self._shape))]


def _numbers(column: Any) -> Array:
    result: Array = column.full().ravel()
    return result
