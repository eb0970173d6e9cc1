"""The parameter at which a curve is nearest to a point, by Newton's method in an interval: steps for `damped_newton`.

A query has the field `interval`, an `Interval`; what is evaluated at a parameter x of the curve c is a `Sight`.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.vec import dot

# A step that promises to lower the merit by no more than this part of it is rounding.
_PROMISE = 1e-15
# A curve counts as straight where the curvature of the squared distance is less than this part of its speed's square.
_STRAIGHT = 1e-3
# A last step longer than this part of the interval, which promises no decrease, is not taken: it is rounding over a
# vanishing speed.
_LONG = 1e-3
# Where a parameter may be: held at the ends, or wrapped round.
Interval = namedtuple("Interval", "low high closed")
# The merit |d|^2 / 2, d from the point to the curve; its slope d.c' and its curvature c'.c' + d.c''; the square c'.c'.
Sight = namedtuple("Sight", "merit slope curvature square")


@kernel(inline=True)
def sight_of(d, first, second):
    """The `Sight` of a point by d and two derivatives; with a second derivative of zero its step is Gauss-Newton's."""
    square = dot(first, first)
    return Sight(0.5 * dot(d, d), dot(d, first), square + dot(d, second), square)


@kernel(inline=True)
def held_in(interval, x):
    """A parameter wrapped where the interval is closed, held at its ends elsewhere."""
    low, high = interval.low, interval.high
    if interval.closed and not low <= x <= high:
        x -= (high - low) * math.floor((x - low) / (high - low))
    return min(max(x, low), high)


@kernel(inline=True)
def step_along(query, x, at):
    """Newton's step along a curve; where the squared distance is not convex, as if the curve were straight."""
    # On a closed curve a step of a whole period would lead back.
    width = (0.5 if query.interval.closed else 1.0) * (query.interval.high - query.interval.low)
    curvature = at.curvature if at.curvature > _STRAIGHT * at.square else max(at.square, 1e-300)
    step = min(max(-at.slope / curvature, -width), width)
    done = not at.slope * step < -_PROMISE * at.merit
    return (0.0 if done and abs(step) > _LONG * width else step), done


@kernel(inline=True)
def move_along(query, x, part, step):
    """The parameter after a part of a step."""
    return held_in(query.interval, x + part * step)
