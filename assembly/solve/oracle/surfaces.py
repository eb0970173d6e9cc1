"""Surfaces and contacts of the reference solver: CasADi's own B-splines, and the rows of an extremal pair."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import BodyFace
from assembly.solve.diagnosis.residual_check import Sides

__all__ = ["Pair", "Patch", "spline_function"]

Array = NDArray[np.float64]
# Samples a direction from which a surface's speed is taken.
_GRID = 17


def spline_function(surface: NurbsSurface) -> ca.Function:
    """(u, v) -> S, Su, Sv by CasADi's own B-splines on homogeneous coordinates, to be differentiated further.

    Closed directions wrap: u - period floor((u - low) / period), whose derivative is one, so nothing ends at the seam.
    """
    # The third derivatives of an exact Hessian want cubics: CasADi 3.8 frees memory twice on those of quadratics.
    raised = surface.elevate([max(3, degree) for degree in surface.degree])
    homogeneous = np.concatenate([raised.control_points * raised.weights[..., None], raised.weights[..., None]], axis=2)
    # CasADi counts the outputs fastest, then u, then v.
    coefficients = np.swapaxes(homogeneous, 0, 1).ravel()
    x = ca.MX.sym("x", 2)
    wrapped = []
    for k, (low, high) in enumerate(surface.domain):
        turns = ca.floor((x[k] - low) / (high - low)) if surface.closed[k] else 0
        wrapped.append(x[k] - (high - low) * turns)
    knots = [knots.tolist() for knots in raised.knots]
    spline = ca.bspline(ca.vertcat(*wrapped), ca.DM(coefficients), knots, list(raised.degree), 4, {})
    point = spline[:3] / spline[3]
    rates = ca.jacobian(point, x)
    return ca.Function("surface", [x], [point, rates[:, 0], rates[:, 1]], ["x"], ["S", "Su", "Sv"])


class Patch:
    """A surface in scaled lengths, with parameters s = (u - low) speed that run at about unit speed."""

    def __init__(self, surface: NurbsSurface, scale: float) -> None:
        self.function = spline_function(surface.transformed(scale=1.0 / scale))
        self.closed = np.array(surface.closed)
        self.low, self.high = np.array(surface.domain).T
        u, v = (np.linspace(low, high, _GRID) for low, high in surface.domain)
        _, su, sv = surface.evaluate(u[:, None], v, 1)
        self.speed = np.array([np.sqrt((rate**2).sum(axis=-1).mean()) for rate in (su, sv)]) / scale
        self.upper = np.where(self.closed, np.inf, (self.high - self.low) * self.speed)
        self.lower = np.where(self.closed, -np.inf, 0.0)

    def expressions(self, s: ca.MX) -> list[ca.MX]:
        """S, Su, Sv at the scaled parameters s."""
        point, su, sv = self.function.call([self.low + s / self.speed], True, False)
        return [point, su / self.speed[0], sv / self.speed[1]]

    def scaled(self, parameters: Array) -> Array:
        """Scaled parameters of the user's."""
        return np.asarray((parameters - self.low) * self.speed)

    def parameters(self, scaled: Array) -> Array:
        """The user's parameters, in the domain."""
        value = self.low + scaled / self.speed
        wrapped = self.low + (value - self.low) % (self.high - self.low)
        return np.asarray(np.where(self.closed, wrapped, np.clip(value, self.low, self.high)))


class Pair(Sides):
    """The rows of one contact."""

    def __init__(self, faces: tuple[BodyFace, BodyFace], bodies: tuple[int, int], patches: tuple[Patch, Patch]) -> None:
        super().__init__(faces, bodies)
        self.patches = patches

    def rows(self, poses: Sequence[ca.MX], turns: Sequence[ca.MX], s: ca.MX) -> ca.MX:
        """Four extremality rows, then the gap; in the axes of f."""
        f, fu, fv = self.patches[0].expressions(s[:2])
        g, gu, gv = self.patches[1].expressions(s[2:])
        (x_f, x_g), (turn_f, turn_g) = ([values[k] for k in self.bodies] for values in (poses, turns))
        turn = turn_f.T @ turn_g
        d = turn_f.T @ (x_g[:3] - x_f[:3]) + turn @ g - f
        n = ca.cross(fu, fv)
        n *= self.faces[0].face.sign / ca.norm_2(n)
        n_g = turn.T @ n
        return ca.vertcat(ca.dot(d, fu), ca.dot(d, fv), ca.dot(n_g, gu), ca.dot(n_g, gv), ca.dot(n, d))

    def scaled(self, parameters: Array) -> Array:
        """The program's variables of the user's parameters."""
        return np.concatenate([p.scaled(x) for p, x in zip(self.patches, parameters.reshape(2, 2), strict=True)])

    def parameters(self, scaled: Array) -> Array:
        """The user's parameters of the program's variables."""
        return np.concatenate([p.parameters(x) for p, x in zip(self.patches, scaled.reshape(2, 2), strict=True)])
