"""Newton's method in a box: a minimum between two bounds, and one of any number of coordinates by shortened steps.

Both are bodies of kernels, made from kernels that evaluate. What these return is a named tuple, which may hold more
than the method asks for and is returned: nobody evaluates again where the method ended.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable
from typing import Any

from assembly._kernel import kernel

__all__ = ["Interval", "Sight", "bracketed_newton", "curve_newton", "damped_newton", "held_in"]

# Bisection alone needs so many steps from any interval to two neighboring doubles of its size, and some.
_BISECTIONS = 80
# A fall of the merit by this part of it is rounding, as is a step that promises no more.
_ROUNDING = 1e-15
_PROMISE = 1e-15
# A curve counts as straight where the curvature of the squared distance is less than this part of its speed's square.
_STRAIGHT = 1e-3
# A step of more than this part of the interval that promises nothing is rounding, where the curve stands still.
_LONG = 1e-3
# Where a parameter may be: held at the ends, or wrapped round.
Interval = namedtuple("Interval", "low high closed")
# A point as a place of a curve sees it (see `curve_newton`).
Sight = namedtuple("Sight", "merit slope curvature square")


def bracketed_newton(evaluate: Callable[..., Any], *, inside: bool, resolution: float = 2e-16) -> Callable[..., Any]:
    """The body of a kernel (problem, low, high, x) -> (x, at): the minimum of a function on [low, high], from x.

    Or the root of a function that rises, which is the slope of another one. Newton's next place where it is between the
    places that are known to be on either side of the minimum, else the middle of these: it converges wherever the slope
    has one sign on either side.

    Parameters
    ----------
    evaluate
        (problem, x) -> at, with at.slope and at.curvature. A curvature that is not positive is not used.
    inside
        Whether the slope is known to be negative at the low end and positive at the high one. Else the minimum may be
        at an end.
    resolution
        A step of no more than this part of x and the interval's width is none.
    """

    def minimum(problem: Any, low: Any, high: Any, x: Any) -> Any:
        below, above = (low, high) if inside else (-math.inf, math.inf)
        left = _BISECTIONS
        while True:
            at = evaluate(problem, x)
            if at.slope > 0.0:
                above = x
            else:
                below = x
            # An end that was not visited is gone to once.
            new = min(max(x - at.slope / at.curvature, low), high) if at.curvature > 0.0 else x
            if not below < new < above:
                new = 0.5 * (max(below, low) + min(above, high))
            ends = at.slope == 0.0 or not below < new < above
            if ends or abs(new - x) <= resolution * max(abs(x), high - low) or left == 0:
                return x, at
            x = new
            left -= 1

    return minimum


def damped_newton(
    evaluate: Callable[..., Any],
    step_from: Callable[..., Any],
    move: Callable[..., Any],
    *,
    steps: int,
    shortenings: int = 12,
    fall: float = 1.0,
) -> Callable[..., Any]:
    """The body of a kernel (problem, x) -> (place, at, last): from x down to a local minimum of a merit, in a box.

    A step is cut to a quarter until the merit falls. Returned are the best place, what is known there, and where the
    next step leads from there, which was not evaluated: where the merit does not tell places apart any more, a step of
    Newton's method still does. It is the best place itself if that step did not lower the merit.

    Parameters
    ----------
    evaluate
        (problem, x) -> at, with at.merit. Places are numbers or tuples, as `move` returns them.
    step_from
        (problem, x, at) -> the step, and whether there is nothing to gain by it.
    move
        (problem, x, part, step) -> the place after a part of a step, held in the box.
    steps
        Places that are evaluated, at most.
    shortenings
        How often in a row a step is cut.
    fall
        A merit of not less than this part of the last one has not fallen.
    """

    def descend(problem: Any, x: Any) -> Any:
        least = math.inf
        for k in range(steps):
            at = evaluate(problem, x)
            if k == 0 or at.merit < fall * least:
                place, known = x, at
                step, done = step_from(problem, x, at)
                stops = not done and at.merit > least * (1.0 - _ROUNDING)
                least = at.merit
                part = 1.0
                failures = 0
            else:
                part *= 0.25
                failures += 1
                stops = failures > shortenings or k == steps - 1
            last = place if stops else move(problem, place, part, step)
            if done or last == place:
                break
            x = last
        return place, known, last

    return descend


@kernel(inline=True)
def held_in(interval, x):
    """A parameter wrapped where the interval is closed, held at its ends elsewhere."""
    low, high = interval.low, interval.high
    if interval.closed and not low <= x <= high:
        x -= (high - low) * math.floor((x - low) / (high - low))
    return min(max(x, low), high)


@kernel(inline=True)
def _step_along(problem, x, at):
    """Newton's step along a curve; where the squared distance is not convex, as if the curve were straight."""
    # A whole turn would lead back.
    width = (0.5 if problem.interval.closed else 1.0) * (problem.interval.high - problem.interval.low)
    curvature = at.curvature if at.curvature > _STRAIGHT * at.square else max(at.square, 1e-300)
    step = min(max(-at.slope / curvature, -width), width)
    done = not at.slope * step < -_PROMISE * at.merit
    return (0.0 if done and abs(step) > _LONG * width else step), done


@kernel(inline=True)
def _move_along(problem, x, part, step):
    return held_in(problem.interval, x + part * step)


def curve_newton(evaluate: Callable[..., Any], *, steps: int) -> Callable[..., Any]:
    """As `damped_newton`, to the nearest place of a curve from x in problem.interval, an `Interval`.

    Parameters
    ----------
    evaluate
        (problem, x) -> at, with the fields of a `Sight`: the merit |d|^2 / 2, d from the point to the curve; its slope
        d.c' and its curvature c'.c' + d.c''; and the square c'.c'. Without c'' the method is Gauss and Newton's.
    """
    return damped_newton(evaluate, _step_along, _move_along, steps=steps)
