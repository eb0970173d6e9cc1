"""NurbsCurve: a rational B-spline curve in the plane or in space.

    C(t) = sum_i N_i,p(t) w_i P_i / sum_i N_i,p(t) w_i

(Piegl & Tiller, The NURBS Book, equation 4.1), on the domain [knots[p], knots[n]], so that clamped and
unclamped knots both work. It is evaluated from one power table per span (`geometry/splines/evaluate.py`), above degree
15 in Bernstein form (`geometry/splines/bezier_pieces.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import isfinite
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._copies import FoundAgain
from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, check_encodable, integer, is_masked, number, real_array, vector
from assembly.geometry.splines import bezier
from assembly.geometry.splines.bezier_packing import pack_pieces
from assembly.geometry.splines.bezier_pieces import evaluate_pieces
from assembly.geometry.splines.evaluate import CURVE_RECORD, evaluate_curve

__all__ = ["NurbsCurve"]

Array = NDArray[np.float64]
# Positions closer than this part of the size coincide.
COINCIDENT = 1e-12
# Weights of straight lines.
_ONES = np.ones(2)
_ONES.flags.writeable = False


def checked_weights(value: ArrayLike | None, shape: tuple[int, ...]) -> Array:
    """Positive weights of the given shape, read-only; ones where none are given."""
    if value is None:
        ones = np.ones(shape)
        ones.flags.writeable = False
        return ones
    weights = real_array("weights", value, shape)
    # Sums of products with points and with each other are to be finite, and not nothing.
    outside = ~((weights >= 1e-100) & (weights <= 1e100))
    if outside.any():
        where = tuple(int(k) for k in np.argwhere(outside)[0])
        wanted = "positive weights" if weights[where] <= 0.0 else "weights from 1e-100 to 1e+100"
        raise InputError(f"weights[{', '.join(map(str, where))}] is {weights[where]:g}; expected {wanted}")
    weights.flags.writeable = False
    return weights


def checked_name(name: str | None) -> str | None:
    """A name or nothing."""
    if name is not None and not isinstance(name, str):
        raise TypeError(f"name is {name!r}; expected a string or None")
    if name is not None:
        check_encodable("name", name)
    return name


def parameters(name: str, value: ArrayLike) -> Array:
    """Parameters as doubles of any shape; not yet checked against the domain."""
    if is_masked(value):
        raise InputError(f"{name} has masked values; expected real numbers")
    try:
        came = np.asarray(value)
        if came.dtype.kind not in "iuf":
            raise TypeError
        return came.astype(np.float64, copy=False)
    except (TypeError, ValueError):
        raise InputError(f"{name} is {value!r}; expected real numbers") from None


def flat(array: Array) -> Array:
    """One contiguous, writable row, so that kernels are compiled for one type."""
    row = array.ravel()
    return row if row.flags.writeable else row.copy()


def similarity(rotation: ArrayLike | None, translation: ArrayLike, scale: float) -> tuple[Array, Array]:
    """Checked matrix and offset of x -> scale rotation x + translation."""
    matrix = np.eye(3) if rotation is None else real_array("rotation", rotation, (3, 3))
    # 1e-9 forgives a rotation that was printed with ten digits; anything further off is another map.
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-9 or np.linalg.det(matrix) < 0.0:
        raise InputError(f"rotation is {matrix.tolist()}; expected a proper rotation matrix")
    factor = number("scale", scale)
    if factor <= 0.0:
        raise InputError(f"scale is {factor:g}; expected a positive number")
    return factor * matrix, vector("translation", translation)


def checked_table_degree(curve: NurbsCurve) -> None:
    """Raise where a curve's degree is too high for power tables."""
    if curve.degree > bezier.MAX_DEGREE:
        raise InputError(
            f"{curve!r} is of degree {curve.degree}; expected at most {bezier.MAX_DEGREE} for trims and contacts"
        )


