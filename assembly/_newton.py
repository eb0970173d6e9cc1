"""Newton's method in a box: for one variable with bisection (`bracketed_newton`), for several with shortened steps.

Each function makes the body of a kernel from a kernel that evaluates. The latter returns a named tuple with the fields
the method needs, and maybe more; that of the place found is handed on, so that callers need not evaluate it again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

__all__ = ["bracketed_newton", "damped_newton"]

# Bisection alone needs so many steps from any interval to two neighboring doubles of its size, and some.
_BISECTIONS = 80
# A fall of the merit by this part of it is rounding.
_ROUNDING = 1e-15


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
        The search ends with a step of at most this factor times the larger of |x| and the interval's width.
    """

    def minimum(problem: Any, low: Any, high: Any, x: Any) -> Any:
        below, above = (low, high) if inside else (-math.inf, math.inf)
        left = _BISECTIONS
        while True:
            at = evaluate(problem, x)
            if at.slope == 0.0 or left == 0:
                return x, at
            if at.slope > 0.0:
                if x == low:
                    return x, at
                above = x
            else:
                if x == high:
                    return x, at
                below = x
            new = x - at.slope / at.curvature if at.curvature > 0.0 else x
            # Where Newton leads to an end of the interval or beyond, that end is evaluated once.
            if new <= low and below < low:
                new = low
            elif new >= high and above > high:
                new = high
            elif not below < new < above:
                new = 0.5 * (max(below, low) + min(above, high))
                if not below < new < above:
                    return x, at
            if abs(new - x) <= resolution * max(abs(x), high - low):
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
        A merit has fallen if it is less than this factor times the least one so far.
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
