"""NurbsSurface: a rational tensor-product B-spline surface.

    S(u, v) = sum_ij N_i,p(u) N_j,q(v) w_ij P_ij / sum_ij N_i,p(u) N_j,q(v) w_ij

(Piegl & Tiller, The NURBS Book, equation 4.11), on the domain [U[p], U[n_u]] x [V[q], V[n_v]], so that
clamped and unclamped knots both work. It is evaluated from one power table per span (`geometry/splines/evaluate.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import sqrt
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._copies import FoundAgain
from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError, integer, number, real_array
from assembly.geometry.splines import bezier
from assembly.geometry.splines.cells import surface_cells
from assembly.geometry.splines.creases import crease_lines
from assembly.geometry.splines.curve import checked_name, checked_weights, flat, parameters, similarity
from assembly.geometry.splines.evaluate import CELL_COUNT, CELLS, SURFACE_RECORD, evaluate_surface
from assembly.geometry.splines.surface_ends import closed_directions, pole_bits, surely_apart

__all__ = ["NurbsSurface"]

Array = NDArray[np.float64]
Domain = tuple[float, float]
# Number of points and derivatives by order.
_QUANTITIES = (1, 3, 6)
# Below this part of the domain from a pole, the limit of the normal is nearer than the quotient.
_POLE = 1e-8
# How far a net of two by two points may be from a parallelogram, in parts of its largest coordinate.
_LINEAR = 1e-13
# Attributes that are kept for the next one who asks, and are no part of copies.
_MADE_AGAIN = ("_whole_face", "_scaled")


def _pair(name: str, value: Any) -> tuple[Any, Any]:
    """The two directions of an argument."""
    if not isinstance(value, (Sequence, np.ndarray)) or isinstance(value, str) or len(value) != 2:
        raise InputError(f"{name} is {value!r}; expected a pair, one for u and one for v")
    return value[0], value[1]


class NurbsSurface(FoundAgain, ReadOnlyArrays):
    """A rational tensor-product B-spline surface. Its outward normal is Su x Sv.

    Parameters
    ----------
    control_points : (n_u, n_v, 3) array
    knots : (U, V)
        (n_u + p + 1,) and (n_v + q + 1,) nondecreasing arrays; the domain is [U[p], U[n_u]] x [V[q], V[n_v]].
    degree : (p, q)
        1 to 15 each.
    weights : (n_u, n_v) array, optional
        Positive; ones by default.
    name : str, optional

    Attributes
    ----------
    control_points, weights : read-only arrays
    knots : pair of read-only arrays
    degree : (int, int)
    domain : ((float, float), (float, float))
    closed : (bool, bool)
        For u and v: the surface comes back to the edge it starts from (to 1e-12 of the size, along the whole
        edge), and that edge is not a single point.
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
        knots: Sequence[ArrayLike],
        degree: Sequence[int],
        weights: ArrayLike | None = None,
        *,
        name: str | None = None,
    ) -> None:
        points = real_array("control_points", control_points, ("n_u", "n_v", 3))
        points.flags.writeable = False
        n, m, _ = points.shape
        p, q = _pair("degree", degree)
        knots_u, knots_v = _pair("knots", knots)
        p = bezier.checked_degree("degree[0]", p, n)
        q = bezier.checked_degree("degree[1]", q, m)
        self.control_points: Array = points
        self.degree: tuple[int, int] = (p, q)
        self.knots: tuple[Array, Array] = (
            bezier.checked_knots("knots[0]", knots_u, p, n),
            bezier.checked_knots("knots[1]", knots_v, q, m),
        )
        self.weights: Array = checked_weights(weights, (n, m))
        self.name: str | None = checked_name(name)
        low, high = self.knots[0][[p, n]], self.knots[1][[q, m]]
        self.domain: tuple[Domain, Domain] = ((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))

    def __repr__(self) -> str:
        label = "" if self.name is None else f"{self.name!r}, "
        n, m, _ = self.control_points.shape
        (a, b), (c, d) = self.domain
        domain = f"[{a:g}, {b:g}] x [{c:g}, {d:g}]"
        return f"NurbsSurface({label}{n} x {m} control points, degree {self.degree}, domain {domain})"

    def __getstate__(self) -> dict[str, Any]:
        # All of it as a face (`whole_face`), and it in another unit, are made again.
        return {name: value for name, value in super().__getstate__().items() if name not in _MADE_AGAIN}

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the control points."""
        low, high = self._box
        across = high - low
        return sqrt(across.dot(across))

    @cached_property
    def closed(self) -> tuple[bool, bool]:
        """Whether u and v come back to the edge they start from."""
        return closed_directions(self)

    @cached_property
    def _apart(self) -> tuple[bool, bool]:
        """Whether ends in u, and in v, are surely at two points."""
        return surely_apart(self)

    @cached_property
    def _periods(self) -> tuple[float, float]:
        """Periods of u and v, 0 where the surface is not closed."""
        (a, b), (c, d) = self.domain
        return (b - a if self.closed[0] else 0.0, d - c if self.closed[1] else 0.0)

    @cached_property
    def _pole_bits(self) -> int:
        """Bits 1, 2, 4, 8: whether the edge at the low and high end of u, then of v, is one point."""
        return pole_bits(self)

    @cached_property
    def is_parallelogram(self) -> bool:
        """Whether (u, v) -> S is linear but for rounding: then lengths in (u, v) are those in space, scaled."""
        net = self.control_points
        if net.shape[:2] != (2, 2) or np.ptp(self.weights) != 0.0:
            return False
        twist = float(np.abs(net[0, 0] - net[1, 0] - net[0, 1] + net[1, 1]).max())
        return twist <= _LINEAR * float(np.abs(net).max())

    @cached_property
    def _creases(self) -> tuple[Array, Array]:
        """Parameters in u and v at which the normal jumps; the low end for a seam where it does."""
        return crease_lines(self)

    @property
    def _homogeneous(self) -> Array:
        return np.concatenate([self.control_points * self.weights[..., None], self.weights[..., None]], axis=2)

    def _from_homogeneous(self, points: Array, knots: Sequence[Array], degree: tuple[int, int]) -> NurbsSurface:
        return NurbsSurface(points[..., :3] / points[..., 3:], knots, degree, points[..., 3], name=self.name)

    def bounding_box(self) -> tuple[Array, Array]:
        """Lower and upper corner, (3,) each, of the control points and so of the surface."""
        low, high = self._box
        return low.copy(), high.copy()

    @cached_property
    def _box(self) -> tuple[Array, Array]:
        """The corners of the bounding box, found once."""
        rows = self.control_points.reshape(-1, 3)
        return np.minimum.reduce(rows), np.maximum.reduce(rows)

    def bounding_sphere(self) -> tuple[Array, float]:
        """Center (3,) and radius of a sphere around the control points and so around the surface."""
        low, high = self.bounding_box()
        center = 0.5 * (low + high)
        radius = float(np.linalg.norm(self.control_points - center, axis=2).max())
        # A few roundings of the coordinates: the sphere must contain, not nearly contain.
        return center, radius + 1e-15 * (radius + float(np.abs(center).max())) * 4.0

    def breaks(self) -> tuple[Array, Array]:
        """The distinct knots of the domain in u and in v."""
        return bezier.breaks(self.knots[0], self.degree[0]), bezier.breaks(self.knots[1], self.degree[1])

    @property
    def _is_clamped(self) -> bool:
        """Whether the domain ends where the knots do, in u and in v."""
        (row, other), (p, q) = self.knots, self.degree
        ends = row[0] == row[p] and row[-1] == row[-1 - p] and other[0] == other[q] and other[-1] == other[-1 - q]
        return bool(ends)

    @cached_property
    def _pieces(self) -> Array:
        if self.weights.shape == (self.degree[0] + 1, self.degree[1] + 1) and self._is_clamped:
            # One span: its control points, a negative zero positive, as in the sums below.
            single = self._homogeneous[None, None] + 0.0
            single.flags.writeable = False
            return single
        in_u = bezier.pieces(self._homogeneous, self.knots[0], self.degree[0])  # (spans_u, p+1, n_v, 4)
        in_v = bezier.pieces(np.moveaxis(in_u, 2, 0), self.knots[1], self.degree[1])  # (spans_v, q+1, spans_u, p+1, 4)
        pieces = np.ascontiguousarray(np.transpose(in_v, (2, 0, 3, 1, 4)))
        pieces.flags.writeable = False
        return pieces

    def bezier_pieces(self) -> Array:
        """Homogeneous Bezier points (w x, w y, w z, w) by spans: (spans_u, spans_v, p + 1, q + 1, 4), read-only."""
        return self._pieces

    def insert_knot(self, direction: int, value: float, times: int = 1) -> NurbsSurface:
        """The same surface with a knot inserted in u (direction 0) or v (1); The NURBS Book, A5.3."""
        direction = integer("direction", direction, 0, 1)
        times = integer("times", times, 1, bezier.MAX_DEGREE)
        turned = np.moveaxis(self._homogeneous, direction, 0)
        points, inserted = bezier.insert(
            turned, self.knots[direction], self.degree[direction], number("value", value), times
        )
        knots = [self.knots[0], self.knots[1]]
        knots[direction] = inserted
        return self._from_homogeneous(np.moveaxis(points, 0, direction), knots, self.degree)

    def elevate(self, degree: Sequence[int]) -> NurbsSurface:
        """The same surface in higher degrees (p, q); interior knots get full multiplicity."""
        p, q = _pair("degree", degree)
        p = integer("degree[0]", p, self.degree[0], bezier.MAX_DEGREE)
        q = integer("degree[1]", q, self.degree[1], bezier.MAX_DEGREE)
        raised = np.einsum(
            "ka,lb,ijabx->jlikx", bezier.elevation(self.degree[0], p), bezier.elevation(self.degree[1], q), self._pieces
        )
        rows = bezier.joined(raised)  # (n_v, spans_u, p + 1, 4)
        points = bezier.joined(np.moveaxis(rows, 0, 2))  # (n_u, n_v, 4)
        at_u, at_v = self.breaks()
        return self._from_homogeneous(points, (bezier.full_knots(at_u, p), bezier.full_knots(at_v, q)), (p, q))

    def reversed(self, direction: int) -> NurbsSurface:
        """The same point set with u (direction 0) or v (1) run backwards; the normal changes sides."""
        direction = integer("direction", direction, 0, 1)
        knots = [self.knots[0], self.knots[1]]
        knots[direction] = bezier.mirrored(knots[direction], *self.domain[direction])
        points, weights = np.flip(self.control_points, direction), np.flip(self.weights, direction)
        return NurbsSurface(points, knots, self.degree, weights, name=self.name)

    def transposed(self) -> NurbsSurface:
        """The same point set with u and v exchanged; the normal changes sides."""
        points = np.swapaxes(self.control_points, 0, 1)
        return NurbsSurface(points, self.knots[::-1], self.degree[::-1], self.weights.T, name=self.name)

    def transformed(
        self, rotation: ArrayLike | None = None, translation: ArrayLike = (0.0, 0.0, 0.0), scale: float = 1.0
    ) -> NurbsSurface:
        """The surface moved by x -> scale rotation x + translation."""
        matrix, offset = similarity(rotation, translation, scale)
        moved = object.__new__(NurbsSurface)
        # Nothing else changes, and that was looked at when this surface was made.
        moved.control_points = real_array(
            "control_points", self.control_points @ matrix.T + offset, self.control_points.shape
        )
        moved.control_points.flags.writeable = False
        moved.degree, moved.knots, moved.weights = self.degree, self.knots, self.weights
        moved.name, moved.domain = self.name, self.domain
        return moved

    def scaled(self, scale: float) -> NurbsSurface:
        """The surface times a scale; the last one is kept, with what is known of it.

        Scenes are packed again in a unit that they had because of other surfaces.
        """
        kept: tuple[float, NurbsSurface] | None = self.__dict__.get("_scaled")
        if kept is None or kept[0] != scale:
            kept = self.__dict__["_scaled"] = scale, self.transformed(scale=scale)
        return kept[1]

    @cached_property
    def _tables(self) -> tuple[NDArray[np.int64], Array]:
        """Record and pool without cells: all that evaluation needs."""
        pieces = self._pieces
        at_u, at_v = self.breaks()
        with np.errstate(over="ignore", invalid="ignore"):
            powers = bezier.centered_powers(pieces, at_u, 2)
            powers = np.swapaxes(bezier.centered_powers(np.swapaxes(powers, 0, 1), at_v, 3), 0, 1)
        p, q = self.degree
        if p <= 3 and q <= 3:
            # Small degrees share the unrolled bicubic path of the evaluator.
            few, powers = powers, np.zeros((*powers.shape[:2], 4, 4, 4))
            powers[:, :, : p + 1, : q + 1] = few
            p, q = 3, 3
        pool = np.concatenate([at_u, at_v, powers.ravel()])
        if not np.isfinite(pool).all():
            raise InputError("knots span a domain too short for doubles at this degree; expected a scale nearer to one")
        breaks_v = at_u.size
        coefficients = breaks_v + at_v.size
        closed_u, closed_v = self.closed
        sizes = [p, q, at_u.size - 1, at_v.size - 1]
        ends = [closed_u, closed_v, 1, pool.size, 0, self._pole_bits]
        record = np.array([*sizes, 0, breaks_v, coefficients, *ends], dtype=np.int64)
        assert record.size == SURFACE_RECORD
        return record, pool

    @cached_property
    def _packed(self) -> tuple[NDArray[np.int64], Array]:
        record, pool = self._tables
        cells = surface_cells(self)
        record = record.copy()
        record[CELLS] = pool.size
        record[CELL_COUNT] = cells.shape[0]
        return record, np.concatenate([pool, cells.ravel()])

    def packed(self) -> tuple[NDArray[np.int64], Array]:
        """Record and pool of doubles as kernels read them (`geometry/splines/evaluate.py`); not to be changed.

        Offsets in the record count from the start of the pool. Behind the power tables stand the bounding
        cells of `geometry/splines/cells.py`.
        """
        return self._packed

    @overload
    def evaluate(self, u: ArrayLike, v: ArrayLike, order: Literal[0] = 0) -> Array: ...

    @overload
    def evaluate(self, u: ArrayLike, v: ArrayLike, order: int) -> Any: ...

    def evaluate(self, u: ArrayLike, v: ArrayLike, order: int = 0) -> Any:
        """Points and derivatives.

        Parameters
        ----------
        u, v : arrays that broadcast
            Parameters in the domain; closed directions wrap.
        order : 0, 1 or 2

        Returns
        -------
        S, or (S, Su, Sv), or (S, Su, Sv, Suu, Suv, Svv), each of the common shape + (3,).

        Raises
        ------
        ValueError
            A parameter outside the domain of an open direction, or not finite.
        """
        order = integer("order", order, 0, 2)
        at_u, at_v = parameters("u", u), parameters("v", v)
        if at_u.shape != at_v.shape:
            try:
                shape = np.broadcast_shapes(at_u.shape, at_v.shape)
            except ValueError:
                raise InputError(
                    f"u and v have shapes {at_u.shape} and {at_v.shape}; expected shapes that broadcast"
                ) from None
            at_u, at_v = np.broadcast_to(at_u, shape), np.broadcast_to(at_v, shape)
        record, pool = self._tables
        row_u, row_v = flat(at_u), flat(at_v)
        out = np.empty(3 * _QUANTITIES[order] * row_u.size)
        bad = evaluate_surface(record, pool, row_u, row_v, order, out)
        if bad >= 0:
            index, direction = divmod(int(bad), 2)
            low, high = self.domain[direction]
            value = (row_u, row_v)[direction][index]
            raise InputError(f"{'uv'[direction]} is {value}; expected a parameter in the domain [{low:g}, {high:g}]")
        result = out.reshape((_QUANTITIES[order],) + at_u.shape + (3,))
        return result[0] if order == 0 else tuple(result)

    def normal(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Unit outward normal Su x Sv / |Su x Sv|, shape of the parameters + (3,).

        At a pole, where Su x Sv vanishes, the limit from inside the domain along the parameter that runs
        into the pole: the first derivative of Su x Sv that way.

        Raises
        ------
        ValueError
            A parameter outside the domain, or a point with no normal (a derivative of Su x Sv vanishes too).
        """
        _, su, sv, suu, suv, svv = self.evaluate(u, v, 2)
        (u0, u1), (v0, v1) = self.domain
        shape = su.shape[:-1]
        inward_u = np.where(np.broadcast_to(u, shape) <= 0.5 * (u0 + u1), u1 - u0, u0 - u1)[..., None]
        inward_v = np.where(np.broadcast_to(v, shape) <= 0.5 * (v0 + v1), v1 - v0, v0 - v1)[..., None]
        normal = np.cross(su, sv)
        inward = inward_u * (np.cross(suu, sv) + np.cross(su, suv)) + inward_v * (np.cross(suv, sv) + np.cross(su, svv))
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        # Below rounding of the products Su x Sv is noise without a direction.
        noise = 1e-14 * np.linalg.norm(su, axis=-1, keepdims=True) * np.linalg.norm(sv, axis=-1, keepdims=True)
        pole = length <= np.maximum(_POLE * np.linalg.norm(inward, axis=-1, keepdims=True), noise)
        normal = np.where(pole, inward, normal)
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        floor = 1e-14 * self.size**2 / ((u1 - u0) * (v1 - v0))
        if (pole & (length <= floor)).any():
            raise InputError("u, v hit a point without a normal: Su x Sv and its derivative into the domain vanish")
        return np.asarray(normal / length)