class NurbsCurve(FoundAgain, ReadOnlyArrays):
    """A rational B-spline curve.

    Parameters
    ----------
    control_points : (n, d) array
        d = 2 (for example a trim loop in (u, v)) or 3.
    knots : (n + degree + 1,) array
        Nondecreasing; the domain is [knots[degree], knots[n]].
    degree : int
        1 to 50; trims and contacts take curves up to 15.
    weights : (n,) array, optional
        Positive; ones by default.
    name : str, optional

    Attributes
    ----------
    control_points, knots, weights : read-only arrays
    degree : int
    domain : (float, float)
    closed : bool
        The two ends of the domain are one point (to 1e-12 of the size).
    size : float
        Diagonal of the box around the control points.

    Raises
    ------
    ValueError
        Naming the argument that does not fit.
    """

    def __init__(
        self,
        control_points: ArrayLike,
        knots: ArrayLike,
        degree: int,
        weights: ArrayLike | None = None,
        *,
        name: str | None = None,
    ) -> None:
        points = real_array("control_points", control_points, ("n", "d"))
        if points.shape[1] not in (2, 3):
            raise InputError(f"control_points has shape {points.shape}; expected (n, 2) or (n, 3)")
        points.flags.writeable = False
        self.control_points: Array = points
        self.degree: int = bezier.checked_degree("degree", degree, points.shape[0], bezier.MAX_CURVE_DEGREE)
        self.knots: Array = bezier.checked_knots("knots", knots, self.degree, points.shape[0])
        self.weights: Array = checked_weights(weights, points.shape[:1])
        self.name: str | None = checked_name(name)
        self.domain: tuple[float, float] = (float(self.knots[self.degree]), float(self.knots[points.shape[0]]))

    @classmethod
    def bezier(
        cls, control_points: ArrayLike, weights: ArrayLike | None = None, *, name: str | None = None
    ) -> NurbsCurve:
        """The Bezier curve of n control points on [0, 1]: degree n - 1."""
        points = real_array("control_points", control_points, ("n", "d"))
        knots = np.repeat([0.0, 1.0], points.shape[0])
        return cls(points, knots, points.shape[0] - 1, weights, name=name)

    @classmethod
    def polyline(cls, points: ArrayLike, *, name: str | None = None) -> NurbsCurve:
        """Straight segments through n points; point i stands at the parameter i."""
        corners = real_array("points", points, ("n", "d"))
        last = corners.shape[0] - 1.0
        return cls(corners, np.concatenate([[0.0], np.arange(last + 1.0), [last]]), 1, name=name)

    @classmethod
    def _lines(cls, ends: Array, intervals: Sequence[tuple[float, float]], names: Sequence[str]) -> list[NurbsCurve]:
        """Straight lines, checked together.

        Parameters
        ----------
        ends : (n, 2, d)
            Where each begins and ends.
        intervals : n pairs
            Their domains.
        names : of each
        """
        knots = np.repeat(np.array(intervals, dtype=np.float64).reshape(-1, 2), 2, axis=1)
        # A sum may overflow: that is seen where all is checked.
        is_finite = isfinite(sum(ends.ravel().tolist()) + sum(map(sum, intervals)))
        if not (is_finite and all(low < high for low, high in intervals)):
            return [cls(row, turn, 1, name=name) for row, turn, name in zip(ends, knots, names, strict=True)]
        points = np.array(ends, dtype=np.float64, order="C")
        points.flags.writeable = knots.flags.writeable = False
        made = []
        for row, turn, domain, name in zip(points, knots, intervals, names, strict=True):
            line = object.__new__(cls)
            known = {"control_points": row, "degree": 1, "knots": turn, "weights": _ONES, "name": name}
            line.__dict__.update(known, domain=domain, _is_clamped=True)
            made.append(line)
        return made

    def __repr__(self) -> str:
        label = "" if self.name is None else f"{self.name!r}, "
        n, d = self.control_points.shape
        return f"NurbsCurve({label}{n} control points in {d}-D, degree {self.degree}, domain {list(self.domain)})"

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the control points."""
        return float(np.linalg.norm(np.ptp(self.control_points, axis=0)))

    @cached_property
    def closed(self) -> bool:
        """Whether the two ends of the domain are one point."""
        pieces = self.bezier_pieces()
        first, last = pieces[0, 0], pieces[-1, -1]
        gap = np.linalg.norm(first[:-1] / first[-1] - last[:-1] / last[-1])
        return bool(self.size > 0.0 and gap <= COINCIDENT * self.size)

    @cached_property
    def _is_clamped(self) -> bool:
        """Whether its first and last control point are its ends."""
        p, row = self.degree, self.knots
        return bool(row[0] == row[p] and row[-1] == row[-p - 1])

    @property
    def _homogeneous(self) -> Array:
        return np.concatenate([self.control_points * self.weights[:, None], self.weights[:, None]], axis=1)

    def _from_homogeneous(self, points: Array, knots: Array, degree: int) -> NurbsCurve:
        return NurbsCurve(points[:, :-1] / points[:, -1:], knots, degree, points[:, -1], name=self.name)

    def bounding_box(self) -> tuple[Array, Array]:
        """Lower and upper corner, (d,) each, of the control points and so of the curve."""
        return self.control_points.min(axis=0), self.control_points.max(axis=0)

    def breaks(self) -> Array:
        """The distinct knots of the domain."""
        return self._breaks.copy()

    @cached_property
    def _breaks(self) -> Array:
        return bezier.breaks(self.knots, self.degree)

    def bezier_pieces(self) -> Array:
        """Homogeneous Bezier points (w x, w y[, w z], w) of every span: (spans, degree + 1, d + 1)."""
        return self._pieces.copy()

    @cached_property
    def _pieces(self) -> Array:
        return bezier.pieces(self._homogeneous, self.knots, self.degree)

    def insert_knot(self, value: float, times: int = 1) -> NurbsCurve:
        """The same curve with a knot inserted (The NURBS Book, A5.1)."""
        times = integer("times", times, 1, bezier.MAX_CURVE_DEGREE)
        points, knots = bezier.insert(self._homogeneous, self.knots, self.degree, number("value", value), times)
        return self._from_homogeneous(points, knots, self.degree)

    def elevate(self, degree: int) -> NurbsCurve:
        """The same curve in a higher degree; interior knots get full multiplicity."""
        degree = integer("degree", degree, self.degree, bezier.MAX_CURVE_DEGREE)
        raised = bezier.elevation(self.degree, degree) @ self.bezier_pieces()
        return self._from_homogeneous(bezier.joined(raised), bezier.full_knots(self.breaks(), degree), degree)

    def reversed(self) -> NurbsCurve:
        """The same curve run backwards over the same domain."""
        low, high = self.domain
        return NurbsCurve(
            self.control_points[::-1],
            bezier.mirrored(self.knots, low, high),
            self.degree,
            self.weights[::-1],
            name=self.name,
        )

    def transformed(
        self, rotation: ArrayLike | None = None, translation: ArrayLike = (0.0, 0.0, 0.0), scale: float = 1.0
    ) -> NurbsCurve:
        """The curve moved by x -> scale rotation x + translation (3-D curves only)."""
        if self.control_points.shape[1] != 3:
            raise InputError("transformed moves curves in space; this one is plane")
        matrix, offset = similarity(rotation, translation, scale)
        return NurbsCurve(
            self.control_points @ matrix.T + offset, self.knots, self.degree, self.weights, name=self.name
        )

    @cached_property
    def _packed_pieces(self) -> tuple[NDArray[np.int64], Array]:
        """Bezier pieces as certified queries read them (`geometry/splines/bezier_pieces.py`); not to be changed."""
        return pack_pieces(self)

    @cached_property
    def _packed(self) -> tuple[NDArray[np.int64], Array]:
        checked_table_degree(self)
        pieces = self.bezier_pieces()
        at = self.breaks()
        lanes = np.zeros(pieces.shape[:2] + (4,))
        lanes[..., : pieces.shape[2] - 1] = pieces[..., :-1]
        lanes[..., 3] = pieces[..., -1]
        with np.errstate(over="ignore", invalid="ignore"):
            powers = bezier.centered_powers(lanes, at, 1)
        pool = np.concatenate([at, powers.ravel()])
        if not np.isfinite(pool).all():
            raise InputError("knots span a domain too short for doubles at this degree; expected a scale nearer to one")
        record = np.array([self.degree, at.size - 1, 0, at.size, int(self.closed)], dtype=np.int64)
        assert record.size == CURVE_RECORD
        return record, pool

    def packed(self) -> tuple[NDArray[np.int64], Array]:
        """Record and pool of doubles as kernels read them (`geometry/splines/evaluate.py`); not to be changed.

        Offsets in the record count from the start of the pool.
        """
        return self._packed

    @overload
    def evaluate(self, t: ArrayLike, order: Literal[0] = 0) -> Array: ...

    @overload
    def evaluate(self, t: ArrayLike, order: int) -> Any: ...

    def evaluate(self, t: ArrayLike, order: int = 0) -> Any:
        """Points and derivatives.

        Parameters
        ----------
        t : array of any shape
            Parameters in the domain; a closed curve wraps.
        order : 0, 1 or 2

        Returns
        -------
        C, or (C, Ct), or (C, Ct, Ctt), each of shape t.shape + (d,).

        Raises
        ------
        ValueError
            A parameter outside the domain of an open curve, or not finite.
        """
        order = integer("order", order, 0, 2)
        at = parameters("t", t)
        row = flat(at)
        out = np.empty(3 * (order + 1) * at.size)
        if self.degree <= bezier.MAX_DEGREE:
            bad = evaluate_curve(*self._packed, row, order, out)
        else:
            bad = evaluate_pieces(*self._packed_pieces, row, self.closed, order, out)
        if bad >= 0:
            low, high = self.domain
            raise InputError(f"t is {row[bad]}; expected a parameter in the domain [{low:g}, {high:g}]")
        result = out.reshape((order + 1,) + at.shape + (3,))[..., : self.control_points.shape[1]]
        return result[0] if order == 0 else tuple(result)
