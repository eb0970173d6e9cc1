"""Measures of a scene as a function of its parameters, with exact derivatives, for optimizers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._turn import Turn, in_turn
from assembly.derivatives.implicit import sensitivity, several, the_scene
from assembly.derivatives.measure import Measure
from assembly.derivatives.parameter import Parameter
from assembly.errors import AssemblyError, InputError, number, text
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    import casadi as ca

    from assembly.assembly import Assembly

__all__ = ["Response", "ResponseError", "values_set"]

Array = NDArray[np.float64]


class ResponseError(AssemblyError, RuntimeError):
    """A response has no value where it was asked for: the scene cannot be solved with these numbers."""


class Refused(InputError):
    """Values of parameters that a scene cannot have."""


@contextmanager
def values_set(parameters: Sequence[Parameter], values: ArrayLike) -> Iterator[None]:
    """Numbers of a scene are others meanwhile. Where one is refused none of them is changed."""
    before = [parameter.value for parameter in parameters]
    try:
        set_values(parameters, np.asarray(values, dtype=np.float64))
        yield
    finally:
        set_values(parameters, np.array(before))


def set_values(parameters: Sequence[Parameter], values: Array) -> None:
    """Set those that differ, in order; but one that another one is in the way of, a limit of a limit, after it."""
    asked = [pair for pair in zip(parameters, values.tolist(), strict=True) if pair[0].value != pair[1]]
    while asked:
        refused, error = [], None
        for parameter, value in asked:
            try:
                parameter.value = value
            except InputError as found:
                refused.append((parameter, value))
                error = error or found
        if error is not None and len(refused) == len(asked):
            raise Refused(str(error)) from error
        asked = refused


class Response:
    """Measures of a scene's solution as a function of numbers of the scene: `f(values)`, `f.jacobian(values)`.

    Each call sets the numbers, solves, and sets back what they were. It starts from one solution always, so that the
    value depends on `values` alone.

    Parameters
    ----------
    scene : Assembly
    of : Measure or several
        Of one measure values are numbers, of several arrays (m,).
    wrt : Parameter or several
        The p numbers that `values` are of.
    start : Solution, optional
        Where each solve starts; by default the scene as it is now is solved.
    follow : bool
        Whether a solve starts from the last one instead: for sweeps along a branch, where values depend on the way.
    penalty : float, optional
        The value of all measures where the scene cannot be solved, or cannot have the values, with a Jacobian of
        zeros; by default that raises.

    Raises
    ------
    InputError, TypeError
        Arguments that cannot be used.
    ResponseError
        The scene cannot be solved as it is now; on a call, with the values given.
    """

    def __init__(
        self,
        scene: Assembly,
        of: Measure | Sequence[Measure],
        wrt: Parameter | Sequence[Parameter],
        *,
        start: Solution | None = None,
        follow: bool = False,
        penalty: float | None = None,
    ) -> None:
        if not isinstance(follow, bool):
            raise InputError(f"follow is {follow!r}; expected True or False")
        self._scene = the_scene(scene)
        self._is_one = isinstance(of, Measure)
        self._of = several("of", of, Measure)
        self._wrt = several("wrt", wrt, Parameter)
        self._penalty = None if penalty is None else number("penalty", penalty)
        self._follow = follow
        if start is not None and not isinstance(start, Solution):
            raise TypeError(f"start is {start!r}; expected a Solution")
        self._start = self._checked(scene.solve() if start is None else start, self.values)
        self._last = self._start
        self.failures = 0

    @property
    def values(self) -> Array:
        """What the parameters are now, (p,): a start for optimizers."""
        return np.array([parameter.value for parameter in self._wrt])

    @property
    def solution(self) -> Solution:
        """The solution of the last call that had one."""
        return self._last

    def __call__(self, values: ArrayLike) -> Array:
        """The measures at values (p,): a number, or (m,)."""
        return self._shaped(self._at(values, with_rates=False)[0])

    def jacobian(self, values: ArrayLike) -> Array:
        """Their derivatives by the parameters: (p,), or (m, p)."""
        return self._shaped(self._at(values, with_rates=True)[1])

    def both(self, values: ArrayLike) -> tuple[Array, Array]:
        """Measures and derivatives of one solve."""
        found, rates = self._at(values, with_rates=True)
        return self._shaped(found), self._shaped(rates)

    def casadi(self, name: str = "response") -> ca.Function:
        """The same as a function of CasADi, of values (p, 1), that gives measures (m, 1), with the exact Jacobian.

        It has no second derivatives: Ipopt takes those of its own (`hessian_approximation` "limited-memory"). Keep it
        as long as what is made of it. What raises in a solve ends the call, and steps of Ipopt are shortened by it.

        Raises
        ------
        InputError
            A name that CasADi cannot have.
        """
        from assembly.derivatives.casadi_response import response_function

        return response_function(self, text("name", name), len(self._of), len(self._wrt))

    def _shaped(self, rows: Array) -> Array:
        return rows[0] if self._is_one else rows

    @property
    def _turn(self) -> Turn:
        """That of its scene."""
        return self._scene._turn

    def _beside(self, is_mine: bool | None) -> Self:
        """The same of what is used beside the scene."""
        other = copy(self)
        other._scene = self._scene._beside(is_mine)
        return other

    @in_turn
    def _at(self, values: ArrayLike, with_rates: bool) -> tuple[Array, Array]:
        """Measures (m,), and derivatives (m, p) where they are asked for."""
        asked = self._asked(values)
        try:
            with values_set(self._wrt, asked):
                solution = self._scene.solve(self._last if self._follow else self._start)
                if solution.success or self._penalty is None:
                    self._last = self._checked(solution, asked)
                    return self._told(solution, asked, with_rates)
        except Refused:
            if self._penalty is None:
                raise
        self.failures += 1
        return np.full(len(self._of), self._penalty), np.zeros((len(self._of), len(self._wrt)))

    def _told(self, solution: Solution, asked: Array, with_rates: bool) -> tuple[Array, Array]:
        """What there is to tell of a solution with the values that are set."""
        found, rates = np.array([m.value(solution) for m in self._of]), np.zeros((len(self._of), len(self._wrt)))
        if with_rates:
            derived = sensitivity(self._scene, solution, self._of, self._wrt)
            rates = derived.matrix.copy()
            if derived.undetermined.any():
                loose = [m.name for m, is_loose in zip(self._of, derived.undetermined, strict=True) if is_loose]
                raise ResponseError(
                    f"measures {loose} change with a motion that the scene leaves free, or are forces that "
                    "redundant rows share"
                )
            if not np.isfinite(rates).all():
                told = "; ".join(f"{name}: {reason}" for name, reason in derived.reasons.items())
                raise ResponseError(f"there is no derivative at {asked.tolist()}; {told or derived}")
        return found, rates

    def _asked(self, values: ArrayLike) -> Array:
        try:
            asked = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            asked = np.empty(0)
        if asked.shape != (len(self._wrt),) or not np.isfinite(asked).all():
            names = ", ".join(parameter.name for parameter in self._wrt)
            raise InputError(f"values are {values!r}; expected {len(self._wrt)} finite numbers: {names}")
        return asked

    def _checked(self, solution: Solution, values: Array) -> Solution:
        if not solution.success:
            told = ", ".join(f"{p.name} = {x:.9g}" for p, x in zip(self._wrt, values.tolist(), strict=True))
            raise ResponseError(f"the scene has no solution with {told}; {solution.status.name}: {solution.message}")
        return solution
