"""Curves with a name, each with its bound of the length of arc in closed form where there is one.

With u the bound of Lakshmanan et al. (003, lemma 1),

    length of arc from t0 to t1  <=  u(t0, t1) = sqrt((t1 - t0) (A(t1) - A(t0))),      A' = |C'|^2.

CasADi is loaded when a curve is made. Circles, arcs and polygons are NURBS and need none: `arc`, `circle`, `polygon`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, radians, sin, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from assembly.errors import InputError, extent, integer, number, positive, vector
from assembly.geometry.shapes.plane_curves import arc, circle, polygon
from assembly.geometry.splines.formula_curve import FormulaCurve

if TYPE_CHECKING:
    import casadi as ca

__all__ = [
    "arc",
    "circle",
    "ellipse",
    "epicycloid",
    "euler_spiral",
    "fish",
    "heart",
    "helix",
    "involute",
    "lissajous",
    "polygon",
    "ranunculoid",
]

# What Fresnel's integrals may be off by quadrature and rounding, over the parameter (tests/geometry).
_FRESNEL = 2e-14


def _symbol() -> Any:
    import casadi as ca

    return ca.SX.sym("t")


def _placed(x: ca.SX, y: ca.SX, angle: float, center: ArrayLike) -> Any:
    """Turned by an angle [degrees] about the origin, then moved."""
    import casadi as ca

    turn, (dx, dy) = radians(number("angle", angle)), vector("center", center, 2).tolist()
    if turn == 0.0:
        return ca.vertcat(x + dx, y + dy)
    c, s = cos(turn), sin(turn)
    return ca.vertcat(c * x - s * y + dx, s * x + c * y + dy)


def _bound(antiderivative: Callable[[ca.SX], Any]) -> Callable[[ca.SX, ca.SX], ca.SX]:
    """Lemma 1 from A."""

    def arc_length(t0: ca.SX, t1: ca.SX) -> Any:
        import casadi as ca

        return ca.sqrt((t1 - t0) * (antiderivative(t1) - antiderivative(t0)))

    return arc_length


def heart(size: float = 1.0, *, angle: float = 0.0, center: ArrayLike = (0.0, 0.0)) -> FormulaCurve:
    """The heart curve, size (16 sin^3 t, 13 cos t - 5 cos 2t - 2 cos 3t - cos 4t), t in [0, 2 pi].

    Parameters
    ----------
    size : float
        Positive; 32 sizes wide.
    angle : float
        Turned by [degrees].
    center : (2,)
        Where the origin goes.
    """
    import casadi as ca

    a, t = extent("size", size), _symbol()
    x = 12 * ca.sin(t) - 4 * ca.sin(3 * t)  # 16 sin^3 t
    y = 13 * ca.cos(t) - 5 * ca.cos(2 * t) - 2 * ca.cos(3 * t) - ca.cos(4 * t)
    return FormulaCurve(
        _placed(a * x, a * y, angle, center), t, (0.0, 2 * pi), _bound(_squared_speed(a, _HEART)), name="heart"
    )


# Of C' by frequency: coefficients of cos k t in x' and of sin k t in y'.
_HEART = ({1: 12.0, 3: -12.0}, {1: -13.0, 2: 10.0, 3: 6.0, 4: 4.0})


def _squared_speed(size: float, slopes: tuple[dict[int, float], dict[int, float]]) -> Callable[[ca.SX], Any]:
    """A for x' = size sum c_k cos k t and y' = size sum s_k sin k t."""
    constant = 0.0
    waves: dict[int, float] = {}
    for sign, terms in zip((1.0, -1.0), slopes, strict=True):
        for j, p in terms.items():
            for k, q in terms.items():
                half = 0.5 * p * q
                # cos j cos k = (cos(j - k) + cos(j + k)) / 2; of sines the second term is taken off.
                if j == k:
                    constant += half
                else:
                    waves[abs(j - k)] = waves.get(abs(j - k), 0.0) + half
                waves[j + k] = waves.get(j + k, 0.0) + sign * half

    def antiderivative(t: ca.SX) -> Any:
        import casadi as ca

        total = constant * t
        for k, wave in sorted(waves.items()):
            if wave:
                total = total + (wave / k) * ca.sin(k * t)
        return size * size * total

    return antiderivative


def epicycloid(
    size: float = 1.0, cusps: int = 5, *, angle: float = 0.0, center: ArrayLike = (0.0, 0.0)
) -> FormulaCurve:
    """The path of a point on a circle of radius `size` that rolls around a circle of radius cusps * size.

    size ((k + 1) cos t - cos (k + 1) t, (k + 1) sin t - sin (k + 1) t), t in [0, 2 pi], k = cusps.
    """
    import casadi as ca

    a, k, t = extent("size", size), integer("cusps", cusps, 1, 1000), _symbol()
    n = k + 1
    x, y = n * ca.cos(t) - ca.cos(n * t), n * ca.sin(t) - ca.sin(n * t)

    def antiderivative(s: ca.SX) -> Any:
        # |C'|^2 = 2 n^2 (1 - cos k t).
        return 2.0 * (a * n) ** 2 * (s - ca.sin(k * s) / k)

    return FormulaCurve(
        _placed(a * x, a * y, angle, center), t, (0.0, 2 * pi), _bound(antiderivative), name="epicycloid"
    )


def ranunculoid(size: float = 1.0, *, angle: float = 0.0, center: ArrayLike = (0.0, 0.0)) -> FormulaCurve:
    """The epicycloid with five cusps."""
    return epicycloid(size, 5, angle=angle, center=center)


def ellipse(half_axes: ArrayLike = (2.0, 1.0), *, angle: float = 0.0, center: ArrayLike = (0.0, 0.0)) -> FormulaCurve:
    """The ellipse (a cos t, b sin t), t in [0, 2 pi]."""
    import casadi as ca

    a, b = (extent(f"half_axes[{k}]", x) for k, x in enumerate(vector("half_axes", half_axes, 2).tolist()))
    t = _symbol()

    def antiderivative(s: ca.SX) -> Any:
        return 0.5 * (a * a + b * b) * s + 0.25 * (b * b - a * a) * ca.sin(2 * s)

    expression = _placed(a * ca.cos(t), b * ca.sin(t), angle, center)
    return FormulaCurve(expression, t, (0.0, 2 * pi), _bound(antiderivative), name="ellipse")


def involute(
    size: float = 1.0, end: float = 10.0, *, angle: float = 0.0, center: ArrayLike = (0.0, 0.0)
) -> FormulaCurve:
    """The involute of a circle of radius `size`: size (cos t + t sin t, sin t - t cos t), t in [0, end]."""
    import casadi as ca

    a, last, t = extent("size", size), positive("end", end), _symbol()
    x, y = ca.cos(t) + t * ca.sin(t), ca.sin(t) - t * ca.cos(t)

    def arc_length(t0: ca.SX, t1: ca.SX) -> Any:
        # |C'| = a t: the length itself.
        return 0.5 * a * (t1 - t0) * (t1 + t0)

    return FormulaCurve(_placed(a * x, a * y, angle, center), t, (0.0, last), arc_length, name="involute")


def fish(size: float = 1.0, *, angle: float = 0.0, center: ArrayLike = (0.0, 0.0)) -> FormulaCurve:
    """The fish curve, size (cos t - sin^2 t / sqrt 2, cos t sin t), t in [0, 2 pi]."""
    import casadi as ca

    a, t = extent("size", size), _symbol()
    x, y = ca.cos(t) - ca.sin(t) ** 2 / sqrt(2.0), 0.5 * ca.sin(2 * t)

    def antiderivative(s: ca.SX) -> Any:
        # x' = -sin t - sin 2t / sqrt 2, y' = cos 2t.
        total = 1.25 * s - 0.25 * ca.sin(2 * s) + 0.0625 * ca.sin(4 * s)
        return a * a * (total + sqrt(0.5) * (ca.sin(s) - ca.sin(3 * s) / 3))

    return FormulaCurve(_placed(a * x, a * y, angle, center), t, (0.0, 2 * pi), _bound(antiderivative), name="fish")


def lissajous(
    half_axes: ArrayLike = (1.0, 1.0),
    frequencies: tuple[int, int] = (3, 2),
    phase: float = 0.0,
    *,
    angle: float = 0.0,
    center: ArrayLike = (0.0, 0.0),
) -> FormulaCurve:
    """The Lissajous curve (a sin(p t + phase), b sin(q t)), t in [0, 2 pi]; the phase is in degrees."""
    import casadi as ca

    a, b = vector("half_axes", half_axes, 2).tolist()
    try:
        first, second = frequencies
    except (TypeError, ValueError):
        raise InputError(f"frequencies are {frequencies!r}; expected two integers") from None
    p, q = integer("frequencies[0]", first, 1, 1000), integer("frequencies[1]", second, 1, 1000)
    shift, t = radians(number("phase", phase)), _symbol()

    def antiderivative(s: ca.SX) -> Any:
        along = 0.5 * s + ca.sin(2 * p * s + 2 * shift) / (4 * p)
        across = 0.5 * s + ca.sin(2 * q * s) / (4 * q)
        return (a * p) ** 2 * along + (b * q) ** 2 * across

    expression = _placed(a * ca.sin(p * t + shift), b * ca.sin(q * t), angle, center)
    return FormulaCurve(expression, t, (0.0, 2 * pi), _bound(antiderivative), name="lissajous")


def helix(
    radius: float = 1.0, pitch: float = 1.0, turns: float = 3.0, *, center: ArrayLike = (0.0, 0.0, 0.0)
) -> FormulaCurve:
    """A helix about the z axis: (radius cos t, radius sin t, pitch t / 2 pi), t in [0, 2 pi turns]."""
    import casadi as ca

    r, rise = extent("radius", radius), number("pitch", pitch) / (2 * pi)
    x, y, z = vector("center", center).tolist()
    t = _symbol()
    # Rounded up: it is the length that is vouched for.
    speed = float(np.nextafter(np.hypot(r, rise), np.inf)) * (1 + 1e-15)
    return FormulaCurve(
        ca.vertcat(r * ca.cos(t) + x, r * ca.sin(t) + y, rise * t + z),
        t,
        (0.0, 2 * pi * positive("turns", turns)),
        lambda t0, t1: speed * (t1 - t0),
        name="helix",
    )


def euler_spiral(
    size: float = 1.0, end: float = 2 * pi, *, angle: float = 0.0, center: ArrayLike = (0.0, 0.0)
) -> FormulaCurve:
    """The Euler spiral, size (integral of cos u^2, integral of sin u^2) from 0 to t, t in [-end, end], end up to 2 pi.

    The integrals are a Gauss-Legendre sum, 2e-14 of the size off at most; derivatives are exact.
    """
    import casadi as ca

    a, last, t = extent("size", size), positive("end", end), _symbol()
    if last > 2 * pi:
        raise InputError(f"end is {last:g}; expected at most 2 pi")
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x = y = ca.SX(0)
    for node, weight in zip((0.5 * (nodes + 1)).tolist(), (0.5 * weights).tolist(), strict=True):
        phase = (node * t) ** 2
        x, y = x + weight * ca.cos(phase), y + weight * ca.sin(phase)
    turn = radians(number("angle", angle))
    slope = ca.vertcat(ca.cos(t**2 + turn), ca.sin(t**2 + turn))
    longest = a * (1 + 1e-15)
    return FormulaCurve(
        _placed(a * t * x, a * t * y, angle, center),
        t,
        (-last, last),
        lambda t0, t1: longest * (t1 - t0),
        derivative=a * slope,
        error=_FRESNEL * a,
        name="euler spiral",
    )
