"""How far a whole surface may be from the cylinder, cone, sphere or torus that samples of it lie on.

With S = A / w and d the distance of a point from one of these, the equation of that is F(S) = d G(S) with G not less
than some positive number, or function; w^k F(A / w) is a polynomial, and the quotient of two polynomials is between the
least and the largest quotient of their Bezier points, where those of the denominator are positive:

    cylinder, sphere   |x|^2 - r^2 = (|x| - r) (|x| + r),                               |x| + r >= r
    cone               c^2 rho^2 - s^2 z^2 = (c rho - s z) (c rho + s z),               c rho + s z >= s z
    torus              h^2 + 4 R^2 (z^2 - r^2) = (t - r) (t + r) ((rho + R)^2 + z^2 - r^2),   >= (t - r) r (R^2 - r^2)

with c, s the cosine and sine of the half angle, t the distance from the circle of the tube, and
h = rho^2 - R^2 + z^2 - r^2. Points are taken from one on the surface, so that radii that are much larger than the
surface cost no digits: |x|^2 - r^2 = e.(e + 2 x_0) of x = x_0 + e with |x_0| = r.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.fits import Fit
from assembly.geometry.recognition.nets import Net, bezier_dot

__all__ = ["deviation_of", "local_net", "with_apex_of"]

Array = NDArray[np.float64]
# A cone whose apex is nearer than this, in parts of the surface's size, is measured from there.
_NEAR_APEX = 4.0
# A pole of a cone's net is its apex that is nearer to that than this many tolerances.
_NEAR_POLE = 1e3
# A torus with a tube as wide as this part of its circle would meet its axis.
_WIDEST = 1.0 - 1e-9


def local_net(net: Net, fit: Fit) -> tuple[Array, Array]:
    """Homogeneous coordinates (n, 3, p + 1, q + 1) in the frame of a fit, and weights (n, 1, p + 1, q + 1)."""
    flat = net.pieces.reshape(-1, *net.pieces.shape[2:])
    weights = flat[..., 3:]
    local = (flat[..., :3] - fit.origin * weights) @ fit.axes.T
    return np.moveaxis(local, -1, 1), np.moveaxis(weights, -1, 1)


def _from_base(fit: Fit, point: Array, base: Array) -> Fit:
    """The fit with its first direction across the axis toward a point, and its origin moved by (x, 0, z) there."""
    axes = fit.axes
    if fit.kind == "sphere":
        out = point - fit.origin
        x = out / np.linalg.norm(out)
        other = np.cross(axes[np.argmin(np.abs(axes @ x))], x)
        y = other / np.linalg.norm(other)
        axes = np.stack([x, y, np.cross(x, y)])
    else:
        flat = axes[:2] @ (point - fit.origin)
        c, s = flat / np.linalg.norm(flat)
        axes = np.stack([c * axes[0] + s * axes[1], c * axes[1] - s * axes[0], axes[2]])
    return fit._replace(axes=axes, origin=fit.origin + base @ axes)


def _largest(value: Array, least: Array) -> float:
    """The largest quotient of Bezier points; of denominators that are zero, the values have to be."""
    where = least > 0.0
    if not where.all() and (value[~where] != 0.0).any():
        return np.inf
    return float(np.abs(value[where] / least[where]).max(initial=0.0))


def _beside_circle(net: Net, fit: Fit, point: Array) -> float:
    """Of a cylinder or a sphere."""
    radius = float(fit.shape[0])
    e, w = local_net(net, _from_base(fit, point, np.array([radius, 0.0, 0.0])))
    if fit.kind == "cylinder":
        e = e[:, :2]
    other = e.copy()
    other[:, :1] += 2.0 * radius * w
    return _largest(bezier_dot(e, other), bezier_dot(w, w)) / radius


def with_apex_of(net: Net, fit: Fit, tolerance: float) -> Fit:
    """A cone with its apex at the pole of a net, if that has one: samples tell less of where along the axis it is."""
    points = net.points.reshape(-1, 3)
    away = np.linalg.norm(points - fit.origin, axis=1)
    at_pole = away <= _NEAR_POLE * tolerance
    return fit._replace(origin=points[at_pole].mean(axis=0)) if at_pole.any() else fit


def _beside_cone(net: Net, fit: Fit, point: Array, tolerance: float) -> float:
    c, s = np.cos(fit.shape[0]), np.sin(fit.shape[0])
    slant = (point - fit.origin) @ fit.axes[2] / c
    snapped = 0.0
    if slant > _NEAR_APEX:
        e, w = local_net(net, _from_base(fit, point, slant * np.array([s, 0.0, c])))
    else:
        slant = 0.0
        e, w = local_net(net, fit)
        # Points at the apex are put there: where the denominator is zero, so is the value.
        away = np.linalg.norm(e, axis=1, keepdims=True) / w
        at_apex = away <= tolerance
        snapped = float(away[at_apex].max(initial=0.0))
        e = np.where(at_apex, 0.0, e)
    one = e * np.array([c, c, s])[:, None, None]
    other = one * np.array([1.0, 1.0, -1.0])[:, None, None]
    shift = 2.0 * slant * s * c * w[:, 0]
    other[:, 0] += shift
    other[:, 2] -= shift
    height = s * (e[:, 2:] + slant * c * w)
    return _largest(bezier_dot(one, other), bezier_dot(w, height)) + snapped


def _beside_torus(net: Net, fit: Fit, point: Array) -> float:
    major, minor = float(fit.shape[0]), float(fit.shape[1])
    if not 0.0 < minor < _WIDEST * major:
        return np.inf
    e, w = local_net(net, _from_base(fit, point, np.array([major, 0.0, 0.0])))
    z = e[:, 2:]
    height = np.concatenate([z, w], axis=1)
    tube = bezier_dot(height, np.concatenate([z, -(minor**2) * w], axis=1))
    other = e[:, :2].copy()
    other[:, :1] += 2.0 * major * w
    ww = bezier_dot(w, w)
    h = bezier_dot(e[:, :2], other) + tube
    value = bezier_dot(np.stack([h, 4.0 * major**2 * tube], axis=1), np.stack([h, ww], axis=1))
    return _largest(value, bezier_dot(ww[:, None], ww[:, None])) / (minor * (major**2 - minor**2))


def deviation_of(net: Net, fit: Fit, point: Array, tolerance: float) -> float:
    """No point of the net is farther from the fit than this.

    Parameters
    ----------
    net : Net
    fit : Fit
    point : (3,)
        One of the net, about in its middle and not on the axis.
    tolerance : float
        Points that are so near to the apex of a cone are taken for it.
    """
    if fit.kind == "cone":
        return _beside_cone(net, fit, point, tolerance)
    return _beside_torus(net, fit, point) if fit.kind == "torus" else _beside_circle(net, fit, point)
