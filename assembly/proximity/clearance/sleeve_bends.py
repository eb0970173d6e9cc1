"""How fast the section of a cylinder or cone by a plane changes while its axis turns: bounds of derivatives.

The axis a turns about a fixed line by the angle w in a unit of time, and moves by no more than w1 itself: |a'| <= w1,
|a''| <= w w1 with w1 <= w. The plane is across the unit vector u of a bore. With t the tangent of the lean, the angle
between a and u, at most, and T = sqrt(1 + t^2), the secant is 1 / (a.u), and

    |(a.u)'| <= w1 t / T,    |(a.u)''| <= w w1.

Every bound here is that of a first derivative over w1, or that of a second one over w w1. They follow from rules for
products, quotients and roots (`docs/derivations.md`, "Cones in sleeves"), and hold for every lean and slope for which
all rulings cross the plane.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel

__all__ = ["axis_bends", "disc_bend", "section_bends"]


@kernel(inline=True)
def axis_bends(t):
    """Bounds of derivatives of the lean s, by how much the axis goes sideways for each unit of height, and of a secant.

    Parameters
    ----------
    t : float
        The tangent of the lean, at most.

    Returns
    -------
    (4,) tuple of float
        Of s' and s''; of the secant's first and second derivative.
    """
    square = 1.0 + t * t
    secant = math.sqrt(square)
    return square, square * (1.0 + 2.0 * t), t * secant, square + 2.0 * t * t * secant


@kernel(inner=True)
def section_bends(t, slope):
    """Bounds of the factor by which the radius of a section is multiplied in its support, and of its derivatives.

    The factor is (S x T + sqrt(D + (1 + S^2) x^2)) / D, with x = v.s for a unit vector v across the bore and D = 1 -
    S^2 t^2. The root is of a number that is at least D, and at most T^2.

    Parameters
    ----------
    t : float
        The tangent of the lean, at most.
    slope : float
        S, by how much it gets wider for each unit of its axis, not negative; with t less than 1.

    Returns
    -------
    (3,) tuple of float
        Of the factor, and of its first and second derivative.
    """
    first, second, secant_first, secant_second = axis_bends(t)
    secant, flat, wide = math.sqrt(1.0 + t * t), slope * slope, 1.0 + slope * slope
    rest = 1.0 - flat * t * t
    # Of the square of the secant, t^2 + 1, and so of D.
    rest_first = 2.0 * flat * secant * secant_first
    rest_second = 2.0 * flat * (secant_first * secant_first + secant * secant_second)
    under_first = rest_first + 2.0 * wide * t * first
    under_second = rest_second + 2.0 * wide * (first * first + t * second)
    root = math.sqrt(rest)
    above = slope * t * secant + secant
    above_first = slope * (first * secant + t * secant_first) + 0.5 * under_first / root
    above_second = slope * (second * secant + 2.0 * first * secant_first + t * secant_second)
    above_second += 0.5 * under_second / root + 0.25 * under_first * under_first / (root * rest)
    factor_first = (above_first + above * rest_first / rest) / rest
    factor_second = (above_second + (2.0 * above_first * rest_first + above * rest_second) / rest) / rest
    factor_second += 2.0 * above * rest_first * rest_first / (rest * rest * rest)
    return above / rest, factor_first, factor_second


@kernel(inline=True)
def disc_bend(sine):
    """A bound of the second derivative of sqrt(1 - x^2), the reach of a disc, for x = N.a with N fixed to the bore.

    Parameters
    ----------
    sine : float
        What |x| is at most, less than 1.
    """
    square = 1.0 - sine * sine
    root = math.sqrt(square)
    return 1.0 / (square * root) + sine / root
