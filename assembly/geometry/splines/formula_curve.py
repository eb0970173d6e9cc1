"""FormulaCurve: a curve in the plane or in space given by a CasADi expression of its parameter.

    C(t),  t in [a, b]

Points are computed by CasADi's list of instructions, bounds over an interval by the same list on intervals, rounded
outward (`geometry/interval.py`), and derivatives are CasADi's own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from math import inf, isfinite
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, integer, number
from assembly.geometry.expression.formula import (
    FORMULA_POOL,
    FORMULA_RECORD,
    WORK_AT,
    arc_bounds,
    formula_at,
    formula_points,
    formula_ranges,
)
from assembly.geometry.expression.instructions import compact, instructions, packed
from assembly.geometry.expression.rounding import apart, upper_expression
from assembly.geometry.expression.tape import tape_at
from assembly.geometry.splines.curve import COINCIDENT, checked_name, parameters

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["FormulaCurve"]

Array = NDArray[np.float64]
# Points at which a new curve is looked at; intervals by which it is boxed in, how often one is halved of which nothing
# is known, how often for a narrower box, and how many may be halved at a time.
_LOOKS, _BOXES, _HALVINGS, _NARROWINGS, _AT_ONCE = 257, 64, 44, 12, 2048
# Squares of what is below are doubles, and their sums.
LARGEST = 1e100
# Operations whose values may jump.
_JUMPS = frozenset("SIGN COPYSIGN LT LE EQ NE NOT AND OR IF_ELSE_ZERO FLOOR CEIL FMOD REMAINDER ATAN2".split())


class FormulaCurve:
    """A curve C(t) given by a CasADi expression.

    Parameters
    ----------
    expression : casadi.SX, a column of 2 or 3
        Of one symbol. Bounded and continuous on the domain; kinks are allowed, as of `fabs`, and verticals, as of a
        root at an end.
    parameter : casadi.SX
        That symbol.
    domain : (float, float)
        First and last parameter, below 1e100.
    arc_length : callable, optional
        Takes the symbols (t0, t1) and returns an SX expression that is nowhere less than the length of arc from t0 to
        t1, for which you vouch: sqrt((t1 - t0) * (integral of |C'|^2)) is one (Lakshmanan et al., lemma 1). Without
        one the length is bounded by the greatest speed.
    derivative : casadi.SX, optional
        C', where the expression's own derivative is worse, as of an integral that the expression computes by
        quadrature: for this too you vouch.
    error : float
        How far the expression may be off the curve that is meant, in each coordinate.
    name : str, optional

    Attributes
    ----------
    domain : (float, float)
    dimension : int
        2 or 3.
    size : float
        Diagonal of a box around the curve.
    closed : bool
        The two ends are one point (to 1e-12 of the size).

    Raises
    ------
    InputError, TypeError
        No such column, other symbols in it, instructions that are no elementary functions, an empty domain, points
        that are not finite or not below 1e100, or a place about which intervals have no bound of the expression,
        however short they are: a pole, or one that is removable, as of sin(t) / t.
    """

    def __init__(
        self,
        expression: ca.SX,
        parameter: ca.SX,
        domain: Sequence[float],
        arc_length: Callable[[ca.SX, ca.SX], ca.SX] | None = None,
        *,
        derivative: ca.SX | None = None,
        error: float = 0.0,
        name: str | None = None,
    ) -> None:
        self.name: str | None = checked_name(name)
        self.domain: tuple[float, float] = _checked_domain(domain)
        self.error: float = number("error", error)
        if self.error < 0.0:
            raise InputError(f"error is {self.error:g}; expected zero or a positive number")
        column = _checked_column("expression", expression, parameter, (2, 3))
        self.dimension: int = int(column.size1())
        slope = None
        if derivative is not None:
            slope = _checked_column("derivative", derivative, parameter, (self.dimension,))
        self._table, self._pool = _packed_record(
            column, parameter, self.domain, slope, _arc_expression(arc_length, self.domain), self.error
        )
        self._workspace = np.zeros(int(formula_at(self._table, 0).workspace))
        self._has_arc = arc_length is not None
        at = np.linspace(*self.domain, _LOOKS)
        out = np.empty((_LOOKS, 9))
        bad = formula_points(self._table, self._pool, at, out, self._workspace)
        if bad >= 0:
            raise InputError(
                f"expression is {out[bad, : self.dimension].tolist()} at {at[bad]:g}; "
                "expected finite numbers on the domain"
            )
        largest = float(np.abs(out[:, : self.dimension]).max())
        if not largest < LARGEST:
            raise InputError(f"expression reaches {largest:g} on the domain; expected coordinates below {LARGEST:g}")
        self._box = self._boxed_in(out[:, : self.dimension])
        self.closed: bool = bool(np.linalg.norm(out[0, :3] - out[-1, :3]) <= COINCIDENT * max(np.ptp(out[:, :3], 0)))

    def __repr__(self) -> str:
        label = "" if self.name is None else f"{self.name!r}, "
        return f"FormulaCurve({label}{self.dimension}-D, domain {list(self.domain)})"

    @overload
    def evaluate(self, t: ArrayLike, order: Literal[0] = 0) -> Array: ...

    @overload
    def evaluate(self, t: ArrayLike, order: int) -> Any: ...

    def evaluate(self, t: ArrayLike, order: int = 0) -> Any:
        """Points and derivatives.

        Parameters
        ----------
        t : array of any shape
            Parameters in the domain.
        order : 0, 1 or 2

        Returns
        -------
        C, or (C, Ct), or (C, Ct, Ctt), each of shape t.shape + (dimension,).

        Raises
        ------
        InputError
            A parameter outside the domain, or one where a value that was asked for is not finite.
        """
        order = integer("order", order, 0, 2)
        at = parameters("t", t)
        row = np.ascontiguousarray(at).ravel()
        low, high = self.domain
        inside = (row >= low) & (row <= high)
        if not inside.all():
            raise InputError(f"t is {row[~inside][0]}; expected a parameter in the domain [{low:g}, {high:g}]")
        out = np.empty((row.size, 9))
        formula_points(self._table, self._pool, row if row.flags.writeable else row.copy(), out, self._workspace.copy())
        values = out.reshape((*at.shape, 3, 3))[..., : order + 1, : self.dimension]
        finite = np.isfinite(values).all(axis=(-2, -1)).ravel()
        if not finite.all():
            raise InputError(
                f"t is {row[~finite][0]}; expected one where the expression and its derivatives are finite"
            )
        return values[..., 0, :] if order == 0 else tuple(values[..., k, :] for k in range(order + 1))

    def bounds(self, t0: ArrayLike, t1: ArrayLike) -> Array:
        """Boxes that hold C, C', C'' and C''' over intervals, rounding included.

        Parameters
        ----------
        t0, t1 : arrays of one shape
            Ends of the intervals, in the domain, t0 <= t1.

        Returns
        -------
        shape + (4, 2, dimension): by order of the derivative, lower and upper corner. Infinite where no bound is
        known; second derivatives are not known where the expression may have a kink.
        """
        return self._ranges(t0, t1)[0]

    def speed(self, t0: ArrayLike, t1: ArrayLike) -> tuple[Array, Array]:
        """Bounds (lower, upper) of |C'| over intervals [t0, t1], rounding included."""
        box = self.bounds(t0, t1)[..., 1, :, :]
        near = np.where((box[..., 0, :] <= 0.0) & (box[..., 1, :] >= 0.0), 0.0, np.abs(box).min(axis=-2))
        low = np.sqrt((near * near).sum(axis=-1)) * (1.0 - 1e-14)
        return low, np.sqrt((np.abs(box).max(axis=-2) ** 2).sum(axis=-1)) * (1.0 + 1e-14)

    def arc_length_bound(self, t0: ArrayLike, t1: ArrayLike) -> Array:
        """Upper bounds of the length of arc over intervals [t0, t1].

        The user's expression rounded up, or (t1 - t0) times the greatest speed, the smaller of the two.
        """
        boxes, arcs = self._ranges(t0, t1)
        fastest = np.sqrt((np.abs(boxes[..., 1, :, :]).max(axis=-2) ** 2).sum(axis=-1))
        width = (np.asarray(t1) - np.asarray(t0)) * (1.0 + 1e-14)
        return np.asarray(np.fmin(arcs, width * fastest * (1.0 + 1e-14)))

    def _ranges(self, t0: ArrayLike, t1: ArrayLike) -> tuple[Array, Array]:
        first, last = np.broadcast_arrays(parameters("t0", t0), parameters("t1", t1))
        low, high = self.domain
        if not ((first >= low) & (last <= high) & (first <= last)).all():
            raise InputError(f"t0, t1 are {first}, {last}; expected intervals in the domain [{low:g}, {high:g}]")
        out = np.empty((first.size, 43))
        formula_ranges(self._table, self._pool, first.ravel().copy(), last.ravel().copy(), out, self._workspace.copy())
        boxes = out[:, :24].reshape((*first.shape, 4, 3, 2))
        return np.swapaxes(boxes, -1, -2)[..., : self.dimension], out[:, 42].reshape(first.shape)

    def _boxed_in(self, points: Array) -> tuple[Array, Array]:
        """Corners of a box around the curve, from intervals that are halved where nothing is known of it.

        Where a derivative has no bound the curve may be undefined on a part, or have a vertical or a kink, which is
        allowed: halving tells. Intervals that reach far beyond points of the curve are halved, too.
        """
        reach = 0.25 * np.ptp(points, axis=0).max()
        inner, outer = points.min(axis=0) - reach, points.max(axis=0) + reach
        ends = np.linspace(*self.domain, _BOXES + 1)
        first, last = ends[:-1], ends[1:]
        low, high = points.min(axis=0), points.max(axis=0)
        for level in range(_HALVINGS + 1):
            ranges = self.bounds(first, last)
            again = ~np.isfinite(ranges[:, 0]).all(axis=(1, 2))
            if again.any() and (level == _HALVINGS or again.sum() > _AT_ONCE):
                t0, t1 = first[again][0], last[again][0]
                raise InputError(
                    f"expression has no bound between {t0:.17g} and {t1:.17g}: a pole, a gap, or more than intervals "
                    "can tell; expected one that is bounded on the domain"
                )
            rough = ~np.isfinite(ranges).all(axis=(1, 2, 3))
            if level < _NARROWINGS:
                rough |= (ranges[:, 0, 0] < inner).any(axis=1) | (ranges[:, 0, 1] > outer).any(axis=1)
            if level < _HALVINGS and (again | rough).sum() <= _AT_ONCE:
                again |= rough
            low = np.minimum(low, ranges[~again, 0, 0].min(axis=0, initial=np.inf))
            high = np.maximum(high, ranges[~again, 0, 1].max(axis=0, initial=-np.inf))
            if not again.any():
                break
            first, last = first[again], last[again]
            middle = 0.5 * (first + last)
            first, last = np.concatenate([first, middle]), np.concatenate([middle, last])
        return low, high

    def bounding_box(self) -> tuple[Array, Array]:
        """Lower and upper corner, (d,) each, of a box around the curve, rounding included."""
        return self._box

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the curve."""
        low, high = self._box
        return float(np.linalg.norm(high - low))

    def packed(self) -> tuple[NDArray[np.int64], Array]:
        """Record and pool as kernels read them (`geometry/expression/formula.py`); not to be changed."""
        return self._table, self._pool

    def arc_lengths(self, t0: Array, t1: Array) -> Array:
        """The user's bound of the length of arc of intervals, rounded up, without any check."""
        out = np.empty(t0.size)
        arc_bounds(self._table, self._pool, t0, t1, out, self._workspace.copy())
        return out


def _checked_domain(value: Any) -> tuple[float, float]:
    try:
        first, last = (float(x) for x in value)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        raise InputError(f"domain is {value!r}; expected two numbers, the first and the last parameter") from None
    if not (isfinite(first) and isfinite(last) and first < last):
        raise InputError(f"domain is [{first:g}, {last:g}]; expected two finite numbers, the first below the last")
    if not max(-first, last) < LARGEST:
        raise InputError(f"domain is [{first:g}, {last:g}]; expected parameters below {LARGEST:g}")
    return first, last


def _checked_column(what: str, value: Any, parameter: Any, rows: tuple[int, ...]) -> ca.SX:
    """A dense column of the given rows in the parameter alone."""
    import casadi as ca

    if not isinstance(parameter, ca.SX) or not parameter.is_scalar() or not parameter.is_symbolic():
        raise TypeError(f"parameter is {parameter!r}; expected one casadi.SX symbol")
    if not isinstance(value, ca.SX):
        raise TypeError(f"{what} is {value!r}; expected a casadi.SX column")
    if value.size2() != 1 or value.size1() not in rows:
        wanted = " or ".join(map(str, rows))
        raise InputError(f"{what} has shape {value.shape}; expected a column of {wanted} rows")
    free = [s.name() for s in ca.symvar(value) if not ca.is_equal(s, parameter)]
    if free:
        raise InputError(f"{what} has the symbols {free} beside {parameter}; expected the parameter alone")
    return ca.densify(value)


def _arc_expression(arc_length: Any, domain: tuple[float, float]) -> tuple[ca.SX, ca.SX] | None:
    """The two ends as a column, and the bound of the length between them."""
    import casadi as ca

    if arc_length is None:
        return None
    if not callable(arc_length):
        raise TypeError(f"arc_length is {arc_length!r}; expected a callable of two casadi.SX symbols, or None")
    ends = ca.SX.sym("ends", 2)
    try:
        value = arc_length(ends[0], ends[1])
    except (TypeError, NotImplementedError, RuntimeError) as error:  # the latter two are CasADi's
        raise TypeError(
            f"arc_length is {arc_length!r}, which takes no two casadi.SX symbols ({error}); expected a callable of two"
        ) from error
    try:
        bound = ca.SX(value)
    except (TypeError, NotImplementedError, RuntimeError):  # CasADi's words say nothing of the argument
        raise TypeError("arc_length returns no casadi.SX expression; expected one of the two ends") from None
    if not bound.is_scalar():
        raise InputError(f"arc_length returns shape {bound.shape}; expected one number")
    free = [s.name() for s in ca.symvar(bound) if not any(ca.is_equal(s, ends[k]) for k in range(2))]
    if free:
        raise InputError(f"arc_length has the symbols {free} beside the two ends; expected these alone")
    whole = float(ca.Function("arc", [ends], [bound])(domain))
    if not 0.0 <= whole < inf:
        raise InputError(
            f"arc_length is {whole:g} over the domain [{domain[0]:g}, {domain[1]:g}]; expected a finite length"
        )
    return ends, bound


def _packed_record(
    column: ca.SX,
    parameter: ca.SX,
    domain: tuple[float, float],
    slope: ca.SX | None,
    arc: tuple[ca.SX, ca.SX] | None,
    error: float,
) -> tuple[NDArray[np.int64], Array]:
    """The record of `geometry/expression/formula.py`, its tapes behind it, and the pool."""
    import casadi as ca

    def space(values: ca.SX) -> ca.SX:
        return ca.vertcat(values, ca.SX.zeros(3 - values.size1()))

    orders = [column, ca.jacobian(column, parameter) if slope is None else slope]
    for _ in range(2):
        orders.append(ca.jacobian(orders[-1], parameter))
    first = column if slope is None else ca.SX.zeros(column.size1())
    programs = [
        compact("point", parameter, ca.vertcat(*map(space, orders[:3]))),
        compact("range", parameter, ca.vertcat(*map(space, [first, *orders[1:]]))),
    ]
    plain = None
    if arc is not None:
        plain = upper_expression(*arc, domain)
        programs.append(compact("arc", arc[0], arc[1] if plain is None else plain))
    table = [np.zeros(FORMULA_RECORD, dtype=np.int64)]
    pool = [np.array([*domain, error, 0.0, 0.0, 0.0])]
    head = formula_at(table[0], 0)
    head.dimension, head.has_range = column.size1(), slope is None
    head.continuous = not _JUMPS & {name for name, _out, _in in instructions(compact("curve", parameter, column))}
    used, constants, work = FORMULA_RECORD, FORMULA_POOL, 0
    for name, program in zip(("point_tape", "range_tape", "arc_tape"), programs, strict=False):
        tape = packed(program)
        if name == "arc_tape" and plain is not None:
            head.arc_plain = 1
            tape = apart(tape)
        head[name] = used
        row = tape.table.copy()
        tape_at(row, 0).constants = constants
        work = max(work, int(tape_at(row, 0).work))
        table.append(row)
        pool.append(tape.constants)
        used += row.size
        constants += tape.constants.size
    head.workspace = WORK_AT + 2 * work
    return np.concatenate(table), np.concatenate(pool)
